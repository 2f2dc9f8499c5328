"""The ends of what was measured held out: extrapolation along one joint, the clock or the temperature at a time.

Regions inside the data do not extrapolate. Here the fifth of the postures with the smallest, and that with the
largest coordinate of each joint are predicted by the others. So are the first and the last fifth of the clock, and
of the temperature, where they are known.
"""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.fit import Blocks, PoseSolution, without
from vjm_updating.poses.study import Study

SHARE = numerical(0.2)
"""Of the postures, that an end has."""
MOST = numerical(0.5)
"""Share of the postures above which an end, of a coordinate with a few values, is none."""


def ends_of(study: Study, *, clock_only: bool = False) -> list[np.ndarray]:
    """Which postures ``(g,)`` each end has; those of a coordinate that does not change are left away.

    Args:
        study: the test.
        clock_only: the ends of the clock and of the temperature alone.
    """
    data = study.data
    courses = [] if clock_only else [data.q[:, i] for i in range(data.q.shape[1])]
    if study.ordered:
        courses.append(np.arange(len(data), dtype=float))
    courses += [course for course in (data.time, data.temperature) if course is not None]
    result = []
    for course in courses:
        if not np.ptp(course) > 0.0:
            continue
        low, high = np.quantile(course, [SHARE, 1.0 - SHARE])
        result += [own for own in (course <= low, course >= high) if own.mean() <= MOST]
    return result


def errors_at_ends(
    study: Study, blocks: Blocks, solution: PoseSolution, sigma: Array, *, clock_only: bool = False
) -> Array:
    """Distances ``(g, k)`` mm of postures at ends, each predicted without its end; nan at none.

    A posture at several ends counts by its mean.
    """
    active = solution.active
    total, count = np.zeros(sigma.shape[:2]), np.zeros(sigma.shape[:2])
    for own in ends_of(study, clock_only=clock_only):
        rows = own[blocks.posture]
        whitened = np.full(len(blocks.y), np.nan)
        z = without(blocks, solution, rows)
        whitened[rows] = blocks.y[rows] - blocks.J[rows][:, active] @ z
        distance = study.distance(study.unwhitened(whitened, sigma))
        seen = np.isfinite(distance)
        total[seen] += distance[seen]
        count += seen
    return np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)
