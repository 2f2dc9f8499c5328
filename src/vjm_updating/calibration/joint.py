"""Calibration by a test of one joint: stiffness, hardening, backlash and friction together.

All four are looked for, whether or not a diagnosis would name them: a size that the readings do not need has an
interval that reaches nothing. Backlash is left out where the loads go to one side only. The scales and zeros of
cell and gauge are nuisances under the sheet's priors, so that a stiffness is known no better than the cell's scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.findings import Finding
from vjm.io.toml_text import toml_text
from vjm_output.documents import versions
from vjm_updating.calibration.document import (
    Calibration,
    ChannelRow,
    DesignRow,
    FitRow,
    IdentifiabilityRow,
    MatrixRow,
    NuisanceRow,
    OutlierRow,
    ParameterRow,
    PredictionsRow,
)
from vjm_updating.calibration.fit import spread_of
from vjm_updating.calibration.results import beyond_tolerance
from vjm_updating.calibration.run import TAKEN_BY_FORCE, judged, warned
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.estimates import Estimate, estimates, nuisance_estimates
from vjm_updating.diagnosis.extended import extended_document
from vjm_updating.diagnosis.joint_kind import JointTest, joint_effects, together
from vjm_updating.diagnosis.preprocess import Prepared, prepare
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import unit_of
from vjm_updating.experiment.joint_levers import one_sided
from vjm_updating.experiment.mistakes import refuse_mistaken
from vjm_updating.experiment.plausibility import considered
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.normal_equations import inverse
from vjm_updating.inference.refit import refit
from vjm_updating.mechanisms.single_joint import JointCompliance
from vjm_updating.result import CALIBRATED, CalibrationResult

NOTHING = numerical(1e-3)
"""Of a standard deviation, up to which a size at its bound is nothing."""


def calibrate_joint(
    measurement: Measurement,
    *,
    force: bool = False,
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:
    """Calibrate a joint; see `vjm_updating.calibrate`.

    Args:
        measurement: the test, by a sheet of ``kind = "joint"``.
        force: whether a model is written that is not for use, see `vjm_updating.calibration.run.judged`; so one
            of readings whose columns are not what they say, which are refused else.
        strict: whether doubtful readings are refused.
        warn: told what is implausible, before anything is fitted.
        progress: told what is being done.

    Raises:
        ValueError: the test cannot be used; one line.
        vjm.errors.NoConvergenceError: the joint's laws do not reach the readings.
    """
    findings = considered(measurement, strict=strict)
    if not force:
        refuse_mistaken(findings, TAKEN_BY_FORCE)
    kind = JointTest()
    observed = kind.observe(measurement)
    warn(findings)
    progress("the nominal joint")
    prepared = prepare(observed)
    progress("stiffness, hardening, backlash and friction")
    fit = _fitted(prepared, kind)
    document = judged(_document(measurement, prepared, fit), findings, force=force)
    model = _model(measurement, prepared.fitter, fit, document) if document.calibrated_model else ""
    return CalibrationResult(document, {CALIBRATED: model})


def _fitted(prepared: Prepared, kind: JointTest) -> Fit:
    """All of the joint's laws together, outliers and autocorrelation found about them."""
    own = joint_effects(prepared.fitter.forward.observed)
    # a spring that hardens has a compliance of its own
    effects = [effect for effect in own if not isinstance(effect, JointCompliance)]
    first = together(prepared.fitter, prepared.null, effects)
    if first is None:
        raise NoConvergenceError(f"{prepared.all.readings.file}: the joint's laws do not reach the readings")
    return refit(prepared.fitter, kind.without_outliers, prepared.all, first)


def _document(measurement: Measurement, prepared: Prepared, fit: Fit) -> Calibration:
    fitter = prepared.fitter
    found, nuisances = estimates(fitter, fit, 0.0), _nuisances(fitter, fit)
    return Calibration(
        title=measurement.sheet.test.title,
        model=measurement.chain.name,
        engine=measurement.engine.label,
        data=measurement.readings.file,
        sheet=measurement.sheet.file,
        fit=_fit(prepared, fit),
        parameters=_parameters(measurement, found),
        combinations=[],
        compliances=[],
        nuisances=nuisances,
        joint=_covariance(fitter, fit),
        identifiability=IdentifiabilityRow(
            statement=[
                _seen(measurement),
                "The stiffness is known no better than the scales of cell and gauge, which count with the sheet's "
                "tolerances.",
                *beyond_tolerance(nuisances),
            ],
            directions=[],
            not_separable=[],
        ),
        predictions=PredictionsRow(calibrated=[], tolerances=[], rounding=[]),
        next_experiment=DesignRow(
            d_optimal=None, i_optimal=None, figure="", figure_std=None, candidates=[], left_out=[]
        ),
        calibrated_model=CALIBRATED,
        versions=versions(),
        hashes={"model": measurement.model_sha256, "data": measurement.data_sha256},
    )


def _seen(measurement: Measurement) -> str:
    joint = measurement.drive.name
    if one_sided(measurement):
        return f"Loads to one side see {joint}'s stiffness, hardening and friction; its backlash they cannot know."
    return f"Loads in both directions see {joint}'s stiffness, hardening, backlash and friction."


def _parameters(measurement: Measurement, found: Mapping[str, Estimate]) -> list[ParameterRow]:
    """Stiffness without load, hardening, backlash and friction; what shapes their laws is not among them."""
    joint = measurement.drive
    turns = not joint.slides
    soft, gap, slip = (
        ("compliance_rad_per_Nmm", "gap_rad", "torque_Nmm")
        if turns
        else ("compliance_mm_per_N", "gap_mm", "force_N")
    )
    c = found[f"actuator_hardening.{soft}"]
    stiff = Estimate(1.0 / c.value, c.std / c.value**2, 1.0 / max(c.high, 1e-300), 1.0 / max(c.low, 1e-300))
    nominal, lost = 1.0 / measurement.joint_compliance, found.get(f"actuator_backlash.{gap}")
    rows = [
        ("stiffness", "N mm/rad" if turns else "N/mm", nominal, stiff),
        ("stiffness_ratio", "1", 1.0, found["actuator_hardening.stiffness_ratio"]),
        *([] if lost is None else [("backlash", "rad" if turns else "mm", 0.0, lost)]),
        ("friction", "N mm" if turns else "N", 0.0, found[f"joint_friction.{slip}"]),
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


def _fit(prepared: Prepared, fit: Fit) -> FitRow:
    fitter, everything = prepared.fitter, prepared.all
    observed, present = fitter.forward.observed, fitter.whitening.present[:, 0]
    spread = float(spread_of(fitter, fit, fit.free)[0])
    at = fitter.forward.reading(everything)
    whole = at.evaluate(fit.found, fit.at.z, fit.hypothesis).residual[:, 0]
    before = at.evaluate(fit.found[: len(fitter.nuisances)], np.zeros(len(fitter.nuisances)), ()).residual[:, 0]
    residual = fitter.whitening.independent(fit.at.residual)[present, 0]
    channel = observed.columns[0]
    unit = unit_of(channel).replace("Nmm", "N mm")
    off = np.abs(whole) / everything.noise.wrench[0]
    statement = (
        "The residuals are what the sheet's noise allows."
        if spread == 1.0
        else f"The joint's laws miss the readings by more than the sheet's noise: {channel} by {spread:.3g} sigma. "
        "The uncertainties are widened by that; `validate diagnose` looks for the cause of the residual."
    )
    return FitRow(
        readings=int(everything.present.sum()),
        converged=fit.converged,
        fits=spread == 1.0,
        statement=statement,
        channels=[
            ChannelRow(
                channel=channel,
                readings=int(everything.present.sum()),
                rmse_nominal=float(np.sqrt(np.mean(before**2))),
                rmse=float(np.sqrt(np.mean(whole**2))),
                unit=unit,
                in_sigma=float(np.sqrt(np.mean(residual**2))),
                spread=spread,
                autocorrelation=float(fitter.whitening.autoregression.neighbours[0]),
                quantum=everything.noise.quantum.get(channel, 0.0),
            )
        ],
        outliers=[
            OutlierRow(
                row=int(everything.readings.row[k]),
                posture=prepared.all.measurement.drive.name,
                channels=[channel],
                in_sigma=float(off[k]),
            )
            for k in np.flatnonzero(everything.present[:, 0] & ~present)
        ],
        behind_bifurcation=0,
    )


def _nuisances(fitter: Fitter, fit: Fit) -> list[NuisanceRow]:
    rows = []
    by_name = {c.name: c for c in fitter.nuisances}
    for name, e in nuisance_estimates(fitter, fit).items():
        own = by_name[name]
        unit = "1" if own.kind == "scale" else unit_of(own.subject).replace("Nmm", "N mm")
        share = float(np.clip(1.0 - (e.std / own.scale) ** 2, 0.0, 1.0))
        rows.append(
            NuisanceRow(name=name, unit=unit, value=e.value, std=e.std, sheet_std=own.scale, from_data=share)
        )
    return rows


def _covariance(fitter: Fitter, fit: Fit) -> MatrixRow:
    """Of the fit's coordinates, each in its own unit."""
    free = np.array([c.sigma != 0.0 for c in fit.found])
    C = inverse(fitter.normal(fit), free)
    slopes = np.array([c.slope(float(z)) for c, z in zip(fit.found, fit.at.z, strict=True)])
    C = (slopes[:, None] * C * slopes)[np.ix_(free, free)]
    size = np.maximum(np.sqrt(np.diag(C)), 1e-300)
    names = [c.name for c, own in zip(fit.found, free, strict=True) if own]
    return MatrixRow(names=names, covariance=C.tolist(), correlation=(C / np.outer(size, size)).tolist())


def _model(measurement: Measurement, fitter: Fitter, fit: Fit, document: Calibration) -> str:
    """The model with the joint's compliance at no load; its other laws stand in the head."""
    text = extended_document(measurement, fitter, fit)
    text["title"] = f"{measurement.document['title']}, calibrated"
    source = f"calibrated from {measurement.readings.file} with {measurement.sheet.file}"
    text["source"] = f"{source}; nominal values: {measurement.document['source']}"
    by = f"Calibrated from {measurement.readings.file} with {measurement.sheet.file} by `validate calibrate`."
    head = [*warned(document), by]
    for row in document.parameters:
        said = "in the joint's compliance" if row.name.endswith(".stiffness") else "not in the numbers below"
        head.append(f"{row.name} = {row.value:.6g} ± {row.std:.2g} {row.unit}: {said}.")
    return "".join(f"# {line}\n" for line in head) + toml_text(text)
