"""Yield of parts from drawings: the same bar once as a shape, once by forms of its stress."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from vjm.continuation.arc_length import trace
from vjm.engines import VjmEngine
from vjm.io.model_file import build_chain, read_document
from vjm.model.load_case import LoadCase
from vjm_updating.diagnosis.stress import first_yield

COLUMN = read_document("pinned-column").content
LENGTH, WIDTH, THICKNESS, LIMIT = 299.085, 25.4, 3.175, 241.3


def bar_stress(x, y, z):
    """Axial stress ``(6,)`` per unit wrench at the tip of a rectangular bar, at a point of it."""
    A, Iy, Iz = WIDTH * THICKNESS, THICKNESS * WIDTH**3 / 12.0, WIDTH * THICKNESS**3 / 12.0
    arm = LENGTH - x
    # the moments at x: My = my − fz arm, Mz = mz + fy arm
    return np.array([1.0 / A, -y * arm / Iz, -z * arm / Iy, 0.0, z / Iy, -y / Iz])


def drawn(segments, places):
    """The table of a drawing with the stress at the corners of sections along the bar."""
    points, forms = [], []
    for x in np.linspace(0.0, LENGTH, places):
        for y in (-0.5 * THICKNESS, 0.5 * THICKNESS):
            for z in (-0.5 * WIDTH, 0.5 * WIDTH):
                s = bar_stress(x, y, z)
                points.append([float(x), y, z])
                forms.append(np.outer(s, s)[np.triu_indices(6)].tolist())
    return {
        "file": "bar.step", "thickness_mm": THICKNESS, "yield_stress_MPa": LIMIT,
        "stress_at_mm": points, "stress_forms": forms,
    }  # fmt: skip


def documents(segments, **changes):
    """The column as a shape, and with a drawing."""
    shape = copy.deepcopy(COLUMN)
    shape["parts"][1] |= changes
    solid = copy.deepcopy(shape)
    solid["parts"][1]["drawing"] = drawn(segments, segments + 1)
    del solid["parts"][1]["section"]["yield_stress_MPa"]
    return shape, solid


def firsts(documents, load_case, segments):
    found = []
    for document in documents:
        problem = VjmEngine(segments).problem(build_chain(document, "m.toml"), load_case)
        found.append(first_yield(problem, trace(problem, load_case), document["parts"]))
    return found


def test_a_bowed_column_yields_at_the_same_force():
    """Compression bends its middle most: a point has to bear what its own segment bears, not what the tip does."""
    shape, solid = firsts(documents(16, bow_mm=[2.0, 0.0]), LoadCase("straight", -20.0), 16)
    assert shape.force is not None
    # a corner between two segments is counted to one of them
    assert solid.force == pytest.approx(shape.force, rel=5e-3)
    assert solid.words == "on the way, in link"


def test_a_pulled_bar_yields_all_through():
    shape, solid = firsts(documents(4), LoadCase("straight", 1.5), 4)
    assert solid.force == pytest.approx(LIMIT * WIDTH * THICKNESS, rel=1e-3)
    assert solid.force == pytest.approx(shape.force, rel=1e-9)


def test_round_bars_have_no_corners():
    document = copy.deepcopy(COLUMN)
    section = document["parts"][1]["section"]
    for key in ("width_mm", "thickness_mm"):
        del section[key]
    d = 6.0
    section |= {"shape": "round_bar", "diameter_mm": d}
    (found,) = firsts([document], LoadCase("straight", 1.5), 4)
    assert found.force == pytest.approx(LIMIT * np.pi * d**2 / 4.0, rel=1e-3)


def test_a_drawing_without_a_yield_stress_says_so():
    _, solid = documents(4)
    del solid["parts"][1]["drawing"]["yield_stress_MPa"]
    (found,) = firsts([solid], LoadCase("straight", 0.1), 4)
    assert (found.force, found.known) == (None, False)
    assert found.words == "not known: the model says no yield stress of link"
