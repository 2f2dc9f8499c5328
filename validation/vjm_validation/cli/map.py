"""The command ``validate map``."""

from __future__ import annotations

import os
import re
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import locked
from vjm.io.findings import Finding
from vjm.io.machine_file import load_model
from vjm.plain_numbers import plain_number
from vjm_output import terminal
from vjm_output.number_text import number
from vjm_updating.maps.evaluate import COLUMNS, NAMES, OK, SHOWN, TITLES, MapQuantity, MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.output import Difference, write_difference, write_map, write_planes
from vjm_updating.maps.run import MOST_N, REFINED, Map, MapResult, check_mapped, run_map
from vjm_validation.cli import INTERRUPTED
from vjm_validation.cli.options import (
    NO_LOADS,
    ActingLoads,
    beyond_calibration,
    considered,
)
from vjm_validation.cli.pages import IMAGE_OUTPUT, ImageOutput
from vjm_validation.design_documents import map_document
from vjm_validation.documents import MapsDocument
from vjm_validation.load_any_model import in_postures
from vjm_validation.page_content import Content, ReportTable

if TYPE_CHECKING:
    from vjm_output.plots import Picture

# --- What ``validate map`` found, as a document and as a page -----------------------------------------------------

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
    apart = Difference(result, second)
    more, missing = write_difference(apart, folder)
    return Mapped(result, [*files, *more], [*left_out, *missing], apart)


def title(wrench: Sequence[float]) -> str:
    """A wrench in words; its force alone where it has no moment."""
    return ", ".join(f"{v:g}" for v in (wrench if any(wrench[3:]) else wrench[:3])) + " N"


def worst_parts(mapped: Mapped) -> list[str]:
    """A line for each part that has the largest share somewhere, those with the most poses first."""
    counts = Counter(f"{part} ({kind})" for part, kind in mapped.result.names if part)
    lines = []
    for name, count in counts.most_common():
        own = [f"{part} ({kind})" == name for part, kind in mapped.result.names]
        low, high = (edge(mapped.result.values[own, 0]) for edge in (np.min, np.max))
        lines.append(f"{name} has the largest share at {count} poses: {low:.1%} to {high:.1%}")
    return lines


def content(maps: Sequence[Mapped], files: Sequence[Path]) -> Content:
    """The page of maps.

    Args:
        maps: one a wrench.
        files: that show all of them.
    """
    first, several = maps[0], len(maps) > 1
    what = TITLES[first.setting.quantity]

    def draw() -> list[Picture]:
        from vjm_output.plots import Drawing, Picture

        titles = {
            "map.png": "The map", "render.png": "Planes through the middle of the workspace",
            "difference.png": "Difference of two engines", "side-by-side.png": "One map for each wrench",
        }  # fmt: skip
        scale = "A colour for each part" if first.setting.quantity is MapQuantity.SHARES else "One colour scale"
        caption = f"{what[:1].upper()}{what[1:]}; where there is none, nothing is drawn. {scale}."
        own = [
            Picture(f"{file.parent.name}-{file.stem}" if several else file.stem, Drawing(file.read_bytes()),
                    titles[file.name], f"{title(each.setting.wrench)}. {caption}" if several else caption)
            for each in maps
            for file in each.files
            if file.name in titles
        ]  # fmt: skip
        return [
            *(Picture(file.stem, Drawing(file.read_bytes()), titles[file.name], caption) for file in files),
            *own,
        ]

    header = (*first.result.joints, "x, mm", "y, mm", "z, mm", *map(_with_unit, COLUMNS[first.setting.quantity]),
              *(NAMES if first.result.names else ()), "status")  # fmt: skip
    solved = sum(why == OK for why in first.result.why)
    heading = f"{first.setting.machine.name}, {first.setting.engine.label}: {first.setting.quantity}"
    verdict = f"{solved} of {len(first.result.why)} poses have an answer"
    shown = first.result.values[:, SHOWN[first.setting.quantity]]
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
    return Content(heading, [f"{verdict}.", *words], tables, draw)


def _rows(mapped: Mapped) -> tuple[tuple[str, ...], ...]:
    joints = np.array([*mapped.result.joints.values()]).reshape(len(mapped.result.joints), len(mapped.result.why)).T
    names: Sequence[tuple[str, ...]] = mapped.result.names or [()] * len(mapped.result.why)
    return tuple(
        (*("∞" if np.isinf(v) else number(float(v)) for v in row), *words, why)
        for row, words, why in zip(
            np.hstack([joints, mapped.places, mapped.result.values]), names, mapped.result.why, strict=True
        )
    )


def _with_unit(column: str) -> str:
    """``kt_min_N_per_mm`` as ``kt_min, N/mm``."""
    for ending, unit in UNITS.items():
        if column.endswith(ending):
            return f"{column.removesuffix(ending)}, {unit}"
    return column


# ------------------------------------------------------------------------------------------------------------------
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")


def map_(
    model: Annotated[str, Parameter(help="A manipulator or an arm of the library, or a path to a file.")],
    *,
    grid: Annotated[
        str,
        Parameter(
            help="Points a side of the file's workspace, such as 21, or x=from:to:count,y=…,z=… in mm from home. "
            "Of an arm: the tool's place in the world, or joints by name, such as elbow=0:2:21. "
            "Where a joint is called x: tool.x or joint.x.",
        ),
    ] = "11",
    quantity: Annotated[
        MapQuantity, Parameter(help="stiffness, critical, deflection, frequency or shares.")
    ] = MapQuantity.STIFFNESS,
    wrench: Annotated[
        tuple[str, ...],
        Parameter(
            allow_leading_hyphen=True,
            help="fx,fy,fz,mx,my,mz on the platform or the end, N and N mm. Given more than once, a map of each, "
            "side by side, such as --wrench 100,0,0 --wrench 0,100,0 --wrench 0,0,100.",
        ),
    ] = (),
    most: Annotated[float, Parameter(help="Largest force tried for a critical one, N.")] = MOST_N,
    posture: Annotated[str, Parameter(help="What the grid leaves out; the first by default.")] = "",
    acting: ActingLoads = NO_LOADS,
    end: Annotated[str, Parameter(help="Of a tree: name of the end frame.")] = "",
    engine: Annotated[str, Parameter(help="vjm-<n> for n springs a beam; or any of `validate list`.")] = REFINED,
    against: Annotated[str, Parameter(help="Another engine: a map of the difference to it, in %.")] = "",
    jobs: Annotated[int, Parameter(help="Processes; one a core by default.")] = 0,
    scheduler: Annotated[str, Parameter(help="Address of a Dask scheduler instead, such as tcp://host:8786.")] = "",
    out: Annotated[Path | None, Parameter(help="Folder; a map that was cut off goes on there.")] = None,
    output: ImageOutput = IMAGE_OUTPUT,
) -> int:
    """Map a quantity over a manipulator's workspace: CSV, VTK, a figure and a render."""
    target = load_model(model)
    solvers = [engine_by_name(name, EngineOptions(), target) for name in (engine, against) if name]
    if jobs < 0:
        raise ValueError(f"--jobs: must be at least 1, not {jobs}")
    if not 0.0 < most < np.inf:
        raise ValueError(f"--most: must be a positive force in N, not {most}")
    output.check()
    folder = out or Path("reports") / "maps" / f"{target.name}-{quantity}-{time.strftime('%Y%m%d-%H%M%S')}"
    on_end = [*wrench] or [""]
    if against and quantity is MapQuantity.SHARES:
        raise ValueError("--against: a map of the shares names parts and has no difference in %; leave it out")
    check_mapped(target)
    machine, (label, *_) = in_postures(target, (posture,) if posture else ())
    doubts = considered(model, output.strict, weighed=bool(acting.gravity) or quantity is MapQuantity.FREQUENCY)
    loads = tuple(acting.parsed)
    settings = [
        MapSetting(machine, solver, quantity, gravity=acting.acceleration, loads=loads, end=end, most=most)
        for solver in solvers
    ]
    for setting in settings:
        setting.check()
    wrenches = [(0.0,) * 6 if not text and acting != NO_LOADS else _wrench(text, quantity) for text in on_end]
    # any engine stands at the same coordinates
    wanted = parsed_grid(grid, settings[0].model)
    if wanted.read_as:
        terminal.error(f"note: {wanted.read_as}")
    points = points_of(settings[0].model, wanted, label, end)
    doubts += beyond_calibration(
        machine, dict(zip(settings[0].model.joints, points.q.T, strict=True)), output.strict
    )
    maps: list[Mapped] = []
    files: list[Path] = []
    left_out: list[str] = []
    try:
        with locked(folder), terminal.progress(quiet=output.json) as progress:
            for k, each in enumerate(wrenches, start=1):
                into = folder if len(wrenches) == 1 else folder / f"wrench-{k}"
                results = [
                    run_map(
                        Map(replace(setting, wrench=each), points, tuple(doubts)), into / name,
                        jobs or len(os.sched_getaffinity(0)), scheduler,
                        lambda done, total: progress("poses", done, total),
                    )
                    for setting, name in zip(settings, ("", "against"), strict=False)
                ]  # fmt: skip
                maps.append(mapped(results[0], into, *results[1:]))
            if len(maps) > 1:
                panels = [(title(each), one.result.values, one.result.names)
                          for each, one in zip(wrenches, maps, strict=True)]  # fmt: skip
                files, left_out = write_planes(folder / "side-by-side.png", quantity, points.grid.ordered, panels)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: the same command with --out {folder} goes on"
        )
        return INTERRUPTED
    return _said(maps, files, left_out, doubts, acting, output)


def _said(
    maps: Sequence[Mapped], files: Sequence[Path], left_out: Sequence[str], doubts: Sequence[Finding],
    acting: ActingLoads, output: ImageOutput,
) -> int:  # fmt: skip
    """What maps hold, in some lines or as a document."""

    def told(console: Console) -> None:
        for each in maps:
            _print(each, console, under=title(each.setting.wrench) if len(maps) > 1 else "")
        for line in (*map(str, files), *left_out):
            console.print(line, soft_wrap=True)

    documents = []
    for each in maps:
        on_end = ",".join(f"{v:g}" for v in each.setting.wrench) if any(each.setting.wrench) else None
        one = map_document(each.result, each.difference, each.files, doubts)
        documents.append(one.model_copy(update={"loads": acting.words(on_end)}))
    whole = documents[0] if len(documents) == 1 else MapsDocument(maps=documents)
    output.show(whole, lambda: content(maps, files), told)
    if output.json:
        for line in (*(line for each in maps for line in each.left_out), *left_out):
            terminal.error(line)
    return 0


def _print(mapped: Mapped, console: Console, under: str) -> None:
    solved = sum(each == OK for each in mapped.result.why)
    setting = mapped.setting
    what = f"{setting.machine.name}, {setting.engine.label}, {setting.quantity}{f' under {under}' if under else ''}"
    console.print(f"{what}: {solved} of {len(mapped.result.why)} poses", soft_wrap=True)
    for k, column in enumerate(COLUMNS[mapped.setting.quantity]):
        finite = mapped.result.values[np.isfinite(mapped.result.values[:, k]), k]
        if finite.size:
            console.print(f"  {column}: {finite.min():.6g} to {finite.max():.6g}", soft_wrap=True)
        rigid = int(np.isinf(mapped.result.values[:, k]).sum())
        if rigid:
            console.print(f"  {column}: infinite at {rigid} poses, where nothing deflects", soft_wrap=True)
    for line in worst_parts(mapped):
        console.print(f"  {line}", soft_wrap=True)
    if mapped.difference is not None:
        console.print(f"  {mapped.difference.words}", soft_wrap=True)
        for line in _reasons([each for each in mapped.difference.why if each not in mapped.result.why]):
            console.print(f"  {line}", soft_wrap=True)
    for line in _reasons(mapped.result.why):
        console.print(f"  {line}", soft_wrap=True)
    for line in (*map(str, mapped.files), *mapped.left_out):
        console.print(line, soft_wrap=True)


def _reasons(why: Sequence[str]) -> list[str]:
    """Why poses have no value, a line for each kind of reason: those that differ in their numbers are one."""
    kinds: dict[str, list[str]] = {}
    for each in why:
        if each != OK:
            kinds.setdefault(NUMBER.sub("", each), []).append(each)
    lines = []
    for reasons in kinds.values():
        like = "" if len(set(reasons)) == 1 else " (the first; each is in the file)"
        lines.append(f"{len(reasons)} poses: {reasons[0]}{like}")
    return lines


def _wrench(text: str, quantity: MapQuantity) -> tuple[float, ...]:
    if not text:
        if quantity in (MapQuantity.DEFLECTION, MapQuantity.SHARES):
            raise ValueError(f"--wrench: a map of the {quantity} needs one, fx,fy,fz,mx,my,mz in N and N mm")
        return (0.0,) * 6
    if quantity is MapQuantity.CRITICAL:
        raise ValueError("--wrench: a map of critical forces looks at all directions itself; leave it out")
    try:
        numbers = [plain_number(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"--wrench: '{text}' is not three or six finite numbers separated by commas")
    return (*numbers, *[0.0] * (6 - len(numbers)))
