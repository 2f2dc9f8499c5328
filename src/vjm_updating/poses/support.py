"""What the postures support over the joints' whole range: how far a file may go there, and how well it is known.

Postures in a small region determine numbers well enough to predict that region, and say little of the rest. What
the model lacks is nearly the same in all of a small region, and the numbers take it up. So there is one more
prior, with a unit: what they change over the joints' whole range is as large, root mean square, as what the model
before them misses where it was measured. All directions of that change are equally likely. It is as if it had been
measured by as many numbers as there are members, with that error. Postures that cover the range outweigh it.

How well the file is known there is said by fits without one region of the postures each: how far their predictions
lie apart, the jackknife by groups (Kott, J. Official Statistics 17, 521, 2001). It needs no law of the noise.

Frames of tracker and markers are refitted wherever a machine is used. So what they can take up does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import definition, numerical
from vjm_updating.poses.fit import best_of, solve
from vjm_updating.poses.state import Candidates, FittedState
from vjm_updating.poses.study import Study

COUNT = numerical(300)
"""Postures drawn over the joints' whole range."""
SEED = numerical(11)
TURN = definition(2.0 * np.pi, "rad")
"""Of a joint, after which its postures are the same."""
DEPENDENT = numerical(1e-9)
"""Singular value over the largest, below which a direction is none."""
BY_REGION = definition(1)
"""Number of the regions among the kinds of folds, see `vjm_updating.poses.folds.Folds.parts`."""


@dataclass(frozen=True)
class RangeSupport:
    """What the postures support.

    Attributes:
        unsupported: members that are nearer to the model's value than to what the postures alone say.
        place: ``(c, 3)`` mm of the first marker by the rigid model, in the postures drawn, and
        error: ``(c,)`` mm predicted there of the file: root mean square of its markers.
        asked: by how much the numbers change the predictions over all of it by the postures alone, and
        changed: as they stand in the file, root mean squares.
        model: root mean square that the model before it misses, where it was measured.
    """

    unsupported: tuple[str, ...]
    place: Array
    error: Array
    asked: float
    changed: float
    model: float

    @property
    def known(self) -> float:
        """Root mean square of the errors that are predicted over the joints' whole range."""
        return float(np.sqrt(np.mean(self.error**2)))


def whole_range(study: Study) -> list[tuple[float, float]]:
    """The whole range of each joint, rad or mm: its limits, or a turn. Without either what was measured."""
    found = []
    for i, name in enumerate(study.data.joints):
        own = (float(study.data.q[:, i].min()), float(study.data.q[:, i].max()))
        limits = study.machine.limits[i]
        if name in study.machine.turning and (limits is None or limits[1] - limits[0] >= TURN):
            middle = 0.5 * (own[0] + own[1])
            found.append((middle - 0.5 * TURN, middle + 0.5 * TURN))
        else:
            found.append(own if limits is None or not np.isfinite(limits).all() else limits)
    return found


def supported(study: Study, state: FittedState, model: float) -> tuple[FittedState, RangeSupport | None]:
    """The fit with the prior over the joints' whole range, and what it says there.

    Args:
        study: the test.
        state: the fit.
        model: root mean square that the model before it misses, held out by region, mm.

    Returns:
        The fit as it was, and None, where nothing was fitted or can be held out, or a posture has no equilibrium.
    """
    n, active = state.blocks.nuisances, state.solution.active
    if len(active) <= n or not study.folds.several or not 0.0 < model < np.inf:
        return state, None
    rng = np.random.default_rng(SEED)
    drawn = study.drawn(rng, COUNT, whole_range(study))
    try:
        J = effects(study, state, drawn)[..., active[n:] - n]
    except NoConvergenceError:
        return state, None
    members = [study.members[u - n] for u in active[n:]]
    W = np.einsum("gkap,gkaq->pq", J, J) / (J.shape[0] * J.shape[1])
    scale = np.sqrt(np.maximum(np.diag(W), np.finfo(float).tiny))
    rank = np.linalg.matrix_rank(W / np.outer(scale, scale), tol=DEPENDENT, hermitian=True)
    before = state.solution.z[active[n:]]
    found = _with_prior(study, state, W * rank / model**2)
    after = found.solution.z[active[n:]]
    nearer = np.abs(after) < np.abs(after - before)
    names = tuple(m.name for m, near in zip(members, nearer, strict=True) if near)
    place = unloaded_frames(study.machine.tree, study.machine.rows(drawn.q))[1][:, 0]
    asked, changed = (float(np.sqrt(z @ W @ z)) for z in (before, after))
    return found, RangeSupport(names, place, _errors(found, J), asked, changed, model)


def _with_prior(study: Study, state: FittedState, precision: Array) -> FittedState:
    """A fit with one more normal prior of its members ``(p, p)``, as a reading of zeros that no part holds out."""
    blocks, members = state.blocks, state.solution.active[state.blocks.nuisances :]
    N = blocks.N.copy()
    N[np.ix_(members, members)] += state.solution.noise**2 * precision
    held = replace(blocks, N=N)
    solution = solve(held, study.numbers(state.hypothesis), state.solution.sizes)
    errors = study.errors(held, solution, state.sigma)
    return replace(state, z=solution.z[blocks.nuisances :], blocks=held, solution=solution, errors=errors)


def effects(study: Study, state: FittedState, drawn: Candidates) -> Array:
    """Motions ``(c, k, 3, P)`` of the markers by the members, mm per unit, without what the frames take up."""
    at = study.at_candidates(state, drawn)
    J, F = at.member[..., :3, :], at.nuisance[..., :3, :].reshape(-1, at.nuisance.shape[-1])
    U, s, _ = np.linalg.svd(F, full_matrices=False)
    U = U[:, s > DEPENDENT * float(s.max(initial=0.0))]
    flat = J.reshape(-1, J.shape[-1])
    result: Array = (flat - U @ (U.T @ flat)).reshape(J.shape)
    return result


def _errors(state: FittedState, J: Array) -> Array:
    """Predicted errors ``(c,)`` mm by fits without one region each.

    Args:
        state: the fit.
        J: ``(c, k, 3, p)`` motions of the markers by its members.
    """
    blocks, active = state.blocks, state.solution.active
    z = np.array(
        [
            best_of(blocks, state.solution, (blocks.N - N)[np.ix_(active, active)], (blocks.b - b)[active])
            for N, b in blocks.parts[BY_REGION]
        ]
    )[:, blocks.nuisances :]
    moved = np.einsum("gkap,rp->rgka", J, z - z.mean(axis=0))
    result: Array = np.sqrt(np.mean(np.sum(moved**2, axis=3), axis=2).sum(axis=0) * (len(z) - 1) / len(z))
    return result
