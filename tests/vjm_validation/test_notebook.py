"""The first tutorial as a notebook, which the gallery offers to load: it runs and gets the tutorial's figures."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def notebook():
    """The notebook that sphinx-gallery makes of the program."""
    pytest.importorskip("sphinx_gallery")
    from sphinx_gallery.gen_gallery import DEFAULT_GALLERY_CONF
    from sphinx_gallery.notebook import jupyter_notebook
    from sphinx_gallery.py_source_parser import split_code_and_text_blocks

    program = DOCS / "gallery/plot_arm_map.py"
    return jupyter_notebook(
        split_code_and_text_blocks(str(program))[1], {**DEFAULT_GALLERY_CONF}, str(program.parent)
    )


def test_the_notebook_of_the_first_tutorial_runs(notebook, capsys):
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) == 3
    kernel = {}
    with mpl.rc_context({"backend": "agg"}):
        for cell in cells:
            exec(compile(cell, "cell", "exec"), kernel)
        sys.modules["matplotlib.pyplot"].close("all")
    out = capsys.readouterr().out
    tutorial = (DOCS / "tutorials/urdf-arm.md").read_text(encoding="utf-8")
    sinks = float(re.search(r"sinks by (\S+) mm", tutorial)[1])
    least, largest = (float(v) for v in re.search(r"kt_min_N_per_mm: (\S+) to (\S+)", tutorial).groups())
    # the tutorial rounds to its last digit; the notebook's grid is denser and ends at the same corners
    assert -kernel["found"].deflection[0, 0, 2] == pytest.approx(sinks, abs=0.006)
    assert (np.min(kernel["weakest"]), np.max(kernel["weakest"])) == pytest.approx((least, largest), rel=1e-4)
    assert f"from {least:.1f} to {largest:.1f} N/mm" in out
