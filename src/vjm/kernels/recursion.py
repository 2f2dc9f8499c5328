"""Compiled kernels: kinematics, condensation and substitution of a chain, block by block.

The linearised equilibrium of a chain at an imposed pose, ``[H − K, Jᵀ; J, 0]`` with (17), is condensed from base
to tool. A block is one spring (up to six coordinates) or one passive joint. Behind each block the motion ``ξ`` of
a body that the end-effector's point is fixed to follows from the wrench ``λ`` on it and the passive coordinates
``q`` so far:

    ξ = Q λ + Y q + a,     with the energy's remainder  −½ qᵀ Z q − zᵀ q.

At the tool this is equation (18), ``[Q, Y; Yᵀ, −Z]``, with a matrix of 6 + n_q rows, for a cost that is linear in
the number of springs. The blocks' pivots give the number of negative eigenvalues (Sylvester's law of inertia).

A load couples a block to all before it only through the rotation Ω that they bring: the work
``Ω · Σ_j (v_j × f + ½ w_j × m) δx_j`` over the joints with the axes w_j and the velocities v_j that they give to
the end-effector. The moment's term is the symmetric half of ``m · (w_i × w_j)``; the rest, a moment fixed in the
world not being conservative, acts on the end-effector alone and is added there: ``½ m × Ω``. Loads on other bodies
add to the sum over the joints before them, see `apply_loads`.

All quantities are dimensionless: lengths over the model's length, forces and moments over its units.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.packed_model import Floats, Ints, PackedModel, Workspace, model_of


@kernel
def forward_kinematics(model: PackedModel, x: Floats, work: Workspace) -> None:
    """Kinematics (1), (2): joint axes, points on them, the end-effector's frame and velocities; where loads act."""
    R, p, w, o, v = work.R, work.p, work.w, work.o, work.v
    loaded = 0
    for a in range(3):
        p[a] = 0.0
        for b in range(3):
            R[a, b] = 1.0 if a == b else 0.0
    for j in range(len(model.rotary)):
        if model.moved[j]:
            _move(R, p, model.R0[j], model.p0[j])
        k = model.along[j]
        if k >= 0:
            for a in range(3):
                w[j, a] = R[a, k]
        else:
            for a in range(3):
                w[j, a] = R[a, 0] * model.axis[j, 0] + R[a, 1] * model.axis[j, 1] + R[a, 2] * model.axis[j, 2]
        for a in range(3):
            o[j, a] = p[a]
        value = model.factor[j] * x[model.coordinate[j]]
        if not model.rotary[j]:
            for a in range(3):
                p[a] += value * w[j, a]
        elif k >= 0:
            c, s = np.cos(value), np.sin(value)
            k1, k2 = (k + 1) % 3, (k + 2) % 3
            for a in range(3):
                r1, r2 = R[a, k1], R[a, k2]
                R[a, k1] = c * r1 + s * r2
                R[a, k2] = c * r2 - s * r1
        else:
            turn_about(R, w[j], value)
        while loaded < len(model.point_joint) and model.point_joint[loaded] == j:
            _place(model, work, loaded)
            loaded += 1
    _move(R, p, model.R_tail, model.p_tail)
    for j in range(len(model.rotary)):
        if model.rotary[j]:
            r0, r1, r2 = p[0] - o[j, 0], p[1] - o[j, 1], p[2] - o[j, 2]
            v[j, 0] = w[j, 1] * r2 - w[j, 2] * r1
            v[j, 1] = w[j, 2] * r0 - w[j, 0] * r2
            v[j, 2] = w[j, 0] * r1 - w[j, 1] * r0
        else:
            for a in range(3):
                v[j, a] = w[j, a]


@kernel
def _place(model: PackedModel, work: Workspace, k: int) -> None:
    """Where a load acts, and its wrench in the world, with the frame that carries it in the workspace."""
    R, offset, load = work.R, model.point_offset[k], work.load[k]
    for a in range(3):
        work.point[k, a] = work.p[a] + R[a, 0] * offset[0] + R[a, 1] * offset[1] + R[a, 2] * offset[2]
        for half in range(0, 6, 3):
            if model.follows[k]:
                s = R[a, 0] * load[half] + R[a, 1] * load[half + 1] + R[a, 2] * load[half + 2]
                work.acting[k, half + a] = s
            else:
                work.acting[k, half + a] = load[half + a]


@kernel
def apply_loads(model: PackedModel, work: Workspace, acting: Floats) -> None:
    """What wrenches ``acting`` (l, 6) on the loaded points do to the joints before them, into ``work.hung``.

    A row is the coupling ``Σ v_j × f + ½ w_j × m`` of the joint's motion to rotations before it, v_j being the
    velocity that it gives the loaded point, and the work ``Σ v_j · f + w_j · m`` that the loads do on it. Both
    follow from the sums of f, of m and of the dyads ``p fᵀ`` of all loads behind the joint, so the cost is linear.
    """
    w, o, hung = work.w, work.o, work.hung
    f0 = f1 = f2 = m0 = m1 = m2 = 0.0
    M = np.zeros((3, 3))
    k = len(model.point_joint) - 1
    for j in range(len(model.rotary) - 1, -1, -1):
        while k >= 0 and model.point_joint[k] == j:
            for a in range(3):
                for b in range(3):
                    M[a, b] += work.point[k, a] * acting[k, b]
            f0, f1, f2 = f0 + acting[k, 0], f1 + acting[k, 1], f2 + acting[k, 2]
            m0, m1, m2 = m0 + acting[k, 3], m1 + acting[k, 4], m2 + acting[k, 5]
            k -= 1
        w0, w1, w2 = w[j, 0], w[j, 1], w[j, 2]
        if not model.rotary[j]:
            hung[j, 0], hung[j, 1], hung[j, 2] = w1 * f2 - w2 * f1, w2 * f0 - w0 * f2, w0 * f1 - w1 * f0
            hung[j, 3] = w0 * f0 + w1 * f1 + w2 * f2
            continue
        # (w × r) × f = r (f · w) − w (f · r), with r from the joint
        o0, o1, o2 = o[j, 0], o[j, 1], o[j, 2]
        along = f0 * w0 + f1 * w1 + f2 * w2
        trace = M[0, 0] + M[1, 1] + M[2, 2] - o0 * f0 - o1 * f1 - o2 * f2
        hung[j, 0] = M[0, 0] * w0 + M[0, 1] * w1 + M[0, 2] * w2 - o0 * along - trace * w0
        hung[j, 1] = M[1, 0] * w0 + M[1, 1] * w1 + M[1, 2] * w2 - o1 * along - trace * w1
        hung[j, 2] = M[2, 0] * w0 + M[2, 1] * w1 + M[2, 2] * w2 - o2 * along - trace * w2
        hung[j, 0] += 0.5 * (w1 * m2 - w2 * m1)
        hung[j, 1] += 0.5 * (w2 * m0 - w0 * m2)
        hung[j, 2] += 0.5 * (w0 * m1 - w1 * m0)
        hung[j, 3] = w0 * (M[1, 2] - M[2, 1] - o1 * f2 + o2 * f1 + m0)
        hung[j, 3] += w1 * (M[2, 0] - M[0, 2] - o2 * f0 + o0 * f2 + m1)
        hung[j, 3] += w2 * (M[0, 1] - M[1, 0] - o0 * f1 + o1 * f0 + m2)


@kernel
def _move(R: Floats, p: Floats, R0: Floats, p0: Floats) -> None:
    for a in range(3):
        p[a] += R[a, 0] * p0[0] + R[a, 1] * p0[1] + R[a, 2] * p0[2]
        r0 = R[a, 0] * R0[0, 0] + R[a, 1] * R0[1, 0] + R[a, 2] * R0[2, 0]
        r1 = R[a, 0] * R0[0, 1] + R[a, 1] * R0[1, 1] + R[a, 2] * R0[2, 1]
        r2 = R[a, 0] * R0[0, 2] + R[a, 1] * R0[1, 2] + R[a, 2] * R0[2, 2]
        R[a, 0], R[a, 1], R[a, 2] = r0, r1, r2


@kernel
def turn_about(R: Floats, w: Floats, angle: float) -> None:
    """Turn a frame about a world axis: each column by Rodrigues' formula."""
    c, s = np.cos(angle), np.sin(angle)
    for b in range(3):
        r0, r1, r2 = R[0, b], R[1, b], R[2, b]
        d = (1.0 - c) * (w[0] * r0 + w[1] * r1 + w[2] * r2)
        R[0, b] = c * r0 + s * (w[1] * r2 - w[2] * r1) + d * w[0]
        R[1, b] = c * r1 + s * (w[2] * r0 - w[0] * r2) + d * w[1]
        R[2, b] = c * r2 + s * (w[0] * r1 - w[1] * r0) + d * w[2]


@kernel
def pose_error(work: Workspace, R_to: Floats, p_to: Floats) -> bool:
    """Displacement from the end-effector to a target frame; false where it is half a turn away."""
    R, gap = work.R, work.gap
    for a in range(3):
        gap[a] = p_to[a] - work.p[a]
    # the relative rotation R_to Rᵀ in the world
    t = 0.0
    for a in range(3):
        for b in range(3):
            s = R_to[a, 0] * R[b, 0] + R_to[a, 1] * R[b, 1] + R_to[a, 2] * R[b, 2]
            work.A[a, b] = s
        t += work.A[a, a]
    A = work.A
    x, y, z = 0.5 * (A[2, 1] - A[1, 2]), 0.5 * (A[0, 2] - A[2, 0]), 0.5 * (A[1, 0] - A[0, 1])
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (t - 1.0)
    scale = 1.0
    if sine > 1e-9:
        scale = np.arctan2(sine, cosine) / sine
    elif not cosine > 0.0:
        return False
    gap[3], gap[4], gap[5] = x * scale, y * scale, z * scale
    return True


@entry
def frames_behind(steps: Floats, out: Floats) -> None:
    """Frames ``out`` (m + 1, 4, 4) behind the base and each joint, from the joints' own ``steps`` (m, 4, 4)."""
    out[0] = np.eye(4)
    for j in range(len(steps)):
        for a in range(3):
            for b in range(4):
                out[j + 1, a, b] = out[j, a, 3] if b == 3 else 0.0
                for c in range(3):
                    out[j + 1, a, b] += out[j, a, c] * steps[j, c, b]
        out[j + 1, 3] = out[0, 3]


@entry
def positions(integers: Ints, numbers: Floats, x: Floats, joint: Ints, offset: Floats, out: Floats) -> None:
    """World positions ``(k, 3)`` of points fixed behind joints, in the order of the joints."""
    model = model_of(integers, numbers)
    R, p, w = np.eye(3), np.zeros(3), np.empty(3)
    k = 0
    for j in range(-1, len(model.rotary)):
        if j >= 0:
            if model.moved[j]:
                _move(R, p, model.R0[j], model.p0[j])
            for a in range(3):
                w[a] = R[a, 0] * model.axis[j, 0] + R[a, 1] * model.axis[j, 1] + R[a, 2] * model.axis[j, 2]
            value = model.factor[j] * x[model.coordinate[j]]
            if model.rotary[j]:
                turn_about(R, w, value)
            else:
                for a in range(3):
                    p[a] += value * w[a]
        while k < len(joint) and joint[k] == j:
            for a in range(3):
                out[k, a] = p[a] + R[a, 0] * offset[k, 0] + R[a, 1] * offset[k, 1] + R[a, 2] * offset[k, 2]
            k += 1
