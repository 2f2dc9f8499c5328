"""A machine, perhaps with branches, as the arrays that the kernels of trees take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from vjm.kernels.arrays import MachineArrays
from vjm.model.assembly import Assembly, Site
from vjm.model.joint_limits import JointLimits, joint_limits
from vjm.model.load_case import Load
from vjm.model.lumped import LumpedModel
from vjm.model.machine import Machine
from vjm.model.packing import Loads, Pieces, packed
from vjm.model.pieces import closure_sites, machine_pieces, point_springs
from vjm.rotations import Array

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

    def __init__(self, chain: Machine, *, split: bool = True) -> None:
        """Assemble a machine.

        Args:
            chain: the machine.
            split: whether beams with a section that are not split yet become as many springs as engine ``vjm``
                makes of them, see `Machine.split`; else each is one spring with its compliance at its tip, as for
                engine ``vjm-paper``.

        Raises:
            ValueError: nothing in it deflects, or a part or joint that it names does not exist.
        """
        self.chain = chain = chain.split() if split else chain
        self._built = built = Assembly(chain, commanded=True)
        self.size = built.size
        if not self.size:
            raise ValueError(
                f"{chain.name}: nothing deflects: give a joint a compliance, or add a beam (kind = 'beam')"
            )
        self.joints = tuple(joint.name for joint in chain.moving if joint.coupling is None)
        self.ends = tuple(chain.ends) or ("",)
        self._map, self._offset = built.commands(chain, self.joints)

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
        if self.chain.pushing:
            # a beam beyond its length is no machine, whatever a batch does with limits
            self.limits.refuse(rows)
        return rows

    @cached_property
    def limits(self) -> JointLimits:
        """Of the joints whose coordinates the data give, and of those that follow."""
        return joint_limits(self.chain, self.joints)

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

    def torques(self, forces: Array) -> Array:
        """What holds each joint ``(g, n_joints)``, N mm or N, from the loads' forces ``(g, m)`` on all joints.

        A joint to which others are coupled under load bears its share of theirs.
        """
        return -forces @ self._carried.T

    @cached_property
    def _carried(self) -> Array:
        share = {name: np.eye(len(self.joints))[i] for i, name in enumerate(self.joints)}
        for joint in self.chain.moving:
            if joint.coupling is not None:
                own = [ratio * share[name] for name, ratio in joint.passes_on]
                share[joint.name] = sum(own, np.zeros(len(self.joints)))
        result = np.zeros((len(self.joints), len(self._built.parent)))
        for i, name in self._built.held.items():
            # what pushes a beam out bears what its end does, and each of the beam's joints but a share of that
            result[:, i] = self._built.share.get(i, 1.0) * share[name]
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

    def arrays(
        self, gravity: Gravity | None = None, loads: Sequence[Load] = (), *, moments: bool = False
    ) -> MachineArrays:
        """The machine under weight, m/s², and loads, all in full.

        With ``moments`` the wrenches on the end frames may have moments: they stand among the loads then, last.

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
        turning = [k for k, (_, _, wrench, follows, _) in enumerate(rows) if follows or np.any(wrench[3:])]
        ends = [-1] * len(rows)
        for k, site in enumerate(self._end(name) for name in self.ends):
            if moments and site.joint >= 0:
                turning.append(len(rows))
                rows.append((site.joint, site.frame[:3, 3], np.zeros(6), False, -1))
                ends.append(k)
        acting = Loads(
            joint=np.array([row[0] for row in rows], dtype=np.int64),
            offset=np.array([row[1] for row in rows]).reshape(-1, 3),
            wrench=np.array([row[2] for row in rows]).reshape(-1, 6),
            follows=np.array([row[3] for row in rows], dtype=np.int64),
            grows=np.array([row[4] for row in rows], dtype=np.int64),
            turning=np.array(turning, dtype=np.int64),
            end=np.array(ends, dtype=np.int64),
        )
        return packed(self._pieces, acting)

    @cached_property
    def springs(self) -> tuple[np.ndarray, Array, Array]:
        """Springs between points, see `point_springs`."""
        return point_springs(self.chain, self._built)

    @cached_property
    def _pieces(self) -> Pieces:
        built = self._built
        return machine_pieces(
            built, self.unit, None, self.reach,
            springs=self.springs,
            closures=(*closure_sites(self.chain, built), [closure.rows for closure in self.chain.closures]),
            chain=self.chain, ends=[self._end(name) for name in self.ends], grows=built.grows,
            spare=self._spare,
            stands={built.spans[part.name].start: self.driven_by(part.name) for part in self.chain.joints},
        )  # fmt: skip

    @cached_property
    def _spare(self) -> tuple[int, int]:
        """See `LumpedModel.spare`; of the machine in its first posture."""
        label = next(iter(self.chain.postures), None)
        if label is None or not self.chain.closes:
            return 0, 0
        return LumpedModel(self.chain.at(label)).spare(held=False)

    @cached_property
    def reach(self) -> float:
        """Length of all links in mm: more than the machine can reach."""
        links = [*self._built.before, *(self._end(name).frame for name in self.ends)]
        grown = sum(beam.length for beam in self.chain.beams if beam.free_length)
        return max(1.0, grown + sum(float(np.linalg.norm(T[:3, 3])) for T in links))

    @cached_property
    def unit(self) -> Array:
        """1 for turns, the machine's reach in mm for shifts ``(n,)``."""
        reach = self.reach
        unit = np.ones(self.size)
        for coordinate, rotary in zip(self._built.coordinate, self._built.rotary, strict=True):
            if coordinate >= 0 and not rotary:
                unit[coordinate] = reach
        return unit
