"""Tests that hide an effect in made-up readings and read nothing but what `validate diagnose` writes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_effects.designs import small_design
from hidden_effects.finder import diagnosed
from hidden_effects.generate import make
from hidden_effects.plan import Group, Plan
from hidden_effects.signatures import Signatures, signatures
from hidden_effects.virtual_rig import WRENCH, Design, Known, Sequence

GOOD = {"ux_mm": Known(0.0005, 0.002, 0.001)} | {
    name: Known(2.0, 3.0, 0.003) if name[0] == "f" else Known(150.0, 300.0, 0.003) for name in WRENCH
}
"""A force cell of six channels and a gauge, about those of docs/measured-data.md's example."""


def bipolar(posture: str, pull: float, push: float, start: float, steps: int = 8) -> Sequence:
    """Out, held, through to the other side, held, and back."""
    ways = [np.linspace(0.0, pull, steps), np.full(4, pull), np.linspace(pull, -push, 2 * steps)[1:],
            np.full(4, -push), np.linspace(-push, 0.0, steps)[1:]]  # fmt: skip
    ux = np.concatenate(ways)
    pace = np.concatenate([np.full(len(way), 40.0 if np.ptp(way) == 0.0 else 3.0) for way in ways])
    time = start + np.cumsum(pace)
    warm = 21.0 + 1.2 * np.sin(time / 170.0) + 0.6 * np.sin(time / 61.0)
    return Sequence(posture, ux, time, warm)


def three_postures(**changes: object) -> Design:
    """Pull and push with holds in A, B and D, six channels."""
    sequences, start = [], 300.0
    for posture, pull, push in (("A", 1.2, 1.9), ("B", 2.8, 2.8), ("D", 2.3, 2.3)):
        sequences.append(bipolar(posture, pull, push, start))
        start = float(sequences[-1].time[-1]) + 300.0
    kept = {"seed": 2 * 10**6, "kind": "three postures", "sequences": tuple(sequences), "instruments": GOOD,
            "drive": 5e-5, "autocorrelation": 0.4, "outliers": 0.004, "missing": 0.01, "quantum": 0.25}  # fmt: skip
    return Design(**(kept | changes))  # type: ignore[arg-type]


class OneDesign:
    """A store of one design's signatures."""

    designs = 3

    def __init__(self, known: Signatures) -> None:
        self.known = known

    def another(self, seed: int, trial: int) -> int:
        return seed

    def signatures(self, seed: int) -> Signatures:
        return self.known


Hide = Callable[..., tuple[dict, dict]]


def hider(known: Signatures, folder: Path) -> Hide:
    """Makes a set in a folder and diagnoses it: what was hidden, and what was found."""

    def hide(number: int, group: Group, *causes: str, strength: float = 20.0) -> tuple[dict, dict]:
        place = folder / f"{number}"
        plan = Plan(number, group, known.visibility.design.seed, causes, (strength,) * len(causes))
        truth = make(plan, OneDesign(known), place)
        for name in ("truth.json", "still.csv"):
            # out of the diagnosis's sight
            (place / name).unlink()
        found = diagnosed(place / "data.csv", place / "sheet.toml", place / "found")
        assert "error" not in found, found["error"]
        written = json.loads((place / "found" / "diagnosis.json").read_text(encoding="utf-8"))
        return truth, written

    return hide


@pytest.fixture(scope="session")
def hide(tmp_path_factory: pytest.TempPathFactory) -> Hide:
    """Hides causes in a test of three postures, six channels."""
    return hider(signatures(three_postures()), tmp_path_factory.mktemp("three"))


@pytest.fixture(scope="session")
def hide_in_a_small_test(tmp_path_factory: pytest.TempPathFactory) -> Hide:
    """Hides causes in two postures of ten readings each, three channels."""
    return hider(signatures(small_design()), tmp_path_factory.mktemp("small"))


@pytest.fixture(scope="session")
def hide_in_a_ramp(tmp_path_factory: pytest.TempPathFactory) -> Hide:
    """Hides causes in one short pull in posture A, force along it only."""
    design = three_postures(seed=2 * 10**6 + 1, instruments={name: GOOD[name] for name in ("ux_mm", "fx_N")})
    (first, *_) = design.sequences
    up = np.arange(30)
    ramp = Sequence("A", np.linspace(0.0, 1.2, 30), 300.0 + 3.0 * up, 21.0 + 0.02 * up)
    design = replace(design, kind="ramp", sequences=(ramp,))
    assert first.posture == "A"
    return hider(signatures(design), tmp_path_factory.mktemp("ramp"))
