"""A carriage on a cantilever as a test of poses: derivatives, a guide that turns, by the textbook's beam."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.command import validate
from helpers.file_texts import table_text
from helpers.from_files import calibrate_poses, diagnose_poses, prepared

import vjm
from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import toml_text
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.load_case import COMPONENTS
from vjm.model.mechanism import Mechanism

LENGTH, EI, ARM, BELOW = 1200.0, 1e10, 150.0, -100.0
GUIDE = 2e-7
"""rad/(N mm), of the guide about y."""
DOCUMENT = {
    "format": 1, "name": "crane", "title": "A carriage on a cantilever", "source": "made up",
    "units": {"length": "mm", "force": "N", "angle": "rad"},
    "parts": [
        {"kind": "beam", "name": "bridge", "length_mm": LENGTH,
         "section": {"EA_N": 1e8, "GJ_Nmm2": 8e9, "EIy_Nmm2": EI, "EIz_Nmm2": EI}},
        {"kind": "actuated", "name": "x", "axis": "x", "motion": "slides", "rides_on": "bridge",
         "limits_mm": [50.0, 1150.0]},
        {"kind": "actuated", "name": "z", "axis": "z", "motion": "slides", "limits_mm": [-300.0, 300.0],
         "compliance_mm_per_N": 1e-6},
        {"kind": "link", "name": "arm", "translation_mm": [ARM, 0.0, BELOW]},
    ],
    "postures": {"there": {"x": 400.0, "z": 0.0}},
}  # fmt: skip
SHEET = (
    'kind = "poses"\n'
    + table_text("test", title="A carriage on a cantilever", model="model.toml", order="unknown", source="made up")
    + table_text("markers.tool", sigma_mm=0.5)
    + table_text("tracker", noise_mm=0.01)
    + table_text("base", position_mm=[0.0, 0.0, 0.0], sigma_mm=0.05, sigma_rad=1e-5)
)


def places(x, z, force, guide, tilt=0.0):
    """Of the tool by the textbook's cantilever: the arm is rigid, and turns with the beam and the guide.

    It stands turned about y by ``tilt`` on the carriage, rad.
    """
    drop = force * (x**3 / (3.0 * EI) + ARM * x**2 / (2.0 * EI))
    slope = force * (x**2 / (2.0 * EI) + ARM * x / EI)
    # the beam's end turns with the slope, and the guide by what the force over the arm turns it by
    turn = slope + guide * force * ARM + tilt
    out = np.array([ARM + 0.0 * x, 0.0 * x, BELOW + z])
    c, s = np.cos(turn), np.sin(turn)
    return np.array([x + c * out[0] + s * out[2], out[1], -drop - s * out[0] + c * out[2]]).T


def written(folder, tilt):
    """Readings and sheet: eleven places by three heights under three forces."""
    rng = np.random.default_rng(5)
    grid = np.meshgrid(np.linspace(80.0, 1120.0, 11), [-200.0, 0.0, 250.0], [0.0, 40.0, 80.0])
    x, z, force = (v.reshape(-1) for v in grid)
    read = places(x, z, force, GUIDE, tilt) + rng.normal(0.0, 0.01, (len(x), 3))
    rows = [",".join(f"{v:.7g}" for v in row) for row in np.column_stack([x, z, read, -force])]
    (folder / "model.toml").write_text(toml_text(DOCUMENT))
    (folder / "sheet.toml").write_text(SHEET)
    (folder / "readings.csv").write_text(
        "\n".join(["x.q_mm,z.q_mm,tool.x_mm,tool.y_mm,tool.z_mm,tool.fz_N", *rows]) + "\n"
    )
    return folder / "readings.csv", folder / "sheet.toml"


@pytest.fixture(scope="module")
def crane(tmp_path_factory):
    return written(tmp_path_factory.mktemp("crane"), 0.0)


def test_derivatives_of_every_member(crane):
    _, study = prepared(*crane)
    forward, frames = study.forward(), study.frames
    z = np.where([member.kind == "compliance" for member in study.members], 0.5, 0.3)
    exact = forward.evaluate(z, frames).member[..., :3, :]
    for i, member in enumerate(study.members):
        step = np.eye(len(z))[i] * 1e-3
        plus, minus = (forward.evaluate(z + s, frames).residual[..., :3] for s in (step, -step))
        # squares of 1e-3 units, and rounding over them, of columns of 0.1 to 100 mm a unit
        assert np.abs((minus - plus) / 2e-3 - exact[..., i]).max() < 2e-5, member.name


def test_a_guide_that_turns_is_named_and_written(crane, tmp_path):
    found = diagnose_poses(*crane, tmp_path / "diagnosed")
    assert (str(found.verdict), found.causes) == ("named", ["lateral_compliance"])
    found = calibrate_poses(*crane, tmp_path / "out", families=["lateral_compliance"])
    members = {row.name: row for family in found.families for row in family.members}
    low, high = members["lateral_compliance.x.first"].interval95
    assert low < GUIDE < high
    # of 0.01 mm along each of three axes the mean length is 0.016
    assert found.after.random_mm < 0.02
    model = Mechanism(load_chain(str(tmp_path / "out" / "calibrated-model.toml")).split())
    x, z, force = np.array([300.0, 900.0, 1100.0]), np.array([100.0, -50.0, 0.0]), 60.0
    rows = np.column_stack([x, z])
    assert model.joints == ("x", "z")
    moved = equilibria(model, rows, wrench=np.array([0.0, 0.0, -force, 0.0, 0.0, 0.0])).deflection[:, 0, :3]
    truth = places(x, z, force, GUIDE) - places(x, z, 0.0, GUIDE)
    # of deflections of 0.5 to 4 mm; the guide's interval is 1 % wide
    assert np.abs(moved - truth).max() < 0.01


def test_what_is_behind_the_carriage_begins_behind_the_errors_of_its_frame(tmp_path):
    tilt = 4e-3
    files = written(tmp_path, tilt)
    found = calibrate_poses(*files, tmp_path / "out", families=["frame_error", "lateral_compliance"])
    assert found.after.random_mm < 0.02
    machine = load_chain(str(tmp_path / "out" / "calibrated-model.toml"))
    assert [part.name for part in machine.parts][:3] == ["bridge", "x", "x-frame"]
    assert machine.predecessors["x"] == ""
    z = np.array([-200.0, 0.0, 250.0])
    x, model = np.full(3, 500.0), Mechanism(machine.split())
    p = equilibria(model, np.column_stack([x, z])).position[:, 0]
    # by how much the tool moves from height to height: 1.8 mm along x by the tilt
    assert np.abs(np.diff(p, axis=0) - np.diff(places(x, z, 0.0, GUIDE, tilt), axis=0)).max() < 0.02


def test_derivatives_of_a_gantry_on_two_rails(tmp_path):
    """A closed machine without passive joints, whose far end is welded to a rail: it has no base that turns."""
    validate("new", "gantry", tmp_path / "model.toml")
    (tmp_path / "sheet.toml").write_text(SHEET)
    rng = np.random.default_rng(7)
    q = rng.uniform([0.0, 100.0, 0.0], [800.0, 1100.0, 300.0], (12, 3))
    read = q[:, [1, 0, 2]] + [0.0, 0.0, 100.0] + rng.normal(0.0, 0.01, (12, 3))
    rows = [",".join(f"{v:.7g}" for v in row) for row in np.column_stack([q, read, rng.uniform(-99.0, 99.0, 12)])]
    (tmp_path / "readings.csv").write_text(
        "\n".join(["y.q_mm,x.q_mm,z.q_mm,tool.x_mm,tool.y_mm,tool.z_mm,tool.fz_N", *rows]) + "\n"
    )
    _, study = prepared(tmp_path / "readings.csv", tmp_path / "sheet.toml")
    assert not [member.name for member in study.members if member.family == "base_compliance"]
    forward, frames = study.forward(), study.frames
    z = np.full(len(study.members), 0.1)
    exact = forward.evaluate(z, frames).member[..., :3, :]
    for i, member in enumerate(study.members):
        step = np.eye(len(z))[i] * 1e-3
        plus, minus = (forward.evaluate(z + s, frames).residual[..., :3] for s in (step, -step))
        assert np.abs((minus - plus) / 2e-3 - exact[..., i]).max() < 2e-5, member.name


@pytest.mark.slow
def test_the_drive_of_a_gantry_is_named_from_finite_elements(tmp_path):
    """Exudyn's gantry has a ram drive of 2e-4 mm/N, the sheet's one of 3e-5, in 24 postures under 24 forces."""
    pytest.importorskip("exudyn", reason="Exudyn, which makes the readings, is not installed")
    validate("new", "gantry", tmp_path / "model.toml")
    truth, (written_down, real) = (tmp_path / "true.toml"), ("mm_per_N = 3e-5", "mm_per_N = 2e-4")
    truth.write_text((tmp_path / "model.toml").read_text().replace(written_down, real))
    machine, rng, rows = load_chain(str(truth)), np.random.default_rng(1), []
    elements = engine_by_name("exudyn", EngineOptions(4), machine)
    for _ in range(24):
        at = dict(zip("yxz", rng.uniform([0.0, 100.0, 0.0], [800.0, 1100.0, 300.0]).tolist(), strict=True))
        there = replace(machine, held={"p": at}, postures={"p": np.zeros(0)})
        force = rng.uniform(-400.0, 400.0, 3)
        loads, weight = (vjm.Load((*force, 0.0, 0.0, 0.0)),), (0.0, 0.0, -9.81)
        case = vjm.LoadCase("p", 1.0, "load", loads=loads, free=COMPONENTS, gravity=weight, steps=2)
        moved = vjm.trace(there, case, engine=elements).points[-1].displacement[:3]
        read = np.array([at["x"], at["y"], at["z"] + 100.0]) + moved + rng.normal(0.0, 0.005, 3)
        rows.append([at["y"], at["x"], at["z"], *read, *force])
    head = "y.q_mm,x.q_mm,z.q_mm,tool.x_mm,tool.y_mm,tool.z_mm,tool.fx_N,tool.fy_N,tool.fz_N\n"
    (tmp_path / "readings.csv").write_text(
        head + "\n".join(",".join(f"{v:.8g}" for v in row) for row in rows) + "\n"
    )
    sheet = SHEET.partition("[base]")[0].replace("= 0.01", "= 0.005")
    sheet = sheet.replace("[markers", "gravity = [0.0, 0.0, -9.81]\n\n[markers")
    (tmp_path / "sheet.toml").write_text(sheet)
    found = diagnose_poses(tmp_path / "readings.csv", tmp_path / "sheet.toml", tmp_path / "out")
    assert (str(found.verdict), found.causes) == ("named", ["actuator_compliance"])
    members = {row.name: row for family in found.families for row in family.members}
    # what these readings tell; that of a new series is wider by what drives may change until then
    low, high = members["actuator_compliance.z"].within_series95
    assert low < 2e-4 < high
    assert high - low < 1e-4
    # of 0.005 mm along each of three axes the mean length is 0.008
    assert found.after.random_mm < 0.012
