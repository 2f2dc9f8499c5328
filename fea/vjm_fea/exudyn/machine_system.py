"""A machine in a posture as a system of Exudyn: a tree of parts, its loops closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vjm.model.closures import Closure, Coupling
from vjm.model.joints import Joint, PointSpring
from vjm.model.machine import Machine
from vjm.model.parts import Part
from vjm.rotations import Array, frame
from vjm_fea.common.mesh import Mesh
from vjm_fea.common.points import NEAR, NO_POINTS, Place, spring_points
from vjm_fea.exudyn.backend import items
from vjm_fea.exudyn.bodies import Rigid, between
from vjm_fea.exudyn.joint_kinds import axes_with, crossing
from vjm_fea.exudyn.matrix_spring import LinearConstraint, RelativeMotion
from vjm_fea.exudyn.system import ExudynSystem

WELD, BALL = (1, 1, 1, 1, 1, 1), (1, 1, 1, 0, 0, 0)
CLOSED = 1e-7
"""mm and rad that two welded frames may be apart and still be one: what iteration of a posture leaves. More is an
error of assembly, which a joint pulls shut."""


class ExudynMachineSystem(ExudynSystem):
    """The assembled system of a tree of parts, its closures, couplings and springs between points.

    A weld makes one rigid piece of two. A ball joint, and a weld that the posture leaves open, are joints of
    Exudyn.
    """

    def __init__(
        self,
        chain: Machine,
        q: Array,
        mesh: Mesh,
        points: Mapping[str, tuple[float, ...]] = NO_POINTS,
        end_condition: Sequence[Joint] = (),
        nominal_end: Array | None = None,
    ) -> None:
        """Assemble a machine.

        Args:
            chain: the machine, its held joints at coordinates.
            q: its passive joints' coordinates.
            mesh: of its beams.
            points: fractions of its beams at which there has to be a node, by name.
            end_condition: joints between the end-effector and the support, see `vjm.model.end_condition`.
            nominal_end: frame ``(4, 4)`` of the end-effector as designed, where errors of assembly move it.

        Raises:
            ValueError: a beam without a section, or another number of joints.
        """
        if len(q) != len(chain.joints):
            raise ValueError(
                f"{chain.name}: {len(chain.joints)} passive joints but {len(q)} coordinates in the posture"
            )
        self._begin(mesh)
        self._marked = spring_points(chain)
        self._points = {
            part: tuple(sorted({*points.get(part, ()), *self._marked.get(part, ())}))
            for part in {*points, *self._marked}
        }
        self._beams = {beam.name: beam for beam in chain.beams}
        self._end_frames = dict(chain.ends)
        self._coupled = {name for coupling in chain.couplings for name, _ in coupling.terms}
        self._passive: dict[str, tuple[RelativeMotion, int]] = {}
        values = dict(zip((joint.name for joint in chain.joints), np.asarray(q, dtype=float).tolist(), strict=True))
        self._begins: dict[str, tuple[Array, Rigid]] = {"": (np.eye(4), self._ground)}
        self._ends: dict[str, tuple[Array, Rigid]] = {"": (np.eye(4), self._ground)}
        self._string(chain, values)
        for spring in chain.point_springs:
            self._add_point_spring(spring)
        for closure in chain.closures:
            self._close(closure)
        for coupling in chain.couplings:
            self._couple(coupling, values)
        if nominal_end is not None:
            self._draw_to(nominal_end)
        self._finish(chain.name, end_condition)

    def _draw_to(self, place: Array) -> None:
        """Go on behind the last part at another place, to which a joint draws it."""
        drawn = self._marker(self._at(), self._frame)
        T = frame(p=place[:3, 3])
        self._frame, self._rigid = place, self._carrier(self._node(T), T)
        self._joint(drawn, self._marker(self._rigid, place), WELD)

    def _string(self, chain: Machine, values: Mapping[str, float]) -> None:
        """The parts, each behind the one that it follows."""
        self._frame, self._rigid = chain.base, self._ground
        seen_again = {*chain.after.values(), *chain.ends.values()}
        seen_again |= {name for closure in chain.closures for name in closure.parts}
        fixed = {name for spring in chain.point_springs for name in spring.parts}
        parts, last = list(chain.parts), ""
        while parts:
            part = parts.pop(0)
            where = chain.after.get(part.name, last)
            if where != last:
                self._at()
                self._frame, self._rigid = self._ends[where] if where else (chain.base, self._ground)
            if part.name in fixed:
                self._begins[part.name] = (self._frame, self._at())
            behind = parts[0] if parts else None
            if self._universal(part, behind, {*seen_again, *fixed}, chain.after):
                assert isinstance(part, Joint)
                assert isinstance(behind, Joint)
                self._add_universal(part, values[part.name], behind, values[behind.name])
                part = parts.pop(0)
            elif isinstance(part, Joint) and part.free:
                self._add_passive(part, values[part.name])
            else:
                self._add(part)
            if part.name in seen_again:
                self._ends[part.name] = (self._frame, self._at())
            if part.name in fixed and isinstance(part, Joint) and not part.fixed:
                # what is fixed to a joint is fixed behind it
                self._begins[part.name] = (self._frame, self._at())
            last = part.name

    def _universal(self, part: Part, behind: Part | None, apart: set[str], after: Mapping[str, str]) -> bool:
        """Whether two joints in a row make a universal joint, between which nothing else is held."""
        return (
            isinstance(part, Joint)
            and isinstance(behind, Joint)
            and part.free
            and behind.free
            and not {part.name, behind.name} & (self._coupled | (apart - {behind.name}))
            and behind.name not in after
            and crossing(part, behind)
        )

    def _add_passive(self, joint: Joint, value: float) -> None:
        before = self._at()
        self._add_joint(joint, value)
        if joint.name not in self._coupled:
            return
        column = 0 if joint.slides else 2
        there = self._frame @ frame(axes_with(joint.axis, column))
        motion = RelativeMotion(*between(before, self._at(), there))
        self._passive[joint.name] = motion, column if joint.slides else 3 + column

    # --- what closes loops --------------------------------------------------------------------------------

    def _close(self, closure: Closure) -> None:
        (first, a), (second, b) = (
            (self._ends[part][0] @ T, self._ends[part][1]) if part else (T, self._ground)
            for part, T in zip(closure.parts, closure.frames, strict=True)
        )
        if not closure.turns and np.abs(first - second).max() < CLOSED:
            self._locked.append((a.node, b.node))
            return
        markers = self._marker(a, first), self._marker(b, second)
        self._joint(*markers, BALL if closure.turns else WELD)

    def _couple(self, coupling: Coupling, values: Mapping[str, float]) -> None:
        terms = tuple((*self._passive[name], weight) for name, weight in coupling.terms)
        off = sum(weight * values[name] for name, weight in coupling.terms) - coupling.total
        self.constraints.append(LinearConstraint(terms, off))

    def _add_point_spring(self, spring: PointSpring) -> None:
        places, markers = [], []
        for part, point in zip(spring.parts, spring.points, strict=True):
            T, rigid = self._begins[part]
            if part in self._beams:
                fraction = self._beams[part].fraction_of(point)
                sections = ((at, r) for (name, at), r in self._sections.items() if name == part)
                rigid = next(r for at, r in sections if abs(at - fraction) < NEAR)
            places.append(T[:3, :3] @ point + T[:3, 3])
            markers.append(self._marker(rigid, frame(p=places[-1])))
        length = float(np.linalg.norm(places[1] - places[0]))
        # Exudyn's law about the present length, so that a free length of zero is one like any other
        pull = spring.stiffness * (length - spring.free_length) + spring.preload
        self.assembly.rigid(
            items.SpringDamper(
                markerNumbers=markers, referenceLength=length, stiffness=spring.stiffness, force=pull
            )
        )

    def find(self, part: str, at: float) -> Place:
        """See `ExudynSystem.find`; an end frame by its name."""
        if part in self._end_frames:
            T, rigid = self._ends[self._end_frames[part]]
            return Place(self._leader(rigid.node), T[:3, 3])
        return super().find(part, at)
