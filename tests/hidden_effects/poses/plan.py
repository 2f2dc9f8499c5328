"""The sets of a campaign: robots, causes and sizes, drawn from a seed; their files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hidden_effects.poses.injector import Array, Hidden, measure
from hidden_effects.poses.robots import HEAVY, PLANAR, ROBOTS, Robot, document, sheet_text
from vjm.io.files import toml_text

SINGLE = (
    "frame_error", "actuator_compliance", "lateral_compliance", "base_compliance", "gear_error", "encoder_scale",
    "tracker_drift", "approach",
)  # fmt: skip
OUTSIDE = ("slip", "crack", "flipped", "rubber")
GROUPS = {"none": 0.2, "single": 0.4, "pair": 0.2, "outside": 0.2, "soft wrist": 0.2}
"""Sets of each group over those that were asked for; soft wrists are of the heavy robot, and come on top."""
NOISE = 0.05
"""mm."""
POSTURES = (120, 200)


@dataclass(frozen=True)
class Planned:
    """One set."""

    number: int
    group: str
    robot: Robot
    causes: tuple[str, ...]
    seed: int


def plans(count: int, seed: int) -> list[Planned]:
    """All sets of a campaign."""
    rng = np.random.default_rng(seed)
    result = []
    groups = [name for name, share in GROUPS.items() for _ in range(round(share * count))]
    for number, group in enumerate(groups):
        robot = HEAVY if group == "soft wrist" else ROBOTS[number % len(ROBOTS)]
        known = [
            name for name in SINGLE if robot is not PLANAR or name not in ("lateral_compliance", "frame_error")
        ]
        if group == "none":
            causes: tuple[str, ...] = ()
        elif group == "soft wrist":
            causes = (("actuator_compliance",), ("frame_error", "actuator_compliance"))[number % 2]
        elif group == "outside":
            causes = (OUTSIDE[(number // len(ROBOTS)) % len(OUTSIDE)],)
        else:
            size = 1 if group == "single" else 2
            causes = tuple(sorted(str(c) for c in rng.choice(known, size, replace=False)))
        result.append(Planned(number, group, robot, causes, int(rng.integers(2**31))))
    return result


def hidden_of(plan: Planned, rng: np.random.Generator) -> Hidden:
    """The causes of a set with sizes of industrial robots."""
    n = len(plan.robot.rows)
    found = Hidden.nothing(n)
    found.names = plan.causes
    load = plan.robot.torque
    for cause in plan.causes:
        size = float(rng.uniform(0.5, 1.5))
        if cause == "frame_error":
            found.shift = size * rng.normal(0.0, 0.5, (n, 3))
            found.tilt = size * rng.normal(0.0, 1e-3, (n, 2))
            found.offset = size * rng.normal(0.0, 1e-3, n)
        elif cause == "actuator_compliance":
            found.own = size * rng.uniform(0.3, 1.0, n) * 2e-3 / load * np.array(plan.robot.softer)
        elif cause == "lateral_compliance":
            found.across = size * rng.uniform(0.3, 1.0, (n, 2)) * 2e-3 / load
        elif cause == "base_compliance":
            found.base = size * rng.uniform(0.5, 1.0, 3) * 1.5e-3 / load
        elif cause == "gear_error":
            found.wave = size * rng.normal(0.0, 4e-4, (n, 4))
        elif cause == "encoder_scale":
            found.scale = size * rng.normal(0.0, 8e-4, n)
        elif cause == "tracker_drift":
            found.drift = size * rng.choice([-1.0, 1.0], 3) * rng.uniform(0.4, 1.0, 3)
        elif cause == "approach":
            found.backlash = size * rng.uniform(1.5e-4, 5e-4, n)
        elif cause == "slip":
            found.slip = int(rng.integers(0, min(n, 3))), float(rng.uniform(0.3, 0.7)), size * 4e-3
        elif cause == "crack":
            found.crack = 1 if n > 2 else 0, size * 4e-3 / load
        elif cause == "flipped":
            found.flipped = (int(rng.integers(1, n)),)
        elif cause == "rubber":
            found.rubber = size * 3e-3 / load, 0.5 * load
        else:
            raise ValueError(cause)
    return found


def write(plan: Planned, folder: Path) -> tuple[Path, Path]:
    """Make the files of a set: readings and sheet, the model beside them."""
    rng = np.random.default_rng(plan.seed)
    robot, n = plan.robot, len(plan.robot.rows)
    q = rng.uniform(-robot.reach, robot.reach, (int(rng.integers(*POSTURES)), n))
    y = measure(robot, hidden_of(plan, rng), q, NOISE, rng)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(toml_text(document(robot)), encoding="utf-8")
    (folder / "sheet.toml").write_text(sheet_text(robot, NOISE), encoding="utf-8")
    save(folder / "readings.csv", q, y)
    return folder / "readings.csv", folder / "sheet.toml"


def save(path: Path, q: Array, y: Array, markers: Sequence[str] = ("target",)) -> None:
    """Write postures ``(g, n)`` rad and positions ``(g, 3 k)`` mm of k markers as readings."""
    header = [f"joint-{i}.q_rad" for i in range(1, q.shape[1] + 1)]
    header += [f"{name}.{axis}_mm" for name in markers for axis in "xyz"]
    rows = (",".join(f"{v:.9g}" for v in row) for row in np.column_stack([q, y]))
    path.write_text("\n".join([",".join(header), *rows]) + "\n", encoding="utf-8")
