"""Where a simulated test takes its readings: ramps out, held and back in each posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import EventKind
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.experiment import SHORT_OF, out_and_back
from vjm_updating.experiment import Readings
from vjm_updating.experiment.channels import POSE, TEMPERATURE, TIME, WRENCH, split_point
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.experiment.source import SheetError

INTERVAL, ROOM = numerical(10.0), numerical(20.0)
"""Seconds between two readings, and the temperature, °C, at which all of them are taken."""


@dataclass(frozen=True)
class PlannedRamp:
    """One way out and back.

    Attributes:
        posture: label.
        axis: component that is driven, of the displacement or under force control of the load.
        end: of the ramp, mm or rad; N or N mm.
    """

    posture: str
    axis: str
    end: float

    def channel(self, sheet: Sheet) -> str:
        """The column that is driven."""
        return (WRENCH if sheet.test.by_force else POSE)[COMPONENTS.index(self.axis)]


def parsed_ramp(text: str) -> PlannedRamp:
    """A ramp as ``POSTURE:END`` along x or ``POSTURE:AXIS:END``.

    Raises:
        ValueError: it is none; one line.
    """
    posture, *axis, end = text.split(":") if text.count(":") in (1, 2) else ["", "", ""]
    name = axis[0] if axis else "x"
    try:
        if not posture or name not in COMPONENTS or not 0.0 < abs(float(end)) < float("inf"):
            raise ValueError
    except ValueError:
        raise ValueError(
            f"--ramp: '{text}' is no ramp: write POSTURE:END or POSTURE:AXIS:END, such as A:-2 or B:y:0.5"
        ) from None
    return PlannedRamp(posture, name, float(end))


def usual_ramps(chain: Machine, engine: VjmEngine, labels: Sequence[str]) -> list[PlannedRamp]:
    """Every posture pulled and pushed along x, short of where the nominal machine turns critical."""
    return [
        PlannedRamp(label, COMPONENTS[0], _safe_end(chain, engine, label, direction))
        for label in labels
        for direction in Direction
    ]


def _safe_end(chain: Machine, engine: VjmEngine, posture: str, direction: Direction) -> float:
    end = ramp_end(chain, posture, direction)
    path = engine.trace(chain, LoadCase(posture, end))
    sharp = [event.s for event in path.events if event.kind is not EventKind.STIFFNESS_KNEE]
    reached = min([abs(end), *(SHORT_OF * s for s in sharp), *([] if path.complete else [SHORT_OF * path.s[-1]])])
    return round(direction.sign * float(reached), 4)


def planned_readings(sheet: Sheet, ramps: Sequence[PlannedRamp]) -> Readings:
    """The readings' places, in the order of time; wrench channels zero.

    Raises:
        SheetError: an instrument cannot be simulated, or one that is needed is missing.
    """
    by_force = sheet.test.by_force
    for name, known in sheet.instrument.items():
        if known.held or (split_point(name)[0] and not by_force):
            raise SheetError(
                f"{sheet.file}: [instrument.{name}]: only instruments at the end-effector can be simulated, at a "
                "point only under force control, and none that stops at marks. Leave it out"
            )
    for ramp in ramps:
        sheet.sigma(ramp.channel(sheet))
    imposed, read = (WRENCH, POSE) if by_force else (POSE, WRENCH)
    if not any(split_point(name)[1] in read for name in sheet.instrument):
        raise SheetError(
            f"{sheet.file}: {'no displacement' if by_force else 'no force'} is read: add "
            f"[instrument.{'uz_mm' if by_force else 'fx_N'}] with its noise"
        )
    ways = [out_and_back(ramp.end) for ramp in ramps]
    n = sum(len(way) for way in ways)
    driven = {name: np.zeros(n) for name in imposed if name in sheet.instrument}
    begin = 0
    for ramp, way in zip(ramps, ways, strict=True):
        driven[ramp.channel(sheet)][begin : begin + len(way)] = way
        begin += len(way)
    values: dict[str, Array] = {TIME: INTERVAL * np.arange(n, dtype=float), **driven}
    values |= {name: np.zeros(n) for name in sheet.instrument if split_point(name)[1] in read}
    if TEMPERATURE in sheet.instrument:
        values[TEMPERATURE] = np.full(n, ROOM)
    labels, numbers = [], []
    for number, (ramp, way) in enumerate(zip(ramps, ways, strict=True), 1):
        labels += [ramp.posture] * len(way)
        numbers += [number] * len(way)
    return Readings("simulated.csv", np.arange(2, n + 2), np.array(labels), np.array(numbers), values)
