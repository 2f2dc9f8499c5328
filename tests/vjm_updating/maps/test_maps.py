"""Maps: their values, going on after an interrupt, their files, and what is refused."""

import csv
import json
from dataclasses import replace
from pathlib import Path as FilePath

import jsonschema
import numpy as np
import pytest

from vjm.continuation.load_stepping import follow
from vjm.io.manipulator_file import load_manipulator
from vjm.machine.legs import in_pose
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.vjm_engine import VjmEngine
from vjm_updating.maps import run as runner
from vjm_updating.maps.evaluate import (
    COLUMNS,
    OK,
    MapQuantity,
    MapTask,
    evaluate,
    principal,
)
from vjm_updating.maps.output import write_map
from vjm_updating.maps.pose_grid import parsed_grid
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli.main import run
from vjm_validation.schemas import schemas

SCHEMAS = FilePath(__file__).parents[3] / "docs/schemas"


def small(quantity=MapQuantity.STIFFNESS, name="orthoglide", grid="x=-40:40:3,y=0:60:2,z=0", **more):
    machine = load_manipulator(name)
    springs = VjmEngine() if name == "orthoglide" else VjmEngine(1)
    return Map(machine, springs, quantity, parsed_grid(grid, machine), **more)


def test_a_grid_is_a_number_or_axes():
    machine = load_manipulator("orthoglide")
    assert parsed_grid("21", machine).shape == (21, 21, 21)
    grid = parsed_grid("x=-50:50:11, z=20", machine)
    assert grid.shape == (11, 1, 1)
    assert grid.poses()[0].tolist() == [-50.0, 0.0, 20.0, 0.0, 0.0, 0.0]
    # a plane's machine has one layer
    assert parsed_grid("5", load_manipulator("par2")).shape == (5, 1, 5)


@pytest.mark.parametrize("text", ["0", "x=1:2", "w=3", "x=1:0:4", "x=0:1:1", "x=a", "x=0:1:2.5", "x=0:1:1e9"])
def test_a_grid_that_makes_no_sense_is_refused(text):
    with pytest.raises(ValueError, match="--grid"):
        parsed_grid(text, load_manipulator("orthoglide"))


@pytest.mark.parametrize("name", ["orthoglide", "3-puu", "delta", "par2"])
def test_stiffness_is_that_of_the_single_pose(name, tmp_path):
    wanted = small(name=name, grid="x=-20:20:2")
    found = run_map(wanted, tmp_path)
    assert found.why == (OK, OK)
    for row, pose in zip(found.values, wanted.grid.poses(), strict=True):
        load_case = LoadCase(",".join(f"{v!r}" for v in pose.tolist()), 1.0)
        K = wanted.springs.problem(*in_pose(wanted.manipulator, load_case)).unloaded().stiffness
        assert row == pytest.approx(principal(np.linalg.inv(K)[None])[0], rel=1e-6)


def test_a_deflection_and_a_critical_force_at_the_isotropic_point(tmp_path):
    load = small(MapQuantity.DEFLECTION, grid="x=0", wrench=(-1000.0, 0, 0, 0, 0, 0))
    assert run_map(load, tmp_path / "a").values[0, 0] == pytest.approx(-1000.0 / 3300.33, rel=2e-3)
    weak = small(MapQuantity.CRITICAL, grid="x=0", most=5000.0)
    assert run_map(weak, tmp_path / "b").values[0, 0] == pytest.approx(2696.0, rel=2e-3)


def test_a_pose_without_an_answer_says_why_and_stops_no_other(tmp_path):
    found = run_map(small(grid="x=0,y=0:300:2,z=0:300:2"), tmp_path)
    assert found.why[0] == OK
    assert "out of reach" in found.why[3]
    assert np.isnan(found.values[3]).all()


def test_a_map_goes_on_where_it_was_cut_off(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "POSES", dict.fromkeys(MapQuantity, 1))
    whole = run_map(small(), tmp_path / "whole")
    calls = []

    def counted(task):
        calls.append(task.index)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return evaluate(task)

    monkeypatch.setattr(runner, "evaluate", counted)
    with pytest.raises(KeyboardInterrupt):
        run_map(small(), tmp_path / "cut")
    seen = []
    again = run_map(small(), tmp_path / "cut", progress=lambda done, total: seen.append((done, total)))
    assert calls == [0, 1, 2, 3, 3, 4, 5]
    assert np.array_equal(again.values, whole.values)
    assert seen[-1] == (6, 6)


def test_a_folder_with_another_map_is_refused(tmp_path):
    run_map(small(grid="x=0"), tmp_path)
    with pytest.raises(ValueError, match="holds another map"):
        run_map(small(grid="x=1"), tmp_path)
    with pytest.raises(ValueError, match="holds another map"):
        run_map(replace(small(grid="x=0"), springs=VjmEngine(2)), tmp_path)


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "POSES", dict.fromkeys(MapQuantity, 2))
    one, two = (run_map(small(), tmp_path / str(jobs), jobs) for jobs in (1, 2))
    assert np.array_equal(one.values, two.values)


def test_the_command_writes_csv_vtk_and_a_figure(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("vjm_output.off_screen.why_not_rendered", lambda: "no graphics in this test")
    assert (
        run(["map", "orthoglide", "--grid", "x=0,y=0:300:3,z=0:300:2", "--jobs", "1", "--out", str(tmp_path)]) == 0
    )
    assert "kt_min_N_per_mm" in capsys.readouterr().out
    lines = (tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# model=orthoglide engine=vjm-4 quantity=stiffness")
    rows = list(csv.DictReader(lines[1:]))
    assert len(rows) == 6
    assert list(rows[0]) == ["x_mm", "y_mm", "z_mm", *COLUMNS[MapQuantity.STIFFNESS], "status"]
    assert rows[0]["status"] == OK
    assert rows[-1]["status"] != OK
    assert rows[-1]["kt_min_N_per_mm"] == ""
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"
    import pyvista

    grid = pyvista.read(tmp_path / "map.vtr")
    assert grid.dimensions == (1, 3, 2)
    # VTK runs x fastest
    assert grid.point_data["kt_min_N_per_mm"][1] == pytest.approx(float(rows[2]["kt_min_N_per_mm"]))
    for file, schema in (("map.json", "map"), ("tasks/000000.json", "map-task")):
        document = json.loads((tmp_path / file).read_text(encoding="utf-8"))
        published = json.loads((SCHEMAS / f"{schema}.schema.json").read_text(encoding="utf-8"))
        assert published == schemas()[f"{schema}.schema.json"]
        jsonschema.validate(document, published)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["orthoglide-chain"], "is a single chain"),
        (["orthoglide", "--quantity", "deflection"], "needs one"),
        (["orthoglide", "--wrench", "1,2"], "not three or six"),
        (["orthoglide", "--quantity", "critical", "--wrench", "1,2,3"], "leave it out"),
        (["orthoglide", "--quantity", "critical", "--engine", "exudyn"], "follows one force at a time"),
        (["orthoglide", "--grid", "x=0", "--most", "-1"], "positive force"),
        (["orthoglid"], "did you mean 'orthoglide'"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, words, tmp_path, capsys):
    assert run(["map", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert words in " ".join(error.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "par2"])
def test_the_weakest_direction_of_a_machine_with_bodies_between(name):
    machine = load_manipulator(name)
    pose = machine.displacement("side")
    task = MapTask(0, machine, VjmEngine(), MapQuantity.CRITICAL, pose[None], (0.0,) * 6, 20_000.0)
    rows = evaluate(task)
    assert rows.why == [OK]
    force, *direction = rows.values[0]
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    for share, lost in ((0.99, []), (1.01, ["bifurcation"])):
        load = Load((*(share * force * np.array(direction)).tolist(), 0.0, 0.0, 0.0))
        load_case = LoadCase("side", 1.0, "load", loads=(load,), free=COMPONENTS, steps=4)
        path = follow(VjmEngine().problem(*in_pose(machine, load_case)), load_case)
        assert [str(event.kind) for event in path.events] == lost


@pytest.mark.slow
def test_titles_are_drawn_as_they_stand_and_break_no_file(tmp_path):
    """A title that is a formula, no formula, and a tag: the figure is drawn, and the files hold none of it."""
    machine = replace(load_manipulator("parallelogram"), title=r"<img src=x onerror=alert(1)> $\frac{ & $5")
    wanted = Map(machine, VjmEngine(), MapQuantity.STIFFNESS, parsed_grid("x=0:1:2", machine))
    files, _ = write_map(run_map(wanted, tmp_path), tmp_path)
    for file in files:
        if file.suffix in (".csv", ".vtr"):
            assert b"onerror" not in file.read_bytes()


def test_a_pose_that_sends_a_drive_beyond_its_limits_has_no_value():
    """With errors of assembly and without: the rigid pose's own drives say which are refused."""
    machine = load_manipulator("3-puu")
    poses = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [20.0, -10.0, 15.0, 0.0, 0.0, 0.0]])
    leg = machine.legs[0]
    labels = [",".join(f"{v!r}" for v in pose.tolist()) for pose in poses]
    drives = [in_pose(machine, LoadCase(label, 1.0))[0].held[label][leg.name] for label in labels]
    edge = 0.5 * sum(drives)
    limits = (-np.inf, edge) if drives[1] > edge else (edge, np.inf)
    tight = replace(machine, legs=(replace(leg, drive=replace(leg.drive, limits=limits)), *machine.legs[1:]))
    gap = abs(drives[1] - edge)
    for each in (tight, tight.with_errors({leg.name: {leg.chain.beams[0].name: 1e-9}})):
        found = evaluate(MapTask(0, each, VjmEngine(), MapQuantity.STIFFNESS, poses, (0.0,) * 6, 1.0))
        assert found.why[0] == "ok"
        assert f"out of reach: the drive of leg '{leg.name}' = " in found.why[1]
        assert f"by {gap:.4g} mm" in found.why[1]
        assert np.isnan(found.values[1]).all()
