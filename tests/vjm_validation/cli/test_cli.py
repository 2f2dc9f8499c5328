import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import in_a_process, validate

from vjm import LoadCase, load, trace
from vjm.io.path_files import read_curve
from vjm_validation.schemas import schemas

PUBLISHED = Path(__file__).parents[3] / "docs" / "schemas"


@pytest.mark.parametrize("name", schemas())
def test_the_published_schemas_are_the_present_ones(name):
    assert json.loads((PUBLISHED / name).read_text()) == schemas()[name]


def test_list_names_models_and_engines():
    finished = in_a_process("list")
    assert finished.status == 0
    for name in (
        "orthoglide-chain",
        "pinned-column",
        "vjm-paper",
        "exudyn-footspring",
        "link_lumping",
        "iterations",
    ):
        assert name in finished.out


def test_curve_writes_the_path(tmp_path):
    file = tmp_path / "new" / "curve.csv"
    finished = validate(
        "curve", "orthoglide-chain", "--posture", "A", "--to", "2", "--engine", "vjm-paper", "--csv", str(file)
    )
    assert finished.status == 0, finished.err
    assert "bifurcation at 0.813" in finished.out
    path = read_curve(file)
    assert path.engine == "vjm-paper"
    assert path.s[-1] == 2.0
    assert path.force[-1] == pytest.approx(2706.5, rel=1e-4)


def test_a_curve_as_a_document_is_its_file():
    words = ("curve", "orthoglide-chain", "--posture", "A", "--to", "2", "--engine", "vjm-paper", "--json")
    finished = validate(*words)
    assert finished.status == 0, finished.err
    document = json.loads(finished.out)
    jsonschema.validate(document, schemas()["curve.schema.json"])
    path = trace(load("orthoglide-chain"), LoadCase("A", to=2.0), engine="vjm-paper")
    assert [point["force"] for point in document["points"]] == path.force.tolist()
    assert [point["stiffness"] for point in document["points"]] == [p.tangent for p in path.points]
    (event,) = document["events"]
    assert (event["kind"], event["force"]) == ("bifurcation", path.critical.force)
    assert event["at"] == pytest.approx(path.critical.s, rel=1e-12)  # displacement and arc of one straight ramp
    assert document["complete"]


def test_buckling_prints_one_document_and_nothing_else():
    finished = validate(
        "buckling", "orthoglide-chain", "--posture", "A", "--direction", "-", "--engine", "vjm", "--json"
    )
    assert finished.status == 0, finished.err
    document = json.loads(finished.out)
    jsonschema.validate(document, schemas()["buckling.schema.json"])
    assert document["chain"]["A"]["compression"]["vjm-16"]["F_cr"] == pytest.approx(8849, rel=1e-3)


def test_stiffness_under_a_displacement():
    finished = validate(
        "stiffness", "orthoglide-chain", "--posture", "A", "--displacement", "-3,0,0,0,0,0", "--json"
    )
    assert finished.status == 0, finished.err
    document = json.loads(finished.out)
    jsonschema.validate(document, schemas()["stiffness.schema.json"])
    assert document["stable"]
    assert document["displacement"][0] == -3.0
    # buckled: the post-critical stiffness along x, and the unloaded one beside it
    assert document["stiffness_loaded"][0][0] == pytest.approx(14.22, rel=2e-3)
    assert document["stiffness_unloaded"][0][0] == pytest.approx(3300, rel=1e-3)


def test_every_engine_answers_for_a_stiffness():
    """Finite elements against springs, K^F in posture B under 3 mm of compression."""
    arguments = ("stiffness", "orthoglide-chain", "--posture", "B", "--displacement", "-3,0,0,0,0,0", "--json")
    found = {}
    for engine in ("vjm-16f16", "exudyn", "msa"):
        finished = validate(*arguments, "--engine", engine)
        assert finished.status == 0, finished.err
        document = json.loads(finished.out)
        jsonschema.validate(document, schemas()["stiffness.schema.json"])
        # moments by the link's length, so that all entries are N/mm
        unit = np.repeat([1.0, 1.0 / 310.0], 3)
        found[engine] = np.array(document["stiffness_loaded"]) * unit[:, None] * unit
    size = np.abs(found["vjm-16f16"]).max()
    # 16 elements err by 1e-4 in critical loads (docs/verification.md); here the difference is 1.5e-5
    assert np.abs(found["exudyn"] - found["vjm-16f16"]).max() < 1e-4 * size
    # the linear model does not see the load
    assert np.abs(found["msa"] - found["vjm-16f16"]).max() > 1e-2 * size


def test_stiffness_under_a_wrench():
    pull = validate("stiffness", "orthoglide-chain", "--posture", "A", "--wrench", "1000,0,0,0,0,0", "--json")
    assert pull.status == 0, pull.err
    document = json.loads(pull.out)
    assert document["wrench"][0] == 1000.0
    # foot's (1,1) and half the bar's (1,1) in series
    assert document["displacement"][0] == pytest.approx(1000.0 * (28e-5 + 23e-6), rel=1e-3)
    push = validate("stiffness", "orthoglide-chain", "--posture", "A", "--wrench", "-1000,0,0,0,0,0", "--json")
    assert push.status == 3
    assert push.out == ""
    assert "unstable" in push.err


BAD = [
    (["curve", "orthoglide-chain", "--posture", "E", "--to", "1"], "no posture 'E' (it has A, B, C, D)"),
    (["curve", "orthoglide-chan", "--to", "1"], "did you mean 'orthoglide-chain'?"),
    (["curve", "orthoglide-chain", "--to", "0"], "other than zero"),
    (["curve", "orthoglide-chain", "--to", "nan"], "finite"),
    (["curve", "orthoglide-chain", "--to", "500"], "out of reach"),
    (["curve", "orthoglide-chain", "--to", "1", "--segments", "0"], "--segments: must be at least 1"),
    (["curve", "orthoglide-chain", "--to", "1", "--csv", "/proc/none/x.csv"], "/proc/none"),
    (["buckling", "orthoglide-chain", "--engine", "abaqus"], "unknown engine 'abaqus'"),
    (["stiffness", "orthoglide-chain", "--wrench", "1,2"], "needs six numbers"),
    (["stiffness", "orthoglide-chain", "--displacement", "1,2,3,4,5,x"], "is not six numbers"),
    (["all", "--only", "nothing"], "no comparison 'nothing'"),
    (["all", "--out", "/proc/none"], "/proc/none"),
    (["frobnicate"], "frobnicate"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(a) for a, _ in BAD])
def test_bad_input_is_one_line_and_status_2(arguments, message):
    finished = validate(*arguments)
    assert finished.status == 2
    assert finished.out == ""
    assert message in finished.err
    assert len(finished.err.strip().splitlines()) == 1


def test_the_printed_matrix_20_is_refused_with_both_entries(tmp_path):
    library = Path(__file__).parents[3] / "src" / "vjm" / "models" / "orthoglide-chain.toml"
    text = library.read_text()
    broken = text.replace(
        "[ 0.0,  23e-2,   0.0,    0.0,    0.0,   11e-4]", "[ 0.0,  23e-2,   0.0,    0.0,    0.0,   11e-5]"
    )
    assert broken != text
    file = tmp_path / "as-printed.toml"
    file.write_text(broken)
    finished = validate("buckling", str(file))
    assert finished.status == 2
    assert (
        "as-printed.toml: part 'link': compliance is not symmetric: (2,6) = 1.1e-4 but (6,2) = 1.1e-3"
        in finished.err
    )
