import json
import re
import shlex
import signal
import subprocess
import sys
from io import StringIO
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from rich.console import Console

from vjm import LoadCase, load, trace
from vjm.io.path_files import read_curve
from vjm_output import terminal
from vjm_validation.acceptance import AcceptanceRow
from vjm_validation.cli.example import first_command, names
from vjm_validation.cli.main import COMMANDS, EXAMPLES, app
from vjm_validation.cli.main import run as command
from vjm_validation.cli.tables import acceptance_table
from vjm_validation.schemas import schemas

PUBLISHED = Path(__file__).parents[3] / "docs" / "schemas"


def test_the_published_schemas_are_the_present_ones():
    assert {file.name: json.loads(file.read_text()) for file in PUBLISHED.iterdir()} == schemas()


def test_list_names_models_and_engines():
    finished = validate("list")
    for name in (
        "orthoglide-chain",
        "pinned-column",
        "vjm-paper",
        "exudyn-footspring",
        "link_lumping",
        "end_conditions",
    ):
        assert name in finished.out


def test_curve_writes_the_path(tmp_path):
    file = tmp_path / "new" / "curve.csv"
    finished = validate(
        "curve", "orthoglide-chain", "--posture", "A", "--to", "2", "--engine", "vjm-paper", "--csv", file
    )
    assert "bifurcation at 0.813" in finished.out
    path = read_curve(file)
    assert path.engine == "vjm-paper"
    assert path.s[-1] == 2.0
    assert path.force[-1] == pytest.approx(2706.5, rel=1e-4)


def test_a_curve_as_a_document_is_its_file():
    words = ("curve", "orthoglide-chain", "--posture", "A", "--to", "2", "--engine", "vjm-paper", "--json")
    document = json.loads(validate(*words).out)
    jsonschema.validate(document, schemas()["curve.schema.json"])
    path = trace(load("orthoglide-chain"), LoadCase("A", to=2.0), engine="vjm-paper")
    assert [point["force"] for point in document["points"]] == path.force.tolist()
    assert [point["stiffness"] for point in document["points"]] == [p.tangent for p in path.points]
    (event,) = document["events"]
    assert (event["kind"], event["force"]) == ("bifurcation", path.critical.force)
    assert event["at"] == pytest.approx(path.critical.s, rel=1e-12)  # displacement and arc of one straight ramp
    assert document["complete"]


def test_buckling_prints_one_document_and_nothing_else():
    document = json_of("buckling", "orthoglide-chain", "--posture", "A", "--direction", "-", "--engine", "vjm")
    jsonschema.validate(document, schemas()["buckling.schema.json"])
    assert document["chain"]["A"]["compression"]["vjm-16"]["F_cr"] == pytest.approx(8849, rel=1e-3)


def test_stiffness_under_a_displacement():
    document = json_of("stiffness", "orthoglide-chain", "--posture", "A", "--displacement", "-3,0,0,0,0,0")
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
        document = json.loads(validate(*arguments, "--engine", engine).out)
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
    document = json_of("stiffness", "orthoglide-chain", "--posture", "A", "--wrench", "1000,0,0,0,0,0")
    assert document["wrench"][0] == 1000.0
    # foot's (1,1) and half the bar's (1,1) in series; Newton stops 4e-10 away
    assert document["displacement"][0] == pytest.approx(1000.0 * (28e-5 + 23e-6), rel=2e-8)
    push = validate(
        "stiffness", "orthoglide-chain", "--posture", "A", "--wrench", "-1000,0,0,0,0,0", "--json", status=3
    )
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
    finished = validate(*arguments, status=2)
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
    assert (
        "as-printed.toml: part 'link': compliance is not symmetric: (2,6) = 1.1e-4 but (6,2) = 1.1e-3"
        in refused("buckling", file)
    )


# The help: nothing in brackets is lost, examples can be parsed, pages are there.


ROOT = Path(__file__).parents[3]


def said(capsys, *arguments):
    command([*arguments, "--help"])
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", capsys.readouterr().out).split())


def test_what_stands_in_brackets_is_shown(capsys):
    assert "vjm-<n>" in said(capsys, "map")
    # lines may be broken within it
    shown = said(capsys, "curve").replace(" ", "")
    assert "[part@fraction:]fx,fy,fz[,mx,my,mz][:follower][:constant]" in shown


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_a_call_of_its_command_and_its_page_is_there(name, capsys):
    example, _, pages = EXAMPLES[name]
    words = shlex.split(example)
    assert words[:2] == ["validate", name]
    app.parse_args(words[1:], exit_on_error=False, print_error=False)
    assert all((ROOT / page).is_file() for page in pages.split(", "))
    assert "Example: validate" in said(capsys, name)


def test_every_example_is_of_a_command():
    assert set(EXAMPLES) <= set(COMMANDS)


# The terminal: an interrupt ends the work wherever it strikes; what is printed is printed as it is.


def interrupted_and_swallowed():
    """As in a callback of a library that goes on after what is raised in it."""
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_was_swallowed_is_raised_with_the_next_progress():
    before, told = signal.getsignal(signal.SIGINT), []

    def work():
        with terminal.progress(quiet=True) as progress:
            for done in (1, 2, 3):
                progress("paths", done, 3)
                told.append(done)
                interrupted_and_swallowed()

    with pytest.raises(KeyboardInterrupt):
        work()
    assert told == [1]
    assert signal.getsignal(signal.SIGINT) is before


def test_or_at_the_end():
    with pytest.raises(KeyboardInterrupt), terminal.progress(quiet=True):
        interrupted_and_swallowed()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_a_library_turned_into_an_error_is_an_interrupt(number):
    def work():
        with terminal.progress(quiet=True) as progress:
            progress("paths", 1, 3)
            # what Exudyn makes of an interrupt in the constructor of an item
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(number)
            raise RuntimeError("Check your python code")

    with pytest.raises(KeyboardInterrupt):
        work()


def test_an_error_without_an_interrupt_stays_one():
    with pytest.raises(RuntimeError, match="negative"), terminal.progress(quiet=True):
        raise RuntimeError("negative indices")


def test_without_one_nothing_is_raised():
    before = signal.getsignal(signal.SIGINT)
    with terminal.progress(quiet=True) as progress:
        progress("paths", 3, 3)
        assert signal.getsignal(signal.SIGINT) is not before
    # the block leaves the signals to whom they belonged
    assert signal.getsignal(signal.SIGINT) is before


def test_a_number_too_long_for_its_column_is_broken_and_not_cut():
    table = terminal.TerminalTable()
    table.add_column("K0")
    table.add_column("K1")
    table.add_row("1.3371e+05", "2.5336e-03")
    narrow = Console(width=16, file=StringIO())
    narrow.print(table)
    shown = narrow.file.getvalue()
    assert "…" not in shown
    pieces = [line.split("│")[1:3] for line in shown.splitlines() if line.startswith("│")]
    assert ["".join(cell.strip() for cell in cells) for cells in zip(*pieces, strict=True)] == [
        "1.3371e+05", "2.5336e-03",
    ]  # fmt: skip


def test_brackets_of_a_table_are_printed(capsys):
    row = AcceptanceRow(name="engines", requirement="agree", value="pip install 'vjm[extra]'", passed=None)
    terminal.console().print(acceptance_table([row]))
    printed = capsys.readouterr().out
    assert "pip install 'vjm[extra]'" in printed
    assert "not run" in printed


# What a command imports before it does anything: start-up is most of the time that a short one takes.


PROGRAM = """
import sys
from vjm_validation.cli.main import run
status = run(sys.argv[1:])
names = ("numpy", "numba", "pydantic", "rich.progress", "scipy.linalg", "numba.np.linalg")
print(status, *(name for name in names if name in sys.modules), sep="|", file=sys.stderr)
"""


def imported(*words):
    run = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=True)
    status, *names = run.stderr.splitlines()[-1].split("|")
    assert status == "0"
    return set(names)


def test_help_imports_nothing_that_computes():
    assert imported("--help") == set()


@pytest.mark.parametrize("words", [("check", "orthoglide-chain"), ("curve", "orthoglide-chain", "--to", "-0.1")])
def test_a_path_takes_no_linear_algebra_of_scipy_and_nothing_to_compile_with(words):
    # where the kernels are not kept yet, this process compiles them
    validate(*words)
    assert imported(*words) == {"numpy", "numba", "pydantic", "rich.progress"} - (
        {"rich.progress"} if words[0] == "check" else set()
    )


# ``validate example``: copies whole, names what to run next, never writes over anything.

SOURCE = ROOT / "validation/vjm_validation/examples"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_all_are_listed():
    said = validate("example").out
    assert names() == sorted(folder.name for folder in SOURCE.iterdir())
    assert [line.split()[0] for line in said.splitlines()[:-1]] == names()


@pytest.mark.parametrize("name", names())
def test_it_is_copied_whole_and_the_next_command_can_be_typed(name):
    assert f"next: {first_command(name)}" in validate("example", name).out
    for file in SOURCE.joinpath(name).iterdir():
        assert Path(name, file.name).read_bytes() == file.read_bytes()
    words = shlex.split(first_command(name))
    app.parse_args(words[1:], exit_on_error=False, print_error=False)
    assert all(Path(word).is_file() for word in words if word.endswith((".csv", ".toml", ".step")))


def test_another_folder_stands_in_the_next_command():
    assert "next: validate buckling own/my-leg/leg.toml\n" in validate("example", "leg", "--out", "own/my-leg").out


def test_nothing_is_written_over():
    validate("example", "leg")
    Path("leg/leg.toml").write_text("mine")
    said = "validate: leg: exists already; give another folder by --out, or remove it first"
    assert refused("example", "leg") == said
    assert Path("leg/leg.toml").read_text() == "mine"


def test_a_wrong_name_is_refused_with_the_near_one():
    assert "did you mean 'leg'" in refused("example", "lag")
    assert list(Path().iterdir()) == []
