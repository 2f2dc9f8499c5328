"""What a user may do wrong, or a machine be like: each ends right, or says clearly why not."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

Z = AXES["z"]
SOFT = Section(1e6, 1e6, 2e6, 1e6)


def pinned(section, *, both=False):
    """A column of 100 mm on hinges about z, or on universal joints."""
    if both:
        joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip("abcd", "yzzy", strict=True)]
        parts = (*joints[:2], Beam("link", 100.0, section=section), *joints[2:])
        return Machine("column", parts, postures={"p": np.zeros(4)})
    parts = (Joint("a", Z, passive=True), Beam("link", 100.0, section=section), Joint("b", Z, passive=True))
    return Machine("column", parts, postures={"p": np.zeros(2)})


def euler(section, EI):
    load = np.pi**2 * EI / 100.0**2
    return 0.5 * section.EA * (1.0 - np.sqrt(1.0 - 4.0 * load / section.EA))


def single_spring(chain, compliance):
    """The paper's model of the chain with another matrix for its bar."""
    parts = [replace(p, compliance=compliance, count=1) if p.name == "link" else p for p in chain.parts]
    return replace(chain, parts=tuple(parts))


@pytest.mark.parametrize("to", [-4.0, -100.0])
def test_a_step_far_too_large_finds_the_first_bifurcation(chain, to):
    path = VjmEngine(8).trace(chain, LoadCase("A", to, steps=1))
    fine = VjmEngine(8).trace(chain, LoadCase("A", -4.0))
    assert path.complete
    # the error measured is rounding alone
    assert path.critical.s == pytest.approx(fine.critical.s, rel=5e-9)
    # the straight column has five unstable modes at 100 mm, but it loses them one after the other
    assert path.critical.multiplicity == 1
    assert path.points[-1].unstable == 0


def test_a_state_that_is_unstable_from_the_start_is_refused():
    beyond = Load((-2000.0, 0.0, 0.0, 0.0, 0.0, 0.0), ramped=False)
    column = pinned(SOFT)
    # half of Euler's load is borne, twice of it is not
    load_case = LoadCase("p", 0.1, "z", free=("x",), loads=(beyond,))
    with pytest.raises(NoConvergenceError, match=r"does not bear its constant loads: stable up to 0\.49"):
        VjmEngine(8).trace(column, load_case)


@pytest.mark.parametrize(("unequal", "multiplicity"), [(0.0, 2), (1e-8, 2), (1e-2, 1)])
def test_columns_that_bend_nearly_alike_in_both_planes(unequal, multiplicity):
    section = Section(1e6, 1e6, 1e6 * (1.0 + unequal), 1e6)
    path = VjmEngine(8).trace(pinned(section, both=True), LoadCase("p", -0.5))
    assert path.complete
    assert path.critical.force == pytest.approx(euler(section, 1e6), rel=1e-7)
    assert path.critical.multiplicity == multiplicity
    assert path.critical.switched
    assert set(path.unstable) == {0}


@pytest.mark.parametrize(
    "posture", [[0.0, np.pi / 2, -np.pi / 2, 0.0], [np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2]]
)
def test_a_singular_posture_is_refused(chain, posture):
    there = replace(chain, postures={"S": np.array(posture)})
    with pytest.raises(ValueError, match="posture S is singular: some of its passive joints move without"):
        VjmEngine(4).trace(there, LoadCase("S", -1.0))


def test_two_joints_in_one_place_are_a_singular_posture():
    parts = (Joint("a", Z, passive=True), Joint("b", Z, passive=True), Beam("link", 100.0, section=SOFT))
    with pytest.raises(ValueError, match="singular"):
        VjmEngine(4).trace(Machine("double", parts, postures={"p": np.zeros(2)}), LoadCase("p", -1.0))


def test_a_nearly_singular_posture_is_traced_or_ends_with_its_reason(chain):
    there = replace(chain, postures={"S": np.array([0.0, 1.57, -1.57, 0.0])})
    path = VjmEngine(4).trace(there, LoadCase("S", -4.0))
    assert path.complete or path.stopped
    assert max(p.residual for p in path.points) < 1e-10


def test_directions_without_compliance_are_rigid(chain):
    """The plane of posture A does not need the bar's other bending: without it the answer is the same."""
    full = VjmEngine().trace(chain, LoadCase("A", 3.0))
    link = next(beam for beam in chain.beams if beam.name == "link")
    compliance = link.compliance / link.count
    rigid = compliance.copy()
    for k in (2, 3, 4):
        rigid[k, :] = rigid[:, k] = 0.0
    path = VjmEngine().trace(single_spring(chain, rigid), LoadCase("A", 3.0))
    assert path.complete
    # the error measured is rounding alone
    assert path.critical.force == pytest.approx(full.critical.force, rel=1e-10)
    # the error measured is rounding alone
    assert path.tangent[0] == pytest.approx(full.tangent[0], rel=1e-10)
    assert len(path.points[0].state) == len(full.points[0].state) - 3


def rod() -> Machine:
    """A clamped bar that only stretches."""
    compliance = np.zeros((6, 6))
    compliance[0, 0] = 1e-4
    return Machine("rod", (Beam("link", 100.0, compliance=compliance),), postures={"p": np.zeros(0)})


def test_a_chain_that_cannot_move_is_not_held():
    with pytest.raises(ValueError, match="rod, posture p cannot move in every direction"):
        VjmEngine().trace(rod(), LoadCase("p", 0.1))


def test_a_chain_that_only_stretches_is_a_straight_line():
    path = VjmEngine().trace(rod(), LoadCase("p", 0.1, free=("y", "z", "rx", "ry", "rz")))
    assert path.complete
    assert path.force[-1] == pytest.approx(1000.0, rel=1e-10)
    assert path.points[-1].wrench[1:] == pytest.approx(np.zeros(5), abs=1e-9)


@pytest.mark.parametrize("spoil", ["oblique", "indefinite", "nan"])
def test_a_matrix_that_is_no_compliance_is_refused(chain, spoil):
    k = np.diag([46e-6, 0.1, 0.05, 1e-6, 1e-6, 3.6e-6])
    if spoil == "oblique":
        s = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0]) / np.sqrt(2.0)
        P = np.eye(6) - np.outer(s, s)
        k = P @ k @ P
    elif spoil == "indefinite":
        k[5, 5] = -1e-6
    else:
        k[1, 1] = np.nan
    with pytest.raises(ValueError, match="part 'link': its compliance is not positive definite"):
        VjmEngine().trace(single_spring(chain, k), LoadCase("A", 1.0))


@pytest.mark.parametrize("name", ["EA", "GJ", "EIy", "EIz", "GAy", "GAz"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_section_has_positive_stiffness(name, value):
    with pytest.raises(ValueError, match=f"a section's {name} must be positive"):
        replace(SOFT, **{name: value})


@pytest.mark.parametrize("ratio", [1e3, 1e6])
@pytest.mark.parametrize("where", ["parts", "planes"])
def test_stiffnesses_far_apart_leave_the_critical_load_alone(ratio, where):
    if where == "planes":
        section = replace(SOFT, EIy=ratio * SOFT.EIy, GJ=ratio * SOFT.GJ)
        column = pinned(section)
    else:
        stiff = Section(1e6 * ratio, 1e6 * ratio, 2e6 * ratio, 1e6 * ratio)
        parts = (Beam("root", 50.0, section=stiff), *pinned(SOFT).parts, Beam("tip", 30.0, section=stiff))
        column = Machine("column", parts, postures={"p": np.zeros(2)})
    path = VjmEngine(8).trace(column, LoadCase("p", -0.5))
    assert path.complete
    assert path.critical.kind is EventKind.BIFURCATION
    assert path.critical.force == pytest.approx(euler(SOFT, 1e6), rel=1e-6)
    assert max(p.residual for p in path.points) < 1e-10
