"""How a tree of parts becomes one-degree joints between rigid links, its held joints among them.

Held joints stay joints here, for their coordinates change from posture to posture. So the arrays are made once.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import GROWS
from vjm.model.assembly import Assembly, Piece
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam
from vjm.model.springs import BeamColumnSpring, LinearSpring
from vjm.rotations import Array, frame, translation

GROWING_SEGMENTS = 4
"""Of a beam that grows out of its root, where its model file asks for no other number."""


class TreeAssembly(Assembly):
    """The same with held joints that stand at coordinates of their own.

    Attributes:
        held: name of the part that gives a joint its coordinate, by the index of the joint.
        share: of that coordinate that the joint stands at, where it is not the whole.
        grows: joint that gives a beam-column spring its length, by the spring's first coordinate.
        rests: coordinates of sprung joints with a rest position of their own: the part's name and that position.
    """

    def __init__(self, chain: Machine) -> None:
        self.held: dict[int, str] = {}
        self.share: dict[int, float] = {}
        self.grows: dict[int, int] = {}
        self._pushing = chain.pushing
        self.rests: dict[int, tuple[str, float]] = {}
        super().__init__(chain)

    def _stand(self, name: str, axis: Array, *, rotary: bool) -> None:
        self._joint(axis, -1, 0.0, rotary=rotary)
        self.held[self._last] = name

    def _hold(self, joint: Joint) -> None:
        self._mark(joint.name, 0.0)
        self._piece(joint.name, 0.0, 0.0, np.zeros(3))
        if joint.name not in self._pushing:
            self._stand(joint.name, joint.axis, rotary=not joint.slides)

    def _add_passive(self, joint: Joint) -> None:
        self._stand(joint.name, joint.axis, rotary=not joint.slides)
        self._own[joint.name] = self.size
        super()._add_passive(joint)

    def _own_spring(self, joint: Joint) -> None:
        if self._last < 0 or self.held.get(self._last) != joint.name:
            super()._own_spring(joint)
            return
        # nothing lies between the coordinate that it stands at and its spring: they are one joint
        self._own[joint.name] = self.coordinate[self._last] = self.size
        self.factor[self._last] = 1.0
        self.springs.append(LinearSpring(np.array([[joint.compliance]])))
        self.size += 1

    def _stress(self, joint: Joint) -> None:
        if joint.rest is None:
            super()._stress(joint)
        else:
            self.rests[self.size - 1] = (joint.name, joint.rest)

    def _add_beam(self, beam: Beam) -> None:
        if not beam.free_length:
            super()._add_beam(beam)
            return
        n, x = beam.own_segments or GROWING_SEGMENTS, np.array([1.0, 0.0, 0.0])
        section = beam.effective_section()
        self._move(beam.section_in_chain)
        self._mark(beam.name, 0.0)

        def slide(share: float, mass: float) -> None:
            self._stand(beam.free_length, x, rotary=False)
            self.share[self._last] = share / n
            if mass:
                self._weigh(beam.name, mass)

        self._piece(beam.name, 0.0, 0.0, np.zeros(3))
        for _ in range(n):
            # the halves' weights act at a third of their length from the segment's ends, as in a beam that stays:
            # the first joint's value is a third of a half, the third one's that of the whole
            slide(0.5 - 1.0 / GROWS, section.mass)
            slide(1.0 / GROWS, 0.0)
            self.grows[self.size] = self._last
            self._symmetric_spring(BeamColumnSpring(section, 1.0))
            slide(1.0 / GROWS, 0.5 * section.mass)
            slide(0.5 - 1.0 / GROWS, 0.0)
        self._piece(beam.name, 1.0, 1.0, np.zeros(3))
        self._mark(beam.name, 1.0)
        self._move(frame(beam.section_frame.T) @ translation(beam.end_offset))
        self._move(frame(beam.own_frame).T)

    def _weigh(self, part: str, mass: float) -> None:
        """A weight, kg for each mm of which the last joint's value is a third; no fraction finds it."""
        nowhere, here = float("nan"), np.zeros(3)
        piece = Piece(part, nowhere, nowhere, self._last, here, here, mass, weight_at=here, grows=self._last)
        self.pieces.append(piece)


def commands(
    chain: Machine, names: list[str], held: dict[int, str], share: dict[int, float], joints: int
) -> tuple[Array, Array]:
    """How the joints' values follow from the coordinates that the data give.

    Args:
        chain: the machine.
        names: of the n joints whose coordinates the data give.
        held: part by joint, and
        share: of its coordinate, see `TreeAssembly`.
        joints: number of one-degree joints m.

    Returns:
        ``(m, n)`` and ``(m,)``: values are ``C q + c``.
    """
    rows: dict[str, tuple[Array, float]] = {name: (np.eye(len(names))[i], 0.0) for i, name in enumerate(names)}
    for joint in chain.moving:
        if (coupling := joint.coupling) is not None:
            row = coupling.summed({name: share for name, (share, _) in rows.items()})
            rows[joint.name] = row, coupling.value({name: offset for name, (_, offset) in rows.items()})
    C, c = np.zeros((joints, len(names))), np.zeros(joints)
    for i, name in held.items():
        C[i], c[i] = (share.get(i, 1.0) * value for value in rows[name])
    return C, c
