"""What ``validate map`` found, as a document and as a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.io.findings import Finding
from vjm.model.chain import Chain
from vjm.platform.manipulator import Manipulator
from vjm_output.documents import doubt_rows
from vjm_updating.maps.difference import Difference
from vjm_updating.maps.evaluate import COLUMNS, NAMES, OK, SHOWN, TITLES, MapQuantity
from vjm_validation.cli import pages
from vjm_validation.documents import MapRowsDocument

UNITS = {"_N_per_mm": "N/mm", "_Nmm_per_rad": "N mm/rad", "_mm": "mm", "_rad": "rad", "_N": "N", "_Hz": "Hz"}
"""Endings of columns, the longer ones first."""


@dataclass(frozen=True)
class Mapped:
    """A map as it is shown.

    Attributes:
        machine: whose map it is.
        engine: label.
        quantity: what was asked.
        wrench: ``(6,)`` N, N mm.
        places: ``(g, 3)`` of the platform or tool, mm.
        values: ``(g, k)`` in the order of `COLUMNS`.
        why: ``ok``, or why there is no value.
        files: that were written.
        left_out: a line for each that was not, with the reason.
        axes: of the grid by name, in the order of the poses.
        joints: of an arm, ``(g,)`` coordinates of each.
        difference: to another engine, where one is asked for.
        names: of a map of the shares, g times the part and the kind.
    """

    machine: Chain | Manipulator
    engine: str
    quantity: MapQuantity
    wrench: tuple[float, ...]
    places: np.ndarray
    values: np.ndarray
    why: Sequence[str]
    files: Sequence[Path]
    left_out: Sequence[str]
    axes: Mapping[str, Sequence[float]]
    joints: dict[str, np.ndarray] = field(default_factory=dict)
    difference: Difference | None = None
    names: Sequence[tuple[str, str]] = ()


def title(wrench: Sequence[float]) -> str:
    """A wrench in words; its force alone where it has no moment."""
    return ", ".join(f"{v:g}" for v in (wrench if any(wrench[3:]) else wrench[:3])) + " N"


def worst_parts(found: Mapped) -> list[str]:
    """A line for each part that has the largest share somewhere, those with the most poses first."""
    counts = Counter(f"{part} ({kind})" for part, kind in found.names if part)
    lines = []
    for name, count in counts.most_common():
        own = [f"{part} ({kind})" == name for part, kind in found.names]
        low, high = (edge(found.values[own, 0]) for edge in (np.min, np.max))
        lines.append(f"{name} has the largest share at {count} poses: {low:.1%} to {high:.1%}")
    return lines


def document(found: Mapped, doubts: Sequence[Finding]) -> MapRowsDocument:
    """What is printed of one map."""

    def numbers(values: np.ndarray) -> list[float | None]:
        return [float(v) if np.isfinite(v) else None for v in values]

    return MapRowsDocument(
        model=found.machine.name,
        model_sha256=found.machine.sha256,
        version=__version__,
        engine=found.engine,
        quantity=str(found.quantity),
        columns=list(COLUMNS[found.quantity]),
        places_mm=[numbers(row) for row in found.places],
        joints={name: numbers(values) for name, values in found.joints.items()},
        values=[numbers(row) for row in found.values],
        parts=[part for part, _ in found.names],
        kinds=[kind for _, kind in found.names],
        status=list(found.why),
        wrench=list(found.wrench),
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
    what = TITLES[found.quantity]
    scale = "A colour for each part" if found.quantity is MapQuantity.SHARES else "One colour scale"
    caption = f"{what[:1].upper()}{what[1:]}; where there is none, nothing is drawn. {scale}."
    pictures = [
        Picture(f"{file.parent.name}-{file.stem}" if several else file.stem, Drawing(file.read_bytes()),
                titles[file.name], f"{title(each.wrench)}. {caption}" if several else caption)
        for each in maps
        for file in each.files
        if file.name in titles
    ]  # fmt: skip
    pictures = [*(Picture(file.stem, Drawing(file.read_bytes()), titles[file.name], caption) for file in files),
                *pictures]  # fmt: skip
    header = (*found.joints, "x, mm", "y, mm", "z, mm", *map(_with_unit, COLUMNS[found.quantity]),
              *(NAMES if found.names else ()), "status")  # fmt: skip
    solved = sum(why == OK for why in found.why)
    heading = f"{found.machine.name}, {found.engine}: {found.quantity}"
    verdict = f"{solved} of {len(found.why)} poses have an answer"
    shown = found.values[:, SHOWN[found.quantity]]
    if np.isfinite(shown).any():
        low, high = (number(float(edge(shown[np.isfinite(shown)]))) for edge in (np.min, np.max))
        name, _, unit = what.partition(",")
        verdict += f"; {name} from {low} to {high}{unit}"
    words = [f"{each.difference.words}." for each in maps if each.difference is not None]
    words += [f"{title(each.wrench)}: {line}." if several else f"{line}." for each in maps
              for line in worst_parts(each)]  # fmt: skip
    tables = [
        ReportTable(f"Every pose, {title(each.wrench)}" if several else "Every pose", header, _rows(each), words=0)
        for each in maps
    ]
    return pages.Content(heading, f"{verdict}.", pictures, tables, words)


def _rows(found: Mapped) -> tuple[tuple[str, ...], ...]:
    from vjm_output.number_text import number

    joints = np.array([*found.joints.values()]).reshape(len(found.joints), len(found.why)).T
    names: Sequence[tuple[str, ...]] = found.names or [()] * len(found.why)
    return tuple(
        (*("∞" if np.isinf(v) else number(float(v)) for v in row), *words, why)
        for row, words, why in zip(np.hstack([joints, found.places, found.values]), names, found.why, strict=True)
    )


def _with_unit(column: str) -> str:
    """``kt_min_N_per_mm`` as ``kt_min, N/mm``."""
    for ending, unit in UNITS.items():
        if column.endswith(ending):
            return f"{column.removesuffix(ending)}, {unit}"
    return column
