"""Critical forces before and after, and where the material would yield."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from vjm.arc_length import walk
from vjm.effects.column import column_force
from vjm.io.model_file import build_chain, read_document
from vjm.programme import Load, PointControl, Programme
from vjm.vjm_engine import VjmEngine
from vjm_validation.diagnosis.critical import knee
from vjm_validation.diagnosis.stress import fibre_of, first_yield

COLUMN = read_document("pinned-column").content


def column(**section):
    document = copy.deepcopy(COLUMN)
    table = document["parts"][1]
    bow = section.pop("bow_mm", None)
    table["section"] |= section
    if bow:
        table["bow_mm"] = bow
    return document


def walked(document, programme, segments=32):
    problem = VjmEngine(segments).problem(build_chain(document, "m.toml"), programme)
    return problem, walk(problem, programme)


def squeezed(to):
    """Squeezed along x by a force, steered by the deflection of the middle."""
    push = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return Programme(
        "straight", to, "load", free=("x",), loads=(push,), control=PointControl("link", 0.5, (0, 1, 0))
    )


def test_a_pulled_bar_yields_all_through():
    # (a squeezed one buckles long before)
    problem, path = walked(COLUMN, Programme("straight", 1.5))
    found = first_yield(problem, path, COLUMN)
    assert found.force == pytest.approx(241.3 * 25.4 * 3.175, rel=1e-3)
    assert found.words == "on the way"


def test_a_column_buckles_long_before_it_yields():
    document = column()
    problem, path = walked(document, Programme("straight", -1.0))
    found = first_yield(problem, path, document)
    euler = np.pi**2 * 68948.0 * 25.4 * 3.175**3 / 12.0 / 299.085**2
    assert path.critical.force == pytest.approx(euler, rel=1e-3)
    share = 100.0 * euler / (241.3 * 25.4 * 3.175)
    assert found.force is None
    assert found.words == f"not before: {share:.0f} % of the yield stress is reached at the bifurcation"


def test_a_bowed_column_yields_where_beam_theory_says():
    document = column(bow_mm=[2.0, 0.0])
    problem, path = walked(document, squeezed(30.0), 64)
    found = first_yield(problem, path, document)
    w = np.linspace(1.0, 30.0, 400)
    P = column_force(w, 299.085, 68948.0 * 25.4 * 3.175**3 / 12.0, 2.0)
    stress = P / (25.4 * 3.175) + P * (w + 2.0) / (25.4 * 3.175**2 / 6.0)
    # the force grows by a tenth of a per cent per 0.1 mm here; steps of the path are interpolated linearly
    assert found.force == pytest.approx(np.interp(241.3, stress, P), rel=2e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"yield_stress_MPa": None}, "not known: the model says no yield stress of link"),
        ({"shape": None}, "not known: the model says no shape of the section of link"),
    ],
)
def test_it_says_what_is_not_known(change, words):
    table = column()["parts"][1]
    for key in change:
        table["section"].pop(key)
    assert fibre_of(table) == words


def test_a_knee_is_seen_only_where_there_is_one():
    s = np.linspace(0.0, 3.0, 40)
    assert knee(s, np.minimum(1000.0 * s, 2000.0 + 50.0 * (s - 2.0))) == pytest.approx(2000.0, rel=0.02)
    assert knee(s, 1000.0 * s) is None
