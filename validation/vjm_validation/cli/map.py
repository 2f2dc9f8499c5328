"""The command ``validate map``."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import locked
from vjm.io.findings import Finding
from vjm.io.machine_file import load_model
from vjm.loaded_stiffness import held_by_itself
from vjm.plain_numbers import plain_number
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_updating.maps.difference import write_planes
from vjm_updating.maps.evaluate import MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.quantity import COLUMNS, OK, MapQuantity
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli import pages
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, acceleration, parsed_load
from vjm_validation.cli.map_result import Mapped, content, document, mapped, title, worst_parts
from vjm_validation.cli.options import Json
from vjm_validation.documents import MapsDocument
from vjm_validation.load_any_model import in_postures

INTERRUPTED = 130
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
REFINED = "vjm-4"
"""Springs a beam by default: critical loads of a pinned column within 1e-3, at a quarter of the cost of 16."""


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
    most: Annotated[float, Parameter(help="Largest force tried for a critical one, N.")] = 20_000.0,
    posture: Annotated[str, Parameter(help="What the grid leaves out; the first by default.")] = "",
    gravity: GravityOption = "",
    end: Annotated[str, Parameter(help="Of a tree: name of the end frame.")] = "",
    engine: Annotated[str, Parameter(help="vjm-<n> for n springs a beam; or any of `validate list`.")] = REFINED,
    against: Annotated[str, Parameter(help="Another engine: a map of the difference to it, in %.")] = "",
    jobs: Annotated[int, Parameter(help="Processes; one a core by default.")] = 0,
    scheduler: Annotated[str, Parameter(help="Address of a Dask scheduler instead, such as tcp://host:8786.")] = "",
    out: Annotated[Path | None, Parameter(help="Folder; a map that was cut off goes on there.")] = None,
    load: LoadOption = (),
    json: Json = False,
    plot: pages.Image = None,
    report: pages.Report = None,
    strict: Strict = False,
) -> int:
    """Map a quantity over a manipulator's workspace: CSV, VTK, a figure and a render."""
    target = load_model(model)
    solvers = [engine_by_name(name, EngineOptions(), target) for name in (engine, against) if name]
    if jobs < 0:
        raise ValueError(f"--jobs: must be at least 1, not {jobs}")
    if not 0.0 < most < np.inf:
        raise ValueError(f"--most: must be a positive force in N, not {most}")
    pages.check(plot, report, pages.IMAGES)
    folder = out or Path("reports") / "maps" / f"{target.name}-{quantity}-{time.strftime('%Y%m%d-%H%M%S')}"
    on_end = [*wrench] or [""]
    if against and quantity is MapQuantity.SHARES:
        raise ValueError("--against: a map of the shares names parts and has no difference in %; leave it out")
    if not held_by_itself(target):
        raise ValueError(
            f"{target.name}: its passive joints leave the end a mechanism, which has no map: give the whole machine"
        )
    machine, (label, *_) = in_postures(target, (posture,) if posture else ())
    doubts = considered(model, strict, weighed=bool(gravity) or quantity is MapQuantity.FREQUENCY)
    loads = tuple(parsed_load(text) for text in load)
    settings = [
        MapSetting(machine, solver, quantity, gravity=acceleration(gravity), loads=loads, end=end, most=most)
        for solver in solvers
    ]
    for setting in settings:
        setting.check()
    wrenches = [(0.0,) * 6 if not text and (gravity or load) else _wrench(text, quantity) for text in on_end]
    # any engine stands at the same coordinates
    wanted = parsed_grid(grid, settings[0].model)
    if wanted.read_as:
        terminal.error(f"note: {wanted.read_as}")
    points = points_of(settings[0].model, wanted, label, end)
    found: list[Mapped] = []
    files: list[Path] = []
    left_out: list[str] = []
    try:
        with locked(folder), terminal.progress(quiet=json) as progress:
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
                found.append(mapped(results[0], into, *results[1:]))
            if len(found) > 1:
                panels = [(title(each), one.result.values, one.result.names)
                          for each, one in zip(wrenches, found, strict=True)]  # fmt: skip
                files, left_out = write_planes(folder / "side-by-side.png", quantity, points.grid.ordered, panels)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: the same command with --out {folder} goes on"
        )
        return INTERRUPTED
    return _said(found, files, left_out, doubts, plot, report, json=json)


def _said(
    found: Sequence[Mapped], files: Sequence[Path], left_out: Sequence[str], doubts: Sequence[Finding],
    plot: Path | None, report: Path | None, *, json: bool,
) -> int:  # fmt: skip
    """What maps hold, in some lines or as a document."""
    if json:
        documents = [document(each, doubts) for each in found]
        sys.stdout.write(as_json(documents[0] if len(documents) == 1 else MapsDocument(maps=documents)))
        for line in (*(line for each in found for line in each.left_out), *left_out):
            terminal.error(line)
        pages.draw(plot, report, lambda: content(found, files), None)
        return 0
    console = terminal.console()
    for each in found:
        _print(each, console, under=title(each.setting.wrench) if len(found) > 1 else "")
    for line in (*map(str, files), *left_out):
        console.print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: content(found, files), console)
    sys.stdout.flush()
    return 0


def _print(found: Mapped, console: Console, under: str) -> None:
    solved = sum(each == OK for each in found.result.why)
    setting = found.setting
    what = f"{setting.machine.name}, {setting.engine.label}, {setting.quantity}{f' under {under}' if under else ''}"
    console.print(f"{what}: {solved} of {len(found.result.why)} poses", soft_wrap=True)
    for k, column in enumerate(COLUMNS[found.setting.quantity]):
        finite = found.result.values[np.isfinite(found.result.values[:, k]), k]
        if finite.size:
            console.print(f"  {column}: {finite.min():.6g} to {finite.max():.6g}", soft_wrap=True)
        rigid = int(np.isinf(found.result.values[:, k]).sum())
        if rigid:
            console.print(f"  {column}: infinite at {rigid} poses, where nothing deflects", soft_wrap=True)
    for line in worst_parts(found):
        console.print(f"  {line}", soft_wrap=True)
    if found.difference is not None:
        console.print(f"  {found.difference.words}", soft_wrap=True)
        for line in _reasons([each for each in found.difference.why if each not in found.result.why]):
            console.print(f"  {line}", soft_wrap=True)
    for line in _reasons(found.result.why):
        console.print(f"  {line}", soft_wrap=True)
    for line in (*map(str, found.files), *found.left_out):
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
