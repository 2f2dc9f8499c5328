"""How long the command takes to show one path: the first time, when it compiles, and later."""

import os
import statistics
import subprocess
import sys
import time

RUNS = 5
"""Of the later ones."""
COMMAND = [
    sys.executable, "-c", "from vjm_validation.cli import main; main()",
    "curve", "orthoglide-chain", "--posture", "A", "--to", "-4",
]  # fmt: skip


def test_time_of_one_curve(tmp_path, record):
    # the first run happens once: it is long enough to be what it is
    value = seconds(tmp_path)
    record("curve_first_s", value, "s", "<= 10", value <= 10.0)
    value = statistics.median(seconds(tmp_path) for _ in range(RUNS))
    record("curve_later_s", value, "s", "<= 2", value <= 2.0)


def seconds(folder):
    """Wall time of the command, which keeps what it compiles in this folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "compiled")}
    started = time.perf_counter()
    done = subprocess.run(COMMAND, cwd=folder, env=environment, check=True, capture_output=True, text=True)
    value = time.perf_counter() - started
    assert "bifurcation" in done.stdout
    return value
