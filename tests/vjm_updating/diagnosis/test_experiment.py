"""The next experiment tells a class's members apart, and breaks nothing."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_updating.diagnosis import experiment
from vjm_updating.diagnosis.document import ExperimentRow
from vjm_updating.diagnosis.experiment import FURTHER, MOST, SHORT_OF, WANTED, propose
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.preprocess import prepare
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import best_fit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.parameters import FitParameter

SHEET = (
    table_text("test", model="orthoglide-chain")
    + table_text("model", link_segments=8)
    + instruments_text(ux_mm=(0.001, 0.002, 0.001), fx_N=(2.0, 3.0, 0.003))
    + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
)
PULL = 1.0
CLASS = ("actuator_compliance", "base_compliance", "joint_clearance")
VALUES = {
    "actuator_compliance": [5e-5],
    "base_compliance": [5e-5, 1.0, 1.0, 1.0, 1.0, 1.0],
    "joint_clearance": [0.05, 0.0, 8.0, 0.0],
}


@pytest.fixture(scope="module")
def pulled(tmp_path_factory):
    """One pull in posture A, of a machine with a soft drive."""
    folder = tmp_path_factory.mktemp("pulled")
    chain = load_chain("orthoglide-chain").with_actuator_compliance(5e-5)
    path = VjmEngine(8).trace(chain, LoadCase("A", PULL))
    u = np.linspace(0.0, PULL, 30)
    force = np.interp(u, path.s, path.force) + 2.0 * np.random.default_rng(1).standard_normal(len(u))
    rows = [f"{2.0 * k:.1f},A,{x:.4f},{f:.2f}" for k, (x, f) in enumerate(zip(u, force, strict=True))]
    (folder / "data.csv").write_text("\n".join(["time_s,posture,ux_mm,fx_N", *rows]) + "\n")
    (folder / "sheet.toml").write_text(SHEET)
    prepared = prepare(observe_ramps(read_measurement(folder / "data.csv", folder / "sheet.toml")))
    start = np.zeros(len(prepared.fitter.nuisances))
    found = {}
    for cause in CLASS:
        effect = next(e for e in prepared.effects if e.cause == cause)
        values = VALUES[cause][: len(effect.quantities())]
        found[cause] = best_fit(prepared.fitter, (effect,), start, [values])
        assert found[cause] is not None
    return prepared, found


def test_no_experiment_is_proposed_that_shows_less_than_the_noise(pulled):
    prepared, fits = pulled
    first = fits["actuator_compliance"]
    kind = kind_of(prepared.all.measurement)
    alike = [SimpleNamespace(causes=frozenset(names), fit=first) for names in (("gravity",), ("creep",))]
    row = kind.next_experiment(prepared.fitter, SimpleNamespace(members=alike))
    assert (row.posture, row.path, row.strength) == ("", "", None)
    assert row.why == "no ramp in a posture of the model tells gravity from creep by more than the noise"


def critical(posture: str, sign: float) -> float:
    """Displacement at which the sheet's machine turns critical, mm; infinite where it does not within 5 mm."""
    path = VjmEngine(8).trace(load_chain("orthoglide-chain"), LoadCase(posture, sign * 5.0))
    sharp = [e.s for e in path.events if e.kind is not EventKind.STIFFNESS_KNEE]
    return min(sharp, default=np.inf)


@pytest.mark.slow
def test_it_tells_the_first_from_each_of_the_others(pulled):
    prepared, found = pulled
    first, *others = CLASS
    whole = propose(prepared.fitter, [found[cause] for cause in CLASS])
    alone = [propose(prepared.fitter, [found[first], found[other]]) for other in others]
    assert whole is not None
    assert None not in alone
    # what distinguishes both determines none of them better than the experiment that was chosen for it alone
    assert whole.strength <= min(one.strength for one in alone) * 1.05 + 1e-9
    assert whole.strength > 2.0
    assert whole.posture != "A"


def test_it_stays_short_of_critical_points(pulled):
    prepared, found = pulled
    proposal = propose(prepared.fitter, [found[cause] for cause in CLASS[:2]])
    word, end = re.match(r"(pull and push|pull|push) to (-?[0-9.]+) mm", proposal.path).groups()
    for sign in {"pull and push": (1.0, -1.0), "pull": (1.0,), "push": (-1.0,)}[word]:
        assert abs(float(end)) <= SHORT_OF * critical(proposal.posture, sign) + 1e-3


def test_it_goes_no_further_than_the_load_of_the_test_allows(pulled):
    prepared, found = pulled
    proposal = propose(prepared.fitter, [found[cause] for cause in CLASS[1:]])
    end = abs(float(re.search(r"to (-?[0-9.]+) mm", proposal.path).group(1)))
    drawn = load_chain("orthoglide-chain")
    load = VjmEngine(8).trace(drawn.with_actuator_compliance(4e-5), LoadCase("A", PULL)).force[-1]
    for sign in (1.0, -1.0):
        # the chain as drawn says how far that is, the likeliest cause how much the load was: they differ by a tenth
        assert (
            abs(VjmEngine(8).trace(drawn, LoadCase(proposal.posture, sign * end)).force[-1]) < 1.1 * FURTHER * load
        )


def test_what_repetitions_tell_decides(pulled, monkeypatch):
    """Posture B shows three pairs at once and the fourth never, D all of them often enough."""
    once = {"B": (9.0, 9.0, 9.0, 0.9), "D": (3.0, 3.0, 3.0, 1.0)}

    def told(fitter, fits, posture, name, ends, times=1):
        strengths = once.get(posture, (0.1,) * 4)
        grown = [s * times**0.5 if posture != "B" or s > 1.0 else s for s in strengths]
        return [ExperimentRow(posture=posture, path=f"{times} times", strength=s) for s in grown]

    monkeypatch.setattr(experiment, "_told", told)
    prepared, found = pulled
    proposal = propose(prepared.fitter, list(found.values()))
    assert (proposal.posture, proposal.path) == ("D", f"{min(MOST, round(WANTED**2))} times")


@pytest.mark.parametrize(("faint", "words"), [(0.5, f"{MOST} times"), (0.02, "1 times")])
def test_it_is_repeated_only_where_that_decides_something(pulled, monkeypatch, faint, words):
    """Of three pairs one shows at once, one nearly, and one hardly ever."""

    def told(fitter, fits, posture, name, ends, times=1):
        strengths = np.array([9.0, 0.99 * WANTED, faint]) * times**0.5
        return [ExperimentRow(posture=posture, path=f"{times} times", strength=s) for s in strengths]

    monkeypatch.setattr(experiment, "_told", told)
    # as often as the one that is faint needs, were it not out of reach
    monkeypatch.setattr(experiment, "HELPS", 1e6)
    prepared, found = pulled
    assert propose(prepared.fitter, list(found.values())).path == words


@pytest.mark.parametrize("high", [0.5, 3.0])
def test_what_the_test_at_hand_says_nothing_of_lies_within_its_bounds(high):
    """One reading, eight of noise off; a coordinate that nothing is known of could make that up at eight."""
    flat = SimpleNamespace(whitening=SimpleNamespace(flat=lambda raw: raw))
    tilt = FitParameter("tilt", "effect", "0", 1.0, sigma=np.inf, low=-high, high=high)
    # an even distribution's variance is a twelfth of its width squared: of reading and tilt together
    together = 1.0 + (2.0 * high) ** 2 / 12.0
    found, left = experiment.left_over(flat, np.array([8.0]), np.array([[1.0]]), np.zeros((1, 1)), [tilt])
    # 1e-9 keeps what is fixed regular, beside weights of one and more: ten times what that makes
    assert found == pytest.approx(8.0 / together**0.5, rel=1e-8)
    assert left[0] == pytest.approx(8.0 / together, rel=1e-8)
