"""Calibration by a test of one joint: its spring, backlash and friction together.

All are looked for, whether or not a diagnosis would name them: a size that the readings do not need has an interval
that reaches nothing. The spring hardens, or has the three slopes of a strain wave gear: the law that the model has
for the joint, else three slopes where the readings leave no doubt of them. Backlash is left out where the loads go
to one side only. The scales and zeros of cell and gauge are nuisances under the sheet's priors, so that a stiffness
is known no better than the cell's scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding
from vjm.model.laws import StrainWave
from vjm.rotations import Array
from vjm_updating.calibration.calibrated_model import extended_document, model_text
from vjm_updating.calibration.document import Calibration, IdentifiabilityRow, ParameterRow
from vjm_updating.calibration.fit import MISFIT, Solution, spread_of
from vjm_updating.calibration.run import (
    beyond_tolerance,
    finished,
    fit_row,
    header,
    matrix_row,
    nuisance_rows,
)
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.diagnosis.evidence import covariance_of, criterion, effective_samples, estimates
from vjm_updating.diagnosis.kinds import JointTest, joint_effects, not_reached, together
from vjm_updating.diagnosis.preprocess import Prepared, prepare
from vjm_updating.diagnosis.search import RIVAL
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.comparison import channels_of, levers_of, one_sided
from vjm_updating.inference.bounded_normal import inverse
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem
from vjm_updating.inference.joint_forward import JointCompliance, JointForward, JointHardening, JointThreeSlopes
from vjm_updating.inference.parameters import uncertain
from vjm_updating.inference.refit import begun_anew, refit
from vjm_updating.mechanisms.contacts import ActuatorBacklash
from vjm_updating.mechanisms.effect import Effect, part_table
from vjm_updating.result import CalibrationResult

KINK = numerical(3)
"""Number of the first kink's torque among the quantities of three slopes."""
NOTHING = numerical(1e-3)
"""Of a standard deviation, up to which a size at its bound is nothing."""


@dataclass(frozen=True)
class JointSolution(Solution):
    """The laws of a joint that were found; what they leave beyond the sheet's noise widens the uncertainties."""

    @cached_property
    def spread(self) -> Array:
        """Of the residuals after the fit."""
        return spread_of(self.fitter, self.fit, self.fit.free)

    @cached_property
    def covariance(self) -> Array:
        """Of the fit's z ``(n_z, n_z)``."""
        return covariance_of(self.fitter, self.fit)


def calibrate_joint(
    measurement: Measurement,
    considered: Callable[[], list[Finding]],
    *,
    force: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:
    """Calibrate a joint by a sheet of ``kind = "joint"``; arguments and errors as of `vjm_updating.calibrate`.

    ``considered`` says what is implausible about the test.
    """
    findings = considered()
    kind = JointTest()
    observed = kind.observe(measurement)
    progress("the nominal joint")
    prepared = prepare(observed)
    progress("spring, backlash and friction")
    fit = _fitted(prepared, kind)
    forward = prepared.fitter.forward.reading(prepared.all)
    assert isinstance(forward, JointForward)
    document = _document(measurement, JointSolution(prepared.all, forward, prepared.fitter, fit))
    return finished(document, _model(measurement, prepared.fitter, fit, document), findings, force=force)


def _fitted(prepared: Prepared, kind: JointTest) -> Fit:
    """All of the joint's laws together, outliers and autocorrelation found about them."""
    fitter = prepared.fitter
    own = joint_effects(fitter.forward.observed)
    stated = isinstance(prepared.all.measurement.drive.law, StrainWave)
    springs = [e for e in own if isinstance(e, JointThreeSlopes) or (isinstance(e, JointHardening) and not stated)]
    # a spring of another law has a compliance of its own
    beside = [e for e in own if not isinstance(e, JointCompliance | JointHardening | JointThreeSlopes)]
    best: tuple[float, Fit] | None = None
    for spring in springs:
        first = together(fitter, prepared.null, [spring, *beside])
        if first is None:
            continue
        fit = begun_anew(fitter, first)
        if best is None:
            fit = refit(fitter, kind.without_outliers, prepared.all, fit)
        elif fit.values[0][KINK] >= spring.quantities()[KINK].high:
            # no reading reached its first kink
            continue
        samples = effective_samples(fitter.whitening.autoregression, fitter.whitening.present)
        # a spring that is straight is one or the other in disguise
        cost = criterion(fitter, fit, own, samples, replace(kind.costs, disguised=0.0))
        number = int(fitter.whitening.present.sum())
        noise_alone = fitter.squares(fit.parameters, fit.evaluation) < number + MISFIT * np.sqrt(2.0 * number)
        # a straight spring is both: only what readings leave no doubt of has three slopes
        if best is None or (noise_alone and cost < best[0] - RIVAL):
            best = cost, fit
    if best is None:
        raise NoConvergenceError(f"{prepared.all.readings.file}: the joint's laws do not reach the readings")
    # about the law that was chosen others may be outliers
    fit = refit(fitter, kind.without_outliers, prepared.all, best[1])
    known = np.diag(prepared.fitter.normal(fit))
    for coordinate, information in zip(fit.parameters, known, strict=True):
        if coordinate.sigma != 0.0 and not information > 0.0:
            raise NoConvergenceError(
                f"{prepared.all.readings.file}: the readings do not change with {coordinate.name}: load the joint "
                "further, or in both directions"
            )
    return fit


def _document(measurement: Measurement, solution: JointSolution) -> Calibration:
    fit, nuisances = solution.fit, nuisance_rows(solution)
    values = estimates(solution.fitter, fit)
    beyond = not_reached(solution.everything, values)
    guessed = "The second kink of its slopes was not reached: K3 and T2 are as catalogues have them."
    # each coordinate in its own unit
    own = [i for i, c in enumerate(fit.parameters) if c.sigma != 0.0]
    slopes = np.array([fit.parameters[i].slope(float(solution.z[i])) for i in own])
    C = inverse(solution.fitter.normal(fit), uncertain(fit.parameters))[np.ix_(own, own)]
    return Calibration(
        **header(measurement),
        fit=fit_row(solution),
        parameters=_parameters(measurement, {n: v for n, v in values.items() if n not in beyond}),
        nuisances=nuisances,
        joint=matrix_row([fit.parameters[i].name for i in own], slopes[:, None] * C * slopes),
        identifiability=IdentifiabilityRow(
            statement=[
                _seen(measurement),
                *([guessed] if beyond else []),
                "The stiffness is known no better than the scales of cell and gauge, which count with the sheet's "
                "tolerances.",
                *beyond_tolerance(nuisances),
            ],
        ),
    )


def _seen(measurement: Measurement) -> str:
    joint = measurement.drive.name
    if one_sided(measurement):
        return f"Loads to one side see {joint}'s spring and friction; its backlash they cannot know."
    return f"Loads in both directions see {joint}'s spring, backlash and friction."


def _largest(measurement: Measurement) -> float:
    """Largest load of a test on the joint, N mm, or N where it slides."""
    lever, _, of_load = levers_of(measurement)
    _, effort = channels_of(measurement)
    return lever * float(np.nanmax(np.abs(measurement.readings.values[effort]))) / of_load


def _parameters(measurement: Measurement, values: Mapping[str, ValueRow]) -> list[ParameterRow]:
    """Stiffnesses, hardening, backlash and friction; what shapes their laws is not among them."""
    joint = measurement.drive
    nominal = 1.0 / joint.compliance if joint.law is None else joint.law.rest_stiffness
    ratio = 1.0 if joint.law is None else joint.law.tangent(joint.law.deflection(_largest(measurement))) / nominal
    turns = not joint.slides
    soft, gap, slip = (
        ("compliance_rad_per_Nmm", "gap_rad", "torque_Nmm")
        if turns
        else ("compliance_mm_per_N", "gap_mm", "force_N")
    )
    stiffness, moment = ("N mm/rad", "N mm") if turns else ("N/mm", "N")
    rows: list[tuple[str, str, float, ValueRow]] = []
    if f"actuator_hardening.{soft}" in values:
        c = values[f"actuator_hardening.{soft}"]
        ends = [1.0 / max(c.high, 1e-300), 1.0 / max(c.low, 1e-300)]
        stiff = ValueRow(value=1.0 / c.value, std=c.std / c.value**2, interval95=ends)
        rows += [
            ("stiffness", stiffness, nominal, stiff),
            ("stiffness_ratio", "1", float(ratio), values["actuator_hardening.stiffness_ratio"]),
        ]
    else:
        before = joint.law.numbers() if isinstance(joint.law, StrainWave) else {}
        for name, key in StrainWave.keys(slides=joint.slides).items():
            if (own := values.get(f"{JointThreeSlopes.cause}.{key}")) is not None:
                of_torque = name in ("T1", "T2")
                # of another law the slope at no load alone is drawn
                drawn = before.get(name, nominal if name == "K1" or (joint.law is None and not of_torque) else 0.0)
                rows.append((name, moment if of_torque else stiffness, drawn, own))
    lost = values.get(f"actuator_backlash.{gap}")
    rows += [
        *([] if lost is None else [("backlash", "rad" if turns else "mm", 0.0, lost)]),
        ("friction", moment, 0.0, values[f"joint_friction.{slip}"]),
    ]
    return [
        ParameterRow(
            name=f"{joint.name}.{name}",
            unit=unit,
            nominal=before,
            value=e.value,
            std=e.std,
            # a size is not negative, whatever its error
            interval95=[e.low if before else max(e.low, 0.0), e.high],
            over_nominal=e.value / before if before else None,
            at_bound=not before and e.value <= NOTHING * e.std,
        )
        for name, unit, before, e in rows
    ]


def _model(measurement: Measurement, fitter: LeastSquaresProblem, fit: Fit, document: Calibration) -> str:
    """The model with the joint's law, or its compliance where readings need no more; friction is in the head."""
    joint, rows = measurement.drive.name, {row.name.rpartition(".")[2]: row for row in document.parameters}
    sizes: dict[type[Effect], str] = {JointHardening: "stiffness_ratio", ActuatorBacklash: "backlash"}
    # a size that reaches nothing, which is 1 of a ratio
    reached = {name for name, row in rows.items() if row.interval95[0] <= row.nominal <= row.interval95[1]}
    needless = [effect.label for effect in fit.hypothesis if sizes.get(type(effect)) in reached]
    text = extended_document(measurement, fitter, fit, "calibrated", needless)
    law = part_table(text, joint).get("law")
    inside = {"stiffness"} if law is None else {*StrainWave.keys(slides=False), "stiffness", "stiffness_ratio"}
    if not any(isinstance(e, ActuatorBacklash) and e.label in needless for e in fit.hypothesis):
        inside |= {"backlash"}
    where = f"in the joint's {'compliance' if law is None else 'law'}"
    notes = [
        f"{row.name} = {row.value:.6g} ± {row.std:.2g}{'' if row.unit == '1' else ' ' + row.unit}: "
        f"{where if name in inside else 'not in the numbers below'}."
        for name, row in rows.items()
    ]
    return model_text(measurement, text, notes)
