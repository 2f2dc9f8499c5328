"""The command ``validate map``."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.engines import EngineOptions, engine_by_name
from vjm.io.files import locked
from vjm.io.manipulator_file import load_manipulator
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal
from vjm_updating.maps.evaluate import COLUMNS, OK, Quantity
from vjm_updating.maps.output import write_map
from vjm_updating.maps.pose_grid import parsed_grid
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli.doubts import Strict, considered

INTERRUPTED = 130


def map_(
    model: Annotated[str, Parameter(help="A manipulator of the library, or a path to a file.")],
    *,
    grid: Annotated[
        str,
        Parameter(
            allow_leading_hyphen=True,
            help="Points a side of the model's workspace, such as 21, or x=from:to:count,y=…,z=… in mm from home.",
        ),
    ] = "11",
    quantity: Annotated[Quantity, Parameter(help="stiffness, critical or deflection.")] = Quantity.STIFFNESS,
    wrench: Annotated[
        str,
        Parameter(allow_leading_hyphen=True, help="fx,fy,fz,mx,my,mz on the platform, N and N mm."),
    ] = "",
    most: Annotated[float, Parameter(help="Largest force tried for a critical one, N.")] = 20_000.0,
    engine: Annotated[str, Parameter(help="vjm-paper, or vjm-<n> for refined chains.")] = "vjm-paper",
    jobs: Annotated[int, Parameter(help="Processes; one a core by default.")] = 0,
    scheduler: Annotated[str, Parameter(help="Address of a Dask scheduler instead, such as tcp://host:8786.")] = "",
    out: Annotated[Path | None, Parameter(help="Folder; a map that was cut off goes on there.")] = None,
    strict: Strict = False,
) -> int:
    """Map a quantity over a manipulator's workspace: CSV, VTK, a figure and a render."""
    springs = engine_by_name(engine, EngineOptions())
    if not isinstance(springs, VjmEngine):
        raise ValueError(f"--engine {engine}: maps are made with vjm-paper or vjm-<n>f<m>")
    if jobs < 0:
        raise ValueError(f"--jobs: must be at least 1, not {jobs}")
    if not 0.0 < most < np.inf:
        raise ValueError(f"--most: must be a positive force in N, not {most}")
    machine = load_manipulator(model)
    considered(model, strict)
    wanted = Map(machine, springs, quantity, parsed_grid(grid, machine), _wrench(wrench, quantity), most)
    folder = out or Path("reports") / "maps" / f"{machine.name}-{quantity}-{time.strftime('%Y%m%d-%H%M%S')}"
    try:
        with locked(folder), terminal.progress() as progress:
            result = run_map(
                wanted, folder, jobs or len(os.sched_getaffinity(0)), scheduler,
                lambda done, total: progress("poses", done, total),
            )  # fmt: skip
    except KeyboardInterrupt:
        terminal.error(
            f"interrupted; what is finished is in {folder}: the same command with --out {folder} goes on"
        )
        return INTERRUPTED
    console = terminal.console()
    solved = [why == OK for why in result.why]
    console.print(
        f"{machine.name}, {springs.label}, {quantity}: {sum(solved)} of {len(solved)} poses", soft_wrap=True
    )
    for k, name in enumerate(COLUMNS[quantity]):
        values = result.values[np.isfinite(result.values[:, k]), k]
        if values.size:
            console.print(f"  {name}: {values.min():.6g} to {values.max():.6g}", soft_wrap=True)
    reasons = [why for why in result.why if why != OK]
    for why in list(dict.fromkeys(reasons))[:5]:
        console.print(f"  {reasons.count(why)} poses: {why}", soft_wrap=True)
    for file in write_map(result, folder):
        console.print(f"{file}", soft_wrap=True)
    sys.stdout.flush()
    return 0


def _wrench(text: str, quantity: Quantity) -> tuple[float, ...]:
    if not text:
        if quantity is Quantity.DEFLECTION:
            raise ValueError("--wrench: a map of the deflection needs one, fx,fy,fz,mx,my,mz in N and N mm")
        return (0.0,) * 6
    if quantity is Quantity.CRITICAL:
        raise ValueError("--wrench: a map of critical forces looks at all directions itself; leave it out")
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"--wrench: '{text}' is not three or six finite numbers separated by commas")
    return (*numbers, *[0.0] * (6 - len(numbers)))
