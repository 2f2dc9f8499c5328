"""Machines built in Python answer as the same machines of files, and bad input is one clear line."""

import tomllib
from importlib import resources

import numpy as np
import pytest

import vjm

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
