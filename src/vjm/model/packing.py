"""Joints, blocks of springs, closures and loads of a machine as arrays, in the order of their elimination."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vjm.kernels.arrays import BEAM_COLUMN, LAW, LINEAR, OWN, PASSIVE, MachineArrays
from vjm.kernels.elimination import BALL, END, SPRING, TURNING, WELD
from vjm.kernels.statics import ORDER
from vjm.model.assembly import Assembly, BodyFrame
from vjm.model.springs import BeamColumnSpring, LawSpring, LinearSpring, Spring
from vjm.rotations import Array

DELAYED = 4
"""Places in the border for coordinates whose pivots cancel, where loops close or an end is held: two modes in both
planes. Free ends need none: there a pivot vanishes where the machine loses its stability."""

KEPT = 64
"""Structures of machines whose order is kept."""


ORDERED = (
    "unit_joint", "unit_block", "unit_column", "unit_row", "unit_above", "unit_subtree", "carrier", "subtree_width",
    "subtree_column", "local", "size", "source_first", "source", "closure_first", "border", "border_joint",
)  # fmt: skip
"""Fields of `vjm.kernels.arrays.MachineArrays` that `order_of` gives."""


class Loads(NamedTuple):
    """What acts on a machine: fields of `vjm.kernels.arrays.MachineArrays`."""

    load_joint: np.ndarray
    load_offset: Array
    load: Array
    follows: np.ndarray
    load_grows: np.ndarray
    turning: np.ndarray
    load_end: np.ndarray

    @classmethod
    def of(
        cls, rows: Sequence[tuple[int, Array, Array, bool]], turning: Sequence[int], grows: Sequence[int] = (),
        ends: Sequence[int] = (),
    ) -> Loads:  # fmt: skip
        """Loads by joint, offset, wrench, and whether they follow; else nothing grows, and none is an end's."""
        none = [-1] * len(rows)
        joint, offset, wrench, follows = zip(*rows, strict=True) if rows else ((), (), (), ())
        return cls(
            _ints(joint), np.array(offset, dtype=float).reshape(-1, 3),
            np.array(wrench, dtype=float).reshape(-1, 6), _ints(follows),
            _ints(grows or none), _ints(turning), _ints(ends or none),
        )  # fmt: skip


class Structure(NamedTuple):
    """What of a machine and its loads decides the order of elimination: no length and no stiffness is in it.

    Names are those of `vjm.kernels.arrays.MachineArrays`; of couplings it is their number.
    """

    parent: tuple[int, ...]
    coordinate: tuple[int, ...]
    kind: tuple[int, ...]
    first: tuple[int, ...]
    closure_joint: tuple[tuple[int, int], ...]
    closure_rows: tuple[int, ...]
    couplings: int
    spring_joint: tuple[tuple[int, int], ...]
    end_joint: tuple[int, ...]
    load_joint: tuple[int, ...]
    turning: tuple[int, ...]


def structure(machine: MachineArrays) -> Structure:
    """Of a machine under loads, whose order need not be known."""

    def numbers(array: np.ndarray) -> tuple[int, ...]:
        return tuple(array.tolist())

    def pairs(array: np.ndarray) -> tuple[tuple[int, int], ...]:
        return tuple((first, second) for first, second in array.tolist())

    return Structure(
        numbers(machine.parent), numbers(machine.coordinate), numbers(machine.kind), numbers(machine.first),
        pairs(machine.closure_joint), numbers(machine.closure_rows), len(machine.total),
        pairs(machine.spring_joint), numbers(machine.end_joint), numbers(machine.load_joint),
        numbers(machine.turning),
    )  # fmt: skip


@lru_cache(maxsize=KEPT)
def order_of(machine: Structure) -> dict[str, np.ndarray]:
    """The fields of `vjm.kernels.arrays.MachineArrays` that say in which order a machine is eliminated."""
    units, border = _units(machine)
    count: int = 0
    last = {joints[1] - 1 for joints, _ in units}
    inside = [j for j in machine.load_joint if machine.coordinate[j] >= 0 and j not in last]
    if inside:
        raise ValueError(
            f"a load acts within a spring, behind joint {inside[0]}: loads act on bodies between springs"
        )
    carrier = np.full(len(machine.parent), -1, dtype=np.int64)
    above, subtrees = np.full(len(units), -1, dtype=np.int64), np.zeros(len(units), dtype=np.int64)
    of_joint = {joint: u for u, (joints, _) in enumerate(units) for joint in range(*joints)}
    for joint, parent in enumerate(machine.parent):
        before = carrier[parent] if parent >= 0 else -1
        u = of_joint.get(joint)
        if u is None:
            carrier[joint] = before
            continue
        carrier[joint] = u
        if joint == units[u][0][0]:
            above[u] = before
            subtrees[u] = subtrees[before] if before >= 0 else count
            count += 1 if before < 0 else 0
    width = [int(machine.first[b + 1] - machine.first[b]) if b >= 0 else 1 for _, b in units]
    first_closure = np.concatenate([[0], np.cumsum(machine.closure_rows)]).astype(np.int64)
    blocks = [
        int(first_closure[-1]), machine.couplings, 3 * len(machine.spring_joint),
        len(border) + (DELAYED if len(machine.closure_rows) else 0), 6 * len(machine.turning),
        6 * len(machine.end_joint),
    ]  # fmt: skip
    size = np.concatenate([[0], np.cumsum(blocks)]).astype(np.int64)
    place = {c: int(size[3]) + q for q, c in enumerate(border)}
    column = [place[int(machine.coordinate[joints[0]])] if b < 0 else -1 for joints, b in units]
    sources = _sources(machine, size, first_closure, carrier, above)
    touched: list[set[int]] = [set() for _ in range(count)]
    for u, own in enumerate(column):
        subtree = int(subtrees[u])
        if own >= 0:
            touched[subtree].add(own)
        for _, _, _, first, places in sources[u]:
            touched[subtree].update(range(first, first + places))
    columns = [sorted(each) for each in touched]
    most = max((len(each) for each in columns), default=0)
    subtree_column, local = np.zeros((count, most), dtype=np.int64), np.full((count, int(size[6])), -1)
    subtree_width = np.zeros((count, 2), dtype=np.int64)
    for subtree, each in enumerate(columns):
        subtree_column[subtree, : len(each)] = each
        local[subtree, each] = OWN + np.arange(len(each))
        subtree_width[subtree] = OWN + sum(c < size[5] for c in each), OWN + len(each)
    entries = [
        (kind, index, side, local[subtrees[u], first])
        for u, each in enumerate(sources)
        for kind, index, side, first, _ in each
    ]
    stands = {c: j for j, c in reversed(list(enumerate(machine.coordinate)))}
    return {
        "unit_joint": _ints([joints for joints, _ in units], 2), "unit_block": _ints([b for _, b in units]),
        "unit_column": _ints(column), "unit_row": _ints(np.concatenate([[0], np.cumsum(width)])),
        "unit_above": above, "unit_subtree": subtrees, "carrier": carrier, "subtree_width": subtree_width,
        "subtree_column": subtree_column, "local": local.astype(np.int64), "size": size,
        "source_first": _ints(np.concatenate([[0], np.cumsum([len(each) for each in sources])])),
        "source": _ints(entries, 4), "closure_first": first_closure, "border": _ints(border),
        "border_joint": _ints([stands[c] for c in border]),
    }  # fmt: skip


def packed(machine: MachineArrays, loads: Loads) -> MachineArrays:
    """The arrays of a machine under loads, from what `machine_arrays` gives."""
    machine = machine._replace(**loads._asdict())
    order = order_of(structure(machine))
    border = order["border"]
    place = {c: q for q, c in enumerate(border.tolist())}
    K = np.zeros((len(border), len(border)))
    for b in range(len(machine.kind)):
        coordinates = range(int(machine.first[b]), int(machine.first[b + 1]))
        if coordinates[0] in place and machine.kind[b] == LINEAR:
            rows = [place[c] for c in coordinates]
            K[np.ix_(rows, rows)] = machine.K[b][: len(rows), : len(rows)]
    return machine._replace(
        **order, border_K=K, border_law=machine.border_law[border],
        coupling=np.ascontiguousarray(machine.coupling[:, border]),
    )  # fmt: skip


def _ints(values: ArrayLike, width: int = 0) -> np.ndarray:
    """Integers ``(k,)``, or ``(k, width)``."""
    flat = np.array(values, dtype=np.int64)
    return flat.reshape(-1, width) if width else flat.reshape(-1)


def _units(machine: Structure) -> tuple[list[tuple[tuple[int, int], int]], list[int]]:
    """Joints and block of each unit, block −1 where its coordinate stays; and the coordinates that stay."""
    block_of = np.repeat(np.arange(len(machine.kind)), np.diff(machine.first)).tolist()
    runs: list[list[int]] = []
    blocks: list[int] = []
    for joint, c in enumerate(machine.coordinate):
        if c < 0:
            continue
        if runs and runs[-1][-1] == joint - 1 == machine.parent[joint] and blocks[-1] == block_of[c]:
            runs[-1].append(joint)
        else:
            runs.append([joint])
            blocks.append(block_of[c])
    units: list[tuple[tuple[int, int], int]] = []
    stay: set[int] = set()
    for run, b in zip(runs, blocks, strict=True):
        if machine.kind[b] not in (PASSIVE, LAW) and blocks.count(b) == 1:
            units.append(((run[0], run[-1] + 1), b))
            continue
        stay.update(range(int(machine.first[b]), int(machine.first[b + 1])))
        units.extend(((joint, joint + 1), -1) for joint in run)
    return units, sorted(stay)


def _sources(
    machine: Structure, size: np.ndarray, first_closure: np.ndarray, carrier: np.ndarray, above: np.ndarray
) -> list[list[tuple[int, int, int, int, int]]]:  # fmt: skip
    """What each unit moves: kind, index, side, first place in the border and number of places."""

    def path(joint: int) -> list[int]:
        ancestors, u = [], int(carrier[joint]) if joint >= 0 else -1
        while u >= 0:
            ancestors.append(u)
            u = int(above[u])
        return ancestors

    sources: list[list[tuple[int, int, int, int, int]]] = [[] for _ in above]

    def add(
        sides: Sequence[tuple[int, int]], kind: int, index: int, first: int, width: int, skip: set[int]
    ) -> None:
        for side, joint in sides:
            for u in path(joint):
                if u not in skip:
                    sources[u].append((kind, index, side, first, width))

    for k, (joints, rows) in enumerate(zip(machine.closure_joint, machine.closure_rows, strict=True)):
        # what carries both frames moves them alike
        both = set(path(joints[0])) & set(path(joints[1]))
        add(list(enumerate(joints)), WELD if rows == 6 else BALL, k, int(first_closure[k]), int(rows), both)
    for k, joints in enumerate(machine.spring_joint):
        add(list(enumerate(joints)), SPRING, k, int(size[2]) + 3 * k, 3, set())
    for k, load in enumerate(machine.turning):
        add([(1, int(machine.load_joint[load]))], TURNING, int(load), int(size[4]) + 6 * k, 6, set())
    for k, joint in enumerate(machine.end_joint):
        add([(1, int(joint))], END, k, int(size[5]) + 6 * k, 6, set())
    return sources


def machine_arrays(
    built: Assembly,
    unit: Array,
    energy: float | None,
    length: float,
    *,
    springs: tuple[np.ndarray, Array, Array],
    closures: tuple[np.ndarray, Array, Sequence[int]],
    ends: Sequence[BodyFrame] = (),
    spare: tuple[int, int] = (0, 0),
) -> MachineArrays:
    """What a machine consists of, for `packed`: no loads, no order, all coordinates in place of the border's.

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
    before, axis = np.array(built.before).reshape(-1, 4, 4), np.array(built.axis, dtype=float).reshape(-1, 3)
    kind, first, K, beam = spring_blocks(built)
    if energy is None:
        own = np.array([block[i, i] for block, k in zip(K, np.diff(first), strict=True) for i in range(k)])
        turning = own[(unit == 1.0) & (own > 0.0)]
        energy = float(np.exp(np.mean(np.log(turning)))) if len(turning) else 1.0
    unit_vector = (axis[:, None, :] == np.eye(3)).all(axis=2)
    # laws of joints' springs, then of springs between points
    elastic = zip(first[:-1][kind != PASSIVE], built.springs, strict=True)
    of_joints = {int(c): spring.law for c, spring in elastic if isinstance(spring, LawSpring)}
    between = [spring.law for spring in built.chain.point_springs]
    laws = [*of_joints.values(), *(law for law in between if law is not None)]
    law_of_coordinate, numbered = np.full(built.size, -1), iter(range(len(of_joints), len(laws)))
    law_of_coordinate[list(of_joints)] = range(len(of_joints))
    return MachineArrays(
        **dict.fromkeys(ORDERED, _ints([])), **Loads.of([], [])._asdict(),
        parent=_ints(built.parent), rotary=_ints(built.rotary), axis=axis,
        along=np.where(unit_vector.any(axis=1), unit_vector.argmax(axis=1), -1).astype(np.int64),
        R0=np.ascontiguousarray(before[:, :3, :3]), p0=np.ascontiguousarray(before[:, :3, 3]),
        moved=_ints((before != np.eye(4)).any(axis=(1, 2))), coordinate=_ints(built.coordinate),
        factor=np.array(built.factor, dtype=float), kind=kind, first=first, K=K, beam=beam,
        grows=_ints([built.grows.get(int(c), -1) for c in first[:-1]]), unit=np.ascontiguousarray(unit),
        energy=np.array([energy]), length=np.array([length]), spare=_ints(spare),
        spring_joint=springs[0], spring_point=springs[1], spring=springs[2],
        spring_law=_ints([-1 if law is None else next(numbered) for law in between]),
        law_first=_ints(np.concatenate([[0], np.cumsum([len(law.curve.knots) for law in laws])])),
        law_knot=np.concatenate([np.zeros(0), *(law.curve.knots for law in laws)]),
        law_piece=np.concatenate([np.zeros((0, ORDER)), *(law.curve.pieces for law in laws)]),
        law_most=np.array([law.largest_stiffness for law in laws], dtype=float),
        closure_joint=_ints(closures[0], 2), closure_R=np.ascontiguousarray(closures[1][:, :, :3, :3]),
        closure_p=np.ascontiguousarray(closures[1][:, :, :3, 3]), closure_rows=_ints(closures[2]),
        border_K=np.zeros((0, 0)), border_law=law_of_coordinate, coupling=coupling_rows(built),
        total=np.array([coupling.total for coupling in built.chain.couplings], dtype=float),
        end_joint=_ints([site.joint for site in ends]),
        end_R=np.array([site.frame[:3, :3] for site in ends]).reshape(-1, 3, 3),
        end_p=np.array([site.frame[:3, 3] for site in ends]).reshape(-1, 3),
    )  # fmt: skip


def closure_sites(built: Assembly) -> tuple[np.ndarray, Array]:
    """Last joints ``(c, 2)`` before the two frames of each closure, −1 for the ground; the frames behind them."""
    joints, frames = [], []
    for closure in built.chain.closures:
        sites = [built.ends[part] if part else BodyFrame(-1, np.eye(4)) for part in closure.parts]
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
