"""What the solvers must do for a run to be accepted: convergence, stability, agreement of converged engines.

That a model or the paper is wrong is a finding, not a failure, and has no row here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from vjm.continuation.path import EventKind, Path
from vjm.engines import FROZEN
from vjm.io.findings import Finding, Grade
from vjm.model.load_case import Direction
from vjm_output.documents import Row
from vjm_validation.metrics import PathMetrics, force_difference, path_metrics, shape_difference
from vjm_validation.studies.chain import CAUSE, DiscoveryStudy, EndConditionStudy, Key
from vjm_validation.studies.robots import COMPARED, ROBOT, SECOND, SPRINGS, RobotCriticalRow, RobotStudy
from vjm_validation.verification.judging import TriangulationRow
from vjm_validation.verification.study import GROUP, Verification

RESIDUAL = 1e-8
"""Scaled equilibrium residual; the lumped solver stops at 1e-11, Exudyn at 1e-9 of its own norm."""
SHARP_POSTURES = ("A", "C")
"""Postures of the paper's chain whose compression has a sharp critical point."""
LOAD_AGREEMENT = 1e-3
"""Of critical forces between converged engines: their discretisation errors at 16 are below 1e-4."""
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
    followed = {key: path for key, path in paths.items() if key.engine != FROZEN}
    if not followed:
        return []
    early = [f"{key.stem}: {path.stopped}" for key, path in followed.items() if not path.complete]
    residuals = [p.residual for path in followed.values() for p in path.points]
    unstable = [f"{key.stem} at {p.s:.4g}" for key, path in followed.items() for p in path.points if p.unstable > 0]
    lost = [
        f"{key.stem} at {event.s:.4g}"
        for key, path in followed.items()
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


def agreement_rows(paths: Mapping[Key, Path]) -> list[AcceptanceRow]:
    """Converged lumped models against finite elements of the same parts, where both are in the run."""
    rows = []
    for posture in SHARP_POSTURES:
        for lumped, elements in (("vjm-16", "exudyn-footspring"), ("vjm-16f16", "exudyn")):
            path = paths.get(Key(posture, Direction.COMPRESSION, lumped))
            reference = paths.get(Key(posture, Direction.COMPRESSION, elements))
            if path is None or reference is None:
                continue
            name = f"{posture} compression, {lumped} against {elements}"
            ours, theirs = path.critical, reference.critical
            if ours is None or theirs is None or ours.kind is not theirs.kind:
                rows.append(none_of(name, "the same kind of critical point", [f"{ours} and {theirs}"]))
                continue
            rows.append(at_most(f"{name}: critical force", abs(ours.force / theirs.force - 1.0), LOAD_AGREEMENT))
            if elements != "exudyn":
                continue
            # the two laws for a lumped foot differ at finite rotation, the refined feet must not
            rows.append(at_most(f"{name}: critical displacement", abs(ours.s / theirs.s - 1.0), CURVE_AGREEMENT))
            apart = force_difference(path, reference) / theirs.force
            rows.append(at_most(f"{name}: force at equal displacement over F_cr", apart, CURVE_AGREEMENT))
            rows.append(
                at_most(
                    f"{name}: deflected shape over its amplitude",
                    shape_difference(path, reference),
                    CURVE_AGREEMENT,
                )
            )
    return rows


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
        abs(row.F_cr / force - 1.0) for row in rows.critical if row.engine in (*COMPARED, SECOND.label)
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


def verification_rows(verification: Verification) -> list[AcceptanceRow]:
    """Cases with known answers, frame invariance, and three engines on the paper's chain.

    What an engine refuses, because it is not installed or cannot express the case, fails nothing.
    """
    groups = (
        ("verification", "every case with a known answer is met, by theory's order", verification.rows, False),
        ("frame invariance", "at most 1e-9 when the base is turned", verification.rows, True),
    )
    rows = []
    for name, requirement, asked, turned in groups:
        ran = [row for row in asked if (row.group == GROUP) is turned and row.passed is not None]
        if ran:
            failed = [f"{row.name}: {row.quantity}" for row in ran if not row.passed]
            rows.append(none_of(name, requirement, failed))
    pairs: dict[str, list[TriangulationRow]] = {}
    for row in verification.triangulation:
        pairs.setdefault(" and ".join(row.engines), []).append(row)
    requirement = "critical forces to 0.1 %, 1 mm behind to 0.2 %, whole curves to 0.5 %"
    for engines, asked_pairs in pairs.items():
        name = f"agreement of {engines}"
        ran_pairs = [row for row in asked_pairs if row.passed is not None]
        if not ran_pairs:
            why = next((row.not_run for row in asked_pairs if row.not_run), "")
            rows.append(AcceptanceRow(name=name, requirement=requirement, value=f"not run: {why}", passed=None))
            continue
        failed = [f"{row.posture} {row.direction} {row.quantity}" for row in ran_pairs if not row.passed]
        agreement = none_of(name, requirement, failed)
        if len(ran_pairs) < len(asked_pairs) and not failed:
            agreement = agreement.model_copy(
                update={"value": f"{len(ran_pairs)} of {len(asked_pairs)}, the rest not run"}
            )
        rows.append(agreement)
    return rows
