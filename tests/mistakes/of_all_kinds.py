"""Mistakes of thirty kinds in tests of every kind: is each noticed, is it named, and is a sound test doubted?

Noticed: a refusal, a doubt, or readings that are said to be left out. Named: one of the words is said.
"""

import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from csv import DictReader, DictWriter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mistakes.kinds import Row
from mistakes.sets import SETS
from vjm.io.findings import Grade
from vjm_updating import load_data

FORCE, MOMENT = re.compile(r"(.*\.)?f[xyz]_N"), re.compile(r"(.*\.)?(m[xyz]|torque)_Nmm")
LENGTH = re.compile(r"(.*\.)?(u[xyz]|d?[xyz])_mm")
JOINT, ANGLE = re.compile(r".*\.q_rad"), re.compile(r"angle_rad")
FREQUENCY = re.compile(r"f\d_Hz")
LABEL = "posture"


@dataclass(frozen=True)
class Spoilt:
    """A test with one mistake."""

    kind: str
    place: str
    says: tuple[str, ...]
    rows: list[Row]
    sheet: str


def spoilt(kind: str, rows: list[Row], sheet: str, seed: int) -> Iterator[Spoilt]:
    """All mistakes that a test may have, each in every place of the test."""
    rng = np.random.default_rng(seed)
    names, n = list(rows[0]), len(rows)

    def those(pattern: re.Pattern[str]) -> list[str]:
        return [name for name in names if pattern.fullmatch(name)]

    forces, moments, lengths, joints = map(those, (FORCE, MOMENT, LENGTH, JOINT))
    angles, tones = map(those, (ANGLE, FREQUENCY))
    read = {"loads": lengths, "deflections": lengths, "frequencies": tones}.get(
        kind, lengths if "poses" in kind else forces + moments
    )
    main = max(read, key=lambda name: float(np.ptp([float(row[name] or 0.0) for row in rows])))
    other = next((name for name in read if name != main), "")
    everywhere, block = range(n), range(int(0.3 * n), int(0.6 * n))
    places = {"everywhere": everywhere, "a block": block}

    def with_cells(of: list[str], at: range | list[int], made: dict[tuple[int, str], str]) -> list[Row]:
        again = [dict(row) for row in rows]
        for k in at:
            for name in of:
                if (k, name) in made and rows[k][name]:
                    again[k][name] = made[k, name]
        return again

    def times(of: list[str], at: range | list[int], factor: float) -> list[Row]:
        made = {(k, c): repr(float(rows[k][c]) * factor) for k in at for c in of if rows[k][c]}
        return with_cells(of, at, made)

    def cells(of: list[str], at: range | list[int], source: list[int]) -> list[Row]:
        return with_cells(of, at, {(k, c): rows[j][c] for k, j in zip(at, source, strict=True) for c in of})

    units = [
        ("inches", lengths, 1 / 25.4, ("inches",)), ("cm", lengths, 0.1, ("cm",)),
        ("m", lengths, 1e-3, ("in m:", "in m ", "in m?", "in m,")), ("µm", lengths, 1e3, ("µm",)),
        ("kgf", forces, 1 / 9.80665, ("kgf",)), ("lbf", forces, 1 / 4.4482216152605, ("lbf",)),
        ("kN", forces, 1e-3, ("kN",)), ("N m", moments, 1e-3, ("N m", "kN", "m instead")),
        ("degrees", angles, 180 / np.pi, ("degrees",)), ("degrees", joints[1:2], 180 / np.pi, ("degrees",)),
        ("rad/s", tones, 2 * np.pi, ("rad/s",)), ("rpm", tones, 60.0, ("rpm",)),
    ]  # fmt: skip
    for place, at in places.items():
        for unit, of, factor, says in units:
            if of:
                yield Spoilt(f"unit {unit}", place, says, times(of, at, factor), sheet)
        if read != tones:
            yield Spoilt("sign of a column", place, ("sign", "reverse"), times([main], at, -1.0), sheet)
            yield Spoilt("sign of all read", place, ("sign", "reverse", "turn"), times(read, at, -1.0), sheet)
        if joints:
            name = joints[1]
            yield Spoilt("sign of a joint", place, (f"joint_sign.{name[:-6]}",), times([name], at, -1.0), sheet)
            a, b = joints[1:3] if len(joints) > 2 else joints[:2]
            made = {(k, c): rows[k][d] for k in at for c, d in ((a, b), (b, a))}
            says = (f"joints_swapped.{a[:-6]}.{b[:-6]}",)
            yield Spoilt("two joints exchanged", place, says, with_cells([a, b], at, made), sheet)
        if other and read != tones:
            made = {(k, c): rows[k][d] for k in at for c, d in ((main, other), (other, main))}
            yield Spoilt("two columns exchanged", place, ("exchange",), with_cells([main, other], at, made), sheet)
        for by in (1, 5):
            at_by = [k for k in at if k >= by]
            moved = cells(read, at_by, [k - by for k in at_by])
            yield Spoilt(f"readings shifted by {by}", place, ("shifted",), moved, sheet)
        backward = cells(read, at, list(at)[::-1])
        yield Spoilt("readings reversed", place, ("revers", "backward"), backward, sheet)
    order = sorted(everywhere, key=lambda k: float(rows[k][main] or 0.0))
    yield Spoilt("a column sorted", "everywhere", ("sorted",), cells([main], everywhere, order), sheet)
    yield Spoilt("a block twice", "a block", ("twice", "repeat"), rows[: block.stop] + rows[block.start :], sheet)
    few = sorted(rng.choice(n, max(3, n // 10), replace=False).tolist())
    yield Spoilt(
        "a thousandfold cell", "cells", ("outlier", "thousand", "1000"), times([main], few[:3], 1e3), sheet
    )
    for filler in ("0", "-999"):
        gone = with_cells([main], few, {(k, main): filler for k in few})
        yield Spoilt(f"{filler} for an absent value", "cells", ("absent", "blank", filler), gone, sheet)
    for place, at in places.items():
        stuck = cells([main], at, [at.start] * len(at))
        yield Spoilt("a channel stands still", place, ("hang", "stands", "same", "every reading"), stuck, sheet)
    if other:
        copied = with_cells([main], everywhere, {(k, main): rows[k][other] for k in everywhere})
        yield Spoilt("a column copied", "everywhere", ("copied", "same as"), copied, sheet)
    span = float(np.ptp([float(row[main] or 0.0) for row in rows]))
    late = range(int(0.6 * n), n)
    tare = {(k, main): repr(float(rows[k][main] or 0.0) + 0.3 * span) for k in late}
    yield Spoilt(
        "tare not subtracted", "from a row on", ("jump", "zero", "off"), with_cells([main], late, tare), sheet
    )
    digit = 0.2 * span
    lost = {(k, main): repr(round(float(rows[k][main] or 0.0) / digit) * digit) for k in everywhere}
    yield Spoilt("digits lost", "everywhere", ("digits",), with_cells([main], everywhere, lost), sheet)
    if "time_s" in names:
        clock = {(k, "time_s"): repr(float(rows[k]["time_s"]) * 1e3) for k in block}
        yield Spoilt("clock in ms", "a block", ("ms", "clock"), with_cells(["time_s"], block, clock), sheet)
        back = {(k, "time_s"): repr(float(rows[k]["time_s"]) - 1e4) for k in late}
        yield Spoilt("clock set back", "from a row on", ("clock",), with_cells(["time_s"], late, back), sheet)
    labels = list(dict.fromkeys(row.get(LABEL, "") for row in rows))
    if len(labels) > 1:
        a, b = labels[:2]
        made = {(k, LABEL): {a: b, b: a}.get(rows[k][LABEL], rows[k][LABEL]) for k in everywhere}
        changed = with_cells([LABEL], everywhere, made)
        yield Spoilt("postures' labels exchanged", "everywhere", ("labelled", "label"), changed, sheet)
    for words, factor in (("a thousandth", 1e-3), ("a thousand times", 1e3)):
        found = re.compile(r"(?m)^(noise\w*) = ([-+.\de]+)")
        text = found.sub(lambda m, by=factor: f"{m[1]} = {float(m[2]) * by!r}", sheet)  # type: ignore[misc]
        yield Spoilt(f"noise of the sheet {words}", "sheet", ("noise",), rows, text)


def said(data: Path, sheet: Path) -> tuple[str, ...]:
    """What is said of a test before anything is fitted: refusals, doubts, and readings that are left out."""
    try:
        found = load_data(data, sheet).considered()
    except ValueError as refused:
        return (str(refused),)
    return tuple(str(one) for one in found if one.grade is not Grade.NOTED or "outlier" in str(one))


def of_set(kind: str, seed: int, folder: Path) -> Iterator[tuple[str, str, bool, bool, tuple[str, ...]]]:
    """Kind of mistake, place, whether it is noticed and named, and what is said; first the sound set."""
    folder.mkdir(parents=True, exist_ok=True)
    data, page = SETS[kind](folder, seed)
    with open(data, newline="", encoding="utf-8") as file:
        rows = list(DictReader(line for line in file if not line.startswith("#")))
    text = page.read_text(encoding="utf-8")
    words = said(data, page)
    yield "sound", "", bool(words), False, words
    for one in spoilt(kind, rows, text, seed):
        if one.rows == rows and one.sheet == text:
            continue
        tomllib.loads(one.sheet)
        page.write_text(one.sheet, encoding="utf-8")
        with open(data, "w", newline="", encoding="utf-8") as file:
            writer = DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(one.rows)
        words = said(data, page)
        named = any(word in line for word in one.says for line in words)
        yield one.kind, one.place, bool(words), named, words


def table(kinds: list[str], seeds: range, folder: Path) -> Iterator[str]:
    """The table in Markdown: noticed/named of tried, a row a mistake and place, a column a kind of test."""
    counted: dict[tuple[str, str], dict[str, list[int]]] = defaultdict(lambda: defaultdict(lambda: [0, 0, 0]))
    for kind in kinds:
        for seed in seeds:
            for mistake, place, noticed, named, _ in of_set(kind, seed, folder / f"{kind}-{seed}"):
                cell = counted[mistake, place][kind]
                for i, count in enumerate((noticed, named, True)):
                    cell[i] += count
    yield f"| mistake | place | {' | '.join(kinds)} |"
    yield "| --- | --- |" + " --- |" * len(kinds)
    for (mistake, place), by_kind in counted.items():
        row = ["{}/{} of {}".format(*by_kind[kind]) if kind in by_kind else "–" for kind in kinds]
        yield f"| {mistake} | {place} | {' | '.join(row)} |"
    total = [
        [sum(c[kind][i] for (m, _), c in counted.items() if m != "sound" and kind in c) for i in range(3)]
        for kind in kinds
    ]
    yield f"| all | | {' | '.join('{}/{} of {}'.format(*row) for row in total)} |"
