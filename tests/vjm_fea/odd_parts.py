"""Parts of every kind, turned at random, for chains that nothing is along an axis of."""

import numpy as np
import pytest

from vjm.continuation.path import StationLabel
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, RigidOffset, Section
from vjm.rotations import frame, rotation_from_vector

ARM = np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])
"""Wrench and stiffness in units of 300 mm, so that forces and moments weigh the same."""


def agrees_with_springs(engine, chain, linear_stiffness, within):
    """Finite elements, three a beam, have the lumped model's unloaded stiffness and stations."""
    problem = engine.problem(chain, LoadCase("P", 1.0))
    unloaded = problem.unloaded()
    names = [beam.name for beam in chain.beams]
    reference = linear_stiffness(chain.refined(dict.fromkeys(names, 1)), chain.posture("P"))
    scaled = (unloaded.stiffness - reference) / np.outer(ARM, ARM)
    assert scaled == pytest.approx(0.0, abs=within * np.max(np.abs(reference / np.outer(ARM, ARM))))

    model = Mechanism(chain.refined(dict.fromkeys(names, 3)))
    assert problem.stations == tuple(StationLabel(s.part, s.fraction) for s in model.stations)
    lumped_shape = model.shape(model.kinematics(model.configuration(chain.posture("P"))))
    # the same products of frames, to rounding of some hundred mm
    assert unloaded.shape == pytest.approx(lumped_shape, abs=1e-10)
    assert unloaded.wrench / ARM == pytest.approx(0.0, abs=1e-9)


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
