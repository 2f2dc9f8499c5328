"""Machines with legs that are rigid against some wrench: the stiffness is infinite there, the compliance is not.

A leg whose joints and springs together do not move its end in all six directions transmits a wrench without
deflecting. Its own ``K_i^F`` (18) does not exist, nor does the sum over the legs. The unloaded compliance of the
platform does: it follows from the motions that close all legs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import null_space

from vjm.model.load_case import COMPONENTS
from vjm.model.lumped import LumpedModel
from vjm.platform.closure import RigidPose
from vjm.platform.leg_topology import carried
from vjm.platform.manipulator import BASE
from vjm.platform.rigid import SINGULAR
from vjm.rotations import Array

LOOSE = 1e-13
"""Energy of a motion of unit size, over the largest, that is rounding: no spring is strained."""


NO_COMPLIANCE = 1e-12
"""Over the largest, all lengths over the characteristic one: compliance that is none. Between that of a soft drive
and of a stiff bearing lie seven decades, and rounding is four below these."""


class RigidLegError(ValueError):
    """A leg is rigid against some wrench, so that the platform's stiffness is infinite there."""


def refuse_rigid_legs(pose: RigidPose, models: Sequence[LumpedModel]) -> None:
    """For whatever sums up the legs' stiffnesses.

    Args:
        pose: rigid, closed.
        models: of its legs.

    Raises:
        RigidLegError: a leg's end does not deflect in all directions, by the rank of its Jacobian.
    """
    robot = pose.manipulator
    for leg, model, q, drive in zip(robot.legs, models, pose.q, pose.drives, strict=True):
        k = model.kinematics(model.configuration(q))
        unit = np.repeat([robot.characteristic_length, 1.0], 3)
        U, sizes, _ = np.linalg.svd(k.jacobian * model.coordinate_scale / unit[:, None])
        rank = int(np.count_nonzero(sizes > SINGULAR * sizes.max(initial=0.0)))
        if rank < 6:
            world = pose.frame(leg.start) @ leg.driven_root(float(drive))
            wrench = np.kron(np.eye(2), world[:3, :3]) @ U[:, rank]
            names = [f"{c} {v:.2g}" for c, v in zip(COMPONENTS, wrench, strict=True) if abs(v) > 0.05]
            raise RigidLegError(
                f"{robot.name}: leg '{leg.name}' is rigid in {6 - rank} direction{'s' * (rank < 5)}, such as "
                f"({', '.join(names)}; turns in rad, shifts over {robot.characteristic_length:g} mm): the "
                f"platform's stiffness is infinite there; give the leg's parts compliance, or ask for the unloaded "
                f"stiffness"
            )


def platform_compliance(pose: RigidPose, models: Sequence[LumpedModel]) -> Array:
    """Unloaded compliance ``(6, 6)`` of the platform in a pose, mm/N, 1/N, rad/(N mm), world axes.

    With ``Z`` a basis of the motions of legs and bodies that keep all legs closed and couplings at rest, and ``K``
    the springs' stiffness, it is ``Z_p (Zᵀ K Z)⁻¹ Z_pᵀ``: the energy's minimum on these motions. It is singular
    where the platform is rigid.

    Args:
        pose: rigid, closed.
        models: of its legs.

    Raises:
        ValueError: in this pose the platform moves without straining a spring.
    """
    robot, length = pose.manipulator, pose.manipulator.characteristic_length
    ends = np.cumsum([0, *(model.size for model in models)])
    first, count = int(ends[-1]), int(ends[-1]) + 6 * len(robot.bodies)
    A = np.zeros((6 * len(models) + len(robot.couplings), count))
    K = np.zeros((first, first))
    unit = np.repeat([length, 1.0], 3)
    for i, (leg, model, q, drive) in enumerate(zip(robot.legs, models, pose.q, pose.drives, strict=True)):
        own, row = slice(int(ends[i]), int(ends[i + 1])), slice(6 * i, 6 * i + 6)
        world = pose.frame(leg.start) @ leg.driven_root(float(drive))
        k = model.kinematics(model.configuration(q))
        J = np.kron(np.eye(2), world[:3, :3]) @ k.jacobian
        A[row, own] = J * model.coordinate_scale / unit[:, None]
        K[own, own] = model.stiffness * model.coordinate_scale[:, None] * model.coordinate_scale
        end = (world @ k.end)[:3, 3]
        for body, sign in ((leg.start, 1.0), (leg.end, -1.0)):
            if body != BASE:
                at = first + 6 * robot.bodies.index(body)
                moved = carried(end - pose.frame(body)[:3, 3])
                A[row, at : at + 6] = sign * moved * unit / unit[:, None]
    for k_, coupling in enumerate(robot.couplings):
        for name, joint, weight in coupling.terms:
            i = [leg.name for leg in robot.legs].index(name)
            j = [part.name for part in robot.legs[i].chain.joints].index(joint)
            at = int(models[i].passive[j])
            A[6 * len(models) + k_, int(ends[i]) + at] = weight * models[i].coordinate_scale[at]
    Z = null_space(A, rcond=SINGULAR)
    energy = float(np.abs(np.diag(K)).max(initial=0.0)) or 1.0
    values, V = np.linalg.eigh(Z[:first].T @ (K / energy) @ Z[:first])
    platform = Z[first : first + 6] @ V
    soft = values < LOOSE * values.max(initial=0.0)
    if np.any(np.abs(platform[:, soft]) > SINGULAR):
        raise ValueError(f"{robot.name}: in this pose the platform moves without straining a spring")
    C = (platform[:, ~soft] / values[~soft]) @ platform[:, ~soft].T / energy
    # a rigid direction keeps what rounding leaves of the motions' basis, and its square on the diagonal
    C[np.abs(C) < NO_COMPLIANCE * np.abs(C).max()] = 0.0
    result: Array = C * unit[:, None] * unit
    return result
