"""Springs between points that are fixed to beams: they go where the cross-section goes at which they are fixed."""

from dataclasses import replace

import numpy as np
import pytest

import vjm
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, PointSpring, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector

LENGTH, COMPLIANCE, EI, STIFFNESS = 1000.0, 1e-9, 1e9, 100.0
SECTION = Section(EA=1e8, GJ=1e9, EIy=EI, EIz=EI)
FORCE = 0.1
DOWN = (0.0, 0.0, -FORCE, 0.0, 0.0, 0.0)


def lever(*beams, springs=()) -> Machine:
    """A hinge about y and beams along x, in a posture p."""
    parts = (Joint("q", AXES["y"], compliance=COMPLIANCE), *beams)
    return Machine("lever", parts, postures={"p": np.zeros(0)}, held={"p": {"q": 0.0}}, point_springs=springs)


def hanger(part: str, point, at: float) -> PointSpring:
    """A spring from straight above, a long way up so that its direction stays; without force as drawn."""
    up = np.array([at, 0.0, 1e5])
    point = np.array(point, dtype=float)
    height = float(np.linalg.norm(up - [at, *point[1:]]))
    return PointSpring("hanger", ("", part), np.array([up, point]), STIFFNESS, height)


def compliance(a: float, b: float) -> float:
    """Deflection at ``a`` by a unit force at ``b``: hinge and cantilever, Euler and Bernoulli."""
    a, b = min(a, b), max(a, b)
    return COMPLIANCE * a * b + a**2 * (3 * b - a) / (6 * EI)


@pytest.mark.parametrize(("engine", "at", "tolerance"), [
    # the remainder is of second order: the beam's turn of 4e-5 squared
    *((engine, at, 1e-7) for engine in ("vjm", "vjm-8") for at in (250.0, 500.0, 1000.0)),
    ("vjm-paper", 1000.0, 1e-7),
    # between nodes a rigid half is up to M h²/8 EI off the curved segment: 9e-4 was measured
    ("vjm", 300.0, 2e-3),
])  # fmt: skip
def test_a_spring_bears_what_the_beam_there_gives(engine: str, at: float, tolerance: float):
    """With the spring's force R: ``R = k w(a)``, ``w = (F − R)``'s superposition of cantilevers."""
    chain = lever(Beam("b", LENGTH, section=SECTION), springs=(hanger("b", [at, 0.0, 0.0], at),))
    R = STIFFNESS * FORCE * compliance(at, LENGTH) / (1.0 + STIFFNESS * compliance(at, at))
    expected = -(FORCE * compliance(LENGTH, LENGTH) - R * compliance(at, LENGTH))
    found = vjm.stiffness(chain, "p", wrench=DOWN, engine=engine).displacement
    assert found[2] == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("at", [0.25, 0.5])
def test_a_point_beside_the_beam_goes_with_its_cross_section(at: float):
    """As a link between two beams of half the springs carries it: the same mechanism, part by part."""
    own = rotation_from_vector([0.2, -0.4, 0.3])
    side = np.array([0.0, 40.0, -25.0])
    anchor = np.array([700.0, 300.0, 900.0])
    place = own @ (np.array([at * LENGTH, 0.0, 0.0]) + side)
    whole = lever(Beam("b", LENGTH, own_frame=own, section=SECTION), springs=(
        PointSpring("s", ("", "b"), np.array([anchor, place]), 50.0, 400.0, 30.0),
    ))  # fmt: skip
    first = Beam("b1", at * LENGTH, own_frame=own, section=SECTION)
    second = Beam("b2", (1.0 - at) * LENGTH, own_frame=own, section=SECTION)
    parts = lever(first, RigidOffset("between", np.eye(4)), second, springs=(
        PointSpring("s", ("", "between"), np.array([anchor, own @ side]), 50.0, 400.0, 30.0),
    ))  # fmt: skip
    n = {0.25: (4, 12), 0.5: (8, 8)}[at]
    wrench = (30.0, -20.0, -60.0, 1e4, 0.0, 5e3)
    expected = vjm.stiffness(parts, "p", wrench=wrench, engine=f"vjm-16[b1={n[0]},b2={n[1]}]")
    found = vjm.stiffness(whole, "p", wrench=wrench, engine="vjm-16")
    assert np.abs(expected.displacement[:3]).max() > 1.0
    # two solutions of one set of equations to rounding, 2e-11 was measured
    assert found.displacement == pytest.approx(expected.displacement, rel=1e-9, abs=1e-12)
    assert found.loaded == pytest.approx(expected.loaded, rel=1e-8, abs=1e-8 * np.abs(expected.loaded).max())


def test_paths_take_it_as_equilibria_do():
    chain = lever(Beam("b", LENGTH, section=SECTION), springs=(hanger("b", [500.0, 0.0, 0.0], 500.0),))
    case = LoadCase("p", 1.0, "load", loads=(Load(DOWN),), free=COMPONENTS, steps=2)
    point = vjm.trace(chain, case).points[-1]
    single = vjm.stiffness(chain, "p", wrench=DOWN)
    # the path solves for the pose of a support, 2e-11 mm off
    assert point.displacement == pytest.approx(single.displacement, rel=1e-7, abs=1e-9)
    # and K^F of the free end is that of the end-effector, not of a support that holds nothing
    assert point.stiffness == pytest.approx(single.loaded, rel=1e-7, abs=1e-9 * np.abs(single.loaded).max())


def test_before_the_root_and_behind_the_end():
    """Before the root it goes with the root, behind the end with the tip as a link there does."""
    beam = Beam("b", LENGTH, section=SECTION)
    ahead = lever(beam, springs=(hanger("b", [1200.0, 0.0, 0.0], 1200.0),))
    link = lever(beam, RigidOffset("l", np.eye(4)), springs=(hanger("l", [200.0, 0.0, 0.0], 1200.0),))
    behind = lever(beam, springs=(hanger("b", [-100.0, 0.0, 0.0], -100.0),))
    root = lever(RigidOffset("l", np.eye(4)), beam, springs=(hanger("l", [-100.0, 0.0, 0.0], -100.0),))
    for one, other in ((ahead, link), (behind, root)):
        a, b = (vjm.stiffness(chain, "p", wrench=DOWN).displacement for chain in (one, other))
        assert a == pytest.approx(b, rel=1e-9, abs=1e-13)


def test_where_a_beam_has_no_shape_it_is_refused():
    chain = lever(Beam("b", LENGTH, section=SECTION), springs=(hanger("b", [400.0, 0.0, 0.0], 400.0),))
    with pytest.raises(
        ValueError, match=r"spring 'hanger': it is fixed at 0.4 of the length of part 'b', which is one"
    ):
        vjm.stiffness(chain, "p", wrench=DOWN, engine="vjm-paper")
    with pytest.raises(ValueError, match="part 'b' comes out of its root"):
        lever(
            Joint("out", AXES["x"], slides=True), Beam("b", LENGTH, section=SECTION, free_length="out"),
            springs=(hanger("b", [400.0, 0.0, 0.0], 400.0),),
        )  # fmt: skip


def test_the_frame_of_a_turned_part_counts():
    """The same machine seen from another base."""
    T = frame(rotation_from_vector([0.4, 0.2, -0.7]), [10.0, -20.0, 30.0])
    spring = hanger("b", [250.0, 10.0, 5.0], 250.0)
    chain = lever(Beam("b", LENGTH, section=SECTION), springs=(spring,))
    there = T[:3, :3] @ spring.points[0] + T[:3, 3]
    turned = replace(chain, base=T, point_springs=(replace(spring, points=np.array([there, spring.points[1]])),))
    R = np.kron(np.eye(2), T[:3, :3])
    found = vjm.stiffness(turned, "p", wrench=tuple(R @ DOWN)).displacement
    assert R.T @ found == pytest.approx(vjm.stiffness(chain, "p", wrench=DOWN).displacement, rel=1e-8, abs=1e-12)
