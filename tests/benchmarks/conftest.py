"""Collects what the benchmarks measure and writes `bench.json` into the working directory at the end.

A benchmark fails where what it timed gave wrong results, never because of a time: whether a requirement holds on
this machine is said in its row.
"""

import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest

from vjm.io.files import write_whole
from vjm.io.model_file import load_chain
from vjm.model.machine import Machine

PACKAGES = ("numpy", "scipy", "numba", "exudyn")
ROWS = pytest.StashKey[list[dict]]()


def pytest_configure(config):
    config.stash[ROWS] = []


@pytest.fixture(scope="session")
def record(pytestconfig) -> Callable[[str, float, str, str, bool], None]:
    """Keep a row: name, value, unit, requirement, and whether the value meets it."""
    rows = pytestconfig.stash[ROWS]

    def keep(name, value, unit, requirement, passed):
        rows.append(_row(name, float(value), unit, requirement, passed))

    return keep


@pytest.fixture(scope="session")
def chain() -> Machine:
    return load_chain("orthoglide-chain")


def pytest_sessionfinish(session, exitstatus):
    rows = session.config.stash[ROWS]
    finished = exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
    if rows and finished:
        write_whole(Path("bench.json"), json.dumps([*rows, *_circumstances()], indent=1) + "\n")


def pytest_terminal_summary(terminalreporter, config):
    rows = config.stash[ROWS]
    if rows:
        terminalreporter.section("benchmarks")
    for row in rows:
        verdict = ("holds" if row["passed"] else "MISSED") if row["requirement"] else ""
        terminalreporter.write_line(
            f"{row['name']:36} {row['value']:12.4g} {row['unit']:3} {row['requirement']:10} {verdict}".rstrip()
        )


def _row(name, value, unit, requirement, passed):
    return {"name": name, "value": value, "unit": unit, "requirement": requirement, "passed": bool(passed)}


def _circumstances():
    """What the figures depend on, as rows."""
    values = {"version:python": platform.python_version()}
    values |= {f"version:{package}": version(package) for package in PACKAGES}
    values |= {"machine:platform": platform.platform(), "machine:processor": _processor()}
    values["machine:cores"] = os.cpu_count()
    return [_row(name, value, "", "", True) for name, value in values.items()]


def _processor():
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
