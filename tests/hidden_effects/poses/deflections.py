"""Made-up tests of deflections: two arms at rest where their energy is smallest, with and without a force.

Nothing of the finder's kinematics, statics or families is used to make the readings.
"""

from pathlib import Path

import numpy as np

from hidden_effects.poses.injector import Array, Hidden, Push, rest
from hidden_effects.poses.robots import SEVEN, UR10, Robot, document
from vjm.io.files import toml_text

POINT, MARKER = np.array([30.0, -60.0, 90.0]), np.array([-50.0, 20.0, 110.0])
"""mm, behind the last link: where the force acts, and what is seen."""
NOISE, NOISE_BY_LOAD = 0.01, 1e-4
"""mm, and mm/N."""
HIDDEN = {
    "own": {"actuator_compliance"},
    "across": {"actuator_compliance", "lateral_compliance"},
    "base": {"actuator_compliance", "base_compliance"},
    "crack": {"actuator_compliance", "tension_compression_asymmetry"},
    "both": {"actuator_compliance", "lateral_compliance", "base_compliance"},
}
"""What is hidden, and the families that are right."""


def moved(robot: Robot, hidden: Hidden, q: Array, force: Array) -> tuple[Array, Array]:
    """Frames ``(g, 4, 4)`` of the last link, unloaded and loaded."""
    return rest(robot, hidden, q), rest(robot, hidden, q, Push(force, POINT))


def displacement(robot: Robot, hidden: Hidden, q: Array, force: Array) -> Array:
    """By how much the marker moves ``(g, 3)`` mm."""
    before, after = (T @ np.array([*MARKER, 1.0]) for T in moved(robot, hidden, q, force))
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
    columns = {f"joint-{i + 1}.q_rad": q[:, i] for i in range(q.shape[1])}
    columns |= {f"hook.f{axis}_N": force[:, k] for k, axis in enumerate("xyz")}
    return columns | {f"target.d{axis}_mm": d[:, k] for k, axis in enumerate("xyz")}


def files(folder: Path, columns: dict[str, Array], sheet: str = "", robot: Robot = UR10) -> tuple[Path, Path]:
    """The files of a test, the model beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(toml_text(document(robot)), encoding="utf-8")
    (folder / "sheet.toml").write_text(sheet or sheet_text(), encoding="utf-8")
    cells = ([v if isinstance(v, str) else f"{v:.9g}" for v in row] for row in zip(*columns.values(), strict=True))
    rows = (",".join(row) for row in cells)
    (folder / "readings.csv").write_text("\n".join([",".join(columns), *rows]) + "\n", encoding="utf-8")
    return folder / "readings.csv", folder / "sheet.toml"


def write(number: int, folder: Path) -> tuple[str, tuple[Path, Path]]:
    """Make a set: what is hidden in it, and its files."""
    rng = np.random.default_rng(number)
    robot = (UR10, SEVEN)[number % 2]
    n, unit = len(robot.rows), 2e-3 / robot.torque
    kind = tuple(HIDDEN)[(number // 2) % len(HIDDEN)]
    postures, loads = int(rng.integers(15, 50)), int(rng.integers(1, 4))
    q = np.repeat(rng.uniform(-robot.reach, robot.reach, (postures, n)), loads, axis=0)
    force = rng.uniform(-150.0, 150.0, (len(q), 3))
    hidden = Hidden.nothing(n)
    hidden.own = rng.uniform(0.5, 1.5, n) * unit * np.linspace(1.0, 3.0, n)
    if kind in ("across", "both"):
        hidden.across = rng.uniform(0.3, 1.0, (n, 2)) * unit
    if kind in ("base", "both"):
        hidden.base = rng.uniform(0.5, 1.0, 3) * unit
    if kind == "crack":
        hidden.crack = (1, 1.5 * unit)
    sigma = np.hypot(NOISE, NOISE_BY_LOAD * np.linalg.norm(force, axis=1))[:, None]
    d = displacement(robot, hidden, q, force)
    d = d + rng.normal(0.0, 1.0, d.shape) * sigma
    sheet = sheet_text(tracker=f"noise_mm_per_N = {NOISE_BY_LOAD}")
    return kind, files(folder, columns_of(q, force, d), sheet, robot)
