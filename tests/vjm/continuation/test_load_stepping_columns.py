"""Columns alone: closed forms, round bars whose two modes buckle together, single springs, and no joints at all."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

EA = 1e6
EULER = 1000.0
"""π²EI/L², N, of every column here; 100 mm long, shear-rigid."""
EI = EULER * 100.0**2 / np.pi**2


def critical_load(euler):
    """P of P (1 − P/EA) = P_E: an extensible, shear-rigid column buckles on its shortened arc."""
    return 0.5 * EA * (1.0 - np.sqrt(1.0 - 4.0 * euler / EA))


def universal_column(EIy):
    """A column on universal joints, y and z at both ends."""
    joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip("abcd", "yzzy", strict=True)]
    beam = Beam("link", 100.0, section=Section(EA, EI, EIy, EI))
    return Machine("column", (*joints[:2], beam, *joints[2:]), postures={"straight": np.zeros(4)})


def clamped_column(EIy):
    beam = Beam("link", 100.0, section=Section(EA, EI, EIy, EI))
    return Machine("clamped", (beam,), postures={"straight": np.zeros(0)})


def test_pinned_column_alone_buckles_at_the_closed_form(column):
    path = VjmEngine(16).trace(column, LoadCase("straight", -0.2))
    # tenth order (docs/virtual-springs.md): sixteen springs err by 3e-11
    assert path.critical.force == pytest.approx(critical_load(EULER), rel=6e-10)
    # before buckling a bar, EA/L; just behind, the elastica's F = P_E (1 + δ/2L) in series with the bar
    assert path.tangent[0] == pytest.approx(EA / 100.0, rel=1e-10)
    assert path.critical.stiffness_after == pytest.approx(1.0 / (100.0 / EA + 200.0 / EULER), rel=0.02)


def test_clamped_column_buckles_at_four_times_the_pinned_load():
    # two half-waves, clamped: the pinned column's error with half the springs, and fourth order again
    error = []
    n = np.array([8, 16, 32])
    for segments in n:
        engine = VjmEngine(int(segments), placement="two-thirds")
        path = engine.trace(clamped_column(20.0 * EI), LoadCase("straight", -0.6))
        assert path.critical.kind is EventKind.BIFURCATION
        error.append(critical_load(4.0 * EULER) - path.critical.force)
    assert error[-1] < 3e-5 * 4.0 * EULER
    assert -np.polyfit(np.log(n), np.log(error), 1)[0] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("to", [-1.0, -10.0, -40.0])
def test_a_critical_load_is_located_as_well_on_a_long_path(to):
    # each is located to 1e-9 of itself; of 40 mm that would be 1e-7 of the 0.4 mm at which it buckles
    short, long = (VjmEngine(8).trace(clamped_column(20.0 * EI), LoadCase("straight", end)) for end in (-0.6, to))
    assert long.critical.s == pytest.approx(short.critical.s, rel=2e-9)


def test_clamped_column_of_eight_beam_column_springs_is_within_a_hundredth_of_a_per_cent():
    path = VjmEngine(8).trace(clamped_column(20.0 * EI), LoadCase("straight", -0.6))
    # half a wave on four springs, as the pinned column with four: some 3e-5
    assert path.critical.force == pytest.approx(critical_load(4.0 * EULER), rel=1e-4)


@pytest.mark.parametrize("placement", ["end", "middle", "two-thirds", "best"])
@pytest.mark.parametrize("segments", [2, 3, 4, 5, 8])
def test_round_bar_buckles_in_two_modes_at_once(segments, placement):
    """The bowed round bar turns freely about its chord: its branch has a neutral mode and is not unstable."""
    engine = VjmEngine(segments, placement=placement)
    round_bar = engine.trace(universal_column(EI), LoadCase("straight", -1.0))
    flat_bar = engine.trace(universal_column(2.0 * EI), LoadCase("straight", -1.0))
    assert (round_bar.critical.multiplicity, flat_bar.critical.multiplicity) == (2, 1)
    # the same mode: located to 1e-9 of 1 mm at 0.1 mm
    assert round_bar.critical.force == pytest.approx(flat_bar.critical.force, rel=1e-10)
    assert round_bar.complete, round_bar.stopped
    assert flat_bar.complete, flat_bar.stopped
    # the error measured is rounding alone
    assert round_bar.force[-1] == pytest.approx(flat_bar.force[-1], rel=1e-10)


@pytest.mark.parametrize("placement", ["end", "middle", "two-thirds", "best"])
@pytest.mark.parametrize("to", [-1.0, -8.0, 8.0])
def test_one_spring_a_column_ends_in_a_path_and_not_in_an_error(placement, to):
    """One spring between four joints leaves exactly singular systems: they are said, or passed, not raised."""
    path = VjmEngine(1, placement=placement).trace(universal_column(2.0 * EI), LoadCase("straight", to))
    assert path.complete or path.stopped
    assert np.all(path.unstable <= 0)


@pytest.mark.parametrize("segments", [None, 1, 2])
def test_cantilever_without_joints_can_be_traced(segments):
    """With one spring nothing is left to become unstable once the pose is held."""
    path = VjmEngine(segments).trace(clamped_column(EI), LoadCase("straight", 0.01, "y"))
    # 12 EI/L³ with the end's turn held; its axial stretch needs force of the order of (0.01/100)²
    assert path.tangent[0] == pytest.approx(12.0 * EI / 100.0**3, rel=1e-10)
    assert np.all(path.unstable == 0)
    assert path.complete


def test_joints_that_undo_each_other_change_nothing():
    """A column between joints whose axes it does not use is the pinned column."""
    plain = universal_column(2.0 * EI)
    swapped = replace(plain, parts=(*plain.parts[:3], plain.parts[4], plain.parts[3]))
    loads = [VjmEngine(4).trace(chain, LoadCase("straight", -0.5)).critical.force for chain in (plain, swapped)]
    # the error measured is rounding alone
    assert loads[0] == pytest.approx(loads[1], rel=1e-10)
