"""A quantity over the workspace of a machine, in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vjm.batch import Progress
from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.loaded_stiffness import held_by_itself
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.postures import Posture, in_posture
from vjm_updating.constants import numerical
from vjm_updating.maps.evaluate import MapQuantity, MapSetting
from vjm_updating.maps.grid import MapGrid, parsed_grid, points_of
from vjm_updating.maps.run import Map, MapResult, run_map

MOST_N = numerical(20_000.0)
"""Largest force tried for a critical one."""
REFINED = "vjm-4"
"""Springs a beam: critical loads of a pinned column within 1e-3, at a quarter of the cost of 16."""


def workspace_map(
    machine: Machine,
    grid: int | str | Mapping[str, Sequence[float] | float],
    quantity: MapQuantity | str = MapQuantity.STIFFNESS,
    *,
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    posture: Posture = "",
    end: str = "",
    most: float = MOST_N,
    engine: str | Engine = REFINED,
    jobs: int = 1,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> MapResult:
    """A quantity over places of the end, or over joints.

    Args:
        machine: see `vjm.load`.
        grid: values by the name of a joint, mm and rad, or by x, y and z of the end, mm; or how many points a side
            of the workspace that the machine names; or a text such as ``elbow=0:2:21,wrist=0.5``.
        quantity: ``stiffness``, ``critical``, ``deflection``, ``frequency`` or ``shares``.
        wrench: ``(6,)`` on the end, N and N mm.
        gravity: m/s².
        loads: on parts.
        posture: of what the grid leaves out; the first one if left out.
        end: name of the end frame; the first if left out.
        most: largest force that is tried for a critical one, N.
        engine: a word of `vjm.engine_by_name`, or an engine.
        jobs: processes.
        folder: where what is done is kept; a map of the same arguments goes on from there.
        progress: called with how many points are done, and of how many.

    Raises:
        ValueError: no such quantity, joint or posture, a load that the quantity needs is missing, or ``folder``
            holds another map.

    Example:
        >>> import vjm
        >>> from vjm_updating import workspace_map
        >>> found = workspace_map(vjm.load("planar-2r"), {"elbow": [0.5, 1.0]}, "frequency")
        >>> [f"{row['f1_Hz']:.2f} Hz" for row in found.table()]
        ['4.50 Hz', '4.94 Hz']
    """
    quantity = MapQuantity(quantity)
    check_mapped(machine)
    if wrench is not None and (len(wrench) != 6 or not np.all(np.isfinite(wrench))):
        raise ValueError(f"wrench must be six finite numbers, got {list(wrench)}")
    if (
        quantity in (MapQuantity.DEFLECTION, MapQuantity.SHARES)
        and wrench is None
        and gravity is None
        and not loads
    ):
        raise ValueError(f"a map of the {quantity} needs a load: give wrench, gravity or loads")
    if quantity is MapQuantity.CRITICAL and wrench is not None:
        raise ValueError("a map of critical forces looks at all directions itself: leave wrench out")
    machine, label = in_posture(machine, posture or next(iter(machine.postures)))
    solver = engine_by_name(engine, EngineOptions(), machine) if isinstance(engine, str) else engine
    on_end = tuple(float(value) for value in ((0.0,) * 6 if wrench is None else wrench))
    setting = MapSetting(machine, solver, quantity, on_end, gravity=gravity, loads=tuple(loads), end=end, most=most)
    setting.check()
    points = points_of(setting.model, _grid(grid, setting.model), label, end)
    return run_map(Map(setting, points), folder, jobs, "", progress)


def check_mapped(machine: Machine) -> None:
    """Refuse a machine that has no map.

    Raises:
        ValueError: its end is a mechanism.
    """
    if not held_by_itself(machine):
        raise ValueError(
            f"{machine.name}: its passive joints leave the end a mechanism, which has no map: "
            "give the whole machine"
        )


def _grid(grid: int | str | Mapping[str, Sequence[float] | float], model: Mechanism) -> MapGrid:
    if not isinstance(grid, Mapping):
        return parsed_grid(str(grid), model)
    # names are those of the text
    named = parsed_grid(",".join(f"{name}=0" for name in grid), model)
    values = [np.atleast_1d(np.array(given, dtype=float)) for given in grid.values()]
    if any(not len(each) or not np.all(np.isfinite(each)) or np.any(np.diff(each) <= 0.0) for each in values):
        raise ValueError("grid: values must be finite and run upwards")
    return replace(named, axes={name: tuple(own.tolist()) for name, own in zip(named.axes, values, strict=True)})
