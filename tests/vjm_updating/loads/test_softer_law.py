"""A joint whose spring has a law is softer than the law says: by loads, readings from arms that turn by hand."""

import numpy as np
import pytest
from helpers.file_texts import instruments_text, model_text, part_text, table_text
from helpers.from_files import EXTENDED, diagnose
from scipy.optimize import brentq

from vjm.io.model_file import load_chain

UPPER, FORE = 400.0, 350.0
NOISE = 0.002
TURNS = np.linspace(-0.005, 0.005, 41)


def askew(turn):
    """N mm of a spring that is softer one way than the other."""
    return 4e7 * turn * (1.0 + 0.3 * np.tanh(turn / 0.002))


LAWS = {
    "strain wave": {
        "kind": "strain_wave", "K1_Nmm_per_rad": 3e7, "K2_Nmm_per_rad": 5e7, "K3_Nmm_per_rad": 6e7,
        "T1_Nmm": 15_000.0, "T2_Nmm": 50_000.0,
    },
    "table": {
        "kind": "table", "deflections_rad": TURNS.tolist(), "forces_Nmm": askew(TURNS).tolist()
    },
}  # fmt: skip


def turned(kind, torque):
    """rad by which a shoulder turns, from its catalogue's numbers."""
    if kind == "strain wave":
        rest = np.abs(torque)
        first, second = np.clip(rest, 0.0, 15e3), np.clip(rest - 15e3, 0.0, 35e3)
        return np.sign(torque) * (first / 3e7 + second / 5e7 + np.maximum(rest - 50e3, 0.0) / 6e7)
    return brentq(lambda turn: askew(turn) - torque, TURNS[0], TURNS[-1])


def arm(kind, links):
    parts = [
        part_text("actuated", "shoulder", axis="y", law=LAWS[kind]),
        part_text("link", "upper", translation_mm=[UPPER, 0.0, 0.0]),
    ]
    if links == 2:
        parts += [
            part_text("actuated", "elbow", axis="y", compliance_rad_per_Nmm=4e-8),
            part_text("link", "fore", translation_mm=[FORE, 0.0, 0.0]),
        ]
    angles = {"shoulder": -0.6, "elbow": 1.0} if links == 2 else {"shoulder": -0.6}
    return model_text("arm", *parts, postures={"P": angles})


def readings(kind, links, factor, seed):
    """Rows of loads up and down and of what gauges read, to first order in the turns, which are below 0.01."""
    rng = np.random.default_rng(seed)
    elbow = UPPER * np.array([np.cos(0.6), np.sin(0.6)])
    tip = elbow + (FORE * np.array([np.cos(0.4), -np.sin(0.4)]) if links == 2 else 0.0)
    rows = []
    for load in [*np.linspace(0.0, 180.0, 16)[1:], *np.linspace(0.0, -180.0, 16)[1:]]:
        # about y a force along z turns the arm by the arm that it has along x
        shoulder = factor * turned(kind, -load * tip[0])
        shift = shoulder * np.array([tip[1], -tip[0]])
        if links == 2:
            own = -load * (tip - elbow)[0] * 4e-8
            shift = shift + own * np.array([(tip - elbow)[1], -(tip - elbow)[0]])
        ux, uz = shift + NOISE * rng.standard_normal(2)
        rows.append(f"P,{load + 0.05 * rng.standard_normal():.4f},{ux:.5f},{uz:.5f}")
    return "\n".join(["posture,fz_N,ux_mm,uz_mm", *rows]) + "\n"


SHEET = table_text("test", model="arm.toml", control="force") + instruments_text(
    fz_N=(0.05, 0.1, 0.001), ux_mm=(NOISE, 0.003, 0.001), uz_mm=(NOISE, 0.003, 0.001)
)


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize(("links", "factor"), [(1, 1.3), (2, 1.3), pytest.param(2, 0.75, marks=pytest.mark.slow)])
def test_it_is_told_as_softer_as_a_whole_and_written(tmp_path, kind, links, factor):
    (tmp_path / "arm.toml").write_text(arm(kind, links))
    (tmp_path / "sheet.toml").write_text(SHEET)
    (tmp_path / "data.csv").write_text(readings(kind, links, factor, 3))
    found = diagnose(tmp_path / "data.csv", tmp_path / "sheet.toml", tmp_path / "out")
    assert found.verdict == "named", found.findings.words
    assert found.causes == ["actuator_compliance"]
    row = found.parameters["actuator_compliance.factor"]
    assert row.low < factor < row.high
    # the law is written as softer as a whole; kinks of lines are rounded in models, and tables kept
    # to 1e-5 of their range
    shoulder = next(joint for joint in load_chain(tmp_path / "out" / EXTENDED).moving if joint.name == "shoulder")
    for torque in (-60e3, -30e3, -5e3, 5e3, 30e3, 60e3):
        assert shoulder.law.deflection(torque) == pytest.approx(row.value * turned(kind, torque), rel=1e-3)
