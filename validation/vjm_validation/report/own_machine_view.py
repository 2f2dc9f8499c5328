"""Pictures of a user's own machine in its postures, with its deflected shape."""

from __future__ import annotations

import numpy as np

from vjm.continuation.path import Path as LoadPath
from vjm.model.machine import Machine
from vjm_output.plot_style import Drawing, Picture
from vjm_validation.report.machine_geometry import geometry
from vjm_validation.report.machine_view import rendered
from vjm_validation.studies.own_machine_request import REFERENCE, OwnMachine

SHOWN_TURN = 0.1
"""Of the machine's size: largest deflection in a render."""


def machine_picture(found: OwnMachine, label: str) -> Picture:
    """The machine, and the shape of its largest deflection in the posture."""
    shown = geometry(found.drawn, label)
    paths = {
        key: path for key, path in found.paths.items() if key[0] == label and key[2] != REFERENCE and path.stations
    }
    moved, said = [], ""
    if paths:
        key, path = max(paths.items(), key=lambda item: _largest(item[1]))
        start, end = path.points[0].shape, path.points[-1].shape
        size = _largest(path)
        times = _nice(SHOWN_TURN * shown.extent / size) if size > 0.0 else 1.0
        moved = _polylines(found.machine, path, start + times * (end - start))
        said = f" In black, {times:g} times its size, the deflection under the load along {key[1]}."
    return Picture(
        f"machine_{file_name(label)}", Drawing(rendered(shown, moved)), f"Posture {label}",
        f"Beams blue, rigid links grey, joints that deflect orange, passive joints pink.{said}",
    )  # fmt: skip


def _polylines(machine: Machine, path: LoadPath, shape: np.ndarray) -> list[np.ndarray]:
    """The stations of a path as lines: along each part, from the last station of the part on which it begins."""
    rows: dict[str, list[int]] = {}
    for row, station in enumerate(path.stations):
        rows.setdefault(station.part, []).append(row)
    lines, last = [], dict[str, int]()
    for name, behind in machine.predecessors.items():
        own = rows.get(name, [])
        begun = [last[behind]] if behind in last else []
        if own:
            lines.append(shape[[*begun, *own]])
        if own or begun:
            last[name] = own[-1] if own else begun[0]
    return lines


def _largest(path: LoadPath) -> float:
    moved = path.points[-1].shape - path.points[0].shape
    return float(np.linalg.norm(moved, axis=1).max(initial=0.0))


def _nice(value: float) -> float:
    decade = 10.0 ** np.floor(np.log10(value))
    return max(1.0, float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= value)))


def file_name(label: str) -> str:
    """A posture's label as a part of a file's name."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in label)
