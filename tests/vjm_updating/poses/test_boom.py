"""A telescoping boom as a test of poses: derivatives of every member, made-up readings, and the measured boom."""

import numpy as np
import pytest
from helpers.boom import SHEET, document, readings
from helpers.from_files import diagnose_poses, prepared
from helpers.measured import needed
from helpers.urdf_arm import import_urdf

from vjm.io.files import toml_text
from vjm.io.model_file import build_chain
from vjm.machine.equilibria import unloaded_frames
from vjm.model.mechanism import Mechanism


def files(folder, text):
    (folder / "model.toml").write_text(toml_text(document()))
    (folder / "sheet.toml").write_text(SHEET)
    (folder / "readings.csv").write_text(text)
    return folder / "readings.csv", folder / "sheet.toml"


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    """Eight lengths under five forces: heights by the textbook's beam on a root that turns."""
    rng = np.random.default_rng(3)
    length, force = (v.reshape(-1) for v in np.meshgrid(np.linspace(250.0, 2000.0, 8), np.linspace(0.0, 6.0, 5)))
    EI, w, root = 1.5e8, 9.81 * 0.65 / 2100.0, 1.2e-6
    moment = force * length + 0.5 * w * length**2
    drop = force * length**3 / (3.0 * EI) + w * length**4 / (8.0 * EI) + root * moment * length
    height = 375.0 - drop + rng.normal(0.0, 1.0, drop.shape)
    rows = [f"{a:.6g},{b:.6g},{-c:.6g}" for a, b, c in zip(length, height, force, strict=True)]
    return files(tmp_path_factory.mktemp("boom"), "\n".join(["extension.q_mm,tip.z_mm,tip.fz_N", *rows]) + "\n")


def test_derivatives_of_every_member(made_up):
    _, study = prepared(*made_up)
    forward, frames = study.forward(), study.frames
    z = np.where([member.kind == "compliance" for member in study.members], 0.5, 0.3)
    exact = forward.evaluate(z, frames).member[..., 2, :]
    for i, member in enumerate(study.members):
        step = np.eye(len(z))[i] * 1e-3
        plus, minus = (forward.evaluate(z + s, frames).residual[..., 2] for s in (step, -step))
        # of 1e-3 units: squares of those and rounding over them, of columns of 1 to 100 mm a unit
        assert np.abs((minus - plus) / 2e-3 - exact[..., i]).max() < 2e-5, member.name


def test_a_root_that_turns_is_named(made_up, tmp_path):
    found = diagnose_poses(*made_up, tmp_path / "out")
    # the same place, the same axis
    same = {"base_compliance.base.y": "base_compliance", "lateral_compliance.extension.first": "lateral_compliance"}
    assert {*found.causes, *found.alternatives[0]} == set(same.values())
    (group,) = found.findings.groups
    assert set(group.causes) == set(same.values())
    row = next(row for row in found.families[0].members if row.identifiable)
    assert same[row.name] == found.causes[0]
    assert row.interval95[0] < 1.2e-6 < row.interval95[1]
    # in URDF the boom's end slides out
    urdf = Mechanism(build_chain(import_urdf(tmp_path / "out/calibrated.urdf").document, "urdf").split())
    _, p = unloaded_frames(urdf, {name: 1500.0 if name == "extension" else 0.0 for name in urdf.joints})
    assert p[0, 0] == pytest.approx([1500.0, 0.0, 0.0], abs=1e-9)


def test_the_measured_boom(tmp_path):
    found = diagnose_poses(*files(tmp_path, readings(needed("boom_giraf.csv"))), tmp_path / "out")
    assert found.causes[0] in ("base_compliance", "lateral_compliance")  # of the same place and axis
    assert found.before.fitted_mm > 6.0
    assert found.after.random_mm < 2.5
    assert found.after.region_mm < 2.5
