"""How beams become springs in batches over postures: as engine ``vjm`` splits them, by one rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vjm
from vjm.machine.equilibria import equilibria
from vjm.model.machine import USUAL_SEGMENTS, Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

LENGTH, EI = 1000.0, 1e9
SECTION = Section(EA=1e9, GJ=1e9, EIy=EI, EIz=EI)


def arm(**changes) -> Machine:
    parts = (
        Joint("q", AXES["y"]),
        Beam("upper", 0.5 * LENGTH, section=SECTION),
        Beam("fore", 0.5 * LENGTH, section=SECTION),
    )
    chain = Machine("arm", parts, postures={"p": np.zeros(0)}, held={"p": {"q": 0.0}})
    return replace(chain, **changes)


def test_a_moment_bends_the_arm_to_an_arc():
    """``κ = M/EI`` all along: the tip at ``(sin φ, 1 − cos φ) L/φ``. One spring a beam is 4 % off."""
    phi = 0.9
    moment = np.array([0.0, 0.0, 0.0, 0.0, -phi * EI / LENGTH, 0.0])
    exact = LENGTH * np.array([np.sin(phi) / phi - 1.0, 0.0, (1.0 - np.cos(phi)) / phi])
    found, single = (
        equilibria(Mechanism(arm().split() if split else arm()), np.zeros(1), wrench=moment).deflection[0, 0, :3]
        for split in (True, False)
    )
    # of the springs' second order in h: φ²/(24 · 32²), 3e-5
    assert np.abs(found - exact).max() < 1e-4 * np.abs(exact).max()
    assert np.abs(single - exact).max() > 0.02 * np.abs(exact).max()


def own_number(chain: Machine) -> Machine:
    parts = tuple(replace(part, own_segments=5) if part.name == "fore" else part for part in chain.parts)
    return replace(chain, parts=parts)


@pytest.mark.parametrize(("chain", "numbers"), [
    (arm(), (USUAL_SEGMENTS, USUAL_SEGMENTS)),
    (arm(link_segments=3), (3, 3)),
    (arm(link_segments=1), (None, None)),
    (own_number(arm(link_segments=3)), (3, 5)),
    (own_number(arm()), (USUAL_SEGMENTS, 5)),
    (arm().refined({"upper": 2}), (2, USUAL_SEGMENTS)),
])  # fmt: skip
def test_batches_and_the_engine_split_alike(chain: Machine, numbers):
    model = Mechanism(chain.split())
    assert tuple(beam.segments for beam in model.chain.beams) == numbers
    wrench = (0.0, 50.0, -300.0, 1e4, 0.0, 0.0)
    batch = equilibria(model, model.posture("p"), wrench=np.array(wrench)).deflection[0, 0]
    if chain.beams[0].segments is None:
        assert batch == pytest.approx(vjm.stiffness(chain, "p", wrench=wrench).displacement, rel=1e-12)


def test_a_beam_without_a_section_stays_the_spring_that_is_given():
    bar = Beam("bar", 300.0, compliance=np.diag([1e-6, 1e-4, 1e-4, 1e-8, 1e-8, 1e-8]))
    model = Mechanism(Machine("matrix", (Joint("q", AXES["y"]), bar)).split())
    assert model.chain.beams[0].segments is None
    assert model.size == 6
