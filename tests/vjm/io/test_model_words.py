"""What a model file says beyond springs: a bow, weight, an elastic frame, how many springs to take."""

import copy
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from packaging.version import Version

import vjm
from vjm.continuation.arc_length import trace
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.design.critical import event_rates
from vjm.design.linear_state import loaded_posture
from vjm.engines import VjmEngine
from vjm.io.files import toml_text
from vjm.io.findings import CAUSES, UNTIL, present_causes, present_document
from vjm.io.joint_tables import CoupledTable
from vjm.io.model_file import ModelFileError, build_chain, load_chain, read_document
from vjm.model.load_case import LoadCase
from vjm.model.parameters import beam_length
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, tabulate
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, bowed
from vjm_updating.mechanisms.series_elements import History, balance
from vjm_updating.mechanisms.structure import BaseCompliance

ORTHOGLIDE = read_document("orthoglide-chain").content
COLUMN = read_document("pinned-column").content
LINK = 4


def changed(document, index, **keys):
    content = copy.deepcopy(document)
    content["parts"][index] |= keys
    return content


def last(path):
    assert path.complete
    return path.points[-1].wrench


@pytest.mark.parametrize(
    ("posture", "to", "near"),
    [
        # in A chord and line of action are one line
        ("A", -2.0, 1e-7),
        # elsewhere the pose of reference differs by the chord's shortening, 0.005 mm of 2
        ("B", 1.0, 3e-4),
        ("D", -2.0, 3e-4),
    ],
)
def test_a_bow_in_the_file_is_the_bow_that_springs_are_free_of_stress_in(posture, to, near):
    bow = (0.3, -0.8)
    engine, load_case = VjmEngine(12), LoadCase(posture, to)
    drawn = engine.trace(build_chain(changed(ORTHOGLIDE, LINK, bow_mm=list(bow)), "m.toml"), load_case)
    model = engine.model(load_chain("orthoglide-chain"))
    prestressed = trace(
        LumpedProblem(model, load_case, "bowed", bowed(model, posture, (("link", *bow),))), load_case
    )
    assert np.abs(last(drawn) - last(prestressed))[:3].max() < near * np.abs(last(prestressed)[:3]).max()
    straight = engine.trace(load_chain("orthoglide-chain"), load_case)
    if posture == "A":
        assert np.abs(last(straight) - last(prestressed))[0] > 0.005 * abs(last(prestressed)[0])


def test_a_bow_has_its_amplitude():
    model = VjmEngine(64).model(build_chain(changed(ORTHOGLIDE, LINK, bow_mm=[2.0, 0.0]), "m.toml"))
    chain = model.chain
    points = model.shape(model.kinematics(model.configuration(chain.posture("A"))))
    own = np.array([p for p, s in zip(points, model.stations, strict=True) if s.part == "link"])
    chord = own[-1] - own[0]
    off = own - own[0] - np.outer((own - own[0]) @ chord, chord) / (chord @ chord)
    # kinks in the middles of 64 segments make a polygon of the sine
    assert np.linalg.norm(off, axis=1).max() == pytest.approx(2.0, rel=2e-3)
    assert np.linalg.norm(off[32]) == pytest.approx(2.0, rel=2e-3)


def test_derivatives_know_the_bow():
    chain = build_chain(changed(ORTHOGLIDE, LINK, bow_mm=[0.4, -0.9]), "m.toml")
    engine, load_case = VjmEngine(4), LoadCase("B", -8.5, steps=8)
    length = beam_length(chain, "link")
    path = engine.trace(chain, load_case)
    h = 2e-4 * length.scale
    near, far = (
        [engine.trace(length.apply(chain, length.value + d), load_case) for d in (step, -step)]
        for step in (h, 2.0 * h)
    )

    def slope(of):
        """By central differences of fourth order."""
        return (8.0 * (of(near[0]) - of(near[1])) - (of(far[0]) - of(far[1]))) / (12.0 * h)

    asked = loaded_posture(chain, "B", displacement=np.zeros(6), engine=engine)
    rates = event_rates(asked, path, [length], np.array([slope(lambda path: path.tangent[0])]))
    # events are located to 1e-9 of the path, over a step of 2e-4
    assert rates.force[0] == pytest.approx(slope(lambda path: path.critical.force), rel=1e-5)
    assert rates.s[0] == pytest.approx(slope(lambda path: path.critical.s), rel=1e-5)


def test_one_spring_has_no_shape():
    chain = build_chain(changed(ORTHOGLIDE, LINK, bow_mm=[0.5, 0.0]), "m.toml")
    with pytest.raises(ValueError, match="part 'link' has a bow, which one spring"):
        VjmEngine().trace(chain, LoadCase("A", -1.0))
    with pytest.raises(ValueError, match="part 'link': exudyn does not take beams with a bow"):
        ExudynEngine().trace(chain, LoadCase("A", -1.0))
    document = changed(ORTHOGLIDE, LINK, bow_mm=[0.5, 0.0]) | {"springs": {"link_segments": 1}}
    with pytest.raises(ModelFileError, match=r"m\.toml: part 'link' has a bow, and \[springs\] one spring"):
        build_chain(document, "m.toml")


def with_mounts(c, shares=(1.0, 1.0, 1.0), about=0.0):
    content = copy.deepcopy(ORTHOGLIDE)
    mounts = [
        {"kind": "mount", "name": f"frame-{a}", "axis": a, "compliance_mm_per_N": c * s}
        for a, s in zip("xyz", shares, strict=True)
    ]
    if about:
        mounts += [
            {"kind": "mount", "name": f"turn-{a}", "axis": a, "compliance_rad_per_Nmm": about} for a in "xyz"
        ]
    content["parts"] = [*mounts, *content["parts"]]
    return build_chain(content, "m.toml")


@pytest.mark.parametrize(("c", "turning"), [(3e-5, 0.0), (2e-5, 8.0)])
@pytest.mark.parametrize("posture", ["A", "B", "D"])
def test_mounts_before_the_drive_are_an_elastic_base(posture, c, turning):
    shares = (1.0, 2.0, 0.5)
    engine = VjmEngine(12)
    machine = ModifiedMachine(load_chain("orthoglide-chain"), engine)
    # the bar is the longest piece
    about = c * turning / 310.0**2
    path = engine.trace(with_mounts(c, shares, about), LoadCase(posture, 1.5))
    table = tabulate(machine, HalfRay(posture, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 2.0, 1), pulls=True)

    def look(u):
        W, K = table.at(u[:, 0])
        return W + np.einsum("nij,nj->ni", K[:, :, 1:], u[:, 1:]), K

    elements = BaseCompliance().elements(machine, (c, shares[1], shares[2], turning, 1.0, 1.0))
    pose = np.array([[1.5, 0, 0, 0, 0, 0]])
    lever = machine.lever(posture) + pose[:, :3]
    history = History(np.zeros(1), np.ones(1, dtype=bool), np.array([[1.0, 0.0, 0.0]]), lever)
    found = balance(look, pose, elements, history)
    # tables are linear across their ray
    assert np.abs(found.wrench[0] - last(path))[:3].max() < 1e-3 * np.abs(last(path)[:3]).max()
    rigid = engine.trace(load_chain("orthoglide-chain"), LoadCase(posture, 1.5))
    assert np.abs(last(rigid) - last(path))[0] > 0.05 * abs(last(path)[0])


@pytest.mark.parametrize("about", [0.0, 3e-10])
def test_finite_elements_have_the_mounts_too(about):
    # so small that it does not matter in which order the foot's spring turns
    chain, load_case = with_mounts(3e-5, about=about), LoadCase("A", 0.01)
    elements = ExudynEngine(foot_spring=True).trace(chain, load_case)
    assert last(elements)[0] == pytest.approx(last(VjmEngine(16).trace(chain, load_case))[0], rel=1e-3)


@pytest.mark.parametrize("by", ["mass", "density"])
def test_weight_hangs_on_a_beam_with_a_mass(by):
    # a pinned bar squeezed by nothing bears half of its weight at its end, by statics alone: to rounding
    mass = 2700e-9 * 25.4 * 3.175 * 299.085
    if by == "mass":
        content = changed(COLUMN, 1, mass_kg=mass)
    else:
        content = copy.deepcopy(COLUMN)
        content["parts"][1]["section"]["density_kg_per_m3"] = 2700.0
    chain = build_chain(content, "m.toml")
    assert chain.beams[0].mass == pytest.approx(mass, rel=1e-12)
    path = VjmEngine(16).trace(chain, LoadCase("straight", 0.01, gravity=(0.0, -9.81, 0.0)))
    assert path.points[0].wrench[1] == pytest.approx(0.5 * 9.81 * mass, rel=1e-12)


def test_a_mass_and_a_density_are_one_too_many():
    content = changed(COLUMN, 1, mass_kg=0.1)
    content["parts"][1]["section"]["density_kg_per_m3"] = 2700.0
    with pytest.raises(ModelFileError, match=r"part 'link': has mass_kg and density_kg_per_m3, two masses"):
        build_chain(content, "m.toml")


def test_the_file_says_how_many_springs():
    chain = build_chain(ORTHOGLIDE | {"springs": {"link_segments": 12, "foot_segments": 8}}, "m.toml")
    assert (chain.link_segments, chain.foot_segments) == (12, 8)
    assert VjmEngine.of(12, 8).label == "vjm-12f8"
    assert VjmEngine.of(1).label == "vjm-paper"
    assert replace(chain, link_segments=None).parts == chain.parts


# Old names of causes are read for one release, and said; the table is right in what it says.


@pytest.mark.parametrize("word", ["as bended", "as bent"])
def test_other_words_are_refused_by_the_present_ones(word):
    with pytest.raises(ValueError, match="as deflected"):
        CoupledTable(kind="coupled", name="b", axis="z", to={"a": 1.0}, coupling=word)


def test_old_words_go_with_the_version_that_is_said():
    assert Version(vjm.__version__) < Version(UNTIL)


@pytest.mark.parametrize(("old", "new"), CAUSES.items())
def test_an_old_name_of_a_cause_is_read_and_said(old, new):
    names, findings = present_causes([f"{old}.elbow", new], "--fit")
    assert names == (f"{new}.elbow", new)
    assert [finding.description for finding in findings] == [
        f"'{old}.elbow' is now called '{new}.elbow'; the old word is read until {UNTIL}"
    ]
    document, findings = present_document({"named": {"causes": [old], "title": old}}, "diagnosis.json")
    assert document == {"named": {"causes": [new], "title": old}}
    assert len(findings) == 1


# What is written as TOML is read back as it was.


# TOML's texts are Unicode without lone surrogates
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
KEYS = TEXTS.filter(bool)
SCALARS = st.one_of(
    st.booleans(), st.integers(-(2**53), 2**53), st.floats(allow_nan=False, allow_infinity=False), TEXTS
)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4))


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_documents_come_back(document):
    assert tomllib.loads(toml_text(document)) == document


@pytest.mark.parametrize("name", ["orthoglide-chain", "pinned-column"])
def test_models_come_back(name: str):
    document = read_document(name)
    again = tomllib.loads(toml_text(document.content))
    assert again == document.content
    assert build_chain(again, "again").name == name


def test_numbers_keep_their_kind_and_every_digit():
    found = tomllib.loads(toml_text({"a": 1, "b": 1.0, "c": math.pi, "d": 1e-300, "e": -0.0}))
    assert found == {"a": 1, "b": 1.0, "c": math.pi, "d": 1e-300, "e": 0.0}
    assert type(found["a"]) is int
    assert type(found["b"]) is float


def test_what_toml_lacks_is_refused():
    with pytest.raises(TypeError, match="NoneType"):
        toml_text({"a": None})
