"""Compiled kernels of a tree: kinematics, the residual of its statics and their dense tangent, in N, mm, rad.

The free machine under loads is in equilibrium where every coordinate's generalised force is its spring's. Loads on
the bodies behind a joint act on it through three sums over the subtree, of the forces f, the moments m and the
dyads ``p fᵀ``, see `vjm.kernels.recursion.apply_loads`: from them follow the force on the joint and the moment G by
which its motion loads any rotation before it. The tangent is that of all loads: forces and springs are
conservative, a moment that keeps its direction and a follower are not.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.beam_column import beam_column
from vjm.kernels.compilation import kernel
from vjm.kernels.packed_model import BEAM_COLUMN, LINEAR, Floats
from vjm.tree.arrays import GROWS, SHORTEST, TreeArrays, TreeWork


@kernel
def place(model: TreeArrays, command: Floats, x: Floats, work: TreeWork) -> None:
    """Kinematics at commanded values ``(m,)`` and coordinates ``x`` (n,)."""
    R, p, w, o = work.R, work.p, work.w, work.o
    R0, p0, axis = model.R0, model.p0, model.axis
    for j in range(len(model.parent)):
        i = model.parent[j]
        for a in range(3):
            if i < 0:
                p[j, a] = p0[j, a]
                for b in range(3):
                    R[j, a, b] = R0[j, a, b]
                continue
            B0, B1, B2 = R[i, a, 0], R[i, a, 1], R[i, a, 2]
            p[j, a] = p[i, a] + B0 * p0[j, 0] + B1 * p0[j, 1] + B2 * p0[j, 2]
            for b in range(3):
                R[j, a, b] = B0 * R0[j, 0, b] + B1 * R0[j, 1, b] + B2 * R0[j, 2, b]
        for a in range(3):
            w[j, a] = R[j, a, 0] * axis[j, 0] + R[j, a, 1] * axis[j, 1] + R[j, a, 2] * axis[j, 2]
            o[j, a] = p[j, a]
        value = command[j]
        if model.coordinate[j] >= 0:
            value += model.factor[j] * x[model.coordinate[j]]
        w0, w1, w2 = w[j, 0], w[j, 1], w[j, 2]
        if not model.rotary[j]:
            p[j, 0] += value * w0
            p[j, 1] += value * w1
            p[j, 2] += value * w2
            continue
        c, s = np.cos(value), np.sin(value)
        for b in range(3):
            r0, r1, r2 = R[j, 0, b], R[j, 1, b], R[j, 2, b]
            d = (1.0 - c) * (w0 * r0 + w1 * r1 + w2 * r2)
            R[j, 0, b] = c * r0 + s * (w1 * r2 - w2 * r1) + d * w0
            R[j, 1, b] = c * r1 + s * (w2 * r0 - w0 * r2) + d * w1
            R[j, 2, b] = c * r2 + s * (w0 * r1 - w1 * r0) + d * w2
    for k in range(len(model.end_joint)):
        j = model.end_joint[k]
        for a in range(3):
            B0, B1, B2, shift = 0.0, 0.0, 0.0, 0.0
            if j < 0:
                B0, B1, B2 = 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0
            else:
                B0, B1, B2, shift = R[j, a, 0], R[j, a, 1], R[j, a, 2], p[j, a]
            work.end_p[k, a] = shift + B0 * model.end_p[k, 0] + B1 * model.end_p[k, 1] + B2 * model.end_p[k, 2]
            for b in range(3):
                turned = B0 * model.end_R[k, 0, b] + B1 * model.end_R[k, 1, b] + B2 * model.end_R[k, 2, b]
                work.end_R[k, a, b] = turned


@kernel
def _point(j: int, offset: Floats, work: TreeWork, out: Floats) -> None:
    for a in range(3):
        out[a] = offset[a]
        if j >= 0:
            R = work.R[j]
            out[a] = work.p[j, a] + R[a, 0] * offset[0] + R[a, 1] * offset[1] + R[a, 2] * offset[2]


@kernel
def turn_followers(model: TreeArrays, work: TreeWork) -> None:
    """Keep the followers in their bodies' axes, the bodies being placed unloaded."""
    for k in range(len(model.load_joint)):
        R = work.R[model.load_joint[k]]
        for a in range(3):
            for half in range(0, 6, 3):
                s = 0.0
                for b in range(3):
                    s += R[b, a] * model.load[k, half + b]
                work.body[k, half + a] = s


@kernel
def _act(work: TreeWork, j: int, point: Floats, f: Floats, share: float) -> None:
    """Add a wrench ``f`` (6,) at a world point to the sums of the joint before it."""
    if j < 0:
        return
    S = work.S
    for a in range(3):
        S[j, a] += share * f[a]
        S[j, 3 + a] += share * f[3 + a]
        for b in range(3):
            S[j, 6 + 3 * a + b] += share * point[a] * f[b]


@kernel
def grown(model: TreeArrays, command: Floats, joint: int) -> float:
    """Length in mm of what grows with a joint; 1 where nothing does."""
    return max(GROWS * command[joint], SHORTEST) if joint >= 0 else 1.0


@kernel
def _gather(
    model: TreeArrays, command: Floats, work: TreeWork, end_wrench: Floats, share: float, tangent: bool
) -> None:
    """Sums over the bodies; with the tangent also the parts of ``A`` that turning and stretching loads bring."""
    S, u, v, offset, load = work.S, work.u, work.v, model.load_offset, model.load
    S[:, :] = 0.0
    for k in range(len(model.load_joint)):
        j = model.load_joint[k]
        R = work.R[j]
        for a in range(3):
            u[a] = work.p[j, a] + R[a, 0] * offset[k, 0] + R[a, 1] * offset[k, 1] + R[a, 2] * offset[k, 2]
        if not model.follows[k]:
            part = share * grown(model, command, model.load_grows[k])
            for a in range(3):
                S[j, a] += part * load[k, a]
                S[j, 3 + a] += part * load[k, 3 + a]
                for b in range(3):
                    S[j, 6 + 3 * a + b] += part * u[a] * load[k, b]
            continue
        for a in range(3):
            for half in range(0, 6, 3):
                s = 0.0
                for b in range(3):
                    s += R[a, b] * work.body[k, half + b]
                v[half + a] = share * s
        _act(work, j, u, v, 1.0)
        if tangent:
            jacobian(model, work, j, u)
            _turning(work)
    for k in range(len(model.end_joint)):
        if model.end_joint[k] >= 0:
            _act(work, model.end_joint[k], work.end_p[k], end_wrench[k], share)
    for k in range(len(model.spring)):
        _stretch(model, work, k, tangent)


@kernel
def _turning(work: TreeWork) -> None:
    """Subtract the tangent of a follower ``v`` (6,) on the point of the Jacobian at hand."""
    J, v, n = work.J, work.v, len(work.t)
    for i in range(n):
        w0, w1, w2 = J[3, i], J[4, i], J[5, i]
        if w0 == 0.0 and w1 == 0.0 and w2 == 0.0:
            continue
        f0, f1, f2 = w1 * v[2] - w2 * v[1], w2 * v[0] - w0 * v[2], w0 * v[1] - w1 * v[0]
        m0, m1, m2 = w1 * v[5] - w2 * v[4], w2 * v[3] - w0 * v[5], w0 * v[4] - w1 * v[3]
        for c in range(n):
            work.A[c, i] -= J[0, c] * f0 + J[1, c] * f1 + J[2, c] * f2
            work.A[c, i] -= J[3, c] * m0 + J[4, c] * m1 + J[5, c] * m2


@kernel
def _stretch(model: TreeArrays, work: TreeWork, k: int, tangent: bool) -> None:
    """A point spring: its forces on both bodies, and in the tangent their change with its length and direction."""
    a, b, d, n = work.u, work.v, np.empty(3), len(work.t)
    _point(model.spring_joint[k, 0], model.spring_point[k, 0], work, a)
    _point(model.spring_joint[k, 1], model.spring_point[k, 1], work, b)
    length = 0.0
    for i in range(3):
        d[i] = b[i] - a[i]
        length += d[i] * d[i]
    length = np.sqrt(length)
    stiffness, free, preload = model.spring[k, 0], model.spring[k, 1], model.spring[k, 2]
    # where the points meet the direction of the pull is not defined; without a pull there it is not needed
    pull = stiffness * (length - free) + preload
    over = pull / length if length > 0.0 else stiffness
    force = np.zeros(6)
    for i in range(3):
        force[i] = over * d[i]
    _act(work, model.spring_joint[k, 0], a, force, 1.0)
    _act(work, model.spring_joint[k, 1], b, force, -1.0)
    if not tangent:
        return
    jacobian(model, work, model.spring_joint[k, 1], b)
    D = work.J[:3].copy()
    jacobian(model, work, model.spring_joint[k, 0], a)
    D -= work.J[:3]
    unit = 1.0 / length if length > 0.0 else 0.0
    for i in range(n):
        along = unit * (d[0] * D[0, i] + d[1] * D[1, i] + d[2] * D[2, i])
        for c in range(n):
            other = unit * (d[0] * D[0, c] + d[1] * D[1, c] + d[2] * D[2, c])
            dot = D[0, i] * D[0, c] + D[1, i] * D[1, c] + D[2, i] * D[2, c]
            work.A[i, c] += over * dot + (stiffness - over) * along * other


@kernel
def jacobian(model: TreeArrays, work: TreeWork, joint: int, point: Floats) -> None:
    """Jacobian ``work.J`` (6, n) of a world point on the body behind a joint."""
    J, w, o = work.J, work.w, work.o
    J[:, :] = 0.0
    j = joint
    while j >= 0:
        c, s = model.coordinate[j], model.factor[j]
        if c >= 0:
            w0, w1, w2 = s * w[j, 0], s * w[j, 1], s * w[j, 2]
            if model.rotary[j]:
                r0, r1, r2 = point[0] - o[j, 0], point[1] - o[j, 1], point[2] - o[j, 2]
                J[0, c] += w1 * r2 - w2 * r1
                J[1, c] += w2 * r0 - w0 * r2
                J[2, c] += w0 * r1 - w1 * r0
                J[3, c] += w0
                J[4, c] += w1
                J[5, c] += w2
            else:
                J[0, c] += w0
                J[1, c] += w1
                J[2, c] += w2
        j = model.parent[j]


@kernel
def _fold(model: TreeArrays, work: TreeWork) -> None:
    """From the sums the forces Q on the joints and their couplings G, children before parents."""
    w, o, G, S = work.w, work.o, work.G, work.S
    for j in range(len(model.parent) - 1, -1, -1):
        f0, f1, f2 = S[j, 0], S[j, 1], S[j, 2]
        w0, w1, w2 = w[j, 0], w[j, 1], w[j, 2]
        o0, o1, o2 = o[j, 0], o[j, 1], o[j, 2]
        along = w0 * f0 + w1 * f1 + w2 * f2
        if model.rotary[j]:
            trace = S[j, 6] + S[j, 10] + S[j, 14] - o0 * f0 - o1 * f1 - o2 * f2
            G[j, 0] = S[j, 6] * w0 + S[j, 7] * w1 + S[j, 8] * w2 - o0 * along - trace * w0
            G[j, 1] = S[j, 9] * w0 + S[j, 10] * w1 + S[j, 11] * w2 - o1 * along - trace * w1
            G[j, 2] = S[j, 12] * w0 + S[j, 13] * w1 + S[j, 14] * w2 - o2 * along - trace * w2
            force = w0 * (S[j, 11] - S[j, 13] - o1 * f2 + o2 * f1 + S[j, 3])
            force += w1 * (S[j, 12] - S[j, 8] - o2 * f0 + o0 * f2 + S[j, 4])
            work.Q[j] = force + w2 * (S[j, 7] - S[j, 9] - o0 * f1 + o1 * f0 + S[j, 5])
        else:
            G[j, 0], G[j, 1], G[j, 2] = w1 * f2 - w2 * f1, w2 * f0 - w0 * f2, w0 * f1 - w1 * f0
            work.Q[j] = along
        i = model.parent[j]
        if i >= 0:
            for a in range(15):
                S[i, a] += S[j, a]


@kernel
def _load_tangent(model: TreeArrays, work: TreeWork) -> None:
    """Subtract from ``A`` what dead loads change by: ``w_i · G_j``, and of moments ``(w_i × w_j) · m_j``."""
    w, G, A = work.w, work.G, work.A
    for j in range(len(model.parent)):
        c = model.coordinate[j]
        if c < 0:
            continue
        s = model.factor[j]
        g0, g1, g2 = s * G[j, 0], s * G[j, 1], s * G[j, 2]
        m0, m1, m2 = s * work.S[j, 3], s * work.S[j, 4], s * work.S[j, 5]
        if model.rotary[j]:
            A[c, c] -= s * (w[j, 0] * g0 + w[j, 1] * g1 + w[j, 2] * g2)
        # (w_i × w_j) · m = w_i · (w_j × m)
        k0 = w[j, 1] * m2 - w[j, 2] * m1 if model.rotary[j] else 0.0
        k1 = w[j, 2] * m0 - w[j, 0] * m2 if model.rotary[j] else 0.0
        k2 = w[j, 0] * m1 - w[j, 1] * m0 if model.rotary[j] else 0.0
        i = model.parent[j]
        while i >= 0:
            d = model.coordinate[i]
            if d >= 0 and model.rotary[i]:
                h = model.factor[i] * (w[i, 0] * g0 + w[i, 1] * g1 + w[i, 2] * g2)
                A[c, d] -= h + model.factor[i] * (w[i, 0] * k0 + w[i, 1] * k1 + w[i, 2] * k2)
                A[d, c] -= h
            i = model.parent[i]


@kernel
def segment(model: TreeArrays, command: Floats, block: int, work: TreeWork) -> None:
    """The data of a beam-column spring at the length that it has, in ``work.beam``."""
    h = grown(model, command, model.grows[block])
    for i in range(7):
        work.beam[i] = model.beam[block, i] * (h if i >= 4 else 1.0)


@kernel
def evaluate(
    model: TreeArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, share: float,
    work: TreeWork, tangent: bool,
) -> None:  # fmt: skip
    """Residual ``work.r`` (n,) of the statics at ``x`` (n,), and their tangent ``work.A`` where asked for.

    Args:
        model: the machine.
        command: ``(m,)`` values of the held joints.
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        x: ``(n,)`` coordinates.
        end_wrench: ``(e, 6)`` on the end frames, world axes.
        share: of all loads.
        work: written.
        tangent: whether.
    """
    A, t, r = work.A, work.t, work.r
    place(model, command, x, work)
    if tangent:
        A[:, :] = 0.0
    _gather(model, command, work, end_wrench, share, tangent)
    _fold(model, work)
    t[:] = 0.0
    for j in range(len(model.parent)):
        if model.coordinate[j] >= 0:
            t[model.coordinate[j]] += model.factor[j] * work.Q[j]
    if tangent:
        _load_tangent(model, work)
    for block in range(len(model.kind)):
        c0, k = model.first[block], model.first[block + 1] - model.first[block]
        if model.kind[block] == LINEAR:
            for i in range(k):
                r[c0 + i] = t[c0 + i]
                for c in range(k):
                    r[c0 + i] -= model.K[block, i, c] * (x[c0 + c] - natural[c0 + c])
                    if tangent:
                        A[c0 + i, c0 + c] += model.K[block, i, c]
        elif model.kind[block] == BEAM_COLUMN:
            for i in range(6):
                work.u[i] = x[c0 + i] - natural[c0 + i]
            segment(model, command, block, work)
            beam_column(work.beam, t[c0 : c0 + 6], work.u, work.Kb, work.v)
            for i in range(6):
                r[c0 + i] = work.v[i]
                if tangent:
                    for c in range(6):
                        A[c0 + i, c0 + c] += work.Kb[i, c]
        else:
            r[c0] = t[c0]
