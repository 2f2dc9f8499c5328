"""A machine, perhaps with branches, as the arrays that the kernels of trees take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from vjm.kernels.packed_model import BEAM_COLUMN, LINEAR, PASSIVE
from vjm.model.chain import Chain
from vjm.model.joints import CoupledJoint, HeldJoint
from vjm.model.load_case import Load
from vjm.model.parts import PassiveJoint
from vjm.model.springs import BeamColumnSpring, LinearSpring, Spring
from vjm.rotations import Array
from vjm.tree.arrays import TreeArrays
from vjm.tree.assembly import BranchedAssembly, Site, TreeAssembly, commands
from vjm.tree.entry_points import residuals_of

Gravity = tuple[float, float, float]


class TreeModel:
    """Rigid links, held joints and virtual springs of a machine, whatever the coordinates of its joints.

    Attributes:
        chain: the machine, its beams split into springs.
        joints: names of the joints whose coordinates the data give: actuated, sprung and passive ones in the order
            of the parts; coupled ones follow from them.
        ends: names of the end frames; one empty name where the machine names none.
        size: number of coordinates n that deflect.
    """

    def __init__(self, chain: Chain, *, split: bool = True) -> None:
        """Assemble a machine.

        Args:
            chain: the machine.
            split: whether beams with a section that are not split yet become as many springs as engine ``vjm``
                makes of them, see `Chain.split`; else each is one spring with its compliance at its tip, as for
                engine ``vjm-paper``.

        Raises:
            ValueError: nothing in it deflects, or a part or joint that it names does not exist.
        """
        self.chain = chain = chain.split() if split else chain
        self._built = built = TreeAssembly(chain)
        self.size = built.size
        if not self.size:
            raise ValueError(
                f"{chain.name}: nothing deflects: give a joint a compliance, or add a beam (kind = 'beam')"
            )
        self.joints = tuple(
            part.name
            for part in chain.parts
            if isinstance(part, HeldJoint | PassiveJoint) and not isinstance(part, CoupledJoint)
        )
        self.ends = tuple(chain.ends) or ("",)
        self._map, self._offset = commands(chain, list(self.joints), built.held, built.share, len(built.parent))

    # --- what the data give -------------------------------------------------------------------------------

    def coordinates(self, q: Array | Mapping[str, float]) -> Array:
        """Rows ``(g, n_joints)`` of joint coordinates from such rows, one row, or values by name.

        Raises:
            ValueError: another number of columns, an unknown or missing name, or no finite number.
        """
        if isinstance(q, Mapping):
            unknown, missing = set(q) - set(self.joints), [name for name in self.joints if name not in q]
            if unknown or missing:
                what = f"no joint '{min(unknown)}'" if unknown else f"no coordinate for joint '{missing[0]}'"
                raise ValueError(f"{self.chain.name}: {what}; its joints are {', '.join(self.joints)}")
            q = np.array([q[name] for name in self.joints])
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        if rows.ndim != 2 or rows.shape[1] != len(self.joints):
            raise ValueError(
                f"{self.chain.name}: q has the shape {rows.shape}; give a column for each of its "
                f"{len(self.joints)} joints: {', '.join(self.joints)}"
            )
        if not np.all(np.isfinite(rows)):
            raise ValueError(
                f"{self.chain.name}: row {int(np.argmin(np.isfinite(rows).all(axis=1)))} of q is not finite"
            )
        return rows

    def posture(self, label: str) -> Array:
        """Coordinates ``(n_joints,)`` of a posture."""
        values = dict(self.chain.held.get(label, {}))
        values.update(zip((joint.name for joint in self.chain.joints), self.chain.posture(label), strict=True))
        return self.coordinates(values)[0]

    def values(self, q: Array) -> Array:
        """Values ``(g, m)`` of all one-degree joints that stand at rows of coordinates ``(g, n_joints)``."""
        result: Array = q @ self._map.T + self._offset
        return np.ascontiguousarray(result)

    def naturals(self, q: Array) -> Array:
        """Coordinates ``(g, n)`` at which the springs are free of stress."""
        natural = np.zeros((len(q), self.size))
        for coordinate, value in self._built.natural.items():
            natural[:, coordinate] = value
        for coordinate, (name, rest) in self._built.rests.items():
            natural[:, coordinate] = rest - q[:, self.joints.index(name)]
        return natural

    def eased_springs(self, q: Array, share: float) -> Array:
        """Laws ``(g, s, 3)`` of the springs between points under a share of their forces at rows of coordinates.

        Stiffness and free length stay; the preload is such that the unloaded posture is under that share.
        """
        joints, points, laws = point_springs(self.chain, self._built)
        g, s = len(q), len(laws)
        ends, nothing = 2 * s, np.zeros((g, self.size))
        R, p = np.zeros((g, ends, 3, 3)), np.zeros((g, ends, 3))
        arrays = self.arrays()._replace(
            end_joint=joints.reshape(ends), end_R=np.tile(np.eye(3), (ends, 1, 1)), end_p=points.reshape(ends, 3)
        )
        residuals_of(arrays, self.values(q), nothing, np.zeros((1, ends, 6)), nothing, nothing.copy(), R, p, True)
        places = p.reshape(g, s, 2, 3)
        lengths = np.linalg.norm(places[:, :, 1] - places[:, :, 0], axis=2)
        result = np.tile(laws, (g, 1, 1))
        result[:, :, 2] -= (1.0 - share) * (laws[:, 0] * (lengths - laws[:, 1]) + laws[:, 2])
        return result

    def torques(self, forces: Array) -> Array:
        """What holds each joint ``(g, n_joints)``, N mm or N, from the loads' forces ``(g, m)`` on all joints.

        A joint to which others are coupled as bent bears its share of theirs.
        """
        return -forces @ self._carried.T

    @cached_property
    def _carried(self) -> Array:
        share = {name: np.eye(len(self.joints))[i] for i, name in enumerate(self.joints)}
        for part in self.chain.parts:
            if isinstance(part, CoupledJoint):
                own = [ratio * share[name] for name, ratio in part.ratios if part.as_bent]
                share[part.name] = sum(own, np.zeros(len(self.joints)))
        result = np.zeros((len(self.joints), len(self._built.parent)))
        for joint, name in self._built.held.items():
            # what pushes a beam out bears what its end does, and each of the beam's joints but a share of that
            result[:, joint] = self._built.share.get(joint, 1.0) * share[name]
        return result

    def span(self, part: str) -> range:
        """The coordinates of a part: of a joint those across its axis first, then its own."""
        return self._built.spans[part]

    def weighed(self) -> tuple[str, ...]:
        """The part of each weight in `arrays`, in their order."""
        return tuple(piece.part for piece in self._built.pieces if piece.mass > 0.0 and piece.joint >= 0)

    def driven_by(self, part: str) -> int:
        """The one-degree joint that stands at the value of a held joint; the first where they are many."""
        return next(joint for joint, name in self._built.held.items() if name == part)

    def shares(self, part: str) -> dict[int, float]:
        """All one-degree joints that stand at the value of a held joint, and at which share of it."""
        return {
            joint: self._built.share.get(joint, 1.0) for joint, name in self._built.held.items() if name == part
        }

    # --- arrays -------------------------------------------------------------------------------------------

    def find(self, part: str, at: float) -> tuple[int, Array]:
        """Last joint before a point of a part, and where it lies behind it, ``(3,)`` mm.

        Args:
            part: name of a part or an end frame; empty for the end of the last part.
            at: fraction of the part's length.

        Raises:
            ValueError: there is no such point.
        """
        if not part or part in self.chain.ends:
            site = self._end(part)
            return site.joint, site.frame[:3, 3]
        own = [piece for piece in self._built.pieces if piece.part == part]
        for piece in reversed(own):
            if piece.start - 1e-9 <= at <= piece.stop + 1e-9:
                return piece.joint, piece.at(at)
        known = ", ".join(dict.fromkeys(piece.part for piece in self._built.pieces))
        raise ValueError(f"{self.chain.name}: no point at {at:g} of a part '{part}' (there are {known})")

    def _end(self, name: str) -> Site:
        last = self.chain.parts[-1].name if self.chain.parts else ""
        return self._built.ends[self.chain.ends.get(name, last)]

    def arrays(self, gravity: Gravity | None = None, loads: Sequence[Load] = ()) -> TreeArrays:
        """The machine under weight, m/s², and loads, all in full.

        Raises:
            ValueError: a load stands on no point of the machine.
        """
        rows: list[tuple[int, Array, Array, bool, int]] = []
        if gravity is not None:
            for piece in self._built.pieces:
                if piece.mass > 0.0:
                    weight = np.concatenate([piece.mass * np.asarray(gravity, dtype=float), np.zeros(3)])
                    rows.append((piece.joint, piece.centre_of_mass, weight, False, piece.grows))
        for load in loads:
            rows.append((*self.find(load.part, load.at), np.array(load.wrench), load.follower, -1))
        # what stands on the base moves nothing
        rows = [row for row in rows if row[0] >= 0]
        return self._bare._replace(
            load_joint=np.array([row[0] for row in rows], dtype=np.int64),
            load_offset=np.array([row[1] for row in rows]).reshape(-1, 3),
            load=np.array([row[2] for row in rows]).reshape(-1, 6),
            follows=np.array([row[3] for row in rows], dtype=np.int64),
            load_grows=np.array([row[4] for row in rows], dtype=np.int64),
        )

    @cached_property
    def _bare(self) -> TreeArrays:
        built = self._built
        before = np.array(built.before).reshape(-1, 4, 4)
        kind, first, K, beam = spring_blocks(built)
        grows = np.array([built.grows.get(int(c), -1) for c in first[:-1]], dtype=np.int64)
        sites = [self._end(name) for name in self.ends]
        joint, point, law = point_springs(self.chain, built)
        nothing = np.zeros(0, dtype=np.int64)
        return TreeArrays(
            parent=np.array(built.parent, dtype=np.int64),
            rotary=np.array(built.rotary, dtype=np.int64),
            axis=np.array(built.axis).reshape(-1, 3),
            R0=np.ascontiguousarray(before[:, :3, :3]),
            p0=np.ascontiguousarray(before[:, :3, 3]),
            coordinate=np.array(built.coordinate, dtype=np.int64),
            factor=np.array(built.factor, dtype=float),
            kind=kind, first=first, K=K, beam=beam, grows=grows,
            unit=self._unit,
            load_joint=nothing, load_offset=np.zeros((0, 3)), load=np.zeros((0, 6)), follows=nothing,
            load_grows=nothing,
            spring_joint=joint, spring_point=point, spring=law,
            end_joint=np.array([site.joint for site in sites], dtype=np.int64),
            end_R=np.array([site.frame[:3, :3] for site in sites]),
            end_p=np.array([site.frame[:3, 3] for site in sites]),
        )  # fmt: skip

    @cached_property
    def reach(self) -> float:
        """Length of all links in mm: more than the machine can reach."""
        links = [*self._built.before, *(self._end(name).frame for name in self.ends)]
        grown = sum(beam.length for beam in self.chain.beams if beam.free_length)
        return max(1.0, grown + sum(float(np.linalg.norm(T[:3, 3])) for T in links))

    @cached_property
    def _unit(self) -> Array:
        """1 for turns, the machine's reach in mm for shifts ``(n,)``."""
        reach = self.reach
        unit = np.ones(self.size)
        for coordinate, rotary in zip(self._built.coordinate, self._built.rotary, strict=True):
            if coordinate >= 0 and not rotary:
                unit[coordinate] = reach
        return unit


def point_springs(chain: Chain, built: BranchedAssembly) -> tuple[np.ndarray, Array, Array]:
    """Joints ``(s, 2)``, points ``(s, 2, 3)`` and laws ``(s, 3)`` of a machine's springs between points.

    Raises:
        ValueError: one is fixed to a beam where that has no shape.
    """
    joints, points, laws = [], [], []
    for spring in chain.point_springs:
        for part, point in zip(spring.parts, np.asarray(spring.points, dtype=float), strict=True):
            try:
                site = built.carrying(part, point)
            except ValueError as error:
                raise ValueError(f"{chain.name}: spring '{spring.name}': {error}") from None
            joints.append(site.joint)
            points.append(site.frame[:3, :3] @ point + site.frame[:3, 3])
        laws.append((spring.stiffness, spring.free_length, spring.preload))
    count = len(laws)
    return (
        np.array(joints, dtype=np.int64).reshape(count, 2),
        np.array(points).reshape(count, 2, 3),
        np.array(laws, dtype=float).reshape(count, 3),
    )


def spring_blocks(built: BranchedAssembly) -> tuple[np.ndarray, np.ndarray, Array, Array]:
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
