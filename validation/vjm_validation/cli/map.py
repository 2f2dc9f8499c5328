"""The command ``validate map``."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import locked
from vjm.io.findings import Finding
from vjm.io.machine_file import load_model
from vjm.io.manipulator_file import load_manipulator
from vjm.loaded_stiffness import held_by_itself
from vjm.model.chain import Chain
from vjm.model.load_case import Load
from vjm.plain_numbers import plain_number
from vjm.platform.manipulator import Manipulator
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_output.documents import as_json, doubt_rows
from vjm_updating.maps.arm_map import map_arm, write_arm_map
from vjm_updating.maps.evaluate import COLUMNS, OK, SHOWN, TITLES, Quantity
from vjm_updating.maps.output import write_map
from vjm_updating.maps.pose_grid import parsed_grid
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli import pages
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.load_case_options import GravityOption, LoadOption, acceleration, parsed_load
from vjm_validation.cli.options import Json
from vjm_validation.documents import MapRowsDocument
from vjm_validation.load_any_model import in_postures

INTERRUPTED = 130
UNITS = {"_N_per_mm": "N/mm", "_Nmm_per_rad": "N mm/rad", "_mm": "mm", "_rad": "rad", "_N": "N"}
"""Endings of columns, the longer ones first."""
NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
REFINED = "vjm-4"
"""Springs a beam by default: critical loads of a pinned column within 1e-3, at a quarter of the cost of 16."""


def map_(
    model: Annotated[str, Parameter(help="A manipulator or an arm of the library, or a path to a file.")],
    *,
    grid: Annotated[
        str,
        Parameter(
            help="Points a side of the workspace, such as 21, or x=from:to:count,y=…,z=… in mm: from home; of an "
            "arm the tool's place in the world, or joints by name, such as elbow=0:2:21.",
        ),
    ] = "11",
    quantity: Annotated[Quantity, Parameter(help="stiffness, critical or deflection.")] = Quantity.STIFFNESS,
    wrench: Annotated[
        str,
        Parameter(help="fx,fy,fz,mx,my,mz on the platform, N and N mm."),
    ] = "",
    most: Annotated[float, Parameter(help="Largest force tried for a critical one, N.")] = 20_000.0,
    posture: Annotated[str, Parameter(help="Of an arm: what the grid leaves out; the first by default.")] = "",
    gravity: GravityOption = "",
    end: Annotated[str, Parameter(help="Of a tree: name of the end frame.")] = "",
    engine: Annotated[str, Parameter(help="vjm-<n> for n springs a beam, vjm, or vjm-paper.")] = REFINED,
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
    springs = engine_by_name(engine, EngineOptions(), target)
    if not isinstance(springs, VjmEngine):
        raise ValueError(f"--engine {engine}: maps are made with vjm, vjm-<n> or vjm-paper")
    if jobs < 0:
        raise ValueError(f"--jobs: must be at least 1, not {jobs}")
    if not 0.0 < most < np.inf:
        raise ValueError(f"--most: must be a positive force in N, not {most}")
    pages.check(plot, report, pages.IMAGES)
    folder = out or Path("reports") / "maps" / f"{target.name}-{quantity}-{time.strftime('%Y%m%d-%H%M%S')}"
    if isinstance(target, Chain):
        doubts = considered(model, strict, weighed=bool(gravity))
        loads = [parsed_load(text) for text in load]
        arm = _of_arm(
            target, springs, quantity, grid, posture, wrench, acceleration(gravity), loads, end, most, folder
        )
        return _said(arm, doubts, plot, report, json=json)
    if posture or gravity or load or end:
        raise ValueError("--posture, --gravity, --load and --end are for maps of arms: leave them out")
    machine = load_manipulator(model)
    doubts = considered(model, strict)
    wanted = Map(
        machine, springs, quantity, parsed_grid(grid, machine), _wrench(wrench, quantity), most, tuple(doubts)
    )
    try:
        with locked(folder), terminal.progress(quiet=json) as progress:
            result = run_map(
                wanted, folder, jobs or len(os.sched_getaffinity(0)), scheduler,
                lambda done, total: progress("poses", done, total),
            )  # fmt: skip
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: the same command with --out {folder} goes on"
        )
        return INTERRUPTED
    places = result.map.grid.poses()[:, :3]
    files, left_out = write_map(result, folder)
    found = Mapped(machine, springs.label, quantity, places, result.values, result.why, files, left_out)
    return _said(found, doubts, plot, report, json=json)


@dataclass(frozen=True)
class Mapped:
    """A map as it is shown.

    Attributes:
        machine: whose map it is.
        engine: label.
        quantity: what was asked.
        places: ``(g, 3)`` of the platform or tool, mm.
        values: ``(g, k)`` in the order of `COLUMNS`.
        why: ``ok``, or why there is no value.
        files: that were written.
        left_out: a line for each that was not, with the reason.
        joints: of an arm, ``(g,)`` coordinates of each.
    """

    machine: Chain | Manipulator
    engine: str
    quantity: Quantity
    places: np.ndarray
    values: np.ndarray
    why: Sequence[str]
    files: Sequence[Path]
    left_out: Sequence[str]
    joints: dict[str, np.ndarray] = field(default_factory=dict)


def _of_arm(
    chain: Chain,
    springs: VjmEngine,
    quantity: Quantity,
    grid: str,
    posture: str,
    wrench: str,
    gravity: tuple[float, float, float] | None,
    loads: Sequence[Load],
    end: str,
    most: float,
    folder: Path,
) -> Mapped:
    if not held_by_itself(chain):
        raise ValueError(f"{chain.name}: is a single chain that swings, and this needs a manipulator or an arm")
    chain, (label, *_) = in_postures(chain, (posture,) if posture else ())
    on_end = (0.0,) * 6 if not wrench and (gravity or loads) else _wrench(wrench, quantity)
    with locked(folder):
        found = map_arm(
            chain, springs, quantity, grid, label, wrench=on_end, gravity=gravity, loads=loads, end=end, most=most
        )
        files, left_out = write_arm_map(found, folder)
    joints = dict(zip(found.joints, found.q.T, strict=True))
    return Mapped(chain, springs.label, quantity, found.tool, found.values, found.why, files, left_out, joints)


def _said(found: Mapped, doubts: Sequence[Finding], plot: Path | None, report: Path | None, *, json: bool) -> int:
    """What a map holds, in some lines or as a document."""
    if json:
        sys.stdout.write(as_json(_document(found, doubts)))
        for line in found.left_out:
            terminal.error(line)
        pages.draw(plot, report, lambda: _content(found), None)
        return 0
    console = terminal.console()
    solved = sum(each == OK for each in found.why)
    console.print(
        f"{found.machine.name}, {found.engine}, {found.quantity}: {solved} of {len(found.why)} poses",
        soft_wrap=True,
    )
    for k, column in enumerate(COLUMNS[found.quantity]):
        finite = found.values[np.isfinite(found.values[:, k]), k]
        if finite.size:
            console.print(f"  {column}: {finite.min():.6g} to {finite.max():.6g}", soft_wrap=True)
        rigid = int(np.isinf(found.values[:, k]).sum())
        if rigid:
            console.print(f"  {column}: infinite at {rigid} poses, where nothing deflects", soft_wrap=True)
    for line in _reasons(found.why):
        console.print(f"  {line}", soft_wrap=True)
    for line in (*map(str, found.files), *found.left_out):
        console.print(line, soft_wrap=True)
    pages.draw(plot, report, lambda: _content(found), console)
    sys.stdout.flush()
    return 0


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


def _document(found: Mapped, doubts: Sequence[Finding]) -> MapRowsDocument:
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
        status=list(found.why),
        files=[str(file) for file in found.files],
        doubts=doubt_rows(doubts),
    )


def _content(found: Mapped) -> pages.Content:
    from vjm_output.number_text import number
    from vjm_output.plot_style import Drawing, Picture
    from vjm_validation.report.tables import Table

    titles = {"map.png": "The map", "render.png": "Planes through the middle of the workspace"}
    what = TITLES[found.quantity]
    caption = f"{what[:1].upper()}{what[1:]}; where there is none, nothing is drawn. One colour scale."
    pictures = [
        Picture(file.stem, Drawing(file.read_bytes()), titles[file.name], caption)
        for file in found.files
        if file.name in titles
    ]
    joints = np.array([*found.joints.values()]).reshape(len(found.joints), len(found.why)).T
    cells = np.hstack([joints, found.places, found.values])
    rows = [
        (*("∞" if np.isinf(v) else number(float(v)) for v in row), why)
        for row, why in zip(cells, found.why, strict=True)
    ]
    header = (*found.joints, "x, mm", "y, mm", "z, mm", *map(_with_unit, COLUMNS[found.quantity]), "status")
    solved = sum(why == OK for why in found.why)
    title = f"{found.machine.name}, {found.engine}: {found.quantity}"
    verdict = f"{solved} of {len(found.why)} poses have an answer"
    shown = found.values[:, SHOWN[found.quantity]]
    if np.isfinite(shown).any():
        low, high = (number(float(edge(shown[np.isfinite(shown)]))) for edge in (np.min, np.max))
        verdict += f"; {what.replace(',', f' from {low} to {high}', 1)}"
    return pages.Content(title, f"{verdict}.", pictures, [Table("Every pose", header, tuple(rows), words=0)])


def _with_unit(column: str) -> str:
    """``kt_min_N_per_mm`` as ``kt_min, N/mm``."""
    for ending, unit in UNITS.items():
        if column.endswith(ending):
            return f"{column.removesuffix(ending)}, {unit}"
    return column


def _wrench(text: str, quantity: Quantity) -> tuple[float, ...]:
    if not text:
        if quantity is Quantity.DEFLECTION:
            raise ValueError("--wrench: a map of the deflection needs one, fx,fy,fz,mx,my,mz in N and N mm")
        return (0.0,) * 6
    if quantity is Quantity.CRITICAL:
        raise ValueError("--wrench: a map of critical forces looks at all directions itself; leave it out")
    try:
        numbers = [plain_number(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"--wrench: '{text}' is not three or six finite numbers separated by commas")
    return (*numbers, *[0.0] * (6 - len(numbers)))
