"""The injector's own simulator: as drawn it is the machine that finite elements see; what it adds obeys its law."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_effects.machine import DRIVE, FOOT, LINK, NoTruthError, TrueMachine

from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm_fea.exudyn.engine import ExudynEngine


def ramp(to, steps=8, axis=0):
    poses = np.zeros((steps, 6))
    poses[:, axis] = np.linspace(to / steps, to, steps)
    return poses


def cycle(reach, steps=20):
    s = np.concatenate([np.linspace(0, reach, steps)[1:], np.linspace(reach, -reach, 2 * steps)[1:],
                        np.linspace(-reach, reach, 2 * steps)[1:]])  # fmt: skip
    poses = np.zeros((len(s), 6))
    poses[:, 0] = s
    return poses


@pytest.mark.parametrize(("posture", "to"), [("A", -2.4), ("B", 3.0), ("D", -2.5)])
def test_beams_as_drawn_are_those_of_finite_elements(chain, posture, to):
    path = ExudynEngine(elements=16).trace(chain, LoadCase(posture, to, steps=8))
    wrench = TrueMachine(chain).readings(posture, ramp(to))
    # elements of both in large rotations: second order at 16; 0.2 N is a tenth of the reading's noise
    assert wrench[:, :3] == pytest.approx(path.wrench[1:, :3], abs=0.3)
    assert wrench[:, 3:] == pytest.approx(path.wrench[1:, 3:], abs=2.0)


@pytest.mark.parametrize("posture", ["A", "B", "C", "D"])
def test_a_lumped_foot_follows_law_22(chain, posture):
    to = 0.3 if posture == "C" else 2.5
    path = VjmEngine(16).trace(chain, LoadCase(posture, to, steps=8))
    wrench = TrueMachine(chain, lumped_foot=True).readings(posture, ramp(to))
    assert wrench == pytest.approx(path.wrench[1:], abs=1e-3)


def test_it_buckles_where_the_column_does_and_comes_back(chain):
    there = ramp(-3.6, 12)
    wrench = TrueMachine(chain).readings("A", np.concatenate([there, there[::-1]]))[:, 0]
    path = VjmEngine(16, 16).trace(chain, LoadCase("A", -3.6, steps=12))
    keep = [int(np.argmin(np.abs(path.s - s))) for s in -there[:, 0]]
    assert wrench[:12] == pytest.approx(path.wrench[keep, 0], abs=0.5)
    assert wrench[12:] == pytest.approx(wrench[11::-1], abs=1e-4)


def test_a_history_is_marched_once(chain, monkeypatch):
    there = ramp(-2.0, 6)
    first = TrueMachine(chain, link_factor=1.013).readings("A", there)
    monkeypatch.setattr("hidden_effects.machine.march", None)
    # the very numbers
    assert np.array_equal(TrueMachine(chain, link_factor=1.013).readings("A", there), first)
    with pytest.raises(TypeError, match="not callable"):
        TrueMachine(chain, link_factor=1.014).readings("A", there)


def test_play_is_travel_without_force(chain):
    tight = TrueMachine(chain, lumped_foot=True)
    loose = tight.with_law(DRIVE, play=0.2, play_force=2.0)
    # the drive moves along x: the rest sees the remainder
    pull, push = (loose.readings("A", ramp(to, 1))[0, 0] for to in (0.6, -0.6))
    assert pull == pytest.approx(tight.readings("A", ramp(0.5, 1))[0, 0], rel=1e-9)
    assert push == pytest.approx(tight.readings("A", ramp(-0.5, 1))[0, 0], rel=1e-9)


def test_contact_grows_as_a_power(chain):
    tight = TrueMachine(chain)
    soft = tight.with_law(DRIVE, contact=0.05, contact_power=2 / 3, contact_force=1e-6)
    force = soft.readings("A", ramp(0.5, 4))[:, 0]
    given = 0.05 * (force / 1000.0) ** (2 / 3)
    through = np.zeros((4, 6))
    through[:, 0] = ramp(0.5, 4)[:, 0] - given
    assert tight.readings("A", through)[:, 0] == pytest.approx(force, abs=1e-3)  # contact_force rounds the corner


def test_friction_takes_energy_and_keeps_its_torque(chain):
    slip = np.full((4, 2), [4e6, 800.0])
    poses = cycle(1.0)
    rough = TrueMachine(chain, joints=slip).readings("B", poses)
    smooth = TrueMachine(chain).readings("B", poses)
    work = np.trapezoid(rough[18:, 0], poses[18:, 0])
    assert work > 10.0
    assert abs(np.trapezoid(smooth[18:, 0], poses[18:, 0])) < 1e-3
    turning = 4 * np.pi  # no joint turns as much: work is less than that of all torques over a whole turn
    assert work < 4 * 800.0 * turning


def test_a_set_remains(chain):
    poses = np.concatenate([ramp(1.0), ramp(1.0)[::-1], np.zeros((1, 6))])
    yielding = TrueMachine(chain).with_law(LINK, set=0.05, set_start=2000.0, set_force=1000.0, set_power=1.5)
    force = yielding.readings("A", poses)[:, 0]
    over = (max(force) - 2000.0) / 1000.0
    K0 = -force[-1] / (0.05 * over**1.5)
    assert K0 == pytest.approx(3300, rel=0.05)
    again = yielding.readings("A", np.concatenate([poses, poses]))[:, 0]
    assert again[len(poses) :][7] == pytest.approx(max(force), rel=1e-6)


@pytest.mark.parametrize("part", [FOOT, LINK, DRIVE])
def test_creep_ends_at_the_relaxed_stiffness(chain, part):
    share = 1e-4 if part == DRIVE else 0.2
    creep = np.zeros((4, 2))
    creep[part] = 0.6 * share, 0.4 * share
    creep[3] = 10.0, 60.0
    held = np.zeros((60, 6))
    held[:, 0] = 1.0
    wrench = TrueMachine(chain, creep=creep).readings("B", held, np.linspace(1e-6, 1200.0, 60))
    if part == DRIVE:
        soft = TrueMachine(chain).with_law(DRIVE, linear=share)
    else:
        soft = replace(TrueMachine(chain), **{"foot_factor" if part == FOOT else "link_factor": 1.0 + share})
    assert wrench[0, 0] == pytest.approx(TrueMachine(chain).readings("B", held[:1])[0, 0], rel=1e-4)
    # both middle stages of a step share one late load: of fourth order like the integration
    assert wrench[-1] == pytest.approx(soft.readings("B", held[:1])[0], rel=1e-5, abs=1e-3)
    assert np.all(np.diff(np.abs(wrench[:, 0])) < 1e-4)


def test_weight_hangs_on_the_end_and_the_base(chain):
    heavy = TrueMachine(chain, weight=(3.0, 2.0), down=(0.0, 0.0, -1.0))
    at_rest = heavy.readings("A", np.zeros((1, 6)))[0]
    # half of the bar's weight hangs on the end, what bends the foot aside goes into the bar as a pull
    assert at_rest[2] == pytest.approx(9.80665, rel=0.05)


def test_a_bow_softens_a_column(chain):
    bowed = TrueMachine(chain, bow=np.array([[1.0, 0.1], [0.0, 0.0]]))
    straight = TrueMachine(chain)
    poses = ramp(-2.8, 10)
    loss = (straight.readings("A", poses) - bowed.readings("A", poses))[:, 0]
    assert loss[0] > -50.0
    assert loss[-1] < -500.0
    # the imperfect column's deflection grows as 1/(1 − P/P_cr): no jump, no branch
    assert np.all(np.diff(loss) < 0.0)


def test_it_says_when_it_gives_up(chain):
    with pytest.raises(NoTruthError, match="reading 1 of 1"):
        TrueMachine(chain).readings("A", np.array([[500.0, 0, 0, 0, 0, 0]]))


@pytest.mark.slow
def test_finite_elements_stand_in_for_rods_where_they_can(design):
    from hidden_effects.rig import drawn
    from hidden_effects.truth_models import by_finite_elements

    rig = drawn(design)
    rig = replace(rig, machine=replace(rig.machine, link_factor=1.02, link_longer=0.3, foot_factor=0.97))
    other = by_finite_elements(rig.__class__(rig.machine.with_law(DRIVE, linear=1e-5)))
    rods = replace(rig, machine=rig.machine.with_law(DRIVE, linear=1e-5)).response(design)
    # a tenth of the readings' noise: 2 N
    assert other.response(design).forces == pytest.approx(rods.forces, abs=0.2)
    assert by_finite_elements(replace(rig, tilt=(0.01, 0.0))) is None
    bowed = replace(rig.machine, bow=np.array([[1.0, 0.0], [0.0, 0.0]]))
    assert by_finite_elements(replace(rig, machine=bowed)) is None


def test_a_lumped_link_is_the_sheets_own(design):
    from hidden_effects.truth_models import LumpedRig, as_drawn

    lumped = as_drawn(replace(design, link_segments=1, foot_segments=1, drive=0.0))
    assert isinstance(lumped, LumpedRig)
    path = VjmEngine().trace(lumped.machine.chain, LoadCase("B", 2.5, steps=8))
    wrench = lumped.response(replace(design, link_segments=1, foot_segments=1, drive=0.0)).forces
    here = int(np.argmax(np.concatenate([s.ux for s in design.sequences])))
    assert wrench[here, 0] == pytest.approx(path.wrench[-1, 0], rel=1e-6)
