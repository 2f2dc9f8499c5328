"""Foreign libraries in a child: its limits, its errors, and its end with whoever waits for it."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from helpers import child_work

from vjm.child_process import GIB, ChildError, ChildLimits, installed, run_in_child

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the limits are those of POSIX systems")
ROOMY = ChildLimits(60.0, GIB, "take a smaller file")


def run(function, *arguments, limits=ROOMY, progress=None):
    return run_in_child(function, *arguments, what="part.step: gmsh", limits=limits, progress=progress)


def children(pid):
    """Numbers of the processes that a process started."""
    every = (file.read_text() for file in Path(f"/proc/{pid}/task").glob("*/children"))
    return [int(word) for text in every for word in text.split()]


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_result_progress_and_what_is_printed(capfd):
    signs = []
    assert run(child_work.double, [1.5], progress=lambda *sign: signs.append(sign)) == [1.5, 1.5]
    assert signs == [("half", 1, 2)]
    # standard output is where a document may go
    assert capfd.readouterr() == ("", "a warning\n")


def test_an_error_is_that_of_the_function():
    with pytest.raises(ModuleNotFoundError, match="none such") as caught:
        run(child_work.divide)
    assert caught.value.name == "such"
    assert isinstance(caught.value.__cause__, ValueError)
    with pytest.raises(RuntimeError, match="OddError: this and that"):
        run(child_work.raise_odd)


@pytest.mark.parametrize(
    ("function", "how"),
    [
        (child_work.read_nowhere, "SIGSEGV"),
        (child_work.give_up, "SIGABRT: terminate called: no more"),
        (child_work.leave, "exit status 3"),
    ],
)
def test_a_crash_is_one_line(function, how):
    with pytest.raises(ChildError) as caught:
        run(function)
    assert str(caught.value) == f"part.step: gmsh crashed ({how}): take a smaller file"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not count what is allocated")
def test_allocations_have_a_limit():
    tight = ChildLimits(60.0, 0.25 * GIB, "take a smaller file")
    assert run(child_work.allocate, 64, limits=tight) == 64 * 2**20
    with pytest.raises(MemoryError, match=r"part.step: gmsh needs more than 0.25 GB .*: take a smaller file"):
        run(child_work.allocate, 512, limits=tight)


def test_time_has_a_limit_from_sign_to_sign():
    # 2.1 s of work in all, never a second and a half without a sign
    brief = ChildLimits(1.5, GIB, "take a smaller file")
    assert run(child_work.report_thrice, limits=brief, progress=lambda *_: None) == "done"
    begun = time.monotonic()
    with pytest.raises(ChildError) as caught:
        run(child_work.work_deaf, limits=brief)
    assert str(caught.value) == "part.step: gmsh did not finish in 1.5 s and was stopped: take a smaller file"
    # twenty times the limit is a third of what it would have taken
    assert time.monotonic() - begun < 20.0


def test_an_interrupt_ends_the_child():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    # of other tests in this process
    others = children(os.getpid()) if sys.platform == "linux" else []
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            run(child_work.work_deaf)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - begun < 20.0
    if sys.platform == "linux":
        assert set(children(os.getpid())) <= set(others)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process that its parent ended")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_child_ends_with_its_parent(number):
    code = (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        "from helpers import child_work\nfrom vjm.child_process import ChildLimits, run_in_child\n"
        "run_in_child(child_work.work_deaf, what='', limits=ChildLimits(60.0, 2.0**30, ''))"
    )
    parent = subprocess.Popen([sys.executable, "-c", code])
    try:
        child = _soon(lambda: children(parent.pid))[0]
        # its handlers stand, and Python's start is over
        _soon(lambda: _ignores(child, signal.SIGTERM))
    finally:
        parent.send_signal(number)
        assert parent.wait(20.0) == -number
    _soon(lambda: not alive(child))


def _soon(ask):
    deadline = time.monotonic() + 30.0
    while not (answer := ask()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return answer


def _ignores(pid, number):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    mask = next(int(line.split()[1], 16) for line in lines if line.startswith("SigIgn"))
    return bool(mask >> (number - 1) & 1)


def test_a_library_that_is_not_there_starts_no_child(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ModuleNotFoundError, match="mujoco"):
        installed("mujoco")
    installed("numpy")
