"""``python -m hidden_effects.poses.changes``: files in whose course something changed, and quiet ones.

A file is a test of poses of a robot with errors of frames, soft drives and gears that err by waves which no family
has, or one of deflections with soft drives. It has none to three changes: the tracker's frame, the marker, the zero
of a joint, or the zero of a load cell. A change counts as found within three rows.
"""

import argparse
import json
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from hidden_effects.poses.deflections import NOISE as OF_DEFLECTIONS
from hidden_effects.poses.deflections import NOISE_BY_LOAD, columns_of, displacement, files, sheet_text
from hidden_effects.poses.injector import Hidden
from hidden_effects.poses.robots import SEVEN, UR10, Robot
from hidden_effects.poses.series import NEAR, hidden_machine, scored, series
from vjm_updating.poses.changes import found_changes
from vjm_updating.poses.kinds import read_test
from vjm_updating.poses.state import Hypothesis

MOST = 3
FAMILIES = ("frame_error", "actuator_compliance")


def deflected(robot: Robot, folder: Path, rng: np.random.Generator, changes: int) -> tuple[Path, Path, list[int]]:
    """A test of deflections whose load cell's zero changes; its files and the rows of the changes."""
    n = len(robot.rows)
    hidden = Hidden.nothing(n)
    hidden.own = rng.uniform(0.5, 1.5, n) * 2e-3 / robot.torque * np.linspace(1.0, 3.0, n)
    g = int(rng.integers(40, 110))
    q, force = rng.uniform(-robot.reach, robot.reach, (g, n)), rng.uniform(-150.0, 150.0, (g, 3))
    sigma = np.hypot(OF_DEFLECTIONS, NOISE_BY_LOAD * np.linalg.norm(force, axis=1))[:, None]
    d = displacement(robot, hidden, q, force) + rng.normal(0.0, 1.0, (g, 3)) * sigma
    rows = places(rng, g, changes)
    read = force.copy()
    for row in rows:
        read[row:] += rng.choice([-1.0, 1.0], 3) * rng.uniform(8.0, 25.0, 3)
    sheet = sheet_text(tracker=f"noise_mm_per_N = {NOISE_BY_LOAD}", test='order = "as taken"')
    return *files(folder, columns_of(q, read, d), sheet, robot), rows


def places(rng: np.random.Generator, count: int, changes: int) -> list[int]:
    """Rows of changes, twelve readings and more from the ends, and between them where the file has as many."""
    apart = min(12, count // (changes + 1), (count - 24) // max(changes - 1, 1))
    while True:
        rows = sorted(rng.choice(np.arange(12, count - 11), changes, replace=False).tolist())
        if not changes or np.min(np.diff([0, *rows, count])) >= apart:
            return [int(row) for row in rows]


def seen(data: Path, sheet: Path) -> list[tuple[int, str]]:
    """Rows of the changes that are found as a calibration finds them, and their kinds."""
    study = read_test(data, sheet).study
    state = study.gauss_newton(Hypothesis(tuple(name for name in FAMILIES if name in study.families)))
    return [(one.where, str(one.kind)) for one in found_changes(study, state)]


def run(seed: int, folder: Path, changes: int | None = None) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Make a file with some changes, else none to three; what is hidden, and what is found."""
    rng = np.random.default_rng(seed)
    robot = (UR10, SEVEN)[int(rng.integers(2))]
    many = int(rng.integers(MOST + 1)) if changes is None else changes
    if rng.uniform() < 0.25:
        data, sheet, rows = deflected(robot, folder, rng, many)
        hidden = [(row, "load cell") for row in rows]
    else:
        data, sheet, truth = series(robot, hidden_machine(robot, rng), folder, "one", rng, many)
        hidden = list(truth.changes)
    return hidden, seen(data, sheet)


def main() -> None:
    """Run files with changes and quiet ones, and print the score."""
    parser = argparse.ArgumentParser(prog="python -m hidden_effects.poses.changes", description=__doc__)
    parser.add_argument("--sets", type=int, default=60)
    parser.add_argument("--quiet", type=int, default=30, help="further sets, without a change")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    score, kinds, invented = Counter[str](), Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.sets + options.quiet):
            quiet = number >= options.sets
            hidden, found = run(options.seed + number, Path(folder) / str(number), 0 if quiet else None)
            right, wrong = scored([row for row, _ in hidden], [row for row, _ in found])
            print(options.seed + number, hidden, found, f"{wrong} invented" if wrong else "", flush=True)
            score["changes"] += len(hidden)
            score["found"] += right
            score["invented in quiet sets" if quiet else "invented"] += wrong
            for row, kind in hidden:
                kinds[f"{kind}: hidden"] += 1
                kinds[f"{kind}: found"] += any(abs(row - at) <= NEAR for at, _ in found)
            for at, kind in found:
                invented[kind] += all(abs(row - at) > NEAR for row, _ in hidden)
    print(json.dumps(dict(score) | {"kinds": dict(kinds), "invented kinds": dict(invented)}))


if __name__ == "__main__":
    main()
