"""Where no compiled kernels are kept a path is interpreted, and another process compiles; then they are used."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from vjm.kernels import first_use

COMMAND = [
    *(sys.executable, "-m", "vjm_validation.cli.main", "curve", "orthoglide-chain"),
    *("--posture", "A", "--to", "-3.2", "--json"),
]


@pytest.fixture
def environment(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return {k: v for k, v in os.environ.items() if k not in (first_use.PLAIN, first_use.HELPED)}


def test_a_note_is_of_these_sources_and_this_numba(environment, tmp_path, monkeypatch):
    with first_use.compiling() as alone:
        assert alone
        with first_use.compiling() as second:
            assert not second
        assert not first_use.note(tmp_path).exists()
    assert first_use.note(tmp_path).exists()
    monkeypatch.setattr(first_use, "version", lambda name: "0.0")
    assert not first_use.note(tmp_path).exists()


def test_who_cannot_note_it_compiles_as_ever(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file/none"))
    assert first_use.kept_in() is None
    assert not first_use.interpreted_meanwhile()


@pytest.mark.slow
def test_the_first_path_is_interpreted_and_later_ones_compiled(environment, tmp_path):
    first = subprocess.run(COMMAND, env=environment, capture_output=True, text=True, check=True)
    assert "interpreted for once" in first.stderr
    compiled = first_use.note(tmp_path)
    until = time.monotonic() + 600.0
    while not compiled.exists() and time.monotonic() < until:
        time.sleep(1.0)
    assert compiled.exists()
    later = subprocess.run(COMMAND, env=environment, capture_output=True, text=True, check=True)
    assert "interpreted" not in later.stderr
    paths = [json.loads(run.stdout) for run in (first, later)]
    events = [path["events"][0]["force"] for path in paths]
    # residuals are below 1e-11; a critical force is located to 1e-9 of it
    assert events[0] == pytest.approx(events[1], rel=1e-9)
    forces = [np.array([point["force"] for point in path["points"]]) for path in paths]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-8, atol=1e-6)


@pytest.mark.slow
def test_what_takes_longer_than_compiling_begins_anew(environment, tmp_path):
    """20,000 steps take minutes, interpreted: the command is done soon after the kernels are."""
    command = [*COMMAND[:-1], "--steps", "20000", "--csv", str(tmp_path / "path.csv")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=900)
    assert "interpreted for once" in done.stderr
    assert done.stdout.count("bifurcation at") == 1
    assert first_use.note(tmp_path).exists()
    assert len((tmp_path / "path.csv").read_text().splitlines()) > 20000
