"""A machine made in Python whose numbers vary: of a function that makes it, or of the numbers of its parts."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from vjm.io.catalogues import Row
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.file_parameters import MachineFiles, Numbered, parameter_of, unit_of_key
from vjm.io.model_file import Model
from vjm.io.shapes import shape
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.postures import assembled, in_posture

Made: TypeAlias = Machine | Callable[..., Machine]
PART_UNITS = {
    "length": "mm", "EA": "N", "GAy": "N", "GAz": "N", "GJ": "N mm²", "EIy": "N mm²", "EIz": "N mm²",
    "own_mass": "kg", "end_offset": "mm", "bow": "mm", "stiffness": "N/mm", "free_length": "mm", "centre": "mm",
}  # fmt: skip
"""Of the attributes of parts."""
NOT_VARIED = ("value", "limits")
"""Attributes of joints by which nothing becomes softer or heavier."""


Designed: TypeAlias = Model | Made | Numbered
"""A model file, what it holds, a machine, or a function of numbers that makes one."""


@dataclass(frozen=True)
class MachineMaker:
    """A machine made in Python.

    Attributes:
        name: of the machine.
        make: makes it of its numbers, by keyword.
        values: numbers, and rows of catalogues, by key.
        unit_of: unit of a number by its key.

    Example:
        >>> import vjm
        >>> maker = maker_of(vjm.load("planar-2r"))
        >>> maker.number("upper.length"), maker.unit("upper.length")
        (500.0, 'mm')
        >>> maker.with_numbers({"upper.length": 600.0}).machine().beams[0].length
        600.0
    """

    name: str
    make: Callable[..., Machine]
    values: Mapping[str, float | Row]
    unit_of: Callable[[str], str] = unit_of_key

    def keys(self) -> list[str]:
        """Keys of the numbers, but zeros."""
        return [key for key, value in self.values.items() if not isinstance(value, Mapping) and value]

    def unit(self, key: str) -> str:
        """Of a number; empty for none."""
        return self.unit_of(key)

    def number(self, key: str) -> float:
        """A number.

        Raises:
            ModelFileError: there is none of the key.
        """
        name, _, column = key.rpartition(".")
        row = self.values.get(name)
        value = row.get(column) if isinstance(row, Mapping) else self.values.get(key)
        if value is None or isinstance(value, Mapping | str):
            known = ", ".join(self.values)
            raise ModelFileError(
                f"{self.name}: '{key}' is no number of it{did_you_mean(key, self.values) or f'; it has {known}'}"
            )
        return value

    def with_numbers(self, values: Mapping[str, float]) -> MachineMaker:
        """The same with other numbers.

        Raises:
            ModelFileError: there is no number of a key.
        """
        now: dict[str, float | Row] = dict(self.values)
        for key, value in values.items():
            self.number(key)
            name, _, column = key.rpartition(".")
            row = now.get(name)
            if isinstance(row, Mapping):
                now[name] = {**row, column: value}
            else:
                now[key] = value
        return replace(self, values=now)

    def with_rows(self, rows: Mapping[str, Row]) -> MachineMaker:
        """The same with other parts of a catalogue."""
        return replace(self, values={**self.values, **rows})

    def machine(self, posture: str = "") -> Machine:
        """The machine with its loops closed, in a posture; see `vjm.in_posture`.

        Raises:
            ValueError: there is none of these numbers, or no such posture.
        """
        made = self.make(**self.values)
        return in_posture(made, posture or next(iter(made.postures)))[0]

    def parameter(self, key: str, posture: str = "") -> Parameter:
        """A number as what the machine's behaviour is differentiated by.

        Raises:
            ModelFileError: there is no such number, or it is zero, which has no size.
        """
        return parameter_of(self, key, posture, self.name)


def maker_of(made: Made) -> MachineMaker:
    """The numbers of a machine made in Python.

    Args:
        made: a machine, whose numbers are ``part.attribute``, ``part.section.attribute``, or ``part.attribute.1``
            for the first of several; or a function, whose numbers are its arguments.

    Raises:
        ValueError: an argument of the function has no default.
    """
    if isinstance(made, Machine):
        return MachineMaker(made.name, partial(_changed, made), dict(_numbers(made)), _part_unit)
    values: dict[str, float | Row] = {}
    for name, parameter in inspect.signature(made).parameters.items():
        if parameter.default is inspect.Parameter.empty:
            raise ValueError(f"argument '{name}' of the function has no default: give it its present value")
        values[name] = parameter.default
    return MachineMaker(getattr(made, "__name__", "machine"), made, values)


def numbered(model: Designed) -> Numbered:
    """The numbers of a machine, however it is given.

    Raises:
        ModelFileError: there is no such file.
        ValueError: an argument of a function has no default.
    """
    if isinstance(model, Machine) or callable(model):
        return maker_of(model)
    return MachineFiles.read(model) if isinstance(model, str | Path | Mapping) else model


def _numbers(machine: Machine) -> Iterator[tuple[str, float]]:
    for part in machine.parts:
        yield from _within(part.name, part)


def _within(key: str, value: object) -> Iterator[tuple[str, float]]:
    if is_dataclass(value) and not isinstance(value, type):
        for each in fields(value):
            if each.name not in NOT_VARIED:
                yield from _within(f"{key}.{each.name}", getattr(value, each.name))
    elif isinstance(value, tuple):
        for i, one in enumerate(value, start=1):
            yield from _within(f"{key}.{i}", one)
    elif isinstance(value, float) and np.isfinite(value):
        yield key, value


def _changed(machine: Machine, /, **values: float | Row) -> Machine:
    """A machine with other numbers, its loops closed anew."""
    parts = {part.name: part for part in machine.parts}
    now = dict(_numbers(machine))
    for key, value in values.items():
        if now.get(key) != value:
            # names of parts may have points
            name = max((name for name in parts if key.startswith(f"{name}.")), key=len)
            parts[name] = _with(parts[name], key[len(name) + 1 :].split("."), value)
    return assembled(replace(machine, parts=tuple(parts.values())))


def _with(owner: Any, path: list[str], value: float | Row) -> Any:  # noqa: ANN401
    head, *rest = path
    if isinstance(owner, tuple):
        i = int(head) - 1
        return (*owner[:i], _with(owner[i], rest, value) if rest else value, *owner[i + 1 :])
    if rest:
        value = _with(getattr(owner, head), rest, value)
    elif isinstance(value, Mapping):
        sizes = {name: cell for name, cell in value.items() if name != "shape"}
        return replace(owner, **{head: shape(str(value["shape"]), **sizes).stiffness()})
    return replace(owner, **{head: value})


def _part_unit(key: str) -> str:
    words = [word for word in key.split(".") if not word.isdigit()]
    if words[-1] == "mass":
        return "kg/mm" if "section" in words else "kg"
    return PART_UNITS.get(words[-1], "")
