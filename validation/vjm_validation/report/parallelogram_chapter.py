"""The chapter on the real parallelogram: what one bar of double stiffness stands for, and what it does not."""

from __future__ import annotations

import numpy as np

from vjm_validation.parallelogram import Element, Robot, Study
from vjm_validation.report.style import Picture, figure, number, percent, png

TITLE = "A parallelogram is not one bar of double stiffness"
DIRECTIONS = ("along the bars, N/mm", "across, in its plane, N/mm", "across, out of its plane, N/mm",
              "torsion, N mm/rad", "bending out of its plane, N mm/rad", "turn in its plane, N mm/rad")  # fmt: skip
ZERO = 1e-6
"""Stiffness over that of the real parallelogram's largest of the kind below which it is none."""


def chapter(found: Study) -> tuple[str, list[Picture]]:
    """The chapter as Markdown, and its figures."""
    straight = next(e for e in found.elements if e.exudyn is not None and e.pose == "straight")
    turned = next(e for e in found.elements if e.exudyn is not None and e.pose != "straight")
    lines = [
        f"## {TITLE}",
        "",
        "The paper replaces each parallelogram, two bars between four hinges, by one bar of double "
        "stiffness between two. Both were computed with the near axis held; the real one as a closed loop "
        "of two legs, in the virtual joint method and in Exudyn.",
        "",
        *_table(straight),
        "",
        *_table(turned),
        "",
        _verdict(straight),
        "",
        *_robots(found.robots),
    ]
    return "\n".join(lines) + "\n", [distance_picture(found)]


def _table(e: Element) -> list[str]:
    assert e.exudyn is not None
    what = "straight" if e.pose == "straight" else "turned by 30°"
    rows = [
        f"Bars {e.distance:g} mm apart, {what}:",
        "",
        "| | one bar, doubled | two bars | ratio | two bars, Exudyn |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for k, name in enumerate(DIRECTIONS):
        scale = np.abs(e.real[:3] if k < 3 else e.real[3:]).max()
        values = [0.0 if abs(v) < ZERO * scale else float(v) for v in (e.single[k], e.real[k], e.exudyn[k])]
        ratio = number(values[1] / values[0], 3) if values[0] else ("∞" if values[1] else "–")
        rows.append(f"| {name} | {number(values[0])} | {number(values[1])} | {ratio} | {number(values[2])} |")
    return rows


def _verdict(e: Element) -> str:
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


def _robots(robots: tuple[Robot, ...]) -> list[str]:
    rows = [
        "In the whole Orthoglide, eigenvalues of the platform's stiffness (turns over 310 mm), N/mm, and the force "
        "against x at which the free platform loses its stability:",
        "",
        "| pose | | three soft ones | three stiff ones | lost at, N |",
        "| --- | --- | --- | --- | ---: |",
    ]
    for r in robots:
        for name, values, force in (
            ("one bar", r.single, r.critical_single),
            ("two bars", r.real, r.critical_real),
        ):
            soft, stiff = (", ".join(number(float(v), 3) for v in part) for part in (values[:3], values[3:]))
            rows.append(f"| {r.pose} | {name} | {soft} | {stiff} | {number(force)} |")
    softest = min(float(r.real[0] / r.single[0]) for r in robots)
    rows += [
        "",
        f"The platform's shifts are alike; its turns are at least {number(softest, 2)} times as stiff with real "
        f"parallelograms. The single bar between universal joints leaves two of a leg's constraints where the "
        f"parallelogram has three, so that the platform is held against turning by torsion alone.",
    ]
    return rows


def distance_picture(found: Study) -> Picture:
    """Torsion and turn in the plane against the bars' distance."""
    own = sorted((e for e in found.elements if e.exudyn is None), key=lambda e: e.distance)
    d = np.array([e.distance for e in own])
    checked = next(e for e in found.elements if e.exudyn is not None and e.pose == "straight")
    assert checked.exudyn is not None
    with figure(2.8, 2) as (fig, axes):
        for ax, k, name in zip(axes, (3, 5), ("torsion", "turn in the plane"), strict=True):
            ax.plot(d, [e.real[k] for e in own], "o-", color="#0072B2", label="two bars")
            ax.plot(d, [max(e.single[k], 0.0) for e in own], "--", color="#D55E00", label="one bar, doubled")
            ax.plot([checked.distance], [checked.exudyn[k]], "x", color="#000000", ms=8, label="two bars, Exudyn")
            ax.set(xlabel="distance of the bars, mm", ylabel=f"{name}, N mm/rad", ylim=(0.0, None))
        axes[0].legend()
        content = png(fig)
    return Picture(
        "parallelogram_distance",
        content,
        "What a parallelogram resists that one bar does not",
        "Stiffness of the far axis against torsion and against a turn in the parallelogram's plane, the near axis "
        "held, over the distance of the bars.",
    )
