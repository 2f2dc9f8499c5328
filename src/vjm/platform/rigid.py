"""Kinematics of the rigid manipulator: closure, inverse kinematics, mobility.

Every leg's end has to meet its place on the body that it ends on. With the platform's pose given, the passive
coordinates, the drives and the other bodies' poses follow by Newton's method along a straight way from home, on
which the legs keep their branch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.model.load_case import COMPONENTS
from vjm.platform.closure import CLOSED, Closure, RigidPose
from vjm.platform.manipulator import BASE, PLATFORM, Manipulator
from vjm.rotations import Array, displaced, displacement_between, inverse_frame

LARGEST_TURN = 0.3
"""rad by which a passive joint may turn, or characteristic lengths by which it may slide, in one step of the way
from home, so that no leg changes its branch."""
SMALLEST_STEP = 1e-3
"""Share of the way from home below which a pose counts as out of reach."""
SINGULAR = 1e-6
"""Singular value over the largest below which a motion or a constraint is lost."""
HOME_GAP = 0.05
"""Gap over the characteristic length up to which the file's posture at home is taken to be rounded."""


class PoseError(ValueError):
    """A pose that the rigid manipulator cannot take; the message says why."""


@dataclass(frozen=True)
class Mobility:
    """What a manipulator can do in a pose.

    Attributes:
        freedom: independent motions of the platform with the drives free.
        loose: motions ``(6, k)`` of the platform with the drives held, world axes, lengths over the characteristic
            one; none unless the pose is singular.
        idle: independent motions of bodies and passive joints with platform and drives held.
        overconstraint: constraints beyond those that are needed: that many self-stresses are possible.
    """

    freedom: int
    loose: Array
    idle: int
    overconstraint: int


def home_pose(manipulator: Manipulator) -> RigidPose:
    """The manipulator at home, its legs closed.

    Raises:
        PoseError: they do not close, or the pose is singular.
    """
    frames: dict[str, Array] = {PLATFORM: manipulator.home, BASE: np.eye(4)}
    closure = Closure(manipulator)
    for leg, model in zip(manipulator.legs, closure.models, strict=True):
        end = frames[leg.start] @ leg.driven_root(leg.coordinate)
        end = end @ model.kinematics(model.configuration(leg.posture)).end
        frames.setdefault(leg.end, end @ inverse_frame(leg.attachment))
    pose = RigidPose(
        manipulator,
        np.array([frames[body] for body in manipulator.bodies]),
        tuple(leg.posture for leg in manipulator.legs),
        np.array([leg.coordinate for leg in manipulator.legs]),
    )
    gap, _ = closure.linearised(pose)
    _refuse_open(closure, gap, HOME_GAP, "at home")
    pose, left = closure.solve(pose)
    if left > CLOSED:
        _refuse_open(closure, closure.linearised(pose)[0], CLOSED, "at home")
    _refuse_singular(pose)
    return pose


def _refuse_open(closure: Closure, gap: Array, allowed: float, where: str) -> None:
    manipulator = closure.manipulator
    gaps = gap[: 6 * len(manipulator.legs)].reshape(-1, 6)
    worst = int(np.argmax(np.abs(gaps).max(axis=1)))
    if np.abs(gaps[worst]).max() <= allowed:
        return
    shift, turned = np.linalg.norm(gaps[worst, :3]) * closure.length, np.linalg.norm(gaps[worst, 3:])
    raise PoseError(
        f"{manipulator.name}: leg '{manipulator.legs[worst].name}' does not close {where}: its end lies "
        f"{shift:.4g} mm and {turned:.4g} rad from its place on '{manipulator.legs[worst].end}'; check its base, "
        f"attachment, posture and branch"
    )


def inverse_kinematics(manipulator: Manipulator, displacement: Array, start: RigidPose | None = None) -> RigidPose:
    """The rigid manipulator with its platform displaced from home.

    Args:
        manipulator: whose.
        displacement: ``(6,)`` of the platform from home, mm, rad.
        start: a known pose nearby, on the branch wanted; else home.

    Raises:
        PoseError: out of reach, on another branch, singular, or beyond a drive's limits; the message says which.
    """
    pose = home_pose(manipulator) if start is None else start
    closure = Closure(manipulator)
    wanted = displaced(manipulator.home, np.asarray(displacement, dtype=float))
    begin = pose.frames[0]
    way = displacement_between(begin, wanted)
    driven = any(leg.drive for leg in manipulator.legs)
    basis = freedom(pose)
    before = rates(pose, basis)
    done, step = 0.0, 1.0
    while done < 1.0:
        to = min(1.0, done + step)
        frames = pose.frames.copy()
        frames[0] = wanted if to == 1.0 else displaced(begin, to * way)
        # without drives only some poses can be taken at all: the way leads over those that are near
        there, left = closure.solve(replace(pose, frames=frames), drives=driven or to == 1.0)
        if left < CLOSED and closure.largest_move(pose, there) <= LARGEST_TURN:
            answers = rates(there, basis)
            if _turned_back(before, answers):
                raise PoseError(
                    f"{manipulator.name}: the pose {_words(displacement)} lies on another branch: between "
                    f"{done:.0%} and {to:.0%} of the way from home the machine passes a singularity"
                )
            pose, done, step, before = there, to, 2.0 * (to - done), answers
            continue
        step = 0.5 * (to - done)
        if step < SMALLEST_STEP:
            raise PoseError(_out_of_reach(closure, there, displacement, done))
    _refuse_beyond_limits(pose)
    _refuse_singular(pose)
    return pose


def rates(pose: RigidPose, basis: Array) -> Array | None:
    """Drives' motions by the platform's in a ``basis`` (6, f) of these.

    None where they do not match one to one, or where there are neither: a machine without drives.
    """
    closure = Closure(pose.manipulator)
    free = _null(closure.linearised(pose)[1])
    drive = free[closure.drive_at : closure.body_at]
    platform = basis.T @ free[closure.body_at : closure.body_at + 6]
    if not 0 < drive.shape[0] == drive.shape[1] == basis.shape[1]:
        return None
    return np.array(np.linalg.solve(platform.T, drive.T).T, dtype=float)


def freedom(pose: RigidPose) -> Array:
    """Orthonormal motions ``(6, f)`` of the platform with the drives free."""
    closure = Closure(pose.manipulator)
    U, s, _ = np.linalg.svd(_null(closure.linearised(pose)[1])[closure.body_at : closure.body_at + 6])
    return np.array(U[:, : int(np.count_nonzero(s > SINGULAR))], dtype=float)


def _turned_back(before: Array | None, after: Array | None) -> bool:
    """Whether drives answer the platform the other way in some direction: a singularity lies between."""
    if before is None or after is None:
        return False
    values = np.linalg.eigvals(np.linalg.solve(before.T, after.T))
    # what is one value twice comes as a pair that rounding has split
    real = np.abs(values.imag) < SINGULAR * np.abs(values).max()
    return bool(np.any(real & (values.real < 0.0)))


def _words(displacement: Array) -> str:
    return ",".join(f"{v:g}" for v in displacement)


def _out_of_reach(closure: Closure, there: RigidPose, displacement: Array, done: float) -> str:
    manipulator = closure.manipulator
    gap = closure.linearised(there)[0][: 6 * len(manipulator.legs)].reshape(-1, 6)
    worst = int(np.argmax(np.abs(gap).max(axis=1)))
    shift, turned = np.linalg.norm(gap[worst, :3]) * closure.length, np.linalg.norm(gap[worst, 3:])
    where = _words(displacement)
    if not any(leg.drive for leg in manipulator.legs):
        return (
            f"{manipulator.name}: the pose {where} is out of reach: no leg has a drive, and the legs' joints "
            f"do not let the platform come there; give the legs drives, or take the pose at home"
        )
    if np.abs(gap).max() < 1e-6:
        return (
            f"{manipulator.name}: the pose {where} lies on another branch: on the way from home leg "
            f"'{manipulator.legs[worst].name}' passes a dead point at {done:.0%}"
        )
    return (
        f"{manipulator.name}: the pose {where} is out of reach: leg '{manipulator.legs[worst].name}' stays "
        f"{shift:.4g} mm and {turned:.4g} rad short (the way from home ends at {done:.0%})"
    )


def _refuse_beyond_limits(pose: RigidPose) -> None:
    said = pose.manipulator.beyond_limits(pose.drives)
    if said:
        raise PoseError(f"{pose.manipulator.name}: out of reach: {said}")


def _refuse_singular(pose: RigidPose) -> None:
    loose = mobility(pose).loose
    if loose.shape[1] == 0 or not any(leg.drive for leg in pose.manipulator.legs):
        # a mechanism without drives is loose by its nature
        return
    twist = loose[:, 0]
    words = [f"{name} {value:.2g}" for name, value in zip(COMPONENTS, twist, strict=True)
             if abs(value) > 0.05]  # fmt: skip
    raise PoseError(
        f"{pose.manipulator.name}: the pose is singular: with all drives held the platform still moves by "
        f"({', '.join(words)}; turns in rad, shifts over {pose.manipulator.characteristic_length:g} mm)"
    )


def mobility(pose: RigidPose) -> Mobility:
    """Freedom, idle motions and over-constraint of the rigid manipulator in a pose, by rank."""
    closure = Closure(pose.manipulator)
    _, J = closure.linearised(pose)
    columns = np.arange(closure.size)
    drive = (columns >= closure.drive_at) & (columns < closure.body_at)
    platform = (columns >= closure.body_at) & (columns < closure.body_at + 6)
    free = _null(J)
    held = _null(J[:, ~drive])
    idle = _null(J[:, ~drive & ~platform])
    # orthonormal platform motions among those with the drives held
    motions = held[platform[~drive]]
    U, s, _ = np.linalg.svd(motions) if motions.size else (np.zeros((6, 0)), np.zeros(0), None)
    loose = U[:, : int(np.count_nonzero(s > SINGULAR))]
    moving = np.linalg.svd(free[platform], compute_uv=False) if free.size else np.zeros(0)
    return Mobility(
        freedom=int(np.count_nonzero(moving > SINGULAR)),
        loose=loose,
        idle=idle.shape[1],
        overconstraint=int(closure.rows - (closure.size - free.shape[1])),
    )


def _null(A: Array) -> Array:
    """Orthonormal basis ``(n, k)`` of a null space."""
    _, s, Vt = np.linalg.svd(A)
    rank = int(np.count_nonzero(s > SINGULAR * s[0]))
    return np.array(Vt[rank:].T, dtype=float)


def forward_kinematics(start: RigidPose, drives: Array) -> RigidPose:
    """The rigid manipulator with its drives at other coordinates ``(l,)``, near a known pose.

    Raises:
        PoseError: the legs do not close there.
    """
    closure = Closure(start.manipulator)
    pose, left = closure.solve(replace(start, drives=np.asarray(drives, dtype=float)), drives=False)
    if not left < CLOSED:
        raise PoseError(f"{start.manipulator.name}: with these drives the legs do not close near the known pose")
    return pose
