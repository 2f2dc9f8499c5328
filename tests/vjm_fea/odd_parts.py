"""Parts of every kind, turned at random, for chains that nothing is along an axis of."""

import numpy as np

from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset, Section
from vjm.rotations import frame, rotation_from_vector


class OddParts:
    """A source of parts; the same seed and the same order of calls give the same ones."""

    def __init__(self, seed: int, section: Section) -> None:
        self.rng, self.section = np.random.default_rng(seed), section

    def unit(self):
        v = self.rng.normal(size=3)
        return v / np.linalg.norm(v)

    def rotation(self):
        return rotation_from_vector(0.5 * self.rng.normal(size=3))

    def offset(self, name):
        return RigidOffset(name, frame(self.rotation(), 50.0 * self.rng.normal(size=3)))

    def beam(self, name):
        arm = 30.0 * self.rng.normal(size=3)
        own, section = self.rotation(), self.rotation()
        return Beam(name, 200.0, own_frame=own, section_frame=section, end_offset=arm, section=self.section)

    def chain(self, parts):
        base = frame(self.rotation(), [10.0, 20.0, 30.0])
        return Machine("odd", parts, base=base, postures={"P": 0.4 * self.rng.normal(size=4)})
