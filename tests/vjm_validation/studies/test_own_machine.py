"""``validate all MODEL``: the report on a machine that the suite does not know."""

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.command import refused, validate
from helpers.file_texts import model_text, part_text, table_text

import vjm
from vjm.batch import Task
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.file_parameters import MachineFiles
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism
from vjm_validation import load_any_model
from vjm_validation.acceptance import accepted, at_most
from vjm_validation.load_any_model import parsed_directions, unit_of
from vjm_validation.runs.own_machine import own_acceptance
from vjm_validation.schemas import schemas
from vjm_validation.studies.own_machine import (
    SMALL,
    CriticalRow,
    OwnMachine,
    Request,
    end_name,
    extent,
    first_loss,
    quantity,
    solved,
    study,
)


@pytest.fixture(scope="module")
def arm():
    """The textbook arm in one posture: 3 directions, 2 engines."""
    return study(Request("planar-2r", ("bent",), ("x", "-y", "z"), force=100.0))


@pytest.mark.slow
def test_both_engines_say_the_same(arm):
    assert not arm.held
    lumped = [row for row in arm.loads if row.engine == "vjm-4"]
    assert len(lumped) == 3
    # 4 elements and 4 springs a beam, of fourth order: 1e-7 measured
    assert max(row.difference for row in lumped) < 1e-4
    assert all(row.difference is None for row in arm.loads if row.engine == "exudyn")


@pytest.mark.slow
def test_deflections_are_those_of_the_equilibria(arm):
    model = Mechanism(load_chain("planar-2r").refined(16).split())
    for row in arm.loads:
        at = equilibria(model, model.posture("bent"), wrench=100.0 * unit_of(row.direction))
        # paths step to the load and solve to 1e-11; Exudyn's are 1e-6 away
        assert row.moved[:3] == pytest.approx(
            at.deflection[0, 0, :3].tolist(), abs=1e-5 * np.abs(row.moved[:3]).max()
        )


def test_the_number_of_springs_converges(arm):
    errors = [row.error for row in arm.convergence]
    assert [row.springs for row in arm.convergence] == [1, 2, 4, 8]
    assert errors[0] > 10.0 * errors[2] > 0.0
    assert errors[-1] == 0.0
    assert arm.elements == pytest.approx(arm.convergence[-1].value, rel=1e-4)


def test_a_direction_in_which_nothing_deflects_has_no_stiffness():
    """The upright UR10 deflects along x only; in the others the engines answer with rounding."""
    found = study(Request("ur10", ("upright",), ("x", "z"), engines=("vjm",)))
    by_direction = {row.direction: row for row in found.loads}
    assert by_direction["z"].K0 is None
    # each gear's lever to the tool, squared
    C = found.stiffness[0].along
    assert by_direction["x"].K0 == pytest.approx(C[0], rel=1e-9)
    assert C[1] is None
    assert any("no beam" in note for note in found.notes)


def test_a_chain_with_passive_joints_is_held():
    """The pinned column, held, buckles at Euler's load."""
    found = study(Request("pinned-column", (), ("-x",), reach=1.0))
    assert found.held
    section = load_chain("pinned-column").beams[0]
    euler = np.pi**2 * section.section.EIz / section.length**2
    forces = {row.engine: row.F_cr for row in found.critical}
    # shortening by the axial force changes it by its strain
    assert forces["vjm-16"] == pytest.approx(euler, rel=1e-2)
    assert forces["exudyn"] == pytest.approx(forces["vjm-16"], rel=1e-3)
    assert found.convergence[0].quantity == "critical force, N"


def test_directions_by_name_and_numbers():
    assert parsed_directions(["x,-z", "1,1,0"]) == ("x", "-z", "1,1,0")
    assert len(parsed_directions([])) == 6
    assert unit_of("0,0,-2").tolist() == [0, 0, -1, 0, 0, 0]
    with pytest.raises(ValueError, match="'w' is no axis"):
        unit_of("w")


DESIGN = ["map", "modes", "sensitivity", "shares"]
"""Figures of the chapters on design."""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The command on a template of its own, one posture and direction."""
    folder = tmp_path_factory.mktemp("own")
    file = folder / "my-arm.toml"
    validate("new", "arm", file)
    words = ("--posture", "home", "--direction", "x", "--gravity", "0,0,-9.81", "--out", folder / "run")
    validate("all", file, *words)
    return folder / "run"


def test_a_report_holds_what_one_shows(report):
    jsonschema = pytest.importorskip("jsonschema")
    summary = json.loads((report / "summary.json").read_text())
    jsonschema.validate(summary, schemas()["own-machine.schema.json"])
    assert {row["passed"] for row in summary["acceptance"]} == {True}
    assert {row["load"] for row in summary["stiffness"]} == {"none", "weight"}
    page = (report / "index.html").read_text()
    for text in ("agree", "least stiffness", "Number of springs", "Critical forces", "my-arm"):
        assert text in page
    for text in ("Map of the stiffness", "What contributes most", "lowest natural frequency", "to halve the"):
        assert text in page
    assert sorted(file.stem for file in (report / "figures").iterdir() if file.stem in DESIGN) == DESIGN
    for text in ("Table II", "Pashkevich", "foot"):
        assert text not in page
    assert "://" not in page.replace("http://www.w3.org", "")
    assert (report / "figures" / "load_home.png").stat().st_size > 5000
    assert len(list((report / "curves").glob("*.csv"))) == 2


@pytest.mark.usefixtures("rendering")
def test_the_machine_is_drawn(report):
    assert (report / "renders" / "machine_home.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ur10", "--quick"], "--quick, --only and --steps are for the paper's report"),
        (["ur10", "--direction", "w"], "'w' is no axis"),
        (["ur10", "--posture", "folded"], "ur10 has no posture 'folded'"),
        (["ur10", "--force", "-3"], "--force: must be positive"),
        (["--gravity", "0,0,-9.81"], "are for a MODEL: name one"),
        (["nowhere.toml"], "nowhere.toml"),
    ],
)
def test_bad_words_are_refused_in_one_line(words, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in refused("all", *words)


@pytest.mark.parametrize(("force", "displacement", "passed"), [(7e3, 2.0, False), (7e5, 47.0, True)])
def test_a_critical_point_that_one_engine_lacks_fails_near_by_only(force, displacement, passed):
    """Behind a tenth of the machine's size, 31 mm, a critical point decides nothing."""
    rows = [
        CriticalRow(
            posture="p", direction="x", engine=engine, kind=EventKind.BIFURCATION if F else None, F_cr=F,
            d_cr=displacement if F else None, largest=1e6, stopped="",
        )
        for engine, F in (("vjm-16", None), ("exudyn", force))
    ]  # fmt: skip
    drawn = load_any_model.loaded("orthoglide")
    found = OwnMachine(solved(drawn), drawn, False, 1.0, critical=rows)
    verdict = next(row for row in own_acceptance(found) if row.name == "kinds of critical points")
    assert verdict.passed is passed


TREE = model_text(
    "fork",
    part_text("actuated", "joint", axis="z", compliance_rad_per_Nmm=1e-7),
    part_text("link", "left", translation_mm=[300.0, 100.0, 0.0], after="joint"),
    part_text("link", "right", translation_mm=[300.0, -100.0, 0.0], after="joint"),
    table_text("ends", l="left", r="right"),
    postures={"home": {"joint": 0.0}},
)


def test_a_trees_load_paths_are_those_of_its_first_end(tmp_path):
    """One gear of compliance c: along y the left end has 1/(c 300²) N/mm, and along z nothing moves."""
    file = tmp_path / "fork.toml"
    file.write_text(TREE.replace("[300.0, 100.0, 0.0]", "[200.0, 100.0, 0.0]"), encoding="utf-8")
    found = study(Request(str(file), directions=("y", "z"), engines=("vjm",)))
    assert [row.K0 for row in found.loads] == [pytest.approx(1.0 / (1e-7 * 200.0**2), rel=1e-9), None]
    assert [path.complete for path in found.paths.values()] == [True, True]
    rows = own_acceptance(found)
    assert [row.passed for row in rows] == [True, True]
    assert rows[1].name == "equilibrium residual"


def test_a_tree_is_solved_at_its_first_end(tmp_path):
    file = tmp_path / "fork.toml"
    file.write_text(TREE, encoding="utf-8")
    drawn = load_any_model.loaded(str(file))
    machine = solved(drawn)
    assert (drawn.parts[-1].name, end_name(machine), machine.after[machine.parts[-1].name]) == (
        "right",
        "l",
        "left",
    )
    assert extent(machine) == pytest.approx(np.hypot(300.0, 100.0))


@pytest.mark.slow
def test_both_engines_refine_a_critical_force_until_it_has_converged(tmp_path):
    """A beam held at both ends, stretched by 2 %: springs and elements are of second order there.

    A carriage in the middle cuts the beam into two halves: two beams of 500 mm have the same critical force.
    """
    file = tmp_path / "axis.toml"
    validate("new", "axis", file)
    found = study(Request(str(file), ("middle",), ("-z",)))
    assert [row.passed for row in own_acceptance(found)] == [True] * 7
    values = [row.value for row in found.convergence]
    assert [row.springs for row in found.convergence] == [1, 2, 4, 8, 16, 32]
    changes = np.diff(values)
    # by second order a quarter each
    assert changes[-1] / changes[-2] == pytest.approx(0.25, abs=0.02)
    # the limit of both by that order: 3e-5 apart
    limit = values[-1] + changes[-1] / 3.0
    assert found.elements == pytest.approx(limit, rel=1e-3)
    assert any("4 springs a beam" in note and "1.0% off" in note for note in found.notes)
    profile, _, table = found.machine.parts
    halves = [replace(profile, length=500.0, name=name) for name in ("left", "right")]
    slide = vjm.Joint("x", vjm.axis("x"), slides=True, compliance=2e-5, lateral=(2e-9, 2e-9))
    weld = replace(found.machine.closures[0], parts=("right", ""))
    two = vjm.build("two", [*halves, slide, table], {"middle": {"x": 0.0}}, after={"x": "left"}, closures=[weld])
    case = found.criticals["middle", "-z", "vjm-4"].load_case
    path = first_loss(Task(VjmEngine(4, parts=(("left", 4), ("right", 4))), two, case))
    # solvers stop at 1e-11, the point is found to 1e-9
    assert quantity(path, True, False) == pytest.approx(values[2], rel=1e-8)


@pytest.fixture(scope="module")
def loops():
    """A palletiser, whose parallelogram closes a loop, along one direction."""
    return study(Request("palletiser", (), ("z",)))


@pytest.mark.slow
def test_a_machine_with_closed_loops_has_the_report_of_an_arm(loops):
    lumped, reference = loops.loads
    assert (lumped.engine, reference.engine) == ("vjm-4", "exudyn")
    # 4 springs and 4 elements a beam: 2e-7 measured
    assert lumped.difference < 1e-4
    assert {row.engine: row.kind for row in loops.critical} == {"vjm-4": "bifurcation", "exudyn": "bifurcation"}
    ours, theirs = (row.F_cr for row in loops.critical)
    # 8 elements a beam: 2e-4 measured
    assert ours == pytest.approx(theirs, rel=2e-3)
    assert all(row.passed for row in own_acceptance(loops))


@pytest.mark.slow
def test_its_shares_add_up_and_its_map_holds_its_stiffness(loops):
    (row,) = loops.shares
    assert sum(part.energy for part in row.parts) == pytest.approx(1.0, abs=1e-12)
    # half of force times deflection is the strain energy: the deflection along the force, by the unloaded stiffness
    assert row.deflection[2] == pytest.approx(SMALL * loops.size / loops.loads[0].K0, rel=1e-9)
    middle = loops.map.values[len(loops.map.values) // 2]
    at = equilibria(
        Mechanism(loops.machine.refined(2).split()), Mechanism(loops.machine.refined(2).split()).posture("home")
    )
    worst = np.linalg.eigvalsh(at.compliance[0, 0, :3, :3])[-1]
    assert middle[0] == pytest.approx(1.0 / worst, rel=1e-6)


def test_what_it_says_to_stiffen_does_halve_the_deflection(loops, tmp_path):
    """The change is made in the file, and the deflection is asked for again by another way."""
    row = next(row for row in loops.sensitivity.parameters if row.factor)
    changed = MachineFiles.read("palletiser").with_numbers({row.parameter: row.factor * row.value}).machine("home")
    model = Mechanism(changed.refined(2).split())
    at = equilibria(model, model.posture("home"))
    assert loops.sensitivity.value == pytest.approx(loops.stiffened.K0, rel=1e-6)
    assert 1.0 / at.compliance[0, 0, 2, 2] == pytest.approx(2.0 * loops.stiffened.K0, rel=1e-4)


def test_a_mechanism_whose_end_moves_freely_is_held_and_says_what_it_lacks():
    found = study(Request("parallelogram", ("straight",), ("x",), reach=0.5, engines=("vjm",)))
    assert found.held
    assert any("passive joints let the end" in note for note in found.notes)
    assert not found.shares
    assert found.paths


def test_a_run_that_looked_at_nothing_is_no_pass(tmp_path, monkeypatch):
    arm = load_any_model.loaded("planar-2r")
    nothing = OwnMachine(arm, arm, False, 1.0, notes=["exudyn was left out"])
    (row,) = own_acceptance(nothing)
    assert (row.passed, "exudyn was left out" in str(row.value)) == (None, True)
    assert [accepted(rows) for rows in ([], [row], [at_most("a", 1.0, 2.0), row])] == [False, False, True]
    assert not accepted([at_most("a", 1.0, 2.0), at_most("b", 3.0, 2.0)])
    file = tmp_path / "fork.toml"
    file.write_text(TREE, encoding="utf-8")
    for name in ("trace_loads", "trace_critical"):
        monkeypatch.setattr(f"vjm_validation.studies.own_machine.{name}", lambda *_: None)
    assert "nothing was checked" in validate("all", file, "--out", tmp_path / "run", status=1).err
