"""``python -m helpers.ur10_parts``: the UR10 calibrated in a part of what was measured, judged in the rest.

The part is the middle of its joints' ranges, or a cube of 300 mm. The file is judged on all other postures of the
series, and on another series, with only frames and zeros fitted there.
"""

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

from vjm_updating import calibrate, load_data
from vjm_updating.poses.document import ComparedRow, PoseCalibration

EXAMPLE = Path(__file__).parents[2] / "validation/vjm_validation/examples/ur10-poses"
SERIES = ("readings.csv", "series-d.csv")
SHARE = 0.7
"""Of the range of a joint, its middle."""
SIDE = 300.0
"""mm, of the cube."""
JOINTS, CUBE = "middle of the joints' ranges", "cube of 300 mm"


def inside(part: str, q: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Which postures ``(g,)`` lie in a part: q ``(g, 6)`` rad, place ``(g, 3)`` mm."""
    if part == JOINTS:
        # of the three joints that bear weight and turn much
        low, high = np.quantile(q[:, 1:4], [0.5 - 0.5 * SHARE, 0.5 + 0.5 * SHARE], axis=0)
        return np.asarray(((q[:, 1:4] >= low) & (q[:, 1:4] <= high)).all(axis=1))
    # the cube about a posture that holds the most
    cubes = np.abs(place[:, None] - place).max(axis=2) <= 0.5 * SIDE
    return np.asarray(cubes[np.argmax(cubes.sum(axis=1))])


def judged(part: str, series: str, folder: Path) -> tuple[int, PoseCalibration, list[ComparedRow]]:
    """Calibrate by a part of a series."""
    with (EXAMPLE / series).open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    numbers = np.array([[float(cell) for cell in row[1:10]] for row in rows])
    own = inside(part, numbers[:, :6], numbers[:, 6:])
    files = {}
    for name, keep in (("inside", own), ("outside", ~own)):
        files[name] = folder / f"{name}.csv"
        lines = [head, *(row for row, kept in zip(rows, keep, strict=True) if kept)]
        files[name].write_text("\n".join(map(",".join, lines)) + "\n", encoding="utf-8")
    sheet = EXAMPLE / "sheet.toml"
    other = EXAMPLE / SERIES[series == SERIES[0]]
    beside = [load_data(files["outside"], sheet), load_data(other, sheet)]
    found = calibrate(load_data(files["inside"], sheet), beside=beside).figures
    assert isinstance(found, PoseCalibration)
    there = [row for row in found.written.compared if row.where.startswith("on ") and "own" not in row.against]
    return int(own.sum()), found, there


def main() -> None:
    """Print a row for each part and series."""
    for part in (JOINTS, CUBE):
        for series in SERIES:
            with tempfile.TemporaryDirectory() as folder:
                count, found, there = judged(part, series, Path(folder))
            each = [f"{one.where} {one.uncalibrated_mm:.3f} to {one.file_mm:.3f}: {one.verdict}" for one in there]
            refused = "not written" if found.written.refused else "written"
            sys.stdout.write(f"{part} of {series}, {count} postures, {refused}: {'; '.join(each)}\n")


if __name__ == "__main__":
    main()
