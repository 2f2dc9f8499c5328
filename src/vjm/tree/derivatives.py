"""Exact derivatives of end frames at equilibria: by values of joints, by forces on coordinates, by loads.

With the statics ``r(x, p) = 0`` and their tangent A, ``A dx = (∂r/∂p) dp``. Everything that a parameter of a
posture changes comes down to three right sides: a held value moves bodies and their weights, a spring's law
changes the force on its own coordinate, a load acts through its Jacobian. No difference is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.kernels.beam_column import beam_column, beam_column_by_length
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.packed_model import BEAM_COLUMN, Floats, Ints
from vjm.rotations import Array
from vjm.tree.arrays import GROWS, TreeArrays, TreeWork, workspace
from vjm.tree.dense import factor, solve
from vjm.tree.kernel import evaluate, grown, jacobian, place, segment


@dataclass(frozen=True)
class FrameDerivatives:
    """Velocities of e end frames in g postures, world axes, mm and rad.

    Attributes:
        value: ``(g, e, 6, m)`` by the value of each one-degree joint, mm or rad.
        force: ``(g, e, 6, n)`` by a force on each coordinate, N or N mm.
        load: ``(g, e, 6, l)`` by the size of each load, its own size being 1.
    """

    value: Array
    force: Array
    load: Array


def frame_derivatives(
    model: TreeArrays, commands: Array, naturals: Array, end_wrench: Array, x: Array
) -> FrameDerivatives:
    """Derivatives of the end frames at equilibria; see `vjm.tree.entry_points.equilibria_of` for the arguments.

    Raises:
        ValueError: the machine has followers or springs between points, whose derivatives are not here.
        NoConvergenceError: the tangent of a posture is singular.
    """
    if model.follows.any() or len(model.spring):
        raise ValueError("derivatives by values of joints know dead loads only: no followers, no point springs")
    g, n = x.shape
    e, m, k = len(model.end_joint), len(model.parent), len(model.load_joint)
    value, force, load = np.zeros((g, e, 6, m)), np.zeros((g, e, 6, n)), np.zeros((g, e, 6, k))
    good = np.zeros(g, dtype=np.int64)
    _derivatives_of(model, commands, naturals, end_wrench, x, value, force, load, good)
    if not good.all():
        raise NoConvergenceError(f"posture {int(np.argmin(good))}: its tangent is singular: no derivatives")
    return FrameDerivatives(value, force, load)


@kernel
def _by_values(model: TreeArrays, work: TreeWork, B: Floats) -> None:
    """What a unit of each joint's value adds to the coordinates' forces, ``B`` (n, m)."""
    w, G, S = work.w, work.G, work.S
    B[:, :] = 0.0
    for j in range(len(model.parent)):
        c, s = model.coordinate[j], model.factor[j]
        if c >= 0 and model.rotary[j]:
            B[c, j] += s * (w[j, 0] * G[j, 0] + w[j, 1] * G[j, 1] + w[j, 2] * G[j, 2])
        k0, k1, k2 = 0.0, 0.0, 0.0
        if model.rotary[j]:
            k0 = w[j, 1] * S[j, 5] - w[j, 2] * S[j, 4]
            k1 = w[j, 2] * S[j, 3] - w[j, 0] * S[j, 5]
            k2 = w[j, 0] * S[j, 4] - w[j, 1] * S[j, 3]
        i = model.parent[j]
        while i >= 0:
            if model.rotary[i]:
                h = w[i, 0] * G[j, 0] + w[i, 1] * G[j, 1] + w[i, 2] * G[j, 2]
                d = model.coordinate[i]
                if d >= 0:
                    B[d, j] += model.factor[i] * h
                if c >= 0:
                    B[c, i] += s * (h + w[i, 0] * k0 + w[i, 1] * k1 + w[i, 2] * k2)
            i = model.parent[i]


@kernel
def _by_lengths(
    model: TreeArrays, command: Floats, strain: Floats, push: Floats, work: TreeWork, B: Floats
) -> None:
    """What a unit of their length adds for segments that grow: their law changes, and their weight."""
    u = np.zeros(6)
    for block in range(len(model.kind)):
        j, c0 = model.grows[block], model.first[block]
        if j < 0 or model.kind[block] != BEAM_COLUMN:
            continue
        segment(model, command, block, work)
        t = work.t[c0 : c0 + 6]
        beam_column(work.beam, t, strain[c0 : c0 + 6], work.Kb, u)
        beam_column_by_length(work.beam, t, u)
        for i in range(6):
            for c in range(6):
                B[c0 + i, j] += GROWS * work.Kb[i, c] * u[c]
    for k in range(len(model.load_joint)):
        j = model.load_grows[k]
        if j >= 0:
            for c in range(B.shape[0]):
                B[c, j] += GROWS * push[k, c] / grown(model, command, j)


@entry
def _derivatives_of(
    model: TreeArrays, commands: Floats, naturals: Floats, end_wrench: Floats, x: Floats,
    value: Floats, force: Floats, load: Floats, good: Ints,
) -> None:  # fmt: skip
    work = workspace(model)
    g, n = x.shape
    m, single = len(model.parent), len(end_wrench) == 1
    B, Z, u = np.zeros((n, m)), np.zeros((n, 6)), np.zeros(3)
    A, push = np.zeros((n, n)), np.zeros((len(model.load_joint), n))
    for t in range(g):
        wrench = end_wrench[0] if single else end_wrench[t]
        place(model, commands[t], x[t], work)
        evaluate(model, commands[t], naturals[t], x[t], wrench, 1.0, work, True)
        _by_values(model, work, B)
        for k in range(len(model.load_joint)):
            j = model.load_joint[k]
            for a in range(3):
                u[a] = work.p[j, a]
                for b in range(3):
                    u[a] += work.R[j, a, b] * model.load_offset[k, b]
            jacobian(model, work, j, u)
            for c in range(n):
                s = 0.0
                for a in range(6):
                    s += work.J[a, c] * model.load[k, a]
                push[k, c] = s * grown(model, commands[t], model.load_grows[k])
        _by_lengths(model, commands[t], x[t] - naturals[t], push, work, B)
        # Zᵀ = J A⁻¹: six solutions with the transpose serve all right sides
        for a in range(n):
            for b in range(n):
                A[a, b] = work.A[b, a]
        good[t] = 1 if factor(A, work.swaps) else 0
        if not good[t]:
            continue
        for e in range(len(model.end_joint)):
            jacobian(model, work, model.end_joint[e], work.end_p[e])
            for c in range(n):
                for a in range(6):
                    Z[c, a] = work.J[a, c]
            solve(A, work.swaps, Z)
            for a in range(6):
                for c in range(n):
                    z = Z[c, a]
                    force[t, e, a, c] = z
                    if z != 0.0:
                        for j in range(m):
                            value[t, e, a, j] += z * B[c, j]
                        for k in range(len(model.load_joint)):
                            load[t, e, a, k] += z * push[k, c]
            j = model.end_joint[e]
            while j >= 0:
                if model.rotary[j]:
                    for a in range(3):
                        u[a] = work.end_p[e, a] - work.o[j, a]
                    value[t, e, 0, j] += work.w[j, 1] * u[2] - work.w[j, 2] * u[1]
                    value[t, e, 1, j] += work.w[j, 2] * u[0] - work.w[j, 0] * u[2]
                    value[t, e, 2, j] += work.w[j, 0] * u[1] - work.w[j, 1] * u[0]
                    for a in range(3):
                        value[t, e, 3 + a, j] += work.w[j, a]
                else:
                    for a in range(3):
                        value[t, e, a, j] += work.w[j, a]
                j = model.parent[j]
