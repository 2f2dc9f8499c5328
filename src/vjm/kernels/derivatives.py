"""Exact derivatives of end frames at equilibria: by values of joints, by forces on coordinates, by loads.

With the statics ``r(x, p) = 0``, their tangent A and the closures' Jacobian J, an end frame's derivative is
``z ∂r/∂p + ζ J_p``, where ``Aᵀ z − Jᵀ ζ = J_eᵀ``, ``J z = 0``: six solutions with the transposed tangent serve all
parameters. A held value moves bodies and their weights: what that does to the coordinates' forces follows from the
turns of z before a joint and the couplings behind it, at a cost linear in the joints. A spring's law changes the
force on its own coordinate, a load acts on the motion z of its point. No difference is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.kernels.arrays import (
    BEAM_COLUMN,
    GROWS,
    Floats,
    Ints,
    MachineArrays,
    Work,
    machine_object,
    work_object,
    workspace,
)
from vjm.kernels.beam_column import beam_column, beam_column_by_length
from vjm.kernels.border import solve, transpose
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.elimination import load, move
from vjm.kernels.entry_points import corrected
from vjm.kernels.newton import linearise
from vjm.kernels.statics import act, force_on, grown, joint_sums, sum_up
from vjm.rotations import Array


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
    model: MachineArrays, commands: Array, naturals: Array, end_wrench: Array, x: Array, wrench: Array | None = None
) -> FrameDerivatives:
    """Derivatives of the end frames at equilibria; see `vjm.kernels.newton.equilibria_of` for the arguments.

    Raises:
        ValueError: the machine has followers, whose directions in the unloaded posture change too.
        NoConvergenceError: the tangent of a posture is singular.
    """
    if model.follows.any():
        raise ValueError("derivatives by values of joints know dead loads only: no followers")
    refuse_moments(model, end_wrench)
    g, n = x.shape
    e, m, k = len(model.end_joint), len(model.parent), len(model.load_joint)
    value, force, pushed = np.zeros((g, e, 6, m)), np.zeros((g, e, 6, n)), np.zeros((g, e, 6, k))
    good = np.zeros(g, dtype=np.int64)
    wrench = np.zeros((g, int(model.size[2]))) if wrench is None else wrench
    _derivatives_of(
        machine_object(model), work_object(workspace(model)), commands, naturals, end_wrench, x, wrench, value,
        force, pushed, good,
    )  # fmt: skip
    if not good.all():
        raise NoConvergenceError(f"posture {int(np.argmin(good))}: its tangent is singular: no derivatives")
    return FrameDerivatives(value, force, pushed)


def refuse_moments(model: MachineArrays, end_wrench: Array) -> None:
    """Refuse arrays that were packed for end frames without moments.

    Raises:
        ValueError: the wrenches have moments.
    """
    if np.any(end_wrench[..., 3:]) and not np.any(model.load_end >= 0):
        raise ValueError("the wrenches on the end frames have moments: pack the machine with moments=True")


@kernel
def _jacobian_row(model: MachineArrays, work: Work, e: int, a: int, row: Floats, held: Floats) -> None:
    """Component ``a`` of an end frame's velocity by the coordinates ``row`` (n,) and held values ``held`` (m,)."""
    row[:] = 0.0
    held[:] = 0.0
    j = model.end_joint[e]
    while j >= 0:
        if not model.rotary[j]:
            s = work.w[j, a] if a < 3 else 0.0
        elif a >= 3:
            s = work.w[j, a - 3]
        else:
            b, c = (a + 1) % 3, (a + 2) % 3
            s = work.w[j, b] * (work.end_p[e, c] - work.o[j, c]) - work.w[j, c] * (work.end_p[e, b] - work.o[j, b])
        held[j] = s
        if model.coordinate[j] >= 0:
            row[model.coordinate[j]] += model.factor[j] * s
        j = model.parent[j]


@kernel
def _couplings(model: MachineArrays, work: Work, S: Floats, G: Floats) -> None:
    """Couplings ``G`` (m, 3) of the joints to turns before them, from the sums ``S`` (m, 15) behind them."""
    for j in range(len(model.parent)):
        f0, f1, f2 = S[j, 0], S[j, 1], S[j, 2]
        w0, w1, w2 = work.w[j, 0], work.w[j, 1], work.w[j, 2]
        if model.rotary[j]:
            o0, o1, o2 = work.o[j, 0], work.o[j, 1], work.o[j, 2]
            along = w0 * f0 + w1 * f1 + w2 * f2
            spread = S[j, 6] + S[j, 10] + S[j, 14] - o0 * f0 - o1 * f1 - o2 * f2
            G[j, 0] = S[j, 6] * w0 + S[j, 7] * w1 + S[j, 8] * w2 - o0 * along - spread * w0
            G[j, 1] = S[j, 9] * w0 + S[j, 10] * w1 + S[j, 11] * w2 - o1 * along - spread * w1
            G[j, 2] = S[j, 12] * w0 + S[j, 13] * w1 + S[j, 14] * w2 - o2 * along - spread * w2
        else:
            G[j, 0], G[j, 1], G[j, 2] = w1 * f2 - w2 * f1, w2 * f0 - w0 * f2, w0 * f1 - w1 * f0


@kernel
def _motion(model: MachineArrays, work: Work, twist: Floats) -> None:
    """Twists ``(m + 1, 6)`` at the world's origin of the bodies behind joints, by ``work.step``; ground last."""
    last = len(twist) - 1
    for a in range(6):
        twist[last, a] = 0.0
    for j in range(len(model.parent)):
        i = model.parent[j] if model.parent[j] >= 0 else last
        for a in range(6):
            twist[j, a] = twist[i, a]
        c = model.coordinate[j]
        if c < 0:
            continue
        d = model.factor[j] * work.step[c]
        w0, w1, w2 = d * work.w[j, 0], d * work.w[j, 1], d * work.w[j, 2]
        if model.rotary[j]:
            o0, o1, o2 = work.o[j, 0], work.o[j, 1], work.o[j, 2]
            twist[j, 0] += o1 * w2 - o2 * w1
            twist[j, 1] += o2 * w0 - o0 * w2
            twist[j, 2] += o0 * w1 - o1 * w0
            twist[j, 3] += w0
            twist[j, 4] += w1
            twist[j, 5] += w2
        else:
            twist[j, 0] += w0
            twist[j, 1] += w1
            twist[j, 2] += w2


@kernel
def _reacting(model: MachineArrays, work: Work, twist: Floats, wrench: Floats, S: Floats) -> None:
    """Sums ``S`` (m, 15) of what springs between points and closures do on the bodies of the motion z."""
    S[:, :] = 0.0
    f, v = np.zeros((1, 6)), np.empty(3)
    last = len(twist) - 1
    for k in range(len(model.spring)):
        f[:, :] = 0.0
        v[:] = 0.0
        for side in range(2):
            j = model.spring_joint[k, side] if model.spring_joint[k, side] >= 0 else last
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                own = twist[j, a] + twist[j, 3 + b] * work.spring_at[k, side, c]
                own -= twist[j, 3 + c] * work.spring_at[k, side, b]
                v[a] += own if side else -own
        for r in range(3):
            s = 0.0
            for a in range(3):
                s += work.pull[k, 3 * r + a] * v[a]
            s *= work.sign[k, r] * work.scale[k, r] ** 2
            for a in range(3):
                f[0, a] -= s * work.pull[k, 3 * r + a]
        for side in range(2):
            if model.spring_joint[k, side] >= 0:
                act(S, model.spring_joint[k, side], work.spring_at[k], side, f, 0, 2.0 * side - 1.0)
    sum_up(model, work, wrench, S)


@kernel
def _by_lengths(model: MachineArrays, command: Floats, strain: Floats, work: Work, laws: Floats) -> None:
    """What a unit of their length adds to the forces ``laws`` (b, 6) of segments that grow: their law changes."""
    beam, u, K = np.empty(7), np.empty(6), np.empty((6, 6))
    for block in range(len(model.kind)):
        j, c0 = model.grows[block], model.first[block]
        if j < 0 or model.kind[block] != BEAM_COLUMN:
            continue
        h = grown(j, command)
        for i in range(7):
            beam[i] = model.beam[block, i] * (h if i >= 4 else 1.0)
        t = work.t[c0 : c0 + 6]
        beam_column(beam, t, strain[c0 : c0 + 6], K, u)
        beam_column_by_length(beam, t, u)
        for i in range(6):
            s = 0.0
            for c in range(6):
                s += K[i, c] * u[c]
            laws[block, i] = GROWS * s


@entry
def _derivatives_of(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, end_wrench: Floats, x: Floats,
    wrenches: Floats, value: Floats, force: Floats, pushed: Floats, good: Ints,
) -> None:  # fmt: skip
    g, n = x.shape
    m = len(model.parent)
    S, other, G, behind = np.zeros((m, 15)), np.zeros((m, 15)), np.zeros((m, 3)), np.zeros((m, 3))
    row, held, twist, laws = np.empty(n), np.empty(m), np.empty((m + 1, 6)), np.zeros((len(model.kind), 6))
    gap, reaction = np.zeros(model.size[2]), np.zeros(model.size[2])
    for t in range(g):
        acting = end_wrench[t if len(end_wrench) > 1 else 0]
        work.wrench[:] = wrenches[t]
        negative = linearise(model, commands[t], naturals[t], x[t], acting, 1.0, False, work)
        good[t] = 1 if negative >= 0 and transpose(model, work) else 0
        if not good[t]:
            continue
        joint_sums(model, work, acting, 1.0, S)
        _couplings(model, work, S, G)
        _by_lengths(model, commands[t], x[t] - naturals[t], work, laws)
        for e in range(len(model.end_joint)):
            for a in range(6):
                _jacobian_row(model, work, e, a, row, held)
                load(model, row, gap, work)
                solve(model, work)
                move(model, False, work)
                corrected(model, work, reaction)
                force[t, e, a] = work.step
                _motion(model, work, twist)
                _reacting(model, work, twist, reaction, other)
                _add_values(model, work, S, G, other, twist, behind, held, value[t, e, a])
                for k in range(len(model.load_joint)):
                    j = model.load_joint[k]
                    s = 0.0
                    for b in range(3):
                        c, d = (b + 1) % 3, (b + 2) % 3
                        v = twist[j, b] + twist[j, 3 + c] * work.point[k, d] - twist[j, 3 + d] * work.point[k, c]
                        s += v * work.acting[k, b] + twist[j, 3 + b] * work.acting[k, 3 + b]
                    pushed[t, e, a, k] = s
                    if model.load_grows[k] >= 0:
                        grows = model.load_grows[k]
                        value[t, e, a, grows] += GROWS * s / grown(grows, commands[t])
                for block in range(len(model.kind)):
                    if model.grows[block] >= 0:
                        for i in range(6):
                            z = work.step[model.first[block] + i]
                            value[t, e, a, model.grows[block]] += z * laws[block, i]


@kernel
def _add_values(
    model: MachineArrays, work: Work, S: Floats, G: Floats, other: Floats, twist: Floats, behind: Floats,
    held: Floats, value: Floats,
) -> None:  # fmt: skip
    """Derivative ``value`` (m,) of one component of an end frame by each joint's value."""
    m, last = len(model.parent), len(twist) - 1
    w, o = work.w, work.o
    behind[:, :] = 0.0
    for j in range(m - 1, -1, -1):
        i = model.parent[j]
        before = i if i >= 0 else last
        c = model.coordinate[j]
        d = model.factor[j] * work.step[c] if c >= 0 else 0.0
        s = held[j]
        for a in range(3):
            s += twist[before, 3 + a] * G[j, a]
        if model.rotary[j]:
            for a in range(3):
                s += w[j, a] * (behind[j, a] + d * G[j, a])
        s += force_on(other, j, model.rotary[j], w, o)
        value[j] += s
        if i >= 0:
            for a in range(3):
                b, k = (a + 1) % 3, (a + 2) % 3
                turned = w[j, b] * S[j, 3 + k] - w[j, k] * S[j, 3 + b] if model.rotary[j] else 0.0
                behind[i, a] += behind[j, a] + d * (G[j, a] + turned)
