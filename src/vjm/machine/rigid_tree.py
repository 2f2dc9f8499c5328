"""The rigid machine: frames and motions of a tree of parts, over many postures at once.

Springs stand at zero here: beams are rigid, and a held joint stands at its coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, assert_never

import numpy as np

from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array, frame, rotation_vectors, translation

if TYPE_CHECKING:
    from vjm.machine.rigid_kernel import RigidArrays


class Site(NamedTuple):
    """A frame ``(4, 4)`` on a rigid body: behind a joint, −1 for the base, mm from there."""

    joint: int
    frame: Array


class RigidTree:
    """Joints, closures and couplings of a machine whose springs are rigid.

    Coordinates are those of its passive joints and of its held ones but coupled ones, in the order of the parts.

    Attributes:
        names: of the n coordinates.
        passive: ``(n,)`` which of them are passive.
        slides: ``(n,)`` which of them slide.
        unit: ``(n,)`` one radian, or the machine's length in mm for a slide: by it steps are measured.
        ends: where each part ends, by its name; empty: the base.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.length = machine.characteristic_length
        given = [joint for joint in machine.moving if joint.coupling is None]
        self.names = tuple(part.name for part in given)
        self.passive = np.array([part.free for part in given], dtype=bool)
        self.slides = np.array([part.slides for part in given], dtype=bool)
        self.unit = np.where(self.slides, self.length, 1.0)
        self._parent: list[int] = []
        self._before: list[Array] = []
        self._axis: list[Array] = []
        self._rotary: list[bool] = []
        self._by_name = {name: (np.eye(len(given))[i], 0.0) for i, name in enumerate(self.names)}
        shares: list[tuple[Array, float]] = []
        self.ends: dict[str, Site] = {"": Site(-1, machine.base)}
        self._begins: dict[str, Site] = {"": Site(-1, np.eye(4))}
        pushing, before = machine.pushing, machine.predecessors
        for part in machine.parts:
            site = begins = self.ends[before[part.name]]
            match part:
                case RigidOffset():
                    site = self._moved(site, part.transform)
                case Beam(free_length=free) if free:
                    site = self._moved(site, part.section_in_chain)
                    site = self._joint(site, np.array([1.0, 0.0, 0.0]), rotary=False)
                    shares.append(self._by_name[free])
                    site = self._moved(site, frame(part.section_frame.T) @ translation(part.end_offset))
                    site = self._moved(site, frame(part.own_frame.T))
                case Beam():
                    site = self._moved(site, translation(part.tip))
                case Joint():
                    if (follows := part.coupling) is not None:
                        row = follows.summed({name: share for name, (share, _) in self._by_name.items()})
                        rest = follows.value({name: offset for name, (_, offset) in self._by_name.items()})
                        self._by_name[part.name] = row, rest
                    if not part.fixed and part.name not in pushing:
                        site = self._joint(site, part.axis, rotary=not part.slides)
                        shares.append(self._by_name[part.name])
                case _:
                    assert_never(part)
            self.ends[part.name] = last_site = site
            # a point of a joint is behind it
            self._begins[part.name] = site if isinstance(part, Joint) else begins
        self.end = last_site
        m = len(self._parent)
        self._share = np.array([row for row, _ in shares]).reshape(m, len(given))
        self._offset = np.array([rest for _, rest in shares])
        self._coupled = np.zeros((len(machine.couplings), len(given)))
        for row_, coupling in zip(self._coupled, machine.couplings, strict=True):
            for name, weight in coupling.terms:
                row_[self.names.index(name)] += weight
        self._totals = np.array([coupling.total for coupling in machine.couplings])
        self.row_names = [c.name for c in machine.closures for _ in range(c.rows)]
        self.row_names += [coupling.name for coupling in machine.couplings]

    def _moved(self, site: Site, transform: Array) -> Site:
        return Site(site.joint, site.frame @ transform)

    def _joint(self, site: Site, axis: Array, *, rotary: bool) -> Site:
        self._parent.append(site.joint)
        self._before.append(site.frame)
        self._axis.append(np.asarray(axis, dtype=float))
        self._rotary.append(rotary)
        return Site(len(self._parent) - 1, np.eye(4))

    def coordinates(self, values: Mapping[str, float]) -> Array:
        """Coordinates ``(n,)`` from values by the joints' names, mm or rad.

        Raises:
            ValueError: one is missing.
        """
        missing = next((name for name in self.names if name not in values), None)
        if missing is not None:
            raise ValueError(f"{self.machine.name}: no coordinate for the joint '{missing}'")
        return np.array([values[name] for name in self.names], dtype=float)

    def posture(self, label: str) -> Array:
        """Coordinates ``(n,)`` of one of the machine's postures.

        Raises:
            KeyError: no such posture.
        """
        q = self.machine.posture(label)
        values = dict(zip((joint.name for joint in self.machine.joints), q.tolist(), strict=True))
        return self.coordinates({**values, **self.machine.held.get(label, {})})

    @cached_property
    def arrays(self) -> RigidArrays:
        """The machine as kernels take it."""
        closures = self.machine.closures
        sites = [self._held(part, T) for c in closures for part, T in zip(c.parts, c.frames, strict=True)]
        return self._arrays(sites, [closure.rows for closure in closures])

    def _arrays(self, sites: list[Site], rows: list[int]) -> RigidArrays:
        """The machine, with pairs of frames of each of which so many components are compared."""
        # imported when it is asked for: compiled code takes longer to load than a model file
        from vjm.machine.rigid_kernel import RigidArrays

        sites = [*sites, self.end]
        m = len(self._parent)
        return RigidArrays(
            parent=np.array(self._parent, dtype=np.int64),
            rotary=np.array(self._rotary, dtype=np.int64),
            axis=np.array(self._axis).reshape(m, 3),
            before=np.array(self._before).reshape(m, 4, 4),
            share=self._share,
            offset=self._offset.astype(float),
            joint=np.array([site.joint for site in sites], dtype=np.int64),
            frame=np.array([site.frame for site in sites]),
            rows=np.array(rows, dtype=np.int64),
            coupled=self._coupled,
            total=self._totals.astype(float),
            unit=self.unit.astype(float),
            length=np.array([self.length]),
        )

    def _held(self, part: str, T: Array) -> Site:
        """A frame of a closure; one on the base is given in the world, ends are from the base's."""
        return self._moved(self.ends[part], T if part else np.linalg.inv(self.machine.base) @ T)

    def linearised(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """What closures and couplings miss at coordinates ``(g, n)``, and the end-effector.

        Returns:
            Gaps ``(g, r)``, lengths over the machine's, and rad; their derivatives ``(g, r, n)`` by the coordinates
            over their units, exact where closed; frames ``(g, 4, 4)`` of the end-effector, mm; and its motion
            ``(g, 6, n)``, likewise.
        """
        return self._linearised(self.arrays, q, len(self.row_names))

    def _linearised(self, arrays: RigidArrays, q: Array, r: int) -> tuple[Array, Array, Array, Array]:
        from vjm.machine.rigid_kernel import linearised

        g, n = len(q), len(self.names)
        gap, J, J_end = np.empty((g, r)), np.empty((g, r, n)), np.empty((g, 6, n))
        place, end = np.empty((g, 3, 4)), np.tile(np.eye(4), (g, 1, 1))
        linearised(arrays, np.ascontiguousarray(q, dtype=float), gap, J, place, J_end)
        end[:, :3] = place
        return gap, J, end, J_end

    def stretching(self, q: Array) -> Array:
        """Derivatives ``(s, n)`` of the lengths of springs between points at coordinates ``(n,)``, dimensionless.

        The two points of a spring are compared as those of a ball joint are. A row is zero where they meet.
        """
        springs = self.machine.point_springs
        if not springs:
            return np.zeros((0, len(self.names)))
        sites = [
            self._moved(self._begins[part], translation(np.asarray(point, dtype=float)))
            for spring in springs
            for part, point in zip(spring.parts, spring.points, strict=True)
        ]
        count = 3 * len(springs)
        gap, J, _, _ = self._linearised(self._arrays(sites, [3] * len(springs)), q[None], count + len(self._totals))
        apart = gap[0, :count].reshape(-1, 3)
        length = np.linalg.norm(apart, axis=1, keepdims=True)
        along = apart / np.where(length > 0.0, length, 1.0)
        result: Array = np.einsum("sa,san->sn", along, J[0, :count].reshape(len(springs), 3, -1))
        return result

    def end_frames(self, q: Array) -> Array:
        """Frames ``(g, 4, 4)`` of the end-effector at coordinates ``(g, n)``, mm."""
        return self.linearised(q)[2]


def difference(start: Array, stop: Array) -> Array:
    """Displacements ``(g, 6)`` between frames ``(g, 4, 4)``, as `vjm.rotations.displacement_between`, mm and rad.

    Of half a turn, which has no one vector, the turn is NaN.
    """
    turned = rotation_vectors(stop[:, :3, :3] @ start[:, :3, :3].transpose(0, 2, 1))
    return np.concatenate([stop[:, :3, 3] - start[:, :3, 3], turned], axis=1)


def displaced_frames(T: Array, displacement: Array) -> Array:
    """Frames ``(g, 4, 4)`` after displacements ``(g, 6)``, as `vjm.rotations.displaced`, mm and rad."""
    w = displacement[:, 3:]
    angle = np.linalg.norm(w, axis=1)[:, None, None]
    result = T.copy()
    result[:, :3, 3] += displacement[:, :3]
    W = np.cross(w[:, None, :], np.eye(3)).transpose(0, 2, 1)
    # sine and versine over the angle and its square; of sin(x) / x nothing is lost at zero
    sine, half = np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)
    result[:, :3, :3] = (np.eye(3) + sine * W + 0.5 * half**2 * (W @ W)) @ T[:, :3, :3]
    return result
