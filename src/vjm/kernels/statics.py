"""Compiled kinematics and loads of a machine.

It says where its bodies are, what its springs' laws answer, and the sums of what acts on the bodies.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import GROWS, SHORTEST, Floats, Ints, MachineArrays, Work
from vjm.kernels.compilation import kernel

ORDER = 5
"""Coefficients of a force: it is at most of the fourth degree in the deflection."""
STEPS = 40
"""At most, of an inverse: each halves the bracket."""
NEAR = 1e-6
"""Last step of an inverse, over the bracket."""


@kernel
def law_at(first: Ints, knots: Floats, pieces: Floats, law: int, u: float) -> tuple[float, float]:
    """Force and tangent of a law at a deflection.

    Args:
        first: ``(l + 1,)`` first knot of each law; its first piece is one further for every law before.
        knots: see `vjm.model.laws.Curve`, of all laws one after another.
        pieces: likewise.
        law: which.
        u: deflection.
    """
    k0, k1 = first[law], first[law + 1]
    k = k0
    while k < k1 and knots[k] <= u:
        k += 1
    own = pieces[k + law]
    s = u - knots[max(k - 1, k0)]
    force, slope = own[ORDER - 1], 0.0
    for power in range(ORDER - 2, -1, -1):
        slope = slope * s + force
        force = force * s + own[power]
    return force, slope


@kernel
def law_inverse(first: Ints, knots: Floats, pieces: Floats, law: int, force: float, near: float) -> float:
    """The deflection at a force to a few digits, for Newton's method to go on; ``near`` where there is none."""
    k0, k1 = first[law], first[law + 1]
    low, high = knots[k0], knots[k1 - 1]
    at_low, _ = law_at(first, knots, pieces, law, low)
    at_high, _ = law_at(first, knots, pieces, law, high)
    if force <= at_low:
        slope = pieces[k0 + law, 1]
        return low + (force - at_low) / slope if slope > 0.0 else near
    if force >= at_high:
        slope = pieces[k1 + law, 1]
        return high + (force - at_high) / slope if slope > 0.0 else near
    u = 0.5 * (low + high)
    for _ in range(STEPS):
        law_force, slope = law_at(first, knots, pieces, law, u)
        if law_force < force:
            low = u
        else:
            high = u
        before = u
        u = u + (force - law_force) / slope if slope > 0.0 else low
        if not low < u < high:
            u = 0.5 * (low + high)
        if abs(u - before) <= NEAR * abs(high - low):
            break
    return u


@kernel
def place(model: MachineArrays, command: Floats, x: Floats, work: Work) -> None:
    """Kinematics at commanded values ``(m,)`` and coordinates ``x`` (n,)."""
    place_joints(
        model.parent, model.rotary, model.axis, model.along, model.R0, model.p0, model.moved, model.coordinate,
        model.factor, command, x, work.R, work.p, work.w, work.o,
    )  # fmt: skip
    for k in range(len(model.end_joint)):
        behind(work.R, work.p, model.end_joint[k], model.end_R[k], model.end_p[k], work.end_R[k], work.end_p[k])


@kernel
def place_joints(
    parent: Ints, rotary: Ints, axis: Floats, along: Ints, R0: Floats, p0: Floats, moved: Ints, coordinate: Ints,
    factor: Floats, command: Floats, x: Floats, R: Floats, p: Floats, w: Floats, o: Floats,
) -> None:  # fmt: skip
    """Frames behind all joints, their axes and points on these; few arrays, for all of them take longer to pass."""
    for j in range(len(parent)):
        i = parent[j]
        k = along[j]
        for a in range(3):
            if i < 0:
                p[j, a] = p0[j, a]
                for b in range(3):
                    R[j, a, b] = R0[j, a, b]
            elif moved[j]:
                B0, B1, B2 = R[i, a, 0], R[i, a, 1], R[i, a, 2]
                p[j, a] = p[i, a] + B0 * p0[j, 0] + B1 * p0[j, 1] + B2 * p0[j, 2]
                for b in range(3):
                    R[j, a, b] = B0 * R0[j, 0, b] + B1 * R0[j, 1, b] + B2 * R0[j, 2, b]
            else:
                p[j, a] = p[i, a]
                for b in range(3):
                    R[j, a, b] = R[i, a, b]
            o[j, a] = p[j, a]
            if k >= 0:
                w[j, a] = R[j, a, k]
            else:
                w[j, a] = R[j, a, 0] * axis[j, 0] + R[j, a, 1] * axis[j, 1] + R[j, a, 2] * axis[j, 2]
        value = command[j]
        if coordinate[j] >= 0:
            value += factor[j] * x[coordinate[j]]
        if not rotary[j]:
            for a in range(3):
                p[j, a] += value * w[j, a]
            continue
        c, s = np.cos(value), np.sin(value)
        if k >= 0:
            k1, k2 = (k + 1) % 3, (k + 2) % 3
            for a in range(3):
                r1, r2 = R[j, a, k1], R[j, a, k2]
                R[j, a, k1] = c * r1 + s * r2
                R[j, a, k2] = c * r2 - s * r1
            continue
        w0, w1, w2 = w[j, 0], w[j, 1], w[j, 2]
        for b in range(3):
            r0, r1, r2 = R[j, 0, b], R[j, 1, b], R[j, 2, b]
            d = (1.0 - c) * (w0 * r0 + w1 * r1 + w2 * r2)
            R[j, 0, b] = c * r0 + s * (w1 * r2 - w2 * r1) + d * w0
            R[j, 1, b] = c * r1 + s * (w2 * r0 - w0 * r2) + d * w1
            R[j, 2, b] = c * r2 + s * (w0 * r1 - w1 * r0) + d * w2


@kernel
def behind(R: Floats, p: Floats, j: int, R_own: Floats, p_own: Floats, R_out: Floats, p_out: Floats) -> None:
    """A frame fixed behind a joint, −1 for the ground."""
    if j < 0:
        for a in range(3):
            p_out[a] = p_own[a]
            for b in range(3):
                R_out[a, b] = R_own[a, b]
        return
    for a in range(3):
        B0, B1, B2 = R[j, a, 0], R[j, a, 1], R[j, a, 2]
        p_out[a] = p[j, a] + B0 * p_own[0] + B1 * p_own[1] + B2 * p_own[2]
        for b in range(3):
            R_out[a, b] = B0 * R_own[0, b] + B1 * R_own[1, b] + B2 * R_own[2, b]


@kernel
def carried(R: Floats, p: Floats, j: int, offset: Floats, out: Floats) -> None:
    """A point fixed behind a joint, −1 for the ground."""
    for a in range(3):
        out[a] = offset[a]
        if j >= 0:
            out[a] = p[j, a] + R[j, a, 0] * offset[0] + R[j, a, 1] * offset[1] + R[j, a, 2] * offset[2]


@kernel
def turn_followers(model: MachineArrays, work: Work) -> None:
    """Keep the followers in their bodies' axes, the bodies being placed unloaded."""
    for k in range(len(model.load_joint)):
        R = work.R[model.load_joint[k]]
        for half in range(0, 6, 3):
            for a in range(3):
                s = 0.0
                for b in range(3):
                    s += R[b, a] * model.load[k, half + b]
                work.body[k, half + a] = s


@kernel
def act(S: Floats, u: int, point: Floats, point_row: int, f: Floats, row: int, share: float) -> None:
    """Add the wrench in a row of ``f`` (…, 6) at a world point, a row of ``point``, to the sums ``S[u]`` (15,)."""
    for a in range(3):
        S[u, a] += share * f[row, a]
        S[u, 3 + a] += share * f[row, 3 + a]
        for b in range(3):
            S[u, 6 + 3 * a + b] += share * point[point_row, a] * f[row, b]


@kernel
def grown(joint: int, command: Floats) -> float:
    """Length in mm of what grows with a joint; 1 where nothing does."""
    return max(GROWS * command[joint], SHORTEST) if joint >= 0 else 1.0


@kernel
def ends_are_loads(load_end: Ints) -> bool:
    """Whether the wrenches on the end frames stand among the loads, the last of them, for they have moments."""
    return len(load_end) > 0 and load_end[len(load_end) - 1] >= 0


@kernel
def gather(model: MachineArrays, command: Floats, end_wrench: Floats, share: float, work: Work) -> None:
    """Sums over what is fixed to each unit: loads, end wrenches, springs between points, closures."""
    S, R, p, acting, point, body = work.S, work.R, work.p, work.acting, work.point, work.body
    joint, offset, load, follows, grows = (
        model.load_joint, model.load_offset, model.load, model.follows, model.load_grows,
    )  # fmt: skip
    carrier, load_end = model.carrier, model.load_end
    for u in range(len(S)):
        for a in range(15):
            S[u, a] = 0.0
    for k in range(len(joint)):
        j = joint[k]
        part_of = share * grown(grows[k], command)
        for a in range(3):
            point[k, a] = p[j, a] + R[j, a, 0] * offset[k, 0] + R[j, a, 1] * offset[k, 1]
            point[k, a] += R[j, a, 2] * offset[k, 2]
            for half in range(0, 6, 3):
                s = load[k, half + a]
                if load_end[k] >= 0:
                    s = end_wrench[load_end[k], half + a]
                elif follows[k]:
                    s = R[j, a, 0] * body[k, half] + R[j, a, 1] * body[k, half + 1]
                    s += R[j, a, 2] * body[k, half + 2]
                acting[k, half + a] = part_of * s
        act(S, carrier[j], point, k, acting, k, 1.0)
    for k in range(len(model.end_joint)):
        if model.end_joint[k] >= 0 and not ends_are_loads(load_end):
            act(S, carrier[model.end_joint[k]], work.end_p, k, end_wrench, k, share)
    for k in range(len(model.spring)):
        stretch(model.spring_joint, model.spring_point, model.spring, model.spring_law[k], model.law_first,
                model.law_knot, model.law_piece, carrier, k, work.R, work.p, S,
                work.spring_at, work.pull, work.sign, work.scale)  # fmt: skip
        law = model.spring_law[k]
        if law >= 0 and work.state[4]:
            work.sign[k, 0], work.scale[k, 0] = 1.0, np.sqrt(model.law_most[law])
    for k in range(len(model.closure_rows)):
        close(model.closure_joint, model.closure_R, model.closure_p, model.closure_rows[k], model.closure_first[k],
              carrier, k, work.R, work.p, S, work.place, work.wrench, work.gap)  # fmt: skip


@kernel
def stretch(
    joint: Ints, point: Floats, spring: Floats, law: int, law_first: Ints, law_knot: Floats, law_piece: Floats,
    carrier: Ints, k: int, R: Floats, p: Floats, S: Floats, ends: Floats, pull: Floats, sign: Floats, scale: Floats,
) -> None:  # fmt: skip
    """A spring between points: its forces on both bodies, and its stiffness along and across."""
    d, force, length = np.empty(3), np.zeros((1, 6)), 0.0
    carried(R, p, joint[k, 0], point[k, 0], ends[k, 0])
    carried(R, p, joint[k, 1], point[k, 1], ends[k, 1])
    for i in range(3):
        d[i] = ends[k, 1, i] - ends[k, 0, i]
        length += d[i] * d[i]
    length = np.sqrt(length)
    stiffness, free, preload = spring[k, 0], spring[k, 1], spring[k, 2]
    if law >= 0:
        tension, stiffness = law_at(law_first, law_knot, law_piece, law, length - free)
    else:
        tension = stiffness * (length - free)
    # where the points meet the direction of the pull is not defined; without a pull there it is not needed
    over = (tension + preload) / length if length > 0.0 else stiffness
    for i in range(3):
        force[0, i] = over * d[i]
        d[i] = d[i] / length if length > 0.0 else (1.0 if i == 0 else 0.0)
    for side in range(2):
        if joint[k, side] >= 0:
            act(S, carrier[joint[k, side]], ends[k], side, force, 0, 1.0 - 2.0 * side)
    # axes: along the spring, and two across
    u = pull[k].reshape((3, 3))
    least = 0
    for i in range(1, 3):
        if abs(d[i]) < abs(d[least]):
            least = i
    size = np.sqrt(1.0 - d[least] * d[least])
    for i in range(3):
        u[0, i] = d[i]
        u[1, i] = ((1.0 if i == least else 0.0) - d[least] * d[i]) / size
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        u[2, i] = u[0, i1] * u[1, i2] - u[0, i2] * u[1, i1]
    for i in range(3):
        K = stiffness if i == 0 else over
        sign[k, i] = 1.0 if K >= 0.0 else -1.0
        scale[k, i] = np.sqrt(abs(K))


@kernel
def close(
    joint: Ints, R_own: Floats, p_own: Floats, rows: int, first: int, carrier: Ints, k: int, R: Floats, p: Floats,
    S: Floats, place: Floats, wrench: Floats, gap: Floats,
) -> None:  # fmt: skip
    """A closure: what its frames miss, and its wrench on both bodies at the second frame's origin."""
    Ra, Rb, pa, acting = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.zeros((1, 6))
    behind(R, p, joint[k, 0], R_own[k, 0], p_own[k, 0], Ra, pa)
    behind(R, p, joint[k, 1], R_own[k, 1], p_own[k, 1], Rb, place[k])
    for i in range(rows):
        acting[0, i] = wrench[first + i]
    for i in range(3):
        gap[first + i] = pa[i] - place[k, i]
    if rows == 6:
        rotation_between(Ra, Rb, gap[first + 3 : first + 6])
    for side in range(2):
        if joint[k, side] >= 0:
            act(S, carrier[joint[k, side]], place, k, acting, 0, 2.0 * side - 1.0)


@kernel
def rotation_between(to: Floats, R: Floats, out: Floats) -> None:
    """Rotation vector from ``R`` to ``to``; nan at half a turn."""
    x = y = z = trace = 0.0
    for b in range(3):
        x += 0.5 * (to[2, b] * R[1, b] - to[1, b] * R[2, b])
        y += 0.5 * (to[0, b] * R[2, b] - to[2, b] * R[0, b])
        z += 0.5 * (to[1, b] * R[0, b] - to[0, b] * R[1, b])
        trace += to[0, b] * R[0, b] + to[1, b] * R[1, b] + to[2, b] * R[2, b]
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (trace - 1.0)
    scale = np.arctan2(sine, cosine) / sine if sine > 1e-9 else (1.0 if cosine > 0.0 else np.nan)
    out[0], out[1], out[2] = x * scale, y * scale, z * scale


@kernel
def joint_sums(model: MachineArrays, work: Work, end_wrench: Floats, share: float, S: Floats) -> None:
    """Sums ``S`` (m, 15) over what is behind each joint, held joints among them; the loads being gathered."""
    f = np.zeros((1, 6))
    S[:, :] = 0.0
    for k in range(len(model.load_joint)):
        act(S, model.load_joint[k], work.point, k, work.acting, k, 1.0)
    for k in range(len(model.end_joint)):
        if model.end_joint[k] >= 0 and not ends_are_loads(model.load_end):
            act(S, model.end_joint[k], work.end_p, k, end_wrench, k, share)
    for k in range(len(model.spring)):
        over = work.sign[k, 1] * work.scale[k, 1] ** 2
        for a in range(3):
            f[0, a] = over * (work.spring_at[k, 1, a] - work.spring_at[k, 0, a])
        for side in range(2):
            if model.spring_joint[k, side] >= 0:
                act(S, model.spring_joint[k, side], work.spring_at[k], side, f, 0, 1.0 - 2.0 * side)
    sum_up(model, work, work.wrench, S)


@kernel
def sum_up(model: MachineArrays, work: Work, wrench: Floats, S: Floats) -> None:
    """Add the closures' wrenches ``(f,)`` to sums ``S`` (m, 15) over bodies, and to each what is behind it."""
    f = np.zeros((1, 6))
    for k in range(len(model.closure_rows)):
        f[:, :] = 0.0
        for i in range(model.closure_rows[k]):
            f[0, i] = wrench[model.closure_first[k] + i]
        for side in range(2):
            if model.closure_joint[k, side] >= 0:
                act(S, model.closure_joint[k, side], work.place, k, f, 0, 2.0 * side - 1.0)
    for j in range(len(S) - 1, -1, -1):
        i = model.parent[j]
        if i >= 0:
            for a in range(15):
                S[i, a] += S[j, a]


@kernel
def joint_forces(model: MachineArrays, work: Work, end_wrench: Floats, share: float, forces: Floats) -> None:
    """Force ``(m,)`` of all that acts behind each joint on it, held joints among them; the loads being gathered."""
    S = np.zeros((len(model.parent), 15))
    joint_sums(model, work, end_wrench, share, S)
    for j in range(len(S)):
        forces[j] = force_on(S, j, model.rotary[j], work.w, work.o)


@kernel
def force_on(S: Floats, j: int, rotary: int, w: Floats, o: Floats) -> float:
    """Force or moment on a joint of what acts behind it, from the sums ``S`` (m, 15)."""
    if not rotary:
        return w[j, 0] * S[j, 0] + w[j, 1] * S[j, 1] + w[j, 2] * S[j, 2]
    force = w[j, 0] * (S[j, 11] - S[j, 13] - o[j, 1] * S[j, 2] + o[j, 2] * S[j, 1] + S[j, 3])
    force += w[j, 1] * (S[j, 12] - S[j, 8] - o[j, 2] * S[j, 0] + o[j, 0] * S[j, 2] + S[j, 4])
    return force + w[j, 2] * (S[j, 7] - S[j, 9] - o[j, 0] * S[j, 1] + o[j, 1] * S[j, 0] + S[j, 5])
