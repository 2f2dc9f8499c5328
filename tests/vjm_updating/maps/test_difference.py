"""Maps by other engines, differences of two, and maps of several wrenches: against direct calls of the engines."""

from __future__ import annotations

import csv
import json

import jsonschema
import numpy as np
import pytest

import vjm
from vjm_validation.cli.main import run
from vjm_validation.schemas import schemas

GRID = ("--posture", "bent", "--grid", "elbow=0.5:1.5:3")
ELBOWS = (0.5, 1.0, 1.5)


def deflection(elbow: float, wrench, engine: str) -> float:
    found = vjm.stiffness(
        vjm.load("planar-2r"), {"shoulder": 0.5, "elbow": elbow}, wrench=wrench, engine=vjm.engine_by_name(engine)
    )
    return float(np.linalg.norm(found.displacement[:3]))


def document_of(capsys, *words):
    assert run([*map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["msa", "vjm-linear", "exudyn"])
def test_an_arm_by_another_engine_and_its_difference_to_springs(engine: str, tmp_path, capsys):
    wrench = (40.0, -60.0, 0.0, 0.0, 0.0, 0.0)
    words = ("map", "planar-2r", *GRID, "--quantity", "deflection", "--wrench", ",".join(map(str, wrench)))
    found = document_of(capsys, *words, "--engine", engine, "--against", "vjm-4", "--out", tmp_path / "map")
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


def test_a_hundred_newtons_along_each_axis_in_one_command(tmp_path, capsys):
    pushes = ("--wrench", "100,0,0", "--wrench", "0,100,0", "--wrench", "0,0,100")
    words = ("map", "planar-2r", *GRID, "--quantity", "deflection", *pushes, "--engine", "vjm-2")
    page = tmp_path / "page.html"
    found = document_of(capsys, *words, "--out", tmp_path / "map", "--report", page)
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
def test_a_platform_against_the_linear_model_names_the_worst_pose(tmp_path, capsys):
    words = ["map", "orthoglide", "--grid", "x=-20:20:2,y=0,z=0", "--engine", "vjm-paper", "--against", "msa"]
    wrench = np.array([0.0, 0.0, -500.0, 0.0, 0.0, 0.0])
    assert run([*words, "--wrench", "0,0,-500", "--out", str(tmp_path / "map")]) == 0
    said = " ".join(capsys.readouterr().out.split())
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
def test_what_an_engine_lacks_is_said(engine: str, said: str, tmp_path, capsys):
    words = ["map", "planar-2r", *GRID, "--quantity", "critical", "--engine", engine]
    assert run([*words, "--out", str(tmp_path / "map")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "map").exists()
