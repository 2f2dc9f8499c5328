"""The verification hierarchy.

Here are cases with known answers, frame invariance and the foot's matrix.
Every solver must get there before any two are compared with each other on the paper's findings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from vjm.batch import map_all
from vjm.continuation.path import Event, EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.io.model_file import load_chain
from vjm.model.load_case import COMPONENTS, Direction, LoadCase, PointControl, ramp_end
from vjm.model.machine import FOOT, Machine
from vjm.rotations import Array, frame, rotate_matrix6, rotation_from_vector
from vjm_fea.opensees.beams import available
from vjm_updating.identify.rounding import printed_entries
from vjm_validation.verification.judging import (
    VerificationRow,
    case_rows,
    matching_digits,
)
from vjm_validation.verification.library import BASELINES, Case, Family, picked
from vjm_validation.verification.runner import (
    MESHED,
    chain_of,
    engine,
    load_case_of,
    run_cases,
)

MODEL = "orthoglide-chain"


TURN = rotation_from_vector([0.7, -1.1, 0.4])
"""A rotation with no axis of the world in it, ``(3, 3)``."""
TOLERANCE = 1e-9
MESH = 4
"""Springs or elements of every beam; the mesh is nothing to the axes."""
LINEAR_MM = 1.0
"""End of the ramp in cases that ask for small displacements only."""
SIDES = 8
"""Of an arc."""
GROUP = "invariance"
SAME_PLACE = 1e-13
"""Difference of two path parameters that are one, over the path's length."""
STILL = 1e-9
"""Displacement, over the path's largest, that is none."""
FORCES_ONLY = ("exudyn",)
"""Families of which forces and displacements are compared. Exudyn's 6×6 stiffness moves by 5e-9 of its largest
entry when the base is turned, by rounding as its inner coordinates are condensed, and events by 3e-9 of a path."""


def turnable(load_case: LoadCase) -> bool:
    """Whether the load case can be said in turned axes."""
    return len(load_case.free) in (0, len(COMPONENTS))


def turned(chain: Machine, load_case: LoadCase, R: Array) -> tuple[Machine, LoadCase]:
    """The chain on a base turned by ``R`` (3, 3), and its load case likewise.

    Raises:
        ValueError: the end-effector is free in some of the world's axes and held in others.
    """
    if not turnable(load_case):
        raise ValueError(f"free in {', '.join(load_case.free)} of the world's axes: cannot be turned")
    changes: dict[str, Any] = {
        "loads": tuple(replace(load, wrench=tuple(_turned6(np.array(load.wrench), R))) for load in load_case.loads)
    }
    if load_case.gravity is not None:
        changes["gravity"] = tuple(R @ np.array(load_case.gravity))
    if isinstance(load_case.control, PointControl):
        along = tuple(R @ np.array(load_case.control.direction))
        changes["control"] = replace(load_case.control, direction=along)
    if not load_case.load_driven:
        # the sign is in `to`
        changes["axis"] = tuple(_turned6(load_case.sign * load_case.direction, R))
    return replace(chain, base=frame(R) @ chain.base), replace(load_case, **changes)


@dataclass(frozen=True)
class Turned:
    """One chain and load case to be turned, and the engine that traces both."""

    name: str
    family: Family
    chain: Machine
    load_case: LoadCase
    mesh: int = MESH


def invariance_rows(
    cases: Sequence[Case],
    families: Sequence[Family] = ("vjm",),
    chains: Sequence[Family] = MESHED,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> list[VerificationRow]:
    """The paper's chain in every posture and direction on every engine, and every case that can be turned.

    Args:
        cases: of the library.
        families: engines that take the cases.
        chains: engines that take the paper's chain.
        jobs: processes.
        progress: called with how many items are done, and of how many.
    """
    items = []
    chain = load_chain(MODEL)
    for family in (family for family in chains if family != "opensees" or available()):
        for posture in sorted(chain.postures):
            for way in Direction:
                load_case = LoadCase(posture, ramp_end(chain, posture, way), steps=8)
                items.append(Turned(f"{MODEL} {posture}, {way}", family, chain, load_case))
    items += [item for family in families for case in cases for item in _of_case(case, family)]
    return map_all(_invariance_row, items, jobs, progress)


def _of_case(case: Case, family: Family) -> list[Turned]:
    table = case.file.engines.get(family)
    if table is None or family in BASELINES:
        return []
    mesh = SIDES if case.file.sided else MESH
    turned_cases = []
    for run in case.file.runs:
        load_case = load_case_of(run, mesh)
        if case.file.group == "linear":
            # its ramp is next to nothing, and the force behind it rounding
            load_case = replace(load_case, to=float(np.copysign(LINEAR_MM, load_case.to)))
        if turnable(load_case):
            name = " ".join(filter(None, [case.name, run.name]))
            elements = 1 if case.file.sided else MESH
            turned_cases.append(Turned(name, family, chain_of(case, mesh), load_case, elements))
    return turned_cases


def _invariance_row(item: Turned) -> VerificationRow:
    solver = engine(item.family, item.mesh)
    path = solver.trace(item.chain, item.load_case)
    turned_path = solver.trace(*turned(item.chain, item.load_case, TURN))
    whole = item.family not in FORCES_ONLY
    error, failure = None, ""
    try:
        error = difference(path, turned_path, TURN, whole=whole)
        if error > TOLERANCE and path.events:
            # which of two mirrored branches is taken is said in the world's axes
            mirrored = solver.trace(item.chain, replace(item.load_case, branch=-item.load_case.branch))
            error = min(error, difference(mirrored, turned_path, TURN, whole=whole))
    except NoConvergenceError as different:
        failure = str(different)
    return VerificationRow(
        name=f"{item.name}, base turned, {item.family}",
        kind="exact",
        quantity=f"largest change of {'stiffness, event, ' if whole else ''}force or displacement, relative",
        reference=0.0,
        source="mechanics knows no preferred axes",
        value=error,
        error=error,
        tolerance=TOLERANCE,
        order=None,
        passed=error is not None and error <= TOLERANCE,
        case=GROUP,
        group=GROUP,
        engine=item.family,
        reason="rounding, and events' places, which are found to 1e-9 of the path",
        digits=None if error is None else matching_digits(error),
        not_run=failure,
    )


def difference(path: Path, turned_path: Path, R: Array, *, whole: bool = True) -> float:
    """Largest change of stiffness, forces, events and displacements, each over its largest.

    Args:
        path: the path as it was.
        turned_path: with the base turned by ``R``.
        R: ``(3, 3)``.
        whole: whether stiffness and the forces of events are compared; the number of events always is.

    Raises:
        NoConvergenceError: the paths do not correspond: another number of events, or no point in common.
    """
    events, turned_events = _seen(path), _seen(turned_path)
    if len(events) != len(turned_events) or path.complete != turned_path.complete:
        raise NoConvergenceError(
            f"{len(events)} events and {path.stopped or 'complete'}, turned {len(turned_events)} and "
            f"{turned_path.stopped or 'complete'}"
        )
    pairs = zip(events, turned_events, strict=True)
    changes = [_relative(np.array([a.force]), np.array([b.force])) for a, b in pairs if whole]
    K, K_turned = path.points[0].stiffness, turned_path.points[0].stiffness
    if whole and K is not None and K_turned is not None:
        finite = bool(np.isfinite(K).all())
        if finite != bool(np.isfinite(K_turned).all()):
            raise NoConvergenceError("the stiffness is infinite in one of the two machines only")
        if finite:
            # a machine that is rigid in some direction has none to compare
            changes.append(_relative(rotate_matrix6(K, R), K_turned))
    # points that an event or an adaptive step has put elsewhere are not compared
    rows = [(i, int(np.argmin(np.abs(turned_path.s - s)))) for i, s in enumerate(path.s)]
    rows = [(i, j) for i, j in rows if abs(path.s[i] - turned_path.s[j]) <= SAME_PLACE * path.s[-1]]
    if len(rows) > 1:
        a, b = (list(column) for column in zip(*rows, strict=True))
        moved = np.array([R @ u[:3] for u in path.displacement[a]])
        changes += [_relative(path.force[a], turned_path.force[b])]
        changes += [_relative(moved, turned_path.displacement[b, :3])]
    if not changes:
        raise NoConvergenceError("the paths have nothing in common to be compared")
    return max(changes)


def _seen(path: Path) -> list[Event]:
    """The events, without bends of a machine that is rigid along its load: half of a stiffness that is rounding."""
    way = np.linalg.norm(path.displacement[:, :3], axis=1)
    still = STILL * float(way.max())
    return [
        event
        for event in path.events
        if event.kind is not EventKind.STIFFNESS_KNEE or float(np.interp(event.s, path.s, way)) > still
    ]


def _relative(a: Array, b: Array) -> float:
    size = float(np.max(np.abs(a)))
    return float(np.max(np.abs(a - b))) / size if size > 0.0 else float(np.max(np.abs(b)))


def _turned6(vector: Array, R: Array) -> Array:
    return np.concatenate([R @ vector[:3], R @ vector[3:]])


def verify(
    chain: Machine,
    *,
    cases: Sequence[str] = (),
    quick: bool = False,
    jobs: int = 1,
    folder: FilePath | None = None,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> list[VerificationRow]:
    """Run the verification hierarchy: a row for every quantity of every case on every engine.

    Args:
        chain: the paper's.
        cases: only these, by name, and nothing else; all where it is empty.
        quick: without the cases that take long.
        jobs: processes.
        folder: of the run, where answers are kept and those of an interrupted run are found.
        progress: called with a stage's name, how much of it is done, and of how much.
    """
    wanted = picked(cases, quick=quick)
    answers = run_cases(wanted, jobs=jobs, folder=folder, progress=_stage(progress, "verification cases"))
    rows = case_rows(wanted, answers, jobs)
    if cases:
        return rows
    rows += invariance_rows(wanted, jobs=jobs, progress=_stage(progress, "frame invariance"))
    return rows + foot_rows(chain)


def _stage(progress: Callable[[str, int, int], None], name: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(name, done, total)


def foot_rows(chain: Machine) -> list[VerificationRow]:
    """The foot as a beam has the foot's printed matrix (19), unloaded, within the printed digits."""
    foot = next((beam for beam in chain.beams if beam.name == FOOT), None)
    if foot is None or foot.section is None or foot.compliance is None:
        return []
    ours = foot.beam_compliance()
    theirs = foot.tip_compliance()
    entries = [e for e in printed_entries(chain) if e.part == FOOT]
    worst = max(entries, key=lambda e: abs(ours[e.row, e.column] - theirs[e.row, e.column]) / e.half_unit)
    value, reference = float(ours[worst.row, worst.column]), float(theirs[worst.row, worst.column])
    tolerance = worst.half_unit / abs(reference)
    error = abs(value / reference - 1.0)
    return [
        VerificationRow(
            name="foot as a beam against (19), worst entry",
            kind="published",
            quantity=f"compliance ({worst.row + 1},{worst.column + 1})",
            reference=reference,
            source="Pashkevich, Klimchik, Chablat, eq. (19); half a unit of the last printed digit",
            value=value,
            error=error,
            tolerance=tolerance,
            order=None,
            passed=error <= tolerance,
            case="foot",
            group="paper",
            engine="beam theory",
            reason="half a unit of the last printed digit",
        )
    ]
