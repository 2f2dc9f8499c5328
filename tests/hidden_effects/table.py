"""The score's headline figures, each beside what is asked of it: the same rows for both pages and the terminal."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from helpers.marked_text import renewed

BEGIN, END = "<!-- blind: begin -->", "<!-- blind: end -->"
"""Between these the table in docs/how-well-it-works.md stands."""
_DASH = "–"


@dataclass(frozen=True)
class Row:
    """One figure."""

    name: str
    asked: str
    found: str
    interval: str
    met: bool | None

    @property
    def verdict(self) -> str:
        """``holds``, ``missed`` or a dash."""
        return _DASH if self.met is None else "holds" if self.met else "missed"


@dataclass(frozen=True)
class Part:
    """How much of a campaign was made."""

    share: float = 1.0
    finished: int = 0
    of: int = 0

    @property
    def words(self) -> str:
        """What a reader must know of it, and the command."""
        part = "" if self.share >= 1.0 else f" of {100.0 * self.share:.0f} % of a campaign"
        left = "" if self.finished == self.of else f", of which {self.finished} of {self.of} sets were finished"
        options = "" if self.share >= 1.0 else f' ARGS="--share {self.share:g}"'
        return f"{part}{left}; made by `make blind{options}`"


def rows(score: dict[str, Any]) -> list[Row]:
    """The headline figures of a score."""
    best = score["rivals"]["likelihood_ratio"]["by_strength"]["4"]["rate"]
    four = None if best is None else max(best - 0.05, 0.0)
    words = (
        "no figure" if best is None else f"at least {_percent(four or 0.0)}, the likelihood ratio's less 5 points"
    )
    error = score["calibration"]
    admits = None if error["interval95"] is None else bool(error["interval95"][0] <= 0.03)
    cover = score["parameters"]["coverage"]
    median = score["parameters"]["median_error"]
    gain = score["gain"]["share_of_the_oracle"]
    took = score["seconds"]["mean"]
    return [
        _rate("right at strength 8 and more", "at least 97 %", score["right"]["strong"], lambda v: v >= 0.97),
        _rate("right at strength 4", words, score["right"]["by_strength"]["4"], lambda v: v >= (four or 0.0)),
        _rate("false alarms on quiet sets", "at most 1 %", score["false_alarms"], lambda v: v <= 0.01),
        _rate("cause outside the catalogue: `unknown`, or one that fits as well", "at least 90 %",
              score["outside"]["right"], lambda v: v >= 0.9),
        _rate("cause outside the catalogue: wrongly named", "at most 3 %", score["outside"]["wrongly_named"],
              lambda v: v <= 0.03),
        _rate("cause deleted from the catalogue: `unknown`, or one that fits as well", "at least 90 %",
              score["omitted"]["right"], lambda v: v >= 0.9),
        _rate("both of a pair, each 8 and more, no other set alike", "at least 85 %", score["pairs"]["both_strong"],
              lambda v: v >= 0.85),
        Row("principal parameter at 8 and more: median error", "at most 5 %", _percent(median), "",
            None if median is None else median <= 0.05),
        Row("coverage of its 95 % interval", "interval admits 95 %", _percent(cover["rate"]),
            _interval(cover["interval95"]), None if not cover["sets"] else bool(cover["interval95"][1] >= 0.95)),
        Row("fall of the held-out error over the oracle's", "at least 95 %", _percent(gain), "",
            None if gain is None else gain >= 0.95),
        Row("calibration error of the confidences", "interval admits 0.03 or less",
            _DASH if error["error"] is None else f"{error['error']:.3f}",
            "" if error["interval95"] is None else "{:.3f} to {:.3f}".format(*error["interval95"]), admits),
        _rate("designs that cannot separate: `class` with an experiment", "at least 90 %",
              score["inseparable"]["class_with_experiment"], lambda v: v >= 0.9),
        _rate("resolved by the one proposed experiment", "at least 90 %", score["inseparable"]["resolved"],
              lambda v: v >= 0.9),
        Row("mean time of a diagnosis", "at most 5 s", _DASH if took is None else f"{took:.1f} s", "",
            None if took is None else took <= 5.0),
    ]  # fmt: skip


def markdown(score: dict[str, Any], part: Part = Part()) -> str:
    """The rows as a table, with what they are about."""
    lines = [
        f"{score['sets']} sets, the {score['half']} half{part.words}.",
        "",
        "| figure | asked | found | 95 % interval | |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in rows(score):
        met = "**missed**" if row.met is False else row.verdict
        lines.append(f"| {row.name} | {row.asked} | {row.found} | {row.interval} | {met} |")
    return "\n".join(lines) + "\n"


def with_table(page: str, score: dict[str, Any], part: Part = Part()) -> str:
    """A page with the table between its marks; unchanged where it has none."""
    return renewed(page, BEGIN, END, markdown(score, part))


def _rate(name: str, asked: str, rate: dict[str, Any], meets: Callable[[float], bool]) -> Row:
    found = rate["rate"]
    interval = _interval(rate["interval95"]) if rate["sets"] else ""
    counts = f" ({rate['hits']} of {rate['sets']})" if rate["sets"] else ""
    return Row(name, asked, _percent(found) + counts, interval, None if found is None else meets(found))


def _percent(share: float | None) -> str:
    return _DASH if share is None else f"{100.0 * share:.1f} %"


def _interval(ends: list[float]) -> str:
    return f"{100.0 * ends[0]:.1f} to {100.0 * ends[1]:.1f} %"
