"""Processor time of help and of the command that shows one path: first after the warm-up, and later."""

import os
import resource
import statistics
import subprocess
import sys

RUNS = 5
"""Of the later ones."""
VALIDATE = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()"]
CURVE = ["curve", "orthoglide-chain", "--posture", "A", "--to", "-4"]


def test_time_of_one_curve(tmp_path, record):
    installed = tmp_path / "installed"
    subprocess.run([sys.executable, "-m", "vjm.warm_up"], env=environment(installed), check=True)
    # this happens once: it is long enough to be what it is
    value = seconds(CURVE, installed, "bifurcation")
    record("curve_first_s", value, "s", "<= 3", value <= 3.0)
    value = statistics.median(seconds(CURVE, installed, "bifurcation") for _ in range(RUNS))
    record("curve_later_s", value, "s", "<= 1.6", value <= 1.6)
    value = statistics.median(seconds(["--help"], installed, "buckling") for _ in range(RUNS))
    record("help_s", value, "s", "<= 0.15", value <= 0.15)


def environment(folder):
    """As it is, with what is compiled kept in a folder of its own."""
    return os.environ | {"NUMBA_CACHE_DIR": str(folder / "compiled")}


def seconds(words, folder, expected):
    """Processor time of a command, user and system, which keeps what it compiles in this folder."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*VALIDATE, *words], env=environment(folder), check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert expected in done.stdout
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
