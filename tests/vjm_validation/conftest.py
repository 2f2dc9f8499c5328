import json
from pathlib import Path

import pytest
from helpers.command import Finished, in_a_process


@pytest.fixture(scope="session")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Finished]:
    """`validate all`, whole, once for all tests that look at what it wrote."""
    folder = tmp_path_factory.mktemp("run")
    return folder, in_a_process("all", "--out", str(folder), "--jobs", "2")


@pytest.fixture(scope="session")
def summary(whole_run: tuple[Path, Finished]) -> dict:
    folder, _ = whole_run
    return json.loads((folder / "summary.json").read_text())
