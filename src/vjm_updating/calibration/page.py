"""``calibration.html``: fit, residuals, intervals and correlation as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm

from vjm.rotations import Array
from vjm_output.plots import Picture, drawing_of, figure
from vjm_output.templating import environment
from vjm_updating.calibration.document import Calibration, interval
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.constants import shown
from vjm_updating.diagnosis.figures import axis_title
from vjm_updating.experiment import Measurement

# --- The pictures of a calibration: fit, residuals, intervals, correlation ----------------------------------------

INK, NOMINAL, CALIBRATED, BAD = "#1b1f24", "#D55E00", "#0072B2", "#b00020"
"""Okabe and Ito's, but for the outliers."""
MOST_NAMED = shown(26)
"""Rows of a correlation picture whose values are written."""
EDGE = shown(5.0)
"""Half a lane of the picture of residuals, sigma; what lies beyond is drawn at its edge."""
LETTER = shown(0.06)
"""Width of a letter of 7 points, inches."""
STRONG = shown(0.3)
"""Correlation from which a value is written."""


def pictures(fit: CalibrationSolution, document: Calibration) -> list[Picture]:
    """Every picture of the page."""
    drawings = [_fit_picture(fit), _residual_picture(fit), _correlation_picture(document)]
    intervals = _interval_picture(document)
    return [*drawings[:2], *([intervals] if intervals else []), drawings[2]]


def _driven(fit: CalibrationSolution) -> int:
    """The component of the pose that moved most, a rad counting 100 mm."""
    size = np.max(np.abs(fit.problem.observed.imposed), axis=0) * np.repeat([1.0, 100.0], 3)
    return int(np.argmax(size))


def _labels(fit: CalibrationSolution) -> dict[str, np.ndarray]:
    """Readings by posture, every ray of it."""
    indices: dict[str, list[np.ndarray]] = {}
    for ray in fit.problem.observed.rays:
        indices.setdefault(ray.posture, []).append(ray.index)
    return {posture: np.sort(np.concatenate(parts)) for posture, parts in indices.items()}


def _fit_picture(fit: CalibrationSolution) -> Picture:
    observed, labels, axis = fit.problem.observed, _labels(fit), _driven(fit)
    channels = [int(c) for c in np.flatnonzero(observed.present.any(axis=0))]
    # what hardly moves says nothing in a picture
    size = {c: float(np.nanmax(np.abs(observed.measured[:, c]))) / observed.noise.wrench[c] for c in channels}
    shown = sorted(sorted(channels, key=lambda c: -size[c])[:3])
    with figure(0.4 + 1.9 * len(shown), len(labels), rows=len(shown)) as (fig, axes):
        for row, c in enumerate(shown):
            for column, (posture, indices) in enumerate(labels.items()):
                ax = axes[row * len(labels) + column]
                x = observed.imposed[indices, axis]
                order = np.argsort(x, kind="stable")
                read = observed.measured[indices, c]
                outlying = fit.outliers[indices, c]
                ax.plot(x, read, ".", color="#8c96a0", ms=3.0, label="readings")
                ax.plot(x[outlying], read[outlying], "x", color=BAD, ms=5.0, label="outlier")
                drawn = (read - fit.nominal.residual[indices, c])[order]
                ax.plot(x[order], drawn, "--", color=NOMINAL, lw=1.2, label="nominal")
                model = (read - fit.at.residual[indices, c])[order]
                ax.plot(x[order], model, "-", color=CALIBRATED, lw=1.2, label="calibrated")
                if row == 0:
                    ax.set_title(f"posture {posture}")
                if row == len(shown) - 1:
                    ax.set_xlabel(axis_title(next(n for n, k in observed.slots.items() if k == axis)))
                if column == 0:
                    ax.set_ylabel(axis_title(observed.columns[c]))
        axes[0].legend(loc="best")
        content = drawing_of(fig)
    caption = (
        "Readings, and the model at the same displacements before and after the calibration, nuisances included."
    )
    return Picture("fit", content, "Fit", caption)


def _residual_picture(fit: CalibrationSolution) -> Picture:
    """Whitened residuals in the order of the readings, a lane for each channel."""
    observed = fit.problem.observed
    channels = [int(c) for c in np.flatnonzero(observed.present.any(axis=0))]
    bins = np.linspace(-EDGE, EDGE, 41)
    density = np.exp(-0.5 * bins**2) / np.sqrt(2.0 * np.pi)
    with figure(0.6 + 0.8 * len(channels), 2, sharey=True, widths=[4.0, 1.0]) as (fig, (ax, side)):
        for k, c in enumerate(channels):
            lane = -2.0 * EDGE * k
            indices = np.flatnonzero(observed.present[:, c])
            outlying = fit.outliers[indices, c]
            own = np.where(outlying, fit.noises[indices, c], fit.residual[indices, c] * fit.whitening.spread[c])
            r = lane + np.clip(own, -EDGE, EDGE)
            ax.axhspan(lane - 2.0, lane + 2.0, color="#e8eef4", zorder=0)
            ax.plot(indices, r, ".", color=CALIBRATED, ms=2.0)
            ax.plot(indices[outlying], r[outlying], "x", color=BAD, ms=4.0)
            counts = np.histogram(r - lane, bins, density=True)[0]
            side.fill_betweenx(lane + bins, 0.0, [*counts, 0.0], step="post", color=CALIBRATED, alpha=0.5)
            side.plot(density, lane + bins, color=INK, lw=1.0)
        ax.set_yticks(
            [-2.0 * EDGE * k for k in range(len(channels))], [observed.columns[c].split("_")[0] for c in channels]
        )
        ax.set_ylim(-2.0 * EDGE * (len(channels) - 0.5), EDGE)
        ax.grid(visible=False)
        side.grid(visible=False)
        side.set_xticks([])
        _postures_along(ax, fit)
        ax.set_xlabel("reading")
        side.set_xlabel("share")
        content = drawing_of(fig)
    caption = (
        "Residuals of every reading, made independent of one another and divided by the noise of the sheet; bands "
        f"are ±2σ, lanes ±{EDGE:g}σ, lines a standard normal density. Crosses are outliers.{_rms(fit)}"
    )
    return Picture("residuals", content, "Residuals", caption)


def _rms(fit: CalibrationSolution) -> str:
    own = fit.whitening
    sizes = [
        float(np.sqrt(np.mean(own.instant(own.without_slow(e.residual))[own.present] ** 2)))
        for e in (fit.nominal, fit.at)
    ]
    return f" Root mean square: {sizes[0]:.3g} sigma of the nominal model, {sizes[1]:.3g} of the calibrated one."


def _postures_along(ax: Axes, fit: CalibrationSolution) -> None:
    for posture, indices in _labels(fit).items():
        ax.axvline(float(indices[0]), color="#c8ced4", lw=0.7, zorder=0)
        ax.annotate(posture, (float(indices[0]), 1.0), xycoords=("data", "axes fraction"), xytext=(3, -9),
                    textcoords="offset points", fontsize=7.5, color="#5b6570")  # fmt: skip


def _interval_picture(document: Calibration) -> Picture | None:
    """Values over nominal with their intervals."""
    rows = [row for row in document.parameters if row.over_nominal is not None]
    if not rows:
        return None
    with figure(0.7 + 0.3 * len(rows), 1) as (fig, (ax,)):
        for k, row in enumerate(rows):
            low, high = (end / row.nominal - 1.0 for end in row.interval95)
            ax.plot([100.0 * low, 100.0 * high], [k, k], color=CALIBRATED, lw=2.2, solid_capstyle="butt")
            ax.plot(100.0 * (row.value / row.nominal - 1.0), k, "o", color=INK, ms=4.0)
        ax.axvline(0.0, color=NOMINAL, lw=1.0)
        ax.set_yticks(range(len(rows)), [row.name for row in rows])
        ax.set_ylim(len(rows) - 0.4, -0.6)
        ax.set_xlabel("value against nominal, %")
        content = drawing_of(fig)
    caption = "95 % intervals by the profile of the likelihood; the vertical line is the nominal value."
    return Picture("intervals", content, "Intervals", caption)


def _correlation_picture(document: Calibration) -> Picture:
    names = [_short(name) for name in document.joint.names]
    C = np.array(document.joint.correlation)
    n = len(names)
    # names stand upright below
    below = LETTER * max(map(len, names), default=0)
    with figure(0.8 + below + 0.24 * n, 1) as (fig, (ax,)):
        ax.grid(visible=False)
        image = ax.imshow(C, cmap="RdBu_r", norm=TwoSlopeNorm(0.0, -1.0, 1.0))
        ax.set_xticks(range(n), names, rotation=90, fontsize=7.0)
        ax.set_yticks(range(n), names, fontsize=7.0)
        if n <= MOST_NAMED:
            _write_values(ax, C)
        ours = len(document.parameters) + sum(row.seen for row in document.combinations)
        for place in (ax.axvline, ax.axhline):
            place(ours - 0.5, color=INK, lw=0.8)
        fig.colorbar(image, ax=ax, shrink=0.6, label="correlation")
        content = drawing_of(fig)
    caption = (
        "Correlation of what the calibration states: parameters and combinations first, the sheet's nuisances "
        f"behind the lines. Written from {STRONG} on."
    )
    return Picture("correlation", content, "Correlation", caption)


def _short(name: str, most: int = 30) -> str:
    return name if len(name) <= most else name[: most - 1] + "…"


def _write_values(ax: Axes, C: Array) -> None:
    rows: Sequence[tuple[int, ...]] = list(np.ndindex(*C.shape))
    for i, j in rows:
        if i != j and abs(C[i, j]) >= STRONG:
            colour = "white" if abs(C[i, j]) > 0.6 else INK
            ax.text(
                j,
                i,
                f"{C[i, j]:.1f}".replace("0.", ".").replace("-", "−"),
                ha="center",
                va="center",
                fontsize=6.0,
                color=colour,
            )


# ------------------------------------------------------------------------------------------------------------------


def write_page(measurement: Measurement, fit: CalibrationSolution, document: Calibration) -> str:
    """The page as HTML."""
    template = environment("vjm_updating.calibration").get_template("calibration.html.j2")
    return template.render(
        found=document,
        source=measurement.sheet.test.source,
        pictures=pictures(fit, document),
        interval=interval,
    )
