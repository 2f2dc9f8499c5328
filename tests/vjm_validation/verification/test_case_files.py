"""Case files: what is wrong is refused in one line that names file, key and remedy; the library is sane."""

import numpy as np
import pytest

from vjm.baselines import MsaEngine
from vjm.io.errors import ModelFileError
from vjm.model.load_case import LoadCase
from vjm_validation.verification.judging import case_rows, made, named, solved
from vjm_validation.verification.library import ArcTable, Reference, case_by_name, library, picked, read_case
from vjm_validation.verification.runner import answered, arc_chain, place, unloaded_position

CASE = """format = 1
name = "bar"
title = "a bar"
group = "linear"
kind = "exact"
[[chain.parts]]
kind = "beam"
name = "bar"
length_mm = 100.0
[chain.parts.section]
EA_N = 1e6
GJ_Nmm2 = 1e6
EIy_Nmm2 = 1e6
EIz_Nmm2 = 1e6
[engines.vjm]
meshes = [2, 4, 8]
tolerance = 1e-9
reason = "exact"
[[runs]]
[runs.load_case]
to = 0.001
[[runs.asked]]
quantity = "stiffness"
measure = "stiffness"
component = "x"
by = "x"
[runs.asked.reference]
source = "EA/L"
value = 1e4
"""


def read(text):
    return read_case("bar.toml", text.encode())


def test_a_sane_case_is_read():
    case = read(CASE)
    assert case.name == "bar"
    assert len(case.questions) == 1
    assert [*case.files] == [f"{case.name}.toml"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("meshes = [2, 4, 8]", "meshes = [4, 4, 8]", "must grow"),
        ("meshes = [2, 4, 8]", "meshes = [4, 8]", "at least three meshes"),
        ("meshes = [2, 4, 8]\n", "", "at least three meshes"),
        ('reason = "exact"\n', "", "reason"),
        ("tolerance = 1e-9", "tolerence = 1e-9", "did you mean 'tolerance'"),
        ("value = 1e4", "", "either value or exact"),
        ("value = 1e4", 'value = 1e4\nexact = "linear.cantilever"', "either value or exact"),
        ('by = "x"\n', "", "second index"),
        ('component = "x"\n', "", "needs a component"),
        ('measure = "stiffness"', 'measure = "stiffnes"', "stiffness"),
        ('source = "EA/L"', 'source = ""', "source"),
        ('name = "bar"\ntitle', 'name = "rod"\ntitle', "name the file rod.toml"),
        ("[engines.vjm]", "[engines.abaqus]", "abaqus"),
        ("format = 1", "format = [", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_named(old, new, words):
    assert old in CASE
    with pytest.raises(ModelFileError) as refused:
        read(CASE.replace(old, new, 1))
    message = str(refused.value)
    assert message.startswith("bar.toml")
    assert words in message
    assert "\n" not in message


def test_the_library_is_complete_and_sane():
    cases = library()
    assert len(cases) >= 35
    for case in cases:
        assert case.file.title
        for _, asked in case.questions:
            assert asked.reference.source
        for table in case.file.engines.values():
            assert table.reason


def test_a_wrong_name_gets_a_hint():
    with pytest.raises(ValueError, match="did you mean 'column-pinned'"):
        case_by_name("column-pined")
    assert [case.name for case in picked(["toggle"])] == ["toggle"]
    assert len(picked([], quick=True)) < len(picked([]))


def test_references_are_numbers_or_functions_by_name():
    made = Reference(
        source="L³/3EI",
        exact="linear.cantilever",
        arguments={"bar": {"make": "linear.Bar", "length": 100.0, "EI": 1e6}},
        take=[0, 0],
        times=2.0,
    )
    assert solved([made])[0] == pytest.approx(2.0 * 100.0**3 / 3e6)
    assert solved([Reference(source="given", value=3.0), made])[0] == 3.0


@pytest.mark.parametrize(
    "name", ["linear.nothing", "os.system", "linear", "linear._private", "linear.Bar.__init__"]
)
def test_references_reach_nothing_but_the_exact_solutions(name):
    with pytest.raises(ValueError, match=name.split(".")[0]):
        named(name)


def test_every_case_of_the_library_names_what_there_is():
    """Functions, classes and constants: what a file names as text no renaming of code finds."""
    named_functions = 0
    for case in library():
        for _, asked in case.questions:
            if asked.reference.exact:
                assert callable(named(asked.reference.exact))
                made(asked.reference.arguments)
                named_functions += 1
    assert named_functions > 50


def test_a_wrong_argument_is_an_error():
    with pytest.raises(ValueError, match="cantilever"):
        solved([Reference(source="?", exact="linear.cantilever", arguments={"length": 1.0})])


# Cases with a known answer on one mesh of an engine; `validate all` runs all, on all meshes, with orders.


COARSE = 0.02
"""Relative error of a coarsest mesh at most; four elements of a column with springs at its ends have 0.016."""


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("linear-cantilever", "vjm"), ("lumped-bar", "vjm"), ("column-pinned-shear", "vjm"), ("arch-215", "vjm"),
        ("postbuckling-pinned-far", "vjm"), ("sprung-arm", "exudyn"), ("cantilever-follower", "exudyn"),
        ("cantilever-tip-moment", "exudyn"), ("column-clamped-pinned-shear", "exudyn"),
        ("twisted-cantilever", "exudyn"),
    ],
)  # fmt: skip
def test_an_engine_has_an_answer_on_the_coarsest_mesh(name, family):
    case = case_by_name(name)
    meshes = case.file.engines[family].meshes[:1]
    answers = answered(case, family, meshes)
    assert answers.refused == ""
    for row in case_rows([case], [answers]):
        assert row.not_run == ""
        # without a mesh there is nothing to refine
        assert row.error <= (COARSE if meshes else row.tolerance)


# An arc in straight sides: its corners lie on it, and in a plane it is as flexible to the fourth order.


ARC = ArcTable.model_validate(
    {
        "radius_mm": 100.0,
        "angle_deg": 90.0,
        "section": {"EA_N": 1e8, "GJ_Nmm2": 1e6, "EIy_Nmm2": 1e6, "EIz_Nmm2": 1e6},
    }
)


@pytest.mark.parametrize("sides", [1, 3, 8])
def test_the_end_lies_on_the_arc(sides):
    assert unloaded_position(arc_chain("arc", ARC, sides)) == pytest.approx([100.0, -100.0, 0.0], abs=1e-9)


def test_its_flexibility_converges_with_the_fourth_order():
    # Castigliano for a quarter circle under a force at its end: moments F R cos φ along x, F R (1 − sin φ) along y
    R, EI, EA = 100.0, 1e6, 1e8
    ring = R**3 / EI
    stretch = R / EA
    exact = np.array(
        [
            [ring * np.pi / 4.0 + stretch * np.pi / 4.0, 0.0],
            [0.0, ring * (0.75 * np.pi - 2.0) + stretch * np.pi / 4.0],
        ]
    )
    errors = []
    for sides in (4, 8, 16):
        chain = arc_chain("arc", ARC, sides)
        path = MsaEngine().trace(chain, LoadCase("straight", 1e-3))
        C = np.linalg.inv(path.points[0].stiffness)
        errors.append(max(abs(C[i, i] / exact[i, i] - 1.0) for i in (0, 1)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.2)
    assert errors[-1] < 1e-5


def test_points_of_an_arc_are_its_corners():
    assert place("arc", 0.5, 8) == ("corner-4", 0.0)
    assert place("bar", 0.3, 8) == ("bar", 0.3)
    with pytest.raises(ValueError, match="no corner"):
        place("arc", 0.5, 5)


def test_a_chain_of_a_case_has_its_posture():
    from vjm_validation.verification.runner import chain_of

    chain = chain_of(case_by_name("column-pinned"), 4)
    assert chain.posture("straight").tolist() == [0.0, 0.0]
