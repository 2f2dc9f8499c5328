"""A series that changed in its course, cut at the changes: each part has what changed as numbers of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import assert_never

import numpy as np

from vjm_updating.constants import numerical
from vjm_updating.poses.changes import ChangeKind, ChangePoint, changes
from vjm_updating.poses.families import ZEROS
from vjm_updating.poses.forward import BASE_PLACE, BASE_TURN, MARKER_FRAME, MARKER_PLACE
from vjm_updating.poses.pooled import PooledStudy, unknowns_of, zero_of
from vjm_updating.poses.state import FittedState, Hypothesis
from vjm_updating.poses.study import SeriesStudy, Study

READINGS = numerical(2.0)
"""Numbers that a part has to have for each unknown of its own; of fewer it says nothing of the machine."""


@dataclass(frozen=True)
class FoundChange:
    """A change, and the series in the course of which it is."""

    study: SeriesStudy
    change: ChangePoint


def found_changes(study: Study, state: FittedState) -> list[FoundChange]:
    """Changes in the course of each series; none of a test that was cut.

    Args:
        study: the test.
        state: its fit. A series of several is fitted alone, by the same families.
    """
    if not isinstance(study, PooledStudy):
        return [FoundChange(one, change) for one in study.groups for change in changes(one, state)]
    found = []
    for one in study.tests:
        if one.ordered:
            families = tuple(name for name in state.hypothesis.families if name in one.families)
            alone = one.settle(Hypothesis(families, state.hypothesis.as_deflected))
            found += [FoundChange(one, change) for change in changes(one, alone)]
    return found


def cut(study: Study, found: Sequence[FoundChange]) -> tuple[Study, list[tuple[int, int]]]:
    """The test with its series cut at the changes: a part has what changed as its own, and the rest as before.

    Parts with too few readings are left out.

    Args:
        study: the test.
        found: the changes.

    Returns:
        The test, the same where no part has enough readings; first and last row of each part that was left out.
    """
    tests = study.tests if isinstance(study, PooledStudy) else study.groups
    groups, series, anew, left_out = [], [], [], []
    for number, one in enumerate(tests):
        own = [c.change for c in found if c.study is one]
        changed: set[str] = set()
        for first, last in pairwise([0, *sorted({c.where for c in own}), len(one.data)]):
            for change in own:
                if change.where == first:
                    changed.update(changed_by(one, change))
            part = _part(one, first, last)
            if part is None:
                left_out.append((int(one.data.row[first]), int(one.data.row[last - 1])))
            else:
                groups.append(part)
                series.append(number)
                anew.append(tuple(changed))
                changed = set()
    if not groups or not found:
        return study, []
    return (groups[0] if len(groups) == 1 else PooledStudy(groups, series, anew)), left_out


def changed_by(study: SeriesStudy, change: ChangePoint) -> list[str]:
    """Names of the nuisances and zeros that a change changes, see `vjm_updating.poses.pooled.unknowns_of`."""
    zeros = [m for m in study.members if m.family in ZEROS]
    match change.kind:
        case ChangeKind.SHIFT:
            if study.turns_with_tracker:
                return [BASE_PLACE]
            # no unknown of displacements shifts them all: anything may have changed
            return [name for name, _ in unknowns_of(study.forward(), zeros)]
        case ChangeKind.FRAME:
            return [BASE_TURN, BASE_PLACE]
        case ChangeKind.MARKER:
            return [f"{MARKER_PLACE} {change.name}", f"{MARKER_FRAME} {change.name}"]
        case ChangeKind.JOINT_ZERO:
            return [zero_of(m) for m in zeros if m.family == "joint_offset" and m.subject == change.name]
        case ChangeKind.LOAD_ZERO:
            return [zero_of(m) for m in zeros if m.family == "instrument_zero" and m.subject == change.name]
        case _:
            assert_never(change.kind)


def _part(study: SeriesStudy, first: int, last: int) -> SeriesStudy | None:
    """Some neighbouring readings of a test; None where they are too few for frames and zeros of their own."""
    if (first, last) == (0, len(study.data)):
        return study
    seen = int(study.present[first:last].sum())
    unknowns = study.forward().nuisances + sum(m.family in ZEROS for m in study.members)
    if seen < READINGS * unknowns:
        return None
    keep = np.arange(first, last)
    return type(study)(study.sheet, study.machine, study.data.only(keep), study.outliers)
