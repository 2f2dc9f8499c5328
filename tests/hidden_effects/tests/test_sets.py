"""Sets on disk: what the finder gets is a valid test, runs resume, and who hides nothing shows nothing."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hidden_effects import finder
from hidden_effects import generate as making
from hidden_effects.designs import KINDS, draw
from hidden_effects.finder import diagnosed
from hidden_effects.follow_up import NoExperimentError, extended
from hidden_effects.plan import CAUSES, COUNTS, Group, Plan, plans
from hidden_effects.virtual_rig import POSTURES, RigResponse, autoregressive_noise, read

from vjm_updating.experiment import read_measurement


class OneDesign:
    """A store that knows the small design only."""

    designs = 3

    def __init__(self, known):
        self.known = known

    def another(self, seed, trial):
        return seed

    def signatures(self, seed):
        return self.known


@pytest.fixture(scope="module")
def made(known, tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    plan = Plan(5, Group.SINGLE, 0, ("joint_friction",), (12.0,))
    return plan, folder, making.make(plan, OneDesign(known), folder)


@pytest.mark.slow
def test_a_set_is_a_test_that_the_suite_reads(made):
    _, folder, truth = made
    measurement = read_measurement(folder / "data.csv", folder / "sheet.toml")
    assert len(measurement.readings) == truth["design"]["readings"]
    assert {n.name for n in measurement.nuisances} >= set(truth["nuisances"])
    assert "joint_friction" not in (folder / "sheet.toml").read_text() + (folder / "data.csv").read_text()


def test_a_cause_is_as_strong_as_wanted_and_in_its_class(made):
    _, _, truth = made
    assert truth["causes"] == ["joint_friction"]
    assert truth["hidden"][0]["strength"] == pytest.approx(12.0, rel=0.05)
    assert truth["strength"] == pytest.approx(12.0, rel=0.05)
    assert truth["apart"] > 2.0


def test_a_seed_makes_the_same_set(made, known, tmp_path):
    plan, folder, truth = made
    assert making.make(plan, OneDesign(known), tmp_path) == truth
    assert (tmp_path / "data.csv").read_text() == (folder / "data.csv").read_text()
    other = making.make(replace(plan, number=6), OneDesign(known), tmp_path / "other")
    assert other["nuisances"] != truth["nuisances"]


def test_readings_scatter_as_the_sheet_says(known, tmp_path):
    """Whitened residuals of quiet sets, nuisances included, have unit variance."""
    visibility, squares = known.visibility, []
    # not multiples of four, which finite elements would trace
    for number in range(21, 141, 4):
        folder = tmp_path / str(number)
        making.make(Plan(number, Group.QUIET, 0, (), ()), OneDesign(known), folder)
        table = [line.split(",") for line in (folder / "data.csv").read_text().splitlines()]
        at = {name: i for i, name in enumerate(table[0])}
        forces = np.array([[float(row[at[c]]) for c in visibility.design.channels] for row in table[1:]])
        ux = np.array([float(row[at["ux_mm"]]) for row in table[1:]])
        flat = (
            forces - visibility.nominal.forces - visibility.stiffness * (ux - visibility.nominal.ux)[:, None]
        ).ravel()
        squares.append(np.sum(visibility.whitened_flat(flat) ** 2))
    n = forces.size
    # 30 sums of n squares: their mean has a standard deviation of √(2 n / 30); 4 of them
    assert np.mean(squares) == pytest.approx(n, abs=4.0 * np.sqrt(2.0 * n / 30.0))


def test_outlying_missed_and_rounded_readings(design):
    rough = replace(design, outliers=0.1, missing=0.1, quantum=1.0)
    n = len(rough)
    still = RigResponse(np.zeros(n), np.zeros((n, 3)))
    rng = np.random.default_rng(0)
    many = [read(rough, still, rng) for _ in range(50)]
    forces = np.concatenate([seen.forces for seen, _ in many])
    assert np.isnan(forces).mean() == pytest.approx(0.1, abs=0.02)
    assert (np.abs(forces[~np.isnan(forces)]) > 20.0).mean() == pytest.approx(0.1, abs=0.02)
    rest = forces[~np.isnan(forces)] / 2.0
    assert rest == pytest.approx(np.round(rest), abs=1e-9)
    assert np.abs(np.concatenate([regular.forces for _, regular in many])).max() < 12.0


def test_noise_has_the_autocorrelation_that_was_drawn(design):
    noise = np.concatenate(
        [
            autoregressive_noise(replace(design, autocorrelation=0.8), 3, np.random.default_rng(k))[:10]
            for k in range(400)
        ]
    )
    own = noise.reshape(400, 10, 3)
    assert np.mean(own[:, 1:] * own[:, :-1]) == pytest.approx(0.8, abs=0.05)
    assert np.mean(own**2) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_designs_fit_the_contract(kind):
    for seed in range(12):
        design = draw(seed, kind)
        assert 20 <= len(design) <= 300
        assert "fx_N" in design.channels
        assert {s.posture for s in design.sequences} <= set(POSTURES)
        clock = np.concatenate([s.time for s in design.sequences])
        assert np.all(np.diff(clock) > 0.0)
        assert all(s.ux[0] == 0.0 for s in design.sequences)
        signs = {np.sign(s.ux[np.abs(s.ux) > 0]).min() for s in design.sequences}
        assert signs
        if kind == "ramp":
            assert all(np.all(np.diff(np.abs(s.ux)) >= 0.0) for s in design.sequences)


def test_a_campaign_has_every_cause_at_every_strength():
    todo = plans()
    assert len(todo) >= 1000
    assert Counter(p.group for p in todo) == Counter(COUNTS)
    for cause in CAUSES:
        own = [p for p in todo if p.group is Group.SINGLE and p.causes == (cause,)]
        assert {p.strengths[0] for p in own} == {1.0, 2.0, 4.0, 8.0, 16.0, 32.0}
    assert len({p.number for p in todo}) == len(todo)
    assert not {p.number for p in todo} & {p.number for p in plans(seed=1)}
    assert not {p.number for p in todo} & {p.number for p in plans(0.03, designs=6)}
    assert len({p.design for p in plans(0.03, designs=6)}) <= 6
    assert all(count >= 2 for count in Counter(p.group for p in plans(0.001)).values())


def test_a_diagnosis_is_not_done_twice_by_one_finder_and_a_refusal_is_kept(tmp_path, monkeypatch):
    (tmp_path / "data.csv").write_text("nothing")
    (tmp_path / "sheet.toml").write_text("")
    out = tmp_path / "found"
    first = diagnosed(tmp_path / "data.csv", tmp_path / "sheet.toml", out)
    assert "error" in first
    assert json.loads((out / "run.json").read_text()) == first
    assert diagnosed(tmp_path / "data.csv", tmp_path / "sheet.toml", out) == first
    monkeypatch.setattr(finder, "identity", lambda *_: "another")
    other = diagnosed(tmp_path / "data.csv", tmp_path / "sheet.toml", out)
    assert (other["finder"], other["error"]) == ("another", first["error"])


@pytest.mark.parametrize(
    ("path", "ends"),
    [("pull and push to 2.2 mm, out, held and back", {2.2, -2.2}), ("pull to 3 mm, out, held and back", {3.0}),
     ("push to -1.5 mm, out, held and back", {-1.5}), ("push to 1.5 mm, out, held and back", {-1.5})],
)  # fmt: skip
def test_a_proposed_experiment_is_added(design, path, ends):
    longer = extended(design, {"posture": "D", "path": path})
    new = longer.sequences[-1]
    assert new.posture == "D"
    assert {new.ux.max(), new.ux.min()} - {0.0} == ends
    assert new.time[0] > design.sequences[-1].time[-1]
    assert new.ux[-1] == pytest.approx(0.0)
    thrice = extended(design, {"posture": "D", "path": f"{path}, 3 times"}).sequences[-1]
    assert len(thrice.ux) - 1 == 3 * (len(new.ux) - 1)
    assert (np.diff(thrice.time) > 0.0).all()
    with pytest.raises(NoExperimentError, match="wiggle"):
        extended(design, {"posture": "D", "path": "wiggle"})
