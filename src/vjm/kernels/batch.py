"""Compiled equilibria of a machine in many postures or under many loads, with the stiffness of its ends."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.border import invert, solve
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.newton import NOT_HELD, linearise, loaded
from vjm.kernels.statics import behind, joint_forces, place, rotation_between, turn_followers
from vjm.kernels.substitution import load, move

STABLE, UNSTABLE, LOST, UNDETERMINED = 0, 1, 2, 3
"""What became of a posture: a stable or an unstable equilibrium, none found, or one that nothing holds."""
REGULAR = 1e-13
"""Pivot of a compliance, scaled to a unit diagonal, below which it is rounding: under six springs move the end."""
STILL = 1e-24
"""Compliance of a direction over the largest of its kind that is rounding: that of J, 1e-15, squared is 1e-30."""


@kernel
def end_compliance(model: MachineArrays, work: Work, k: int, C: Floats) -> None:
    """Compliance ``C`` (6, 6) of an end frame with the factors at hand, which have its columns."""
    T, y, right = work.T, work.y, work.right
    first, inner = model.size[5] + 6 * k, model.size[5]
    for a in range(6):
        for i in range(inner):
            right[i] = -T[i, first + a]
        solve(model, work)
        for b in range(6):
            s = T[first + b, first + a]
            for i in range(inner):
                s += T[first + b, i] * y[i]
            C[b, a] = s


@kernel
def inverse_of(C: Floats, F: Floats, K: Floats) -> None:
    """``K = C⁻¹`` (6, 6), scaled to a unit diagonal on the way; nan where C has no inverse."""
    # a direction in which nothing moves: what its diagonal holds is rounding, squared
    largest, unit = np.zeros(2), np.empty(6)
    for a in range(6):
        largest[a // 3] = max(largest[a // 3], abs(C[a, a]))
    good = True
    for a in range(6):
        good = good and abs(C[a, a]) > STILL * largest[a // 3]
        unit[a] = 1.0 / np.sqrt(abs(C[a, a]))
    if good:
        for a in range(6):
            for b in range(6):
                F[a, b] = C[a, b] * unit[a] * unit[b]
                good = good and np.isfinite(F[a, b])
    if not good or not invert(F, REGULAR):
        K[:, :] = np.nan
        return
    for a in range(6):
        for b in range(6):
            K[a, b] = F[a, b] * unit[a] * unit[b]


@entry
def equilibria_of(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, homes: Floats, end_wrench: Floats,
    springs: Floats, gradual: bool, x: Floats, wrench: Floats, verdict: Ints, forces: Floats, end_R: Floats,
    end_p: Floats, deflection: Floats, compliance: Floats, stiffness: Floats,
) -> None:  # fmt: skip
    """Equilibria of g postures; every array but the first two has g rows.

    Args:
        model: the machine.
        work: written.
        commands: ``(g, m)`` values of the held joints.
        naturals: ``(g, n)`` coordinates at which springs are free of stress.
        homes: ``(g or 1, n)`` coordinates of the unloaded posture: zero but for joints that closures turn.
        end_wrench: ``(g or 1, e, 6)`` wrenches on the end frames.
        springs: ``(g or 1, s, 3)`` laws of the springs between points.
        gradual: whether loads are put on in steps where an equilibrium is not found at once.
        x: ``(g, n)`` coordinates to start from; become those of the equilibria.
        wrench: ``(g, f)`` the closures' wrenches, likewise.
        verdict: ``(g,)`` written: `STABLE`, `UNSTABLE`, `LOST` or `UNDETERMINED`.
        forces: ``(g, m)`` of the loads on the joints.
        end_R: ``(g, e, 3, 3)`` and
        end_p: ``(g, e, 3)`` the end frames.
        deflection: ``(g, e, 6)`` of them from the unloaded posture.
        compliance: ``(g, e, 6, 6)`` tangent compliance of them; without rows where it is not wanted.
        stiffness: ``(g, e, 6, 6)`` its inverse, nan where it has none; likewise.
    """
    F = np.empty((6, 6))
    wanted = len(compliance) > 0
    for g in range(len(x)):
        home = homes[g if len(homes) > 1 else 0]
        acting = end_wrench[g if len(end_wrench) > 1 else 0]
        model.spring[:] = springs[g if len(springs) > 1 else 0]
        place(model, commands[g], home, work)
        turn_followers(model, work)
        end_R[g], end_p[g] = work.end_R, work.end_p
        work.wrench[:] = wrench[g]
        negative = settled(model, commands[g], naturals[g], x[g], acting, gradual, wanted, wrench[g], work)
        wrench[g] = work.wrench
        verdict[g] = UNDETERMINED if negative == NOT_HELD else LOST
        if negative >= 0:
            verdict[g] = STABLE if negative == 0 and work.state[3] == 0 else UNSTABLE
        joint_forces(model, work, acting, 1.0, forces[g])
        for k in range(len(work.end_p)):
            for a in range(3):
                deflection[g, k, a] = work.end_p[k, a] - end_p[g, k, a]
            rotation_between(work.end_R[k], end_R[g, k], deflection[g, k, 3:])
            if wanted and negative >= 0:
                end_compliance(model, work, k, compliance[g, k])
                inverse_of(compliance[g, k], F, stiffness[g, k])
        end_R[g], end_p[g] = work.end_R, work.end_p


@kernel
def settled(
    model: MachineArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, gradual: bool,
    ends: bool, wrench: Floats, work: Work,
) -> int:  # fmt: skip
    """The same as `loaded`; a machine with laws is also led to where these act, if it would fall else.

    Newton's method finds an equilibrium near by. Where a law has no slope the machine may fall from there. Led to
    where the law acts, the method may find another. The first one is kept unless that one is stable.

    Args:
        model: see `loaded`, as all others.
        command: likewise.
        natural: likewise.
        x: likewise.
        end_wrench: likewise.
        gradual: likewise.
        ends: likewise.
        wrench: the closures' wrenches ``(f,)`` to start from.
        work: likewise.
    """
    if len(model.law_most) == 0:
        return loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)
    begin = x.copy()
    negative = loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)
    if negative == 0 or negative == NOT_HELD:
        return negative
    first, first_wrench, found = x.copy(), work.wrench.copy(), negative
    x[:], work.wrench[:] = begin, wrench
    negative = loaded(model, command, natural, x, end_wrench, gradual, ends, True, work)
    if negative == 0 or found < 0:
        return negative
    x[:], work.wrench[:] = first, first_wrench
    return loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)


@entry
def residuals_of(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, homes: Floats, end_wrench: Floats,
    x: Floats, wrench: Floats, residual: Floats, gap: Floats, end_R: Floats, end_p: Floats,
) -> None:  # fmt: skip
    """Residuals ``(g, n)``, closures' gaps ``(g, f)`` and end frames at coordinates that need not be equilibria.

    See `equilibria_of` for the arguments.
    """
    for g in range(len(x)):
        place(model, commands[g], homes[g if len(homes) > 1 else 0], work)
        turn_followers(model, work)
        work.wrench[:] = wrench[g]
        acting = end_wrench[g if len(end_wrench) > 1 else 0]
        linearise(model, commands[g], naturals[g], x[g], acting, 1.0, False, work)
        residual[g], gap[g] = work.r, work.gap
        end_R[g], end_p[g] = work.end_R, work.end_p


@entry
def frames_at(
    model: MachineArrays, work: Work, commands: Floats, joint: Ints, R_own: Floats, p_own: Floats, R: Floats,
    p: Floats,
) -> None:  # fmt: skip
    """Frames ``(g, k, …)`` fixed behind joints, −1 for the ground, at commanded values ``(g, m)``, undeflected."""
    still = np.zeros(len(model.unit))
    for g in range(len(commands)):
        place(model, commands[g], still, work)
        for k in range(len(joint)):
            behind(work.R, work.p, joint[k], R_own[k], p_own[k], R[g, k], p[g, k])


@entry
def responses_of(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, homes: Floats, end_wrench: Floats,
    x: Floats, wrench: Floats, right: Floats, gap: Floats, moved: Floats,
) -> None:  # fmt: skip
    """Motions of the end frames that residuals ``right`` (g, k, n) and gaps (g, k, f) bring at equilibria.

    ``moved`` (g, k, e, 6) is written; see `equilibria_of` for the other arguments.
    """
    for g in range(len(x)):
        place(model, commands[g], homes[g if len(homes) > 1 else 0], work)
        turn_followers(model, work)
        work.wrench[:] = wrench[g]
        acting = end_wrench[g if len(end_wrench) > 1 else 0]
        linearise(model, commands[g], naturals[g], x[g], acting, 1.0, True, work)
        for k in range(right.shape[1]):
            load(model, right[g, k], gap[g, k], work)
            solve(model, work)
            move(model, False, work)
            for e in range(len(model.end_joint)):
                twist_of(model, work, e, moved[g, k, e])


@kernel
def twist_of(model: MachineArrays, work: Work, e: int, out: Floats) -> None:
    """Twist ``(6,)`` of an end frame by ``work.step``, along the joints before it."""
    out[:] = 0.0
    j = model.end_joint[e]
    while j >= 0:
        c = model.coordinate[j]
        if c >= 0:
            d = model.factor[j] * work.step[c]
            w0, w1, w2 = d * work.w[j, 0], d * work.w[j, 1], d * work.w[j, 2]
            if model.rotary[j]:
                r0 = work.end_p[e, 0] - work.o[j, 0]
                r1 = work.end_p[e, 1] - work.o[j, 1]
                r2 = work.end_p[e, 2] - work.o[j, 2]
                out[0] += w1 * r2 - w2 * r1
                out[1] += w2 * r0 - w0 * r2
                out[2] += w0 * r1 - w1 * r0
                out[3] += w0
                out[4] += w1
                out[5] += w2
            else:
                out[0] += w0
                out[1] += w1
                out[2] += w2
        j = model.parent[j]
