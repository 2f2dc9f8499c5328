"""What ``validate map`` found, as a document and as a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.io.findings import Finding
from vjm_output.documents import doubt_rows
from vjm_updating.maps.difference import Difference, difference_of, write_difference
from vjm_updating.maps.evaluate import MapSetting
from vjm_updating.maps.output import write_map
from vjm_updating.maps.quantity import COLUMNS, NAMES, OK, SHOWN, TITLES, MapQuantity
from vjm_updating.maps.run import MapResult
from vjm_validation.cli import pages
from vjm_validation.documents import MapRowsDocument

UNITS = {"_N_per_mm": "N/mm", "_Nmm_per_rad": "N mm/rad", "_mm": "mm", "_rad": "rad", "_N": "N", "_Hz": "Hz"}
"""Endings of columns, the longer ones first."""


@dataclass(frozen=True)
class Mapped:
    """A map with its files.

    Attributes:
        result: the map.
        files: that were written.
        left_out: a line for each that was not, with the reason.
        difference: to another engine, where one is asked for.
    """

    result: MapResult
    files: Sequence[Path]
    left_out: Sequence[str]
    difference: Difference | None = None

    @property
    def setting(self) -> MapSetting:
        """What was asked."""
        return self.result.map.setting

    @property
    def places(self) -> np.ndarray:
        """``(g, 3)`` of the end, mm."""
        return self.result.map.points.places


def mapped(result: MapResult, folder: Path, second: MapResult | None = None) -> Mapped:
    """A map and the files of a folder; its difference to a second map too."""
    files, left_out = write_map(result, folder)
    if second is None:
        return Mapped(result, files, left_out)
    first, points = result.map.setting, result.map.points
    apart = difference_of(
        (first.engine.label, second.map.setting.engine.label), first.quantity, result.map.points.grid.ordered,
        points.places, (result.values, second.values), (result.why, second.why),
    )  # fmt: skip
    more, missing = write_difference(apart, folder)
    return Mapped(result, [*files, *more], [*left_out, *missing], apart)


def title(wrench: Sequence[float]) -> str:
    """A wrench in words; its force alone where it has no moment."""
    return ", ".join(f"{v:g}" for v in (wrench if any(wrench[3:]) else wrench[:3])) + " N"


def worst_parts(found: Mapped) -> list[str]:
    """A line for each part that has the largest share somewhere, those with the most poses first."""
    counts = Counter(f"{part} ({kind})" for part, kind in found.result.names if part)
    lines = []
    for name, count in counts.most_common():
        own = [f"{part} ({kind})" == name for part, kind in found.result.names]
        low, high = (edge(found.result.values[own, 0]) for edge in (np.min, np.max))
        lines.append(f"{name} has the largest share at {count} poses: {low:.1%} to {high:.1%}")
    return lines


def document(found: Mapped, doubts: Sequence[Finding]) -> MapRowsDocument:
    """What is printed of one map."""

    def numbers(values: np.ndarray) -> list[float | None]:
        return [float(v) if np.isfinite(v) else None for v in values]

    return MapRowsDocument(
        model=found.setting.machine.name,
        model_sha256=found.setting.machine.sha256,
        version=__version__,
        engine=found.setting.engine.label,
        quantity=str(found.setting.quantity),
        columns=list(COLUMNS[found.setting.quantity]),
        places_mm=[numbers(row) for row in found.places],
        joints={name: numbers(values) for name, values in found.result.joints.items()},
        values=[numbers(row) for row in found.result.values],
        parts=[part for part, _ in found.result.names],
        kinds=[kind for _, kind in found.result.names],
        status=list(found.result.why),
        wrench=list(found.setting.wrench),
        against=found.difference.against if found.difference else "",
        difference_percent=numbers(found.difference.percent) if found.difference else [],
        files=[str(file) for file in found.files],
        doubts=doubt_rows(doubts),
    )


def content(maps: Sequence[Mapped], files: Sequence[Path]) -> pages.Content:
    """The page of maps.

    Args:
        maps: one a wrench.
        files: that show all of them.
    """
    from vjm_output.number_text import number
    from vjm_output.plot_style import Drawing, Picture
    from vjm_validation.report.tables import ReportTable

    found, several = maps[0], len(maps) > 1
    titles = {
        "map.png": "The map", "render.png": "Planes through the middle of the workspace",
        "difference.png": "Difference of two engines", "side-by-side.png": "One map for each wrench",
    }  # fmt: skip
    what = TITLES[found.setting.quantity]
    scale = "A colour for each part" if found.setting.quantity is MapQuantity.SHARES else "One colour scale"
    caption = f"{what[:1].upper()}{what[1:]}; where there is none, nothing is drawn. {scale}."
    pictures = [
        Picture(f"{file.parent.name}-{file.stem}" if several else file.stem, Drawing(file.read_bytes()),
                titles[file.name], f"{title(each.setting.wrench)}. {caption}" if several else caption)
        for each in maps
        for file in each.files
        if file.name in titles
    ]  # fmt: skip
    pictures = [*(Picture(file.stem, Drawing(file.read_bytes()), titles[file.name], caption) for file in files),
                *pictures]  # fmt: skip
    header = (*found.result.joints, "x, mm", "y, mm", "z, mm", *map(_with_unit, COLUMNS[found.setting.quantity]),
              *(NAMES if found.result.names else ()), "status")  # fmt: skip
    solved = sum(why == OK for why in found.result.why)
    heading = f"{found.setting.machine.name}, {found.setting.engine.label}: {found.setting.quantity}"
    verdict = f"{solved} of {len(found.result.why)} poses have an answer"
    shown = found.result.values[:, SHOWN[found.setting.quantity]]
    if np.isfinite(shown).any():
        low, high = (number(float(edge(shown[np.isfinite(shown)]))) for edge in (np.min, np.max))
        name, _, unit = what.partition(",")
        verdict += f"; {name} from {low} to {high}{unit}"
    words = [f"{each.difference.words}." for each in maps if each.difference is not None]
    words += [f"{title(each.setting.wrench)}: {line}." if several else f"{line}." for each in maps
              for line in worst_parts(each)]  # fmt: skip
    tables = [
        ReportTable(
            f"Every pose, {title(each.setting.wrench)}" if several else "Every pose", header, _rows(each), words=0
        )
        for each in maps
    ]
    return pages.Content(heading, f"{verdict}.", pictures, tables, words)


def _rows(found: Mapped) -> tuple[tuple[str, ...], ...]:
    from vjm_output.number_text import number

    joints = np.array([*found.result.joints.values()]).reshape(len(found.result.joints), len(found.result.why)).T
    names: Sequence[tuple[str, ...]] = found.result.names or [()] * len(found.result.why)
    return tuple(
        (*("∞" if np.isinf(v) else number(float(v)) for v in row), *words, why)
        for row, words, why in zip(
            np.hstack([joints, found.places, found.result.values]), names, found.result.why, strict=True
        )
    )


def _with_unit(column: str) -> str:
    """``kt_min_N_per_mm`` as ``kt_min, N/mm``."""
    for ending, unit in UNITS.items():
        if column.endswith(ending):
            return f"{column.removesuffix(ending)}, {unit}"
    return column
