"""Rigid manipulators: inverse kinematics against closed forms, mobility as theory says, and what is refused."""

import tomllib
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from helpers.legs import Leg, joined

import vjm
from vjm.engines import VjmEngine
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import build_machine, load_model
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import ModelDocument, load_chain
from vjm.machine.equilibria import equilibria
from vjm.machine.rigid_mechanism import LoopClosure, PoseError, home_label, moved_by_drives
from vjm.model.machine import ROOT, Machine, legs_of
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.postures import in_posture
from vjm.rotations import AXES, frame, rotation_from_vector, translation
from vjm_updating.maps.evaluate import OK, MapQuantity, MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map

LENGTH = 310.0
MOBILITY = {
    # freedom of the platform; constraints too many. One bar between universal joints leaves two constraints a leg
    "orthoglide": (3, 0),
    "3-puu": (3, 0),
    # two turns held by each leg, three of six too many
    "isoglide": (3, 3),
    # three for each planar parallelogram, and one turn of three that each leg holds and one would do
    "orthoglide-parallelograms": (3, 12),
    "parallelogram": (1, 3),
    # Grübler: six rods hold six freedoms; eight rods and a coupling hold six of the platform and two free arms
    "delta": (3, 0),
    "par2": (2, 1),
}


def closing(machine):
    return LoopClosure(machine, home_label(machine))


def rates(manipulator, displacement):
    """Motions of the platform by its drives, mm and rad by mm and rad."""
    there = closing(manipulator)
    unit, length = there.tree.unit[~there.tree.passive], there.tree.length
    moved = moved_by_drives(there.tree, there.displaced(np.asarray(displacement, dtype=float))[None])[0]
    return moved * np.repeat([length, 1.0], 3)[:, None] / unit


def drives(manipulator, displacement):
    """Coordinates of the drives, in the legs' order."""
    there = closing(manipulator)
    q = dict(zip(there.tree.names, there.displaced(np.asarray(displacement, dtype=float)).tolist(), strict=True))
    return [q[joint.name] for joint in manipulator.held_joints]


@pytest.mark.parametrize("p", [(0, 0, 0), (40, -30, 60), (-73.65, -73.65, -73.65), (126.35, 126.35, 126.35)])
def test_the_orthoglides_drives_are_those_of_its_closed_form(robot, p):
    # Wenger and Chablat 2000: ρ_x = x − √(L² − y² − z²), counted here from the isotropic point; the
    # chain's base is given to 1e-6 mm
    found = drives(robot("orthoglide"), [*p, 0, 0, 0])
    square = np.sum(np.square(p)) - np.square(p)
    assert found == pytest.approx(np.array(p) - np.sqrt(LENGTH**2 - square) + LENGTH, abs=1e-6)


@pytest.mark.parametrize(
    ("corner", "share", "derived"), [("Q1", -0.25, -LENGTH / 18**0.5), ("Q2", 0.5, LENGTH / 6**0.5)]
)
def test_the_orthoglides_workspace_is_the_one_of_its_design_criterion(robot, corner, share, derived):
    # Chablat and Wenger 2003: velocity transmission factors from 1/2 to 2; on the diagonal they are 1/(1+2t) and
    # 1/(1−t) with t = c/√(L² − 2c²). The corners in the file are quoted: they lie within 0.6 mm of the derived ones
    machine = robot("orthoglide")
    c = float(machine.poses[corner][0])
    assert np.ptp(machine.workspace, axis=0) == pytest.approx(np.full(3, 200.0))
    assert c == pytest.approx(derived, abs=0.6)
    factors = {}
    for at in (c, derived):
        # each drive's platform motions are shifts alone, mm by mm
        found = np.linalg.svd(rates(machine, [at] * 3 + [0.0] * 3)[:3], compute_uv=False)
        t = at / np.sqrt(LENGTH**2 - 2.0 * at**2)
        assert np.sort(found) == pytest.approx(np.sort(np.abs([1 / (1 + 2 * t), 1 / (1 - t), 1 / (1 - t)])))
        factors[at] = found
    assert share == pytest.approx(derived / np.sqrt(LENGTH**2 - 2.0 * derived**2))
    # at the derived corner the largest is 2; at the far one the smallest is 1/2 too
    assert factors[derived].max() == pytest.approx(2.0)
    assert factors[c].max() == pytest.approx(2.0, rel=0.01)
    assert factors[c].min() == pytest.approx({"Q1": 0.8, "Q2": 0.5}[corner], rel=0.01)


def test_the_deltas_arms_stand_where_its_closed_form_has_them(robot):
    # Williams 2016: each arm's end lies on the circle of the arm and the sphere of the rods
    machine = robot("delta")
    for label in machine.poses:
        p = machine.poses[label][:3] + closing(machine).end[:3, 3]
        turned = drives(machine, machine.poses[label])
        for leg, angle in enumerate(turned):
            turn = rotation_from_vector([0.0, 0.0, 2.0 * np.pi * leg / 3.0])
            near = np.array([np.sqrt(3.0) / 6.0 * 567.0 + 524.0 * np.cos(angle), 0.0, -524.0 * np.sin(angle)])
            far = turn.T @ p + [np.sqrt(3.0) / 3.0 * 76.0, 0.0, 0.0]
            # the error measured is 7e-9
            assert np.linalg.norm(far - near) == pytest.approx(1244.0, abs=2e-7)


def test_each_drive_of_the_isoglide_is_one_coordinate(robot):
    # Gogu 2004: the Jacobian is the unit matrix everywhere
    machine = robot("isoglide")
    for label in machine.poses:
        p = machine.poses[label]
        # the file's home posture is given to 1e-9 rad, which is 3e-7 mm at a bar's end
        assert drives(machine, p) == pytest.approx(p[:3], abs=1e-6)
        assert rates(machine, p)[:3] == pytest.approx(np.eye(3), abs=1e-8)


@pytest.mark.parametrize("name", [entry.name for entry in manipulators()])
def test_mobility_is_as_theory_says(robot, name):
    machine = robot(name)
    for label in machine.poses:
        found = closing(machine).mobility(closing(machine).displaced(machine.poses[label]))
        assert (found.freedom, found.redundant) == MOBILITY[name]
        assert found.idle_freedom == 0
        assert found.loose.shape[1] == (1 if name == "parallelogram" else 0)


def test_forward_kinematics_takes_inverse_kinematics_back(robot):
    machine = closing(robot("orthoglide"))
    there = machine.displaced(np.array([10.0, 20.0, -15.0, 0, 0, 0]))
    names = ("x", "y", "z")
    back = machine.held({name: float(there[machine.tree.names.index(name)]) for name in names})
    # the error measured is rounding alone
    assert back == pytest.approx(there, abs=1e-9)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ((300, 300, 0, 0, 0, 0), "out of reach: closure '[yz]' stays .* open"),
        ((0, 0, 0, 0, 0, 0.2), "out of reach: "),
        # beyond the singular point L/√3 = 178.98 the platform answers its drives the other way
        ((180, 180, 180, 0, 0, 0), "another branch"),
    ],
)
def test_poses_that_cannot_be_taken_are_refused_with_the_reason(robot, pose, words):
    with pytest.raises(PoseError, match=words):
        closing(robot("orthoglide")).displaced(np.array(pose, dtype=float))


def test_a_singular_pose_is_refused_with_the_motion_that_is_loose(robot):
    c = LENGTH / np.sqrt(3.0)
    with pytest.raises(PoseError, match=r"singular: with all drives held the end-effector still moves by"):
        closing(robot("orthoglide")).displaced(np.array([c, c, c, 0, 0, 0]))


def test_a_drive_beyond_its_limits_is_named(robot):
    with pytest.raises(PoseError, match=r"out of reach: a = .* its limit .* by .* (mm|rad)"):
        closing(robot("3-puu")).displaced(np.array([0, 0, -250.0, 0, 0, 0]))


def test_two_bases_at_odds_do_not_close(robot):
    machine = robot("orthoglide")
    turned = frame(rotation_from_vector([0.0, 0.0, 0.5]))
    parts = [
        replace(part, transform=turned @ part.transform)
        if isinstance(part, RigidOffset) and part.name == f"x/{ROOT}"
        else part
        for part in machine.parts
    ]
    with pytest.raises(PoseError, match=r"closure 'y' does not close at home: its frames are .* mm and 0\.5 rad"):
        closing(replace(machine, parts=tuple(parts)))


# Platforms whose legs slide passively, have no drive, or are rigid against some wrench.


SECTION = Section(EA=4e7, GJ=3e9, EIy=5e9, EIz=2e9)
DRIVE, BAR = 1e-4, 200.0


def cartesian(*, elastic: bool = True, turned: np.ndarray | None = None) -> Machine:
    """Three drives along x, y and z, each with a bar along it that ends in two passive slides across."""
    legs = []
    for a, b, c in ("xyz", "yzx", "zxy"):
        axes = np.column_stack([AXES[a], AXES[b], AXES[c]])
        bar = Beam("bar", BAR, own_frame=axes, section=SECTION)
        parts = (
            Joint("slide", AXES[a], slides=True, fixed=True, compliance=DRIVE),
            bar if elastic else RigidOffset("bar", translation(bar.tip)),
            Joint("u", AXES[b], slides=True, passive=True),
            Joint("v", AXES[c], slides=True, passive=True),
        )
        chain = Machine("leg", parts, postures={"h": np.zeros(2)})
        R = np.eye(4) if turned is None else turned
        drive = Joint("drive", AXES[a], slides=True)
        legs.append(
            Leg(
                a,
                chain,
                root=R @ translation(-bar.tip),
                attachment=R,
                drive=drive,
                before="slide",
                posture=[0.0, 0.0],
            )
        )
    return joined("cartesian", legs, {"h": np.zeros(6)})


@pytest.mark.parametrize("shift", [(50.0, 60.0, -70.0), (150.0, 0.0, 0.0), (400.0, -900.0, 80.0)])
def test_passive_slides_go_as_far_as_they_are_asked(shift):
    """Drives go along their own axes, slides along the others'; the stiffness is that of a bar and its drive."""
    robot, d = cartesian(), np.concatenate([shift, np.zeros(3)])
    label = ",".join(map(str, shift))
    posed, label = in_posture(robot, label)
    x, y, z = shift
    assert posed.held[label] == pytest.approx({"x": x, "y": y, "z": z}, abs=1e-9)
    assert posed.posture(label) == pytest.approx([y, z, z, x, x, y], abs=1e-9)
    K = vjm.stiffness(robot, ",".join(map(str, shift))).loaded
    assert np.diag(K)[:3] == pytest.approx(1.0 / (DRIVE + BAR / SECTION.EA), rel=1e-9)
    # and the way of many poses at once
    q, _ = LoopClosure(robot, home_label(robot)).all_displaced(d[None])
    states = equilibria(VjmEngine(16).model(robot), q)
    assert states.stiffness[0, 0] == pytest.approx(K, rel=1e-8, abs=1e-8 * np.abs(K).max())


def strut(i: int) -> tuple[Leg, np.ndarray, np.ndarray]:
    """A hexapod's leg: universal joint, drive held in its middle, strut, spherical joint; its foot and head."""
    low, high = (2 * np.pi * (i // 2) / 3 + s * (2 * (i % 2) - 1) for s in (0.2, 0.85))
    foot = 300.0 * np.array([np.cos(low), np.sin(low), 0.0])
    head = 150.0 * np.array([np.cos(high), np.sin(high), 0.0]) + [0.0, 0.0, 400.0]
    x = (head - foot) / np.linalg.norm(head - foot)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y)
    root = frame(np.column_stack([x, y, np.cross(x, y)]), foot)
    length = float(np.linalg.norm(head - foot))
    bar = Beam("strut", length, section=SECTION)
    names = ("u1", "u2", "s1", "s2", "s3")
    joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip(names, "yzxyz", strict=True)]
    parts = (*joints[:2], Joint("slide", AXES["x"], slides=True, fixed=True, compliance=DRIVE), bar, *joints[2:])
    chain = Machine(f"leg{i}", parts, postures={"h": np.zeros(5)})
    attachment = frame(root[:3, :3], head - [0.0, 0.0, 400.0])
    return Leg(f"l{i}", chain, root=root, attachment=attachment, posture=[0.0] * 5), foot, head


def test_legs_without_a_drive_hold_the_platform_at_home():
    """``K = Σ J⁻ᵀ k J⁻¹``: each strut is a spring along its own line."""
    legs, feet, heads = zip(*(strut(i) for i in range(6)), strict=True)
    robot = joined("hexapod", legs, {"home": np.zeros(6)}, translation([0.0, 0.0, 400.0]))
    K = np.zeros((6, 6))
    for foot, head in zip(feet, heads, strict=True):
        length = np.linalg.norm(head - foot)
        line = (head - foot) / length
        screw = np.concatenate([line, np.cross(head - [0.0, 0.0, 400.0], line)])
        K += np.outer(screw, screw) / (DRIVE + length / SECTION.EA)
    for engine, tolerance in (("vjm", 1e-10), ("vjm-paper", 1e-10), ("exudyn", 1e-7)):
        found = vjm.stiffness(robot, "home", engine=engine).loaded
        assert found == pytest.approx(K, rel=tolerance, abs=tolerance * np.abs(K).max()), engine
    with pytest.raises(PoseError, match=r"out of reach: nothing drives it, .* Give it drives"):
        vjm.stiffness(robot, "0,0,10")


def test_a_rigid_rotation_is_infinitely_stiff():
    """Three stiff bars with compliant drives: a platform that shifts by its drives and does not turn."""
    # turned, so that the rotation's zero is a sum and not a constant
    robot = cartesian(elastic=False, turned=frame(rotation_from_vector([0.3, -0.7, 0.4])))
    found = vjm.stiffness(robot, "h")
    assert np.all(np.isinf(found.loaded))
    C = np.zeros((6, 6))
    C[:3, :3] = DRIVE * np.eye(3)
    assert found.loaded_compliance == pytest.approx(C, abs=1e-14 * DRIVE)
    assert len(found.rigid) == 3
    assert np.all(found.rigid[:, :3] == 0.0)
    setting = MapSetting(robot, VjmEngine(4), MapQuantity.STIFFNESS)
    rows = run_map(Map(setting, points_of(setting.model, parsed_grid("x=-50:50:3", setting.model), "h")))
    assert rows.why == (OK,) * 3
    assert rows.values[:, :2] == pytest.approx(1.0 / DRIVE, rel=1e-12)
    assert np.all(np.isinf(rows.values[:, 2:]))


@pytest.mark.parametrize("engine", ["vjm", "vjm-paper", pytest.param("exudyn", marks=pytest.mark.slow)])
def test_a_force_on_rigid_legs_moves_what_is_elastic(engine: str):
    found = vjm.stiffness(cartesian(elastic=False), "h", wrench=(10.0, 0.0, 0.0, 0.0, 0.0, 0.0), engine=engine)
    assert found.displacement == pytest.approx([10.0 * DRIVE, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-11)
    assert np.all(np.isinf(found.loaded))
    # an imposed turn has no wrench that is determined
    with pytest.raises(ValueError, match="cannot move in every direction in which it is held"):
        vjm.stiffness(cartesian(elastic=False), "h", displacement=(0.0, 0.0, 0.0, 1e-3, 0.0, 0.0), engine=engine)


def test_a_leg_that_is_rigid_in_one_direction_alone():
    """A bar that does not twist: the platform turns as the two others bend, and not about x."""
    robot = cartesian()
    C = robot.beams[0].beam_compliance()
    C[3], C[:, 3] = 0.0, 0.0
    bar = replace(robot.beams[0], section=None, compliance=C)
    robot = replace(robot, parts=tuple(bar if part.name == bar.name else part for part in robot.parts))
    found = vjm.stiffness(robot, "h", engine="vjm-paper")
    assert len(found.rigid) == 1
    assert found.rigid[0] == pytest.approx([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], abs=1e-9)
    whole = vjm.stiffness(cartesian(), "h", engine="vjm-paper")
    # the limit of ever stiffer bars: K with its rx row and column gone
    rest = [0, 1, 2, 4, 5]
    limit = np.linalg.inv(whole.loaded[np.ix_(rest, rest)])
    assert found.loaded_compliance[np.ix_(rest, rest)] == pytest.approx(limit, rel=1e-9, abs=1e-12 * limit.max())


CASES = Path(__file__).parents[4] / "shared/cases/machines"


@pytest.mark.skipif(not CASES.exists(), reason="not redistributed: put it into ../shared beside the checkout")
def test_a_map_reaches_what_single_poses_reach():
    robot = vjm.load(CASES / "tripteron.toml")
    low, high = robot.workspace
    grid = np.linspace(0.0, 1.0, 10)
    shares = np.array(np.meshgrid(grid, grid, grid, indexing="ij")).reshape(3, -1).T
    poses = np.hstack([low + shares * (high - low), np.zeros((1000, 3))])
    q, _ = LoopClosure(robot, home_label(robot)).all_displaced(poses)
    states = equilibria(VjmEngine(4).model(robot), q)
    assert states.stable.all()
    for k in range(0, 1000, 83):
        K = vjm.stiffness(robot, ",".join(f"{v:.12g}" for v in poses[k, :3]), engine="vjm-4").loaded
        assert states.stiffness[k, 0] == pytest.approx(K, rel=1e-7, abs=1e-9 * np.abs(K).max())


# Manipulator files: what the library holds, and how a wrong file is reported.


FOLDER = resources.files("vjm").joinpath("models", "manipulators")


def content(name="orthoglide"):
    return tomllib.loads(FOLDER.joinpath(f"{name}.toml").read_text(encoding="utf-8"))


def built(changed):
    return build_machine(ModelDocument("robot.toml", changed, {}), FOLDER / "chains")


def test_the_library_holds_the_papers_manipulators_each_with_its_source():
    names = {entry.name for entry in manipulators()}
    assert {
        "orthoglide",
        "orthoglide-parallelograms",
        "3-puu",
        "isoglide",
        "delta",
        "par2",
        "parallelogram",
    } <= names
    for name in names:
        machine = load_model(name)
        assert machine.name == name
        assert machine.source
        assert machine.sha256


def test_a_name_may_be_of_a_chain_or_of_a_manipulator():
    assert not legs_of(load_model("orthoglide-chain"))
    assert [leg.name for leg in legs_of(load_model("orthoglide"))] == ["x", "y", "z"]
    with pytest.raises(ModelFileError, match=r"no model 'orthoglid' .* did you mean 'orthoglide'"):
        load_model("orthoglid")


def test_the_legs_are_the_papers_chain(robot):
    chain = load_chain("orthoglide-chain")
    for leg in legs_of(robot("orthoglide")):
        assert leg.parts == tuple(f"{leg.name}/{part.name}" for part in chain.parts)
        beams = {beam.name: beam for beam in robot("orthoglide").beams}
        for beam in chain.beams:
            own = beams[f"{leg.name}/{beam.name}"]
            assert (own.section, own.length, own.count) == (beam.section, beam.length, beam.count)
            assert (own.compliance == beam.compliance).all()


def test_the_parallelograms_parts_are_the_chains_own(robot):
    chain = {part.name: part for part in load_chain("orthoglide-chain").beams}
    beams = {beam.name: beam for beam in robot("orthoglide-parallelograms").beams}
    for axis in "xyz":
        bar, foot = beams[f"bar-{axis}1/bar"], beams[f"foot-{axis}/foot"]
        assert (bar.section, bar.length, bar.count) == (chain["link"].section, chain["link"].length, 1)
        assert (bar.compliance == chain["link"].compliance).all()
        assert (foot.section, foot.length) == (chain["foot"].section, chain["foot"].length)


def test_a_file_beside_the_manipulators_is_found(tmp_path):
    for name in ("delta-arm", "delta-rod"):
        text = FOLDER.joinpath("chains", f"{name}.toml").read_text(encoding="utf-8")
        (tmp_path / f"{name}.toml").write_text(text.replace("524.0", "520.0"), encoding="utf-8")
    (tmp_path / "mine.toml").write_text(FOLDER.joinpath("delta.toml").read_text(encoding="utf-8"), encoding="utf-8")
    machine = load_model(tmp_path / "mine.toml")
    assert machine.beams[0].length == 520.0


def wrong(change):
    document = content()
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["legs"][1].update(chain="no-such-chain"), "chain 'no-such-chain' is neither a file beside"),
        (lambda d: d["legs"][1].update(drives="x"), "leg 'y': unknown key 'drives'; did you mean 'drive'"),
        (lambda d: d["legs"][1].pop("name"), "name is missing"),
        (lambda d: d["legs"][1].update(drive="link"), "leg 'y': drive 'link' is no actuator"),
        (lambda d: d["legs"][1].update(posture="Z"), "leg 'y': orthoglide-chain: no posture 'Z'"),
        (lambda d: d["legs"][1].update(posture=[0.0]), "leg 'y': 1 coordinates for 4 joints"),
        (lambda d: d["legs"][1].update(drive_limits=[5.0, 1.0]), r"drive_limits must be \[lower, upper\]"),
        (lambda d: d["legs"][1].update(starts_on="rod"), "leg 'y' begins on 'rod', where no leg before it ends"),
        (lambda d: d["legs"][1].update(starts_on="platform", ends_on="base"), "leg 'y' ends on the base"),
        (lambda d: d.update(legs=[leg | {"ends_on": "rod"} for leg in d["legs"]]), "no leg ends on the platform"),
        (lambda d: d["legs"].append(d["legs"][0]), "part name 'x/root' stands twice"),
        (lambda d: d["poses"].update(high=[1.0, 2.0, 3.0, 4.0]), "pose 'high' must have 3 entries"),
        (lambda d: d.update(couplings=[{"name": "c", "terms": []}]), "at least 2 entries"),
        (lambda d: d.update(platfrom={}), "unknown key 'platfrom'; did you mean 'platform'"),
    ],
)
def test_a_wrong_file_is_reported_in_one_line_that_names_the_key(change, words):
    with pytest.raises(ModelFileError, match=words) as caught:
        built(wrong(change))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("robot.toml: ")
