"""Kernels: one equilibrium of the whole chain, and the branch that it takes where the straight one is unstable.

The force, the base's moment and the joints' angles are solved for at once, by Newton's method with differences.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hidden_effects.rod_kernel import (
    DRIVE,
    FOOT,
    LINK,
    back_on,
    integrated,
    on,
    shifted,
    sprung,
    stretch,
    times,
    turned_by,
    vector_of,
)
from vjm.kernels.compilation import kernel
from vjm.rotations import Array

Bundle = tuple[Any, ...]
"""Arrays of several shapes."""
UNIT = np.array([1e3, 1e3, 1e3, 1e5, 1e5, 1e5, 1e-1, 1e-1, 1e-1, 1e-1])
"""Of the unknowns: force, moment, angles."""
SPAN = np.array([1e-1, 1e-1, 1e-1, 1e-3, 1e-3, 1e-3, 1e2, 1e2, 1e2, 1e2])
"""Of the conditions: mm, rad, N mm."""
STEP = 1e-6
"""Of the Jacobian's forward differences, in units: its error only slows Newton's method down."""
TOLERANCE = 1e-8
"""Of the conditions in their spans: 1e-9 mm, some 1e-5 N."""
TRIALS = 12
GAIN = 0.3
"""Of the conditions in one step; a Jacobian with which they fall less is renewed."""
HALVINGS = 10
BRISTLE, TORQUE, ANGLE, HELD = 0, 1, 2, 3
"""Columns of the joints' state ``(4, 4)``: N mm/rad before it slips, N mm at which it slips, angle, torque now."""
TERMS = 2
"""Of creep."""


@kernel
def joint_torque(q: float, joint: Array) -> float:
    """Dahl's friction: a bristle that bends before it slips (P. R. Dahl, 1968), exactly over one turn."""
    slip = joint[TORQUE]
    if slip == 0.0:
        return 0.0
    turn = q - joint[ANGLE]
    end = slip if turn >= 0.0 else -slip
    return end + (joint[HELD] - end) * np.exp(-joint[BRISTLE] * abs(turn) / slip)


@kernel
def conditions(
    x: Array, place: Array, turn: Array, m: Bundle, laws: Array, joints: Array, late: Bundle, out: Array
) -> Array:
    """What is left of the ten conditions ``(10,)``, in their spans.

    Args:
        x: unknowns ``(10,)`` in units.
        place: position ``(3,)`` that the end must have.
        turn: its orientation ``(3, 3)``.
        m: the machine, see `hidden_effects.machine.TrueMachine.packed`.
        laws: ``(3, COLUMNS)``.
        joints: ``(4, 4)`` by joint.
        late: what answers late: rates ``(2,)``, strains of foot and link, wrench ``(6,)`` of a lumped foot; and the
            loads of foot and link, to be written.
        out: ``(18,)`` becomes the wrench at the end, the force along the link, and the wrench at the foot's tip.
    """
    (
        base,
        base_soft,
        foot_in,
        foot_back,
        foot_arm,
        foot_soft,
        foot_own,
        link_in,
        link_back,
        axes,
        rods,
        down,
        path,
    ) = m
    rates, strain_foot, strain_link, wrench_late, loads_foot, loads_link = late
    n, moment = x[:3] * UNIT[:3], x[3:6] * UNIT[3:6]
    r = np.empty(10)
    p, R = base[:3, 3].copy(), base[:3, :3].copy()
    given = np.zeros(6)
    for i in range(6):
        for j in range(6):
            given[i] += base_soft[i, j] * (n[j] if j < 3 else moment[j - 3])
    shifted(p, n, moment, given[:3])
    R = times(turned_by(given[3:]), R)
    along = on(R, path)
    shifted(p, n, moment, along * stretch(n[0] * along[0] + n[1] * along[1] + n[2] * along[2], laws[DRIVE]))
    if rods[0, 0] > 0.0:
        R = integrated(p, times(R, foot_in), n, moment, rods[0], down, rates[0], strain_foot, loads_foot)
        shifted(p, n, moment, on(R, foot_arm))
        R = times(R, foot_back)
    else:
        shifted(p, n, moment, on(R, foot_arm))
        own = times(R, foot_own)
        soft = foot_soft * (1.0 + rates[0])
        # a lumped foot's late answer is small: its wrench is carried over to the tip
        R = sprung(p, own, n, moment, soft)
        R = times(R, foot_own.T)
    tip = np.empty(6)
    tip[:3], tip[3:] = back_on(R, n), back_on(R, moment)
    extra = np.zeros(6)
    if rods[0, 0] == 0.0:
        for i in range(6):
            for j in range(6):
                extra[i] += foot_soft[i, j] * wrench_late[j]
    push = stretch(n[0] * along[0] + n[1] * along[1] + n[2] * along[2], laws[FOOT]) if laws[FOOT].any() else 0.0
    if push != 0.0:
        # the foot deflects as it does under a force along the drive
        C = on(foot_own.T, path)
        whole = 0.0
        for i in range(3):
            for j in range(3):
                whole += C[i] * foot_soft[i, j] * C[j]
        for i in range(6):
            for j in range(3):
                extra[i] += foot_soft[i, j] * C[j] * push / whole
    if extra.any():
        shifted(p, n, moment, on(R, on(foot_own, extra[:3])))
        R = times(R, turned_by(on(foot_own, extra[3:])))
    q = x[6:] * UNIT[6:]
    for k in range(4):
        a = on(R, axes[k])
        r[6 + k] = (a[0] * moment[0] + a[1] * moment[1] + a[2] * moment[2] - joint_torque(q[k], joints[k])) / SPAN[
            6 + k
        ]
        R = times(R, turned_by(axes[k] * q[k]))
        if k == 1:
            R = times(R, link_in)
            along = R[:, 0].copy()
            axial = n[0] * along[0] + n[1] * along[1] + n[2] * along[2]
            out[6] = axial
            shifted(p, n, moment, along * stretch(axial, laws[LINK]))
            R = integrated(p, R, n, moment, rods[1], down, rates[1], strain_link, loads_link)
            R = times(R, link_back)
    out[:3], out[3:6], out[7:13] = n, moment, tip
    error = vector_of(times(turn.T.copy(), R))
    for i in range(3):
        r[i] = (p[i] - place[i]) / SPAN[i]
        r[3 + i] = error[i] / SPAN[3 + i]
    return r


@kernel
def jacobian(x: Array, r: Array, place: Array, turn: Array, m: Bundle, laws: Array, joints: Array,
             late: Bundle, out: Array) -> Array:  # fmt: skip
    """Forward differences ``(10, 10)``."""
    J, y = np.empty((10, 10)), x.copy()
    for k in range(10):
        y[k] = x[k] + STEP
        J[:, k] = (conditions(y, place, turn, m, laws, joints, late, out) - r) / STEP
        y[k] = x[k]
    return J


@kernel
def solved(A: Array, b: Array) -> bool:
    """Solve ``A y = b`` by elimination in copies; ``b`` becomes y. Whether that was possible."""
    n, A = len(b), A.copy()
    for k in range(n):
        pivot = k + np.argmax(np.abs(A[k:, k]))
        if not abs(A[pivot, k]) > 1e-300:
            return False
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            b[k], b[pivot] = b[pivot], b[k]
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            if share != 0.0:
                A[i, k:] -= share * A[k, k:]
                b[i] -= share * b[k]
    for k in range(n - 1, -1, -1):
        b[k] = (b[k] - A[k, k + 1 :] @ b[k + 1 :]) / A[k, k]
    return bool(np.isfinite(b).all())


@kernel
def settled(x: Array, place: Array, turn: Array, m: Bundle, laws: Array, joints: Array, late: Bundle,
            out: Array, J: Array, fresh: bool) -> bool:  # fmt: skip
    """Newton's method from ``x`` in place; whether it converged.

    The Jacobian ``J`` is Broyden's (C. G. Broyden, Math. Comp. 19, 1965, 577): each step's outcome mends it, and
    differences are taken anew only where a step has gained little.
    """
    last = np.inf
    before, step = np.empty(10), np.empty(10)
    for trial in range(TRIALS):
        r = conditions(x, place, turn, m, laws, joints, late, out)
        size = np.abs(r).max()
        if not size < 1e6:
            return False
        if size < TOLERANCE:
            return True
        if (fresh and trial == 0) or size > GAIN * last:
            J[:] = jacobian(x, r, place, turn, m, laws, joints, late, out)
        elif trial > 0:
            square = step @ step
            for i in range(10):
                for k in range(10):
                    J[i, k] += (r[i] - before[i]) / square * step[k]
        last = size
        before[:] = r
        if not solved(J, r):
            return False
        share = min(1.0, 3.0 / np.abs(r).max())
        # what J says will be left
        before *= 1.0 - share
        step[:] = -share * r
        x += step
    return False


@kernel
def orientation(J: Array) -> float:
    """Sign of the determinant: it changes where a stable chain becomes unstable."""
    return np.sign(np.linalg.det(J))


@kernel
def branched(x: Array, pose0: Array, pose1: Array, home: Array, m: Bundle, laws: Array, joints: Array,
             late: Bundle, out: Array, side: float) -> bool:  # fmt: skip
    """From the unstable state near ``x`` to the branch that leaves along the softest motion, in place.

    The displacement is sought between ``pose0`` and ``pose1`` (and beyond) at which the branch has a prescribed
    amplitude; then the amplitude at which that is ``pose1``.
    """
    place, turn = posed(pose1, home)
    r = conditions(x, place, turn, m, laws, joints, late, out)
    J = jacobian(x, r, place, turn, m, laws, joints, late, out)
    if not np.isfinite(J).all():
        return False
    _, _, V = np.linalg.svd(J)
    v = V[9].copy()
    pivot = np.argmax(np.abs(v[6:])) + 6
    v *= side * np.sign(v[pivot])
    root, amplitude, last, last_share = x.copy(), 0.05, 0.0, 0.0
    for _ in range(30):
        y, share = root + amplitude * v, 1.0
        good = False
        for _ in range(2 * TRIALS):
            pose = pose0 + share * (pose1 - pose0)
            place, turn = posed(pose, home)
            r = conditions(y, place, turn, m, laws, joints, late, out)
            if not np.abs(r).max() < 1e6:
                break
            if np.abs(r).max() < TOLERANCE:
                good = True
                break
            A, b = np.zeros((11, 11)), np.zeros(11)
            A[:10, :10] = jacobian(y, r, place, turn, m, laws, joints, late, out)
            further, aside = posed(pose + 1e-5 * (pose1 - pose0), home)
            A[:10, 10] = (conditions(y, further, aside, m, laws, joints, late, out) - r) / 1e-5
            A[10, :10] = v
            b[:10], b[10] = r, v @ (y - root) - amplitude
            if not solved(A, b):
                break
            y -= b[:10]
            share -= b[10]
        if not good:
            amplitude *= 0.5
            continue
        if abs(share - 1.0) < 0.02:
            break
        factor = 1.7 if share < 1.0 else 0.6
        if last > 0.0 and share != last_share:
            # a branch bends away by its amplitude's square
            square = amplitude**2 + (1.0 - share) * (amplitude**2 - last**2) / (share - last_share)
            if square > 0.0:
                factor = min(max(np.sqrt(square) / amplitude, 0.3), 3.0)
        last, last_share = amplitude, share
        amplitude *= factor
        if amplitude < 1e-6:
            return False
    place, turn = posed(pose1, home)
    J = np.empty((10, 10))
    if not good or not settled(y, place, turn, m, laws, joints, late, out, J, True):
        return False
    if np.abs(y - root).max() < 1e-5:
        return False
    x[:] = y
    return True


@kernel
def posed(pose: Array, home: Array) -> tuple[Array, Array]:
    """Position and orientation of the end at a displacement ``(6,)`` from its unloaded frame ``(4, 4)``."""
    place = home[:3, 3] + pose[:3]
    return place, times(turned_by(pose[3:]), home[:3, :3].copy())
