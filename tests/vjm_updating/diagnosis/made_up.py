"""Made-up tests of the library's machine: its own model says what it does, a generator of errors what is read.

They show that a search finds what its own laws put into the data; other laws are tried elsewhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from helpers.file_texts import instruments_text, table_text

from vjm_updating.diagnosis.ramp_kind import ramp_effects
from vjm_updating.experiment import measurement as reading
from vjm_updating.inference.forward import Forward, observe_ramps
from vjm_updating.inference.parameters import coordinates, nuisance_coordinates, start

SHEET = (
    table_text("test", title="made up", model="orthoglide-chain")
    + table_text("model", link_segments=4)
    + instruments_text(
        ux_mm=(0.001, 0.002, 0.001),
        fx_N=(2.0, 3.0, 0.003),
        mz_Nmm=(300.0, 300.0, 0.003),
        my_Nmm=(300.0, 300.0, 0.003),
    )
    + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
)
NOISE = {"fx_N": (0, 2.0), "my_Nmm": (4, 300.0), "mz_Nmm": (5, 300.0)}


@dataclass(frozen=True)
class Files:
    data: Path
    sheet: Path


def load_case(postures: Sequence[str], reach: float, per: int) -> list[tuple[float, str, int, float]]:
    """Time, posture, run, displacement: two bipolar cycles in each posture."""
    rows, time = [], 0.0
    for posture in postures:
        for run in (1, 2):
            for end in (reach, -reach):
                way = np.linspace(0.0, end, per + 1)
                for u in (*way[1:], end, end, *way[::-1][1:]):
                    time += 2.0
                    rows.append((time, posture, run, float(u)))
    return rows


def write(folder: Path, rows, wrench, displacement, sheet=SHEET) -> Files:
    folder.mkdir(parents=True, exist_ok=True)
    names = ["time_s", "posture", "run", "ux_mm", *NOISE]
    lines = [",".join(names)]
    for (t, posture, run, _), u, w in zip(rows, displacement, wrench, strict=True):
        read = ",".join(f"{w[k]:.4f}" for k, _ in NOISE.values())
        lines.append(f"{t:.3f},{posture},{run},{u:.6f},{read}")
    (folder / "data.csv").write_text("\n".join(lines) + "\n")
    (folder / "sheet.toml").write_text(sheet)
    return Files(folder / "data.csv", folder / "sheet.toml")


def made_up(
    folder: Path,
    hidden: dict[str, tuple[float, ...]],
    seed: int,
    monkeypatch,
    *,
    per: int = 10,
    postures: Sequence[str] = ("A", "B"),
    reach: float = 1.5,
) -> Files:
    """A test with causes hidden in it, by label with values of the first parameters; the others are as usual."""
    rng = np.random.default_rng(seed)
    rows = load_case(postures, reach, per)
    true = np.array([row[3] for row in rows])
    # the wrench is not known yet: ones, of which no unit can be told; then the nominal one, for its size
    monkeypatch.setattr(reading, "check_units", lambda *args: None)
    wrench = np.ones((len(rows), 6))
    for _ in range(2):
        blank = write(folder, rows, wrench, true)
        observed = observe_ramps(reading.read_measurement(blank.data, blank.sheet))
        nuisances = nuisance_coordinates(observed)
        at = Forward(observed).evaluate(nuisances, np.zeros(len(nuisances)), ())
        wrench = np.nan_to_num(observed.measured - at.residual)
    monkeypatch.undo()
    known = {effect.label: effect for effect in ramp_effects(observed)}
    hypothesis = tuple(known[label] for label in hidden)
    found = coordinates(nuisances, hypothesis)
    values = [
        [*own, *(q.usual for q in effect.quantities()[len(own) :])]
        for effect, own in zip(hypothesis, hidden.values(), strict=True)
    ]
    z = start(found, hypothesis, rng.standard_normal(len(nuisances)), values)
    at = Forward(observed).evaluate(found, z, hypothesis)
    wrench = np.nan_to_num(observed.measured - at.residual)
    for k, sigma in NOISE.values():
        error = rng.standard_normal(len(rows))
        for i in range(1, len(rows)):
            error[i] = 0.5 * error[i - 1] + 0.75**0.5 * error[i]
        wrench[:, k] += sigma * error
    flagged = rng.choice(len(rows), 2, replace=False)
    wrench[flagged, 0] += 80.0
    return write(folder, rows, wrench, true + 0.001 * rng.standard_normal(len(rows)))
