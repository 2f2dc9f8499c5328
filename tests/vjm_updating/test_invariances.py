"""What does not change a test does not change its calibration: drawn machines of every kind of test.

No truth is needed: a test and the same test written in another way have to have the same numbers.
"""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Callable, Iterator
from csv import DictReader, DictWriter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mistakes.sets import SETS
from scipy.spatial.transform import Rotation

from vjm.io.files import toml_text
from vjm.io.machine_file import machine_document
from vjm.model.laws import StrainWave
from vjm_updating import calibrate, load_data

Row = dict[str, str]
SAME = 0.02
"""Of a standard deviation: what the ends of two fits may differ by that begin at other roundings."""
TWICE = 0.3
"""Likewise of readings that stand twice: noise, autocorrelation and outliers are estimated from other numbers."""
TURNED = 0.15
"""Likewise of another tracker: how far readings scatter is told by the median of coordinates, whose axes turn."""


@dataclass(frozen=True)
class Written:
    """A test as it stands in files."""

    rows: list[Row]
    sheet: str
    model: dict[str, Any]
    named: dict[str, str]

    def each(self, change: Callable[[str, float], float]) -> Written:
        """With every number of the data changed, given its column."""
        rows = [
            {c: repr(change(c, float(v))) if _is_number(c, v) else v for c, v in row.items()} for row in self.rows
        ]
        return replace(self, rows=rows)


def _is_number(column: str, cell: str) -> bool:
    return column not in ("posture", "reading", "run") and bool(cell)


def drawn(kind: str, seed: int, folder: Path) -> tuple[Written, str]:
    """A sound test of a kind, and the name of its model file."""
    folder.mkdir(parents=True)
    data, sheet = SETS[kind](folder, seed)
    with open(data, newline="", encoding="utf-8") as file:
        rows = list(DictReader(line for line in file if not line.startswith("#")))
    # rows are exchanged where their order is not said
    text = sheet.read_text(encoding="utf-8").replace('order = "as taken"', 'order = "unknown"')
    name = tomllib.loads(text)["test"]["model"]
    own = sheet.parent / name
    return Written(rows, text, tomllib.loads(own.read_text()) if own.is_file() else {}, {}), name


def numbers(test: Written, model: str, folder: Path) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of each parameter of a calibration, by the names before."""
    folder.mkdir(parents=True)
    if test.model:
        (folder / model).write_text(toml_text(test.model), encoding="utf-8")
    (folder / "sheet.toml").write_text(test.sheet, encoding="utf-8")
    with open(folder / "data.csv", "w", newline="", encoding="utf-8") as file:
        writer = DictWriter(file, test.rows[0])
        writer.writeheader()
        writer.writerows(test.rows)
    found = calibrate(load_data(folder / "data.csv", folder / "sheet.toml"), force=True)

    def before(name: str) -> str:
        for now, old in test.named.items():
            name = name.replace(now, old)
        return name

    return {before(row["name"]): (row["value"], row["std"]) for row in found.rows()}


# --- What does not change a test ----------------------------------------------------------------------------------


def columns_in_another_order(test: Written, rng: np.random.Generator) -> Written:
    names = rng.permutation(list(test.rows[0])).tolist()
    return replace(test, rows=[{name: row[name] for name in names} for row in test.rows])


def rows_in_another_order(test: Written, rng: np.random.Generator) -> Written:
    return replace(test, rows=[test.rows[k] for k in rng.permutation(len(test.rows))])


def postures_in_another_order(test: Written, rng: np.random.Generator) -> Written:
    """What is done to a machine in one posture is no history of another one."""
    labels = rng.permutation(list(dict.fromkeys(row["posture"] for row in test.rows))).tolist()
    return replace(test, rows=sorted(test.rows, key=lambda row: labels.index(row["posture"])))


def other_names(test: Written, rng: np.random.Generator) -> Written:
    """Markers, points of load, and labels of postures."""
    page = tomllib.loads(test.sheet)
    old = [*page.get("markers", {}), *page.get("loads", {})]
    named = {f"zz{k}": name for k, name in enumerate(old)}
    sheet, rows = test.sheet, test.rows
    for now, was in named.items():
        sheet = re.sub(rf"(?m)^\[(markers|loads)\.{re.escape(was)}\]", rf"[\1.{now}]", sheet)
        rows = [{re.sub(rf"^{re.escape(was)}\.", f"{now}.", c): v for c, v in row.items()} for row in rows]
    # an empty posture is the model's of that name
    if all(page.get("postures", {"": []}).values()) and "posture" in rows[0]:
        head, tail = sheet.split("[postures]")
        for k, was in enumerate(page["postures"]):
            tail = re.sub(rf"(?m)^{re.escape(was)} =", f"yy{k} =", tail)
            rows = [row | {"posture": f"yy{k}"} if row["posture"] == was else row for row in rows]
        sheet = f"{head}[postures]{tail}"
        named |= {f"yy{k}": was for k, was in enumerate(page["postures"])}
    return replace(test, rows=rows, sheet=sheet, named=named)


def both_signs_reversed(test: Written, rng: np.random.Generator) -> Written:
    """A joint, or a tube with a round section, does the same to both sides."""
    return test.each(lambda column, v: v if column == "time_s" else -v)


def twice(test: Written, rng: np.random.Generator) -> Written:
    """Each reading as two of √2 times the noise, whose mean it is; of a machine with a history in a second run.

    What a reading errs and what is added and taken away are independent, and of the same size: so are the sum and
    the difference.
    """
    page = tomllib.loads(test.sheet)
    noise = {name: table.get("noise", 0.0) for name, table in page.get("instrument", {}).items()}
    noise |= dict.fromkeys(
        (c for c in test.rows[0] if c.endswith("_Hz")), page.get("frequencies", {}).get("noise_Hz")
    )
    noise |= dict.fromkeys((c for c in test.rows[0] if ".d" in c), page.get("tracker", {}).get("noise_mm"))
    more = {
        name: sigma * rng.standard_normal(len(test.rows)) for name, sigma in noise.items() if name in test.rows[0]
    }
    rows = []
    for run, sign in (("1", 1.0), ("2", -1.0)):
        for k, row in enumerate(test.rows):
            read = {name: repr(float(row[name]) + sign * float(e[k])) for name, e in more.items() if row[name]}
            rows.append(row | read | ({"run": run} if noise.keys() & {*page.get("instrument", {})} else {}))
    sheet = re.sub(r"(?m)^(noise\w*) = ([-+.\de]+)", lambda m: f"{m[1]} = {float(m[2]) * 2**0.5!r}", test.sheet)
    return replace(test, rows=rows, sheet=sheet)


def another_tracker(test: Written, rng: np.random.Generator) -> Written:
    """Positions in the axes of a tracker that stands elsewhere."""
    R, t = Rotation.random(random_state=rng).as_matrix(), rng.uniform(-2000.0, 2000.0, 3)
    rows = []
    for row in test.rows:
        seen = [c for c in row if re.fullmatch(r".*\.[xyz]_mm", c)]
        place = R @ [float(row[c]) for c in seen] + t
        rows.append(row | {c: repr(float(v)) for c, v in zip(seen, place, strict=True)})
    return replace(test, rows=rows)


def mirrored(test: Written, rng: np.random.Generator) -> Written:
    """The machine and all that is done to it in a mirror across y: turns about x and z change their sign."""

    def side(v: list[float]) -> list[float]:
        return [v[0], -v[1], v[2]]

    turned = {}
    parts = []
    for part in test.model["parts"]:
        one = {k: side(v) if k in ("translation_mm", "centre_of_mass_mm") else v for k, v in part.items()}
        if "turns" in one:
            one["turns"] = [
                t | {"angle_deg": t["angle_deg"] * (1.0 if t["turn_about"] == "y" else -1.0)} for t in one["turns"]
            ]
        if one["kind"] == "actuated":
            turned[one["name"]] = 1.0 if one["axis"] == "y" else -1.0
        parts.append(one)
    page = tomllib.loads(test.sheet)
    for table in (*page.get("markers", {}).values(), *page.get("loads", {}).values()):
        table["position_mm"] = side(table["position_mm"])
    if "gravity" in page["test"]:
        page["test"]["gravity"] = side(page["test"]["gravity"])
    if "postures" in page:
        page["postures"] = {
            label: {joint: turned[joint] * v for joint, v in q.items()} for label, q in page["postures"].items()
        }

    def change(column: str, v: float) -> float:
        if column.endswith(".q_rad"):
            return turned[column[:-6]] * v
        return -v if re.fullmatch(r".*\.(d?y_mm|fy_N)", column) else v

    return replace(test.each(change), model={**test.model, "parts": parts}, sheet=toml_text(page))


def straight_laws(test: Written, rng: np.random.Generator) -> Written:
    """Springs of joints as laws of three slopes that are one. Of a joint under test the slopes would be found."""
    model = test.model or machine_document(tomllib.loads(test.sheet)["test"]["model"]).content
    parts = []
    for part in model["parts"]:
        one = dict(part)
        for key, slides in (("compliance_rad_per_Nmm", False), ("compliance_mm_per_N", True)):
            if one["kind"] != "beam" and one.get(key):
                k = 1.0 / one.pop(key)
                one["law"] = StrainWave(K1=k, K2=k, K3=k, T1=1.0, T2=3.0).table(slides=slides)
                if one["kind"] == "mount":
                    one["motion"] = "slides" if slides else "turns"
        parts.append(one)
    assert parts != model["parts"]
    return replace(test, model={**model, "parts": parts})


OF_ALL = (columns_in_another_order, other_names)
INVARIANCES: dict[str, tuple[Callable[[Written, np.random.Generator], Written], ...]] = {
    "ramps": (*OF_ALL, twice, postures_in_another_order, straight_laws),
    "loads": (*OF_ALL, twice, both_signs_reversed, straight_laws),
    "joint": (*OF_ALL, twice, both_signs_reversed),
    "frequencies": (*OF_ALL, twice, rows_in_another_order, mirrored, straight_laws),
    "poses": (*OF_ALL, rows_in_another_order, another_tracker, mirrored),
    "deflections": (*OF_ALL, twice, rows_in_another_order, mirrored),
}
"""By kind of test what does not change it. Positions scatter by what a robot lacks, which is not known: there
readings that stand twice are more."""
QUICK = (("frequencies", columns_in_another_order), ("frequencies", mirrored), ("loads", straight_laws))
SEEDS = {"ramps": 2, "poses": 4}


def cases() -> Iterator[object]:
    for kind, changes in INVARIANCES.items():
        for change in changes:
            quick = (kind, change) in QUICK
            marks = [] if quick else [pytest.mark.slow]
            yield pytest.param(kind, change, id=f"{kind}-{change.__name__}", marks=marks)


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """By kind the test as drawn, the name of its model, and its numbers."""
    known: dict[str, tuple[Written, str, dict[str, tuple[float, float]]]] = {}

    def of(kind: str) -> tuple[Written, str, dict[str, tuple[float, float]]]:
        if kind not in known:
            folder = tmp_path_factory.mktemp(kind)
            test, model = drawn(kind, SEEDS.get(kind, 11), folder / "drawn")
            known[kind] = test, model, numbers(test, model, folder / "as-drawn")
        return known[kind]

    return of


@pytest.mark.parametrize(("kind", "change"), [*cases()])
def test_a_calibration_does_not_change(kind, change, before, tmp_path):
    test, model, was = before(kind)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        now = numbers(change(test, np.random.default_rng(5)), model, tmp_path / "changed")
    tolerance = {twice: TWICE, another_tracker: TURNED}.get(change, SAME)
    assert set(now) == set(was)
    # turns and shifts across the mirror change their sign
    size = abs if change is mirrored else float
    off = {
        name: (now[name], (value, std))
        for name, (value, std) in was.items()
        if abs(size(now[name][0]) - size(value)) > tolerance * std
    }
    assert not off
