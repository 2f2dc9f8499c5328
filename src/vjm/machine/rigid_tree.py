"""The rigid machine: frames and motions of a tree of parts, over many postures at once.

Springs stand at zero here: beams are rigid, and a held joint stands at its coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, assert_never

import numpy as np

from vjm.model.chain import Chain
from vjm.model.joints import CoupledJoint, HeldJoint
from vjm.model.parts import Actuator, Beam, Mount, PassiveJoint, RigidOffset
from vjm.rotations import Array, frame, translation


class Site(NamedTuple):
    """A frame ``(4, 4)`` on a rigid body: behind a joint, −1 for the base, mm from there."""

    joint: int
    frame: Array


class State(NamedTuple):
    """The machine in g postures.

    Attributes:
        behind: frames ``(m + 1, g, 4, 4)`` behind the base and behind each joint, world, mm.
        axes: of the joints ``(m, g, 3)``, world.
    """

    behind: Array
    axes: Array


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

    def __init__(self, machine: Chain) -> None:
        self.machine = machine
        self.length = machine.characteristic_length
        joints = [part for part in machine.parts if isinstance(part, HeldJoint | PassiveJoint)]
        given = [part for part in joints if not isinstance(part, CoupledJoint)]
        self.names = tuple(part.name for part in given)
        self.passive = np.array([isinstance(part, PassiveJoint) for part in given], dtype=bool)
        self.slides = np.array([part.slides for part in given], dtype=bool)
        self.unit = np.where(self.slides, self.length, 1.0)
        self._parent: list[int] = []
        self._before: list[Array] = []
        self._axis: list[Array] = []
        self._rotary: list[bool] = []
        self._by_name = {name: (np.eye(len(given))[i], 0.0) for i, name in enumerate(self.names)}
        shares: list[tuple[Array, float]] = []
        self.ends: dict[str, Site] = {"": Site(-1, machine.base)}
        pushing, last = machine.pushing, ""
        for part in machine.parts:
            site = self.ends[machine.after.get(part.name, last)]
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
                case Actuator() | Mount():
                    pass
                case HeldJoint() | PassiveJoint():
                    if isinstance(part, CoupledJoint):
                        row = sum((r * self._by_name[name][0] for name, r in part.ratios), np.zeros(len(given)))
                        rest = part.offset + sum(r * self._by_name[name][1] for name, r in part.ratios)
                        self._by_name[part.name] = row, rest
                    if part.name not in pushing:
                        site = self._joint(site, part.axis, rotary=not part.slides)
                        shares.append(self._by_name[part.name])
                case _:
                    assert_never(part)
            self.ends[part.name] = last_site = site
            last = part.name
        self.end = last_site
        m = len(self._parent)
        self._share = np.array([row for row, _ in shares]).reshape(m, len(given))
        self._offset = np.array([rest for _, rest in shares])
        self._on_way = np.zeros((m + 1, m), dtype=bool)
        for j, parent in enumerate(self._parent):
            self._on_way[j + 1] = self._on_way[parent + 1]
            self._on_way[j + 1, j] = True
        self._turning = np.array(self._rotary, dtype=bool)
        axis = np.array(self._axis).reshape(m, 3)
        self._skew = np.cross(axis[:, None, :], np.eye(3)).transpose(0, 2, 1)
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

    def state(self, q: Array) -> State:
        """Frames and axes at coordinates ``(g, n)``."""
        m, g = len(self._parent), len(q)
        value = q @ self._share.T + self._offset
        behind = np.zeros((m + 1, g, 4, 4))
        behind[0] = np.eye(4)
        axes = np.empty((m, g, 3))
        local = np.zeros((g, 4, 4))
        local[:, 3, 3] = 1.0
        for j, parent in enumerate(self._parent):
            at = behind[parent + 1] @ self._before[j]
            if self._rotary[j]:
                s, c = np.sin(value[:, j])[:, None, None], np.cos(value[:, j])[:, None, None]
                local[:, :3, :3] = np.eye(3) + s * self._skew[j] + (1.0 - c) * (self._skew[j] @ self._skew[j])
                local[:, :3, 3] = 0.0
            else:
                local[:, :3, :3] = np.eye(3)
                local[:, :3, 3] = value[:, j, None] * self._axis[j]
            behind[j + 1] = at @ local
            axes[j] = at[:, :3, :3] @ self._axis[j]
        return State(behind, axes)

    def frames(self, state: State, site: Site) -> Array:
        """World frames ``(g, 4, 4)`` of a site, mm."""
        result: Array = state.behind[site.joint + 1] @ site.frame
        return result

    def motion(self, state: State, site: Site, point: Array) -> Array:
        """Derivatives ``(g, 6, n)`` of the place of a point ``(g, 3)`` on the body of a site, and of its turn."""
        g, moving = len(point), np.flatnonzero(self._on_way[site.joint + 1])
        J = np.zeros((g, 6, len(self._parent)))
        axes = state.axes[moving].transpose(1, 0, 2)
        turning = self._turning[moving][:, None]
        levers = point[:, None] - state.behind[moving + 1, :, :3, 3].transpose(1, 0, 2)
        J[:, :3, moving] = np.where(turning, np.cross(axes, levers), axes).transpose(0, 2, 1)
        J[:, 3:, moving] = np.where(turning, axes, 0.0).transpose(0, 2, 1)
        result: Array = J @ self._share
        return result

    def closing(self, q: Array, state: State | None = None) -> tuple[Array, Array]:
        """What closures and couplings miss at coordinates ``(g, n)``, lengths over the machine's, and rad.

        Returns:
            Gaps ``(g, r)`` and their derivatives ``(g, r, n)`` by the coordinates over their units, exact where
            closed.
        """
        state = self.state(q) if state is None else state
        gaps, rows, unit = [], [], np.repeat([self.length, 1.0], 3)
        for closure in self.machine.closures:
            sites = [
                self._moved(self.ends[part], T) for part, T in self._held_frames(closure.parts, closure.frames)
            ]
            first, second = (self.frames(state, site) for site in sites)
            d = difference(second, first)
            J = self.motion(state, sites[0], first[:, :3, 3]) - self.motion(state, sites[1], second[:, :3, 3])
            gaps.append((d / unit)[:, : closure.rows])
            rows.append((J / unit[:, None])[:, : closure.rows])
        gaps.append(q @ self._coupled.T - self._totals)
        rows.append(np.broadcast_to(self._coupled, (len(q), *self._coupled.shape)))
        return np.concatenate(gaps, axis=1), np.concatenate(rows, axis=1) * self.unit

    def _held_frames(self, parts: Sequence[str], frames: Array) -> list[tuple[str, Array]]:
        """Parts and frames of a closure; a frame on the base is given in the world, ends are from the base's."""
        base = np.linalg.inv(self.machine.base)
        return [(part, T if part else base @ T) for part, T in zip(parts, frames, strict=True)]

    def end_motion(self, state: State) -> tuple[Array, Array]:
        """Frames ``(g, 4, 4)`` of the end-effector, and its motion ``(g, 6, n)`` by the coordinates.

        The motion's lengths are over the machine's, the coordinates over their units.
        """
        end = self.frames(state, self.end)
        J = self.motion(state, self.end, end[:, :3, 3]) / np.repeat([self.length, 1.0], 3)[:, None]
        return end, J * self.unit


def difference(start: Array, stop: Array) -> Array:
    """Displacements ``(g, 6)`` between frames ``(g, 4, 4)``, as `vjm.rotations.displacement_between`, mm and rad.

    Of half a turn, which has no one vector, the turn is NaN.
    """
    R = stop[:, :3, :3] @ start[:, :3, :3].transpose(0, 2, 1)
    w = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine = np.linalg.norm(w, axis=1)
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    small = sine < 1e-9
    factor = np.where(
        small, np.where(cosine > 0.0, 1.0, np.nan), np.arctan2(sine, cosine) / np.where(small, 1.0, sine)
    )
    return np.concatenate([stop[:, :3, 3] - start[:, :3, 3], w * factor[:, None]], axis=1)


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
