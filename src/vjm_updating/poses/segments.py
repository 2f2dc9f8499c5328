"""A series that changed in its course, cut at the changes: each part has frames, markers and zeros of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vjm_updating.constants import numerical
from vjm_updating.poses.changes import ChangePoint, changes
from vjm_updating.poses.families import ZEROS
from vjm_updating.poses.pooled import PooledStudy
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
    """The test with its series cut at the changes.

    Parts with too few readings are left out.

    Args:
        study: the test.
        found: the changes.

    Returns:
        The test, the same where no part has enough readings; first and last row of each part that was left out.
    """
    tests = study.tests if isinstance(study, PooledStudy) else study.groups
    groups, series, left_out = [], [], []
    for number, one in enumerate(tests):
        ends = [0, *sorted({c.change.where for c in found if c.study is one}), len(one.data)]
        for first, last in pairwise(ends):
            part = _part(one, first, last)
            if part is None:
                left_out.append((int(one.data.row[first]), int(one.data.row[last - 1])))
            else:
                groups.append(part)
                series.append(number)
    if not groups or not found:
        return study, []
    return (groups[0] if len(groups) == 1 else PooledStudy(groups, series)), left_out


def _part(study: SeriesStudy, first: int, last: int) -> SeriesStudy | None:
    """Some neighbouring readings of a test; None where they are too few."""
    if (first, last) == (0, len(study.data)):
        return study
    seen = int(study.present[first:last].sum())
    unknowns = study.forward().nuisances + sum(m.family in ZEROS for m in study.members)
    if seen < READINGS * unknowns:
        return None
    keep = np.arange(first, last)
    return type(study)(study.sheet, study.machine, study.data.only(keep), study.outliers)
