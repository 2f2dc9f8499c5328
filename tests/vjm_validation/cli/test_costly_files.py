"""Small files that make a foreign library work without end: a limit ends it, and so does a signal, at once."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.command import refused

from vjm.io import foreign_readers

REPEATED = (
    '<mujoco><worldbody><replicate count="50000000" offset="0 0 1"><body><geom size="1"/></body></replicate>'
    "</worldbody></mujoco>"
)
NESTED = "".join(
    [
        "<mujoco><worldbody>",
        4 * '<replicate count="999" offset="0 0 1">',
        '<body><geom size="1"/></body>',
        4 * "</replicate>",
        "</worldbody></mujoco>",
    ]
)
ENDLESS = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${max(range(10**13))}"/></robot>'
HUGE = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${len(str(10)*10**11)}"/></robot>'
CASES = {
    "repeated": ("mujoco", REPEATED, []),
    "nested": ("mujoco", NESTED, []),
    "endless": ("xacro", ENDLESS, ["--xacro"]),
}


@pytest.fixture(params=CASES)
def costly(request, tmp_path):
    """Words of a command that would not end."""
    library, text, more = CASES[request.param]
    pytest.importorskip(library, reason=f"the extra that brings {library} is not installed")
    file = tmp_path / "robot.xml"
    file.write_text(text)
    return ["import", str(file), *more, "--out", str(tmp_path / "robot.toml")]


@pytest.mark.slow
def test_a_limit_ends_it(costly, monkeypatch, tmp_path):
    monkeypatch.setattr(foreign_readers, "LIMITS", replace(foreign_readers.LIMITS, seconds=4.0))
    begun = time.monotonic()
    line = refused(*costly)
    assert line.startswith("validate: robot.xml: ")
    assert " did not finish in 4 s and was stopped: take out of the file what no machine needs" in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["robot.xml"]
    # the limit, and what a loaded machine takes for the command's imports
    assert time.monotonic() - begun < 30.0


def test_allocations_have_a_limit(tmp_path):
    pytest.importorskip("xacro", reason="the extra that brings xacro is not installed")
    file = tmp_path / "robot.xml"
    file.write_text(HUGE)
    line = refused("import", file, "--xacro", "--out", tmp_path / "robot.toml")
    assert "robot.xml: xacro needs more than 4 GB of working memory: take out" in line


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc shows what the library does")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_at_once(costly, number):
    # a shell starts its background jobs with this signal ignored, and so would be what a test in one starts
    handled = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"import sys; sys.path[:] = {sys.path!r}; {handled}; from vjm_validation.cli.main import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *costly], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60.0
    while not (children := Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    # long enough for it to be in the library
    time.sleep(3.0)
    assert process.poll() is None
    process.send_signal(number)
    sent = time.monotonic()
    out, err = process.communicate(timeout=60.0)
    # a second; three more where every processor is taken
    assert time.monotonic() - sent < 4.0
    assert (process.returncode, out, err) == (130, "", "validate: interrupted\n")
    assert not any(Path(f"/proc/{child}").exists() for child in children)
