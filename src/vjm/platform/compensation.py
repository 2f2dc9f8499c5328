"""Compensation: the drives' coordinates that put the loaded platform where it should be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.platform.closure import RigidPose
from vjm.platform.manipulator import Manipulator
from vjm.platform.problem import ManipulatorProblem
from vjm.platform.rigid import PoseError, freedom, inverse_kinematics, rates
from vjm.rotations import Array
from vjm.tree.damped_search import damped_search
from vjm.vjm_engine import VjmEngine

EXACT = 1e-8
"""mm, or rad times the characteristic length, that may be left of what the drives can put right."""


@dataclass(frozen=True)
class Compensation:
    """What compensation does at one pose under one wrench.

    Attributes:
        drives: coordinates ``(l,)`` of the rigid machine, mm or rad.
        offsets: by leg, what is added to them.
        offsets_linear: the same by the linear model, ``K`` of the unloaded machine, cut at the drives' limits.
        rigid: error ``(6,)`` of the platform where nothing is compensated, mm, rad.
        linear: where the linear model's offsets are.
        loaded: where the loaded model's are: what no drive can put right, such as turns of a platform that only
            shifts.
    """

    drives: Array
    offsets: dict[str, float]
    offsets_linear: dict[str, float]
    rigid: Array
    linear: Array
    loaded: Array


def compensated(manipulator: Manipulator, displacement: Array, wrench: Array, engine: VjmEngine) -> Compensation:
    """The drives' offsets that bring the loaded platform to a pose, by damped least squares within their limits.

    Only what the rigid platform can do counts: a machine that shifts its platform cannot turn it back.

    Args:
        manipulator: the machine, with its errors of assembly if it has any.
        displacement: ``(6,)`` the pose wanted, from home, mm, rad.
        wrench: ``(6,)`` dead on the platform, N, N mm.
        engine: how beams become springs.

    Raises:
        PoseError: the rigid machine cannot take the pose, or the loaded one not within its drives' limits.
        ValueError: its drives are not as many as its platform's freedoms.
        NoConvergenceError: an equilibrium or the offsets were not found.
    """
    pose = inverse_kinematics(manipulator, displacement)
    basis = freedom(pose)
    answers = rates(pose, basis)
    if answers is None:
        raise ValueError(f"{manipulator.name}: its drives do not match its platform's {basis.shape[1]} freedoms")
    length = manipulator.characteristic_length
    unit = np.repeat([1.0, length], 3)
    driven = [leg for leg in manipulator.legs if leg.drive is not None]
    drive_unit = np.array([length if leg.drive and leg.drive.slides else 1.0 for leg in driven])
    names = [leg.name for leg in driven]

    def named(u: Array) -> dict[str, float]:
        return {name: manipulator.offsets.get(name, 0.0) + float(v) for name, v in zip(names, u, strict=True)}

    error = _error_of(manipulator, pose, np.asarray(wrench, dtype=float), engine, named)
    # platform's freedoms, in mm, by the drives
    J = np.linalg.inv(answers) * length / drive_unit

    def felt(e: Array) -> Array:
        return basis.T @ (unit * e)

    stands = np.array([d for d, leg in zip(pose.drives, manipulator.legs, strict=True) if leg.drive is not None])
    stands = stands + np.array([manipulator.offsets.get(name, 0.0) for name in names])
    limits = np.array([leg.drive.limits for leg in driven if leg.drive is not None]) - stands[:, None]
    rigid = error(np.zeros(len(driven)))
    K = ManipulatorProblem(manipulator.with_offsets({}).with_errors({}), LoadCase("", 1.0), engine, pose)
    soft = np.linalg.solve(np.asarray(K.unloaded().stiffness), np.asarray(wrench, dtype=float))
    u_linear = np.clip(-np.linalg.solve(J, felt(soft)), limits[:, 0], limits[:, 1])
    linear = error(u_linear)

    def left(u: Array, _: np.ndarray) -> Array:
        rows = np.full((len(u), basis.shape[1]), np.nan)
        for row, each in zip(rows, u, strict=True):
            try:
                row[:] = felt(error(each)) / length
            except NoConvergenceError:
                continue
        return rows

    u, size = damped_search(left, u_linear[None], limits[:, 0], limits[:, 1], drive_unit)
    if not size[0] * length < EXACT:
        anywhere = np.full(len(driven), np.inf)
        free, free_size = damped_search(left, u_linear[None], -anywhere, anywhere, drive_unit)
        reached = pose.drives.copy()
        reached[[leg.drive is not None for leg in manipulator.legs]] = stands + free[0]
        said = f"{manipulator.beyond_limits(reached)}; " if free_size[0] * length < EXACT else ""
        raise PoseError(
            f"{manipulator.name}: out of reach of the loaded machine: {said}the platform stays "
            f"{size[0] * length:.2g} mm off"
        )
    return Compensation(pose.drives, named(u[0]), named(u_linear), rigid, linear, error(u[0]))


def _error_of(
    manipulator: Manipulator,
    pose: RigidPose,
    wrench: Array,
    engine: VjmEngine,
    named: Callable[[Array], dict[str, float]],
) -> Callable[[Array], Array]:
    """The loaded platform's error ``(6,)`` as a function of the drives' offsets."""
    load_case = LoadCase("", 1.0, "load", loads=(Load(tuple(wrench)),), free=COMPONENTS, steps=1)

    def error(u: Array) -> Array:
        problem = ManipulatorProblem(manipulator.with_offsets(named(u)), load_case, engine, pose)
        point = problem.solve(1.0, problem.unloaded())
        if point.unstable > 0:
            raise NoConvergenceError(f"{manipulator.name}: under this wrench the platform is unstable")
        return point.displacement

    return error
