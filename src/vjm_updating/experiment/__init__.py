"""A measurement on a machine: the test sheet, the readings, and what may be wrong with either.

`Measurement` puts a sheet, its readings and the nominal chain together; calibration and diagnosis start from it.
"""

from vjm_updating.experiment.measured import Kind, Measurement, Nuisance
from vjm_updating.experiment.measurement import read_measurement
from vjm_updating.experiment.readings import Readings, read_readings
from vjm_updating.experiment.sheet import Instrument, Sheet, read_sheet

__all__ = [
    "Instrument",
    "Kind",
    "Measurement",
    "Nuisance",
    "Readings",
    "Sheet",
    "read_measurement",
    "read_readings",
    "read_sheet",
]
