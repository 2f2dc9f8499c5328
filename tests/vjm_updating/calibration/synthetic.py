"""Made-up tests of a machine: finite elements or the model itself say what it does, dice what is read."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from helpers.file_texts import instruments_text, table_text

from vjm.continuation.path import Path as LoadPath
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Section
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating.calibration.parameters import unknowns

COLUMNS = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
SIGMA = {name: (2.0, 3.0, 0.003) if name.startswith("f") else (300.0, 300.0, 0.003) for name in COLUMNS}
"""Noise, zero and scale of the channels: a force cell's and a moment cell's."""
SIGMA_UX = (0.001, 0.002, 0.001)
POSTURES = """A = [0.0, 0.0, 0.0, 0.0]
B = [0.0, 0.5235987755982988, -0.5235987755982988, 0.0]
C = [0.5235987755982988, 0.0, 0.0, -0.5235987755982988]
"""
TOLERANCE = "link_length_mm = 0.2\nmodulus_rel = 0.02"


def sheet_text(
    *,
    foot: int = 8,
    link: int = 8,
    model: str = "",
    columns: Sequence[str] = COLUMNS,
    postures: str = POSTURES,
    tolerance: str = TOLERANCE,
) -> str:
    """A test sheet."""
    return (
        table_text("test", title="made up", model="orthoglide-chain")
        + table_text("model", link_segments=link, foot_segments=foot)
        + f"{model}\n[postures]\n{postures}[tolerance]\n{tolerance}\n"
        + instruments_text(ux_mm=SIGMA_UX, **{name: SIGMA[name] for name in columns})
    )


TRUTH = {"link.EA": 0.95, "link.GJ": 1.06, "link.EIy": 1.05, "link.EIz": 0.94, "foot.factor": 1.08}
"""Stiffnesses over nominal; the foot's compliance."""


@cache
def true_machine() -> Machine:
    """The library's chain with the stiffnesses of `TRUTH`, by hand: not by the code under test."""
    parts = []
    chain = load_chain("orthoglide-chain")
    for part in chain.parts:
        if part.name == "link":
            part = replace(part, section=_times(part.section, {k[5:]: v for k, v in TRUTH.items() if "link" in k}))
        if part.name == "foot":
            soft = dict.fromkeys(("EA", "GJ", "EIy", "EIz"), 1.0 / TRUTH["foot.factor"])
            part = replace(
                part, section=_times(part.section, soft), compliance=part.compliance * TRUTH["foot.factor"]
            )
        parts.append(part)
    return replace(chain, parts=tuple(parts))


def _times(section: Section, factors: dict[str, float]) -> Section:
    return replace(section, **{name: getattr(section, name) * factor for name, factor in factors.items()})


@cache
def finite_elements(posture: str, to: float, steps: int | None) -> LoadPath:
    """The true machine's path, foot and bar as Exudyn's beams."""
    path = ExudynEngine(elements=16).trace(true_machine(), LoadCase(posture, to, steps=steps))
    assert path.complete
    return path


Trace = Callable[[str, float, int], tuple[np.ndarray, np.ndarray]]
"""Displacements ``(k,)``, magnitudes from zero on, and wrenches ``(k, 6)`` of a ramp in equal steps."""


def of_finite_elements(posture: str, to: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """What the true machine needs, by Exudyn."""
    return _on_grid(finite_elements(posture, to, steps), steps)


def _on_grid(path: LoadPath, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """The points at equal steps, without those that a path has behind a bifurcation and where it turns sharply."""
    wanted = np.linspace(0.0, path.load_case.length, steps + 1)
    at = [int(np.argmin(np.abs(path.s - s))) for s in wanted]
    np.testing.assert_allclose(path.s[at], wanted, atol=1e-9)
    return path.s[at], path.wrench[at]


def of_model(chain: Machine, engine: VjmEngine) -> Trace:
    """What a lumped chain needs."""

    @cache
    def trace(posture: str, to: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
        found = engine.trace(chain, LoadCase(posture, to, steps=steps))
        assert found.complete
        return _on_grid(found, steps)

    return trace


def changed(z: Mapping[str, float], engine: VjmEngine) -> Machine:
    """The library's chain with parameters moved by z, see `vjm_updating.calibration.parameters`."""
    chain = load_chain("orthoglide-chain")
    # the entries of a 6×6's factor come together
    names = dict.fromkeys(re.sub(r"\.R\d\d$", ".matrix", name) for name in z)
    found = unknowns(chain, engine, list(names), ())
    assert [one.name for one in found.all] == list(z)
    return found.build(np.array(list(z.values())))


def lengthened(chain: Machine, part: str, by: float) -> Machine:
    """The chain with a longer part, mm."""
    parts = (replace(p, length=p.length + by) if p.name == part else p for p in chain.parts)
    return replace(chain, parts=tuple(parts))


Row = dict[str, str | float]


def readings(
    trace: Trace,
    ramps: Mapping[str, Sequence[float]],
    steps: int,
    rng: np.random.Generator,
    *,
    errors: float = 1.0,
    rho: float = 0.0,
    outliers: float = 0.0,
    columns: Sequence[str] = COLUMNS,
    drawn: Sequence[float] | None = None,
) -> list[Row]:
    """Rows as read: true, times one plus scale, plus zero, plus noise of autocorrelation ``rho``, some outliers.

    The draws do not depend on the machine. Displacements are read with errors too. ``drawn`` are standard normal
    numbers for the zeros and the scales of the columns, then of the displacement, in place of the dice.
    """
    dice = iter(rng.standard_normal(2 * len(columns) + 2) if drawn is None else drawn)
    zero = {n: errors * SIGMA[n][1] * next(dice) for n in columns}
    scale = {n: errors * SIGMA[n][2] * next(dice) for n in columns}
    zero_u, scale_u = (errors * sigma * next(dice) for sigma in SIGMA_UX[1:])
    rows: list[Row] = []
    for posture, ends in ramps.items():
        errors_before = {n: rng.standard_normal() for n in columns}
        for to in ends:
            for s, wrench in zip(*trace(posture, to, steps), strict=True):
                u = np.sign(to) * s * (1.0 + scale_u) + zero_u + errors * SIGMA_UX[0] * rng.standard_normal()
                row: Row = {"posture": posture, "ux_mm": float(u)}
                for name in columns:
                    errors_before[name] = rho * errors_before[name] + np.sqrt(1.0 - rho**2) * rng.standard_normal()
                    value = wrench[COLUMNS.index(name)] * (1.0 + scale[name]) + zero[name]
                    kick = 60.0 * rng.standard_normal() if rng.random() < outliers else 0.0
                    row[name] = float(value + errors * SIGMA[name][0] * (errors_before[name] + kick))
                rows.append(row)
    return rows


@dataclass(frozen=True)
class Files:
    """The two files of a test."""

    data: Path
    sheet: Path


def write(folder: Path, rows: Sequence[Row], sheet: str) -> Files:
    """Write the two files of a test."""
    folder.mkdir(parents=True, exist_ok=True)
    files = Files(folder / "data.csv", folder / "sheet.toml")
    names = list(rows[0])
    lines = [",".join(names)]
    for row in rows:
        cells = (row[name] for name in names)
        lines.append(",".join(cell if isinstance(cell, str) else f"{cell:.6f}" for cell in cells))
    files.data.write_text("\n".join(lines) + "\n")
    files.sheet.write_text(sheet)
    return files
