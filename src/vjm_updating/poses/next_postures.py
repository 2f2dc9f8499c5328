"""The next readings to take: those that make the members (D) or the predictions (I) most certain.

From a list, or drawn within the joints' limits. Chosen one after another: D-optimal adds the most to the log
determinant of the information about the members. I-optimal takes the most from the mean variance of predictions
of the postures measured so far (Atkinson, Donev and Tobias, Optimum Experimental Designs, 2007).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.poses.document import NextRow
from vjm_updating.poses.state import Candidates, FittedState
from vjm_updating.poses.study import Study

CRITERIA: tuple[Literal["D", "I"], ...] = ("D", "I")
CANDIDATES = numerical(200)
COUNT = numerical(6)
SEED = numerical(7)
SAMPLE = numerical(60)
"""Measured postures whose predictions are looked at."""


def next_postures(study: Study, state: FittedState, listed: Candidates | None = None) -> list[NextRow]:
    """Next postures by both criteria; empty where nothing was fitted but frames."""
    if not state.hypothesis.families:
        return []
    possible = study.drawn(np.random.default_rng(SEED), CANDIDATES) if listed is None else listed
    try:
        at = study.at_candidates(state, possible)
    except NoConvergenceError:
        return []
    J = np.concatenate([at.nuisance, at.member], axis=3).reshape(len(possible), -1, len(state.blocks.b))
    active = state.solution.active
    sigma = _sigma(state)
    rows = J[..., active] / sigma[None, :, None]
    rows = np.nan_to_num(rows)
    keep = np.linspace(0, len(study.data) - 1, min(SAMPLE, len(study.data))).astype(int)
    seen = np.concatenate([state.at.nuisance, state.at.member], axis=3)[keep][..., :3, :]
    view = seen.reshape(-1, seen.shape[-1])[:, active]
    return [_chosen(study, criterion, state, rows, view, possible) for criterion in CRITERIA]


def _sigma(state: FittedState) -> Array:
    """Standard deviation ``(6 k,)`` of one reading."""
    sigma: Array = np.nanmedian(state.sigma, axis=0).reshape(-1)
    present = np.isfinite(state.at.residual).any(axis=0).reshape(-1)
    return np.where(present, sigma, np.inf)


def _chosen(
    study: Study, criterion: Literal["D", "I"], state: FittedState, rows: Array, view: Array, possible: Candidates
) -> NextRow:
    n = state.blocks.nuisances
    before = state.solution.covariance
    free = np.diag(before) > 0.0
    C = before.copy()
    taken: list[int] = []
    for _ in range(min(COUNT, len(possible))):
        best, best_gain = -1, -np.inf
        for i, J in enumerate(rows):
            if i in taken:
                continue
            S = np.eye(len(J)) + J @ C @ J.T
            if criterion == "D":
                gain = float(np.linalg.slogdet(S)[1])
            else:
                G = view @ C @ J.T
                gain = float(np.sum(G * np.linalg.solve(S, G.T).T))
            if gain > best_gain:
                best, best_gain = i, gain
        taken.append(best)
        J = rows[best]
        CJ = C @ J.T
        C = C - CJ @ np.linalg.solve(np.eye(len(J)) + J @ CJ, CJ.T)
    members = free.copy()
    members[:n] = False
    ratio = np.sqrt(np.maximum(np.diag(C)[members], 1e-300) / np.diag(before)[members])
    seen_before = np.einsum("ri,ij,rj->r", view, before, view)
    seen_after = np.einsum("ri,ij,rj->r", view, C, view)
    promised = float(np.exp(np.mean(np.log(ratio)))) if len(ratio) else 1.0
    loads = [dict(zip(study.points, load.tolist(), strict=True)) for load in possible.load[taken]]
    prediction = float(np.sqrt(seen_after.sum() / max(seen_before.sum(), 1e-300)))
    return NextRow(
        criterion=criterion, joints=list(study.data.joints), q=possible.q[taken].tolist(), loads=loads,
        members=promised, prediction=prediction,
    )  # fmt: skip
