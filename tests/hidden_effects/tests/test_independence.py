"""The injector shares nothing with the diagnosis but the machine's numbers and the file format."""

import ast
from pathlib import Path

import hidden_effects
import pytest

FOLDER = Path(hidden_effects.__file__).parent
MODULES = sorted(FOLDER.glob("*.py"))
MAY = (
    "vjm.model.machine", "vjm.model.parts", "vjm.model.parts", "vjm.rotations", "vjm.kernels.compilation",
    "vjm.io.model_file", "vjm.io.provenance",
    "vjm.io.files", "vjm.batch", "vjm.model.load_case", "vjm.engines",
)  # fmt: skip
"""Numbers, files and their keys, compilation; `truth_models` alone takes the lumped model, for sheets whose link is
one spring."""
FINDER = (
    "vjm_updating.mechanisms",
    "vjm_updating.diagnosis",
    "vjm_updating.calibration",
    "vjm_validation.cli.measured_data",
)


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
    lumped = {n for n in modules if n.startswith(("vjm.engines", "vjm.model.load_case"))}
    assert not lumped or path.stem == "truth_models"


def test_only_the_runner_calls_the_command():
    callers = {
        path.stem for path in MODULES if any(n.startswith("vjm_validation.cli.main") for n in imported(path))
    }
    assert callers == {"finder"}


def test_an_import_of_the_finder_would_be_seen(tmp_path):
    path = tmp_path / "made_up.py"
    path.write_text(
        "def late():\n    from vjm_updating.mechanisms import catalogue\n    import vjm_updating.diagnosis.search\n"
    )
    names = imported(path)
    assert {"vjm_updating.mechanisms", "vjm_updating.diagnosis.search"} <= names
