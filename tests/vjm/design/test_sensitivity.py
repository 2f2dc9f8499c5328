"""Derivatives by numbers of the file against differences of equilibria that are solved anew, and closed forms."""

from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from helpers.closed_machines import bridged_tree
from helpers.file_texts import model_text, table_text
from helpers.parameters import joint_compliance

import vjm
from vjm.design import sensitivity as module
from vjm.design.changes import residual_forces
from vjm.design.critical import critical_state
from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.modes import modes, total_mass
from vjm.design.sensitivity import DesignQuantity, sensitivity, verified
from vjm.engines import VjmEngine
from vjm.io.errors import ModelFileError
from vjm.io.file_parameters import MachineFiles
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.parameters import beam_length, compliance_factor, section_value
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES

from .conftest import DIAMETER, LENGTH, E

COLUMN, PRESSED = {"wrench": (-100.0, 0.0, 0.0, 0.0, 0.0, 0.0)}, {"wrench": (0.0, 0.0, -1e3, 0.0, 0.0, 0.0)}
BAR = {"shape": "round_bar", "diameter_mm": 12.0, "youngs_modulus_MPa": 210000.0, "shear_modulus_MPa": 80000.0}
LEFT, APEX, RIGHT = [-200.0, 0.0, 0.0], [0.0, 0.0, 8.0], [200.0, 0.0, 0.0]
TOGGLE = model_text(
    "toggle",
    *(table_text("[bodies]", name=name) for name in ("left-near", "left-far", "right-near", "right-far")),
    table_text("[joints]", name="left-pin", between=["ground", "left-near"], at_mm=LEFT, axis="y"),
    table_text("[joints]", name="apex", between=["left-far", "right-far"], at_mm=APEX, axis="y"),
    table_text("[joints]", name="right-pin", between=["ground", "right-near"], at_mm=RIGHT, axis="y"),
    table_text("[beams]", name="left", between=["left-near", "left-far"], from_mm=LEFT, to_mm=APEX, section=BAR),
    table_text(
        "[beams]", name="right", between=["right-near", "right-far"], from_mm=RIGHT, to_mm=APEX, section=BAR
    ),
    kind="bodies",
    end={"body": "left-far", "at_mm": APEX},
)
LOADS = {"wrench": (20.0, -50.0, 10.0, 300.0, 0.0, 0.0), "gravity": (0.0, -9.81, 0.0)}
KEYS = (
    "shoulder.compliance_rad_per_Nmm", "elbow.compliance_rad_per_Nmm", "upper.length_mm",
    "upper.section.width_mm", "fore.section.wall_mm", "fore.section.density_kg_per_m3", "tool.mass_kg",
)  # fmt: skip
TUBE = Section(1e8, 1e12, 1e12, 1e12)
DIFFERENCES = 1e-6
"""Of the largest relative derivative: of equilibria solved to 1e-11, over a step of 1e-3, and of h⁴."""


def solved(machine, quantity, along, label, loads):
    """The quantity of an equilibrium that is solved for."""
    if quantity is DesignQuantity.FREQUENCY:
        return modes(machine, label, number=1, **loads).frequencies[0]
    state = state_of(loaded_posture(machine, label, **loads))
    if quantity is DesignQuantity.MASS:
        return total_mass(state.question)
    k = ["x", "y", "z", "rx", "ry", "rz"].index(along)
    if quantity is DesignQuantity.DEFLECTION:
        return state.moved[k]
    found = vjm.stiffness(machine, label, engine=VjmEngine(16), **loads)
    return 1.0 / found.loaded_compliance[k, k]


def differenced(parameter, machine, *asked, step=1e-3):
    h = step * parameter.scale
    slopes = [
        (
            solved(parameter.apply(machine, parameter.value + s), *asked)
            - solved(parameter.apply(machine, parameter.value - s), *asked)
        )
        / (2.0 * s)
        for s in (h, 0.5 * h)
    ]
    return (4.0 * slopes[1] - slopes[0]) / 3.0


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("quantity", "along"),
    [(DesignQuantity.DEFLECTION, "y"), (DesignQuantity.DEFLECTION, "rz"), (DesignQuantity.STIFFNESS, "y"),
     (DesignQuantity.FREQUENCY, ""),
     (DesignQuantity.MASS, "")],
)  # fmt: skip
def test_derivatives_of_an_arm_are_its_differences(quantity, along):
    files = MachineFiles.read("planar-2r")
    machine = files.machine()
    parameters = [files.parameter(key, "bent") for key in KEYS]
    found = sensitivity(machine, parameters, quantity, "bent", along=along, **LOADS)
    by_name = {row.parameter: row for row in found.rows}
    largest = max(abs(row.relative) for row in found.rows)
    assert largest > 0.1
    for parameter in parameters:
        slope = differenced(parameter, machine, quantity, along, "bent", LOADS)
        error = (by_name[parameter.name].derivative - slope) * parameter.value / found.value
        assert abs(error) < DIFFERENCES * largest, parameter.name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "part"), [("orthoglide", "x/link"), ("hexapod", "c/strut"), ("palletiser", "rod")]
)
def test_derivatives_of_closed_loops_are_their_differences(name, part):
    machine = vjm.load(name)
    label, loads = next(iter(machine.postures)), {"wrench": (200.0, -100.0, -150.0, 0.0, 500.0, 200.0)}
    parameter = compliance_factor(machine, part)
    found = sensitivity(machine, [parameter], "deflection", label, along="x", **loads)
    # deflections of 0.01 mm are solved to 1e-13 mm: a step of 1e-2 leaves 1e-9 of them, and h⁴
    slope = differenced(parameter, machine, DesignQuantity.DEFLECTION, "x", label, loads, step=1e-2)
    assert found.rows[0].derivative == pytest.approx(slope, rel=DIFFERENCES)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "key", "posture"),
    [
        ("delta", "delta-rod.rod.length_mm", "10,5,-20"),
        ("delta", "arm-a.base.position_mm.1", "home"),
        ("orthoglide", "orthoglide-chain.link.section.EA_N", "Q1"),
        ("hexapod", "ups-strut.slide.compliance_mm_per_N", "home"),
        ("palletiser", "forearm.section.EIy_Nmm2", ""),
        ("bodies", "coupler.section.diameter_mm", "forward"),
        ("bodies", "near.at_mm.3", "drawn"),
    ],
)
def test_derivatives_by_numbers_of_legs_and_bodies_are_differences(tmp_path, name, key, posture):
    """Loops close anew with each value, so that lengths and places have derivatives, too."""
    if name == "bodies":
        name = tmp_path / "linkage.toml"
        template = resources.files("vjm_validation").joinpath("cli", "templates", "bodies.toml")
        name.write_text(template.read_text("utf-8").replace("NAME", "linkage"), encoding="utf-8")
    files = MachineFiles.read(name)
    posture = posture or next(iter(files.machine().postures))
    machine, parameter = files.machine(posture), files.parameter(key, posture)
    loads = {"wrench": (20.0, -10.0, -15.0, 0.0, 500.0, 200.0), "engine": VjmEngine(2)}
    found = sensitivity(machine, [parameter], "deflection", posture, along="x", **loads)
    slope = differenced(parameter, machine, DesignQuantity.DEFLECTION, "x", posture, loads, step=1e-2)
    assert abs(found.rows[0].relative) > 1e-6
    assert found.rows[0].derivative == pytest.approx(slope, rel=DIFFERENCES)


def test_files_make_the_machine_that_is_loaded():
    """Legs that share a chain file are one machine with the manipulator's that `vjm.load` reads."""
    loads = {"wrench": (20.0, -10.0, -15.0, 0.0, 500.0, 200.0), "engine": VjmEngine(2)}
    files = MachineFiles.read("delta")
    for posture in ("home", "low"):
        ours = state_of(loaded_posture(files.machine(posture), posture, **loads)).moved
        # the same numbers by the same equations: rounding
        assert ours == pytest.approx(state_of(loaded_posture(vjm.load("delta"), posture, **loads)).moved, rel=1e-12)


def test_a_number_of_a_chain_file_changes_all_legs_of_it(tmp_path):
    files = MachineFiles.read("delta").with_numbers({"delta-rod.rod.section.EA_N": 1e7})
    machine = files.machine("home")
    rods = [beam for beam in machine.beams if beam.name.endswith("/rod")]
    assert [rod.section.EA for rod in rods] == [1e7] * 6
    written = files.write(tmp_path / "best.toml", "# ours\n", "A delta")
    assert [file.name for file in written] == ["best-delta-arm.toml", "best-delta-rod.toml", "best.toml"]
    again = vjm.load(str(tmp_path / "best.toml"))
    assert next(beam for beam in again.beams if beam.name == "rod-b2/rod").section.EA == 1e7
    assert again.title == "A delta"


def test_an_entry_of_a_symmetric_matrix_changes_both():
    files = MachineFiles.read("orthoglide-chain")
    keys = files.keys()
    assert "foot.compliance.1.2" in keys
    assert "foot.compliance.2.1" not in keys
    wanted = 0.9 * files.number("foot.compliance.2.1")
    matrix = files.with_numbers({"foot.compliance.1.2": wanted}).machine().beams[0].compliance
    assert matrix[0, 1] == matrix[1, 0] == wanted


def test_what_has_no_derivative_is_left_out_with_a_reason(cantilever):
    chain = cantilever()
    known = compliance_factor(chain, "rod")

    def refused(chain, value):
        raise ValueError("no such part is made")

    parameters = [known, replace(known, name="other", apply=refused)]
    loads = {"wrench": (0.0, -1.0, 0.0, 0.0, 0.0, 0.0)}
    found = sensitivity(chain, parameters, "deflection", leave_out=True, **loads)
    assert [row.parameter for row in found.rows] == [known.name]
    assert found.left_out == (("other", "no such part is made"),)
    with pytest.raises(ValueError, match="no such part is made"):
        sensitivity(chain, parameters, "deflection", **loads)


def test_a_cantilever_in_closed_form(cantilever):
    """Stiffness 3EI/L³: by its length −3, by its compliance −1; it is doubled by L/∛2."""
    chain = cantilever()
    parameters = [beam_length(chain, "rod"), compliance_factor(chain, "rod")]
    found = sensitivity(chain, parameters, "stiffness", along="y", factors=2)
    length, compliance = found.rows
    assert [row.geometric for row in found.rows] == [True, False]
    assert length.relative == pytest.approx(-3.0, rel=1e-9)
    assert compliance.relative == pytest.approx(-1.0, rel=1e-9)
    assert length.factor == pytest.approx(2.0 ** (-1.0 / 3.0), rel=1e-6)
    assert compliance.factor == pytest.approx(0.5, rel=1e-6)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_path_that_begins_within_a_clearance_has_no_critical_load_to_look_for():
    parts = (Joint("a", AXES["z"], law=vjm.DeadZone(2e6, 2e-3)), Beam("arm", 500.0, section=TUBE))
    machine = Machine("loose", parts, postures={"home": np.zeros(0)}, held={"home": {"a": 0.0}})
    for way in (-10.0, 10.0):
        with pytest.raises(vjm.NoConvergenceError, match="'a' is free within its clearance"):
            critical_state(loaded_posture(machine, "home", wrench=(way, 0.0, 0.0, 0.0, 0.0, 0.0)))


def test_the_critical_load_of_a_cantilever_in_closed_form(cantilever):
    """Euler's π² E I / 4 L² in both planes: by the length −2, by the compliance −1, by one of two stiffnesses ½."""
    chain = cantilever()
    parameters = [beam_length(chain, "rod"), compliance_factor(chain, "rod"), section_value(chain, "rod", "EIz")]
    found = sensitivity(
        chain, parameters, "critical", wrench=(-100.0, 0.0, 0.0, 0.0, 0.0, 0.0), engine=VjmEngine(8), factors=1
    )
    euler = np.pi**2 * E * np.pi * DIAMETER**4 / 64.0 / (4.0 * LENGTH**2)
    # of eight springs a beam, which converges with the fourth order
    assert found.value == pytest.approx(euler / 100.0, rel=1e-6)
    relative = {row.parameter: row.relative for row in found.rows}
    assert relative["rod length"] == pytest.approx(-2.0, rel=1e-6)
    assert relative["rod compliance factor"] == pytest.approx(-1.0, rel=1e-6)
    # of two equal loads the mean counts
    assert relative["rod EIz"] == pytest.approx(0.5, rel=1e-6)
    assert found.rows[0].factor == pytest.approx(2.0**-0.5, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "key", "posture", "loads", "limit"),
    [
        ("planar-2r", "elbow.compliance_rad_per_Nmm", "stretched", COLUMN, False),
        ("toggle", "left.section.diameter_mm", "drawn", PRESSED, True),
        ("toggle", "apex.at_mm.3", "drawn", PRESSED, True),
    ],
    ids=["bifurcation", "limit", "limit by a place"],
)  # fmt: skip
def test_derivatives_of_critical_loads_are_differences(tmp_path, name, key, posture, loads, limit):
    """A straight arm, where a branch begins; and two bars in a loop that snap through."""
    if name == "toggle":
        name = tmp_path / "toggle.toml"
        name.write_text(TOGGLE, encoding="utf-8")
    files = MachineFiles.read(name)
    machine, parameter = files.machine(posture), files.parameter(key, posture)
    engine = VjmEngine(2)

    def critical(value):
        return critical_state(loaded_posture(parameter.apply(machine, value), posture, engine=engine, **loads))

    assert critical(parameter.value).limit is limit
    found = sensitivity(machine, [parameter], "critical", posture, engine=engine, **loads)
    assert abs(found.rows[0].relative) > 0.01
    h = 1e-2 * parameter.value
    slopes = [
        (critical(parameter.value + s).factor - critical(parameter.value - s).factor) / (2.0 * s)
        for s in (h, 0.5 * h)
    ]
    assert found.rows[0].derivative == pytest.approx((4.0 * slopes[1] - slopes[0]) / 3.0, rel=DIFFERENCES)


def test_a_factor_halves_the_deflection():
    files = MachineFiles.read("planar-2r")
    machine = files.machine()
    parameters = [files.parameter(key, "stretched") for key in KEYS[:2]]
    loads = {"wrench": (0.0, -20.0, 0.0, 0.0, 0.0, 0.0)}
    found = sensitivity(machine, parameters, "deflection", "stretched", factors=2, **loads)
    first, second = found.rows
    assert first.parameter == "shoulder.compliance_rad_per_Nmm"
    parameter = next(p for p in parameters if p.name == first.parameter)
    halved = parameter.apply(machine, first.factor * parameter.value)
    moved = state_of(loaded_posture(halved, "stretched", **loads)).moved
    assert moved[1] == pytest.approx(0.5 * found.value, rel=1e-5)
    # the elbow has 28 % of the deflection: without it 72 % are left
    assert second.parameter == "elbow.compliance_rad_per_Nmm"
    assert second.factor is None


def test_all_numbers_of_a_file_are_its_keys():
    keys = MachineFiles.read("planar-2r").keys()
    assert set(KEYS) <= set(keys)
    assert not any("limits" in key for key in keys)
    # the centre of mass of the tool is zero
    assert "tool.centre_of_mass_mm.1" not in keys


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("shoulder.compliance", "'shoulder.compliance' is no number of a part"),
        ("nobody.length_mm", "'nobody.length_mm' is no number of a part"),
        ("upper.section.shape", "is no number of a part"),
        ("tool.centre_of_mass_mm.1", "is zero"),
    ],
)
def test_keys_that_are_no_numbers_are_refused(key, said):
    with pytest.raises(ModelFileError, match=said):
        MachineFiles.read("planar-2r").parameter(key)


def test_what_has_no_derivative_is_refused(cantilever):
    chain = cantilever()
    rod = [compliance_factor(chain, "rod")]
    with pytest.raises(ValueError, match="its deflection along z is zero"):
        sensitivity(chain, rod, "deflection", along="z", wrench=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="a mass has no component"):
        sensitivity(chain, rod, "mass", along="x")
    with pytest.raises(ValueError, match="component 'w' is none of"):
        sensitivity(chain, rod, "stiffness", along="w")
    machine = vjm.load("orthoglide")
    with pytest.raises(ValueError, match="its loops are open"):
        sensitivity(machine, [beam_length(machine, "x/link")], "deflection", wrench=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))


# The dense matrices about an equilibrium against differences of forces and against the compiled kernel.


WRENCH = (100.0, 50.0, -80.0, 1e3, 2e3, -3e3)
CASES = {
    "arm": ("ur10", {"wrench": WRENCH, "gravity": (0.0, 0.0, -9.81)}),
    "arm with a follower": (
        "planar-2r",
        {"loads": [Load((30.0, -50.0, 5.0, 100.0, 0.0, 20.0), "fore", 0.5, follower=True)]},
    ),
    "platform": ("orthoglide", {"wrench": WRENCH}),
    "hexapod": ("hexapod", {"wrench": WRENCH, "gravity": (0.0, 0.0, -9.81)}),
    "loops and a spring between points": (
        "palletiser", {"wrench": (10.0, 5.0, 0.0, 0.0, 0.0, 0.0), "gravity": (0.0, 0.0, -9.81)},
    ),
    "held chain": ("orthoglide-chain", {"displacement": (-1.0, 0.2, 0.0, 0.0, 0.0, 1e-3)}),
}  # fmt: skip


@pytest.mark.parametrize(("name", "asked"), CASES.values(), ids=CASES)
def test_the_tangent_is_the_derivative_of_the_forces(name, asked):
    state = state_of(loaded_posture(vjm.load(name), **asked))
    # solvers stop at 1e-11 of the machine's scale
    scale = np.broadcast_to(state.model.coordinate_scale, state.model.size)[: state.n]
    assert np.abs(residual_forces(state) * scale).max() < 1e-9 * np.abs(state.reactions[: state.n] * scale).max()
    N, h = state.motions, 1e-6
    rate = N @ np.random.default_rng(0).standard_normal(N.shape[1])

    def forces(step):
        x = state.x.copy()
        x[: state.n] += step * rate
        return replace(state, x=x).reactions[: state.n]

    change = (forces(h) - forces(-h)) / (2.0 * h)
    expected = N.T @ (state.spring_stiffness @ rate - change)
    # of a central difference 1e-12 of the curvature and 1e-16 over h of the forces are left
    np.testing.assert_allclose(N.T @ (state.tangent @ rate), expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["orthoglide", "hexapod", "palletiser"])
def test_the_compliance_is_that_of_the_compiled_kernel(name):
    machine, asked = vjm.load(name), CASES["platform"][1]
    state = state_of(loaded_posture(machine, **asked))
    N = state.motions
    C = state.jacobian @ N @ np.linalg.solve(N.T @ state.tangent @ N, N.T @ state.jacobian.T)
    K = vjm.stiffness(machine, state.question.posture, engine=state.question.engine, **asked).loaded
    np.testing.assert_allclose(np.linalg.inv(C), K, atol=1e-9 * np.abs(K).max())


def test_conservative_loads_have_a_symmetric_tangent():
    state = state_of(loaded_posture(vjm.load("palletiser"), **CASES["loops and a spring between points"][1]))
    assert state.conservative
    A = state.motions.T @ state.tangent @ state.motions
    np.testing.assert_allclose(A, A.T, atol=1e-13 * np.abs(A).max())
    assert not state_of(loaded_posture(vjm.load("planar-2r"), **CASES["arm with a follower"][1])).conservative


# A derivative beside a difference: what agrees, what does not, and what cannot be told.


@pytest.mark.parametrize("centre", [1e-8, 0.7, 3e5])
@pytest.mark.parametrize("wrong", [0.0, 1e-2, -0.8])
def test_a_wrong_derivative_is_told_from_a_right_one(centre, wrong):
    found = verified(lambda p: (p / centre) ** 3, 1.0, centre, 3.0 / centre * (1.0 + wrong))
    # x³: the difference errs by the square of its step
    assert found.difference == pytest.approx(3.0 / centre, rel=1e-6)
    assert found.doubtful == bool(wrong)


def test_at_a_corner_any_slope_between_the_two_agrees():
    assert not verified(lambda p: abs(p - 1.0), 0.0, 1.0, 0.5).doubtful
    assert verified(lambda p: abs(p - 1.0), 0.0, 1.0, 1.5).doubtful


def test_what_cannot_be_solved_again_says_why():
    def none(_):
        raise ValueError("no such machine")

    found = verified(none, 1.0, 1.0, 1.0)
    assert (found.difference, found.why, found.doubtful) == (None, "no such machine", False)
    assert "zero" in verified(none, 1.0, 0.0, 1.0).why


def arm() -> Machine:
    parts = (Joint("drive", AXES["z"], fixed=True, compliance=1e-6), Beam("link", 400.0, section=TUBE))
    return Machine("arm", parts, postures={"home": np.zeros(0)})


def test_every_row_is_verified_and_a_wrong_one_is_doubtful(monkeypatch):
    drive = joint_compliance(arm(), "drive")
    load = (0.0, 10.0, 0.0, 0.0, 0.0, 0.0)
    (row,) = module.sensitivity(arm(), [drive], "deflection", along="y", wrench=load).rows
    # δ = F L² c of a small angle of 4e-3, whose square is what linear theory leaves out
    assert row.verification.difference == pytest.approx(10.0 * 400.0**2, rel=1e-4)
    assert not row.verification.why
    right = module.derivative_at
    monkeypatch.setattr(module, "derivative_at", lambda *asked: 0.2 * right(*asked))
    (row,) = module.sensitivity(arm(), [drive], "deflection", along="y", wrench=load).rows
    assert row.verification.doubtful


@pytest.mark.parametrize(("make", "loads"), [
    (lambda: vjm.load("planar-2r"), [Load((20.0, -50.0, 10.0, 300.0, 5.0, 7.0), "upper", 0.5, follower=True)]),
    (lambda: vjm.load("palletiser"), []),
    (bridged_tree, []),
])  # fmt: skip
def test_what_the_tangent_makes_of_motions_is_what_its_matrix_makes(make, loads):
    """Of an arm with a load that turns with it, closed loops, and branches with a spring between them."""
    asked = loaded_posture(make(), wrench=(20.0, -50.0, 10.0, 100.0, 0.0, 50.0), loads=loads, engine=VjmEngine(3))
    state = state_of(asked)
    motions = np.random.default_rng(0).standard_normal((state.n, 3)) * state.unit[:, None]
    for times, matrix in ((state.tangent_times, state.tangent), (state.springs_times, state.spring_stiffness)):
        expected = matrix @ motions
        # two orders of the same sums
        assert np.abs(times(motions) - expected).max() < 1e-13 * np.abs(expected).max()
