"""Machines built in Python answer as the same machines of files, and bad input is one clear line."""

import tomllib
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

import vjm
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

PUSH = (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)
ALUMINIUM = {"youngs_modulus_MPa": 7e4, "poissons_ratio": 0.33, "density_kg_per_m3": 2700.0}


def planar(upper=60.0, fore=40.0, length=500.0):
    """The library's planar arm, of parts."""

    def tube(width):
        return vjm.shape("square_tube", width_mm=width, wall_mm=3.0, **ALUMINIUM).stiffness()

    parts = [
        vjm.Joint("shoulder", vjm.axis("z"), compliance=5e-7, limits=(-3.0, 3.0)),
        vjm.Beam("upper", length, section=tube(upper)),
        vjm.Joint("elbow", vjm.axis("z"), compliance=1e-6, limits=(-2.6, 2.6)),
        vjm.Beam("fore", 400.0, section=tube(fore)),
        vjm.RigidOffset("tool", mass=2.0, centre=np.zeros(3)),
    ]
    return vjm.build("planar-2r", parts, {"stretched": {}, "bent": {"shoulder": 0.5, "elbow": 1.2}})


def test_an_arm_of_parts_is_that_of_the_file():
    made, read = planar(), vjm.load("planar-2r")
    for posture in ("stretched", "bent"):
        own, other = (vjm.stiffness(each, posture, wrench=PUSH) for each in (made, read))
        np.testing.assert_array_equal(own.displacement, other.displacement)
        np.testing.assert_array_equal(own.loaded_compliance, other.loaded_compliance)
    np.testing.assert_array_equal(vjm.modes(made, "bent").frequencies, vjm.modes(read, "bent").frequencies)


def four_bar(drive):
    """A parallelogram of 200 by 100 mm, its crank elastic in the drive, closed at the end of the second crank."""
    steel = vjm.shape("round_bar", diameter_mm=20.0).stiffness()
    z = vjm.axis("z")
    up = vjm.turn(z, np.pi / 2)
    parts = [
        vjm.Joint("motor", z, compliance=drive),
        vjm.RigidOffset("stand", up),
        vjm.Beam("crank", 100.0, section=steel),
        vjm.RigidOffset("lie", np.linalg.inv(up)),
        vjm.Joint("pin", z, passive=True),
        vjm.Beam("coupler", 200.0, section=steel),
        vjm.RigidOffset("far", vjm.translation((200.0, 0.0, 0.0))),
        vjm.Joint("foot", z, passive=True),
        vjm.RigidOffset("stand-2", up),
        vjm.Beam("rocker", 100.0, section=steel),
        vjm.RigidOffset("lie-2", np.linalg.inv(up)),
    ]
    return vjm.build(
        "four-bar",
        parts,
        after={"far": ""},
        closures=[vjm.Closure("corner", ("coupler", "lie-2"), np.array([np.eye(4), np.eye(4)]), turns=True)],
        ends={"tool": "coupler"},
    )


def test_a_closed_loop_of_parts_moves_as_statics_says():
    """A force across the crank turns it by force, length squared and compliance, beside what bars bend by."""
    push = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    soft, hard = (vjm.stiffness(four_bar(drive), wrench=push).displacement[0] for drive in (2e-6, 1e-6))
    # the crank of 100 mm turns by 100 N mm times the difference of the drives; second order is 1e-6 of that
    assert soft - hard == pytest.approx(100.0 * 100.0 * 1e-6, rel=1e-5)


def test_a_mapping_is_a_file():
    content = {
        "name": "cantilever",
        "parts": [{"kind": "beam", "name": "bar", "length_mm": 500.0,
                   "section": {"shape": "round_bar", "diameter_mm": 20.0, **ALUMINIUM}}],
        "postures": {"home": {}},
    }  # fmt: skip
    EI = vjm.shape("round_bar", diameter_mm=20.0, **ALUMINIUM).stiffness().EIz
    deflection = vjm.stiffness(vjm.load(content), wrench=(0, 0, -1e-3, 0, 0, 0)).displacement[2]
    # PL³/3EI; large deflections change it by the square of the slope, 1e-13
    assert deflection == pytest.approx(-1e-3 * 500.0**3 / (3.0 * EI), rel=1e-9)
    swept = vjm.sweep(content, {"bar.section.diameter_mm": [10.0, 20.0]}, ["mass"])
    light, heavy = (row["mass"] for row in swept.table())
    assert heavy == pytest.approx(4.0 * light, rel=1e-12)


@pytest.mark.parametrize("name", ["manipulators/delta", "machines/palletiser", "planar-2r"])
def test_what_a_file_holds_is_the_machine_of_the_file(name):
    """Of legs, of bodies and joints, and of parts; what a mapping need not say is left out."""
    content = tomllib.loads(resources.files("vjm").joinpath("models", f"{name}.toml").read_text("utf-8"))
    given = {key: value for key, value in content.items() if key not in ("format", "title", "source", "units")}
    made, read = vjm.load(given), vjm.load(name.split("/")[-1])
    own, other = (vjm.stiffness(each, wrench=PUSH) for each in (made, read))
    np.testing.assert_array_equal(own.displacement, other.displacement)
    assert vjm.check(given).sound


def test_numbers_of_a_function_a_machine_and_a_file_are_the_same():
    of_function = vjm.sensitivities(planar, ["length"], wrench=PUSH, posture="bent")
    of_machine = vjm.sensitivities(planar(), ["upper.length"], wrench=PUSH, posture="bent")
    of_file = vjm.sensitivities("planar-2r", ["upper.length_mm"], wrench=PUSH, posture="bent")
    expected = of_file.rows[0].derivative
    # the same differences of the same machines
    assert of_function.rows[0].derivative == pytest.approx(expected, rel=1e-12)
    assert of_machine.rows[0].derivative == pytest.approx(expected, rel=1e-12)
    assert of_machine.rows[0].unit == "mm"


def test_progress_is_told():
    told = []
    vjm.sweep(planar, {"upper": [50.0, 60.0]}, ["mass"], progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (2, 2)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: vjm.axis("w"), "is none of x, y, z"),
        (lambda: vjm.axis((0, 0, 0)), "not all zero"),
        (lambda: vjm.shape("tub", width_mm=3.0), "is none of rectangle"),
        (lambda: vjm.shape("square_tube", width_mm=60.0), "wall_mm"),
        (lambda: planar(length=-1.0), "length"),
        (lambda: vjm.build("a", [vjm.Joint("j", vjm.axis("z"))], {"home": {"k": 1.0}}), "gives joint 'k'"),
        (
            lambda: vjm.build("a", [vjm.Joint("j", vjm.axis("z"), limits=(-1.0, 1.0))], {"home": {"j": 2.0}}),
            "exceeds its limit 1 by 1 rad",
        ),
        (lambda: vjm.sweep(planar(), {"upper.lenght": [1.0]}), "did you mean 'upper.length'"),
        (lambda: vjm.sweep(lambda width: planar(width), {"width": [1.0]}), "has no default"),
        (lambda: vjm.compensate(planar(), [(1.0, 2.0)]), r"must have the shape \(g, 3\)"),
        (lambda: vjm.tool_postures(planar(), (1.0, 2.0)), "three finite numbers"),
        (lambda: vjm.tool_postures(planar(), (2000.0, 0.0, 0.0)), "of reach"),
        (lambda: vjm.optimise(planar, {"upper": (40.0, 80.0)}), "say one: minimise"),
        (lambda: vjm.optimise(planar, {"upper": (40.0,)}, minimise="mass"), "give two bounds"),
        (lambda: vjm.optimise(planar, {}, minimise="mass"), "say which number varies"),
        (lambda: vjm.catalogue("square-tube"), "did you mean 'square-tubes'"),
    ],
)
def test_bad_input_is_one_clear_line(call, said):
    with pytest.raises(ValueError, match=said) as caught:
        call()
    assert "\n" not in str(caught.value)


# What a user may do wrong, or a machine be like: each ends right, or says clearly why not.


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
