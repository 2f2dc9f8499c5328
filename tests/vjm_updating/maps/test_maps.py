"""Maps: their values, going on after an interrupt, their files, and what is refused."""

import csv
import json
import os
import signal
import socket
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from helpers.in_pose import in_pose

import vjm
from vjm.continuation.load_stepping import follow
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm_updating.maps import run as cluster
from vjm_updating.maps import run as runner
from vjm_updating.maps.evaluate import COLUMNS, OK, MapQuantity, MapSetting, evaluate, principal
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.output import write_map
from vjm_updating.maps.run import Map, run_map
from vjm_validation.schemas import schemas


def small(quantity=MapQuantity.STIFFNESS, name="orthoglide", grid="x=-40:40:3,y=0:60:2,z=0", **more):
    springs = VjmEngine() if name == "orthoglide" else VjmEngine(1)
    return of(MapSetting(load_model(name), springs, quantity, **more), grid)


def of(setting, grid):
    points = points_of(setting.model, parsed_grid(grid, setting.model), next(iter(setting.machine.postures)))
    return Map(setting, points)


def grid_of(text, name):
    return parsed_grid(text, VjmEngine().model(load_model(name)))


def test_a_grid_is_a_number_or_axes():
    assert grid_of("21", "orthoglide").shape == (21, 21, 21)
    grid = grid_of("z=20, x=-50:50:11", "orthoglide")
    assert grid.shape == (11, 1)
    assert small(grid="z=20, x=-50:50:11").points.places[0].tolist() == [-50.0, 0.0, 20.0]
    # a plane's machine has one layer
    assert grid_of("5", "par2").shape == (5, 1, 5)


@pytest.mark.parametrize("text", ["0", "x=1:2", "w=3", "x=1:0:4", "x=0:1:1", "x=a", "x=0:1:2.5", "x=0:1:1e9"])
def test_a_grid_that_makes_no_sense_is_refused(text):
    with pytest.raises(ValueError, match="--grid"):
        grid_of(text, "orthoglide")


@pytest.mark.parametrize("name", ["orthoglide", "3-puu", "delta", "par2"])
def test_stiffness_is_that_of_the_single_pose(name, tmp_path):
    wanted = small(name=name, grid="x=-20:20:2")
    found = run_map(wanted, tmp_path)
    assert found.why == (OK, OK)
    for row, place in zip(found.values, wanted.points.places, strict=True):
        load_case = LoadCase(",".join(f"{v!r}" for v in place.tolist()), 1.0)
        K = wanted.setting.engine.problem(*in_pose(wanted.setting.machine, load_case)).unloaded().stiffness
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
    monkeypatch.setattr(runner, "POINTS", dict.fromkeys(MapQuantity, 1))
    whole = run_map(small(), tmp_path / "whole")
    calls = []

    def counted(task):
        calls.append(task.number)
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
        run_map(of(MapSetting(load_model("orthoglide"), VjmEngine(2), MapQuantity.STIFFNESS), "x=0"), tmp_path)


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "POINTS", dict.fromkeys(MapQuantity, 2))
    one, two = (run_map(small(), tmp_path / str(jobs), jobs) for jobs in (1, 2))
    assert np.array_equal(one.values, two.values)


def test_the_command_writes_csv_vtk_and_a_figure(tmp_path, monkeypatch):
    monkeypatch.setattr("vjm_output.optional_drawing.why_not_rendered", lambda: "no graphics in this test")
    assert (
        "kt_min_N_per_mm"
        in validate("map", "orthoglide", "--grid", "x=0,y=0:300:3,z=0:300:2", "--jobs", "1", "--out", tmp_path).out
    )
    lines = (tmp_path / "map.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# model=orthoglide engine=vjm-4 quantity=stiffness")
    rows = list(csv.DictReader(lines[1:]))
    assert len(rows) == 6
    assert list(rows[0]) == ["x", "y", "z", "x_mm", "y_mm", "z_mm", *COLUMNS[MapQuantity.STIFFNESS], "status"]
    assert rows[0]["status"] == OK
    assert rows[-1]["status"] != OK
    assert rows[-1]["kt_min_N_per_mm"] == ""
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"
    import pyvista

    grid = pyvista.read(tmp_path / "map.vtr")
    assert grid.dimensions == (1, 3, 2)
    # VTK runs x fastest
    assert grid.point_data["kt_min_N_per_mm"][1] == pytest.approx(float(rows[2]["kt_min_N_per_mm"]))
    document = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, schemas()["map.schema.json"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["orthoglide-chain"], "leave the end a mechanism"),
        (["orthoglide", "--quantity", "deflection"], "needs one"),
        (["orthoglide", "--wrench", "1,2"], "not three or six"),
        (["orthoglide", "--quantity", "critical", "--wrench", "1,2,3"], "leave it out"),
        (["orthoglide", "--quantity", "critical", "--engine", "exudyn"], "follows one force at a time"),
        (["orthoglide", "--grid", "x=0", "--most", "-1"], "positive force"),
        (["orthoglid"], "did you mean 'orthoglide'"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, words, tmp_path):
    error = refused("map", *arguments, "--out", tmp_path / "out")
    assert words in " ".join(error.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "par2"])
def test_the_weakest_direction_of_a_machine_with_bodies_between(name):
    machine = load_model(name)
    x, y, z = machine.poses["side"][:3].tolist()
    rows = run_map(of(MapSetting(machine, VjmEngine(), MapQuantity.CRITICAL), f"x={x},y={y},z={z}"))
    assert rows.why == (OK,)
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
    machine = replace(load_model("parallelogram"), title=r"<img src=x onerror=alert(1)> $\frac{ & $5")
    wanted = of(MapSetting(machine, VjmEngine(), MapQuantity.STIFFNESS), "x=0:1:2")
    files, _ = write_map(run_map(wanted, tmp_path), tmp_path)
    for file in files:
        if file.suffix in (".csv", ".vtr"):
            assert b"onerror" not in file.read_bytes()


def test_a_pose_that_sends_a_drive_beyond_its_limits_has_no_value():
    machine = load_model("3-puu")
    drive = machine.held_joints[0]
    labels = ("0,0,0", "20,-10,15")
    at = [in_pose(machine, LoadCase(label, 1.0))[0].held[label][drive.name] for label in labels]
    edge = 0.5 * sum(at)
    limits = (-1e3, edge) if at[1] > edge else (edge, 1e3)
    tight = replace(drive, limits=limits)
    machine = replace(machine, parts=tuple(tight if part.name == drive.name else part for part in machine.parts))
    setting = MapSetting(machine, VjmEngine(), MapQuantity.STIFFNESS)
    for grid, why in (("x=0,y=0,z=0", OK), ("x=20,y=-10,z=15", f"out of reach: {drive.name} = ")):
        found = run_map(of(setting, grid))
        assert why in found.why[0]
    assert f"by {abs(at[1] - edge):.4g} mm" in found.why[0]
    assert np.isnan(found.values).all()


@pytest.mark.parametrize("quantity", [MapQuantity.FREQUENCY, MapQuantity.SHARES])
def test_maps_of_every_quantity_and_machine_go_on_where_they_were_cut_off(tmp_path, quantity, monkeypatch):
    """Parts of a pose's answer too: the second run computes nothing again."""
    monkeypatch.setattr(runner, "POINTS", dict.fromkeys(MapQuantity, 1))
    setting = MapSetting(load_model("planar-2r"), VjmEngine(2), quantity, wrench=(0.0, -50.0, 0.0, 0.0, 0.0, 0.0))
    wanted = of(setting, "elbow=0.4:1.2:3")
    whole = run_map(wanted, tmp_path)

    def no_more(task):
        raise AssertionError(task.number)

    monkeypatch.setattr(runner, "evaluate", no_more)
    again = run_map(wanted, tmp_path)
    assert set(whole.why) == {OK}
    assert np.array_equal(again.values, whole.values)
    assert again.names == whole.names
    assert bool(whole.names) == (quantity is MapQuantity.SHARES)


# Maps on a Dask cluster: the same rows, also when a worker is killed half-way; a scheduler that is not there.


distributed = pytest.importorskip("distributed", reason="Dask is an optional extra and is not installed")


def free_port():
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


@pytest.mark.filterwarnings("ignore")
def test_a_dead_scheduler_is_one_line_and_status_2(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", "2s")
    address = f"tcp://127.0.0.1:{free_port()}"
    arguments = ["map", "orthoglide", "--grid", "x=0", "--scheduler", address, "--out", str(tmp_path / "out")]
    said = " ".join(validate(*arguments, status=2).err.split())
    assert f"--scheduler {address}: no Dask scheduler answers there" in said


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "POINTS", dict.fromkeys(MapQuantity, 4))
    setting = MapSetting(load_model("orthoglide"), VjmEngine(), MapQuantity.CRITICAL)
    wanted = Map(setting, points_of(setting.model, parsed_grid("5", setting.model), "isotropic"))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        victims = [worker["id"] for worker in cluster.scheduler_info["workers"].values()]
        assert len(victims) == 2
        killed = []

        def progress(done, total):
            if done >= total // 2 and not killed:
                killed.append(cluster.workers[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        found = run_map(wanted, tmp_path / "cluster", scheduler=cluster.scheduler_address, progress=progress)
    assert killed
    alone = run_map(wanted, tmp_path / "alone", jobs=1)
    assert found.why == alone.why
    assert np.array_equal(found.values, alone.values, equal_nan=True)


# Maps by other engines, differences of two, and maps of several wrenches: against direct calls of the engines.


GRID = ("--posture", "bent", "--grid", "elbow=0.5:1.5:3")
ELBOWS = (0.5, 1.0, 1.5)


def deflection(elbow: float, wrench, engine: str) -> float:
    found = vjm.stiffness(
        vjm.load("planar-2r"), {"shoulder": 0.5, "elbow": elbow}, wrench=wrench, engine=vjm.engine_by_name(engine)
    )
    return float(np.linalg.norm(found.displacement[:3]))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["msa", "vjm-linear", "exudyn"])
def test_an_arm_by_another_engine_and_its_difference_to_springs(engine: str, tmp_path):
    wrench = (40.0, -60.0, 0.0, 0.0, 0.0, 0.0)
    words = ("map", "planar-2r", *GRID, "--quantity", "deflection", "--wrench", ",".join(map(str, wrench)))
    found = json_of(*words, "--engine", engine, "--against", "vjm-4", "--out", tmp_path / "map")
    jsonschema.validate(found, schemas()["map-rows.schema.json"])
    assert found["against"] == "vjm-4"
    for k, elbow in enumerate(ELBOWS):
        a, b = deflection(elbow, wrench, engine), deflection(elbow, wrench, "vjm-4")
        # the batch of springs and the path of the engine solve to 1e-11
        assert found["values"][k][6] == pytest.approx(a, rel=1e-7)
        assert found["difference_percent"][k] == pytest.approx(100.0 * (a - b) / b, rel=1e-4, abs=1e-6)
    rows = list(csv.DictReader((tmp_path / "map" / "difference.csv").read_text().splitlines()))
    assert [float(row["difference_percent"]) for row in rows] == pytest.approx(found["difference_percent"])
    assert (tmp_path / "map" / "difference.png").stat().st_size > 5000


def test_a_hundred_newtons_along_each_axis_in_one_command(tmp_path):
    pushes = ("--wrench", "100,0,0", "--wrench", "0,100,0", "--wrench", "0,0,100")
    words = ("map", "planar-2r", *GRID, "--quantity", "deflection", *pushes, "--engine", "vjm-2")
    page = tmp_path / "page.html"
    found = json_of(*words, "--out", tmp_path / "map", "--report", page)
    jsonschema.validate(found, schemas()["maps.schema.json"])
    for axis, one in enumerate(found["maps"]):
        wrench = 100.0 * np.eye(6)[axis]
        assert one["wrench"] == wrench.tolist()
        expected = [deflection(elbow, wrench, "vjm-2") for elbow in ELBOWS]
        assert [row[6] for row in one["values"]] == pytest.approx(expected, rel=1e-7)
        assert (tmp_path / "map" / f"wrench-{axis + 1}" / "map.csv").exists()
    assert (tmp_path / "map" / "side-by-side.png").stat().st_size > 5000
    assert "One map for each wrench" in page.read_text()


@pytest.mark.slow
def test_a_platform_against_the_linear_model_names_the_worst_pose(tmp_path):
    words = ["map", "orthoglide", "--grid", "x=-20:20:2,y=0,z=0", "--engine", "vjm-paper", "--against", "msa"]
    wrench = np.array([0.0, 0.0, -500.0, 0.0, 0.0, 0.0])
    said = " ".join(validate(*words, "--wrench", "0,0,-500", "--out", tmp_path / "map").out.split())
    assert "difference to msa:" in said
    rows = list(csv.DictReader((tmp_path / "map" / "difference.csv").read_text().splitlines()))
    machine = vjm.load("orthoglide")
    for row, x in zip(rows, (-20.0, 20.0), strict=True):
        smallest_stiffness = []
        for engine in ("vjm-paper", "msa"):
            K = vjm.stiffness(machine, (x, 0.0, 0.0), wrench=wrench, engine=vjm.engine_by_name(engine)).loaded
            smallest_stiffness.append(1.0 / np.linalg.eigvalsh(np.linalg.inv(K)[:3, :3])[-1])
        expected = 100.0 * (smallest_stiffness[0] / smallest_stiffness[1] - 1.0)
        # 500 N soften it by 0.02 %: both solve to 1e-9 of the stiffness
        assert abs(expected) > 0.01
        assert float(row["difference_percent"]) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("engine", "said"),
    [("msa", "is linear and knows no loss of stability"), ("exudyn-8", "unknown engine 'exudyn-8'")],
)
def test_what_an_engine_lacks_is_said(engine: str, said: str, tmp_path):
    words = ["map", "planar-2r", *GRID, "--quantity", "critical", "--engine", engine]
    assert said in refused(*words, "--out", tmp_path / "map")
    assert not (tmp_path / "map").exists()
