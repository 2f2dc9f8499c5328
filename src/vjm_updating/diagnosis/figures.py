"""The pictures of a diagnosis: findings as bars, readings and predictions, what was left, what stands out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from vjm.rotations import Array
from vjm_output.plots import Margins, Picture, drawing_of, figure
from vjm_updating.constants import shown
from vjm_updating.diagnosis.document import Diagnosis, FindingsRow, Word
from vjm_updating.diagnosis.preprocess import Prepared
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.model_error import driven_channel, loading
from vjm_updating.inference.observed import Observed

COLOURS, LEFT = {Word.ACTS: "#0072B2", Word.ONE_OF: "#56B4E9", Word.MAY: "#b0b0b0"}, "#D55E00"
HEADLINES = {
    "none": "The model explains the readings within the noise and the tolerances of the sheet.",
    "named": "What the model gets wrong is named.",
    "class": "Several causes explain the readings alike; these readings cannot distinguish them.",
    "partly": "Most of what the model gets wrong is named; what remains is more than noise.",
    "unknown": "The model is wrong, and no known cause explains how.",
}
TONES = {"none": "agrees", "named": "cause", "class": "differs", "partly": "differs", "unknown": "failed"}
"""Class of the box that a verdict stands in."""
ROW = shown(0.26)
"""Height of a bar, inches."""


def bars(ax: Axes, findings: FindingsRow) -> None:
    """A bar for each cause, as long as its probability; the shares of what the nominal model misses beside them."""
    names, lengths, colours, notes = [], [], [], []
    for row in findings.causes:
        names.append(row.cause.replace("_", " "))
        lengths.append(row.probability)
        colours.append(COLOURS[row.word])
        share = "" if row.share is None else f", explains {row.share:.0%}"
        notes.append(f"{row.word}{share}")
    for name, p in (("nothing acts", findings.nothing), ("something unknown", findings.unknown)):
        if p is not None:
            names.append(name)
            lengths.append(p)
            colours.append(LEFT)
            notes.append("")
    positions = range(len(names))
    ax.barh(positions, lengths, color=colours, height=0.7)
    for y, length, note in zip(positions, lengths, notes, strict=True):
        ax.text(length + 0.01, y, f"{length:.2f} {note}".strip(), va="center", fontsize=7)
    ax.set_yticks(positions, names)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.6)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
    ax.set_xlabel("probability that it acts")


def picture(findings: FindingsRow) -> Picture:
    """The chart for a page."""
    rows = len(findings.causes) + (findings.nothing is not None) + (findings.unknown is not None)
    with figure(0.7 + ROW * max(rows, 1), columns=1) as (fig, (axes,)):
        bars(axes, findings)
        drawing = drawing_of(fig)
    return Picture(
        "findings", drawing, "What acts, what may act, and the residual", "; ".join(findings.words) + "."
    )


INK, BEFORE, BEST, AFTER, BACK = "#1b1f24", "#D55E00", "#E69F00", "#0072B2", "#7a7a7a"
MOST_PANELS = shown(4)
"""Postures, and channels driven in them, that are drawn."""
THRESHOLD = shown(3.0)
"""Standard errors from which on a contrast is marked; its axis is straight below and logarithmic beyond."""
TICKS = shown((1.0, 2.0, THRESHOLD, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, 1e5))
"""Marks of that axis: more of them would run into one another."""
LETTER = shown(0.066)
"""Width of a letter, inches."""


@dataclass(frozen=True)
class Before:
    """The nominal model against the readings.

    Attributes:
        drawn: residuals ``(n, 6)`` at the sheet's own values; None where the model does not reach the readings.
        best: with zero, scale, length and modulus at their best within the sheet's tolerances.
    """

    drawn: Array | None
    best: Array

    @property
    def shown(self) -> Array:
        """Those that are drawn."""
        return self.best if self.drawn is None else self.drawn


def nominal(prepared: Prepared) -> Before:
    """The nominal model's residuals."""
    fitter, null = prepared.fitter, prepared.null
    evaluation = fitter.evaluate(null.parameters, np.zeros(len(null.parameters)), ())
    return Before(None if evaluation is None else evaluation.residual, null.evaluation.residual)


def pictures(prepared: Prepared, fit: Fit, document: Diagnosis, before: Before) -> list[Picture]:
    """Every picture of the page."""
    charts = [_curves(prepared, fit, before), _residuals(prepared, fit, before)]
    return [*charts, _contrasts(document)] if document.contrasts else charts


@dataclass(frozen=True)
class Panel:
    """The readings of a posture on the ramps that drove one channel.

    Attributes:
        driven: the channel: a displacement, of a test by force a load.
        read: index of the channel that is drawn over it.
        on: which readings ``(n,)``.
    """

    posture: str
    driven: str
    read: int
    on: np.ndarray


def panels_of(observed: Observed) -> list[Panel]:
    """What is drawn of a test: its first postures, and in each the channels that were driven, one after another."""
    names = {index: name for name, index in observed.slots.items()}
    driven = np.full(len(observed.readings), driven_channel(observed), dtype=object)
    for ray in observed.rays:
        # shares of the components in the ramp, without a unit
        share = ray.direction * ray.measure
        driven[ray.index] = names.get(int(np.argmax(share)), driven_channel(observed))
    labels = observed.readings.posture
    pairs = dict.fromkeys(zip(labels.tolist(), driven.tolist(), strict=True))
    panels = []
    for label, channel in pairs:
        on = (labels == label) & (driven == channel)
        read = _read(observed, channel, on)
        panels.append(Panel(label, channel, read, on & observed.present[:, read]))
    return panels[:MOST_PANELS]


def _read(observed: Observed, driven: str, on: np.ndarray) -> int:
    """The channel that is drawn of readings: the driven one, else the first read; of displacements the clearest."""
    if observed.columns != WRENCH:
        size = np.nanmax(np.abs(observed.measured[on]), axis=0, initial=0.0) / observed.noise.wrench
        return int(np.argmax(np.nan_to_num(size)))
    own, present = observed.slots[driven], observed.present[on]
    return own if present[:, own].any() else int(np.argmax(present.any(axis=0)))


def _titles(panels: Sequence[Panel]) -> list[str]:
    """The posture of each, with the driven channel where the test drove several."""
    several = len({panel.driven for panel in panels}) > 1
    return [
        f"posture {p.posture}, {p.driven.rsplit('_', 1)[0]}" if several else f"posture {p.posture}" for p in panels
    ]


def _curves(prepared: Prepared, fit: Fit, before: Before) -> Picture:
    observed = prepared.fitter.forward.observed
    panels = panels_of(observed)
    columns = min(len(panels), 2)
    rows = (len(panels) + 1) // 2
    margins = Margins(between=0.72)
    alike = len({panel.driven for panel in panels}) == 1
    height = 3.0 if rows == 1 else 2.7 * rows
    with figure(height, columns, rows=rows, margins=margins, sharex=alike) as (fig, axes):
        for panel, title, ax in zip(panels, _titles(panels), axes, strict=False):
            c, on, u = panel.read, panel.on, observed.readings.values[panel.driven]
            order = np.argsort(u[on], kind="stable")
            read = observed.measured[on, c]
            drawn = (read - before.shown[on, c])[order]
            ax.plot(u[on][order], drawn, color=BEFORE, lw=1.3, label="nominal model", zorder=2)
            if fit.hypothesis:
                after = read - fit.evaluation.residual[on, c]
                ax.plot(u[on], after, color=AFTER, lw=1.3, label="extended model", zorder=2.5)
            ax.plot(u[on], read, ".", color=INK, ms=3.5, label="measured", zorder=3)
            ax.set(title=title, xlabel=axis_title(panel.driven), ylabel=axis_title(observed.columns[c]))
            ax.tick_params(labelbottom=True)
        axes[0].legend()
        for ax in axes[len(panels) :]:
            ax.set_visible(False)
        content = drawing_of(fig)
    how = "with the sheet's own values" if before.drawn is not None else "its nuisances at their best"
    imposed = "at the same displacements" if observed.columns == WRENCH else "under the same loads"
    caption = f"Readings, and what the models predict {imposed}; the nominal one {how}."
    return Picture("curves", content, "What was measured and what the model said", caption)


def _residuals(prepared: Prepared, fit: Fit, before: Before) -> Picture:
    observed = prepared.fitter.forward.observed
    drawn = panels_of(observed)
    shown = [(before.best, BEST, "at its best")]
    if before.drawn is not None:
        shown.insert(0, (before.drawn, BEFORE, "as drawn"))
    if fit.hypothesis:
        shown.append((fit.evaluation.residual, AFTER, "extended"))
    n = len(shown)
    alike = len({panel.driven for panel in drawn}) == 1
    margins = Margins() if alike else Margins(between=0.72)
    with figure(2.2 * len(drawn), n, rows=len(drawn), margins=margins, sharex=alike) as (fig, axes):
        for k, (panel, title) in enumerate(zip(drawn, _titles(drawn), strict=True)):
            c, u, way = panel.read, observed.readings.values[panel.driven], loading(observed, panel.driven)
            known = ((1.0, "o", "way out"), (-1.0, "x", "way back"), (0.0, "s", "held"))
            kinds = [kind for kind in known if (panel.on & (way == kind[0])).any()]
            for ax, (residual, colour, name) in zip(axes[n * k : n * k + n], shown, strict=True):
                for sign, marker, kind in kinds:
                    own = panel.on & (way == sign)
                    ax.plot(u[own], residual[own, c], marker, ms=3.0, lw=0, color=colour, label=kind, alpha=0.7)
                ax.axhline(0.0, color=BACK, lw=0.7)
                last = k == len(drawn) - 1
                ax.set(title=f"{title}, {name}", xlabel="" if alike and not last else axis_title(panel.driven))
            axes[n * k].set_ylabel(axis_title(observed.columns[c]))
            if len(kinds) > 1 and k == 0:
                axes[0].legend()
        content = drawing_of(fig)
    caption = (
        "Reading minus model: the nominal one with the sheet's own values, then with zero, scale, length and "
        "modulus at their best within the sheet's tolerances, and the extended one. Each has a scale of its own."
    )
    return Picture("residuals", content, "Where it failed, and the residual", caption)


def _contrasts(document: Diagnosis) -> Picture:
    rows = document.contrasts[::-1]
    words = [f"{row.channel}: {row.name}" for row in rows]
    margins = Margins(left=0.2 + LETTER * max(map(len, words)), top=0.1)
    with figure(0.26 * len(rows) + 0.9, 1, margins=margins) as (fig, (ax,)):
        ax.barh(range(len(rows)), [abs(row.significance) for row in rows], color=BEFORE, height=0.6)
        ax.set_yticks(range(len(rows)), words)
        ax.set_ylim(-0.8, len(rows) - 0.2)
        ax.axvline(THRESHOLD, color=BACK, lw=0.8, ls="--")
        ax.set_xscale("symlog", linthresh=THRESHOLD)
        most = max(abs(row.significance) for row in rows)
        ax.set_xticks([0.0, *(t for t in TICKS if t <= max(most, THRESHOLD))])
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_xlabel("significance, standard errors")
        content = drawing_of(fig)
    caption = "The nominal model's residual taken apart; zero, scale, length and modulus are fitted beside each."
    return Picture("contrasts", content, "What stands out", caption)


def axis_title(channel: str) -> str:
    """``fx, N``."""
    name, unit = channel.rsplit("_", 1)
    return f"{name}, {unit.replace('Nmm', 'N mm')}"
