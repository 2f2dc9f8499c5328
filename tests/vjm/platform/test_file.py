"""Manipulator files: what the library holds, and how a wrong file is reported."""

import tomllib
from importlib import resources

import pytest

from vjm.io.errors import ModelFileError
from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import build_manipulator, load_manipulator, manipulators
from vjm.io.model_file import ModelDocument, load_chain
from vjm.model.chain import Chain
from vjm.platform.manipulator import Manipulator

FOLDER = resources.files("vjm").joinpath("models", "manipulators")


def content(name="orthoglide"):
    return tomllib.loads(FOLDER.joinpath(f"{name}.toml").read_text(encoding="utf-8"))


def built(changed):
    return build_manipulator(ModelDocument("robot.toml", changed, ""), FOLDER / "chains")


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
        machine = load_manipulator(name)
        assert machine.name == name
        assert machine.source
        assert machine.sha256


def test_a_name_may_be_of_a_chain_or_of_a_manipulator():
    assert isinstance(load_model("orthoglide-chain"), Chain)
    assert isinstance(load_model("orthoglide"), Manipulator)
    with pytest.raises(ModelFileError, match="is a single chain"):
        load_manipulator("orthoglide-chain")
    with pytest.raises(ModelFileError, match=r"no model 'orthoglid' .* did you mean 'orthoglide'"):
        load_model("orthoglid")


def test_the_legs_are_the_papers_chain(robot):
    chain = load_chain("orthoglide-chain")
    for leg in robot("orthoglide").legs:
        assert leg.chain.sha256 == chain.sha256


def test_the_parallelograms_parts_are_the_chains_own(robot):
    chain = {part.name: part for part in load_chain("orthoglide-chain").beams}
    legs = {
        leg.name: {beam.name: beam for beam in leg.chain.beams} for leg in robot("orthoglide-parallelograms").legs
    }
    for axis in "xyz":
        bar, foot = legs[f"bar-{axis}1"]["bar"], legs[f"foot-{axis}"]["foot"]
        assert (bar.section, bar.length, bar.count) == (chain["link"].section, chain["link"].length, 1)
        assert (bar.compliance == chain["link"].compliance).all()
        assert (foot.section, foot.length) == (chain["foot"].section, chain["foot"].length)


def test_a_file_beside_the_manipulators_is_found(tmp_path):
    for name in ("delta-arm", "delta-rod"):
        text = FOLDER.joinpath("chains", f"{name}.toml").read_text(encoding="utf-8")
        (tmp_path / f"{name}.toml").write_text(text.replace("524.0", "520.0"), encoding="utf-8")
    (tmp_path / "mine.toml").write_text(FOLDER.joinpath("delta.toml").read_text(encoding="utf-8"), encoding="utf-8")
    machine = load_manipulator(tmp_path / "mine.toml")
    assert machine.legs[0].chain.beams[0].length == 520.0


def wrong(change):
    document = content()
    change(document)
    return document


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["legs"][1].update(chain="no-such-chain"), "chain 'no-such-chain' is neither a file beside"),
        (lambda d: d["legs"][1].update(drives="x"), "unknown key 'drives' in leg 'y'; did you mean 'drive'"),
        (lambda d: d["legs"][1].pop("name"), "name is missing"),
        (lambda d: d["legs"][1].update(drive="link"), "leg 'y': drive 'link' is no actuator"),
        (lambda d: d["legs"][1].update(drive="link", drive_turns_about="y"), "lies before the drive 'link'"),
        (lambda d: d["legs"][1].update(posture="Z"), "leg 'y': orthoglide-chain: no posture 'Z'"),
        (lambda d: d["legs"][1].update(posture=[0.0]), "leg 'y': 1 coordinates for 4 passive joints"),
        (lambda d: d["legs"][1].update(drive_limits=[5.0, 1.0]), r"drive_limits must be \[lower, upper\]"),
        (lambda d: d.update(legs=d["legs"][:1]), "only leg 'x' holds the platform"),
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


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('kind = "joint"\nstiffness_Nmm_per_rad = 1e5', "has a spring.*: leave its stiffness out"),
        ('kind = "actuated"', "is held at a coordinate.*: write kind = 'joint'"),
    ],
)
def test_a_joint_of_a_leg_that_is_not_free_is_refused_by_file_leg_and_joint(table, words, tmp_path):
    text = resources.files("vjm").joinpath("models", "orthoglide-chain.toml").read_text(encoding="utf-8")
    (tmp_path / "leg.toml").write_text(text.replace('kind = "joint"', table, 1), encoding="utf-8")
    robot = FOLDER.joinpath("orthoglide.toml").read_text(encoding="utf-8")
    (tmp_path / "p.toml").write_text(robot.replace("orthoglide-chain", "leg.toml"), encoding="utf-8")
    with pytest.raises(ModelFileError, match=f"^p.toml: leg 'x': joint 'q1' of chain 'leg.toml' {words}") as caught:
        load_manipulator(tmp_path / "p.toml")
    assert "\n" not in str(caught.value)
