"""The injector shares nothing with the finder but the machine's numbers and the file format."""

import ast
from pathlib import Path

import pytest

import vjm_validation.blind

FOLDER = Path(vjm_validation.blind.__file__).parent
MODULES = sorted(FOLDER.glob("*.py"))
MAY = (
    "vjm.chain", "vjm.parts", "vjm.rotations", "vjm.compilation", "vjm.io.model_file", "vjm.io.files", "vjm.batch",
    "vjm.programme", "vjm.vjm_engine",
)  # fmt: skip
"""Numbers, files, compilation; `drawing` alone takes the lumped model, for sheets whose link is one spring."""
FINDER = ("vjm.effects", "vjm_validation.diagnosis", "vjm_validation.calibration", "vjm_validation.cli_diagnose")


def imported(path):
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative import"
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", MODULES, ids=[path.stem for path in MODULES])
def test_no_module_imports_the_finder(path):
    offences = {n for n in imported(path) if any(f"{n}.".startswith(f"{finder}.") for finder in FINDER)}
    assert offences == set()


@pytest.mark.parametrize("path", MODULES, ids=[path.stem for path in MODULES])
def test_no_module_takes_mechanics_from_the_suite(path):
    modules = {n for n in imported(path) if n.startswith("vjm.")}
    foreign = {n for n in modules if not any(n == m or n.startswith(f"{m}.") for m in MAY)}
    assert foreign == set()
    lumped = {n for n in modules if n.startswith(("vjm.vjm_engine", "vjm.programme"))}
    assert not lumped or path.stem == "drawing"


def test_only_the_runner_calls_the_command():
    callers = {path.stem for path in MODULES if any(n.startswith("vjm_validation.cli") for n in imported(path))}
    assert callers == {"finder"}


def test_an_import_of_the_finder_would_be_seen(tmp_path):
    path = tmp_path / "made_up.py"
    path.write_text(
        "def late():\n    from vjm.effects import catalogue\n    import vjm_validation.diagnosis.search\n"
    )
    names = imported(path)
    assert {"vjm.effects", "vjm_validation.diagnosis.search"} <= names
