"""A lumped model packed into the arrays that the kernels take, dimensionless."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from vjm.kernels.packed_model import BEAM_COLUMN, LINEAR, PASSIVE, PackedModel
from vjm.model.applied_loads import AppliedLoads
from vjm.model.springs import BeamColumnSpring, LinearSpring, Spring
from vjm.rotations import Array


class SpringChain(Protocol):
    """Joints between rigid links, and the springs' blocks among them; see `vjm.model.lumped.LumpedModel`."""

    size: int
    passive: np.ndarray
    natural: Array
    joint_rotary: np.ndarray
    drive: Array
    axis: Array
    before: Array
    tail: Array
    applied_loads: AppliedLoads

    @property
    def characteristic_length(self) -> float:
        """Unit of translations, mm."""

    @property
    def coordinate_scale(self) -> Array:
        """Units ``(n,)`` of the coordinates."""

    @property
    def wrench_scale(self) -> Array:
        """Units ``(6,)`` of the wrench."""

    @property
    def blocks(self) -> list[tuple[Spring, slice]]:
        """The springs with the range of their coordinates, base to tool."""


def packed(model: SpringChain) -> PackedModel:
    """The model in dimensionless arrays."""
    length = model.characteristic_length
    coordinate, energy = model.coordinate_scale, float(model.wrench_scale[3])
    joint_coordinate = np.argmax(model.drive != 0.0, axis=1) if len(model.drive) else np.zeros(0)
    block_of = np.empty(model.size, dtype=int)
    kind: list[int] = []
    first: list[int] = []
    K: list[Array] = []
    beam: list[Array] = []
    springs = iter(model.blocks)
    c = 0
    passive = set(model.passive.tolist())
    while c < model.size:
        k6, b7, width = np.zeros((6, 6)), np.zeros(7), 1
        if c in passive:
            this = PASSIVE
        else:
            spring, where = next(springs)
            width = where.stop - where.start
            unit = coordinate[where]
            k6[:width, :width] = spring.stiffness * unit[:, None] * unit / energy
            this = BEAM_COLUMN if isinstance(spring, BeamColumnSpring) else LINEAR
            if isinstance(spring, BeamColumnSpring):
                s, h = spring.section, spring.length
                force, moment = energy / length, energy * length
                b7[:] = (
                    s.EA / force, s.GJ / moment, s.EIy / moment, s.EIz / moment, h / length,
                    h / s.GAy * force / length, h / s.GAz * force / length,
                )  # fmt: skip
            elif not isinstance(spring, LinearSpring):
                raise TypeError(f"{type(spring).__name__} has no kernel")
        block_of[c : c + width] = len(kind)
        kind.append(this)
        first.append(c)
        K.append(k6)
        beam.append(b7)
        c += width
    joint_block = block_of[joint_coordinate.astype(int)] if model.size else np.zeros(0, dtype=int)
    # a joint that slides and follows one that turns, or the other way, has other units than its coordinate
    joint_unit = np.where(model.joint_rotary, 1.0, length)
    factor = model.drive[np.arange(len(model.drive)), joint_coordinate.astype(int)]
    # 0, 1, 2 for the unit vectors x, y, z, else −1
    unit_vector = (model.axis[:, None, :] == np.eye(3)).all(axis=2)
    along = np.where(unit_vector.any(axis=1), unit_vector.argmax(axis=1), -1).astype(np.int64)
    R0 = np.ascontiguousarray(model.before[:, :3, :3])
    p0 = model.before[:, :3, 3] / length
    return PackedModel(
        rotary=model.joint_rotary.astype(np.int64),
        axis=np.ascontiguousarray(model.axis),
        along=along,
        moved=np.any(model.before != np.eye(4), axis=(1, 2)).astype(np.int64),
        R0=R0,
        p0=np.ascontiguousarray(p0),
        coordinate=joint_coordinate.astype(np.int64),
        factor=factor * coordinate[joint_coordinate.astype(int)] / joint_unit,
        kind=np.array(kind, dtype=np.int64),
        first=np.array([*first, model.size], dtype=np.int64),
        joints=np.searchsorted(joint_block, np.arange(len(kind) + 1)).astype(np.int64),
        K=np.array(K).reshape(-1, 6, 6),
        beam=np.array(beam).reshape(-1, 7),
        R_tail=np.ascontiguousarray(model.tail[:3, :3]),
        p_tail=model.tail[:3, 3] / length,
        natural=model.natural / coordinate,
        **loaded_points(model.applied_loads, length),
    )


def loaded_points(applied_loads: AppliedLoads, length: float) -> dict[str, Any]:
    """What a model's arrays have of the loads on its bodies, over its characteristic length."""
    return {
        "point_joint": applied_loads.joint.astype(np.int64),
        "point_offset": applied_loads.offset / length,
        "follows": applied_loads.follows.astype(np.int64),
        "turning": applied_loads.turning.astype(np.int64),
    }
