"""What gmsh changes in the process that loads it."""

import os
import signal

import pytest
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_fea.solid.drawing import drawing


@pytest.mark.skipif(not hasattr(signal, "SIGPIPE"), reason="this system has no SIGPIPE")
def test_a_closed_pipe_is_an_error_of_python_after_gmsh(tmp_path):
    """`gmsh.initialize` makes SIGPIPE end the process; a drawing that was read leaves it ignored."""
    gmsh_or_skip()
    with drawing(drawn(tmp_path / "beam.step", prism)) as opened:
        assert opened.volume == pytest.approx(100.0 * 20.0 * 10.0)
    reader, writer = os.pipe()
    os.close(reader)
    child = os.fork()
    if not child:
        try:
            os.write(writer, b"x")
        except BrokenPipeError:
            os._exit(7)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    os.close(writer)
    assert os.waitstatus_to_exitcode(status) == 7
