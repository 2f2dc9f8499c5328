"""The score as one page."""

from typing import Any

import numpy as np

from hidden_effects.plan import CAUSES
from hidden_effects.score import RIVALS
from hidden_effects.table import rows
from vjm_output.plots import Picture, drawing_of, figure
from vjm_output.templating import environment

OTHERS = ("several", "class", "none", "unknown", "failed")
"""Columns of the confusion matrix that are no single cause."""


def page(score: dict[str, Any], development: dict[str, Any]) -> str:
    """The page as HTML."""
    columns = [*CAUSES, *OTHERS]
    return (
        environment("hidden_effects")
        .get_template("blind.html.j2")
        .render(
            score=score,
            rows=rows(score),
            development=rows(development),
            pictures=[_strengths(score), _reliability(score)],
            columns=columns,
            confusion={name: [row.get(c, 0) for c in columns] for name, row in score["confusion"].items()},
            rivals=RIVALS,
        )
    )


def _strengths(score: dict[str, Any]) -> Picture:
    """Right verdicts by strength."""
    with figure(2.9, 1) as (fig, axes):
        (ax,) = axes
        lines = {"diagnose": score["right"]["by_strength"]}
        lines |= {words: score["rivals"][name]["by_strength"] for name, words in RIVALS.items()}
        for i, (words, by) in enumerate(lines.items()):
            known = [(float(s), r) for s, r in by.items() if r["sets"]]
            x = np.array([s for s, _ in known]) * 1.03 ** (i - 1.5)
            y = np.array([r["rate"] for _, r in known])
            ends = np.array([r["interval95"] for _, r in known]).reshape(-1, 2)
            ax.errorbar(
                x, y, np.abs(ends.T - y), marker="o", ms=3, lw=1.6 if i == 0 else 0.9, elinewidth=0.6, label=words
            )
        ax.set_xscale("log", base=2)
        ax.set(xlabel="strength", ylabel="share of right verdicts", ylim=(-0.03, 1.03))
        ax.set_xticks([1, 2, 4, 8, 16, 32], ["1", "2", "4", "8", "16", "32"])
        ax.legend(loc="upper left", fontsize=7)
        caption = "One hidden cause. Bars: 95 % intervals (Wilson)."
        return Picture("blind_strength", drawing_of(fig), "How visible a cause must be to be named", caption)


def _reliability(score: dict[str, Any]) -> Picture:
    """Share of right verdicts against their confidence."""
    with figure(2.9, 1) as (fig, axes):
        (ax,) = axes
        ax.plot([0, 1], [0, 1], color="0.7", lw=0.8)
        bins = score["reliability"]
        if bins:
            x, y = np.array([b["confidence"] for b in bins]), np.array([b["right"] for b in bins])
            ends = np.array([[b["low"], b["high"]] for b in bins])
            ax.errorbar(x, y, np.abs(ends.T - y), marker="o", ms=3, lw=0.0, elinewidth=0.8)
        ax.set(xlabel="confidence", ylabel="share of right verdicts", xlim=(0, 1.02), ylim=(-0.03, 1.03))
        caption = "All sets, bins of as many verdicts each. On the line a confidence is what it says."
        return Picture("blind_reliability", drawing_of(fig), "What a confidence is worth", caption)
