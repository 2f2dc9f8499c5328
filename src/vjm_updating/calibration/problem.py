"""What a calibration looks for in which readings, and the forward model of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from vjm.vjm_engine import VjmEngine
from vjm_updating.calibration.of_unknowns import OfUnknowns
from vjm_updating.calibration.parameters import Unknowns, default_parameters, unknowns
from vjm_updating.experiment import Kind, Measurement
from vjm_updating.frequencies.forward import FrequencyForward
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.observation.observed import Observed, observe_loads


@dataclass
class CalibratedForward(OfUnknowns, Forward):
    """Predicts readings by a machine with other parameters."""

    def reading(self, observed: Observed) -> CalibratedForward:
        """The same for other readings of the same test."""
        return replace(self, observed=observed, branches=dict(self.branches))


@dataclass
class CalibratedLoads(OfUnknowns, LoadForward):
    """Predicts what gauges read under loads on a machine with other parameters.

    A modulus acts on what of its beam is not looked for.
    """

    whole_beams: ClassVar[bool] = False


Calibrated = CalibratedForward | CalibratedLoads | FrequencyForward
"""What predicts the readings of a calibration, by its kind of test."""


@dataclass(frozen=True)
class CalibrationProblem:
    """What is to be fitted, to what.

    Attributes:
        unknowns: of the fit.
        observed: the readings, displacements as they were imposed.
        by_default: whether nobody said what to look for.
        promised: beams that are not looked for, because readings do not tell them from other parts: of them counts
            what the sheet promises.
    """

    unknowns: Unknowns
    observed: Observed
    by_default: bool = False
    promised: tuple[str, ...] = ()

    @property
    def engine(self) -> VjmEngine:
        """Of the lumped model."""
        return self.observed.measurement.engine

    def forward(self, observed: Observed) -> Calibrated:
        """The model at readings of this test, or at such as could be taken next."""
        if observed.measurement.loaded:
            return CalibratedLoads(observed, unknowns=self.unknowns)
        return CalibratedForward(observed, at_readings=True, unknowns=self.unknowns)


def problem_of(measurement: Measurement, names: Sequence[str] = ()) -> CalibrationProblem:
    """The calibration of a measurement.

    Args:
        measurement: sheet, readings and nominal machine.
        names: parameters to look for, see `vjm_updating.calibration.parameters.unknowns`; one factor for every
            elastic part by default.

    Raises:
        ValueError: the data are of a kind that cannot be calibrated with, or a parameter means nothing.
    """
    engine, chain = measurement.engine, measurement.chain
    observed = observe_loads(measurement) if measurement.loaded else observe_ramps(measurement)
    found = unknowns(chain, engine, names or default_parameters(engine, chain), measurement.nuisances)
    count = int(observed.present.sum())
    if count <= found.parameters:
        raise ValueError(
            f"{observed.readings.file}: {count} readings for {found.parameters} parameters: "
            "look for fewer of them, or read more"
        )
    return CalibrationProblem(found, observed, by_default=not names)


def with_promises(problem: CalibrationProblem) -> CalibrationProblem | None:
    """The same with each beam as the sheet promises it; None where the sheet promises none, or nothing is left.

    For readings that do not tell a beam from the joint or mount that carries it: of the beam more is known.
    """
    observed, engine = problem.observed, problem.engine
    measurement, chain = observed.measurement, observed.measurement.chain
    promised = {n.subject for n in measurement.nuisances if n.kind is Kind.MODULUS}
    names = [f"{beam.name}.factor" for beam in chain.beams if beam.name in promised]
    left = [name for name in default_parameters(engine, chain) if name not in names]
    if not problem.by_default or not names or not left:
        return None
    found = unknowns(chain, engine, left, measurement.nuisances)
    return CalibrationProblem(found, observed, promised=tuple(name.partition(".")[0] for name in names))
