"""The command ``validate map``."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import locked
from vjm.io.findings import Finding
from vjm.io.machine_file import load_machine, load_model
from vjm.io.manipulator_file import KIND
from vjm.io.model_file import read_document
from vjm.loaded_stiffness import held_by_itself
from vjm.model.chain import Chain
from vjm.model.load_case import Load
from vjm.plain_numbers import plain_number
from vjm.platform.manipulator import Manipulator
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_updating.maps.arm_map import map_arm, write_arm_map
from vjm_updating.maps.by_engine import refuse
from vjm_updating.maps.difference import difference_of, write_difference, write_planes
from vjm_updating.maps.evaluate import COLUMNS, OK, PER_MACHINE, MapQuantity
from vjm_updating.maps.output import write_map
from vjm_updating.maps.pose_grid import Grid, parsed_grid
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli import pages
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, acceleration, parsed_load
from vjm_validation.cli.map_result import Mapped, content, document, title, worst_parts
from vjm_validation.cli.options import Json
from vjm_validation.documents import MapsDocument
from vjm_validation.load_any_model import in_postures

INTERRUPTED = 130
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
NOTHING: tuple[list[Path], list[str]] = [], []
"""Files that are written, and those left out, where there is no folder."""
REFINED = "vjm-4"
"""Springs a beam by default: critical loads of a pinned column within 1e-3, at a quarter of the cost of 16."""


def map_(
    model: Annotated[str, Parameter(help="A manipulator or an arm of the library, or a path to a file.")],
    *,
    grid: Annotated[
        str,
        Parameter(
            help="Points a side of the file's workspace, such as 21, or x=from:to:count,y=…,z=… in mm from home. "
            "Of an arm: the tool's place in the world, or joints by name, such as elbow=0:2:21.",
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
    for solver in solvers:
        if not isinstance(solver, VjmEngine):
            refuse(solver, quantity)
    if jobs < 0:
        raise ValueError(f"--jobs: must be at least 1, not {jobs}")
    if not 0.0 < most < np.inf:
        raise ValueError(f"--most: must be a positive force in N, not {most}")
    pages.check(plot, report, pages.IMAGES)
    folder = out or Path("reports") / "maps" / f"{target.name}-{quantity}-{time.strftime('%Y%m%d-%H%M%S')}"
    on_end = [*wrench] or [""]
    mapper: _OfArm | _OfPlatform
    if against and quantity is MapQuantity.SHARES:
        raise ValueError("--against: a map of the shares names parts and has no difference in %; leave it out")
    if isinstance(target, Manipulator) and quantity not in PER_MACHINE and not (posture or gravity or load or end):
        doubts = considered(model, strict)
        processes = jobs or len(os.sched_getaffinity(0))
        mapper = _OfPlatform(
            target, quantity, parsed_grid(grid, target), most, tuple(doubts), processes, scheduler, json
        )
        wrenches = [_wrench(text, quantity) for text in on_end]
    else:
        for option, given in (("--jobs", jobs > 1), ("--scheduler", scheduler)):
            if given:
                raise ValueError(
                    f"{option}: this map is computed in one process. Leave it out: several are for platforms "
                    "without --posture, --gravity, --load and --end"
                )
        machine = load_machine(model)
        if not held_by_itself(machine):
            raise ValueError(
                f"{machine.name}: is a single chain, which is a mechanism, and this needs a manipulator or an arm"
            )
        chain, (label, *_) = in_postures(machine, (posture,) if posture else ())
        doubts = considered(model, strict, weighed=bool(gravity) or quantity is MapQuantity.FREQUENCY)
        mapper = _OfArm(
            chain, quantity, grid, label, acceleration(gravity), [parsed_load(text) for text in load], end, most,
            *_workspace(model), json,
        )  # fmt: skip
        wrenches = [(0.0,) * 6 if not text and (gravity or load) else _wrench(text, quantity) for text in on_end]
    try:
        with locked(folder):
            found = [
                _of_wrench(mapper, solvers, each, folder if len(wrenches) == 1 else folder / f"wrench-{k}")
                for k, each in enumerate(wrenches, start=1)
            ]
            files: list[Path] = []
            left_out: list[str] = []
            if len(found) > 1:
                panels = [(title(each), one.values, one.names) for each, one in zip(wrenches, found, strict=True)]
                files, left_out = write_planes(folder / "side-by-side.png", quantity, found[0].axes, panels)
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: the same command with --out {folder} goes on"
        )
        return INTERRUPTED
    return _said(found, files, left_out, doubts, plot, report, json=json)


@dataclass(frozen=True)
class _OfArm:
    """What is asked of an arm, a tree or a machine with closed loops."""

    chain: Chain
    quantity: MapQuantity
    grid: str
    posture: str
    gravity: tuple[float, float, float] | None
    loads: Sequence[Load]
    end: str
    most: float
    workspace: Array | None
    from_home: bool
    quiet: bool

    def mapped(self, engine: Engine, wrench: tuple[float, ...], folder: Path | None) -> Mapped:
        """The map by an engine, and its files where a folder is given."""
        with terminal.progress(quiet=self.quiet) as progress:
            found = map_arm(
                self.chain, engine, self.quantity, self.grid, self.posture, wrench=wrench, gravity=self.gravity,
                loads=self.loads, end=self.end, most=self.most, workspace=self.workspace, from_home=self.from_home,
                progress=lambda done, total: progress("poses", done, total),
            )  # fmt: skip
        files, left_out = NOTHING if folder is None else write_arm_map(found, folder)
        joints = dict(zip(found.joints, found.q.T, strict=True))
        return Mapped(
            self.chain, engine.label, self.quantity, wrench, found.tool, found.values, found.why, files, left_out,
            found.grid.ordered, joints, names=found.names,
        )  # fmt: skip


@dataclass(frozen=True)
class _OfPlatform:
    """What is asked of a platform."""

    machine: Manipulator
    quantity: MapQuantity
    grid: Grid
    most: float
    doubts: tuple[Finding, ...]
    jobs: int
    scheduler: str
    quiet: bool

    def mapped(self, engine: Engine, wrench: tuple[float, ...], folder: Path | None) -> Mapped:
        """The map by an engine, and its files where a folder is given."""
        wanted = Map(self.machine, engine, self.quantity, self.grid, wrench, self.most, self.doubts)
        with ExitStack() as stack:
            kept = folder or Path(stack.enter_context(TemporaryDirectory()))
            progress = stack.enter_context(terminal.progress(quiet=self.quiet))
            result = run_map(
                wanted, kept, self.jobs, self.scheduler, lambda done, total: progress("poses", done, total)
            )
        files, left_out = NOTHING if folder is None else write_map(result, folder)
        places, axes = self.grid.poses()[:, :3], dict(zip("xyz", self.grid.axes, strict=True))
        return Mapped(
            self.machine, engine.label, self.quantity, wrench, places, result.values, result.why, files, left_out,
            axes,
        )  # fmt: skip


def _of_wrench(
    mapper: _OfArm | _OfPlatform, solvers: Sequence[Engine], wrench: tuple[float, ...], folder: Path
) -> Mapped:
    """The map by the first engine and, where there is a second, its difference to that."""
    first = mapper.mapped(solvers[0], wrench, folder)
    if len(solvers) == 1:
        return first
    second = mapper.mapped(solvers[1], wrench, None)
    apart = difference_of(
        (first.engine, second.engine), first.quantity, first.axes, first.places, (first.values, second.values),
        (first.why, second.why),
    )  # fmt: skip
    files, left_out = write_difference(apart, folder)
    return replace(first, files=[*first.files, *files], left_out=[*first.left_out, *left_out], difference=apart)


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
        _print(each, console, under=title(each.wrench) if len(found) > 1 else "")
    for line in (*map(str, files), *left_out):
        console.print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: content(found, files), console)
    sys.stdout.flush()
    return 0


def _print(found: Mapped, console: Console, under: str) -> None:
    solved = sum(each == OK for each in found.why)
    what = f"{found.machine.name}, {found.engine}, {found.quantity}{f' under {under}' if under else ''}"
    console.print(f"{what}: {solved} of {len(found.why)} poses", soft_wrap=True)
    for k, column in enumerate(COLUMNS[found.quantity]):
        finite = found.values[np.isfinite(found.values[:, k]), k]
        if finite.size:
            console.print(f"  {column}: {finite.min():.6g} to {finite.max():.6g}", soft_wrap=True)
        rigid = int(np.isinf(found.values[:, k]).sum())
        if rigid:
            console.print(f"  {column}: infinite at {rigid} poses, where nothing deflects", soft_wrap=True)
    for line in worst_parts(found):
        console.print(f"  {line}", soft_wrap=True)
    if found.difference is not None:
        console.print(f"  {found.difference.words}", soft_wrap=True)
        for line in _reasons([each for each in found.difference.why if each not in found.why]):
            console.print(f"  {line}", soft_wrap=True)
    for line in _reasons(found.why):
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


def _workspace(model: str) -> tuple[Array | None, bool]:
    """Corners ``(2, 3)`` of the workspace that a file states, mm, and whether its poses count from home."""
    content = read_document(model).content
    box = content.get("workspace")
    corners = None if box is None else np.array([box["min_mm"], box["max_mm"]])
    return corners, content.get("kind") == KIND


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
