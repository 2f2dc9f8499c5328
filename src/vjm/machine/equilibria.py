"""Equilibria of a machine in many postures at once, and their loaded stiffness K^F.

    model = Mechanism(chain.split())
    found = equilibria(model, q, gravity=(0.0, 0.0, -9.81))

`q` has a row for each posture and a column for each of ``model.joints``. The end frames are free, under the weight
of all parts, wrenches on the end frames, and loads on any part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from vjm.kernels.arrays import MachineArrays, Work, machine_object, work_object, workspace
from vjm.kernels.derivatives import refuse_moments
from vjm.kernels.newton import (
    LOST,
    SMALLEST_SHARE,
    STABLE,
    UNDETERMINED,
    equilibria_of,
    frames_at,
    residuals_of,
)
from vjm.model.load_case import Load
from vjm.model.mechanism import Gravity, Mechanism
from vjm.rotations import Array


@dataclass(frozen=True)
class Equilibria:
    """Equilibria of g postures of a machine with e end frames.

    Attributes:
        model: the machine.
        q: ``(g, n_joints)`` coordinates of its joints as commanded, mm and rad.
        x: ``(g, n)`` what the springs add, and what passive joints have turned by.
        closures: ``(g, f)`` wrenches of the machine's closures on their second frames, one closure behind the
            other, N and N mm, world axes.
        converged: ``(g,)`` whether an equilibrium was found; rows of what was not are nan.
        undetermined: ``(g,)`` whether none was found as nothing holds the machine: laws of springs have no slope
            there. Rows of `x` have one of the states that the loads allow.
        stable: ``(g,)`` whether it is stable with the end frames free.
        torques: ``(g, n_joints)`` what holds each joint, N mm or N; for an actuated joint the drive's torque.
        rotation: ``(g, e, 3, 3)`` and
        position: ``(g, e, 3)`` of the end frames in the world, mm.
        deflection: ``(g, e, 6)`` from the unloaded posture: shift and rotation vector, mm and rad, world axes.
        compliance: ``(g, e, 6, 6)`` of the end frames by (18), mm/N, 1/N, rad/(N mm); None where not asked for.
        stiffness: ``K^F`` ``(g, e, 6, 6)`` of (18), N/mm, N, N mm; nan where fewer than six springs move the end,
            so that it is infinite in some direction.
    """

    model: Mechanism
    q: Array
    x: Array
    closures: Array
    converged: np.ndarray
    undetermined: np.ndarray
    stable: np.ndarray
    torques: Array
    rotation: Array
    position: Array
    deflection: Array
    compliance: Array | None
    stiffness: Array | None


def equilibria(
    model: Mechanism,
    q: Array | Mapping[str, float],
    *,
    gravity: Gravity | None = None,
    wrench: Array | None = None,
    loads: Sequence[Load] = (),
    compliance: bool = True,
    start: Array | None = None,
    start_closures: Array | None = None,
    gradual: bool = True,
    share: float = 1.0,
) -> Equilibria:
    """Equilibria of a machine in many postures under the same loads, or each under its own wrench.

    Args:
        model: the machine.
        q: coordinates of ``model.joints``: rows ``(g, n_joints)``, one row, or values by name; mm and rad.
        gravity: ``(3,)`` m/s², world axes.
        wrench: on the end frames, N and N mm, fixed in the world: ``(6,)`` on the only one, ``(e, 6)``, or
            ``(g, e, 6)`` for each posture.
        loads: on any parts; they act in full.
        compliance: whether it and the stiffness are wanted.
        start: coordinates ``(g, n)`` from which Newton's method begins, such as those of a neighbour.
        start_closures: the closures' wrenches ``(g, f)``, likewise.
        gradual: whether the loads are put on in steps where an equilibrium is not found at once.
        share: of all that strains the machine: weight, wrenches, loads, and the stress in which sprung joints and
            springs between points are in the unloaded posture.

    Raises:
        ValueError: an array of another shape, or a load on no point of the machine.
    """
    q = model.command_rows(q)
    g, n, e = len(q), model.coordinates, len(model.ends)
    F = share * _wrenches(wrench, g, e)
    arrays = _arrays(model, gravity, loads, F)
    arrays = arrays._replace(load=share * arrays.load)
    commands, naturals = model.values(q), share * model.naturals(q)
    x = np.zeros((g, n)) if start is None else np.array(start, dtype=float).reshape(g, n)
    closures = np.zeros((g, int(arrays.size[2])))
    if start_closures is not None:
        closures[:] = start_closures
    verdict, forces = np.zeros(g, dtype=np.int64), np.zeros((g, len(arrays.parent)))
    R, p, moved = np.zeros((g, e, 3, 3)), np.zeros((g, e, 3)), np.zeros((g, e, 6))
    C, K = (np.zeros((g if compliance else 0, e, 6, 6)) for _ in range(2))
    # under a share of their stress the springs' forces differ from posture to posture
    springs = (
        arrays.spring[None]
        if share == 1.0 or not len(arrays.spring)
        else _partially_unloaded_springs(model, q, share)
    )
    equilibria_of(
        *objects(arrays), commands, naturals, F, springs, gradual, x, closures, verdict, forces,
        R, p, moved, C, K,
    )  # fmt: skip
    lost, undetermined = verdict == LOST, verdict == UNDETERMINED
    x[lost] = np.nan
    for each in (closures, forces, R, p, moved, C, K):
        if len(each):
            each[lost | undetermined] = np.nan
    states = Equilibria(
        model, q, x, closures, ~(lost | undetermined), undetermined, verdict == STABLE, model.torques(forces), R, p,
        moved, C if compliance else None, K if compliance else None,
    )  # fmt: skip
    if gradual and share == 1.0 and lost.any() and (len(arrays.spring) or naturals.any()):
        for row in np.flatnonzero(lost):
            acting = wrench if wrench is None or len(F) == 1 else F[row]
            _put_on(states, int(row), gravity, acting, loads, compliance=compliance)
    return states


def _put_on(
    states: Equilibria, row: int, gravity: Gravity | None, wrench: Array | None, loads: Sequence[Load], *,
    compliance: bool,
) -> None:  # fmt: skip
    """Find a row that was not found by growing shares of all that strains it, the stress of its springs too.

    The kernels put on the loads alone step by step: a machine that the springs alone move far is not found by them.
    """
    done, step, state = 0.0, 0.5, None
    while done < 1.0:
        share = min(done + step, 1.0)
        trial = equilibria(
            states.model, states.q[row], gravity=gravity, wrench=wrench, loads=loads,
            compliance=compliance and share == 1.0, start=None if state is None else state.x,
            start_closures=None if state is None else state.closures, gradual=False, share=share,
        )  # fmt: skip
        if trial.converged[0]:
            done, state = share, trial
        else:
            step *= 0.5
            if step < SMALLEST_SHARE:
                return
    for name in (each.name for each in fields(Equilibria)):
        rows = getattr(states, name)
        if isinstance(rows, np.ndarray) and name != "q":
            rows[row] = getattr(state, name)[0]


def _partially_unloaded_springs(model: Mechanism, q: Array, share: float) -> Array:
    """Laws ``(g, s, 3)`` of the springs between points under a share of their forces at rows of coordinates.

    Stiffness and free length stay; the preload is such that the unloaded posture is under that share.
    """
    joints, points, laws = model.point_springs
    g, s = len(q), len(laws)
    sites = joints.reshape(2 * s), np.tile(np.eye(3), (2 * s, 1, 1)), points.reshape(2 * s, 3)
    places = frames_of(model, q, *sites)[1].reshape(g, s, 2, 3)
    lengths = np.linalg.norm(places[:, :, 1] - places[:, :, 0], axis=2)
    result = np.tile(laws, (g, 1, 1))
    for spring, own, length in zip(model.chain.point_springs, result.transpose(1, 0, 2), lengths.T, strict=True):
        own[:, 2] -= (1.0 - share) * spring.pull(length)
    return result


def free_equilibria(
    arrays: MachineArrays, commands: Array, naturals: Array, wrench: Array, x: Array, closures: Array,
    verdict: np.ndarray, forces: Array, R: Array, p: Array,
) -> None:  # fmt: skip
    """Equilibria of arrays that are changed from call to call, without compliance.

    See `vjm.kernels.newton.equilibria_of` for the arguments.
    """
    refuse_moments(arrays, wrench)
    g, e = p.shape[:2]
    none = np.zeros((0, e, 6, 6))
    equilibria_of(
        *objects(arrays), commands, naturals, wrench, arrays.spring[None], True, x,
        closures, verdict, forces, R, p, np.zeros((g, e, 6)), none, none,
    )  # fmt: skip


def _arrays(model: Mechanism, gravity: Gravity | None, loads: Sequence[Load], wrench: Array) -> MachineArrays:
    return model.arrays(gravity, loads, moments=bool(np.any(wrench[..., 3:])))


def objects(arrays: MachineArrays) -> tuple[MachineArrays, Work]:
    """A machine and a workspace as the kernels take them; what they overwrite of the machine is a copy."""
    return machine_object(arrays._replace(spring=arrays.spring.copy())), work_object(workspace(arrays))


def largest_residual(
    states: Equilibria,
    *,
    gravity: Gravity | None = None,
    wrench: Array | None = None,
    loads: Sequence[Load] = (),
) -> float:
    """Largest force that an equilibrium lacks, over the largest that the loads put on a joint or a closure.

    Forces along joints that slide, and those of closures, count times the machine's reach. At the same loads as the
    equilibria.
    """
    model = states.model
    F = _wrenches(wrench, len(states.q), len(model.ends))
    arrays, q, x = _arrays(model, gravity, loads, F), states.q, states.x
    r, gap = np.zeros_like(x), np.zeros_like(states.closures)
    residuals_of(
        *objects(arrays), model.values(q), model.naturals(q), F, x,
        states.closures, r, gap,
    )  # fmt: skip
    unit, wrench_unit = arrays.unit, np.ones(states.closures.shape[1])
    for first in arrays.closure_first[:-1]:
        wrench_unit[first : first + 3] = model.reach
    acting = max(np.abs(states.torques).max(initial=0.0), np.abs(states.closures * wrench_unit).max(initial=0.0))
    lacking = float(np.nanmax(np.abs(r) * unit, initial=0.0)) / max(float(acting), 1.0)
    return max(lacking, float(np.nanmax(np.abs(gap), initial=0.0)) / model.reach)


def unloaded_frames(model: Mechanism, q: Array | Mapping[str, float]) -> tuple[Array, Array]:
    """End frames without load and without deflection: rotations ``(g, e, 3, 3)``, positions ``(g, e, 3)`` mm."""
    arrays = model.arrays()
    return frames_of(model, model.command_rows(q), arrays.end_joint, arrays.end_R, arrays.end_p)


def frames_of(model: Mechanism, q: Array, joint: np.ndarray, R_own: Array, p_own: Array) -> tuple[Array, Array]:
    """Frames fixed behind joints in the unloaded posture: rotations ``(g, k, 3, 3)``, positions ``(g, k, 3)`` mm.

    Args:
        model: the machine.
        q: ``(g, n_joints)``.
        joint: ``(k,)`` last joint before each, −1 for the ground.
        R_own: ``(k, 3, 3)`` and
        p_own: ``(k, 3)`` behind that joint.
    """
    commands = model.values(q)
    R, p = np.zeros((len(q), len(joint), 3, 3)), np.zeros((len(q), len(joint), 3))
    frames_at(*objects(model.arrays()), commands, joint, R_own, p_own, R, p)
    return R, p


def _wrenches(wrench: Array | None, g: int, e: int) -> Array:
    """Rows ``(g or 1, e, 6)``."""
    if wrench is None:
        return np.zeros((1, e, 6))
    given = np.asarray(wrench, dtype=float)
    if given.shape == (6,) and e == 1:
        given = given[None]
    if given.shape == (e, 6):
        given = given[None]
    if given.shape not in ((1, e, 6), (g, e, 6)) or not np.all(np.isfinite(given)):
        raise ValueError(f"wrench has the shape {given.shape}; give finite numbers as ({e}, 6) or ({g}, {e}, 6)")
    return np.ascontiguousarray(given)
