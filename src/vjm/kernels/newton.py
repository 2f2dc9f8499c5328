"""Compiled equilibria of a machine: Newton's method on its coordinates and its closures' wrenches."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats, MachineArrays, Work
from vjm.kernels.border import assemble, factor, solve
from vjm.kernels.compilation import kernel
from vjm.kernels.elimination import eliminate
from vjm.kernels.laws import law_at, law_inverse
from vjm.kernels.statics import gather, place
from vjm.kernels.substitution import move

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
        led: see `newton`.
        work: written.

    Returns:
        Number of negative eigenvalues of the symmetric part on what the closures leave; −1 where it is singular.
    """
    place(model, command, x, work)
    gather(model, command, end_wrench, share, work)
    found = eliminate(model, command, natural, x, ends, work)
    assemble(model, command, natural, x, ends, work)
    if found < 0:
        return -1
    work.state[0] = found
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
        there, _ = law_at(model.law_first, model.law_knot, model.law_piece, law, u + step)
        foreseen = work.law_slope[q] * step
        if abs(there - force) > STIFFER * abs(foreseen):
            if abs(foreseen) < abs(work.r[c]):
                foreseen = work.r[c]
            end = law_inverse(model.law_first, model.law_knot, model.law_piece, law, force + foreseen, u + step)
            work.step[c] = end - u


@kernel
def slack(model: MachineArrays, work: Work) -> bool:
    """Whether a joint's law has no slope where it is: a machine that falls there falls to where the law acts."""
    found = False
    for q in range(len(model.border)):
        found = found or (model.border_law[q] >= 0 and work.law_slope[q] == 0.0)
    return found


@kernel
def newton(
    model: MachineArrays, command: Floats, natural: Floats, x: Floats, end_wrench: Floats, share: float, ends: bool,
    tolerance: float, most: int, led: bool, work: Work,
) -> tuple[int, int, float, int]:  # fmt: skip
    """Equilibrium from ``x`` (n,) and the closures' wrenches, which are overwritten.

    Args:
        model: the machine.
        command: see `linearise`.
        natural: likewise.
        x: likewise.
        end_wrench: likewise.
        share: likewise.
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
            lacking, heavy = 0.0, 1.0
            for i in range(len(x)):
                lacking = max(lacking, abs(r[i]) * unit[i] / energy)
                heavy = max(heavy, abs(t[i]) * unit[i] / energy)
            for i in range(model.size[2]):
                if not abs(gap[i]) < np.inf and tolerance < np.inf:
                    return DIVERGED, iteration, np.inf, -1
                lacking = max(lacking, abs(gap[i]) * scale[i] / energy)
                heavy = max(heavy, abs(wrench[i]) / scale[i])
            for k in range(len(model.load_joint)):
                for i in range(6):
                    heavy = max(heavy, abs(acting[k, i]) / (force if i < 3 else energy))
            error = lacking / heavy
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

    Args:
        model: the machine.
        command: see `linearise`.
        natural: likewise.
        x: likewise; overwritten.
        end_wrench: likewise.
        gradual: whether loads are put on in steps where it is not found at once.
        ends: whether with the columns of the end frames.
        led: see `newton`.
        work: written.

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
