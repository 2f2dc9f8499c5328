"""What ``import vjm`` offers: it is all there, it is cheap, and its results speak for themselves."""

import doctest
import importlib
import inspect
import subprocess
import sys

import numpy as np
import pytest

import vjm
from vjm.vjm_engine import VjmEngine

PUBLIC = [name for name in vjm.__all__ if not name.startswith("_")]


@pytest.fixture(scope="module")
def path(chain):
    return vjm.trace(chain, vjm.LoadCase("A", to=1.0), engine="vjm-paper")


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_is_there_and_documented(name):
    thing = getattr(vjm, name)
    if name != "Machine":  # an alias of two classes
        assert len(inspect.getdoc(thing) or "") > 20


def test_an_unknown_name_is_refused_with_those_that_there_are():
    with pytest.raises(AttributeError, match=r"'lod'.*load"):
        vjm.lod  # noqa: B018


def test_import_alone_loads_no_numpy():
    command = "import sys, vjm; print('numpy' in sys.modules, 'numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout == "False False\n"


@pytest.mark.parametrize("module", ["vjm", "vjm.analysis"])
def test_examples_in_docstrings_hold(module):
    result = doctest.testmod(importlib.import_module(module))
    assert result.attempted >= 2
    assert result.failed == 0


def test_a_word_and_an_engine_are_the_same(chain, path):
    again = vjm.trace(chain, vjm.LoadCase("A", to=1.0), VjmEngine())
    np.testing.assert_array_equal(path.force, again.force)


def test_an_unknown_engine_is_refused(chain):
    with pytest.raises(ValueError, match="did you mean 'exudyn'"):
        vjm.trace(chain, vjm.LoadCase("A", to=1.0), engine="exudin")


def test_results_are_a_few_lines(chain, path):
    for shown in (path, chain, vjm.load("orthoglide"), path.points[0], path.critical):
        assert len(repr(shown)) < 400, repr(shown)
    assert "bifurcation" in repr(path)
    assert path._repr_html_().count("<tr>") == 13


def test_a_frame_has_the_columns_of_a_curve_file(path, tmp_path):
    pd = pytest.importorskip("pandas")
    frame = path.to_frame()
    vjm.write_curve(path, tmp_path / "curve.csv")
    written = pd.read_csv(tmp_path / "curve.csv", comment="#")
    shared = [name for name in written.columns if name in frame.columns]
    assert len(shared) == 15
    # a curve file has 12 digits, its eigenvalue 9
    np.testing.assert_allclose(frame[shared], written[shared], rtol=1e-8, atol=1e-9)


def test_a_plot_shows_every_event(path):
    axes = path.plot()
    assert len(axes.lines) >= 1 + len(path.events)
    assert "mm" in axes.get_xlabel()


def test_stiffness_by_displacement_and_by_wrench_agree(chain):
    imposed = vjm.stiffness(chain, "A", displacement=(-1.0, 0, 0, 0, 0, 0))
    # K^F is the derivative of the wrench: a central difference of 0.002 mm is off by its square and by rounding
    step = 1e-3
    far, near = (vjm.stiffness(chain, "A", displacement=(-1.0 + d, 0, 0, 0, 0, 0)).wrench for d in (step, -step))
    assert (far - near)[0] / (2 * step) == pytest.approx(imposed.loaded[0, 0], rel=1e-6)
    with pytest.raises(ValueError, match="not both"):
        vjm.stiffness(chain, "A", displacement=[0.0] * 6, wrench=[0.0] * 6)
    with pytest.raises(ValueError, match="six finite numbers"):
        vjm.stiffness(chain, "A", displacement=[1.0])


def test_buckling_says_what_its_paths_say(chain):
    found = vjm.buckling(chain, ["A"], engine="vjm-paper")
    assert [row["critical"] for row in found.rows()] == ["bifurcation", None]
    assert found.rows()[0]["F_cr"] == found.paths["A", "tension"].critical.force
    assert found._repr_html_().count("<tr>") == 3
    assert len(found.plot().get_legend().get_texts()) == 2
    with pytest.raises(ValueError, match="up to how many N"):
        vjm.buckling(chain, ["A"], force=True)


def test_a_hinged_column_buckles_at_eulers_load():
    column = vjm.load("pinned-column")
    found = vjm.buckling(column, directions=["compression"], engine="vjm-16", to=10.0)
    (row,) = found.rows()
    beam = column.beams[0]
    section = beam.effective_section()
    assert row["critical"] == "bifurcation"
    # P (1 − P/EA) = π² EI/L²; springs of the tenth order leave less than the event's location, 3e-11
    P = row["F_cr"]
    EI = min(section.EIy, section.EIz)
    assert P * (1 - P / section.EA) == pytest.approx(np.pi**2 * EI / beam.length**2, rel=2e-9)
