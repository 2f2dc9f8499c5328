import json
import re
from pathlib import Path

import jsonschema
import pytest
from helpers.command import validate

from vjm_updating.identify.beam_fit import Form, search
from vjm_updating.identify.matrix_file import parse_matrix, target
from vjm_validation.cli.main import run
from vjm_validation.schemas import schemas

from .paths import TAPER
from .textbook import as_text, cantilever

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.slow
def test_a_part_is_identified_and_its_document_kept_to_its_schema():
    finished = validate("identify", "orthoglide-chain", "--part", "link", "--json")
    assert finished.status == 0, finished.err
    document = json.loads(finished.out)
    jsonschema.validate(document, schemas()["identification.schema.json"])
    assert document["source"] == "part"
    assert document["compliance"][1][1] == pytest.approx(310.0**3 / 3 / 4.3055556e7, rel=1e-6)


@pytest.mark.slow
def test_a_raw_matrix_is_examined_and_said_in_words():
    finished = validate("identify", "--matrix", "bar-20-as-printed")
    assert finished.status == 0, finished.err
    assert "misprint: (2,6) = 11e-5 is inconsistent with a beam; proposed: (2,6) = 1.1e-3" in finished.out
    assert "not identifiable from these entries: GAy, GAz" in finished.out


def test_the_documented_files_are_one_bar():
    text = (DOCS / "compliance-matrix-file.md").read_text()
    blocks = [block.split("```")[0] for block in text.split("```text\n")[1:]]
    rows, cases = (target(parse_matrix(block, "example.txt")) for block in blocks)
    # the entries are printed to three or four digits
    assert rows.matrix == pytest.approx(cases.matrix, rel=1e-3)
    found = search(cases, Form.STRAIGHT)
    assert found.met
    assert found.beam.beam.length == pytest.approx(310.0, rel=2e-4)


@pytest.mark.slow
def test_the_documented_path_is_identified(tmp_path):
    text = (DOCS / "identification.md").read_text()
    (block,) = [block.split("```")[0] for block in re.split(r"```(?:\{code-block\} )?toml\n(?::.*\n)*", text)[1:]]
    file = tmp_path / "bracket.toml"
    file.write_text(block)
    finished = validate("identify", str(file), "--json")
    assert finished.status == 0, finished.err
    document = json.loads(finished.out)
    jsonschema.validate(document, schemas()["identification.schema.json"])
    assert document["experiments"]["order"] == pytest.approx(2.0, abs=0.1)
    assert document["experiments"]["extrapolated"]
    assert not document["beams"][-1]["met"]


REFUSED = {
    "nothing": ([], "either a model with --part, or --matrix FILE"),
    "both": (["orthoglide-chain", "--matrix", "foot-19"], "either a model with --part, or --matrix FILE"),
    "no part": (["orthoglide-chain"], "--part: which one? orthoglide-chain has foot, link"),
    "an unknown part": (["orthoglide-chain", "--part", "foots"], "no part 'foots'"),
    "a passive joint": (["orthoglide-chain", "--part", "q1"], "'q1' is a passive joint"),
    "an unknown model": (["orthoglide-chains", "--part", "foot"], "no model 'orthoglide-chains' in the library"),
    "a manipulator": (["orthoglide", "--part", "foot"], "is a whole manipulator, and this takes one chain"),
    "a missing file": (["--matrix", "nothing.txt"], "nothing.txt: no such file"),
    "a folder": (["--matrix", "."], "is a directory"),
    "a part of a path": (["{taper}", "--part", "x"], "is a beam path, which is taken whole"),
    "an indefinite one": (["--matrix", "{indefinite}"], "not positive definite"),
    "nan": (["--matrix", "{nan}"], "line 2: entry (2,2) is nan"),
    "no table": (["pinned-column", "--table2"], "printed compliance matrices"),
    "a table of a part": (["orthoglide-chain", "--part", "foot", "--table2"], "--table2: give a model"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_refused_in_one_line(name, tmp_path, monkeypatch, capsys):
    arguments, message = REFUSED[name]
    C = cantilever(310.0, EA=6.74e6, GJ=1.07e7, EIy=2.07e8, EIz=4.31e7)
    C[2, 4] = C[4, 2] = 3e-3
    rows = as_text(C, 5).splitlines()
    files = {
        "taper": TAPER,
        "indefinite": "\n".join(rows),
        "nan": "\n".join([rows[0], "0 nan 0 0 0 1e-3", *rows[2:]]),
    }
    for key, content in files.items():
        (tmp_path / f"{key}.toml").write_text(content)
    paths = {key: str(tmp_path / f"{key}.toml") for key in files}
    monkeypatch.chdir(tmp_path)
    assert run(["identify", *(one.format(**paths) for one in arguments)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert {file.name for file in tmp_path.iterdir()} == {f"{key}.toml" for key in files}
