"""A machine's Jacobians and Hessians in the unloaded posture, with the springs of the virtual joint method.

Any tree of parts: how a body moves follows from the joints between it and the base. Closures and couplings are
conditions on the coordinates, and springs between points have the stiffness along their line.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.baselines.linear_machine import LinearMachine, refuse_open, refuse_stretched, refuse_uncoupled
from vjm.limits import refuse
from vjm.model.assembly import NEAR, Assembly, Site
from vjm.model.machine import Machine
from vjm.rotations import Array, frame, translation, turn


class FrozenGeometry:
    """A machine's joints where the unloaded posture has them.

    Attributes:
        chain: the machine.
        end: where the end-effector is.
        unit: of the coordinates ``(n,)``: the machine's length for shifts, 1 for turns.
        closures: frames of the two sides of each closure, and how many of its components are held.
        point_springs: the two points of each spring between points.
    """

    def __init__(self, label: str, chain: Machine, posture: Array) -> None:
        """Set a machine up.

        Args:
            label: of the engine.
            chain: its held joints at the coordinates of a posture.
            posture: passive coordinates ``(n_q,)`` rad or mm.

        Raises:
            ValueError: see `vjm.limits`.
        """
        refuse(label, chain)
        self.label, self.chain = label, chain
        self._posture = posture
        built = self._built = Assembly(chain)
        m = len(built.rotary)
        self._rotary = np.array(built.rotary, dtype=bool)
        self._drive = np.zeros((m, built.size))
        self._drive[np.arange(m), built.coordinate] = built.factor
        turns = self._drive[self._rotary].any(axis=0)
        self.unit = np.where(turns, 1.0, chain.characteristic_length)
        x = np.zeros(built.size)
        x[built.passive] = posture
        self._place_joints(built.values(built.stands[None])[0] + self._drive @ x)
        self.end = Site(built.last, built.rigid)
        self.closures = [
            (tuple(map(self._behind_part, closure.parts, closure.frames)), closure) for closure in chain.closures
        ]
        self.point_springs = [
            [
                Site(site.joint, site.frame @ frame(p=point))
                for part, point in zip(spring.parts, spring.points, strict=True)
                for site in [built.carrying(part, point)]
            ]
            for spring in chain.point_springs
        ]

    def _behind_part(self, part: str, transform: Array) -> Site:
        """A frame ``(4, 4)`` on from a part's end, from the world where it has no name."""
        site = self._built.ends[part] if part else Site(-1, np.eye(4))
        return Site(site.joint, site.frame @ transform)

    def _place_joints(self, values: Array) -> None:
        """Frames behind the joints, their axes, and which joints lie before which."""
        built, m = self._built, len(values)
        self._behind = np.empty((m + 1, 4, 4))
        self._behind[0] = np.eye(4)
        self._way = np.zeros((m + 1, m), dtype=bool)
        self._axes = np.zeros((m, 3))
        for j, parent in enumerate(built.parent):
            T = self._behind[parent + 1] @ built.before[j]
            axis = built.axis[j]
            self._behind[j + 1] = T @ (turn(axis, values[j]) if self._rotary[j] else translation(axis * values[j]))
            self._axes[j] = T[:3, :3] @ built.axis[j]
            self._way[j + 1] = self._way[parent + 1]
            self._way[j + 1, j] = True

    def place(self, site: Site) -> Array:
        """Frame ``(4, 4)`` of a site in the world, mm."""
        result: Array = self._behind[site.joint + 1] @ site.frame
        return result

    def jacobian(self, site: Site) -> Array:
        """Shift and turn ``(6, n)`` of a site by the coordinates, world axes."""
        result: Array = self._columns(site) @ self._drive
        return result

    def _columns(self, site: Site) -> Array:
        """Shift and turn ``(6, m)`` of a site by the joints."""
        point, turning = self.place(site)[:3, 3], self._rotary[:, None]
        shifts = np.where(turning, np.cross(self._axes, point - self._behind[1:, :3, 3]), self._axes)
        turns = np.where(turning, self._axes, 0.0)
        result: Array = (np.hstack([shifts, turns]) * self._way[site.joint + 1][:, None]).T
        return result

    def hessian(self, site: Site, wrench: Array) -> Array:
        """Derivative ``(n, n)`` of ``Jᵀ w`` at a constant wrench ``w`` (6,), see `Kinematics.force_hessian`."""
        way = np.flatnonzero(self._way[site.joint + 1])
        columns = self._columns(site)[:, way]
        turning = np.where(self._rotary[way, None], self._axes[way], 0.0)
        linear = np.cross(wrench[:3], turning) @ columns[:3]
        angular = np.cross(wrench[3:], turning) @ turning.T
        H = np.triu(linear, 1).T + np.triu(linear) + np.triu(angular, 1).T
        drive = self._drive[way]
        result: Array = drive.T @ H @ drive
        return result

    def stiffness(self, reactions: Array | None = None) -> Array:
        """Springs' tangent stiffness ``(n, n)`` under reactions ``(n,)``, those between points apart."""
        built = self._built
        K, first = np.zeros((built.size, built.size)), 0
        for spring in built.springs:
            where = np.array(built.elastic[first : first + len(spring.unloaded)])
            first += len(where)
            own = spring.stiffness if reactions is None else spring.tangent(reactions[where])
            K[np.ix_(where, where)] = own
        return K

    def conditions(self) -> Array:
        """Rows ``(c, n)`` of closures and couplings.

        Raises:
            ValueError: one is open in the posture.
        """
        built = self._built
        rows = [np.zeros((0, built.size))]
        for (a, b), closure in self.closures:
            refuse_open(self.label, self.chain, closure, self.place(a), self.place(b))
            rows.append((self.jacobian(b) - self.jacobian(a))[: closure.rows])
        names = [joint.name for joint in self.chain.joints]
        coordinates = dict(zip(names, self._posture.tolist(), strict=True))
        for coupling in self.chain.couplings:
            refuse_uncoupled(self.label, coupling, coordinates)
            row = np.zeros((1, built.size))
            for name, weight in coupling.terms:
                row[0, built.passive[names.index(name)]] += weight
            rows.append(row)
        return np.vstack(rows)

    def stretching(self) -> tuple[Array, Array]:
        """Derivative ``(s, n)`` of the lengths of the springs between points, and their tangent stiffness ``(s,)``.

        Raises:
            ValueError: one bears a force in the posture.
        """
        rows, stiffness = [np.zeros((0, self._built.size))], []
        for spring, (a, b) in zip(self.chain.point_springs, self.point_springs, strict=True):
            way = self.place(b)[:3, 3] - self.place(a)[:3, 3]
            length = float(np.linalg.norm(way))
            refuse_stretched(self.label, self.chain, spring, length)
            rows.append((way / (length or 1.0) @ (self.jacobian(b) - self.jacobian(a))[:3])[None])
            stiffness.append(float(spring.tangent(length)))
        return np.vstack(rows), np.array(stiffness)

    def find(self, part: str, at: float) -> Site:
        """The place of a part at a fraction of its length, of the end-effector where it has no name.

        Raises:
            ValueError: the part has no such point.
        """
        if not part:
            return self.end
        if part in self.chain.ends:
            return self._built.ends[self.chain.ends[part]]
        own = [piece for piece in self._built.pieces if piece.part == part]
        if not own:
            known = ", ".join(dict.fromkeys(piece.part for piece in self._built.pieces))
            raise ValueError(f"{self.chain.name}: no part '{part}' with points on it (there are {known})")
        # of two bodies that meet in a point the further one, as in `vjm.model.mechanism.Mechanism.find`
        for piece in reversed(own):
            if piece.start - NEAR <= at <= piece.stop + NEAR:
                return Site(piece.joint, frame(p=piece.at(at)))
        raise ValueError(f"{self.chain.name}: part '{part}' has points from 0 to 1 of its length, not at {at:g}")

    def machine(self) -> LinearMachine:
        """The machine as a linear one.

        Raises:
            ValueError: a closure, coupling or spring is under stress in the posture.
        """
        rows, stiffness = self.stretching()
        weights: Sequence[tuple[float, Array]] = [
            (piece.mass, self.jacobian(Site(piece.joint, frame(p=piece.centre_of_mass)))[:3])
            for piece in self._built.pieces
            if piece.mass > 0.0
        ]
        return LinearMachine(
            self.chain.name,
            self.chain.characteristic_length,
            self.unit,
            self.stiffness() + (rows.T * stiffness) @ rows,
            self.jacobian(self.end),
            self.conditions(),
            lambda part, at: self.jacobian(self.find(part, at)),
            weights,
        )
