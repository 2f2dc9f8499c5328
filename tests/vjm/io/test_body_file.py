"""Files of bodies and joints: the same machines as chain files, written by places, and what is wrong with one."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.file_texts import model_text, stiffness_of, table_text

import vjm
from vjm.io.body_file import JOINT_KINDS
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.machine.equilibria import equilibria
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.postures import in_posture

TUBE = stiffness_of(1.4778e8, 4.4897e10, 5.82e10, 5.82e10)
BAR = stiffness_of(8.4e7, 1.8222e9, 2.8e9, 2.8e9)


def written(folder: Path, *tables: str, name: str = "machine", end: dict[str, Any] | None = None) -> Path:
    file = folder / f"{name}.toml"
    file.write_text(
        model_text(name, *tables, kind="bodies", **({} if end is None else {"end": end})), encoding="utf-8"
    )
    return file


def bodies(*names: str) -> str:
    return "".join(table_text("[bodies]", name=name) for name in names)


def joint(name: str, first: str, second: str, at: Sequence[float], **keys: Any) -> str:
    """With its kind before its bodies, and its axis before what else it has."""
    kind = {"kind": keys.pop("kind")} if "kind" in keys else {}
    return table_text("[joints]", name=name, **kind, between=[first, second], at_mm=[float(v) for v in at], **keys)


def beam(name: str, first: str, second: str, start: Sequence[float], far: Sequence[float], section: Any) -> str:
    places = {"from_mm": [float(v) for v in start], "to_mm": [float(v) for v in far]}
    return table_text("[beams]", name=name, between=[first, second], **places, section=section)


def about_y(angle, length) -> np.ndarray:
    """A link along x that is turned about y."""
    return length * np.array([np.cos(angle), 0.0, -np.sin(angle)])


def palletiser() -> str:
    """The library's, by where its pins are at home: shoulder -1.3, elbow 1.5, lever 0.2 behind it."""
    column = np.array([150.0, 0.0, 500.0])
    elbow = column + about_y(-1.3, 600.0)
    wrist, rear = elbow + about_y(0.2, 700.0), elbow - about_y(0.2, 200.0)
    lever = column - about_y(0.2, 200.0)
    tool = wrist + np.array([-np.sin(0.2), 0.0, -np.cos(0.2)]) * 50.0
    balance = column + about_y(-1.3, 150.0)
    end = {
        "body": "tool",
        "at_mm": tool.tolist(),
        "turns": [{"turn_about": "y", "angle_deg": float(np.rad2deg(0.2))}],
    }
    drive, middle = {"kind": "actuated"}, column + about_y(-1.3, 300.0)
    return model_text(
        "machine",
        bodies("column"),
        table_text("[bodies]", name="upper-arm", mass_kg=25.0, centre_of_mass_mm=middle.tolist()),
        bodies("rear"),
        table_text("[bodies]", name="tool", mass_kg=30.0, centre_of_mass_mm=tool.tolist()),
        bodies("lever", "rod-foot", "rod-head"),
        joint("waist", "ground", "column", np.zeros(3), axis="z", compliance_rad_per_Nmm=1e-10, **drive),
        joint(
            "shoulder", "column", "upper-arm", column, axis="y", drawn=-1.3, compliance_rad_per_Nmm=5e-10, **drive
        ),
        joint("lever-drive", "column", "lever", column, axis="y", drawn=0.2, compliance_rad_per_Nmm=5e-10, **drive),
        joint("elbow", "upper-arm", "rear", elbow, axis="y"),
        joint("rod-low", "rod-foot", "lever", lever, axis="y"),
        joint("rod-high", "rod-head", "rear", rear, axis="y"),
        beam("forearm", "rear", "tool", elbow, wrist, TUBE),
        beam("rod", "rod-foot", "rod-head", lever, rear, BAR),
        table_text(
            "[point_springs]", name="compensator", between=["column", "upper-arm"],
            points_mm=[[0.0, 0.0, 250.0], balance.tolist()], stiffness_N_per_mm=15.0, free_length_mm=150.0,
        ),
        postures={"low": {"shoulder": -1.0, "lever-drive": 0.4}}, kind="bodies", end=end,
    )  # fmt: skip


def palletiser_file(folder: Path, old: str = "", new: str = "") -> Path:
    file = folder / "machine.toml"
    file.write_text(palletiser().replace(old, new, 1), encoding="utf-8")
    return file


def loaded(machine, posture):
    model = Mechanism(machine.split())
    return equilibria(model, model.posture(posture), gravity=(0.0, 0.0, -9.81))


def test_the_palletiser_by_its_pins_is_that_of_the_library(tmp_path):
    """Another tree, other frames and another place where its loop is cut; the same equilibria under weight."""
    own, known = load_model(palletiser_file(tmp_path)), load_model("palletiser")
    assert [closure.name for closure in own.closures] == ["rod-high-loop"]
    posed, low = in_posture(known, "waist=0,shoulder=-1.0,lever-drive=0.4")
    for label, other, machine in (("drawn", "home", known), ("low", low, posed)):
        found, wanted = loaded(own, label), loaded(machine, other)
        assert found.stable.all()
        assert wanted.stable.all()
        # numbers of the two files agree to rounding of angles in degrees
        assert found.position == pytest.approx(wanted.position, abs=1e-8)
        assert found.deflection == pytest.approx(wanted.deflection, abs=1e-9)
        assert found.stiffness == pytest.approx(wanted.stiffness, rel=1e-6, abs=1e-6 * wanted.stiffness.max())


def test_a_chain_by_its_places_is_the_library_s_chain_with_the_same_stiffness(tmp_path):
    machine = load_model(
        written(
            tmp_path,
            bodies("link", "tool"),
            joint(
                "shoulder", "link", "ground", np.zeros(3), kind="actuated", axis="z", compliance_rad_per_Nmm=1e-8
            ),
            beam("upper", "tool", "link", [900.0, 0.0, 0.0], np.zeros(3), TUBE),
            end={"body": "tool", "at_mm": [900.0, 0.0, 0.0]},
        )
    )
    found = loaded(machine, "drawn")
    # end deflection by unit forces: gear along y, bending, tension
    C = found.compliance[0, 0]
    assert C[0, 0] == pytest.approx(900.0 / 1.4778e8, rel=1e-9)
    assert C[1, 1] == pytest.approx(900.0**3 / (3.0 * 5.82e10) + 900.0**2 * 1e-8, rel=1e-9)
    assert C[2, 2] == pytest.approx(900.0**3 / (3.0 * 5.82e10), rel=1e-9)


def test_a_body_on_three_ball_rods_is_held_by_the_sum_of_their_stiffnesses(tmp_path):
    """Six struts with balls at both ends, three pairs: K = Σ k u uᵀ for the place; rods may spin."""
    rng = np.random.default_rng(4)
    tops = [
        100.0 * np.array([np.cos(a), np.sin(a), 0.0]) + [0, 0, 400.0]
        for a in np.deg2rad([0, 60, 120, 180, 240, 300])
    ]
    feet = [300.0 * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.deg2rad([50, 10, 170, 130, 290, 250])]
    tables, K = [bodies("top")], np.zeros((6, 6))
    for i, (foot, top) in enumerate(zip(feet, tops, strict=True)):
        EA = float(rng.uniform(1e6, 2e6))
        tables += [
            bodies(f"foot{i}", f"head{i}"),
            joint(f"low{i}", "ground", f"foot{i}", foot, kind="universal", axes=["x", "y"]),
            beam(f"rod{i}", f"foot{i}", f"head{i}", foot, top, stiffness_of(EA, 1e9, 1e9, 1e9)),
            joint(f"high{i}", f"head{i}", "top", top, kind="ball"),
        ]
        u = (top - foot) / np.linalg.norm(top - foot)
        J = np.concatenate([u, np.cross(top - [0, 0, 400.0], u)])
        K += EA / np.linalg.norm(top - foot) * np.outer(J, J)
    machine = load_model(written(tmp_path, *tables, end={"body": "top", "at_mm": [0.0, 0.0, 400.0]}))
    found = loaded(machine, "drawn")
    assert len(machine.closures) == 5
    assert found.stiffness[0, 0] == pytest.approx(K, rel=1e-9, abs=1e-9 * np.abs(K).max())


def test_a_file_of_bodies_is_loaded_like_any_other(tmp_path):
    machine = vjm.load(palletiser_file(tmp_path))
    assert isinstance(machine, Machine)
    assert set(machine.postures) == {"drawn", "low"}
    assert machine.held["low"]["shoulder"] == -1.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('["column", "lever"]', '["colum", "lever"]', "no body 'colum'; did you mean 'column'?"),
        ('name = "rear"', 'name = "elbow"', "stands twice"),
        ('name = "lever"\n', 'name = "lever"\n[[bodies]]\nname = "loose"\n', "body 'loose' is connected to"),
        ("mass_kg = 25.0\ncentre", "mass_kg = 25.0\n#", "body 'upper-arm' has mass_kg but no centre_of_mass_mm"),
        ('"actuated"\nbetween = ["ground"', '"ball"\nbetween = ["ground"', "of kind 'ball' takes no axis"),
        ("low = { shoulder", "low = { sholder", "no joint 'sholder'; did you mean 'shoulder'?"),
        ("axis = \"y\"\ndrawn", "axis = [1.0, 1.0, 0.0]\ndrawn", "write the unit vector"),
        ("EA_N = 84000000.0", "EA_N = -8.4e7", "part 'rod'"),
        ('name = "rod-foot"', 'name = "rod-foot"\nmas_kg = 1.0', "unknown key 'mas_kg'"),
        ("{ shoulder = -1.0", "{ elbow = 1.0, shoulder = -1.0", "no held joint 'elbow'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tmp_path, old, new, said):
    assert old in palletiser()
    file = palletiser_file(tmp_path, old, new)
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    assert said in str(error.value)
    assert str(error.value).startswith("machine.toml: ")
    assert "\n" not in str(error.value)


def spindle(folder: Path, thread: str) -> Path:
    """A motor turns a spindle, a nut slides on a guide, and a joint given by its text is between them."""
    return written(
        folder,
        bodies("spindle", "nut"),
        joint("motor", "ground", "spindle", np.zeros(3), kind="actuated", axis="x", compliance_rad_per_Nmm=1e-6),
        joint("guide", "ground", "nut", [200.0, 0.0, 0.0], axis="x", motion="slides"),
        table_text("postures", forward={"motor": 3.0}),
        table_text("[joints]", name="thread", at_mm=[200.0, 0.0, 0.0], axis="x") + thread,
        end={"body": "nut", "at_mm": [200.0, 0.0, 0.0]},
    )


@pytest.mark.parametrize(
    "thread",
    [
        'kind = "screw"\npitch_mm = 10.0\nbetween = ["spindle", "nut"]\n',
        'kind = "screw"\npitch_mm = 10.0\nbetween = ["nut", "spindle"]\n',
        'kind = "cylindrical"\nbetween = ["spindle", "nut"]\n'
        '[[couplings]]\nname = "lead"\nterms = [{ joint = "thread-slide", weight = 1.0 }, '
        '{ joint = "thread-turn", weight = -1.5915494309189535 }]\n',
    ],
)
def test_a_nut_on_a_screw_moves_and_yields_by_its_pitch(tmp_path, thread):
    """A turn of the motor is a pitch; a motor of compliance c gives c (pitch/2π)², whoever is named first."""
    machine = load_model(spindle(tmp_path, thread))
    found, turned = loaded(machine, "drawn"), loaded(machine, "forward")
    assert np.abs(turned.position - found.position - [-10.0 * 3.0 / (2.0 * np.pi), 0.0, 0.0]).max() < 1e-9
    # linear, but for rounding
    assert found.compliance[0, 0, 0, 0] == pytest.approx(1e-6 * (10.0 / (2.0 * np.pi)) ** 2, rel=1e-9)


def test_a_plate_on_a_plane_slides_across_its_axis_and_turns_about_it(tmp_path):
    """Two springs along x and one along y: these yield, and a force across the plane does nothing."""
    springs = [
        table_text(
            "[point_springs]", name=f"s{k}", between=["ground", "plate"], points_mm=points,
            stiffness_N_per_mm=stiffness, free_length_mm=100.0,
        )
        for k, (points, stiffness) in enumerate(
            [
                ([[-100.0, 50.0, 0.0], [0.0, 50.0, 0.0]], 2.0),
                ([[-100.0, -50.0, 0.0], [0.0, -50.0, 0.0]], 2.0),
                ([[0.0, -100.0, 0.0], [0.0, 0.0, 0.0]], 3.0),
            ]
        )
    ]  # fmt: skip
    slab = joint("slab", "ground", "plate", np.zeros(3), kind="planar", axis="z")
    end = {"body": "plate", "at_mm": [0.0, 0.0, 0.0]}
    machine = load_model(written(tmp_path, bodies("plate"), slab, *springs, end=end))
    model = Mechanism(machine.split())
    found = equilibria(model, np.zeros((1, 3)), wrench=1e-3 * np.array([4.0, 3.0, 7.0, 0.0, 0.0, 5.0]))
    # springs turn by their ends' shifts over their length, which is of the second order here
    assert found.deflection[0, 0] == pytest.approx([1e-3, 1e-3, 0.0, 0.0, 0.0, 5e-7], rel=1e-4)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ('kind = "screw"', "needs pitch_mm"),
        ('kind = "cylindrical"\npitch_mm = 10.0', "takes no pitch_mm"),
        ('kind = "screw"\npitch_mm = 10.0\ndrawn = 0.1', "takes no drawn: it is drawn at zero"),
        ('kind = "screws"', "no kind of joint; did you mean 'screw'"),
    ],
)
def test_what_a_kind_of_joint_does_not_take_is_refused(tmp_path, given, said):
    with pytest.raises(ModelFileError, match=said):
        load_model(spindle(tmp_path, given + '\nbetween = ["spindle", "nut"]\n'))


def test_the_page_on_model_files_lists_the_kinds_of_joints():
    page = (Path(__file__).parents[3] / "docs" / "model-file.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:4] for line in page.splitlines() if line.startswith("| `")]
    listed = [(name.strip(), needs.strip(), says.strip()) for name, needs, says in rows if len(says) > 0]
    for name, kind in JOINT_KINDS.items():
        assert (f"`{name}`", ", ".join(f"`{key}`" for key in kind.keys) or "–", kind.says) in listed
