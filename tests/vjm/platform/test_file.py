"""Manipulator files: what the library holds, and how a wrong file is reported."""

import tomllib
from importlib import resources

import pytest

from vjm.io.errors import ModelFileError
from vjm.io.machine_file import build_machine, load_model
from vjm.io.manipulator_file import manipulators
from vjm.io.model_file import ModelDocument, load_chain
from vjm.model.machine import legs_of

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
        (lambda d: d["legs"][1].update(drives="x"), "unknown key 'drives' in leg 'y'; did you mean 'drive'"),
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
