"""Laws of joints in tests of robots: written where they are found, and taken from models."""

import numpy as np
import pytest
from helpers.deflections import compliant, displacement, drawn
from helpers.from_files import diagnose_poses
from hidden_effects.poses import injector
from hidden_effects.poses.deflections import NOISE, columns_of, files
from hidden_effects.poses.plan import NOISE as TRACKED
from hidden_effects.poses.plan import save
from hidden_effects.poses.robots import UR10, document, sheet_text

from vjm.io.files import toml_text
from vjm.io.model_file import build_chain, load_chain
from vjm.model.laws import DeadZone, Polynomial, StrainWave, Tabulated
from vjm_updating.poses.machine import straight_and_rest

CRACKED = 1.2e-8
"""rad/(N mm): what the second joint turns by more to one side."""


@pytest.mark.parametrize(
    "law",
    [
        StrainWave(K1=5e7, K2=8e7, K3=9e7, T1=1.4e4, T2=4.8e4),
        Polynomial(K1=1e8, range=(-0.01, 0.01), K3=2e12),
        Tabulated((-2e-3, -1e-3, 0.0, 1e-3, 3e-3), (-1e5, -2e4, 0.0, 8e4, 1e5)),
        DeadZone(stiffness=1e7, clearance=2e-3),
    ],
)
def test_a_straight_spring_and_the_rest_are_the_law(law):
    compliance, rest = straight_and_rest(law)
    for force in np.linspace(-2e5, 2e5, 41).tolist():
        both = compliance * force + rest.deflection(force)
        # cubics through five hundred pairs
        assert both == pytest.approx(law.deflection(force), rel=1e-4, abs=1e-12)
    # a thousandth of its least compliance is left in the rest, and none of that falls
    assert (np.diff(rest.deflections) > 0.0).all()
    steepest = float(law.tangent(np.linspace(*law.curve.knots[[0, -1]], 100_001)).max())
    assert compliance == pytest.approx(0.999 / steepest, rel=1e-2)


def cracked(seed, *, stiffer=1.0):
    """Readings of a robot of which a joint deflects more to one side."""
    hidden = compliant()
    hidden.crack = (1, CRACKED)
    hidden.own = hidden.own * [1.0, 1.0, stiffer, 1.0, 1.0, 1.0]
    q, force = drawn(seed, postures=40)
    d = displacement(hidden, q, force)
    return columns_of(q, force, d + np.random.default_rng(seed).normal(0.0, NOISE, d.shape))


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cracked")
    return diagnose_poses(*files(folder, cracked(7)), folder / "out"), folder / "out" / "extended-model.toml"


def test_a_joint_that_deflects_more_to_one_side_is_written_as_a_law(diagnosed):
    found, file = diagnosed
    assert found.verdict in ("named", "class")
    assert {"actuator_compliance", "tension_compression_asymmetry"} in map(set, [found.causes, *found.alternatives])
    assert (found.not_in_model, found.written.without) == ([], [])
    # the fit of what the file holds is that of all that was judged; frames are fitted once more
    assert found.written.file_mm == pytest.approx(found.written.judged_mm, rel=0.05)
    joint = next(joint for joint in load_chain(file).held_joints if joint.name == "joint-2")
    c = compliant().own[1]
    for torque in (-2e4, 2e4):
        truth = c * torque + (CRACKED * torque if torque > 0.0 else 0.0)
        assert joint.law.deflection(torque) == pytest.approx(truth, rel=0.05)


def next_series(diagnosed, folder, columns):
    """The diagnosis of a next series by the model that was written."""
    data, sheet = files(folder, columns)
    (folder / "model.toml").write_text(diagnosed[1].read_text())
    sheet.write_text(sheet.read_text().replace("rigid = true", "rigid = false"))
    return diagnose_poses(data, sheet, folder / "out")


def test_the_written_law_leaves_nothing_of_a_next_series(diagnosed, tmp_path):
    found = next_series(diagnosed, tmp_path, cracked(11))
    assert (found.verdict, found.causes) == ("none", [])
    # the noise is 0.01 mm a coordinate, its distance sqrt(8/π) of that in the mean
    assert found.before.fitted_mm == pytest.approx(NOISE * np.sqrt(8.0 / np.pi), rel=0.1)


def test_a_joint_is_found_stiffer_beside_a_law_of_the_model(diagnosed, tmp_path):
    found = next_series(diagnosed, tmp_path, cracked(12, stiffer=0.9))
    assert found.causes == ["actuator_compliance"]
    rows = {row.name: row for row in found.families[0].members}
    row = rows["actuator_compliance.joint-3"]
    assert abs(row.value - 0.9 * compliant().own[2]) < 4.0 * row.std + 0.01 * row.value
    assert found.written.file_mm == pytest.approx(found.written.judged_mm, rel=0.05)


def with_springs(content, *, laws):
    """The document of a robot with its joints' compliances, or straight laws of them."""
    for part, c in zip((p for p in content["parts"] if p["kind"] == "actuated"), compliant().own, strict=True):
        part.pop("compliance_rad_per_Nmm", None)
        if laws:
            k = 1.0 / float(c)
            part["law"] = StrainWave(K1=k, K2=k, K3=k, T1=1e4, T2=4e4).table(slides=False)
        else:
            part["compliance_rad_per_Nmm"] = float(c)
    return toml_text(content)


@pytest.mark.parametrize("kind", ["poses", "deflections"])
def test_a_straight_law_is_a_compliance(kind, tmp_path):
    hidden = compliant()
    hidden.own = hidden.own * [1.0, 1.4, 1.0, 1.0, 1.0, 1.0]
    found = []
    for laws in (False, True):
        folder = tmp_path / str(laws)
        if kind == "deflections":
            q, force = drawn(5)
            d = displacement(hidden, q, force) + np.random.default_rng(2).normal(0.0, NOISE, (len(q), 3))
            data, sheet = files(folder, columns_of(q, force, d))
            sheet.write_text(sheet.read_text().replace("rigid = true", "rigid = false"))
        else:
            folder.mkdir()
            q = np.random.default_rng(8).uniform(-2.0, 2.0, (60, 6))
            data, sheet = folder / "readings.csv", folder / "sheet.toml"
            save(data, q, injector.measure(UR10, hidden, q, TRACKED, np.random.default_rng(9)))
            sheet.write_text(sheet_text(UR10, TRACKED, "as taken").replace("rigid = true", "rigid = false"))
        (folder / "model.toml").write_text(with_springs(document(UR10), laws=laws))
        found.append(diagnose_poses(data, sheet, folder / "out"))
    constant, law = found
    assert (law.verdict, law.causes) == (constant.verdict, constant.causes)
    # the same machine in two parts: rounding
    for one, other in ((law.before, constant.before), (law.after, constant.after)):
        assert one.fitted_mm == pytest.approx(other.fitted_mm, rel=1e-9)
    assert law.written.file_mm == pytest.approx(constant.written.file_mm, rel=1e-9)
    # of the compliance a thousandth is in the rest of the law, and is not told
    values = [{row.name: row.value for family in one.families for row in family.members} for one in found]
    assert values[1] == pytest.approx(values[0], rel=1.001e-3)
    assert constant.causes == ["actuator_compliance"]


def test_a_law_of_a_joint_that_another_follows_is_refused(tmp_path):
    content = document(UR10)
    content["parts"].append({"kind": "coupled", "name": "follower", "axis": "z", "to": {"joint-6": 1.0}})
    part = next(p for p in content["parts"] if p["name"] == "joint-6")
    part.pop("compliance_rad_per_Nmm", None)
    part["law"] = StrainWave(K1=5e7, K2=8e7, K3=9e7, T1=1.4e4, T2=4.8e4).table(slides=False)
    assert build_chain(content, "model").laws
    data, sheet = files(tmp_path, cracked(7))
    sheet.write_text(sheet.read_text().replace("rigid = true", "rigid = false"))
    (tmp_path / "model.toml").write_text(toml_text(content))
    with pytest.raises(ValueError, match="joint 'joint-6' has a law, and it is coupled") as refused:
        diagnose_poses(data, sheet, tmp_path / "out")
    assert "\n" not in str(refused.value)
