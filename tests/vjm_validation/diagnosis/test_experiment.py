"""The next experiment tells a class's members apart, and breaks nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest

from vjm.io.model_file import load_chain
from vjm.paths import EventKind
from vjm.programme import Programme
from vjm.vjm_engine import VjmEngine
from vjm_validation.diagnosis.experiment import SHORT_OF, propose
from vjm_validation.diagnosis.observed import observe
from vjm_validation.diagnosis.preparation import prepare
from vjm_validation.measurement import read_measurement

SHEET = """
[test]
model = "orthoglide-chain"

[model]
link_segments = 8

[instrument.ux_mm]
noise = 0.001
zero = 0.002
scale = 0.001

[instrument.fx_N]
noise = 2.0
zero = 3.0
scale = 0.003

[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
"""
PULL = 1.0
CLASS = ("actuator_compliance", "load_misalignment", "joint_clearance")
VALUES = {"actuator_compliance": [4e-5], "load_misalignment": [0.1, 0.1], "joint_clearance": [0.05, 0.0, 8.0]}


@pytest.fixture(scope="module")
def pulled(tmp_path_factory):
    """One pull in posture A, of a machine with a soft drive."""
    folder = tmp_path_factory.mktemp("pulled")
    chain = load_chain("orthoglide-chain").with_actuator_compliance(4e-5)
    path = VjmEngine(8).walk(chain, Programme("A", PULL))
    u = np.linspace(0.0, PULL, 30)
    force = np.interp(u, path.s, path.force) + 2.0 * np.random.default_rng(1).standard_normal(len(u))
    rows = [f"{2.0 * k:.1f},A,{x:.4f},{f:.2f}" for k, (x, f) in enumerate(zip(u, force, strict=True))]
    (folder / "data.csv").write_text("\n".join(["time_s,posture,ux_mm,fx_N", *rows]) + "\n")
    (folder / "sheet.toml").write_text(SHEET)
    prepared = prepare(observe(read_measurement(folder / "data.csv", folder / "sheet.toml")))
    start = np.zeros(len(prepared.fitter.nuisances))
    found = {}
    for cause in CLASS:
        effect = next(e for e in prepared.effects if e.cause == cause)
        values = VALUES[cause][: len(effect.quantities())]
        found[cause] = prepared.fitter.fit((effect,), start, [values])
        assert found[cause] is not None
    return prepared, found


def critical(posture: str, sign: float) -> float:
    """Displacement at which the sheet's machine turns critical, mm; infinite where it does not within 5 mm."""
    path = VjmEngine(8).walk(load_chain("orthoglide-chain"), Programme(posture, sign * 5.0))
    sharp = [e.s for e in path.events if e.kind is not EventKind.BEND_OVER]
    return min(sharp, default=np.inf)


def test_it_tells_the_first_from_each_of_the_others(pulled):
    prepared, found = pulled
    first, *others = CLASS
    whole = propose(prepared.fitter, [found[cause] for cause in CLASS])
    alone = [propose(prepared.fitter, [found[first], found[other]]) for other in others]
    assert whole is not None
    assert None not in alone
    # what tells both apart tells none of them better than the experiment that was chosen for it alone
    assert whole.strength <= min(one.strength for one in alone) * 1.05 + 1e-9
    assert whole.strength > 2.0
    assert whole.posture != "A"


def test_it_stays_short_of_critical_points(pulled):
    prepared, found = pulled
    proposal = propose(prepared.fitter, [found[cause] for cause in CLASS[:2]])
    word, end = re.match(r"(pull and push|pull|push) to (-?[0-9.]+) mm", proposal.path).groups()
    for sign in {"pull and push": (1.0, -1.0), "pull": (1.0,), "push": (-1.0,)}[word]:
        assert abs(float(end)) <= SHORT_OF * critical(proposal.posture, sign) + 1e-3
