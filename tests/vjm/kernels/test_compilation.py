"""A kernel that is kept on disk is compiled anew where one that it calls has changed."""

import os
import subprocess
import sys

CALLEE = "from vjm.kernels.compilation import kernel\n\n\n@kernel\ndef factor(x):\n    return {} * x\n"
CALLER = (
    "from callee import factor\nfrom vjm.kernels.compilation import entry\n"
    "from vjm.kernels.compiling import watchers\n\nsaid = []\nwatchers.append(said.append)\n\n\n"
    "@entry\ndef scaled(x):\n    return factor(x)\n\n\n"
    "print(scaled(3.0), sum(scaled.stats.cache_hits.values()), *said)\n"
)


def test_a_change_of_what_a_kernel_calls_is_seen(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    # Python's own cache looks at a file's time in whole seconds and its size, which stay here
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}
    said = []
    for factor in (2.0, 2.0, 5.0):
        (tmp_path / "callee.py").write_text(CALLEE.format(factor))
        run = subprocess.run(
            [sys.executable, "caller.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        said.append(run.stdout.split())
    # the second run finds what the first has kept, the third must not
    # and who watches is told of each kernel that is compiled, of none that is loaded
    assert said == [["6.0", "0", "scaled", "factor"], ["6.0", "1"], ["15.0", "0", "scaled", "factor"]]


KEPT = """
from numba.core.cpu import CPUContext
from vjm import warm_up
from vjm_updating.warm_up import histories

read, reading = [], CPUContext.load_additional_registries
CPUContext.load_additional_registries = lambda context: read.append(context) or reading(context)
for work in (warm_up.paths, warm_up.platforms, warm_up.postures, histories):
    work()
print(len(read))
"""


def test_every_kernel_that_is_kept_is_loaded_without_what_compiling_takes():
    """A kernel that needs one of Numba's translations to be loaded would end the process."""
    command = [sys.executable, "-c", KEPT]
    subprocess.run(command, check=True, capture_output=True)
    assert subprocess.run(command, check=True, capture_output=True).stdout.split() == [b"0"]
