"""The library's pinned column by virtual springs, by finite elements and by the diagnosis's own elastica agree."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.model_file import build_chain, load_chain, read_document
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating.mechanisms.column import column_force

LENGTH, EI = 299.085, 68948.0 * 25.4 * 3.175**3 / 12.0
PUSH = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))


ASIDE = Load((0.0, 1e-3, 0.0, 0.0, 0.0, 0.0), "link", 0.5, ramped=False)
"""N on the middle, which deflects it by 1e-4 mm: a straight column has to know where to go."""


def squeezed(to: float, steps: int | None = None) -> LoadCase:
    """Squeezed by a force along x, controlled by the deflection of the middle, as the operator of the rig does."""
    control = PointControl("link", 0.5, (0.0, 1.0, 0.0))
    return LoadCase("straight", to, "load", steps, free=("x",), loads=(PUSH, ASIDE), control=control)


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine",
    [VjmEngine(16), VjmEngine(32), ExudynEngine(elements=16)],
    ids=["springs", "more springs", "finite elements"],
)
def test_a_straight_column_behind_its_bifurcation(engine):
    path = engine.trace(load_chain("pinned-column"), squeezed(49.0, steps=200))
    assert path.complete, path.stopped
    w = np.array([2.0, 5.0, 10.0, 19.0, 30.0, 48.0])
    there = np.interp(w, path.s, path.ramp)
    # the bar's own shortening by P/EA, 9e-5, is not in the elastica
    np.testing.assert_allclose(there, column_force(w, LENGTH, EI), rtol=2e-4)


@pytest.mark.parametrize("bow", [1.0, 3.0])
def test_a_bowed_column(bow):
    document = copy.deepcopy(read_document("pinned-column").content)
    document["parts"][1]["bow_mm"] = [bow, 0.0]
    path = VjmEngine(32).trace(build_chain(document, "m.toml"), squeezed(30.0, steps=120))
    w = np.array([0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0])
    there = np.interp(w, path.s, path.ramp)
    # the polygon of springs and the chord that the bow shortens by (πa)²/4L, 0.02 mm of 299
    np.testing.assert_allclose(there, column_force(w, LENGTH, EI, bow), rtol=3e-3)
