"""A second machine beside that of the page: another file, or what an optimisation has found. Both bear one load."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape

import numpy as np

from vjm.design.best_machine import optimise
from vjm.design.optimum import Optimum
from vjm.design.space import LoadCases
from vjm.design.sweep import asked, signs
from vjm.io.shapes import Shape
from vjm_validation.explore.state import Explorer, ExplorerAnswer, Setting

MINIMISE = "minimise"
EVERY = 0.25
"""s between two lines on how far an optimisation is."""


@dataclass(frozen=True)
class ComparedMachine:
    """The second machine.

    Attributes:
        explorer: of the machine.
        name: for people.
        sizes: numbers of its file that are changed, by key.
    """

    explorer: Explorer
    name: str
    sizes: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def shapes(self) -> dict[str, Shape]:
        """Of its beams, by name."""
        return self.explorer.files.with_numbers(self.sizes).sections()

    def answer(self, first: Explorer, setting: Setting) -> ExplorerAnswer:
        """What it does under the load of the first machine's setting, its coordinates of like names being alike.

        Raises:
            ValueError: out of reach.
            NoConvergenceError: there is no stable equilibrium.
        """
        given = {each.name: at for each, at in zip(first.coordinates, setting.coordinates, strict=True)}
        coordinates = tuple(given.get(each.name, each.value) for each in self.explorer.coordinates)
        there = Setting(coordinates, setting.load, setting.weighed, self.sizes)
        return self.explorer.answer(there, shares=False)


def beside_file(first: Explorer, model: str, second: Explorer) -> ComparedMachine:
    """Another file beside the first one.

    Raises:
        ValueError: the end of one of them is held, and that of the other bears a load.
    """
    if first.held is not second.held:
        held, free = (first.model, model) if first.held else (model, first.model)
        raise ValueError(
            f"{held} has passive joints and its end is held; {free} bears a load: compare like machines"
        )
    return ComparedMachine(second, second.files.document.content["name"])


def compared(names: tuple[str, str], first: ExplorerAnswer, second: ExplorerAnswer) -> str:
    """Both answers and their difference as an HTML table; every number has an id of its own."""
    rows = []
    for name, unit, id_, of in (
        ("shift of the end", "mm", "shift", lambda a: float(np.linalg.norm(a.deflection[:3]))),
        ("least stiffness", "N/mm", "stiffness", lambda a: float(a.principal[0])),
        ("first frequency", "Hz", "frequency", lambda a: a.frequency),
        ("mass", "kg", "mass", lambda a: a.mass),
    ):
        values = [of(answer) for answer in (first, second)]
        shown = ["–" if v is None else "rigid" if not np.isfinite(v) else f"{v:.5g}" for v in values]
        a, b = values
        change = "–"
        if a is not None and b is not None and np.isfinite([a, b]).all() and a != 0.0:
            change = f"{b / a - 1.0:+.1%}"
        cells = f"<td>{shown[0]}</td><td id='beside-{id_}'>{shown[1]}</td><td>{change}</td>"
        rows.append(f"<tr><td>{name}, {unit}</td>{cells}</tr>")
    head = f"<tr><td></td><td><b>{escape(names[0])}</b></td><td><b>{escape(names[1])}</b></td><td></td></tr>"
    style = "width:100%;font-size:0.85em;padding:0 0.8em"
    return f"<table id='compared' style='{style}'>{head}{''.join(rows)}</table>"


@dataclass(frozen=True)
class Wish:
    """What an optimisation is asked for.

    Attributes:
        numbers: keys of the file, separated by commas; each goes from end to end of its slider.
        best: quantity that is made best.
        limits: on other quantities.
    """

    numbers: str
    best: str
    limits: str

    def bounds(self, explorer: Explorer) -> dict[str, tuple[float, float]]:
        """Of the numbers.

        Raises:
            ValueError: one is none of the page's.
        """
        ends = {each.name: (each.low, each.high) for each in explorer.sizes}
        keys = [word.strip() for word in self.numbers.split(",") if word.strip()]
        for key in keys:
            if key not in ends:
                raise ValueError(f"'{key}' is no number of the tab Sizes: write keys such as {next(iter(ends))}")
        if not keys:
            raise ValueError("write which numbers vary: keys of the tab Sizes, separated by commas")
        return {key: ends[key] for key in keys}

    def _direction(self) -> str:
        return MINIMISE if signs([asked(self.best)])[0] > 0.0 else "maximise"

    def command(self, explorer: Explorer, setting: Setting) -> str:
        """The command that finds the same."""
        words = [
            "validate optimise",
            shlex.quote(explorer.model),
            f"--{self._direction()} {shlex.quote(self.best)}",
        ]
        if self.limits:
            words.append(f"--such-that {shlex.quote(self.limits)}")
        words.append("--vary " + " ".join(f"{k}={a:.12g}:{b:.12g}" for k, (a, b) in self.bounds(explorer).items()))
        words.append(shlex.quote(f"--posture={explorer.posture(setting)}"))
        if any(setting.load):
            words.append("--wrench=" + ",".join(f"{value:.12g}" for value in setting.load))
        if setting.weighed:
            words.append("--gravity=" + ",".join(f"{value:.12g}" for value in explorer.gravity))
        if explorer.end:
            words.append(f"--end {shlex.quote(explorer.end)}")
        return " ".join([*words, f"--segments {explorer.segments} --starts 1"])

    def optimum(
        self, explorer: Explorer, setting: Setting, said: Callable[[str], None], stopped: Callable[[], bool]
    ) -> Optimum:
        """The best machine in a setting, from the numbers that the sliders stand at.

        Args:
            explorer: of the machine.
            setting: its posture, load and sizes.
            said: takes a line on how far it is.
            stopped: whether to end with the best so far.

        Raises:
            ValueError: no such number or quantity.
            NoConvergenceError: no machine has the quantities.
        """
        due = 0.0

        def progress(machines: int, best: float | None) -> None:
            nonlocal due
            if stopped():
                raise KeyboardInterrupt
            if time.monotonic() > due:
                due = time.monotonic() + EVERY
                value = "none keeps the limits so far" if best is None else f"best {self.best} {best:.5g}"
                said(f"{machines} machines, {value}")

        least = self._direction() == MINIMISE
        cases = LoadCases(
            [explorer.posture(setting)], [setting.load] if any(setting.load) else [],
            explorer.gravity if setting.weighed else None, end=explorer.end, engine=explorer.engine,
        )  # fmt: skip
        return optimise(
            explorer.files.with_numbers(setting.sizes), self.bounds(explorer), minimise=self.best if least else "",
            maximise="" if least else self.best, such_that=self.limits, starts=1, cases=cases, progress=progress,
        )  # fmt: skip
