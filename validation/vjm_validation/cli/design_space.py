"""What ``validate sweep`` and ``validate optimise`` share: the numbers that vary, the machine and its loads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.design.linear_state import Question, question
from vjm.design.sensitivity import Quantity
from vjm.design.sweep import Asked
from vjm.engines import EngineOptions, engine_by_name
from vjm.io.file_parameters import file_number, file_parameter, unit_of_key, with_numbers
from vjm.io.model_file import ModelDocument, build_chain, read_document
from vjm.model.chain import Chain
from vjm.model.load_case import Load
from vjm.model.parameters import Parameter
from vjm.postures import in_posture_of
from vjm.rotations import Array
from vjm.tree.model import Gravity
from vjm.vjm_engine import VjmEngine
from vjm_validation.cli.load_case_options import acceleration, parsed_load
from vjm_validation.cli.options import segments_of, six
from vjm_validation.cli.status import UsageError
from vjm_validation.load_any_model import in_postures, loaded


@dataclass(frozen=True)
class Loading:
    """What acts on the machine.

    Attributes:
        wrench: ``(6,)`` on the free end, N and N mm.
        gravity: m/s².
        loads: on parts.
        end: name of the end frame.
    """

    wrench: tuple[float, ...] | None
    gravity: Gravity | None
    loads: tuple[Load, ...]
    end: str

    @classmethod
    def of(cls, wrench: str | None, gravity: str, loads: Sequence[str], end: str) -> Loading:
        """What the options say."""
        return cls(
            None if wrench is None else tuple(six("--wrench", wrench)),
            acceleration(gravity),
            tuple(parsed_load(text) for text in loads),
            end,
        )

    def refuse_deflection_of_nothing(self, quantities: Iterable[Asked]) -> None:
        """Refuse to ask for a deflection where nothing acts.

        Raises:
            UsageError: it is asked for.
        """
        nothing = self.wrench is None and self.gravity is None and not self.loads
        if nothing and any(each.quantity is Quantity.DEFLECTION for each in quantities):
            raise UsageError("--of deflection: say under which load: give --wrench, --gravity or --load")


@dataclass(frozen=True)
class DesignSpace:
    """A machine whose numbers vary.

    Attributes:
        document: of its file.
        keys: of the numbers.
        posture: label.
        at: makes the machine of values ``(k,)``, with what is done to it.
    """

    document: ModelDocument
    keys: tuple[str, ...]
    posture: str
    at: Callable[[Array], Question]

    @property
    def units(self) -> list[str]:
        """Of the numbers."""
        return [unit_of_key(key) for key in self.keys]

    @property
    def present(self) -> Array:
        """Values ``(k,)`` in the file."""
        return np.array([file_number(self.document, key) for key in self.keys])

    def parameters(self, row: Array) -> list[Parameter]:
        """The numbers as parameters, at values ``(k,)``."""
        there = self.changed(row)
        return [file_parameter(there, key, lambda chain: chain) for key in self.keys]

    def changed(self, row: Array) -> ModelDocument:
        """The file's document with values ``(k,)``."""
        return with_numbers(self.document, dict(zip(self.keys, row.tolist(), strict=True)))


def design_space(
    model: str, keys: Sequence[str], posture: str | None, segments: str | None, loading: Loading
) -> DesignSpace:
    """The machine of a file whose numbers vary.

    Raises:
        ModelFileError: no such file or number.
        UsageError: a manipulator's file, or a number twice.
    """
    machine, document = loaded(model), read_document(model)
    if not isinstance(machine, Chain) or "parts" not in document.content:
        raise UsageError(
            f"{model}: is a manipulator's file, whose parts stand in the files of its legs: vary it in Python, see "
            "vjm.design.sweep"
        )
    twice = next((key for key in keys if list(keys).count(key) > 1), None)
    if twice:
        raise UsageError(f"--vary {twice} stands twice: give one range")
    for key in keys:
        file_number(document, key)
    number, parts = segments_of(segments)
    solver = engine_by_name("vjm", EngineOptions(number, parts=parts), machine)
    assert isinstance(solver, VjmEngine)
    machine, (label, *_) = in_postures(machine, (posture,) if posture else ())

    def at(row: Array) -> Question:
        content = with_numbers(document, dict(zip(keys, row.tolist(), strict=True))).content
        chain = in_posture_of(build_chain(content, document.file), label, machine)
        return question(
            chain, label, wrench=loading.wrench, gravity=loading.gravity, loads=loading.loads, end=loading.end,
            engine=solver,
        )  # fmt: skip

    return DesignSpace(document, tuple(keys), label, at)


def ranges_of(texts: Sequence[str], *, counted: bool) -> dict[str, tuple[float, float, int]]:
    """Ranges of numbers by key, as ``--vary`` has them: first, last, and how many.

    Args:
        texts: ``KEY=a:b:n``, or ``KEY=a:b`` where nothing is counted.
        counted: whether n is asked for.

    Raises:
        UsageError: it is no range.
    """
    form = "KEY=a:b:n, such as upper.length_mm=400:600:5" if counted else "KEY=a:b, such as upper.length_mm=400:600"
    result: dict[str, tuple[float, float, int]] = {}
    for text in texts:
        key, _, numbers = text.partition("=")
        words = numbers.split(":")
        try:
            first, last = float(words[0]), float(words[1])
            count = int(words[2]) if counted else 2
        except (IndexError, ValueError):
            raise UsageError(f"--vary {text}: write {form}") from None
        if len(words) != 2 + counted or not np.isfinite([first, last]).all() or count < 1 or first == last:
            raise UsageError(f"--vary {text}: write {form}")
        if key.strip() in result:
            raise UsageError(f"--vary {key.strip()} stands twice: give one range")
        result[key.strip()] = first, last, count
    if not result:
        raise UsageError(f"say which number varies: --vary {form}")
    return result
