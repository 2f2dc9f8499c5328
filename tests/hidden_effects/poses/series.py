"""``python -m hidden_effects.poses.series``: robots measured in two to five series; what that says of one more.

Each robot has errors of frames, soft drives and gears that err by waves of a third or a fourth of a turn, which no
family has. Each series has its own postures, tool, tracker, marker and zeros; the drives differ by some per cent
from series to series, and some have a change in their course. One more series is kept back. It tells whether the
file that was written is worse than no calibration, and whether the intervals of a new series hold its drives.
"""

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hidden_effects.poses.injector import Array, Hidden, rest
from hidden_effects.poses.plan import NOISE, save
from hidden_effects.poses.robots import SEVEN, UR10, Robot, document, sheet_text
from vjm.io.files import toml_text
from vjm.io.model_file import load_chain
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm_updating.inference.significance import Worth, paired_gain
from vjm_updating.poses.held_out import by_machine
from vjm_updating.poses.kinds import read_test, together
from vjm_updating.poses.run import calibrate_poses

SERIES = (2, 5)
KINDS_OF_CHANGE = ("tracker", "marker", "zero")


@dataclass(frozen=True)
class Truth:
    """What a series has: its drives' compliances ``(n,)`` rad/(N mm), and its changes (row, kind)."""

    own: Array
    changes: tuple[tuple[int, str], ...]


def hidden_machine(robot: Robot, rng: np.random.Generator) -> tuple[Hidden, Array, np.ndarray]:
    """The machine that all series share: errors, gears' waves ``(n, 2)`` rad and their periods ``(n,)`` a turn."""
    n = len(robot.rows)
    hidden, size = Hidden.nothing(n), float(rng.uniform(0.4, 1.3))
    hidden.own = rng.uniform(0.3, 1.0, n) * 2e-3 / robot.torque * np.array(robot.softer)
    hidden.shift, hidden.tilt = size * rng.normal(0.0, 0.4, (n, 3)), size * rng.normal(0.0, 8e-4, (n, 2))
    hidden.offset = size * rng.normal(0.0, 1e-3, n)
    return hidden, rng.normal(0.0, float(rng.choice([0.0, 1e-4, 2e-4])), (n, 2)), rng.integers(3, 5, n)


def series(
    robot: Robot, shared: tuple[Hidden, Array, np.ndarray], folder: Path, name: str, rng: np.random.Generator,
    changes: int = 0, region: float = 1.0, count: int = 0,
) -> tuple[Path, Path, Truth]:  # fmt: skip
    """Make the files of a series, with a tool, a tracker and zeros of its own; its truth."""
    hidden, wave, period = shared
    n = len(robot.rows)
    tooled = replace(robot, payload=float(robot.payload * rng.uniform(0.5, 1.5)))
    own = hidden.own * (1.0 + float(rng.choice([0.0, 0.03, 0.08])) * rng.normal(size=n))
    there = replace(hidden, own=np.maximum(own, 0.0))
    # parts of twelve postures at least, and place for them to be drawn
    g = max(count or int(rng.integers(40, 110)), 25 * (changes + 1))
    middle = rng.uniform(-1.0, 1.0, n) * (1.0 - region) * robot.reach
    q = middle + region * rng.uniform(-robot.reach, robot.reach, (g, n))
    zero = float(rng.choice([0.0, 1e-3])) * rng.normal(size=n)
    rows = sorted(int(row) for row in rng.choice(np.arange(15, g - 15), changes, replace=False)) if changes else []
    while np.min(np.diff([0, *rows, g])) < 12:
        rows = sorted(int(row) for row in rng.choice(np.arange(15, g - 15), changes, replace=False))
    kinds = [str(rng.choice(KINDS_OF_CHANGE)) for _ in rows]
    zeros, places = np.tile(zero, (g, 1)), np.tile(rng.uniform(-80.0, 80.0, 3), (g, 1))
    shifts, turns = np.zeros((g, 3)), np.zeros((g, 3))
    for row, kind in zip(rows, kinds, strict=True):
        if kind == "tracker":
            shifts[row:] += rng.normal(0.0, 2.0, 3)
            turns[row:] += rng.normal(0.0, 1e-3, 3)
        elif kind == "marker":
            places[row:] += rng.normal(0.0, 2.0, 3)
        else:
            zeros[row:, int(rng.integers(1, n - 1))] += float(rng.choice([-1.0, 1.0])) * rng.uniform(2e-3, 6e-3)
    geared = q + wave[:, 0] * np.sin(period * q) + wave[:, 1] * np.cos(period * q)
    T = rest(tooled, there, geared + there.offset + zeros)
    target = np.einsum("gab,gb->ga", T[:, :3, :3], places) + T[:, :3, 3]
    yaw = rng.uniform(-np.pi, np.pi)
    view = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    seen = target @ view.T + rng.uniform(-2000.0, 2000.0, 3)
    seen = seen + np.cross(turns, seen) + shifts + rng.normal(0.0, NOISE, (g, 3))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}-model.toml").write_text(toml_text(document(tooled)), encoding="utf-8")
    sheet = sheet_text(robot, NOISE).replace("model.toml", f"{name}-model.toml")
    (folder / f"{name}.toml").write_text(sheet, encoding="utf-8")
    save(folder / f"{name}.csv", q, seen)
    return folder / f"{name}.csv", folder / f"{name}.toml", Truth(there.own, tuple(zip(rows, kinds, strict=True)))


@dataclass(frozen=True)
class Outcome:
    """One robot: what was written, what it is worth on the series kept back, and what its intervals hold there."""

    seed: int
    series: int
    written: bool
    worth: str
    held: int
    intervals: int
    within: int
    changes: int
    found: int
    false_changes: int


def run(seed: int, folder: Path, count: int | None = None, families: tuple[str, ...] = ()) -> Outcome:
    """Make the series of a robot, calibrate it by all but the last, and score that."""
    rng = np.random.default_rng(seed)
    robot = (UR10, SEVEN)[int(rng.integers(2))]
    shared = hidden_machine(robot, rng)
    many = int(rng.integers(SERIES[0], SERIES[1] + 1)) if count is None else count
    made = [
        series(robot, shared, folder, f"s{i}", rng, int(rng.choice([0, 0, 0, 1, 2])), float(rng.choice([1.0, 0.5])))
        for i in range(many)
    ]
    kept_back = series(robot, shared, folder, "new", rng)
    # mistakes of data are not asked for: none are made, and this takes half of the time
    result = calibrate_poses(together([read_test(*files[:2]) for files in made]), list, families=families)
    found = result.figures
    text, worth = result.models["calibrated-model.toml"], ""
    if text:
        (folder / "calibrated.toml").write_text(text, encoding="utf-8")
        worth = str(worth_on(folder / "calibrated.toml", *kept_back[:2]))
    truth = dict(zip((f"actuator_compliance.joint-{i}" for i in range(1, 9)), kept_back[2].own, strict=False))
    rows = [m for f in found.families for m in f.members if m.name in truth and m.identifiable and not m.one_with]
    held = sum(int(m.interval95[0] <= truth[m.name] <= m.interval95[1]) for m in rows)
    within = sum(int(m.within_series95[0] <= truth[m.name] <= m.within_series95[1]) for m in rows)
    hidden = [[row for row, _ in files[2].changes] for files in made]
    # row of the file: its first line is the header
    seen = [[c.row - 2 for c in found.changes if c.file == f"s{i}.csv"] for i in range(many)]
    near, false = np.sum([scored(*both) for both in zip(hidden, seen, strict=True)], axis=0).tolist()
    return Outcome(seed, many, bool(text), worth, held, len(rows), within, sum(map(len, hidden)), near, false)


def worth_on(model: Path, data: Path, sheet: Path) -> Worth:
    """What a file is worth on a series, with that series' tool in it."""
    test = read_test(data, sheet).study
    chain = with_payload(model, sheet)
    was, weight_was = by_machine(test, None, zeros=True)
    now, weight_now = by_machine(test, chain, zeros=True)
    gain = paired_gain(was, now, test.folds.region, np.maximum(weight_was, weight_now))
    assert gain is not None
    return gain.worth


def with_payload(model: Path, sheet: Path) -> Machine:
    """The machine of a file with the payload of a series' own model."""
    tool, chain = load_chain(sheet.with_name(f"{sheet.stem}-model.toml")).parts[-1], load_chain(model)
    assert isinstance(tool, RigidOffset)
    return replace(chain, parts=(*chain.parts[:-1], tool))


NEAR = 3
"""Rows within which a change is found."""


def scored(truth: Sequence[int], found: Sequence[int]) -> tuple[int, int]:
    """How many changes are found, each by a row of its own, and how many rows are invented."""
    left = list(found)
    for row in truth:
        near = min(left, key=lambda one: abs(one - row), default=None)
        if near is not None and abs(near - row) <= NEAR:
            left.remove(near)
    return len(found) - len(left), len(left)


def main() -> None:
    """Run a campaign and print its score."""
    parser = argparse.ArgumentParser(prog="python -m hidden_effects.poses.series", description=__doc__)
    parser.add_argument("--robots", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--series", type=int, default=None, help="of each robot; else 2 to 5")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seed, options.seed + options.robots):
            rows.append(run(seed, Path(folder) / str(seed), options.series))
            print(rows[-1], flush=True)
    total = max(sum(row.intervals for row in rows), 1)
    print(json.dumps({
        "robots": len(rows), "written": sum(row.written for row in rows),
        "worse": [row.seed for row in rows if row.worth == Worth.WORSE],
        "better": sum(row.worth == Worth.BETTER for row in rows),
        "intervals": total, "held": sum(row.held for row in rows) / total,
        "held by series": {
            many: [sum(row.held for row in own), sum(row.intervals for row in own)]
            for many in range(SERIES[0], SERIES[1] + 1)
            if (own := [row for row in rows if row.series == many])
        },
        "within": sum(row.within for row in rows) / total, "changes": sum(row.changes for row in rows),
        "found": sum(row.found for row in rows), "false": sum(row.false_changes for row in rows),
    }))  # fmt: skip


if __name__ == "__main__":
    main()
