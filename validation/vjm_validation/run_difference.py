"""What moved between two runs: every figure of their JSON documents, side by side."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DOCUMENTS = ("summary.json", "diagnosis.json", "calibration.json", "map.json")
"""What a run's folder may hold, the first that is there."""
LEFT_OUT = frozenset(
    {
        *("timings", "versions", "version", "hashes", "command", "notes", "seconds", "reason", "source", "doubts"),
        # sizes of errors, which say how well and not how much
        *(
            "error",
            "errors",
            "difference",
            "estimate",
            "residual",
            "extrapolated",
            "gci",
            "order",
            "digits",
            "within",
        ),
        *("order", "digits", "within", "contraction", "autocorrelation", "values", "at"),
    }
)
"""Keys that are no figures of the machine."""
NAMES = (
    *("name", "case", "kind", "group", "robot", "what", "posture", "pose", "direction", "condition", "load"),
    *("engine", "engines", "quantity", "placement", "springs", "channel", "causes", "size", "s", "ramp", "row"),
)
"""Keys by which a row of a list is known, where it has them."""


@dataclass(frozen=True)
class Move:
    """One figure of two runs.

    Attributes:
        name: its place in the document.
        before: in the first run.
        after: in the second run.
        change: relative to the larger of the two; infinite for what is no number.
    """

    name: str
    before: Any
    after: Any
    change: float


@dataclass(frozen=True)
class RunDifference:
    """Two runs compared.

    Attributes:
        moved: beyond the tolerance, the largest first.
        compared: how many figures both have.
        lost: only the first run has them.
        new: only the second run has them.
        largest: relative change of the figures that are within the tolerance.
    """

    moved: list[Move]
    compared: int
    lost: list[str]
    new: list[str]
    largest: float

    @property
    def same(self) -> bool:
        """Whether no figure moved and none was lost."""
        return not self.moved and not self.lost


def document_of(run: Path) -> dict[str, Any]:
    """The JSON document of a run's folder, or of a file.

    Raises:
        ValueError: there is none, or it is no JSON document; one line.
    """
    file = run
    if run.is_dir():
        found = [run / name for name in DOCUMENTS if (run / name).is_file()]
        if not found:
            raise ValueError(f"{run}: no run: none of {', '.join(DOCUMENTS)} is there")
        file = found[0]
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{file}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{file}: no JSON document: {error}") from error
    if not isinstance(content, dict):
        raise ValueError(f"{file}: no document of the suite: its outermost value is no table")
    return content


def compared(first: dict[str, Any], second: dict[str, Any], tolerance: float) -> RunDifference:
    """Two documents figure by figure.

    Args:
        first: the reference.
        second: what is compared with it.
        tolerance: relative change up to which a figure has not moved.
    """
    before, after = dict(_figures(first)), dict(_figures(second))
    both = [name for name in before if name in after]
    moves = [Move(name, before[name], after[name], _change(before[name], after[name])) for name in both]
    moved = sorted((m for m in moves if m.change > tolerance), key=lambda m: -m.change)
    return RunDifference(
        moved,
        len(both),
        [name for name in before if name not in after],
        [name for name in after if name not in before],
        max((m.change for m in moves if m.change <= tolerance), default=0.0),
    )


def _change(before: Any, after: Any) -> float:  # noqa: ANN401
    if before == after:
        return 0.0
    numbers = [isinstance(v, int | float) and not isinstance(v, bool) for v in (before, after)]
    if not all(numbers):
        return math.inf
    return float(abs(after - before) / max(abs(before), abs(after)))


def _figures(tree: Any, name: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Leaves of a document by their place: numbers, words and nulls."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key not in LEFT_OUT:
                yield from _figures(value, f"{name} / {key}" if name else key)
    elif isinstance(tree, list):
        taken: dict[str, int] = {}
        for k, value in enumerate(tree):
            own = _row_name(value) or str(k)
            taken[own] = taken.get(own, 0) + 1
            own += f" ({taken[own]})" if taken[own] > 1 else ""
            figures = {k: v for k, v in value.items() if k not in NAMES} if isinstance(value, dict) else value
            yield from _figures(figures, f"{name} / {own}")
    else:
        yield name, tree


def _row_name(row: Any) -> str:  # noqa: ANN401
    if not isinstance(row, dict):
        return ""
    words = [" ".join(map(str, row[key])) if isinstance(row[key], list) else str(row[key]) for key in NAMES
             if row.get(key) is not None]  # fmt: skip
    return " ".join(words)
