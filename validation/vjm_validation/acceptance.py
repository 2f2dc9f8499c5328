"""What the solvers must do for a run to be accepted: convergence, stability, agreement of converged engines.

That a model or the paper is wrong is a finding, not a failure, and has no row here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from vjm.continuation.path import EventKind, Path
from vjm.io.findings import Finding, Grade
from vjm_fea.opensees.beams import MISSING
from vjm_output.documents import Row
from vjm_validation.metrics import PathMetrics, force_difference, path_metrics, shape_difference
from vjm_validation.studies.chain import CAUSE, SECOND, DiscoveryStudy, EndConditionStudy, Key
from vjm_validation.studies.robots import COMPARED, ROBOT, SECOND_ENGINE, SPRINGS, RobotCriticalRow, RobotStudy
from vjm_validation.verification.judging import VerificationRow
from vjm_validation.verification.study import GROUP

RESIDUAL = 1e-8
"""Scaled equilibrium residual; the lumped solver stops at 1e-11, Exudyn at 1e-9 of its own norm."""
LOAD_AGREEMENT = 1e-3
"""Of critical forces between converged engines: their discretisation errors at 16 are below 1e-4."""
BEHIND_AGREEMENT = 2e-3
"""Of the force at the end of a path that has a critical point."""
CURVE_AGREEMENT = 5e-3
"""Of forces at equal displacement over the critical force, critical displacements and deflected shapes."""

ROBOT_AGREEMENT = 5e-3
"""Of the Orthoglide's stiffness and critical forces; with the foot as one spring its law takes nearly all of it."""
HELD_OUT = 1e-2
"""Of what the discovery's extended model predicts without having seen it, over its size."""
OTHERS_AGREEMENT = 1e-2
"""Of the other robots' stiffness, and of what errors of assembly do."""


class AcceptanceRow(Row):
    """One requirement and whether it holds."""

    name: str
    requirement: str
    value: float | str
    passed: bool | None
    """Null where nothing of it was run, which is no pass."""


def at_most(name: str, value: float, limit: float, unit: str = "") -> AcceptanceRow:
    """A number that must not exceed a limit."""
    return AcceptanceRow(
        name=name, requirement=f"at most {limit:g}{unit}", value=value, passed=bool(value <= limit)
    )


def accepted(rows: Iterable[AcceptanceRow]) -> bool:
    """Whether a run is accepted: no requirement failed, and one at least was looked at and holds."""
    passed = [row.passed for row in rows]
    return False not in passed and True in passed


MODEL_ROW = "model"
"""Name of the row about the model file itself."""


def model_rows(findings: Iterable[Finding]) -> list[AcceptanceRow]:
    """The model file says nothing doubtful: what a mistaken one computes tells nothing of the paper."""
    doubtful = [str(finding) for finding in findings if finding.grade is not Grade.NOTED]
    return [none_of(MODEL_ROW, "nothing in its file is doubtful", doubtful)]


def solver_rows(paths: Mapping[Key, Path]) -> list[AcceptanceRow]:
    """Every path reached its end, every point is an equilibrium, every point that was kept is stable.

    No rows where no path was followed: of nothing everything holds.
    """
    if not paths:
        return []
    early = [f"{key.stem}: {path.stopped}" for key, path in paths.items() if not path.complete]
    residuals = [p.residual for path in paths.values() for p in path.points]
    unstable = [f"{key.stem} at {p.s:.4g}" for key, path in paths.items() for p in path.points if p.unstable > 0]
    lost = [
        f"{key.stem} at {event.s:.4g}"
        for key, path in paths.items()
        for event in path.events
        if event.kind is EventKind.BIFURCATION and not event.switched
    ]
    return [
        none_of("paths complete", "every path reaches the end of its load case", early),
        at_most("equilibrium residual", float(np.max(residuals, initial=0.0)), RESIDUAL, " (scaled)"),
        none_of("stability", "no point of a path is unstable", unstable),
        none_of("branches", "behind every bifurcation the stable branch was found", lost),
    ]


def none_of(name: str, requirement: str, offenders: Iterable[str]) -> AcceptanceRow:
    """A requirement that nothing may offend."""
    failures = list(offenders)
    return AcceptanceRow(
        name=name, requirement=requirement, value="; ".join(failures) or "all", passed=not failures
    )


CONVERGED = ("vjm-16f16", "exudyn", SECOND)
"""Engines of one model, foot and bar as beams, that are as good as converged."""


def agreement_rows(paths: Mapping[Key, Path], *, second: bool = False) -> list[AcceptanceRow]:
    """Converged engines beside each other on every path that both have.

    Args:
        paths: of a run.
        second: whether a second program was asked for; then it is said where it is not installed.
    """
    engines = {key.engine for key in paths}
    pairs = [*combinations(CONVERGED, 2), ("vjm-16", "exudyn-footspring")]
    rows = [row for pair in pairs if engines.issuperset(pair) for row in _pair_rows(paths, *pair)]
    if second and SECOND not in engines:
        requirement = "as the other engines agree"
        rows.append(
            AcceptanceRow(
                name=f"agreement with {SECOND}", requirement=requirement, value=f"not run: {MISSING}", passed=None
            )
        )
    return rows


def _pair_rows(paths: Mapping[Key, Path], first: str, second: str) -> list[AcceptanceRow]:
    """Kinds and places of critical points, whole curves, their ends and deflected shapes of two engines."""
    pairs = {
        key: (path, paths[other])
        for key, path in paths.items()
        if key.engine == first and (other := replace(key, engine=second)) in paths
    }
    critical = {key: (a.critical, b.critical) for key, (a, b) in pairs.items()}
    kinds = [
        f"{key.posture} {key.direction}: {a and a.kind} and {b and b.kind}"
        for key, (a, b) in critical.items()
        if (a and a.kind) != (b and b.kind)
    ]
    sharp = [(a, b) for a, b in critical.values() if a and b and a.kind is b.kind is EventKind.BIFURCATION]
    name = f"agreement of {first} and {second}"
    forces = max((abs(a.force / b.force - 1.0) for a, b in sharp), default=0.0)
    rows = [
        none_of(f"{name}: critical points", "of the same kind", kinds),
        at_most(f"{name}: critical forces", forces, LOAD_AGREEMENT),
    ]
    if first not in CONVERGED:
        # the two laws for a lumped foot differ at finite rotation, the refined feet must not
        return rows
    places = max((abs(a.s / b.s - 1.0) for a, b in sharp), default=0.0)
    curves = [force_difference(a, b) / float(np.max(b.force)) for a, b in pairs.values()]
    behind = [
        abs(a.force[-1] / b.force[-1] - 1.0) for a, b in pairs.values() if a.critical and a.complete and b.complete
    ]
    shapes = [shape_difference(a, b) for a, b in pairs.values() if a.complete and b.complete]
    return [
        *rows,
        at_most(f"{name}: critical displacements", places, CURVE_AGREEMENT),
        at_most(f"{name}: force at equal displacement over the largest", max(curves), CURVE_AGREEMENT),
        at_most(f"{name}: force behind the critical point", max(behind, default=0.0), BEHIND_AGREEMENT),
        at_most(f"{name}: deflected shape over its amplitude", max(shapes, default=0.0), CURVE_AGREEMENT),
    ]


def end_rows(study: EndConditionStudy | None) -> list[AcceptanceRow]:
    """Under every end condition the engines find the same kind of critical point at the same force."""
    if study is None:
        return []
    metrics: dict[tuple[str, str], list[PathMetrics]] = {}
    for (posture, condition, _), path in study.paths.items():
        metrics.setdefault((posture, condition), []).append(path_metrics(path))
    kinds = [f"{posture}, {name}" for (posture, name), row in metrics.items() if len({m.critical for m in row}) > 1]
    apart = [abs(m.F_cr / row[0].F_cr - 1.0) for row in metrics.values() for m in row[1:] if m.F_cr and row[0].F_cr]
    early = [f"{', '.join(key)}: {path.stopped}" for key, path in study.paths.items() if not path.complete]
    return [
        none_of("end conditions: paths complete", "every path reaches its end or a limit point", early),
        none_of("end conditions: kinds", "the engines find the same kind of critical point", kinds),
        at_most("end conditions: critical forces", max(apart, default=0.0), LOAD_AGREEMENT),
    ]


def discovery_rows(study: DiscoveryStudy | None) -> list[AcceptanceRow]:
    """The diagnosis names the cause that its data hold, predicts what it had not read, and the beams' buckling."""
    if study is None:
        return []
    rows = study.rows
    said = " + ".join([rows.verdict, *rows.causes])
    force, truth = rows.compression.extended_N, rows.truth_N
    apart = abs(force / truth - 1.0) if force and truth else float("inf")
    return [
        AcceptanceRow(
            name="discovery: verdict", requirement=f"named, {CAUSE}", value=said,
            passed=rows.verdict == "named" and rows.causes == [CAUSE],
        ),
        at_most("discovery: error of compression held out, over its force", rows.error, HELD_OUT),
        at_most("discovery: critical force in compression, against the beams that made the data", apart, HELD_OUT),
    ]  # fmt: skip


def robot_rows(study: RobotStudy | None) -> list[AcceptanceRow]:
    """Whole robots: refined chains against finite elements, and mobility by theory."""
    if study is None:
        return []
    rows = study.rows
    groups = (
        ("free of load", ROBOT_AGREEMENT, [r for r in rows.stiffness if r.robot == ROBOT and r.load == "none"]),
        ("under 1 kN", ROBOT_AGREEMENT, [r for r in rows.stiffness if r.robot == ROBOT and r.load != "none"]),
        ("other robots", OTHERS_AGREEMENT, [r for r in rows.stiffness if r.robot != ROBOT]),
    )
    result = [
        at_most(f"robots: stiffness, {name}", max(row.difference for row in group), limit)
        for name, limit, group in groups
        if group
    ]
    critical_rows: dict[tuple[str, str], list[RobotCriticalRow]] = {}
    for row in rows.critical:
        if row.engine in COMPARED:
            critical_rows.setdefault((row.pose, row.direction), []).append(row)
    lost = [f"{' '.join(key)} {row.engine}" for key, group in critical_rows.items() for row in group if row.stopped]
    lost += [f"{pose} {engine}" for (pose, _, engine), path in study.curves.items() if not path.complete]
    kinds = [" ".join(key) for key, group in critical_rows.items() if len({row.kind for row in group}) > 1]
    legs = [" ".join(key) for key, group in critical_rows.items() if len({row.first_leg for row in group}) > 1]
    reference = {(row.pose, row.direction): row.F_cr for row in rows.critical if row.engine == COMPARED[-1]}
    gaps = [
        abs(row.F_cr / force - 1.0) for row in rows.critical if row.engine in (*COMPARED, SECOND_ENGINE.label)
        if row.F_cr and (force := reference[row.pose, row.direction])
    ]  # fmt: skip
    result += [
        none_of("robots: paths complete", "every path reaches its end or a critical point", lost),
        none_of("robots: kinds of critical points", "the same in all engines that are refined", kinds),
        none_of("robots: legs that lose stability first", "the same in all engines that are refined", legs),
        at_most("robots: critical forces", max(gaps, default=float("nan")), ROBOT_AGREEMENT),
    ]
    curves = study.curves
    if curves:
        apart = [
            force_difference(curves[pose, sign, SPRINGS.label], path) / float(np.max(path.force))
            for (pose, sign, engine), path in curves.items()
            if engine == COMPARED[-1]
        ]
        result.append(at_most("robots: force at equal displacement, over the largest", max(apart), CURVE_AGREEMENT))
    wrong = [f"{row.robot} at {row.pose}" for row in rows.mobility if not row.holds]
    return [
        *result,
        at_most("robots: a part too long", max(row.difference for row in rows.misfit), OTHERS_AGREEMENT),
        none_of("robots: mobility and rank of K", "as theory says", wrong),
    ]


def verification_rows(verification: Sequence[VerificationRow]) -> list[AcceptanceRow]:
    """Cases with known answers, and frame invariance.

    What an engine refuses, because it is not installed or cannot express the case, fails nothing.
    """
    groups = (
        ("verification", "every case with a known answer is met, by theory's order", False),
        ("frame invariance", "at most 1e-9 when the base is turned", True),
    )
    rows = []
    for name, requirement, turned in groups:
        ran = [row for row in verification if (row.group == GROUP) is turned and row.passed is not None]
        if ran:
            failed = [f"{row.name}: {row.quantity}" for row in ran if not row.passed]
            rows.append(none_of(name, requirement, failed))
    return rows
