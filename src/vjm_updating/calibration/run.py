"""The calibration of a machine by ramps, from its fit to its model.

A solved calibration is written as the rows of ``calibration.json``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vjm.io.findings import Finding
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_output.documents import doubt_rows, versions
from vjm_updating.calibration import design
from vjm_updating.calibration import design as carried
from vjm_updating.calibration.calibrated_model import calibrated_text, model_files
from vjm_updating.calibration.design import Predicted, parsed_ramps
from vjm_updating.calibration.document import (
    Calibration,
    ChannelRow,
    ComplianceRow,
    DesignRow,
    DirectionRow,
    FigureRow,
    FitRow,
    IdentifiabilityRow,
    MatrixRow,
    NuisanceRow,
    OutlierRow,
    ParameterRow,
    PredictionsRow,
)
from vjm_updating.calibration.fit import (
    MISFIT,
    ROUNDS,
    CalibrationProblem,
    CalibrationSolution,
    Identifiability,
    Solution,
    identifiability,
    problem_of,
    solve,
    with_promises,
)
from vjm_updating.calibration.parameters import MATRIX
from vjm_updating.constants import numerical, shown
from vjm_updating.experiment import Kind, Measurement
from vjm_updating.experiment.data_file import unit_of
from vjm_updating.experiment.mistakes import columns_mistaken
from vjm_updating.inference.parameters import FitParameter
from vjm_updating.inference.profile import profile_interval
from vjm_updating.inference.significance import NORMAL_95, more_than_noise
from vjm_updating.result import CALIBRATED, CalibrationResult

WIDENED = numerical(0.1)
"""Of a tolerance, by which it must change to be found again: an uncertainty is no better known."""
AT_BOUND = numerical(1.5)
"""Over the lowest z of a rigid drive: below, it is as rigid as can be told."""
SOURCES = shown(6)
"""Most sources of a figure's uncertainty that are worth naming."""
STEP = numerical(1e-5)
"""Of the differences of a 6×6 by its factor's entries."""


def results(
    measurement: Measurement, fit: CalibrationSolution, *, ramps: Sequence[LoadCase] = (), figure: str = ""
) -> tuple[Calibration, str]:
    """What a fit says, and the text of the calibrated model file.

    Args:
        measurement: that was fitted.
        fit: solved.
        ramps: feasible next ones; every posture along x where empty.
        figure: that the next experiment is to make certain, see `vjm_updating.calibration.design.in_view`.

    Raises:
        ValueError: the figure is unknown, or the calibrated machine is none that a model file admits.
    """
    model = calibrated_text(measurement, fit.problem.unknowns.build(fit.z))
    calibrated = carried.after_calibration(fit)
    document = found_document(measurement, fit, identifiability(fit)).model_copy(
        update={
            "predictions": PredictionsRow(
                calibrated=_figures(*calibrated),
                tolerances=_figures(*carried.within_tolerances(measurement)),
                rounding=_figures(*carried.within_rounding(measurement)),
            ),
            "next_experiment": _design(fit, calibrated, ramps, figure),
        }
    )
    return document, model


def found_document(
    measurement: Measurement, fit: CalibrationSolution, identifiability: Identifiability
) -> Calibration:
    """What a fit says of the machine that was tested."""
    return Calibration(
        **header(measurement),
        fit=fit_row(fit),
        parameters=parameter_rows(fit, identifiability),
        combinations=identifiability.combinations,
        compliances=compliance_rows(fit, identifiability),
        nuisances=nuisance_rows(fit),
        joint=joint_row(fit, identifiability),
        identifiability=identifiability_row(fit, identifiability),
    )


def header(measurement: Measurement) -> dict[str, Any]:
    """Whose calibration a document is, and what made it."""
    return {
        "title": measurement.sheet.test.title,
        "model": measurement.chain.name,
        "engine": measurement.engine.label,
        "data": measurement.readings.file,
        "sheet": measurement.sheet.file,
        "calibrated_model": CALIBRATED,
        "versions": versions(),
    }


def _names(fit: CalibrationSolution) -> list[str]:
    return [unknown.name for unknown in fit.problem.unknowns.sought]


def parameter_rows(fit: CalibrationSolution, identifiability: Identifiability) -> list[ParameterRow]:
    """The parameters that the readings determine."""
    rows = []
    for i in np.flatnonzero(identifiability.separable):
        unknown, z = fit.problem.unknowns.sought[i], float(fit.z[i])
        ends = profile_interval(fit.fitter, fit.fit, int(i), fit.covariance)
        value = unknown.value(z)
        rows.append(
            ParameterRow(
                name=unknown.name,
                unit=unknown.unit,
                nominal=unknown.nominal,
                value=value,
                std=abs(unknown.slope(z)) * float(np.sqrt(fit.covariance[i, i])),
                interval95=[unknown.value(ends.low), unknown.value(ends.high)],
                over_nominal=value / unknown.nominal if unknown.nominal else None,
                at_bound=bool(np.isfinite(unknown.low) and z <= AT_BOUND * unknown.low),
            )
        )
    return rows


def compliance_rows(fit: CalibrationSolution, identifiability: Identifiability) -> list[ComplianceRow]:
    """The entries of every 6×6 that was looked for as a whole, with what is known of each."""
    names, p = _names(fit), fit.problem.unknowns.parameters
    rows = []
    for part in dict.fromkeys(name.partition(".")[0] for name in names if name.endswith(".R11")):
        indices = [names.index(f"{part}.R{i + 1}{j + 1}") for i, j in MATRIX]

        def matrix(z: Array, part: str = part) -> Array:
            beam = next(beam for beam in fit.problem.unknowns.build(z).beams if beam.name == part)
            assert beam.compliance is not None
            return beam.compliance

        gradient = np.zeros((6, 6, p))
        for k in indices:
            step = STEP * np.eye(len(fit.z))[k]
            gradient[:, :, k] = (matrix(fit.z + step) - matrix(fit.z - step)) / (2.0 * STEP)
        variance = np.einsum("ijk,kl,ijl->ij", gradient, fit.covariance[:p, :p], gradient)
        std = [
            [
                float(np.sqrt(v)) if identifiability.determined(g, float(v)) else None
                for g, v in zip(*line, strict=True)
            ]
            for line in zip(gradient, variance, strict=True)
        ]
        nominal = matrix(np.zeros(len(fit.z))).tolist()
        rows.append(ComplianceRow(part=part, value=matrix(fit.z).tolist(), std=std, nominal=nominal))
    return rows


def nuisance_rows(fit: Solution) -> list[NuisanceRow]:
    """The nuisances that the sheet allows."""
    rows = []
    for own, z, deviation in zip(fit.fit.parameters, fit.z.tolist(), fit.deviation.tolist(), strict=True):
        if own.kind in list(Kind) and own.sigma > 0.0:
            rows.append(
                NuisanceRow(
                    name=own.name,
                    unit=_unit(own),
                    value=own.value(z),
                    std=own.slope(z) * deviation,
                    sheet_std=own.scale,
                    counted_std=own.scale * own.sigma,
                    from_data=float(np.clip(1.0 - (deviation / own.sigma) ** 2, 0.0, 1.0)),
                )
            )
    return rows


def beyond_tolerance(rows: Sequence[NuisanceRow]) -> list[str]:
    """In words, the nuisances that lie further off than the sheet's tolerances let expect."""
    return [
        f"The fit takes {row.name} to {row.value:.3g}, {abs(row.value) / row.sheet_std:.1f} of the sheet's "
        "standard deviations: doubt that tolerance, or what the model says."
        + (f" It counts as {row.counted_std:.2g} here." if row.counted_std > row.sheet_std else "")
        for row in rows
        if abs(row.value) > MISFIT * row.sheet_std
    ]


def _unit(nuisance: FitParameter) -> str:
    if nuisance.kind == Kind.ZERO:
        return nuisance.subject.rpartition("_")[2].replace("Nmm", "N mm")
    return "mm" if nuisance.kind == Kind.LENGTH else "1"


def joint_row(fit: CalibrationSolution, identifiability: Identifiability) -> MatrixRow:
    """Covariance of what has a number of its own: separable parameters, seen combinations, nuisances."""
    unknowns = fit.problem.unknowns
    p, n = unknowns.parameters, len(unknowns)
    names, rows = [], []

    def add(name: str, row: Array) -> None:
        names.append(name)
        rows.append(row)

    def own(i: int, unknown: FitParameter) -> None:
        add(unknown.name, unknown.slope(float(fit.z[i])) * np.eye(n)[i])

    for k in np.flatnonzero(identifiability.separable):
        own(int(k), unknowns.all[k])
    for one in identifiability.combinations:
        if one.seen:
            own_z = [one.coefficients.get(name, 0.0) for name in _names(fit)]
            add(one.name, np.concatenate([own_z, np.zeros(n - p)]))
    for i in range(p, n):
        own(i, unknowns.all[i])
    G = np.array(rows).reshape(-1, n)
    return matrix_row(names, G @ fit.covariance @ G.T)


def matrix_row(names: list[str], C: Array) -> MatrixRow:
    """A covariance ``(n, n)`` with its correlation, 0 with what is held at its bound."""
    size = np.sqrt(np.diag(C))
    size = np.where(size > 0.0, size, 1.0)
    return MatrixRow(names=names, covariance=C.tolist(), correlation=(C / np.outer(size, size)).tolist())


def identifiability_row(fit: CalibrationSolution, identifiability: Identifiability) -> IdentifiabilityRow:
    """What the readings see, in words and directions."""
    names = _names(fit)
    lost = [name for name, separable in zip(names, identifiability.separable, strict=True) if not separable]
    postures = ", ".join(dict.fromkeys(ray.posture for ray in fit.problem.observed.rays))
    seen = sum(one.seen for one in identifiability.directions)
    words = [f"Postures {postures} see {seen} of {len(names)} directions in the space of the parameters."]
    if promised := fit.problem.promised:
        words.insert(
            0,
            f"The readings do not tell {', '.join(promised)} from what carries it. What the sheet promises of it "
            "counts, and it is not looked for. --fit says otherwise.",
        )
    if fit.refuted:
        words.append(
            f"What the sheet promises of {', '.join(fit.refuted)} does not explain the readings as well, and does "
            "not count."
        )
    if not lost:
        words.append("Every parameter has a number of its own.")
    else:
        words.append(f"No number of its own has {', '.join(lost)}.")
        visible = [one.name for one in identifiability.combinations if one.seen]
        if visible:
            words.append(f"Of these the readings determine only {'; '.join(visible)}, in terms of z.")
        hidden = [one.name for one in identifiability.combinations if not one.seen]
        if hidden:
            words.append(f"They do not see {'; '.join(hidden)}.")
    rows = [
        DirectionRow(name=one.name, singular_value=one.singular_value, seen=one.seen)
        for one in identifiability.directions
    ]
    words += beyond_tolerance(nuisance_rows(fit))
    return IdentifiabilityRow(statement=words, directions=rows, not_separable=lost)


def fit_row(fit: Solution) -> FitRow:
    """How well the model fits."""
    observed, evaluation, spread = fit.everything, fit.at, fit.spread
    channels = []
    for c in np.flatnonzero(observed.present.any(axis=0)):
        on, name = observed.present[:, c], observed.columns[c]
        good = on & ~fit.outliers[:, c]
        channels.append(
            ChannelRow(
                channel=name,
                readings=int(on.sum()),
                rmse_nominal=float(np.sqrt(np.mean(fit.nominal.residual[on, c] ** 2))),
                rmse=float(np.sqrt(np.mean(evaluation.residual[on, c] ** 2))),
                unit=unit_of(name).replace("Nmm", "N mm"),
                in_sigma=float(fit.whitening.spread[c] * np.sqrt(np.mean(fit.residual[good, c] ** 2))),
                spread=float(spread[c]),
                autocorrelation=float(fit.whitening.autoregression.neighbours[c]),
                quantum=observed.noise.quantum.get(name, 0.0),
            )
        )
    worst, count = max(channels, key=lambda row: row.spread), int(observed.present.sum())
    together = float(np.sqrt(sum(row.readings * row.spread**2 for row in channels) / count))
    scatter = [(together, count), *((row.spread, row.readings) for row in channels)]
    fits = not any(more_than_noise(times, number) for times, number in scatter)
    widened = "" if worst.spread == 1.0 else f" The uncertainties are widened by {worst.spread:.3g} at most."
    return FitRow(
        readings=count,
        converged=fit.fit.converged,
        fits=fits,
        statement=f"The residuals are what the sheet's noise allows.{widened}"
        if fits
        else f"The model misses the readings by more than the sheet's noise: {worst.channel} by {worst.spread:.3g} "
        "sigma. The uncertainties are widened by that, but what the model lacks can bias every number: "
        "`validate diagnose` says what it may be.",
        channels=channels,
        outliers=[
            OutlierRow(
                row=int(observed.readings.row[k]),
                posture=next(ray.posture for ray in observed.rays if k in ray.index),
                channels=[observed.columns[c] for c in np.flatnonzero(fit.outliers[k])],
                in_sigma=float(np.abs(fit.noises[k, fit.outliers[k]]).max()),
            )
            for k in np.flatnonzero(fit.outliers.any(axis=1))
        ],
        behind_bifurcation=int(fit.branched.sum()),
    )


def _figures(figures: Sequence[Predicted], covariance: Array, names: Sequence[str]) -> list[FigureRow]:
    rows = []
    for one in figures:
        std = one.std(covariance)
        known = bool(np.isfinite(std))
        alone = one.gradient * np.sqrt(np.diag(covariance))
        largest = [int(i) for i in np.argsort(-np.nan_to_num(np.abs(alone), nan=np.inf))[:SOURCES]]
        rows.append(
            FigureRow(
                posture=one.posture,
                direction=str(one.direction),
                quantity=one.quantity,
                unit=carried.QUANTITIES[one.quantity],
                kind=one.kind,
                value=one.value,
                std=std if known else None,
                interval95=[one.value - NORMAL_95 * std, one.value + NORMAL_95 * std] if known else None,
                sensitivities={names[i]: float(alone[i]) if np.isfinite(alone[i]) else None for i in largest},
                reasons=sorted({reason for reason in one.reasons if reason}),
            )
        )
    return rows


def _design(
    fit: CalibrationSolution,
    calibrated: tuple[list[Predicted], Array, list[str]],
    ramps: Sequence[LoadCase],
    wanted: str,
) -> DesignRow:
    figures, covariance, _ = calibrated
    target = design.in_view(figures, covariance, wanted)
    candidates, left_out = design.candidates(fit, target, ramps or design.usual_ramps(fit))
    by_figure = sorted(
        (row for row in candidates if row.figure_std is not None), key=lambda row: row.figure_std or 0.0
    )
    return DesignRow(
        d_optimal=candidates[0] if candidates else None,
        i_optimal=by_figure[0] if by_figure else None,
        figure="" if target is None else design.label(target),
        figure_std=None if target is None else target.std(covariance),
        candidates=candidates,
        left_out=left_out,
    )


MISSES, MISTAKEN = "it does not explain its own readings", "its readings are mistaken"


def calibrate_ramps(
    measurement: Measurement,
    considered: Callable[[], list[Finding]],
    *,
    fit: Sequence[str] = (),
    ramps: Sequence[str] = (),
    figure: str = "",
    force: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration]:
    """Calibrate a machine by ramps; arguments and errors as of `vjm_updating.calibrate`.

    Args:
        measurement: the test.
        considered: says what is implausible about it.
        fit: parameters, see `vjm_updating.calibration.parameters.unknowns`.
        ramps: feasible next experiments, see `vjm_updating.calibration.design.parsed_ramps`.
        figure: that the next experiment is to make certain, see `vjm_updating.calibration.design.in_view`.
        force: whether a model is written that is not for use, see `finished`.
        progress: told what is being done.
    """
    problem, feasible = problem_of(measurement, fit), tuple(parsed_ramps(ramps, measurement.chain))
    findings = considered()
    progress("fit")
    solution = distinguishable_solution(problem, solve)
    progress("uncertainty and predictions")
    document, model = results(measurement, solution, ramps=feasible, figure=figure)
    progress("report")

    def page(document: Calibration) -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.calibration.page import write_page

        return write_page(measurement, solution, document)

    return finished(document, model, findings, force=force, page=page)


def finished(
    document: Calibration,
    model: str,
    findings: Sequence[Finding],
    *,
    force: bool,
    page: Callable[[Calibration], str] | None = None,
) -> CalibrationResult[Calibration]:
    """A calibration with what is doubted, and whether its model is for use, and is written.

    It is not for use where it misses its own readings, or where columns are not what they say, which are taken by
    force alone: a machine that fits them is another one.

    Args:
        document: what was found.
        model: text of the model.
        findings: what is implausible about the test.
        force: whether a model is written that is not for use; it says so in its head.
        page: makes the page of a document.
    """
    unfit = [] if document.fit.fits else [MISSES]
    unfit += [f"{MISTAKEN}: {one}" for one in columns_mistaken(findings)]
    changed = {"doubts": doubt_rows(findings), "unfit": unfit}
    models = model_files({CALIBRATED: model}, unfit, notes=beyond_tolerance(document.nuisances), force=force)
    final = document.model_copy(update=changed if models[CALIBRATED] else changed | {"calibrated_model": ""})
    return CalibrationResult(final, models, page)


def distinguishable_solution(
    problem: CalibrationProblem, solver: Callable[[CalibrationProblem], CalibrationSolution]
) -> CalibrationSolution:
    """A solution, or where its parameters are not distinguishable the one with beams as the sheet promises them.

    The second counts where it explains the readings as well and each of its parameters has a number. What the
    nuisances' priors take is part of what explains: each promised beam adds one square of a standard normal to it,
    whose sum is judged as the variance of residuals is.

    Raises:
        vjm.errors.NoConvergenceError: as the solver.
    """
    return widened(_distinguishable(problem, solver), solver)


def widened(
    solution: CalibrationSolution, solver: Callable[[CalibrationProblem], CalibrationSolution]
) -> CalibrationSolution:
    """The same with the tolerances that the fit shows, where it takes some further off than the sheet lets expect.

    What a sheet says of them was then no standard deviation, and uncertainties that rest on it are too small. So
    the variance is found from the readings as that of residuals is: the mean square of what is likely (expectation
    and maximisation of a variance component: Dempster, Laird and Rubin, J. R. Stat. Soc. B 39, 1977, p. 1). The
    machine's of one kind have one, each of the instruments its own.
    """
    first = {own.name: own.sigma for own in solution.problem.unknowns.nuisances}
    for _ in range(ROUNDS):
        unknowns = solution.problem.unknowns
        groups: dict[tuple[str, str], list[int]] = {}
        for i, own in enumerate(unknowns.nuisances, start=unknowns.parameters):
            groups.setdefault((own.kind, own.subject if own.of_instrument else ""), []).append(i)
        wider: dict[int, float] = {}
        sigma = unknowns.sigma
        for indices in groups.values():
            sheet = np.array([first[unknowns.all[i].name] for i in indices])
            squares = (solution.z[indices] ** 2 + solution.deviation[indices] ** 2) / sheet**2
            if np.abs(solution.z[indices] / sheet).max() > MISFIT:
                wider |= dict(zip(indices, sheet * max(float(np.sqrt(squares.mean())), 1.0), strict=True))
        if all(abs(s / sigma[i] - 1.0) < WIDENED for i, s in wider.items()):
            break
        nuisances = tuple(
            replace(own, sigma=float(wider.get(i, own.sigma)))
            for i, own in enumerate(unknowns.nuisances, start=unknowns.parameters)
        )
        problem = replace(solution.problem, unknowns=replace(unknowns, nuisances=nuisances))
        solution = replace(solver(problem), refuted=solution.refuted)
    return solution


def _distinguishable(
    problem: CalibrationProblem, solver: Callable[[CalibrationProblem], CalibrationSolution]
) -> CalibrationSolution:
    solution = solver(problem)
    if identifiability(solution).separable.all() or (promised := with_promises(problem)) is None:
        return solution
    other = solver(promised)
    n, more = len(other.problem.promised), float(np.sum(other.pulls**2) - np.sum(solution.pulls**2))
    within = more <= n * (1.0 + MISFIT * np.sqrt(2.0 / n))
    if not within or not (other.whitening.spread <= solution.whitening.spread).all():
        return replace(solution, refuted=other.problem.promised)
    return other if identifiability(other).separable.all() else solution
