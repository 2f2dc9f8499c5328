"""What ``import vjm`` offers: it is all there, it is cheap, and its results speak for themselves."""

import doctest
import importlib
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vjm
import vjm_updating
from vjm.analysis import rigid_wrenches
from vjm.design.linear_state import loaded_posture
from vjm.design.sensitivity import DesignQuantity, value_at
from vjm.engines import VjmEngine

PUBLIC = [name for name in vjm.__all__ if not name.startswith("_")]


@pytest.fixture(scope="module")
def path(chain):
    return vjm.trace(chain, vjm.LoadCase("A", to=1.0), engine="vjm-paper")


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_is_there_and_documented(name):
    assert len(inspect.getdoc(getattr(vjm, name)) or "") > 20


def test_an_unknown_name_is_refused_with_those_that_there_are():
    with pytest.raises(AttributeError, match=r"'lod'.*load"):
        vjm.lod  # noqa: B018


def test_import_alone_loads_no_numpy():
    command = "import sys, vjm; print('numpy' in sys.modules, 'numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout == "False False\n"


DOCUMENTED = """
vjm vjm.analysis vjm.postures vjm.model.joint_limits vjm.machine.inverse_kinematics vjm.design.shares
vjm.design.modes vjm.design.space vjm.building vjm.compensation vjm.design.best_machine vjm.io.catalogues vjm.robots
vjm.design.sweep vjm.design.sensitivity vjm.io.shapes vjm.io.inertia vjm.io.model_report
vjm_updating.maps.run vjm_updating.identify.command vjm_updating.simulate
"""


@pytest.mark.parametrize("module", DOCUMENTED.split())
def test_examples_in_docstrings_hold(module):
    result = doctest.testmod(importlib.import_module(module))
    assert result.attempted >= 2
    assert result.failed == 0


@pytest.mark.parametrize(
    ("module", "name"),
    [(owner, name) for owner in (vjm, vjm_updating) for name in owner.__all__ if not name.startswith("_")],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_a_public_name_has_an_example_that_holds(module, name):
    thing = getattr(module, name)
    own = importlib.import_module(thing.__module__)
    (example,) = doctest.DocTestFinder(recurse=False).find(thing, name, own)
    assert example.examples, f"{module.__name__}.{name} has no example"
    assert doctest.DocTestRunner().run(example).failed == 0


def test_a_word_and_an_engine_are_the_same(chain, path):
    again = vjm.trace(chain, vjm.LoadCase("A", to=1.0), VjmEngine())
    np.testing.assert_array_equal(path.force, again.force)


def test_an_unknown_engine_is_refused(chain):
    with pytest.raises(ValueError, match="did you mean 'exudyn'"):
        vjm.trace(chain, vjm.LoadCase("A", to=1.0), engine="exudin")


def test_results_are_a_few_lines(chain, path):
    for shown in (path, chain, vjm.load("orthoglide"), path.points[0], path.critical):
        assert len(repr(shown)) < 400, repr(shown)
    assert "bifurcation" in repr(path)
    assert path._repr_html_().count("<tr>") == 13


def test_a_frame_has_the_columns_of_a_curve_file(path, tmp_path):
    pd = pytest.importorskip("pandas", reason="pandas is not installed: pip install 'vjm-stiffness[frame]'")
    frame = path.to_frame()
    vjm.write_curve(path, tmp_path / "curve.csv")
    written = pd.read_csv(tmp_path / "curve.csv", comment="#")
    shared = [name for name in written.columns if name in frame.columns]
    assert len(shared) == 15
    # a curve file has 12 digits, its eigenvalue 9
    np.testing.assert_allclose(frame[shared], written[shared], rtol=1e-8, atol=1e-9)


def test_a_plot_shows_every_event(path):
    axes = path.plot()
    assert len(axes.lines) >= 1 + len(path.events)
    assert "mm" in axes.get_xlabel()


def test_stiffness_by_displacement_and_by_wrench_agree(chain):
    imposed = vjm.stiffness(chain, "A", displacement=(-1.0, 0, 0, 0, 0, 0))
    # K^F is the derivative of the wrench: a central difference of 0.002 mm is off by its square and by rounding
    step = 1e-3
    far, near = (vjm.stiffness(chain, "A", displacement=(-1.0 + d, 0, 0, 0, 0, 0)).wrench for d in (step, -step))
    assert (far - near)[0] / (2 * step) == pytest.approx(imposed.loaded[0, 0], rel=1e-6)
    with pytest.raises(ValueError, match="not both"):
        vjm.stiffness(chain, "A", displacement=[0.0] * 6, wrench=[0.0] * 6)
    with pytest.raises(ValueError, match="six finite numbers"):
        vjm.stiffness(chain, "A", displacement=[1.0])


def test_an_arm_carries_wrench_weight_and_loads():
    arm = vjm.load("planar-2r")
    force = (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)
    found = vjm.stiffness(arm, "stretched", wrench=force)
    x, y = 900.0 + found.displacement[0], found.displacement[1]
    # the shoulder's torque is the force's moment about it, at the place to which the tool has gone
    assert found.torques["shoulder"] == pytest.approx(10.0 * x, rel=1e-9)
    assert y < 0.0
    step = (0.0, -10.01, 0.0, 0.0, 0.0, 0.0)
    further = vjm.stiffness(arm, "stretched", wrench=step).displacement - found.displacement
    # the solver stops at 1e-8 mm
    assert found.loaded_compliance[:, 1] * -0.01 == pytest.approx(further, abs=1e-7)
    assert np.allclose(found.loaded @ found.loaded_compliance, np.eye(6), atol=1e-8)
    heavy = vjm.stiffness(arm, "stretched", gravity=(0.0, -9.81, 0.0))
    assert heavy.torques["shoulder"] > 0.0 == heavy.wrench[1]
    leg, mechanism = vjm.load("orthoglide-chain"), "that its springs hold: with its end free it is a mechanism"
    with pytest.raises(vjm.MechanismError, match=mechanism):
        vjm.stiffness(leg, gravity=(0.0, 0.0, -9.81))
    with pytest.raises(vjm.MechanismError, match=mechanism):
        vjm.modes(leg, wrench=(100.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_a_rod_that_hangs_on_a_free_joint_is_held_by_its_weight():
    """A pendulum's stiffness is that of the weight: half of the rod's counts at its tip."""
    tube = vjm.Section(EA=2.2e7, GJ=4.1e8, EIy=5.5e8, EIz=5.5e8, mass=8.5e-4)
    turned = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    rod = vjm.Beam("rod", 1000.0, section=tube, own_frame=turned)
    bob = vjm.RigidOffset("bob", np.eye(4), 3.0, np.zeros(3))
    pin = vjm.Joint("pin", np.array([0.0, 1.0, 0.0]), passive=True)
    hanging = vjm.Machine("pendulum", (pin, rod, bob), postures={"down": np.zeros(1)})
    weight = (0.0, 0.0, -9.81)
    found = vjm.stiffness(hanging, "down", gravity=weight)
    mass, at_tip, EI = 0.85, 3.0 + 0.85 / 2.0, 5.5e8
    # of which a half sine of the rod under its own weight takes 3e-5; higher waves, and what the weight stiffens
    # of that one, are some hundredths of this
    bent = 8.0 * mass**2 * 9.81 * 1000.0 / (np.pi**6 * EI * at_tip) * 1000.0
    assert 1.0 / found.loaded_compliance[0, 0] == pytest.approx(at_tip * 9.81 / 1000.0 * (1.0 - bent), rel=5e-6)
    assert np.isnan(found.unloaded).all()
    assert "there is no unloaded stiffness: the loads alone hold the machine" in found.laws
    # as its sensitivity has it
    asked = loaded_posture(hanging, "down", gravity=weight)
    assert value_at(asked, DesignQuantity.STIFFNESS, "x") == pytest.approx(1.0 / found.loaded_compliance[0, 0])
    with pytest.raises(vjm.NoConvergenceError, match="unstable"):
        vjm.stiffness(hanging, "down", gravity=(0.0, 0.0, 9.81))


def test_an_arm_that_some_wrench_does_not_move_is_infinitely_stiff():
    found = vjm.stiffness(vjm.load("ur10"), "stretched", wrench=(0.0, 0.0, -100.0, 0.0, 0.0, 0.0))
    assert np.all(np.isinf(found.loaded))
    assert len(found.rigid) >= 1
    moved = found.rigid @ found.loaded_compliance
    assert np.abs(moved[:, :3]).max() < 1e-9 * np.abs(found.displacement[:3]).max()


def test_what_moves_nothing_is_one_wrench_each():
    """Only a force along x, or the moment about y that turns the arm alike, moves an arm of 300 mm on a drive."""
    arm = np.array([300.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    across, along, about_x, tilt, about_z = rigid_wrenches(
        arm[:, None] / np.repeat([[300.0], [1.0]], 3, axis=0), 300.0
    )
    assert tilt == pytest.approx([-1 / 300, 0.0, 0.0, 0.0, 1.0, 0.0], abs=1e-15)
    for found, axis in ((across, 1), (along, 2), (about_x, 3), (about_z, 5)):
        assert found == pytest.approx(np.eye(6)[axis], abs=1e-15)


def test_buckling_says_what_its_paths_say(chain):
    found = vjm.buckling(chain, ["A"], engine="vjm-paper")
    assert [row["critical"] for row in found.rows()] == ["bifurcation", None]
    assert found.rows()[0]["F_cr"] == found.paths["A", "tension"].critical.force
    assert found._repr_html_().count("<tr>") == 3
    assert len(found.plot().get_legend().get_texts()) == 2
    with pytest.raises(ValueError, match="up to how many N"):
        vjm.buckling(chain, ["A"], force=True)


def test_a_hinged_column_buckles_at_eulers_load():
    column = vjm.load("pinned-column")
    found = vjm.buckling(column, directions=["compression"], engine="vjm-16", to=10.0)
    (row,) = found.rows()
    beam = column.beams[0]
    section = beam.effective_section()
    assert row["critical"] == "bifurcation"
    # P (1 − P/EA) = π² EI/L²; springs of the tenth order leave less than the event's location, 3e-11
    P = row["F_cr"]
    EI = min(section.EIy, section.EIz)
    assert P * (1 - P / section.EA) == pytest.approx(np.pi**2 * EI / beam.length**2, rel=2e-9)


@pytest.mark.parametrize("module", ["vjm", "vjm_updating"])
def test_dir_shows_what_is_public_and_nothing_else(module):
    owner = importlib.import_module(module)
    assert dir(owner) == sorted(owner.__all__)
    for name in owner.__all__:
        assert getattr(owner, name) is not None


def test_every_answer_is_plain_python_a_table_and_a_frame(path):
    pd = pytest.importorskip("pandas", reason="pandas is not installed: pip install 'vjm-stiffness[frame]'")
    arm, push = vjm.load("planar-2r"), (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)
    answers = [
        path,
        vjm.stiffness(arm, wrench=push),
        vjm.shares(arm, wrench=push),
        vjm.modes(arm, number=2),
        vjm.sweep(arm, {"upper.length": [400.0, 500.0]}, ["mass", "stiffness.y"]),
        vjm.sensitivities(arm, ["upper.length"], of="mass"),
        vjm.compensate(arm, [(600, 300, 0)], wrenches=[push]),
        vjm.check(arm),
    ]
    for answer in answers:
        assert isinstance(answer, vjm.Outcome)
        assert json.loads(json.dumps(answer.to_dict())) is not None
        assert isinstance(answer.to_frame(), pd.DataFrame)
        assert len(answer.to_frame()) == len(answer.table())
        if hasattr(answer, "plot"):
            axes = answer.plot()
            assert axes.get_xlabel() or axes.get_ylabel()
    assert answers[0].to_dict()["points"][0]["s"] == path.points[0].s


@pytest.mark.parametrize("module", ["vjm", "vjm_updating"])
def test_every_public_name_is_on_the_reference_page(module):
    page = (Path(__file__).parents[2] / "docs/reference/python.md").read_text(encoding="utf-8")
    names = importlib.import_module(module).__all__
    assert [name for name in names if not re.search(rf"\b{module}\.{name}\b", page)] == []


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"machine": "planar-2r"}, TypeError, "give a machine, as vjm.load gives it, not 'planar-2r'"),
        ({"posture": 3}, TypeError, "a posture is a label or coordinates, not 3"),
        ({"wrench": 3.0}, ValueError, "wrench must be six finite numbers, got 3.0"),
        ({"wrench": (1, None, 0, 0, 0, 0)}, ValueError, "wrench must be six finite numbers"),
        ({"displacement": "abc"}, ValueError, "displacement must be six finite numbers, got 'abc'"),
        ({"gravity": (0.0, 0.0)}, ValueError, r"gravity must be three finite numbers, got \(0.0, 0.0\)"),
    ],
)
def test_what_is_of_another_type_is_refused_in_words(given, error, said):
    machine = given.pop("machine", None) or vjm.load("planar-2r")
    with pytest.raises(error, match=said):
        vjm.stiffness(machine, **given)


@pytest.mark.parametrize(
    "asked",
    [
        vjm.stiffness, vjm.buckling, vjm.modes, vjm.shares, lambda m: vjm.compensate(m, [(600, 300, 0)]),
        lambda m: vjm.robot_text(m, "urdf"), lambda m: vjm.tool_postures(m, (600, 300, 0)),
        lambda m: vjm.trace(m, vjm.LoadCase("A", to=1.0)), lambda m: vjm.in_posture(m, "A"),
    ],
)  # fmt: skip
def test_what_takes_a_machine_says_so(asked):
    for other in ("planar-2r", None, {"name": "arm"}):
        with pytest.raises(TypeError, match=r"give a machine, as vjm\.load gives it, not"):
            asked(other)


@pytest.mark.parametrize("position", [3, (1.0, 2.0), (1.0, None, 0.0), "abc"])
def test_a_place_that_is_none_is_refused(position):
    with pytest.raises(ValueError, match="position must be three finite numbers, got"):
        vjm.tool_postures(vjm.load("planar-2r"), position)
