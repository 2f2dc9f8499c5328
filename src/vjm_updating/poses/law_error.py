"""What it changes of a hypothesis' evidence that the laws of its families are right to some per cent only.

A spring that stiffens a little, a gear with one more harmonic: what a family does beyond its law is what it does by
the law times a smooth function of what the law depends on. Geometry, weights and the scales of encoders have no
such error. See `vjm_updating.inference.law_error`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import cho_factor, cho_solve

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.law_error import integrated, principal
from vjm_updating.observation.significance import LAW_ERROR
from vjm_updating.poses.families import COMPLIANCE, WAVES, Member
from vjm_updating.poses.fit import Blocks, PoseSolution, precision_of, scaled
from vjm_updating.poses.posture_noise import PostureNoise
from vjm_updating.poses.readings import PoseData

DEGREE = numerical(4)
"""Of the polynomials by which a law may be off."""
EXACT = ("joint_offset", "frame_error", "mass", "encoder_scale", "load_zero")
"""Families whose laws are geometry or scales."""


def law_shapes(members: Sequence[Member], data: PoseData, bearing: Array) -> list[Array | None]:
    """Functions of the posture ``(g, k)`` by which the law of each member may be off; None: it is exact.

    Args:
        members: of a test.
        data: its postures.
        bearing: ``(g, n_tree)`` what each coordinate bears, N mm or N.
    """
    return [_shapes(member, data, bearing) for member in members]


def _shapes(member: Member, data: PoseData, bearing: Array) -> Array | None:
    if member.family in EXACT:
        return None
    if member.kind == COMPLIANCE:
        return _smooth(bearing[:, member.index])
    if member.family == "gear_error":
        q = data.q[:, data.joints.index(member.subject)]
        return np.sqrt(2.0 / len(WAVES)) * np.column_stack([wave(q) for wave in WAVES.values()])
    return None if member.basis is None else _smooth(member.basis)


def _smooth(argument: Array) -> Array | None:
    """Legendre's polynomials ``(g, DEGREE)`` of an argument ``(g,)``, of mean square one in all."""
    most = float(np.abs(argument).max(initial=0.0))
    if most == 0.0:
        return None
    shapes = legendre.legvander(argument / most, DEGREE)[:, 1:]
    result: Array = shapes / np.sqrt(DEGREE * np.maximum(np.mean(shapes**2, axis=0), 1e-300))
    return result


def law_evidence(
    blocks: Blocks, shapes: Sequence[Array | None], members: Sequence[Member], solution: PoseSolution,
    noise: PostureNoise, whitened: Blocks,
) -> float:  # fmt: skip
    """What the discrepancy of its families adds to the logarithm of a fit's evidence.

    Args:
        blocks: readings as they are.
        shapes: of the members, see `law_shapes`.
        members: of the test.
        solution: the fit to the readings made independent.
        noise: how readings of like postures are correlated.
        whitened: the readings made independent.
    """
    n = blocks.nuisances
    groups: dict[tuple[str, int], list[int]] = {}
    for u in solution.active[n:]:
        if shapes[u - n] is not None and solution.z[u] != 0.0:
            groups.setdefault((members[u - n].family, members[u - n].index), []).append(int(u))
    if not groups:
        return 0.0
    made = [
        (blocks.J[:, own] @ solution.z[own])[:, None] * shape[blocks.posture]
        for own in groups.values()
        if (shape := shapes[own[0] - n]) is not None
    ]
    noise2 = solution.noise**2
    D = noise.independent(np.concatenate(made, axis=1)) / solution.noise
    held = np.isin(solution.active, solution.at_bound)
    free = solution.active[~held]
    J = whitened.J[:, free] / solution.noise
    r = (whitened.y - whitened.J[:, solution.active] @ solution.z[solution.active]) / solution.noise
    precision = precision_of(blocks, blocks.family[solution.active], solution.sizes)[~held]
    A, scale = scaled(whitened.N[np.ix_(free, free)] / noise2 + np.diag(precision))
    X = (J.T @ D) * scale[:, None]
    M = D.T @ D - X.T @ cho_solve(cho_factor(A, lower=True), X)
    turn, sizes = principal(M)
    left = (D @ turn).T @ r / sizes
    return -0.5 * integrated(sizes, left, LAW_ERROR)
