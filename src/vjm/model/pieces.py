"""A machine's joints, springs and closures as the arrays that are packed for the kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.kernels.arrays import BEAM_COLUMN, LAW, LINEAR, PASSIVE
from vjm.model.assembly import Assembly, Site
from vjm.model.packing import Pieces
from vjm.model.springs import BeamColumnSpring, LawSpring, LinearSpring, Spring
from vjm.rotations import Array


def machine_pieces(
    built: Assembly,
    unit: Array,
    energy: float | None,
    length: float,
    *,
    springs: tuple[np.ndarray, Array, Array],
    closures: tuple[np.ndarray, Array, Sequence[int]],
    ends: Sequence[Site] = (),
    spare: tuple[int, int] = (0, 0),
) -> Pieces:
    """What a machine consists of, for `vjm.model.packing.packed`.

    Args:
        built: its joints and springs.
        unit: of each coordinate ``(n,)``, mm or 1.
        energy: unit of energy, N mm; None for the geometric mean of the springs' rotational stiffnesses.
        length: unit of length, mm.
        springs: between points, see `point_springs`.
        closures: joints ``(c, 2)`` and frames ``(c, 2, 4, 4)``, see `closure_sites`, and how many rows each holds.
        ends: its end frames.
        spare: see `vjm.kernels.arrays.MachineArrays`.
    """
    before = np.array(built.before).reshape(-1, 4, 4)
    kind, first, K, beam = spring_blocks(built)
    if energy is None:
        own = np.array([block[i, i] for block, k in zip(K, np.diff(first), strict=True) for i in range(k)])
        turning = own[(unit == 1.0) & (own > 0.0)]
        energy = float(np.exp(np.mean(np.log(turning)))) if len(turning) else 1.0
    return Pieces(
        parent=np.array(built.parent, dtype=np.int64),
        rotary=np.array(built.rotary, dtype=np.int64),
        axis=np.array(built.axis, dtype=float).reshape(-1, 3),
        R0=np.ascontiguousarray(before[:, :3, :3]),
        p0=np.ascontiguousarray(before[:, :3, 3]),
        coordinate=np.array(built.coordinate, dtype=np.int64),
        factor=np.array(built.factor, dtype=float),
        kind=kind, first=first, K=K, beam=beam,
        grows=np.array([built.grows.get(int(c), -1) for c in first[:-1]], dtype=np.int64),
        unit=np.ascontiguousarray(unit), energy=energy, length=length,
        end_joint=np.array([site.joint for site in ends], dtype=np.int64),
        end_R=np.array([site.frame[:3, :3] for site in ends]).reshape(-1, 3, 3),
        end_p=np.array([site.frame[:3, 3] for site in ends]).reshape(-1, 3),
        spring_joint=springs[0], spring_point=springs[1], spring=springs[2],
        spring_law=[spring.law for spring in built.chain.point_springs],
        laws={
            int(c): spring.law for c, spring in zip(first[:-1][kind != PASSIVE], built.springs, strict=True)
            if isinstance(spring, LawSpring)
        },
        closure_joint=closures[0].astype(np.int64),
        closure_R=np.ascontiguousarray(closures[1][:, :, :3, :3]),
        closure_p=np.ascontiguousarray(closures[1][:, :, :3, 3]),
        closure_rows=np.array(closures[2], dtype=np.int64),
        coupling=coupling_rows(built),
        total=np.array([coupling.total for coupling in built.chain.couplings], dtype=float),
        spare=spare,
    )  # fmt: skip


def closure_sites(built: Assembly) -> tuple[np.ndarray, Array]:
    """Last joints ``(c, 2)`` before the two frames of each closure, −1 for the ground; the frames behind them."""
    joints, frames = [], []
    for closure in built.chain.closures:
        sites = [built.ends[part] if part else Site(-1, np.eye(4)) for part in closure.parts]
        joints.append([site.joint for site in sites])
        frames.append([site.frame @ own for site, own in zip(sites, closure.frames, strict=True)])
    return np.array(joints, dtype=np.int64).reshape(-1, 2), np.array(frames).reshape(-1, 2, 4, 4)


def coupling_rows(built: Assembly) -> Array:
    """Weights ``(k, n)`` of the coordinates that rigid transmissions couple."""
    rows = np.zeros((len(built.chain.couplings), built.size))
    for row, coupling in zip(rows, built.chain.couplings, strict=True):
        for joint, weight in coupling.terms:
            row[built.spans[joint].start] += weight
    return rows


def point_springs(built: Assembly) -> tuple[np.ndarray, Array, Array]:
    """Joints ``(s, 2)``, points ``(s, 2, 3)`` and laws ``(s, 3)`` of a machine's springs between points.

    Raises:
        ValueError: one is fixed to a beam where that has no shape.
    """
    joints, points, laws = [], [], []
    for spring in built.chain.point_springs:
        for part, point in zip(spring.parts, np.asarray(spring.points, dtype=float), strict=True):
            try:
                site = built.carrying(part, point)
            except ValueError as error:
                raise ValueError(f"{built.chain.name}: spring '{spring.name}': {error}") from None
            joints.append(site.joint)
            points.append(site.frame[:3, :3] @ point + site.frame[:3, 3])
        stiffness = spring.stiffness if spring.law is None else spring.law.largest_stiffness
        laws.append((stiffness, spring.free_length, spring.preload))
    count = len(laws)
    return (
        np.array(joints, dtype=np.int64).reshape(count, 2),
        np.array(points).reshape(count, 2, 3),
        np.array(laws, dtype=float).reshape(count, 3),
    )


def spring_blocks(built: Assembly) -> tuple[np.ndarray, np.ndarray, Array, Array]:
    """Kinds, first coordinates, stiffnesses and beam data of the blocks of springs, passive joints among them."""
    kind: list[int] = []
    first = [0]
    K: list[Array] = []
    beam: list[Array] = []
    springs = iter(built.springs)
    passive = set(built.passive)
    while first[-1] < built.size:
        k6, b7, width, this = np.zeros((6, 6)), np.zeros(7), 1, PASSIVE
        if first[-1] not in passive:
            spring: Spring = next(springs)
            width = len(spring.unloaded)
            k6[:width, :width] = spring.stiffness
            this = LINEAR
            if isinstance(spring, BeamColumnSpring):
                s, h, this = spring.section, spring.length, BEAM_COLUMN
                b7[:] = s.EA, s.GJ, s.EIy, s.EIz, h, h / s.GAy, h / s.GAz
            elif isinstance(spring, LawSpring):
                # for units alone: it may have none at rest
                this, k6[0, 0] = LAW, spring.law.largest_stiffness
            elif not isinstance(spring, LinearSpring):
                raise TypeError(f"{type(spring).__name__} has no kernel")
        kind.append(this)
        first.append(first[-1] + width)
        K.append(k6)
        beam.append(b7)
    return (
        np.array(kind, dtype=np.int64),
        np.array(first, dtype=np.int64),
        np.array(K).reshape(-1, 6, 6),
        np.array(beam).reshape(-1, 7),
    )
