"""Made-up tests of deflections: a UR10-like arm at rest where its energy is smallest, with and without a force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hidden_effects.poses.injector import Array, Hidden, Push, rest
from hidden_effects.poses.robots import UR10, document

from vjm.io.toml_text import toml_text

POINT, MARKER = np.array([30.0, -60.0, 90.0]), np.array([-50.0, 20.0, 110.0])
"""mm, behind the last link."""
NOISE = 0.01
"""mm."""


def drawn(seed: int, postures: int = 25, loads: int = 2) -> tuple[Array, Array]:
    """Postures ``(g, 6)`` rad, each of several times, and forces ``(g, 3)`` N."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform(-2.0, 2.0, (postures, 6)), loads, axis=0)
    return q, rng.uniform(-120.0, 120.0, (len(q), 3))


def moved(hidden: Hidden, q: Array, force: Array) -> tuple[Array, Array]:
    """Frames ``(g, 4, 4)`` of the last link, unloaded and loaded."""
    return rest(UR10, hidden, q), rest(UR10, hidden, q, Push(force, POINT))


def displacement(hidden: Hidden, q: Array, force: Array) -> Array:
    """By how much the marker moves ``(g, 3)`` mm."""
    before, after = (T @ np.array([*MARKER, 1.0]) for T in moved(hidden, q, force))
    return np.asarray(after - before)[:, :3]


def sheet_text(loads: str = "", marker: str = "", tracker: str = "", test: str = "") -> str:
    """The sheet, with more lines for its tables."""
    return (
        f'kind = "deflections"\n[test]\nmodel = "model.toml"\nrigid = true\n{test}\n'
        f"[loads.hook]\nposition_mm = {POINT.tolist()}\n{loads}\n"
        f"[markers.target]\nposition_mm = {MARKER.tolist()}\nsigma_mm = 1.0\n{marker}\n"
        f"[tracker]\nnoise_mm = {NOISE}\nsigma_rad = 1e-3\n{tracker}\n"
    )


def columns_of(q: Array, force: Array, d: Array) -> dict[str, Array]:
    """Columns of a data file."""
    columns = {f"joint-{i + 1}.q_rad": q[:, i] for i in range(6)}
    columns |= {f"hook.f{axis}_N": force[:, k] for k, axis in enumerate("xyz")}
    return columns | {f"target.d{axis}_mm": d[:, k] for k, axis in enumerate("xyz")}


def files(folder: Path, columns: dict[str, Array], sheet: str = "") -> tuple[Path, Path]:
    """The files of a test, the model beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(toml_text(document(UR10)), encoding="utf-8")
    (folder / "sheet.toml").write_text(sheet or sheet_text(), encoding="utf-8")
    cells = ([v if isinstance(v, str) else f"{v:.9g}" for v in row] for row in zip(*columns.values(), strict=True))
    rows = (",".join(row) for row in cells)
    (folder / "readings.csv").write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    return folder / "readings.csv", folder / "sheet.toml"


def compliant() -> Hidden:
    """Joints that are elastic about their own axes."""
    hidden = Hidden.nothing(6)
    hidden.own = np.array([1.0, 1.2, 1.5, 3.0, 4.0, 5.0]) * 1e-8
    return hidden
