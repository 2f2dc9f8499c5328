"""The chapter on the real parallelogram: what one bar of double stiffness stands for, and what it does not."""

from __future__ import annotations

import numpy as np

from vjm_output.number_text import DASH, number, percent
from vjm_output.plot_style import Picture, drawing_of, figure
from vjm_validation.report.tables import ReportTable
from vjm_validation.report.words import ReportFinding, Tone
from vjm_validation.studies.parallelogram import (
    ParallelogramComparison,
    ParallelogramRobots,
    ParallelogramStiffness,
)
from vjm_validation.studies.study_results import Run

TITLE = "A parallelogram is not one bar of double stiffness"
DIRECTIONS = ("along the bars, N/mm", "across, in its plane, N/mm", "across, out of its plane, N/mm",
              "torsion, N mm/rad", "bending out of its plane, N mm/rad", "turn in its plane, N mm/rad")  # fmt: skip
ZERO = 1e-6
"""Stiffness over that of the real parallelogram's largest of the kind below which it is none."""


def parallelogram(run: Run) -> ReportFinding | None:
    """Where the paper's replacement is good, and where not."""
    found = run.parallelogram
    if found is None:
        return None
    sentences = (
        "The paper replaces each parallelogram, two bars between four hinges, by one bar of double stiffness "
        "between two. Both were computed with the near axis held; the real one as a closed loop of two legs, in "
        "the virtual joint method and in Exudyn.",
        _verdict(_checked(found, "straight")),
        _whole(found.robots),
    )
    return ReportFinding(Tone.CAUSE, TITLE, sentences)


def parallelogram_tables(found: ParallelogramComparison) -> list[ReportTable]:
    """Stiffness of the parallelogram alone, straight and turned, and of the whole robot with either."""
    alone = [e for e in found.elements if e.exudyn is not None]
    return [*(_alone(e) for e in alone), _robots(found.robots)]


def _checked(found: ParallelogramComparison, pose: str) -> ParallelogramStiffness:
    return next(e for e in found.elements if e.exudyn is not None and e.pose == pose)


def _alone(e: ParallelogramStiffness) -> ReportTable:
    assert e.exudyn is not None
    rows = []
    for k, name in enumerate(DIRECTIONS):
        scale = np.abs(e.real[:3] if k < 3 else e.real[3:]).max()
        values = [0.0 if abs(v) < ZERO * scale else float(v) for v in (e.single[k], e.real[k], e.exudyn[k])]
        ratio = number(values[1] / values[0], 3) if values[0] else ("∞" if values[1] else DASH)
        rows.append((name, number(values[0]), number(values[1]), ratio, number(values[2])))
    what = "straight" if e.pose == "straight" else "turned by 30°"
    header = ("", "one bar, doubled", "two bars", "ratio", "two bars, Exudyn")
    return ReportTable(f"Parallelogram alone, bars {e.distance:g} mm apart, {what}", header, tuple(rows))


def _verdict(e: ParallelogramStiffness) -> str:
    assert e.exudyn is not None
    torsion = e.real[3] / e.single[3]
    felt = np.abs(e.real) > ZERO * np.repeat([np.abs(e.real[:3]).max(), np.abs(e.real[3:]).max()], 3)
    apart = float(np.max(np.abs(e.real[felt] / e.exudyn[felt] - 1.0)))
    return (
        f"Along the bars and out of the plane the replacement is exact. It is not in torsion, where the two "
        f"bars bend as well as twist: the real one is {number(float(torsion), 3)} times as stiff, which grows "
        f"with the square of the distance. And it leaves the far axis free to turn in the plane, which the "
        f"real one holds by the bars' stretch. Exudyn has the same to {percent(apart)}."
    )


def _robots(robots: tuple[ParallelogramRobots, ...]) -> ReportTable:
    rows = []
    for r in robots:
        for name, values, force in (
            ("one bar", r.single, r.critical_single),
            ("two bars", r.real, r.critical_real),
        ):
            soft, stiff = (", ".join(number(float(v), 3) for v in part) for part in (values[:3], values[3:]))
            rows.append((r.pose, name, soft, stiff, number(force)))
    caption = (
        "The whole Orthoglide: eigenvalues of the platform's stiffness, turns over 310 mm, N/mm. The force "
        "against x at which the free platform loses its stability, N"
    )
    return ReportTable(
        caption, ("pose", "", "three soft ones", "three stiff ones", "lost at"), tuple(rows), words=2
    )


def _whole(robots: tuple[ParallelogramRobots, ...]) -> str:
    ratio = min(float(r.real[0] / r.single[0]) for r in robots)
    return (
        f"In the whole Orthoglide the platform's shifts are alike; its turns are at least {number(ratio, 2)} "
        "times as stiff with real parallelograms. The single bar between universal joints leaves two of a leg's "
        "constraints where the parallelogram has three: the platform is held against turning by torsion alone."
    )


def distance_picture(found: ParallelogramComparison) -> Picture:
    """Torsion and turn in the plane against the bars' distance."""
    own = sorted((e for e in found.elements if e.exudyn is None), key=lambda e: e.distance)
    d = np.array([e.distance for e in own])
    checked = _checked(found, "straight")
    assert checked.exudyn is not None
    with figure(2.8, 2) as (fig, axes):
        for ax, k, name in zip(axes, (3, 5), ("torsion", "turn in the plane"), strict=True):
            ax.plot(d, [e.real[k] for e in own], "o-", color="#0072B2", label="two bars")
            ax.plot(d, [max(e.single[k], 0.0) for e in own], "--", color="#D55E00", label="one bar, doubled")
            ax.plot([checked.distance], [checked.exudyn[k]], "x", color="#000000", ms=8, label="two bars, Exudyn")
            ax.set(xlabel="distance of the bars, mm", ylabel=f"{name}, N mm/rad", ylim=(0.0, None))
        axes[0].legend()
        content = drawing_of(fig)
    return Picture(
        "parallelogram_distance",
        content,
        "What a parallelogram resists that one bar does not",
        "Stiffness of the far axis against torsion and against a turn in the parallelogram's plane, the near axis "
        "held, over the distance of the bars.",
    )
