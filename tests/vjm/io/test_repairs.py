"""What no machine can have in a robot's file: repaired and said, left out, or refused."""

from pathlib import Path

import numpy as np
import pytest
from helpers.urdf_arm import arm, imported, joint, link, refusal
from scipy.optimize import minimize

from vjm.io.errors import ModelFileError
from vjm.io.inertia import inertia_matrix, inertia_values, is_of_a_body, nearest_of_a_body
from vjm.io.robot import Reading
from vjm.io.robot_document import Imported
from vjm.io.robot_file import Description, import_robot
from vjm.rotations import rotation_from_vector

pytestmark = pytest.mark.usefixtures("readers_in_this_process")

REVERSED = {"j2": joint("j2", "l1", "l2", more='<limit lower="1.5" upper="-2"/>')}


def part(found, name):
    return next(one for one in found.document["parts"] if one["name"] == name)


# --- moments of inertia ---------------------------------------------------------------------------------------


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(8))
def test_the_nearest_moments_are_nearer_than_any_other(seed):
    """Against a search over masses in space, Σ = L L', of the tensors tr(Σ) 1 − Σ that bodies have."""
    rng = np.random.default_rng(seed)
    R = rotation_from_vector(rng.normal(size=3))
    moments = rng.uniform(-0.5, 3.0, 3)
    moments[0] = np.abs(moments[1:]).sum() + rng.uniform(0.2, 3.0)
    given = R @ np.diag(moments) @ R.T
    assert not is_of_a_body(inertia_values(given))

    def off(entries):
        L = np.zeros((3, 3))
        L[np.tril_indices(3)] = entries
        spread = L @ L.T
        return float(np.sum((np.trace(spread) * np.eye(3) - spread - given) ** 2))

    starts = (rng.normal(size=6) for _ in range(20))
    least = min(minimize(off, start, method="BFGS", options={"gtol": 1e-10}).fun for start in starts)
    nearest = nearest_of_a_body(given)
    assert is_of_a_body(inertia_values(nearest), rounded=1e-12)
    # squares of what is not zero: a search ends at the square root of rounding
    assert np.sum((nearest - given) ** 2) == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.0), (3.0, 2.0, 4.0), (0.0, 1.0, 1.0)])
def test_moments_that_a_body_has_stay(moments):
    given = np.diag(moments)
    assert np.abs(nearest_of_a_body(given) - given).max() < 1e-14


def test_impossible_moments_of_a_urdf_become_the_nearest(tmp_path):
    """About turned axes, and said with the principal moments before and after."""
    odd = link("l2", inertia='<inertia ixx="1" iyy="1" izz="3"/>').replace('0.02"/>', '0.02" rpy="0.3 0.2 0.1"/>')
    found = imported(tmp_path, arm(l2=odd))
    moments = np.linalg.eigvalsh(inertia_matrix(part(found, "l2-mass")["inertia_kg_mm2"]))
    assert moments == pytest.approx([4e6 / 3, 4e6 / 3, 8e6 / 3], rel=1e-12)
    assert (
        "link 'l2': principal moments of inertia 1, 1, 3 kg m², which no body has, became 1.333, 1.333, 2.667, the "
        "nearest ones"
    ) in found.notes.changed


@pytest.mark.parametrize("inertia", ['<inertia ixx="1" iyy="1" izz="3"/>', '<inertia ixx="-1" iyy="1" izz="1"/>'])
def test_impossible_moments_are_left_out_or_refused_where_that_is_asked(tmp_path, inertia):
    text = arm(l2=link("l2", inertia=inertia))
    found = imported(tmp_path, text, repairs="left out")
    assert "inertia_kg_mm2" not in part(found, "l2-mass")
    assert "link 'l2' has moments of inertia that no body has: left out" in found.notes.doubtful
    said = refusal(tmp_path, text, repairs="refused")
    assert "line 5: link 'l2' has moments of inertia that no body has: correct them" in said


# --- limits, masses, bases ------------------------------------------------------------------------------------


def test_reversed_limits_are_exchanged_left_out_or_refused(tmp_path):
    found = imported(tmp_path, arm(**REVERSED))
    assert part(found, "j2")["limits_rad"] == [-2.0, 1.5]
    assert "joint 'j2' has the limits 1.5 to -2 rad, reversed: they were exchanged" in found.notes.changed
    found = imported(tmp_path, arm(**REVERSED), repairs="left out")
    assert "limits_rad" not in part(found, "j2")
    assert "joint 'j2' has the limits 1.5 to -2 rad, reversed: taken as none" in found.notes.doubtful
    assert "1.5 to -2 rad, reversed: give lower below upper" in refusal(
        tmp_path, arm(**REVERSED), repairs="refused"
    )


def test_a_mass_of_twenty_tonnes_is_read_and_doubted(tmp_path):
    found = imported(tmp_path, arm(l2=link("l2", "20000")))
    assert part(found, "l2-mass")["mass_kg"] == 20000.0
    assert "link 'l2' has a mass of 20000 kg, above 10000 kg: is it in g?" in found.notes.doubtful


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_floating_base_is_fixed_where_that_is_asked(tmp_path, kind):
    text = arm(j1=joint("j1", "base", "l1", kind))
    assert f"joint 'j1' is {kind}, and a machine stands on its base: --fix-base" in refusal(tmp_path, text)
    found = imported(tmp_path, text, fix_base=True)
    assert f"joint 'j1' is {kind}: it holds 'l1' where it is" in found.notes.changed
    fixed = imported(tmp_path, arm(j1=joint("j1", "base", "l1", "fixed")))
    assert found.document == fixed.document


# --- every reader repairs, leaves out and refuses alike -------------------------------------------------------

MJCF = (
    '<mujoco><compiler angle="radian"{balance}/><worldbody><body name="a"><joint name="j1" axis="0 0 1"{limit}/>'
    '<inertial mass="2" pos=".3 0 0" {moments}/></body></worldbody></mujoco>'
)
SDF = (
    '<sdf version="1.9"><model name="m"><link name="base"/><link name="a"><inertial><pose>.3 0 0 {turned}</pose>'
    "<mass>2</mass><inertia>{moments}</inertia></inertial></link><joint name='j1' type='revolute'>"
    "<parent>base</parent><child>a</child><axis><xyz>0 0 1</xyz>{limit}</axis></joint></model></sdf>"
)
URDF = (
    '<robot name="m"><link name="base"/><link name="a"><inertial><origin xyz=".3 0 0" rpy="{turned}"/>'
    '<mass value="2"/><inertia {moments}/></inertial></link><joint name="j1" type="revolute"><parent link="base"/>'
    '<child link="a"/><axis xyz="0 0 1"/>{limit}</joint></robot>'
)
TURNED = "0.3 0.2 0.1"


def odd_files(moments: tuple[float, float, float]) -> dict[str, str]:
    """An arm about z in each format, reversed limits and principal moments, kg m², in turned axes."""
    x, y, z = moments
    R = turned_axes()
    full = inertia_values(R @ np.diag(moments) @ R.T)
    xx, yy, zz, xy, xz, yz = full
    quaternion = " ".join(map(str, quaternion_of(R)))
    mjcf_limit = ' limited="true" range="1.5 -2"'
    tags = zip(("ixx", "iyy", "izz"), moments, strict=True)
    return {
        "full.xml": MJCF.format(
            balance="", limit=mjcf_limit, moments=f'fullinertia="{xx!r} {yy!r} {zz!r} {xy!r} {xz!r} {yz!r}"'
        ),
        "principal.xml": MJCF.format(
            balance="", limit=' range="1.5 -2"', moments=f'quat="{quaternion}" diaginertia="{x} {y} {z}"'
        ),
        "balanced.xml": MJCF.format(
            balance=' balanceinertia="true"', limit=mjcf_limit,
            moments=f'quat="{quaternion}" diaginertia="{x} {y} {z}"',
        ),
        "arm.sdf": SDF.format(
            turned=TURNED, moments="".join(f"<{tag}>{value}</{tag}>" for tag, value in tags),
            limit="<limit><lower>1.5</lower><upper>-2</upper></limit>",
        ),
        "arm.urdf": URDF.format(
            turned=TURNED, moments=f'ixx="{x}" iyy="{y}" izz="{z}"', limit='<limit lower="1.5" upper="-2"/>'
        ),
    }  # fmt: skip


def turned_axes() -> np.ndarray:
    """Roll, pitch and yaw about fixed axes."""
    roll, pitch, yaw = (float(word) for word in TURNED.split())
    about = [rotation_from_vector(np.array(v)) for v in ((0, 0, yaw), (0, pitch, 0), (roll, 0, 0))]
    return about[0] @ about[1] @ about[2]


def quaternion_of(R: np.ndarray) -> tuple[float, float, float, float]:
    w = 0.5 * float(np.sqrt(1.0 + np.trace(R)))
    x, y, z = ((R[2, 1] - R[1, 2]), (R[0, 2] - R[2, 0]), (R[1, 0] - R[0, 1]))
    return w, float(x / 4 / w), float(y / 4 / w), float(z / 4 / w)


def of_file(folder: Path, file: str, stiff: str = "stiffness_Nm_per_rad = 5000.0", **how) -> Imported:
    """An odd file with the stiffness of its one drive beside it."""
    (folder / file).write_text(odd_files((1.0, 1.0, 3.0))[file], encoding="utf-8")
    if stiff:
        (folder / f"{Path(file).stem}.stiffness.toml").write_text(f"[joints.j1]\n{stiff}\n")
    return import_robot(Description(folder / file), None, Reading(**how))


@pytest.mark.parametrize("file", odd_files((1.0, 1.0, 3.0)))
def test_every_reader_repairs_and_says_the_effect_on_the_lowest_frequency(tmp_path, file):
    """Closed form: about z the arm has m r² and the moment about z of its tensor, on 5000 N m/rad."""
    found = of_file(tmp_path, file)
    assert part(found, "j1")["limits_rad"] == [-2.0, 1.5]
    R = turned_axes()

    def hertz(moments):
        about_z = 2.0 * 0.3**2 + (R @ np.diag(moments) @ R.T)[2, 2]
        return f"{np.sqrt(5000.0 / about_z) / (2.0 * np.pi):.4g} Hz"

    given, nearest, without = map(hertz, ((1.0, 1.0, 3.0), (4 / 3, 4 / 3, 8 / 3), (0.0, 0.0, 0.0)))
    assert len({given, nearest, without}) == 3
    assert (
        f"the lowest natural frequency in the posture home is {given} with the moments of inertia of the file. "
        f"With the nearest ones it is {nearest}, without those of these bodies {without}"
    ) in found.notes.changed
    own = inertia_matrix(part(found, "a-mass")["inertia_kg_mm2"])
    # the 1e-12 that MuJoCo's rounding asks for
    assert own == pytest.approx(1e6 * R @ np.diag([4 / 3, 4 / 3, 8 / 3]) @ R.T, rel=1e-9, abs=1e-3)
    for line in ("which no body has, became 1.333, 1.333, 2.667", "the limits 1.5 to -2 rad, reversed"):
        assert sum(line in one for one in found.notes.changed) == 1


@pytest.mark.parametrize("file", odd_files((1.0, 1.0, 3.0)))
def test_every_reader_leaves_out_or_refuses_where_that_is_asked(tmp_path, file):
    found = of_file(tmp_path, file, repairs="left out")
    assert "limits_rad" not in part(found, "j1")
    assert "inertia_kg_mm2" not in part(found, "a-mass")
    doubts = "\n".join(found.notes.doubtful)
    assert "has moments of inertia that no body has: left out" in doubts
    assert "reversed: taken as none" in doubts
    assert any("the lowest natural frequency" in line for line in found.notes.changed)
    with pytest.raises(ModelFileError, match=r"reversed|no body has"):
        of_file(tmp_path, file, repairs="refused")


@pytest.mark.parametrize("file", odd_files((1.0, 1.0, 3.0)))
def test_each_repair_alone_is_refused_by_strict(tmp_path, file):
    text = odd_files((1.0, 1.0, 3.0))[file]
    for changed, says in (
        (odd_files((1.0, 1.0, 2.0))[file], "reversed: give lower below upper"),
        (text.replace("1.5", "-2.5"), "has moments of inertia that no body has: correct them"),
    ):
        (tmp_path / file).write_text(changed, encoding="utf-8")
        with pytest.raises(ModelFileError, match=says):
            import_robot(Description(tmp_path / file), None, Reading(repairs="refused"))


def test_without_a_stiffness_there_is_no_frequency_and_that_is_said(tmp_path):
    found = of_file(tmp_path, "arm.urdf", stiff="")
    (line,) = [one for one in found.notes.changed if "frequency" in one]
    assert line.startswith(
        "no stiffness is known of j1, and so no frequency. With NAME.stiffness.toml beside the file"
    )


def test_moments_that_make_the_mass_negative_have_no_frequency(tmp_path):
    text = odd_files((1.0, 1.0, -3.0))["arm.urdf"]
    (tmp_path / "arm.urdf").write_text(text)
    (tmp_path / "arm.stiffness.toml").write_text("[joints.j1]\nstiffness_Nm_per_rad = 5000.0\n")
    said = import_robot(Description(tmp_path / "arm.urdf")).notes.changed
    assert any(
        "is none (a motion has a negative mass) with the moments of inertia of the file" in one for one in said
    )
