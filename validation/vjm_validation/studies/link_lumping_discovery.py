"""The suite's own discovery: finite elements' data under a sheet with one spring per link, diagnosed.

Exudyn's beams are pulled and pushed in posture A, as `vjm_updating.simulate` makes readings. The sheet says the
paper's model. `vjm_updating.diagnosis` reads the two files and nothing else.
"""

from __future__ import annotations

from pathlib import Path as FilePath

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine, engine_by_name
from vjm.io.files import write_whole
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating import diagnose, load_data
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.experiment import read_measurement
from vjm_updating.mechanisms.modified_chain import ModifiedMachine
from vjm_updating.result import EXTENDED
from vjm_updating.simulate import DATA, SHEET, Truth, simulate
from vjm_validation.studies.chain import CAUSE, Discovery, DiscoveryStudy

MODEL, POSTURE = "orthoglide-chain", "A"
PULL, PUSH = 1.2, 2.4
"""mm: past where the paper's model buckles in tension, short of where beams buckle in compression."""
FURTHER = 3.4
"""mm of compression to which the models are taken: past all critical points."""
SEED = 31
HALVES = {"cycle 1": "tension", "cycle 2": "compression"}
"""What the test's two ramps are, each held out once."""
SHEET_TEXT = """\
[test]
title = "finite elements, posture A"
model = "orthoglide-chain"
control = "displacement"

[model]
link_segments = 1
foot_segments = 8

[postures]
A = [0.0, 0.0, 0.0, 0.0]

[instrument.ux_mm]
noise = 0.0005
zero = 0.002
scale = 0.001

[instrument.fx_N]
noise = 2.0
zero = 3.0
scale = 0.003

[instrument.fz_N]
noise = 2.0
zero = 3.0
scale = 0.003

[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
"""


def write_data(folder: FilePath, seed: int = SEED) -> Truth:
    """Write the sheet and the readings of finite elements, and what was drawn within the sheet's tolerances.

    Raises:
        vjm.errors.NoConvergenceError: the beams do not stand at the readings.
    """
    write_whole(folder / SHEET, SHEET_TEXT)
    ramps = [f"{POSTURE}:{PULL}", f"{POSTURE}:{-PUSH}"]
    return simulate(MODEL, folder / SHEET, folder, hide=[CAUSE], seed=seed, ramps=ramps, engine="exudyn")


def study(out: FilePath) -> DiscoveryStudy:
    """Make the data, diagnose them, and take both models along the test and beyond.

    Args:
        out: the run's folder; the files go to ``discovery`` in it.
    """
    folder = out / "discovery"
    truth = write_data(folder)
    data, sheet = folder / DATA, folder / SHEET
    diagnosed = diagnose(load_data(data, sheet))
    diagnosed.write(folder)
    diagnosis = diagnosed.figures
    assert isinstance(diagnosis, Diagnosis)  # the sheet is one of ramps
    measurement = read_measurement(data, sheet)
    extended = load_chain(folder / EXTENDED)
    models = (measurement.engine, measurement.chain), (engine_by_name("vjm", chain=extended), extended)
    nominal, longer = (
        (engine.trace(chain, LoadCase(POSTURE, PULL + 0.1)), engine.trace(chain, LoadCase(POSTURE, -FURTHER)))
        for engine, chain in models
    )
    readings = measurement.readings
    return DiscoveryStudy(
        _rows(diagnosis, _critical_force(measurement.chain, truth)),
        f"{folder.name}/diagnosis.html",
        readings.values["ux_mm"],
        readings.values["fx_N"],
        nominal,
        longer,
    )


def _critical_force(chain: Machine, truth: Truth) -> float | None:
    """Critical force in compression of the finite elements that made the data, with the parts that were drawn."""
    drawn = ModifiedMachine(chain, VjmEngine())
    for name, value in truth.nuisances.items():
        kind, _, part = name.partition(" ")
        if kind == "length":
            drawn = drawn.longer(part, value)
        elif kind == "modulus":
            drawn = drawn.times(part, 1.0 / (1.0 + value))
    event = ExudynEngine().trace(drawn.chain(), LoadCase(POSTURE, -FURTHER)).critical
    return event.force if event is not None and event.kind is EventKind.BIFURCATION else None


def _rows(diagnosis: Diagnosis, truth: float | None) -> Discovery:
    return Discovery(
        verdict=diagnosis.verdict,
        causes=diagnosis.causes,
        confidence=diagnosis.confidence,
        held_out=[
            fold.model_copy(update={"name": HALVES.get(fold.name, fold.name)})
            for fold in (diagnosis.gain.folds if diagnosis.gain is not None else [])
        ],
        critical=diagnosis.critical,
        truth_N=truth,
        readings=diagnosis.noise.readings if diagnosis.noise is not None else 0,
        seconds=diagnosis.seconds,
    )
