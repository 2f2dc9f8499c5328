"""Compiled equilibria of a machine by Newton's method.

The unknowns are its coordinates and its closures' wrenches. One state is solved at a time, or many postures or
loads with the stiffness of the ends.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats, Ints, MachineArrays, Work
from vjm.kernels.border import assemble, factor, invert, solve
from vjm.kernels.compilation import entry, kernel
from vjm.kernels.elimination import eliminate, move
from vjm.kernels.statics import (
    behind,
    gather,
    joint_forces,
    law_at,
    law_inverse,
    place,
    rotation_between,
    turn_followers,
)

CONVERGED, DIVERGED, SINGULAR, UNSTABLE, LOOSE = 0, 1, 2, 3, 4
"""How an iteration or a march ends; loose is an equilibrium that nothing holds, as laws have no slope there."""
NO_EQUILIBRIUM, NOT_HELD = -1, -2
"""In place of a number of negative eigenvalues: no equilibrium, or one that nothing holds."""
DIVERGING = 1e6
"""Scaled residual from which Newton's method does not come back."""
ITERATIONS = 40
"""Of Newton's method at one share of the loads."""
LARGEST_STEP = 0.3
"""Radians, or lengths of the machine, that one step may move a coordinate by."""
LAST_STEP = 2.5e-10
"""Below it the next would be lost in rounding, as steps shrink by their square. Compliance, which changes with a
turn by some times as much, is then known to 1e-9."""
STIFFER = 2.0
"""Growth of a law's force over what its tangent foresees from which a step is followed by the force."""
SMALLEST_SHARE = 1.0 / 256.0
"""Of the loads that is put on at once where all of them do not converge."""


@kernel
def linearise(
    model: MachineArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, share: float, ends: bool,
    work: Work,
) -> int:  # fmt: skip
    """Place, load, eliminate and factor a machine at a state.

    Args:
        model: the machine.
        command: ``(m,)`` values of the held joints.
        natural: ``(n,)`` coordinates at which the springs are free of stress.
        x: ``(n,)`` coordinates; the closures' wrenches are in ``work.wrench``.
        end_wrench: ``(e, 6)`` on the end frames, world axes.
        share: of all loads.
        ends: whether with the columns of the end frames.
        work: written.

    Returns:
        Number of negative eigenvalues of the symmetric part on what the closures leave; −1 where it is singular.
    """
    place(model, command, x, work)
    gather(model, command, end_wrench, share, work)
    negative = eliminate(model, command, natural, x, ends, work)
    assemble(model, command, natural, x, ends, work)
    if negative < 0:
        return -1
    work.state[0] = negative
    return factor(model, work)


@kernel
def advance(model: MachineArrays, share: float, x: Floats, work: Work) -> None:
    """Move coordinates and closures' wrenches by a share of what the border's solution asks for."""
    for i in range(len(x)):
        x[i] += share * work.step[i]
    for i in range(model.size[2]):
        work.wrench[i] += share * work.y[i]
    # a moment turns with nothing: the half of its coupling that is not symmetric
    for k in range(len(model.closure_rows)):
        if model.closure_rows[k] < 6:
            continue
        joint, first = model.closure_joint[k, 1], model.closure_first[k]
        if joint >= 0:
            turn = work.turn[model.carrier[joint]]
        else:
            turn = work.turn[model.carrier[model.closure_joint[k, 0]]]
        m0 = work.wrench[first + 3] - share * work.y[first + 3]
        m1 = work.wrench[first + 4] - share * work.y[first + 4]
        m2 = work.wrench[first + 5] - share * work.y[first + 5]
        half = 0.5 * share
        work.wrench[first + 3] -= half * (m1 * turn[2] - m2 * turn[1])
        work.wrench[first + 4] -= half * (m2 * turn[0] - m0 * turn[2])
        work.wrench[first + 5] -= half * (m0 * turn[1] - m1 * turn[0])


@kernel
def follow_laws(model: MachineArrays, natural: Floats, x: Floats, work: Work) -> None:
    """Let a step end where a law has the force that is foreseen, if that grows much faster than its tangent says.

    A law that becomes stiffer is followed by its force, one that becomes softer by its deflection: neither goes
    too far across a kink (so are the diodes of a circuit followed by SPICE, Nagel 1975). Foreseen is what the
    tangent says, or the residual where it has next to none.
    """
    for q in range(len(model.border)):
        law = model.border_law[q]
        if law < 0:
            continue
        c = model.border[q]
        u, step = x[c] - natural[c], work.step[c]
        force, _ = law_at(model.law_first, model.law_knot, model.law_piece, law, u)
        end_force, _ = law_at(model.law_first, model.law_knot, model.law_piece, law, u + step)
        foreseen = work.law_slope[q] * step
        if abs(end_force - force) > STIFFER * abs(foreseen):
            if abs(foreseen) < abs(work.r[c]):
                foreseen = work.r[c]
            end = law_inverse(model.law_first, model.law_knot, model.law_piece, law, force + foreseen, u + step)
            work.step[c] = end - u


@kernel
def slack(model: MachineArrays, work: Work) -> bool:
    """Whether a joint's law has no slope where it is: a machine that falls there falls to where the law acts."""
    is_slack = False
    for q in range(len(model.border)):
        is_slack = is_slack or (model.border_law[q] >= 0 and work.law_slope[q] == 0.0)
    return is_slack


@kernel
def newton(
    model: MachineArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, share: float, ends: bool,
    tolerance: float, most: int, led: bool, work: Work,
) -> tuple[int, int, float, int]:  # fmt: skip
    """Equilibrium from ``x`` (n,) and the closures' wrenches, which are overwritten.

    Args beside those of `linearise`:
        ends: whether with the columns of the end frames, but for the first iteration, which is seldom the last.
        tolerance: scaled residual at which it ends, by full steps; infinite to factor at the state that is given.
            Zero: steps are cut where they are large, and it ends when they are lost in rounding.
        most: iterations after which it gives up.
        led: whether a machine that falls where a law has no slope is led to where the law acts.
        work: written; its factors are those of the state returned, or of the last step's before it.

    Returns:
        How it ended, iterations, scaled residual, infinite where the tolerance is zero, and the number of negative
        eigenvalues there.
    """
    error, negative = np.inf, -1
    r, t, unit, gap, wrench, scale, acting, step = (
        work.r, work.t, model.unit, work.gap, work.wrench, work.scale_T, work.acting, work.step,
    )  # fmt: skip
    energy = model.energy[0]
    force = energy / model.length[0]
    for iteration in range(most + 1):
        negative = linearise(model, command, natural, x, end_wrench, share, ends and iteration > 0, work)
        loose = negative < 0 and len(model.law_most) > 0
        if loose or (led and negative > 0 and slack(model, work)):
            # nothing holds it where a law has no slope: go towards where the law acts
            work.state[4] = 1
            stiffer = linearise(model, command, natural, x, end_wrench, share, ends and iteration > 0, work)
            negative = stiffer if loose else negative
            work.state[4] = 0
        if tolerance > 0.0:
            residual, reaction_scale = 0.0, 1.0
            for i in range(len(x)):
                residual = max(residual, abs(r[i]) * unit[i] / energy)
                reaction_scale = max(reaction_scale, abs(t[i]) * unit[i] / energy)
            for i in range(model.size[2]):
                if not abs(gap[i]) < np.inf and tolerance < np.inf:
                    return DIVERGED, iteration, np.inf, -1
                residual = max(residual, abs(gap[i]) * scale[i] / energy)
                reaction_scale = max(reaction_scale, abs(wrench[i]) / scale[i])
            for k in range(len(model.load_joint)):
                for i in range(6):
                    reaction_scale = max(reaction_scale, abs(acting[k, i]) / (force if i < 3 else energy))
            error = residual / reaction_scale
            if error < tolerance and negative >= 0:
                return (LOOSE, iteration, error, -1) if loose else (CONVERGED, iteration, error, negative)
            if not error < DIVERGING:
                return DIVERGED, iteration, error, -1
        if negative < 0:
            return SINGULAR, iteration, error, -1
        if iteration == most:
            break
        solve(model, work)
        move(model, True, work)
        if len(model.law_most) > 0:
            follow_laws(model, natural, x, work)
        largest = 0.0
        for i in range(len(x)):
            largest = max(largest, abs(step[i]) / unit[i])
        if not largest < np.inf:
            return DIVERGED, iteration, error, -1
        cut = min(1.0, LARGEST_STEP / largest) if tolerance == 0.0 and largest > 0.0 else 1.0
        advance(model, cut, x, work)
        if tolerance == 0.0 and largest < LAST_STEP:
            return (LOOSE, iteration, error, -1) if loose else (CONVERGED, iteration, error, negative)
    return DIVERGED, most, error, negative


@kernel
def loaded(
    model: MachineArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, gradual: bool,
    ends: bool, led: bool, work: Work,
) -> int:  # fmt: skip
    """Equilibrium under all loads from ``x`` (n,), where the bodies stand and the loads act in the end.

    The factors are those of a state that the last step, less than `LAST_STEP`, was taken from: they are not made
    anew for it.

    With ``gradual`` loads are put on in steps where it is not found at once; see `newton` for the other arguments.

    Returns:
        Number of negative eigenvalues, see `linearise`; `NO_EQUILIBRIUM` where none is found, and
        `NOT_HELD` where nothing holds that which is.
    """
    work.begin[:] = x
    work.begin_wrench[:] = work.wrench
    done, step, share = -1.0, 0.25, 1.0
    while True:
        how, iterations, _, negative = newton(
            model, command, natural, x, end_wrench, share, ends and share == 1.0, 0.0, ITERATIONS, led, work
        )
        if how == LOOSE and share == 1.0:
            return NOT_HELD
        if how in (CONVERGED, LOOSE):
            # what few loads leave loose, more of them may bring to where a law acts
            if share == 1.0:
                # the slope of a law may change within the last step
                if ends and (iterations == 0 or len(model.law_most) > 0):
                    return linearise(model, command, natural, x, end_wrench, 1.0, True, work)
                place(model, command, x, work)
                gather(model, command, end_wrench, 1.0, work)
                return negative
            done = share
            work.begin[:] = x
            work.begin_wrench[:] = work.wrench
        elif not gradual:
            return NO_EQUILIBRIUM
        else:
            # from where it began: first without loads, then in steps that become smaller
            x[:] = work.begin
            work.wrench[:] = work.begin_wrench
            if share == 0.0:
                return NO_EQUILIBRIUM
            step = step if done < 0.0 else 0.5 * step
            if step < SMALLEST_SHARE:
                return NO_EQUILIBRIUM
        share = 0.0 if done < 0.0 else min(done + step, 1.0)


STABLE, UNSTABLE_STATE, LOST, UNDETERMINED = 0, 1, 2, 3
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
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, end_wrench: Floats,
    springs: Floats, gradual: bool, x: Floats, wrench: Floats, verdict: Ints, forces: Floats, end_R: Floats,
    end_p: Floats, deflection: Floats, compliance: Floats, stiffness: Floats,
) -> None:  # fmt: skip
    """Equilibria of g postures; every array but the first two has g rows.

    Args:
        model: the machine.
        work: written.
        commands: ``(g, m)`` values of the held joints.
        naturals: ``(g, n)`` coordinates at which springs are free of stress.
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
    F, still = np.empty((6, 6)), np.zeros(x.shape[1])
    wanted = len(compliance) > 0
    for g in range(len(x)):
        acting = end_wrench[g if len(end_wrench) > 1 else 0]
        model.spring[:] = springs[g if len(springs) > 1 else 0]
        place(model, commands[g], still, work)
        turn_followers(model, work)
        end_R[g], end_p[g] = work.end_R, work.end_p
        work.wrench[:] = wrench[g]
        negative = settled(model, commands[g], naturals[g], x[g], acting, gradual, wanted, wrench[g], work)
        wrench[g] = work.wrench
        verdict[g] = UNDETERMINED if negative == NOT_HELD else LOST
        if negative >= 0:
            verdict[g] = STABLE if negative == 0 and work.state[3] == 0 else UNSTABLE_STATE
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
    """The same as `loaded`, from closures' wrenches ``(f,)``; with laws led to where these act, if it would fall.

    Newton's method finds an equilibrium near by. Where a law has no slope the machine may fall from there. Led to
    where the law acts, the method may find another. The first one is kept unless that one is stable.
    """
    if len(model.law_most) == 0:
        return loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)
    begin = x.copy()
    negative = loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)
    if negative == 0 or negative == NOT_HELD:
        return negative
    first, first_wrench, first_negative = x.copy(), work.wrench.copy(), negative
    x[:], work.wrench[:] = begin, wrench
    negative = loaded(model, command, natural, x, end_wrench, gradual, ends, True, work)
    if negative == 0 or first_negative < 0:
        return negative
    x[:], work.wrench[:] = first, first_wrench
    return loaded(model, command, natural, x, end_wrench, gradual, ends, False, work)


@entry
def residuals_of(
    model: MachineArrays, work: Work, commands: Floats, naturals: Floats, end_wrench: Floats,
    x: Floats, wrench: Floats, residual: Floats, gap: Floats,
) -> None:  # fmt: skip
    """Residuals ``(g, n)`` and closures' gaps ``(g, f)`` at coordinates that need not be equilibria.

    See `equilibria_of` for the arguments.
    """
    still = np.zeros(x.shape[1])
    for g in range(len(x)):
        place(model, commands[g], still, work)
        turn_followers(model, work)
        work.wrench[:] = wrench[g]
        acting = end_wrench[g if len(end_wrench) > 1 else 0]
        linearise(model, commands[g], naturals[g], x[g], acting, 1.0, False, work)
        residual[g], gap[g] = work.r, work.gap


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
