"""Compensation of platforms: the drives' coordinates that put the loaded platform where it should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.machine.closing import PoseError
from vjm.machine.platforms import PlatformBatch
from vjm.machine.rigid_motions import moved_by_drives
from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array
from vjm.tree.compensation import Compensation
from vjm.tree.damped_search import damped_search
from vjm.vjm_engine import VjmEngine

EXACT = 1e-8
"""mm, or rad times the machine's length, that may be left of what the drives can put right."""


def compensated_platform(
    manipulator: Manipulator, poses: Array, wrenches: Array, engine: VjmEngine
) -> Compensation:
    """The drives' coordinates that bring the loaded platform to poses, by damped least squares within their limits.

    Only what the rigid platform can do counts: a machine that shifts its platform cannot turn it back.

    Args:
        manipulator: the machine, with its errors of assembly if it has any. What its drives are off is among the
            coordinates.
        poses: ``(g, 6)`` wanted, from home, mm, rad.
        wrenches: ``(g, 6)`` dead on the platform, N, N mm.
        engine: how beams become springs.

    Raises:
        PoseError: the rigid machine cannot take a pose, or the loaded one not within its drives' limits.
        ValueError: its drives are not as many as its platform's freedoms.
        NoConvergenceError: an equilibrium was not found, or is unstable.
    """
    batch = PlatformBatch(manipulator, engine)
    closing, tree = batch.closing, batch.closing.tree
    held = np.flatnonzero(~tree.passive)
    if not 0 < len(held) == closing.mobility(closing.home).freedom:
        raise ValueError(
            f"{manipulator.name}: its drives do not match its platform's "
            f"{closing.mobility(closing.home).freedom} freedoms"
        )
    q, reached = batch.closed(poses)
    for row, pose, good in zip(q, poses, reached, strict=True):
        closing.refuse_unfit(row if good else closing.displaced(pose))
    unit, drive_unit = np.repeat([tree.length, 1.0], 3), tree.unit[held]
    # the platform's freedoms, and how the drives move it along them
    basis, sizes, turned = np.linalg.svd(moved_by_drives(tree, q), full_matrices=False)
    J = sizes[:, :, None] * turned
    off = np.array([manipulator.offsets.get(tree.names[j], 0.0) for j in held])

    def felt(errors: Array, at: np.ndarray) -> Array:
        return np.asarray(np.einsum("gar,ga->gr", basis[at], errors / unit))

    def error(drives: Array, at: np.ndarray) -> Array:
        rows = q[at].copy()
        rows[:, held] = drives - off
        return batch.displacements(rows, poses[at], wrenches[at])

    everyone = np.arange(len(q))
    stands = q[:, held] + off
    rigid = error(stands, everyone)
    if not np.all(np.isfinite(rigid)):
        lost = int(np.argmin(np.isfinite(rigid).all(axis=1)))
        raise NoConvergenceError(
            f"{manipulator.name}: under its wrench the platform has no stable equilibrium at pose {lost + 1}"
        )
    designed = PlatformBatch(replace(manipulator, errors={}, offsets={}), engine)
    soft = np.einsum("gab,gb->ga", designed.equilibria(poses, np.zeros(6)).compliance, wrenches)
    limits = np.array([leg.drive.limits for leg in manipulator.legs if leg.drive is not None])
    step = -np.linalg.solve(J, felt(soft, everyone)[:, :, None])[:, :, 0] * drive_unit
    linear = np.clip(stands + step, limits[:, 0], limits[:, 1])

    def left(drives: Array, at: np.ndarray) -> Array:
        return felt(error(drives, at), at)

    loaded, size = damped_search(left, linear, limits[:, 0], limits[:, 1], drive_unit)
    failed = np.flatnonzero(~(size * tree.length < EXACT))
    if len(failed):
        k = int(failed[0])

        def of_this(drives: Array, at: np.ndarray) -> Array:
            return left(drives, np.full(len(at), k))

        anywhere = np.full(len(held), np.inf)
        free, free_size = damped_search(of_this, linear[k : k + 1], -anywhere, anywhere, drive_unit)
        named = dict(zip((tree.names[j] for j in held), free[0].tolist(), strict=True))
        said = manipulator.beyond_limits(np.array([named.get(leg.name, 0.0) for leg in manipulator.legs]))
        said = f"{said}; " if free_size[0] * tree.length < EXACT and said else ""
        raise PoseError(
            f"{manipulator.name}: out of reach of the loaded machine: {said}the platform stays "
            f"{size[k] * tree.length:.2g} mm off"
        )
    return Compensation(
        tuple(tree.names[j] for j in held), q[:, held], linear, loaded, rigid, error(linear, everyone),
        error(loaded, everyone),
    )  # fmt: skip
