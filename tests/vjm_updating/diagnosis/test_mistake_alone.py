"""A mistake of the instruments never stands alone where more than noise is left."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.from_files import diagnose

from vjm_updating.diagnosis.discrepancy import Misfit
from vjm_updating.diagnosis.run import unless_unexplained
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment.mistakes import UNIT, Mistake
from vjm_updating.inference.significance import FALSE_ALARMS

POUNDS = Mistake(
    cause=UNIT, where=np.ones(3, dtype=bool), factors={"fx_N": 4.448}, parameters={f"{UNIT}.fx_N": 4.448}
)
QUIET = Verdict("none", (), (), 0.8, (), Misfit(0.5, 0.0, ""))


def left(p=1.0, prior_p=1.0):
    return Verdict(
        "none", (), (), 0.8, (), Misfit(p, 40.0, "fx_N: shape", prior_p, "modulus link 5.1 sigma from the sheet's")
    )


def test_a_mistake_that_leaves_noise_is_the_finding():
    assert unless_unexplained(QUIET, [POUNDS]) is QUIET


def test_without_a_mistake_nothing_changes():
    verdict = left(p=0.1 * FALSE_ALARMS)
    assert unless_unexplained(verdict, []) is verdict


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (left(p=0.1 * FALSE_ALARMS), "leaves fx_N: shape"),
        (left(prior_p=0.1 * FALSE_ALARMS), "takes modulus link 5.1 sigma"),
    ],
)
def test_a_mistake_that_leaves_more_is_a_guess(verdict, words):
    found = unless_unexplained(verdict, [POUNDS])
    assert found.kind == "unknown"
    assert not found.members
    assert words in found.doubt
    assert found.confidence == pytest.approx(0.5)


@pytest.mark.slow
def test_pounds_beside_what_no_cause_explains(make, tmp_path, monkeypatch):
    """Forces in pounds from the middle on, and a wave of twenty sigma that no catalogue has."""
    made = make.made_up(tmp_path, {}, 8, monkeypatch)
    head, *rows = made.data.read_text().splitlines()
    names = head.split(",")
    fx, force = (
        names.index("fx_N"),
        [k for k, name in enumerate(names) if name in ("fx_N", "fy_N", "fz_N", "my_Nmm", "mz_Nmm")],
    )
    lines = [head]
    for k, row in enumerate(rows):
        cells = row.split(",")
        cells[fx] = repr(float(cells[fx]) + 40.0 * math.sin(0.9 * k))
        for c in force:
            cells[c] = repr(float(cells[c]) / (4.4482216152605 if k >= 60 else 1.0))
        lines.append(",".join(cells))
    made.data.write_text("\n".join(lines) + "\n")
    document = diagnose(made.data, made.sheet, tmp_path / "out")
    assert document.verdict == "unknown"
    assert "another unit" in document.residual
    assert document.alternatives
    assert all(UNIT in row.causes for row in document.alternatives)
