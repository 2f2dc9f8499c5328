"""A machine whose files' numbers vary, in the postures and under the loads in which it is judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vjm.design.linear_state import Question, question
from vjm.io.file_parameters import MachineFiles, unit_of_key
from vjm.model.load_case import Load
from vjm.model.mechanism import Gravity
from vjm.model.parameters import Parameter
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine


class DesignCase(NamedTuple):
    """Where a machine stands, and what its end bears.

    Attributes:
        posture: label or coordinates.
        wrench: ``(6,)`` on the free end, N and N mm; None for nothing.
    """

    posture: str
    wrench: tuple[float, ...] | None = None

    @property
    def wrench_text(self) -> str:
        """The wrench as a command takes it; empty for nothing."""
        return "" if self.wrench is None else ",".join(f"{v:.12g}" for v in self.wrench)


@dataclass(frozen=True)
class DesignSpace:
    """A machine whose numbers vary.

    Attributes:
        files: of the machine.
        keys: of the numbers, see `vjm.io.file_parameters.MachineFiles`.
        cases: where it stands and what its end bears; it is judged in all of them.
        gravity: m/s², in every case.
        loads: on parts, in every case.
        end: name of the end frame; empty for the first.
        engine: how beams become springs; None for `vjm`'s own.
    """

    files: MachineFiles
    keys: tuple[str, ...]
    cases: tuple[DesignCase, ...]
    gravity: Gravity | None = None
    loads: tuple[Load, ...] = ()
    end: str = ""
    engine: VjmEngine | None = None

    @property
    def units(self) -> list[str]:
        """Of the numbers."""
        return [unit_of_key(key) for key in self.keys]

    @property
    def present(self) -> Array:
        """Values ``(k,)`` in the files."""
        return np.array([self.files.number(key) for key in self.keys])

    def changed(self, row: Sequence[float] | Array) -> MachineFiles:
        """The files with values ``(k,)``."""
        return self.files.with_numbers(dict(zip(self.keys, map(float, row), strict=True)))

    def question(self, row: Sequence[float] | Array, case: DesignCase) -> Question:
        """The machine of values ``(k,)``, with what is done to it in a case.

        Raises:
            ValueError: there is no such machine, or it cannot stand so.
        """
        return question(
            self.changed(row).machine(case.posture), case.posture, wrench=case.wrench, gravity=self.gravity,
            loads=self.loads, end=self.end, engine=self.engine,
        )  # fmt: skip

    def parameters(self, row: Sequence[float] | Array, case: DesignCase) -> list[Parameter]:
        """The numbers as parameters of the machine of values ``(k,)`` in a case."""
        there = self.changed(row)
        return [there.parameter(key, case.posture) for key in self.keys]
