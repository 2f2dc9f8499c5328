"""The command ``validate compare``: every figure of two runs' JSON documents side by side, and which moved."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vjm.io.findings import Finding, present_document
from vjm_output import terminal
from vjm_output.number_text import number, percent
from vjm_validation.cli import NOT_ACCEPTED, OK, UsageError
from vjm_validation.cli.options import warn
from vjm_validation.cli.pages import ResultOutput
from vjm_validation.page_content import ReportTable

DOCUMENTS = ("summary.json", "diagnosis.json", "calibration.json", "map.json")
"""What a run's folder may hold, the first that is there."""
LEFT_OUT = frozenset(
    {
        *("timings", "versions", "version", "hashes", "made_of", "command", "notes"),
        *("seconds", "reason", "source", "doubts"),
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
class MovedFigure:
    """One figure of two runs.

    Attributes:
        name: its place in the document.
        before: in the first run.
        after: in the second run.
        change: ``|after − before| / |before|``; infinite where the first is zero or where one is no finite number.
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
        compared: how many figures both have a place for.
        lost: only the first run has a value: the second has no such place, or null or NaN there.
        new: only the second run has the place.
        largest: relative change of the figures that are within the tolerance.
    """

    moved: list[MovedFigure]
    compared: int
    lost: list[str]
    new: list[str]
    largest: float

    @property
    def same(self) -> bool:
        """Whether no figure moved and none was lost."""
        return not self.moved and not self.lost


def document_of(run: Path) -> tuple[dict[str, Any], list[Finding]]:
    """The JSON document of a run's folder, or of a file, in the present words; a finding for each old word in it.

    Raises:
        ValueError: there is none, or it is no JSON document; one line.
    """
    file = run
    if run.is_dir():
        documents = [run / name for name in DOCUMENTS if (run / name).is_file()]
        if not documents:
            raise ValueError(f"{run}: no run: none of {', '.join(DOCUMENTS)} is there")
        file = documents[0]
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{file}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{file}: no JSON document: {error}") from error
    if not isinstance(content, dict):
        raise ValueError(f"{file}: no document of the suite: its outermost value is no table")
    return present_document(content, str(file))


def compared(
    first: dict[str, Any], second: dict[str, Any], tolerance: float, absolute: float = 0.0
) -> RunDifference:
    """Two documents figure by figure.

    Null and NaN are both no value, which is how documents of the suite write it. A value that becomes none is lost;
    none that becomes a value has moved.

    Args:
        first: the reference.
        second: what is compared with it.
        tolerance: change relative to the first up to which a figure has not moved.
        absolute: difference up to which it has not moved either, in its own unit: for figures whose reference is
            zero but for rounding.

    Example:
        >>> compared({"F": 100.0, "K": 2.0}, {"F": 101.0, "K": float("nan")}, 0.02).lost
        ['K']
    """
    before, after = dict(_figures(first)), dict(_figures(second))
    both = [name for name in before if name in after]
    gone = {name for name in both if _no_value(after[name]) and not _no_value(before[name])}
    changes = [(name, _change(before[name], after[name], absolute)) for name in both if name not in gone]
    moved = [MovedFigure(name, before[name], after[name], change) for name, change in changes if change > tolerance]
    return RunDifference(
        sorted(moved, key=lambda m: -m.change),
        len(both),
        [name for name in before if name not in after or name in gone],
        [name for name in after if name not in before],
        max((change for _, change in changes if change <= tolerance), default=0.0),
    )


def _no_value(figure: Any) -> bool:  # noqa: ANN401
    return figure is None or (isinstance(figure, float) and math.isnan(figure))


def _is_number(figure: Any) -> bool:  # noqa: ANN401
    return isinstance(figure, int | float) and not isinstance(figure, bool)


def _change(before: Any, after: Any, absolute: float) -> float:  # noqa: ANN401
    """Relative change of two figures, never NaN."""
    if _no_value(before) or _no_value(after):
        return 0.0 if _no_value(before) and _no_value(after) else math.inf
    if not (_is_number(before) and _is_number(after)):
        # True equals 1 in Python, and is no number
        return 0.0 if type(before) is type(after) and before == after else math.inf
    if before == after:
        return 0.0
    reference = _real(before)
    difference = abs(_real(after) - reference)
    if difference <= absolute:
        return 0.0
    # with an infinite reference the quotient would be NaN
    return math.inf if reference == 0.0 or math.isinf(reference) else difference / abs(reference)


def _real(number: float) -> float:
    try:
        return float(number)
    except OverflowError:  # whole numbers have no largest in JSON
        return math.inf if number > 0 else -math.inf


def _figures(tree: Any, name: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Leaves of a document by their place: numbers, words and nulls."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key not in LEFT_OUT:
                yield from _figures(value, f"{name} / {key}" if name else key)
    elif isinstance(tree, list):
        if not any(isinstance(value, dict) for value in tree):
            # rows may come and go by name; numbers in a list have no name
            yield f"{name} / entries", f"{len(tree)} entries"
        taken: dict[str, int] = {}
        for k, value in enumerate(tree):
            own = _row_name(value) or str(k)
            taken[own] = taken.get(own, 0) + 1
            own += f" ({taken[own]})" if taken[own] > 1 else ""
            figures = {k: v for k, v in value.items() if not _names(k, v)} if isinstance(value, dict) else value
            yield from _figures(figures, f"{name} / {own}")
    else:
        yield name, tree


def _names(key: str, value: Any) -> bool:  # noqa: ANN401
    """Whether an entry of a row says which row it is; a real number is a figure, which may move."""
    return key in NAMES and value is not None and not isinstance(value, float)


def _row_name(row: Any) -> str:  # noqa: ANN401
    if not isinstance(row, dict):
        return ""
    words = [" ".join(map(str, row[key])) if isinstance(row[key], list) else str(row[key]) for key in NAMES
             if _names(key, row.get(key))]  # fmt: skip
    return " ".join(words)


SHOWN = 20
"""Figures that a terminal lists."""


def compare_(
    first: Annotated[Path, Parameter(help="A run's folder, or a JSON file of the suite: the reference.")],
    second: Annotated[Path, Parameter(help="Another run's folder or file.")],
    *,
    tolerance: Annotated[
        float, Parameter(help="Change relative to the first run up to which a figure has not moved.")
    ] = 1e-6,
    absolute: Annotated[
        float,
        Parameter(
            help="Difference up to which it has not moved either, in its own unit: for zeros but for rounding."
        ),
    ] = 0.0,
    report: Annotated[Path | None, Parameter(help="Write a page to this file.")] = None,
) -> int:
    """Compare two runs: which figures moved, and by how much."""
    ResultOutput(report=report).check()
    if not 0.0 <= tolerance < 1.0:
        raise UsageError(f"--tolerance: must be from 0 to 1, not {tolerance:g}")
    if not 0.0 <= absolute < math.inf:
        raise UsageError(f"--absolute: must be from 0, not {absolute:g}")
    (before, old_first), (after, old_second) = document_of(first), document_of(second)
    warn([*old_first, *old_second])
    difference = compared(before, after, tolerance, absolute)
    if not difference.compared:
        raise UsageError(f"{first} and {second} have no figure in common: compare runs of one command")
    console = terminal.console()
    if difference.moved:
        console.print(_moved(difference.moved[:SHOWN]).for_terminal(f"{first} and {second}"))
    if len(difference.moved) > SHOWN:
        console.print(f"and {len(difference.moved) - SHOWN} more" + ("" if report else "; --report writes all"))
    for name in difference.lost[:SHOWN]:
        console.print(f"only in the first: {name}", soft_wrap=True, markup=False)
    if len(difference.lost) > SHOWN:
        console.print(f"and {len(difference.lost) - SHOWN} more" + ("" if report else "; --report writes all"))
    console.print(_words(difference, tolerance, absolute), soft_wrap=True)
    if report is not None:
        _page(report, f"{first} and {second}", difference, _words(difference, tolerance, absolute))
        console.print(f"page: {report}", soft_wrap=True)
    return OK if difference.same else NOT_ACCEPTED


def _moved(figures: Sequence[MovedFigure]) -> ReportTable:
    header = ("figure", "before", "after", "change")
    return ReportTable("Figures that moved, the most first", header, tuple(map(_row, figures)))


def _row(move: MovedFigure) -> tuple[str, str, str, str]:
    change = (
        percent(move.change) if math.isfinite(move.change) else "from 0" if _is_zero(move.before) else "another"
    )
    return move.name, _figure(move.before), _figure(move.after), change


def _is_zero(figure: object) -> bool:
    return isinstance(figure, int | float) and not isinstance(figure, bool) and figure == 0


def _figure(figure: object) -> str:
    return str(figure) if isinstance(figure, float) and math.isinf(figure) else number(figure, 7)


def _words(difference: RunDifference, tolerance: float, absolute: float) -> str:
    also = f" and by more than {absolute:g} in their own units" if absolute else ""
    moved = (
        f"{len(difference.moved)} of {difference.compared} figures moved by more than {tolerance:g} "
        f"of the first run's{also}"
    )
    rest = f"; the others by at most {difference.largest:.2g}" if difference.largest else "; the others are equal"
    lost = f"; {len(difference.lost)} have no value in the second" if difference.lost else ""
    new = f"; {len(difference.new)} are new in it" if difference.new else ""
    return moved + rest + lost + new


def _page(file: Path, title: str, difference: RunDifference, words: str) -> None:
    # matplotlib takes a second to import
    from vjm_validation.report.command_pages import write_small_page
    from vjm_validation.report.words import Tone

    absent = tuple(
        (name, where) for names, where in ((difference.lost, "first"), (difference.new, "second")) for name in names
    )
    tables = [
        _moved(difference.moved),
        ReportTable("Figures that only one run has", ("figure", "run"), absent),
    ]
    write_small_page(
        file, f"Comparison: {title}", f"{words}.",
        tone=Tone.AGREES if difference.same else Tone.FAILED, tables=[table for table in tables if table.rows],
    )  # fmt: skip
