"""Mistakes in tests of every kind are noticed and named; sound tests are not doubted."""

import warnings

import pytest

from mistakes.of_all_kinds import of_set, said
from mistakes.sets import SETS

SEED = 3
NAMED = {
    "loads": {("unit inches", "a block"), ("sign of all read", "a block"), ("a block twice", "a block")},
    "poses": {
        ("unit inches", "a block"), ("unit cm", "a block"), ("sign of a joint", "a block"),
        ("two joints exchanged", "a block"), ("readings shifted by 1", "a block"), ("a block twice", "a block"),
        ("-999 for an absent value", "cells"), ("a column copied", "everywhere"),
    },
    "deflections": {
        ("unit inches", "a block"), ("unit kgf", "a block"), ("sign of all read", "a block"),
        ("readings shifted by 1", "a block"), ("readings shifted by 5", "everywhere"), ("a block twice", "a block"),
    },
    "frequencies": {("unit rad/s", "a block"), ("unit rpm", "everywhere")},
}  # fmt: skip
"""By kind of test mistakes that have to be named, and where they are."""


@pytest.fixture(autouse=True)
def _quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@pytest.mark.slow
@pytest.mark.parametrize("kind", NAMED)
def test_mistakes_are_named(kind, tmp_path):
    met = {(mistake, place) for mistake, place, _, named, _ in of_set(kind, SEED, tmp_path) if named}
    assert not NAMED[kind] - met


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=[] if kind in ("loads", "frequencies", "joint") else [pytest.mark.slow])
        for kind in SETS
    ],
)
def test_a_sound_test_is_not_doubted(kind, tmp_path):
    assert said(*SETS[kind](tmp_path, SEED)) == ()
