"""Kernels: the chain's equilibria step after step along a history, with what each step leaves behind.

What depends on the history (bristles in the joints, sets, what lags behind) keeps its state between steps. A step
on which Newton's method fails is halved. Where the chain has become unstable (the determinant has changed its sign)
the branch that leaves along the softest motion is taken.
"""

from __future__ import annotations

import numpy as np

from hidden_effects.chain_kernel import (
    ANGLE,
    HALVINGS,
    HELD,
    TERMS,
    UNIT,
    Bundle,
    branched,
    conditions,
    jacobian,
    joint_torque,
    orientation,
    posed,
    settled,
)
from hidden_effects.rod_kernel import (
    DRIVE,
    EIY,
    EIZ,
    FACTOR,
    FACTOR_PULL,
    FOOT,
    LAG,
    LAG_RATE,
    LENGTH,
    LINK,
    SET,
    SET_LARGEST,
    SET_NOW,
    back_on,
    permanent,
)
from vjm.kernels.compilation import entry, kernel
from vjm.rotations import Array


@kernel
def prepare(span: float, creep: Array, lags: Bundle, last: Bundle, laws: Array, late: Bundle) -> None:
    """What a step of ``span`` seconds adds to strains and shifts by what lags behind, in place.

    Each term of creep follows its load exactly where that changes evenly over the step.
    """
    rates, strain_foot, strain_link, wrench_late, _, _ = late
    lag_foot, lag_link, lag_wrench, lag_drive = lags
    last_foot, last_link, last_wrench, last_drive, fixed_foot, fixed_link, soft_foot, soft_link = last
    strain_foot[:], strain_link[:], wrench_late[:] = fixed_foot, fixed_link, 0.0
    rates[:] = 0.0
    laws[DRIVE, LAG], laws[DRIVE, LAG_RATE] = 0.0, 0.0
    for k in range(TERMS):
        tau = creep[3, k]
        if tau <= 0.0:
            continue
        z = span / tau
        a = np.exp(-z)
        # load from w₀ to w₁: lag₁ = a lag₀ + b₀ w₀ + b₁ w₁
        mean = (1.0 - a) / z if z > 1e-9 else 1.0 - 0.5 * z
        b0, b1 = mean - a, 1.0 - mean
        share = creep[FOOT, k]
        if share != 0.0:
            rates[0] += share * b1
            strain_foot += share * soft_foot * (a * lag_foot[k] + b0 * last_foot)
            wrench_late += share * (a * lag_wrench[k] + b0 * last_wrench)
        share = creep[LINK, k]
        if share != 0.0:
            rates[1] += share * b1
            strain_link += share * soft_link * (a * lag_link[k] + b0 * last_link)
        share = creep[DRIVE, k]
        if share != 0.0:
            laws[DRIVE, LAG] += share * (a * lag_drive[k] + b0 * last_drive[0])
            laws[DRIVE, LAG_RATE] += share * b1


@kernel
def keep(span: float, x: Array, out: Array, creep: Array, lags: Bundle, last: Bundle, laws: Array, joints: Array,
         late: Bundle, foot_own: Array, path: Array) -> None:  # fmt: skip
    """Take the state over at the end of a step, in place."""
    lag_foot, lag_link, lag_wrench, lag_drive = lags
    last_foot, last_link, last_wrench, last_drive = last[0], last[1], last[2], last[3]
    _, _, _, _, loads_foot, loads_link = late
    wrench = np.empty(6)
    wrench[:3], wrench[3:] = back_on(foot_own, out[7:10]), back_on(foot_own, out[10:13])
    drive = out[0] * path[0] + out[1] * path[1] + out[2] * path[2]
    for k in range(TERMS):
        tau = creep[3, k]
        if tau <= 0.0:
            continue
        z = span / tau
        a = np.exp(-z)
        mean = (1.0 - a) / z if z > 1e-9 else 1.0 - 0.5 * z
        b0, b1 = mean - a, 1.0 - mean
        lag_foot[k] = a * lag_foot[k] + b0 * last_foot + b1 * loads_foot
        lag_link[k] = a * lag_link[k] + b0 * last_link + b1 * loads_link
        lag_wrench[k] = a * lag_wrench[k] + b0 * last_wrench + b1 * wrench
        lag_drive[k] = a * lag_drive[k] + b0 * last_drive[0] + b1 * drive
    last_foot[:], last_link[:], last_wrench[:] = loads_foot, loads_link, wrench
    last_drive[0] = drive
    for row in range(3):
        force = out[6] if row == LINK else drive
        if laws[row, SET] != 0.0:
            laws[row, SET_NOW] = permanent(force, laws[row])
            laws[row, SET_LARGEST] = max(laws[row, SET_LARGEST], abs(force))
    for k in range(4):
        q = x[6 + k] * UNIT[6 + k]
        joints[k, HELD] = joint_torque(q, joints[k])
        joints[k, ANGLE] = q


@entry
def march(poses: Array, spans: Array, q0: Array, home: Array, m: Bundle, laws: Array, joints: Array, creep: Array,
          fixed_foot: Array, fixed_link: Array, soft_foot: Array, soft_link: Array, side: float,
          ) -> tuple[Array, int]:  # fmt: skip
    """Wrenches along a history.

    Args:
        poses: displacements ``(n, 6)`` of the end from its unloaded pose.
        spans: seconds ``(n,)`` since the pose before.
        q0: joints' angles ``(4,)`` of the posture.
        home: frame ``(4, 4)`` of the unloaded end.
        m: the machine.
        laws: ``(3, COLUMNS)``; changed.
        joints: ``(4, 4)``; changed.
        creep: ``(4, TERMS)``: share by part (of the drive: mm/N), last row the times in s.
        fixed_foot: intrinsic strains ``(2 k + 1, 4)``.
        fixed_link: likewise.
        soft_foot: compliances ``(4,)`` by which late loads become strains.
        soft_link: likewise.
        side: +1 or −1: to which side a column buckles.

    Returns:
        Wrench ``(n, 6)`` and joints' angles ``(n, 4)`` side by side ``(n, 10)``, and how many poses were reached.
    """
    late = (np.zeros(2), fixed_foot.copy(), fixed_link.copy(), np.zeros(6), np.zeros_like(fixed_foot),
            np.zeros_like(fixed_link))  # fmt: skip
    lags = (np.zeros((TERMS, *fixed_foot.shape)), np.zeros((TERMS, *fixed_link.shape)), np.zeros((TERMS, 6)),
            np.zeros(TERMS))  # fmt: skip
    last = (np.zeros_like(fixed_foot), np.zeros_like(fixed_link), np.zeros(6), np.zeros(1), fixed_foot, fixed_link,
            soft_foot, soft_link)  # fmt: skip
    foot_own, path = m[6], m[12]
    out, result = np.zeros(18), np.zeros((len(poses), 10))
    joints[:, ANGLE] = q0
    x = np.zeros(10)
    x[6:] = q0 / UNIT[6:]
    J, pose, start = np.zeros((10, 10)), np.zeros(6), x.copy()
    place, turn = posed(pose, home)
    prepare(0.0, creep, lags, last, laws, late)
    # weight is there before anything moves
    if not settled(x, place, turn, m, laws, joints, late, out, J, True):
        return result, 0
    keep(0.0, x, out, creep, lags, last, laws, joints, late, foot_own, path)
    J[:] = jacobian(
        x, conditions(x, place, turn, m, laws, joints, late, out), place, turn, m, laws, joints, late, out
    )
    stable = orientation(J)
    before, moved = x.copy(), np.zeros(6)
    rod = m[10][1]
    doubtful = (
        0.5 * np.pi**2 * min(rod[EIY], rod[EIZ]) / (rod[FACTOR] * (1.0 + abs(rod[FACTOR_PULL])) * rod[LENGTH] ** 2)
    )
    for i in range(len(poses)):
        done, share, halvings = 0.0, 1.0, 0
        first = pose.copy()
        while done < 1.0:
            share = min(share, 1.0 - done)
            here = first + (done + share) * (poses[i] - first)
            span = spans[i] * share
            prepare(span, creep, lags, last, laws, late)
            place, turn = posed(here, home)
            start[:] = x
            step = here - pose
            # along the last step where this one goes the same way
            norm = moved @ moved
            if norm > 0.0:
                x += (x - before) * max(min((step @ moved) / norm, 2.0), -1.0)
            good = settled(x, place, turn, m, laws, joints, late, out, J, i == 0)
            if not good:
                x[:] = start
                good = settled(x, place, turn, m, laws, joints, late, out, J, True)
            # well below the column's critical force nothing can become unstable
            if good and -out[6] > doubtful:
                r = conditions(x, place, turn, m, laws, joints, late, out)
                J[:] = jacobian(x, r, place, turn, m, laws, joints, late, out)
                if orientation(J) != stable:
                    good = branched(x, pose, here, home, m, laws, joints, late, out, side)
                    r = conditions(x, place, turn, m, laws, joints, late, out)
                    J[:] = jacobian(x, r, place, turn, m, laws, joints, late, out)
                    good = good and orientation(J) == stable
                # differences have left another state's loads behind
                conditions(x, place, turn, m, laws, joints, late, out)
            if not good:
                x[:] = start
                share *= 0.5
                halvings += 1
                if halvings > HALVINGS:
                    return result, i
                continue
            keep(span, x, out, creep, lags, last, laws, joints, late, foot_own, path)
            before[:], moved[:], pose[:] = start, step, here
            done += share
        result[i, :6], result[i, 6:] = out[:6], x[6:] * UNIT[6:]
    return result, len(poses)
