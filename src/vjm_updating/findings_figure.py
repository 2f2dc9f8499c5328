"""The bar chart of findings: what acts, what may act, and the residual."""

from __future__ import annotations

from typing import assert_never

from matplotlib.axes import Axes

from vjm_output.plot_style import Picture, drawing_of, figure
from vjm_updating.constants import shown
from vjm_updating.findings import FindingsRow, Word

ACTS, ONE_OF, MAY, LEFT = "#0072B2", "#56B4E9", "#b0b0b0", "#D55E00"
ROW = shown(0.26)
"""Height of a bar, inches."""


def bars(ax: Axes, found: FindingsRow) -> None:
    """A bar for each cause, as long as its probability; the shares of what the nominal model misses beside them."""
    names, lengths, colours, notes = [], [], [], []
    for row in found.causes:
        names.append(row.cause.replace("_", " "))
        lengths.append(row.probability)
        colours.append(_colour(row.word))
        share = "" if row.share is None else f", explains {row.share:.0%}"
        notes.append(f"{row.word}{share}")
    for name, p in (("nothing acts", found.nothing), ("something unknown", found.unknown)):
        if p is not None:
            names.append(name)
            lengths.append(p)
            colours.append(LEFT)
            notes.append("")
    at = range(len(names))
    ax.barh(at, lengths, color=colours, height=0.7)
    for y, length, note in zip(at, lengths, notes, strict=True):
        ax.text(length + 0.01, y, f"{length:.2f} {note}".strip(), va="center", fontsize=7)
    ax.set_yticks(at, names)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.6)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    ax.set_xlabel("probability that it acts")


def _colour(word: Word) -> str:
    match word:
        case Word.ACTS:
            return ACTS
        case Word.ONE_OF:
            return ONE_OF
        case Word.MAY:
            return MAY
        case _:
            assert_never(word)


def picture(found: FindingsRow) -> Picture:
    """The chart for a page."""
    rows = len(found.causes) + (found.nothing is not None) + (found.unknown is not None)
    with figure(0.7 + ROW * max(rows, 1), columns=1) as (fig, (axes,)):
        bars(axes, found)
        drawing = drawing_of(fig)
    return Picture("findings", drawing, "What acts, what may act, and the residual", "; ".join(found.words) + ".")
