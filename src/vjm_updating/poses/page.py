"""The page of a diagnosis or a calibration of a robot in many postures, which needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.machine.equilibria import unloaded_frames
from vjm_output.plots import Picture, drawing_of, figure
from vjm_output.templating import environment
from vjm_updating.diagnosis.figures import HEADLINES, TONES, picture
from vjm_updating.poses.document import (
    NOT_HELD_OUT,
    PoseCalibration,
    PoseDiagnosis,
    interval,
    of_asked,
    of_file,
    of_range,
    weighed_down,
    within_words,
)
from vjm_updating.poses.identifiability import RangeSupport
from vjm_updating.poses.measurement import RobotSheet
from vjm_updating.poses.selection import Step
from vjm_updating.poses.study import Study

BEFORE, AFTER, FITTED = "#D55E00", "#0072B2", "#7a7a7a"


def page(
    sheet: RobotSheet,
    study: Study,
    steps: Sequence[Step],
    support: RangeSupport | None,
    calibration: PoseCalibration,
) -> str:
    """The page as HTML."""
    diagnosis = calibration if isinstance(calibration, PoseDiagnosis) else None
    template = environment("vjm_updating.poses").get_template("poses.html.j2")
    return template.render(
        title=sheet.test.title or sheet.file, model=study.machine.chain.name, sheet=sheet, data=study.data.file,
        found=calibration, diagnosis=diagnosis,
        selection=diagnosis.selection if diagnosis else [calibration.before, calibration.after],
        headline=HEADLINES[diagnosis.verdict] if diagnosis else f"Calibration by {calibration.kind}.",
        tone=TONES[diagnosis.verdict] if diagnosis else "cause",
        chart=picture(diagnosis.findings) if diagnosis else None,
        interval=interval, not_held_out=NOT_HELD_OUT,
        said=[
            *([] if diagnosis else [of_file(calibration.written)]), *weighed_down(calibration),
            *of_range(calibration.written),
            *of_asked(calibration), *within_words(calibration.written.valid_within),
        ],
        pictures=[
            _selection(steps, calibration.baseline), _residuals(steps, calibration.baseline),
            *([] if support is None else [_map(study, support)]),
        ],
    )  # fmt: skip


def _map(study: Study, support: RangeSupport) -> Picture:
    """How well the file is known over the workspace."""
    measured = unloaded_frames(study.machine.tree, study.machine.rows(study.data.q))[1][:, 0]
    with figure(3.2, columns=1) as (fig, (axes,)):
        out = np.linalg.norm(support.place[:, :2], axis=1)
        dots = axes.scatter(out, support.place[:, 2], c=support.error, s=12, vmin=0.0, label="drawn")
        axes.plot(np.linalg.norm(measured[:, :2], axis=1), measured[:, 2], "k+", ms=3, mew=0.5, label="measured")
        fig.colorbar(dots, ax=axes, label="predicted error, mm")
        axes.set_xlabel("distance from the base's z axis, mm")
        axes.set_ylabel("height, mm")
        axes.legend()
        drawing = drawing_of(fig)
    return Picture(
        "whole-range", drawing, "How well the file is known over the workspace",
        f"{len(support.error)} postures drawn over the joints' whole range: how far fits without one region of the "
        "measured postures each lie apart there.",
    )  # fmt: skip


def _selection(steps: Sequence[Step], baseline: str) -> Picture:
    names = [baseline, *(step.added for step in steps[1:])]
    means = np.array([step.state.errors.means for step in steps])
    with figure(2.6, columns=1) as (fig, (axes,)):
        ticks = np.arange(len(steps))
        for column, (label, colour, mark) in enumerate(
            (("fitted", FITTED, "."), (steps[0].state.errors.way, AFTER, "o"), ("held out by region", BEFORE, "^"))
        ):
            if np.isfinite(means[:, column]).any():
                axes.plot(ticks, means[:, column], mark + "-", color=colour, label=label, lw=1.2, ms=4)
        axes.set_xticks(ticks, [name.replace("_", " ") for name in names], rotation=20, ha="right")
        axes.set_yscale("log")
        axes.set_ylabel("mean distance, mm")
        axes.legend()
        drawing = drawing_of(fig)
    return Picture(
        "selection",
        drawing,
        "Stepwise selection",
        "Mean distance of the markers from their predictions, step by step.",
    )


def _residuals(steps: Sequence[Step], baseline: str) -> Picture:
    errors = [step.state.errors for step in (steps[0], steps[-1])]
    held = errors[0].held_out
    words = "held out" if held else "fitted"
    first, last = (one.between if held else one.fitted for one in errors)
    with figure(2.4, columns=2) as (fig, axes):
        order = np.arange(len(first))
        largest = max(float(np.nanmax(np.nanmean(one, axis=1))) for one in (first, last))
        bins = np.linspace(0.0, largest, int(np.clip(len(first) // 8, 8, 40)) + 1).tolist()
        for distance, label, colour in ((first, baseline, BEFORE), (last, "at the end", AFTER)):
            mean = np.nanmean(distance, axis=1)
            axes[0].plot(order, mean, ".", ms=2, color=colour, label=label)
            axes[1].hist(mean, bins=bins, color=colour, alpha=0.6, label=label)
        axes[0].set_xlabel("reading, in the order of the file")
        axes[0].set_ylabel(f"distance {words}, mm")
        axes[0].set_yscale("log")
        axes[1].set_xlabel(f"distance {words}, mm")
        axes[1].set_ylabel("readings")
        axes[1].legend()
        drawing = drawing_of(fig)
    title = f"Postures {errors[0].way}" if held else "Readings fitted"
    caption = "Each predicted without its own part of the test." if held else f"{NOT_HELD_OUT.capitalize()}."
    return Picture("residuals", drawing, title, caption)
