"""Readings of a machine with a hidden effect: what is in them, what their strength is, what is refused."""

import csv
import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text

import vjm
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_updating import simulate as beams
from vjm_updating.experiment import read_measurement
from vjm_updating.simulate import DATA, SHEET, TRUTH, simulate, words

MODEL = "orthoglide-chain"
BARE = (
    table_text("test", model="someone else's")
    + table_text("model", link_segments=4)
    + table_text("postures", A=[])
    + instruments_text(ux_mm=(0.0,), fx_N=(5.0,))
)
"""No tolerances, and no noise of the gauge."""


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(BARE)
    return path


def column(folder, name):
    with (folder / DATA).open() as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def test_readings_without_noise_are_the_path_of_the_machine(sheet, tmp_path):
    """With a compliant drive hidden, the forces are those of the chain that has it by its model."""
    softness = 2e-5
    simulate(MODEL, sheet, tmp_path, hide=[f"actuator_compliance={softness}"], noise="none", ramps=["A:2"])
    soft = load_chain(MODEL).with_actuator_compliance(softness)
    path = VjmEngine.of(4, 1).trace(soft, LoadCase("A", 2.0, steps=400))
    u, force = column(tmp_path, "ux_mm"), column(tmp_path, "fx_N")
    expected = np.interp(u, path.s, path.force)
    stiff = VjmEngine.of(4, 1).trace(load_chain(MODEL), LoadCase("A", 2.0, steps=400))
    assert np.abs(np.interp(u, stiff.s, stiff.force) - expected).max() > 100.0
    # tables of 1e-3 of the force against a path of 400 steps
    np.testing.assert_allclose(force, expected, atol=1e-3 * expected.max())


LAW = """
from vjm_updating.mechanisms.effect import Effect, Quantity
from vjm_updating.mechanisms.effect import drive
from vjm_updating.mechanisms.series_elements import SeriesElement, memoryless

class Soft(Effect):
    cause = "soft"
    title = "a soft drive"
    def quantities(self):
        return (Quantity("compliance_mm_per_N", 0.0, 1.0, 1e-5, neutral=0.0),)
    def trials(self):
        return [(1e-5,)]
    def elements(self, machine, values):
        return (SeriesElement(drive(machine), memoryless(lambda N: (values[0] * N, values[0] + 0.0 * N))),)

def effects(scene):
    return [Soft()]
"""


def test_an_effect_of_one_s_own_is_hidden_like_the_catalogue_s(sheet, tmp_path):
    """A law that is the catalogue's soft drive under another name gives the same readings."""
    law = tmp_path / "law.py"
    law.write_text(LAW)
    simulate(MODEL, sheet, tmp_path, hide=["actuator_compliance=2e-5"], noise="none", ramps=["A:2"])
    known = column(tmp_path, "fx_N")
    simulate(MODEL, sheet, tmp_path, hide=["soft=2e-5"], noise="none", ramps=["A:2"], plug_ins=[law])
    # files have six decimals
    np.testing.assert_allclose(column(tmp_path, "fx_N"), known, atol=2e-6)


@pytest.fixture
def coarse(monkeypatch):
    """Fewer points of a path of beams: cubics err by 1e-6 of the force between these."""
    pytest.importorskip("exudyn", reason="Exudyn, which makes the readings, is not installed")
    monkeypatch.setattr(beams, "STEPS", 8)


def test_readings_of_beams_are_the_path_of_a_bowed_and_soft_machine(sheet, tmp_path, coarse):
    """Chords of finite elements against the lumped machine that has bow and drive by its model file's keys."""
    hide = ["link_bow=1.0", "actuator_compliance=2e-5"]
    truth = simulate(MODEL, sheet, tmp_path, hide=hide, noise="none", ramps=["A:-2"], engine="exudyn")
    assert truth.engine == "exudyn"
    chain = load_chain(MODEL).with_actuator_compliance(2e-5)
    parts = tuple(replace(p, bow=(1.0, 0.0)) if p.name == "link" else p for p in chain.parts)
    engine, straight = VjmEngine.of(16, 16), LoadCase("A", -2.0, steps=100)
    path = engine.trace(replace(chain, parts=parts), straight)
    u, force = column(tmp_path, "ux_mm"), column(tmp_path, "fx_N")
    expected = np.interp(-u, path.s, -path.force)
    plain = engine.trace(chain, straight)
    change = np.abs(np.interp(-u, plain.s, -plain.force) - expected).max()
    assert change > 100.0
    # 16 chords: the second order of their length, 0.3 % of what the bow does
    np.testing.assert_allclose(force, expected, atol=0.01 * change)


def test_beams_turn_lengthen_weigh_and_misread(sheet, tmp_path, coarse):
    """Against the machine of the sheet with as many springs, whose way to its readings is another one."""
    sheet.write_text(BARE.replace("link_segments = 4", "link_segments = 16\nfoot_segments = 16"))
    hide = [
        *("load_misalignment=0.05", "link_length=0.5", "gravity=30", "base_compliance=1e-5"),
        # a base in series turns under the end-effector's wrench only, one that is built in under the weight too
        "base_compliance.turning_over_cxx=0.001",
        *("foot_compliance=1.1", "instrument_zero.fx_N=20", "instrument_scale.fx_N=0.01"),
    ]
    for engine in ("", "exudyn"):
        simulate(MODEL, sheet, tmp_path / engine, hide=hide, noise="none", ramps=["A:1"], engine=engine)
    ours, beams_ = column(tmp_path, "fx_N"), column(tmp_path / "exudyn", "fx_N")
    np.testing.assert_allclose(beams_, ours, atol=2e-5 * np.abs(ours).max())


def test_beams_stand_on_a_base_that_turns(sheet, tmp_path, coarse):
    sheet.write_text(BARE.replace("link_segments = 4", "link_segments = 16\nfoot_segments = 16"))
    hide = ["base_compliance=1e-5", "base_compliance.turning_over_cxx=5"]
    for engine in ("", "exudyn"):
        simulate(MODEL, sheet, tmp_path / engine, hide=hide, noise="none", ramps=["A:1"], engine=engine)
    simulate(MODEL, sheet, tmp_path / "rigid", hide=[], noise="none", ramps=["A:1"])
    ours, beams_, rigid = (column(tmp_path / name, "fx_N") for name in ("", "exudyn", "rigid"))
    change = np.abs(ours - rigid).max()
    assert change > 50.0
    # the base in series turns to first order: the chain's own force turns with it, by 2e-4 rad at 3000 N
    np.testing.assert_allclose(beams_, ours, atol=2e-3 * change)


def test_what_beams_cannot_carry_is_refused_with_what_they_can(sheet, tmp_path):
    with pytest.raises(ValueError, match=r"--hide joint_friction: .* they carry actuator_compliance, ") as refusal:
        simulate(MODEL, sheet, tmp_path / "out", hide=["joint_friction"], ramps=["A:1"], engine="exudyn")
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_strength_of_a_zero_error_is_that_of_a_mean(sheet, tmp_path):
    """An error e beside a tolerance s and n readings of noise sigma: e/sqrt(s² + sigma²/n)."""
    sheet.write_text(BARE + "zero = 3.0\n")
    truth = simulate(MODEL, sheet, tmp_path, hide=["instrument_zero.fx_N=20"], noise="none", ramps=["A:1"])
    assert truth.largest == pytest.approx(20.0, rel=1e-6)
    # the fit's bounds, 60 sigmas off, weigh 12/120² beside the prior: 4e-4 of the strength
    assert truth.strength == pytest.approx(20.0 / np.hypot(3.0, 5.0 / np.sqrt(truth.readings)), rel=1e-3)


def test_a_seed_gives_the_same_files_and_noise_of_the_sheet_s_size(sheet, tmp_path):
    for name in ("one", "two"):
        simulate(MODEL, sheet, tmp_path / name, hide=["actuator_compliance=1e-5"], seed=7, ramps=["A:2", "A:-2"])
    simulate(
        MODEL, sheet, tmp_path / "still", hide=["actuator_compliance=1e-5"], noise="none", ramps=["A:2", "A:-2"]
    )
    for file in (DATA, SHEET, TRUTH):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    noise = column(tmp_path / "one", "fx_N") - column(tmp_path / "still", "fx_N")
    # 60 readings: the spread is known to 9 %
    assert np.std(noise) == pytest.approx(5.0, rel=0.35)


def test_the_files_are_a_test_that_can_be_read(sheet, tmp_path):
    truth = simulate(MODEL, sheet, tmp_path, hide=["link_bow.along_z_mm=0.5"], ramps=["A:2"])
    measurement = read_measurement(tmp_path / DATA, tmp_path / SHEET)
    assert (measurement.chain.name, len(measurement.readings)) == (MODEL, truth.readings)
    written = json.loads((tmp_path / TRUTH).read_text())
    assert written["hidden"] == {"link_bow.along_y_mm": 0.0, "link_bow.along_z_mm": 0.5}
    assert any(f"strength {truth.strength:.2f}" in line for line in words(truth))


def test_every_posture_is_pulled_and_pushed_short_of_its_critical_point(sheet, tmp_path):
    truth = simulate(MODEL, sheet, tmp_path, hide=[], noise="none")
    critical = VjmEngine.of(4, 1).trace(load_chain(MODEL), LoadCase("A", -4.0)).critical.s
    pull, push = (float(ramp.rpartition(" ")[2]) for ramp in truth.ramps)
    assert pull > 0.0
    assert 0.7 * critical < -push < 0.9 * critical
    assert truth.strength == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("hide", "said"),
    [("link_bov=1", "no such effect in this test; did you mean 'link_bow'"),
     ("link_bow=much", "'much' is no number"),
     ("link_bow=500", "along_y_mm must be from"),
     ("link_bow.along_x_mm=1", "has no parameter 'along_x_mm'"),
     ("instrument_zero=1", "say where it sits: instrument_zero.fx_N, instrument_zero.ux_mm")],
)  # fmt: skip
def test_an_effect_that_there_is_not_is_refused(sheet, tmp_path, hide, said):
    with pytest.raises(ValueError, match=r"--hide") as refusal:
        simulate(MODEL, sheet, tmp_path / "out", hide=[hide], ramps=["A:1"])
    assert said in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_a_ramp_or_an_instrument_that_makes_no_sense_is_refused(sheet, tmp_path):
    with pytest.raises(ValueError, match=r"--ramp: 'A' is no ramp"):
        simulate(MODEL, sheet, tmp_path, hide=[], ramps=["A"])
    with pytest.raises(ValueError, match=r"no posture 'Q'"):
        simulate(MODEL, sheet, tmp_path, hide=[], ramps=["Q:1"])
    with pytest.raises(ValueError, match=r"channel uy_mm was measured: add \[instrument.uy_mm\]"):
        simulate(MODEL, sheet, tmp_path, hide=[], ramps=["A:y:1"])
    sheet.write_text(BARE.replace("[instrument.fx_N]", "[instrument.fx_N]\nheld = 'target'"))
    with pytest.raises(ValueError, match="only instruments at the end-effector can be simulated"):
        simulate(MODEL, sheet, tmp_path, hide=[], ramps=["A:1"])


def test_a_machine_with_a_spring_between_points_has_the_readings_of_its_path(tmp_path):
    """The force at the end of the ramp is that of a path of the same machine."""
    text = (files("vjm") / "models/planar-2r.toml").read_text()
    model = tmp_path / "sprung.toml"
    part = load_chain("planar-2r").parts[-1].name
    model.write_text(
        text
        + f'''
[[point_springs]]
name = "balance"
between = ["", "{part}"]
points_mm = [[0.0, 0.0, 300.0], [0.0, 0.0, 0.0]]
stiffness_N_per_mm = 2.0
free_length_mm = 100.0
'''
    )
    sheet = tmp_path / "own.toml"
    sheet.write_text(BARE.replace("A = []", "").replace("link_segments = 4", ""))
    simulate(str(model), sheet, tmp_path / "out", hide=[], noise="none", ramps=["bent:0.5"])
    rows = list(csv.DictReader((tmp_path / "out" / "readings.csv").read_text().splitlines()))
    furthest = max(rows, key=lambda row: float(row["ux_mm"]))
    assert float(furthest["ux_mm"]) == 0.5
    path = vjm.trace(vjm.load(model), vjm.LoadCase("bent", to=0.5), engine="vjm")
    # the readings are written to six decimals
    assert float(furthest["fx_N"]) == pytest.approx(path.points[-1].wrench[0], abs=1e-6)


def test_gauges_of_a_platform_are_zeroed_where_it_stands_as_built(monkeypatch):
    """A strut 0.05 mm longer moves a platform of three freedoms, and strains none of its parts."""
    pytest.importorskip("exudyn", reason="the beams are Exudyn's, which is not installed")
    monkeypatch.setattr(beams, "ELEMENTS", 2)
    monkeypatch.setattr(beams, "STEPS", 2)
    machine, place = vjm.load("3-puu"), np.zeros((2, 6))
    place[1, 0] = 0.05
    asked = beams.BeamMachine(machine, np.array(["home"] * 2), np.zeros(2), place, ())
    drawn, built = asked.wrench({}), asked.wrench({("length", "a/strut"): 0.05})
    assert drawn[1, 0] > 500.0
    # held where it was drawn it would take about as much as the 0.05 mm along x
    assert np.abs(built[0, :3]).max() < 1e-3
    # 0.05 mm of 500 mm change the stiffness by some ten thousandths
    assert built[1, 0] == pytest.approx(drawn[1, 0], rel=1e-3)
