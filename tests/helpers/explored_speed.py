"""How long `validate explore` takes from a slider to new numbers and a new drawing, without a browser.

OMP_NUM_THREADS=1 PYTHONPATH=tests .venv/bin/python -m helpers.explored_speed     # the table of docs/explore.md
"""

import time
from dataclasses import replace

import numpy as np

from vjm_validation.explore.drawing import MachineDrawing
from vjm_validation.explore.page import numbers
from vjm_validation.explore.state import ComparedMachine, Explorer, compared

MACHINES = ("ur10", "planar-2r", "palletiser", "orthoglide", "hexapod", "delta", "par2")
REPEATED = 9


def settings(explorer, what):
    """Settings of which one after the other is answered."""
    load = tuple(0.2 * each.high if k == 2 else 0.0 for k, each in enumerate(explorer.load))
    for k in range(REPEATED + 1):
        setting = replace(explorer.start, load=tuple(value * (1.0 + 0.05 * k) for value in load))
        if what != "load":
            moved = (
                each.value + 0.002 * (k + 1) * (each.high - each.low) * (1 if each.value <= 0.5 * each.high else -1)
                for each in explorer.coordinates
            )
            setting = replace(setting, coordinates=tuple(moved))
        if what == "size":
            size = next(each for each in explorer.sizes if not each.name.endswith("length_mm"))
            setting = replace(setting, sizes={size.name: size.value * (1.0 + 0.01 * (k + 1))})
        yield setting


def milliseconds(explorer, what):
    """Median processor time of an answer, drawing and words included; ``both``: of two machines under a load."""
    found, drawing = [], None
    beside = ComparedMachine(explorer.again(), "the same") if what == "both" else None
    what, other = "load" if beside else what, None
    for setting in settings(explorer, what):
        begun = time.process_time()
        answer = explorer.answer(setting)
        sections = explorer.files.with_numbers(setting.sizes).sections()
        drawing = MachineDrawing(answer.rest, answer.loaded, answer.modes, sections, drawing)
        for surface in drawing.surfaces.values():
            surface.at(drawing.points(10.0))
        numbers(answer, 10.0, 0.0)
        if beside:
            second = beside.answer(explorer, setting)
            other = MachineDrawing(second.rest, second.loaded, second.modes, beside.shapes, other)
            for surface in other.surfaces.values():
                surface.at(other.points(10.0))
            compared(("", ""), answer, second)
        found.append(1e3 * (time.process_time() - begun))
    return float(np.median(found[1:]))


def main():
    """Print the table."""
    print("| machine | load | posture | size | load of two machines |\n| --- | --- | --- | --- | --- |")
    for name in MACHINES:
        explorer = Explorer(name)
        row = " | ".join(f"{milliseconds(explorer, what):.0f}" for what in ("load", "posture", "size", "both"))
        print(f"| `{name}` | {row} |", flush=True)


if __name__ == "__main__":
    main()
