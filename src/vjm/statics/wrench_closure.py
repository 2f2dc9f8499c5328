"""Whether cables hold a platform whatever acts on it: wrench closure."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from vjm.model.law_states import law_states
from vjm.model.mechanism import Mechanism
from vjm.rank import NEGLIGIBLE, null_space, rank_of
from vjm.rotations import Array


def force_closed(pulls: Array) -> bool:
    """Whether pulls of cables carry every wrench: they span all, and some of them, all positive, balance.

    Args:
        pulls: ``(k, m)`` what a unit of each of m cables' pull does to each of k free motions.

    Example:
        >>> force_closed(np.array([[1.0, -1.0]])), force_closed(np.array([[1.0, 2.0]]))
        (True, False)
    """
    k, m = pulls.shape
    if m <= k or rank_of(pulls).rank < k:
        return False
    # t = 1 + u with u >= 0 in place of t > 0, which may be scaled at will
    size = np.linalg.norm(pulls, axis=0)
    scaled = pulls / np.where(size > 0.0, size, 1.0)
    _, left = nnls(scaled, -scaled.sum(axis=1))
    return bool(left < NEGLIGIBLE * m)


def cable_words(model: Mechanism, x: Array) -> tuple[str, ...]:
    """What is said of a machine's cables at a state, in one line; nothing where it has none.

    Args:
        model: of the machine.
        x: components ``(size,)`` of the state.
    """
    cables = [k for k, spring in enumerate(model.chain.point_springs) if spring.cable]
    if not cables:
        return ()
    states = {state.name: state for state in law_states(model, x) if state.what == "cable"}
    taut = [k for k in cables if states[model.chain.point_springs[k].name].place]
    at = model.kinematics(x)
    motions = null_space(model.closing_rows(at)[:, model.passive])
    pulls = -(model.stretching_rows(at)[taut][:, model.passive] @ motions).T
    held = "force-closed: with more pull in all they carry every load"
    if not force_closed(pulls):
        held = "not force-closed: under other loads the platform moves until others become taut"
    return (f"{len(taut)} of {len(cables)} cables are taut, and {held}",)
