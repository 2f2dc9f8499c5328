"""What a command imports before it does anything: start-up is most of the time that a short one takes."""

import subprocess
import sys

import pytest

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
    # half a second each; where the kernels are not kept yet, the first run compiles them
    imported(*words)
    assert imported(*words) == {"numpy", "numba", "pydantic", "rich.progress"} - (
        {"rich.progress"} if words[0] == "check" else set()
    )
