"""The pictures of a diagnosis: what was measured and predicted, what was left, what stands out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.ticker import NullLocator

from vjm.rotations import Array
from vjm_output.plot_style import Margins, Picture, drawing_of, figure
from vjm_updating.constants import shown
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.diagnosis.preprocess import Prepared
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.residual_basis import driven_channel, loading

INK, BEFORE, BEST, AFTER, BACK = "#1b1f24", "#D55E00", "#E69F00", "#0072B2", "#7a7a7a"
MOST_POSTURES = shown(4)
"""Postures that are drawn."""
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
    at = fitter.evaluate(null.found, np.zeros(len(null.found)), ())
    return Before(None if at is None else at.residual, null.at.residual)


def pictures(prepared: Prepared, fit: Fit, document: Diagnosis, before: Before) -> list[Picture]:
    """Every picture of the page."""
    found = [_curves(prepared, fit, before), _residuals(prepared, fit, before)]
    return [*found, _contrasts(document)] if document.contrasts else found


def _force(prepared: Prepared) -> int:
    """The channel that is drawn: the driven one, else the first that was read; of displacements the clearest."""
    observed = prepared.fitter.forward.observed
    if observed.columns != WRENCH:
        size = np.nanmax(np.abs(observed.wrench), axis=0) / observed.noise.wrench
        return int(np.argmax(np.nan_to_num(size)))
    driven = observed.slots[driven_channel(observed)]
    return driven if observed.present[:, driven].any() else int(np.argmax(observed.present.any(axis=0)))


def _postures(prepared: Prepared) -> list[str]:
    return list(dict.fromkeys(prepared.fitter.forward.observed.readings.posture.tolist()))[:MOST_POSTURES]


def _curves(prepared: Prepared, fit: Fit, before: Before) -> Picture:
    observed = prepared.fitter.forward.observed
    c, driven = _force(prepared), driven_channel(observed)
    u = observed.readings.values[driven]
    labels = _postures(prepared)
    columns = min(len(labels), 2)
    rows = (len(labels) + 1) // 2
    margins = Margins(between=0.72)
    with figure(3.0 if rows == 1 else 2.7 * rows, columns, rows=rows, margins=margins) as (fig, axes):
        for label, ax in zip(labels, axes, strict=False):
            on = (observed.readings.posture == label) & observed.present[:, c]
            order = np.argsort(u[on], kind="stable")
            read = observed.wrench[on, c]
            drawn = (read - before.shown[on, c])[order]
            ax.plot(u[on][order], drawn, color=BEFORE, lw=1.3, label="nominal model", zorder=2)
            if fit.hypothesis:
                after = read - fit.at.residual[on, c]
                ax.plot(u[on], after, color=AFTER, lw=1.3, label="extended model", zorder=2.5)
            ax.plot(u[on], read, ".", color=INK, ms=3.5, label="measured", zorder=3)
            ax.set(
                title=f"posture {label}",
                xlabel=axis_title(driven),
                ylabel=axis_title(observed.columns[c]),
            )
            ax.tick_params(labelbottom=True)
        axes[0].legend()
        for ax in axes[len(labels) :]:
            ax.set_visible(False)
        content = drawing_of(fig)
    how = "with the sheet's own values" if before.drawn is not None else "its nuisances at their best"
    caption = f"Readings, and what the models predict at the same displacements; the nominal one {how}."
    return Picture("curves", content, "What was measured and what the model said", caption)


def _residuals(prepared: Prepared, fit: Fit, before: Before) -> Picture:
    observed = prepared.fitter.forward.observed
    c, driven = _force(prepared), driven_channel(observed)
    u = observed.readings.values[driven]
    way: Array = loading(observed)
    labels = _postures(prepared)
    kinds = [k for k in ((1.0, "o", "way out"), (-1.0, "x", "way back"), (0.0, "s", "held")) if (way == k[0]).any()]
    panels = [(before.best, BEST, "at its best")]
    if before.drawn is not None:
        panels.insert(0, (before.drawn, BEFORE, "as drawn"))
    if fit.hypothesis:
        panels.append((fit.at.residual, AFTER, "extended"))
    n = len(panels)
    with figure(2.2 * len(labels), n, rows=len(labels), margins=Margins()) as (fig, axes):
        for k, label in enumerate(labels):
            on = (observed.readings.posture == label) & observed.present[:, c]
            for ax, (residual, colour, name) in zip(axes[n * k : n * k + n], panels, strict=True):
                for sign, marker, kind in kinds:
                    own = on & (way == sign)
                    ax.plot(u[own], residual[own, c], marker, ms=3.0, lw=0, color=colour, label=kind, alpha=0.7)
                ax.axhline(0.0, color=BACK, lw=0.7)
                ax.set(title=f"posture {label}, {name}")
            axes[n * k].set_ylabel(axis_title(observed.columns[c]))
        if len(kinds) > 1:
            axes[0].legend()
        for ax in axes[-n:]:
            ax.set_xlabel(axis_title(driven))
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
