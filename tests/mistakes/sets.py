"""Sound tests of every kind, of several machines, with fresh noise and hidden causes, by injectors of their own."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from helpers import joint_rig, tapped_arm
from helpers.file_texts import instruments_text, table_text
from hidden_effects.poses import deflections
from hidden_effects.poses.injector import Array, measure
from hidden_effects.poses.plan import NOISE, hidden_of, plans, save
from hidden_effects.poses.robots import UR10, document, sheet_text

from mistakes.rigs import made
from vjm.io.files import toml_text

Files = tuple[Path, Path]
"""Readings and sheet."""
RAMPS = ("chain", "arm", "planar-2r", "ur10")
CUBE = 300.0
"""mm: edge of the cube in which the tool of a robot stays."""


def _ramps(folder: Path, seed: int) -> Files:
    test = made(RAMPS[seed % len(RAMPS)], folder, seed)
    return test / "DATA.csv", test / "SHEET.toml"


def _column(folder: Path, seed: int) -> Files:
    test = made("column", folder, seed)
    return test / "DATA.csv", test / "SHEET.toml"


def _loads(folder: Path, seed: int) -> Files:
    """A tube in a clamp under weights, by closed forms; its clamp and its tube are not as drawn."""
    rng = np.random.default_rng(seed)
    bend = deflections_of_tube(rng)
    force = 1000.0 * np.concatenate([(up := np.linspace(0.0, 1.0, 11)), up[-2::-1], -up[1:], -up[-2::-1]])
    lines = ["posture,fz_N,uz_mm,mid.uz_mm"]
    for f in force.tolist():
        read = [f + 0.02 * rng.standard_normal(), *(f * bend + 0.003 * rng.standard_normal(2))]
        lines.append("bench," + ",".join(f"{v:.4f}" for v in read))
    (folder / "tube.toml").write_text(TUBE)
    (folder / "sheet.toml").write_text(TUBE_SHEET)
    (folder / "readings.csv").write_text("\n".join(lines) + "\n")
    return folder / "readings.csv", folder / "sheet.toml"


TUBE = joint_rig.MODEL.replace('kind = "actuated"', 'kind = "mount"').replace('name = "elbow"', 'name = "clamp"')
TUBE = TUBE.replace("1e-7", "1e-9").replace("{ elbow = 0.0 }", "[]")
TUBE_SHEET = (
    table_text("test", title="tube", model="tube.toml", control="force")
    + table_text("postures", bench=[])
    + table_text("points.mid", body="arm", at=0.5)
    + instruments_text(fz_N=(0.02, 0.05, 0.001), uz_mm=(0.003, 0.01, 0.002), **{"mid.uz_mm": (0.003, 0.01, 0.002)})
    + table_text("tolerance", link_length_mm=0.5, modulus_rel=0.02)
)


def deflections_of_tube(rng: np.random.Generator) -> Array:
    """mm/N of the tip and of the middle of a cantilever in an elastic clamp, for which textbooks have the forms."""
    inertia, length = np.pi / 64.0 * (60.0**4 - 52.0**4), 300.0
    clamp, bend = 1e-9 * rng.uniform(0.8, 2.0), rng.uniform(0.9, 1.2) / (70000.0 * inertia)
    x = np.array([length, 0.5 * length])
    result: Array = clamp * length * x + bend * (0.5 * length * x**2 - x**3 / 6.0)
    return result


def _joint(folder: Path, seed: int) -> Files:
    rng = np.random.default_rng(seed)
    hidden = joint_rig.Joint(
        stiffness=float(1e7 * rng.uniform(0.6, 1.4)), gap=float(rng.choice([0.0, 5e-4])),
        friction=float(rng.choice([0.0, 2500.0])),
    )  # fmt: skip
    return joint_rig.write(folder, hidden, seed)


def _poses(folder: Path, seed: int) -> Files:
    return _of_robot(folder, seed, small=False)


def _cube(folder: Path, seed: int) -> Files:
    return _of_robot(folder, seed, small=True)


def _of_robot(folder: Path, seed: int, *, small: bool) -> Files:
    rng = np.random.default_rng(seed)
    possible = [plan for plan in plans(60, 7) if plan.group in ("none", "single", "pair")]
    plan = possible[seed % len(possible)]
    robot = UR10 if small else plan.robot
    n = len(robot.rows)
    if small:
        # around one posture, by as much as the tool's way in the cube is at the reach
        middle = np.array([0.0, -1.2, 1.4, -1.0, 1.2, 0.0]) + rng.uniform(-0.6, 0.6, n)
        q = middle + rng.uniform(-0.15, 0.15, (60, n))
    else:
        q = rng.uniform(-robot.reach, robot.reach, (60, n))
    other = [one for one in possible if one.robot is robot]
    y = measure(robot, hidden_of(other[seed % len(other)], rng), q, NOISE, rng)
    (folder / "model.toml").write_text(toml_text(document(robot)), encoding="utf-8")
    (folder / "sheet.toml").write_text(sheet_text(robot, NOISE), encoding="utf-8")
    save(folder / "readings.csv", q, y)
    return folder / "readings.csv", folder / "sheet.toml"


def _deflections(folder: Path, seed: int) -> Files:
    return deflections.write(seed, folder)[1]


def _frequencies(folder: Path, seed: int) -> Files:
    rng = np.random.default_rng(seed)
    compliance = np.array(tapped_arm.COMPLIANCE) * rng.uniform(0.6, 1.6, 4)
    table = np.array([tapped_arm.frequencies(q, compliance) for q in tapped_arm.POSTURES])
    return tapped_arm.write(folder, np.sort(table + 0.02 * rng.standard_normal(table.shape)))


SETS: dict[str, Callable[[Path, int], Files]] = {
    "ramps": _ramps,
    "column": _column,
    "loads": _loads,
    "joint": _joint,
    "poses": _poses,
    "poses in a cube": _cube,
    "deflections": _deflections,
    "frequencies": _frequencies,
}
"""By kind of test what writes a sound set of a seed into a folder."""
