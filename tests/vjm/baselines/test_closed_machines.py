"""Linear models of machines with branches and closed loops, against the energy and against one another."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.closed_machines import MACHINES, apart, four_bar, palletiser, truth, two_legs, y_tree

from vjm.baselines import LinearEngine, MsaEngine
from vjm.limits import LIMITS
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.parts import Coupling

ENGINES = [LinearEngine(), MsaEngine()]


def by_label(engine):
    return engine.label


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("engine", ENGINES, ids=by_label)
@pytest.mark.parametrize("name", MACHINES)
def test_stiffness_is_that_of_the_energy(engine, name):
    chain = MACHINES[name]()
    found = engine.trace(chain, LoadCase("p", 1e-6, steps=1)).points[0].stiffness
    # second derivatives of the energy by differences: rounding over their step
    assert apart(found, truth(chain)) < 1e-9


def loads(engine, chain, load_case):
    return engine.trace(chain, load_case).points[-1]


@pytest.mark.parametrize("name", MACHINES)
def test_loads_on_parts_and_weight_move_both_models_alike(name):
    chain = MACHINES[name]()
    last = chain.beams[-1].name
    load_case = LoadCase(
        "p", 0.5, "load", free=COMPONENTS, gravity=(1.0, -2.0, -9.81),
        loads=(Load((3.0, -4.0, 5.0, 200.0, -100.0, 50.0)), Load((2.0, 1.0, -3.0, 0.0, 0.0, 0.0), last, 1.0)),
    )  # fmt: skip
    # a beam of one spring has its whole weight on its root, elements on their nodes: as many springs as
    # show the difference by the square of their number
    exact = loads(MsaEngine(), chain, load_case).displacement
    coarse, fine = (loads(LinearEngine(), chain.refined(n), load_case).displacement for n in (4, 8))
    size = np.abs(exact).reshape(2, 3).max(axis=1).repeat(3)
    assert np.abs((coarse - exact) / size).max() < 1e-2
    assert np.abs((fine - exact) / size).max() < 0.3 * np.abs((coarse - exact) / size).max() + 1e-9


@pytest.mark.parametrize("engine", ENGINES, ids=by_label)
@pytest.mark.parametrize("make", [y_tree, four_bar, two_legs])
def test_pose_and_wrench_go_both_ways(engine, make):
    """The wrench that an imposed pose takes brings the free end-effector to that pose."""
    chain = make()
    pose = LoadCase("p", 0.1, (0.3, -0.2, 0.5, 1e-3, 2e-3, -1e-3), steps=1)
    held = engine.trace(chain, pose).points[-1]
    assert held.wrench == pytest.approx(held.stiffness @ held.displacement, rel=1e-12)
    free = LoadCase("p", 1.0, "load", free=COMPONENTS, loads=(Load(tuple(held.wrench)),), steps=1)
    moved = engine.trace(chain, free).points[-1]
    assert moved.displacement == pytest.approx(held.displacement, rel=1e-8, abs=1e-12)


def test_a_component_that_is_free_bears_nothing():
    for engine in ENGINES:
        point = engine.trace(four_bar(), LoadCase("p", 0.1, "x", free=("ry", "z"), steps=1)).points[-1]
        assert np.abs(point.wrench[[2, 4]]).max() == 0.0
        assert point.stiffness[0, 0] == pytest.approx(point.wrench[0] / 0.1, rel=1e-10)
        assert point.displacement[2] != 0.0


def test_a_rigid_parallelogram_keeps_its_head_level():
    """The arm gives way about its own axis, and the head is carried along without a turn."""
    push = Load((50.0, 0.0, 0.0, 0.0, 0.0, 0.0), "head")
    load_case = LoadCase("p", 1.0, "load", free=COMPONENTS, loads=(push,))
    point = MsaEngine().trace(palletiser(), load_case).points[-1]
    assert np.abs(point.displacement[3:]).max() < 1e-12
    # the load's moment about the drive, over its stiffness, times the arm
    turned = 50.0 * 400.0 * np.cos(0.4) * 2e-8
    assert point.displacement[:3] == pytest.approx(
        [400.0 * np.cos(0.4) * turned, 0.0, -400.0 * np.sin(0.4) * turned], rel=1e-10, abs=1e-14
    )


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ENGINES, ids=by_label)
def test_stress_in_the_posture_is_refused(engine):
    chain, load_case = four_bar(), LoadCase("p", 1e-6, steps=1)
    open_loop = replace(chain, postures={"p": chain.postures["p"] + 1e-4})
    with pytest.raises(ValueError, match=r"closure 'pivot', open by .* in this posture"):
        engine.trace(open_loop, load_case)
    off = replace(MACHINES["coupled"](), couplings=(Coupling("belt", (("shoulder", 1.0),), 0.4),))
    with pytest.raises(ValueError, match=r"coupling 'belt', off its total by 0\.1"):
        engine.trace(off, load_case)
    bridged = MACHINES["bridged_tree"]()
    tight = replace(bridged.point_springs[0], preload=20.0)
    with pytest.raises(ValueError, match="spring 'bridge', which bears 20 N"):
        engine.trace(replace(bridged, point_springs=(tight,)), load_case)


def test_every_limit_says_why_and_what_takes_it():
    assert set(LIMITS) == {"vjm-linear", "msa", "exudyn", "exudyn-footspring", "opensees"}
    for engine, limits in LIMITS.items():
        for limit in limits:
            line = str(limit.refusal(engine, "part 'a'"))
            assert line == f"part 'a': {engine} does not take {limit.what}: {limit.why}; {limit.remedy}"
            assert min(len(limit.what), len(limit.why), len(limit.remedy)) > 10
