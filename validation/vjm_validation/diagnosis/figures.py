"""The pictures of a diagnosis: what was measured and predicted, what was left, what stands out."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_validation.diagnosis.document import Diagnosis
from vjm_validation.diagnosis.fitting import Fit
from vjm_validation.diagnosis.preparation import Prepared
from vjm_validation.diagnosis.shapes import driven_channel, loading
from vjm_validation.measurement.channels import WRENCH
from vjm_validation.report.style import Picture, figure, png

INK, BEFORE, AFTER, BACK = "#1b1f24", "#D55E00", "#0072B2", "#7a7a7a"
MOST_POSTURES = 4
"""Postures that are drawn."""


def pictures(prepared: Prepared, fit: Fit, document: Diagnosis) -> list[Picture]:
    """Every picture of the page."""
    found = [_curves(prepared, fit), _residuals(prepared, fit)]
    return [*found, _contrasts(document)] if document.contrasts else found


def _force(prepared: Prepared) -> int:
    """The wrench channel that is drawn: the driven one, else the first that was read."""
    observed = prepared.fitter.forward.observed
    driven = observed.slot(driven_channel(observed))
    return driven if observed.present[:, driven].any() else int(np.argmax(observed.present.any(axis=0)))


def _postures(prepared: Prepared) -> list[str]:
    return list(dict.fromkeys(prepared.fitter.forward.observed.readings.posture.tolist()))[:MOST_POSTURES]


def _curves(prepared: Prepared, fit: Fit) -> Picture:
    observed = prepared.fitter.forward.observed
    c, u = _force(prepared), observed.readings.values[driven_channel(observed)]
    labels = _postures(prepared)
    columns = min(len(labels), 2)
    rows = (len(labels) + 1) // 2
    with figure(2.6 * rows, columns, rows=rows) as (fig, axes):
        for label, ax in zip(labels, axes, strict=False):
            on = (observed.readings.posture == label) & observed.present[:, c]
            order = np.argsort(u[on], kind="stable")
            read = observed.wrench[on, c]
            ax.plot(u[on], read, ".", color=INK, ms=2.5, label="measured")
            ax.plot(
                u[on][order],
                (read - prepared.null.at.residual[on, c])[order],
                color=BEFORE,
                lw=1.0,
                label="nominal model",
            )
            if fit.hypothesis:
                ax.plot(u[on], read - fit.at.residual[on, c], color=AFTER, lw=1.0, label="extended model")
            ax.set(title=f"posture {label}", xlabel=_axis(driven_channel(observed)), ylabel=_axis(WRENCH[c]))
        axes[0].legend()
        for ax in axes[len(labels) :]:
            ax.set_visible(False)
        content = png(fig)
    caption = "Readings, and what the model predicts at the same displacements, its nuisances at their best."
    return Picture("curves", content, "What was measured and what the model said", caption)


def _residuals(prepared: Prepared, fit: Fit) -> Picture:
    observed = prepared.fitter.forward.observed
    c, u = _force(prepared), observed.readings.values[driven_channel(observed)]
    way: Array = loading(observed)
    labels = _postures(prepared)
    with figure(2.1 * len(labels), 2, rows=len(labels), sharey=False) as (fig, axes):
        for k, label in enumerate(labels):
            on = (observed.readings.posture == label) & observed.present[:, c]
            for ax, one, colour, name in (
                (axes[2 * k], prepared.null, BEFORE, "before"),
                (axes[2 * k + 1], fit, AFTER, "after" if fit.hypothesis else "no cause added"),
            ):
                for sign, marker, kind in ((1.0, "o", "way out"), (-1.0, "x", "way back"), (0.0, "s", "held")):
                    own = on & (way == sign)
                    ax.plot(
                        u[own], one.at.residual[own, c], marker, ms=2.5, lw=0, color=colour, label=kind, alpha=0.7
                    )
                ax.axhline(0.0, color=BACK, lw=0.7)
                ax.set(title=f"posture {label}, {name}", ylabel=_axis(WRENCH[c]))
        axes[0].legend()
        for ax in axes[-2:]:
            ax.set_xlabel(_axis(driven_channel(observed)))
        content = png(fig)
    caption = "Reading minus model; the scales of both columns differ."
    return Picture("residuals", content, "Where it failed, and what is left", caption)


def _contrasts(document: Diagnosis) -> Picture:
    rows = document.contrasts[::-1]
    with figure(0.26 * len(rows) + 0.8, 1) as (fig, (ax,)):
        ax.barh(range(len(rows)), [abs(row.significance) for row in rows], color=BEFORE, height=0.6)
        ax.set_yticks(range(len(rows)), [f"{row.channel}: {row.name}" for row in rows])
        ax.axvline(3.0, color=BACK, lw=0.8, ls="--")
        ax.set_xscale("symlog", linthresh=3.0)
        ax.set_xlabel("significance, standard errors")
        content = png(fig)
    caption = "The nominal model's residual taken apart; zero, scale, length and modulus are fitted beside each."
    return Picture("contrasts", content, "What stands out", caption)


def _axis(channel: str) -> str:
    name, unit = channel.rsplit("_", 1)
    return f"{name}, {unit.replace('Nmm', 'N mm')}"
