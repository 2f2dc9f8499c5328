"""How long the command takes to show one path: interpreted, first after the installation's warm-up, and later."""

import os
import statistics
import subprocess
import sys
import time

RUNS = 5
"""Of the later ones."""
COMMAND = [
    sys.executable, "-c", "from vjm_validation.cli.main import main; main()",
    "curve", "orthoglide-chain", "--posture", "A", "--to", "-4",
]  # fmt: skip


def test_time_of_one_curve(tmp_path, record):
    # these happen once: they are long enough to be what they are
    value = seconds(tmp_path / "bare")
    record("curve_uncompiled_s", value, "s", "<= 5", value <= 5.0)
    installed = tmp_path / "installed"
    subprocess.run([sys.executable, "-m", "vjm.warm_up"], env=environment(installed), check=True)
    value = seconds(installed)
    record("curve_first_s", value, "s", "<= 10", value <= 10.0)
    value = statistics.median(seconds(installed) for _ in range(RUNS))
    record("curve_later_s", value, "s", "<= 2", value <= 2.0)


def environment(folder):
    """As it is, with what is compiled kept in a folder of its own."""
    return os.environ | {"NUMBA_CACHE_DIR": str(folder / "compiled")}


def seconds(folder):
    """Wall time of the command, which keeps what it compiles in this folder."""
    started = time.perf_counter()
    done = subprocess.run(COMMAND, env=environment(folder), check=True, capture_output=True, text=True)
    value = time.perf_counter() - started
    assert "bifurcation" in done.stdout
    return value
