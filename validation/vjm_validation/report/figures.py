"""The figures of one posture: force, stiffness and difference to the finite elements along each path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vjm.continuation.path import Path
from vjm.model.load_case import Direction
from vjm.rotations import Array
from vjm_output.number_text import number
from vjm_output.plots import (
    EVENT_MARKERS,
    FE,
    FE_FOOT_SPRING,
    FOOT_SPRING,
    LINEAR,
    MSA,
    PAPER,
    REFINED,
    Picture,
    drawing_of,
    engine_order,
    engine_style,
    figure,
)
from vjm_validation.studies.chain import Run

DRAWN = (PAPER, REFINED, FE, FE_FOOT_SPRING, FOOT_SPRING, "opensees")
"""Engines whose force is worth a line of its own.

The linear ones share one straight line, drawn as `LINEAR`.
"""

HEADROOM = 1.6
"""Height of a force axis over the smallest force at a path's end, so that a plateau fills the panel."""
REACH = 3.0
"""Width of a displacement axis over the largest critical displacement, so that a critical point is seen."""
STIFFNESS_SPAN = 1e4
"""Largest ratio that a stiffness axis shows, so that a force maximum does not press all else together."""


def posture_paths(run: Run, posture: str, direction: Direction) -> dict[str, Path]:
    """The paths of one panel by engine label, in the order of the legend."""
    paths = {
        key.engine: path for key, path in run.paths.items() if (key.posture, key.direction) == (posture, direction)
    }
    return dict(sorted(paths.items(), key=lambda item: engine_order(item[0])))


def postures(run: Run) -> list[str]:
    """Labels of the postures that the run has paths for."""
    return sorted({key.posture for key in run.paths})


def posture_pictures(run: Run, posture: str) -> list[Picture]:
    """The figures of one posture; the last is missing where there are no finite elements to differ from."""
    panels = {d: posture_paths(run, posture, d) for d in Direction}
    panels = {d: paths for d, paths in panels.items() if paths}
    pictures = [force_picture(run, posture, panels), stiffness_picture(posture, panels)]
    if any(FE in paths and len(paths) > 1 for paths in panels.values()):
        pictures.append(difference_picture(posture, panels))
    return pictures


def force_picture(run: Run, posture: str, panels: Mapping[Direction, Mapping[str, Path]]) -> Picture:
    """Force against displacement."""
    with figure(3.5, len(panels)) as (fig, axes):
        for ax, (direction, paths) in zip(axes, panels.items(), strict=True):
            drawn = _drawn(paths)
            window = Window.around(drawn)
            for label, path in drawn.items():
                draw_force(ax, label, path)
            _say_what_leaves(ax, drawn, window)
            linear = next((paths[label] for label in (LINEAR, MSA) if label in paths), None)
            if linear is not None:
                _line(ax, LINEAR, linear.s, linear.force / 1e3)
            if direction is Direction.TENSION:
                _published_point(ax, run, posture)
            ax.set(xlim=(0.0, window.s), ylim=(0.0, window.force / 1e3), title=direction.capitalize())
            ax.set_xlabel(f"displacement {_sense(direction)}, mm")
        axes[0].set_ylabel("force, kN")
        legend(fig, axes)
        content = drawing_of(fig)
    return Picture(
        f"force_{posture}",
        content,
        f"Posture {posture}: force against displacement",
        "The rest of the pose is held. Hollow marks are critical points; a star is the published one. "
        f"An axis ends at {REACH:g} times the largest critical displacement and at {HEADROOM:g} times the "
        "smallest force at a path's end; where a line leaves the panel, the force at its end is written.",
    )


def stiffness_picture(posture: str, panels: Mapping[Direction, Mapping[str, Path]]) -> Picture:
    """Tangent stiffness against force."""
    with figure(3.3, len(panels), sharey=True) as (fig, axes):
        for ax, (direction, paths) in zip(axes, panels.items(), strict=True):
            drawn = _drawn(paths)
            for label, path in drawn.items():
                force, stiffness = stiffness_with_drops(path)
                _line(ax, label, force / 1e3, np.where(stiffness > 0.0, stiffness, np.nan))
            ax.set(xlim=(0.0, Window.around(drawn).force / 1e3), yscale="log", title=direction.capitalize())
            ax.set_xlabel("force, kN")
        unloaded = min(path.tangent[0] for paths in panels.values() for path in paths.values())
        lowest, highest = axes[0].get_ylim()
        axes[0].set_ylim(max(lowest, unloaded / STIFFNESS_SPAN), highest)
        axes[0].set_ylabel("tangent stiffness, N/mm")
        legend(fig, axes, events=False)
        content = drawing_of(fig)
    return Picture(
        f"stiffness_{posture}",
        content,
        f"Posture {posture}: stiffness against load",
        "Derivative of the driven force by the driven displacement along the stable path, on a logarithmic "
        "scale. A vertical drop is a bifurcation: the force stays, the stiffness is lost. Values at or below "
        "zero, beyond a force maximum, cannot be drawn.",
    )


def stiffness_with_drops(path: Path) -> tuple[Array, Array]:
    """Force and tangent stiffness along a path, with the two values at a bifurcation one above the other."""
    drops = [e for e in path.events if e.stiffness_before is not None and e.stiffness_after is not None]
    displacements = np.concatenate([path.s, np.repeat([event.s for event in drops], 2)])
    force = np.concatenate([path.force, np.repeat([event.force for event in drops], 2)])
    values = [value for event in drops for value in (event.stiffness_before, event.stiffness_after)]
    # a stable sort keeps the value before a bifurcation before the value after it; the point that the path
    # itself may hold there, where the tangent is not defined, is left out
    regular = ~np.isin(displacements, [event.s for event in drops])
    regular[path.s.size :] = True
    order = np.argsort(displacements, kind="stable")
    order = order[regular[order]]
    return force[order], np.concatenate([path.tangent, np.array(values, dtype=float)])[order]


def difference_picture(posture: str, panels: Mapping[Direction, Mapping[str, Path]]) -> Picture:
    """Difference of force to the finite elements at equal displacement."""
    norms = []
    with figure(3.3, len(panels), sharey=True) as (fig, axes):
        for ax, (direction, paths) in zip(axes, panels.items(), strict=True):
            ax.set_title(direction.capitalize())
            ax.set_xlabel(f"displacement {_sense(direction)}, mm")
            if FE not in paths:
                ax.text(0.5, 0.5, f"no path of {FE}", transform=ax.transAxes, ha="center")
                continue
            reference = paths[FE]
            critical = reference.critical
            what = "its force at the critical point" if critical else "its largest force"
            norms.append(f"{direction}: {what}, {number(reference_force(reference))} N")
            for label, path in paths.items():
                if label not in (FE, MSA):
                    s, difference = difference_to(path, reference)
                    _line(ax, label, s, 100.0 * difference)
            if critical:
                ax.axvline(critical.s, color="black", lw=0.8, ls=":")
            ax.set(xlim=(0.0, reference.s[-1]), ylim=(-1000.0, 1000.0))
            ax.set_yscale("symlog", linthresh=0.1, linscale=0.6)
            ax.set_yticks([sign * v for v in (0.1, 1.0, 10.0, 100.0, 1000.0) for sign in (-1, 1)] + [0.0])
            ax.yaxis.set_major_formatter(lambda v, _: f"{v:+g}".replace("-", "−") if v else "0")
            ax.minorticks_off()
        axes[0].set_ylabel(f"force less {FE}'s, % of the norm")
        legend(fig, axes, events=False)
        content = drawing_of(fig)
    return Picture(
        f"difference_{posture}",
        content,
        f"Posture {posture}: difference to the finite elements",
        f"Force less that of {FE} at the same displacement, over one norm a panel ({'; '.join(norms)}). The "
        f"scale is linear within ±0.1 % and logarithmic beyond. Dotted: the critical point of {FE}.",
    )


def reference_force(path: Path) -> float:
    """The norm of differences: the force at the critical point, else the largest on the path, N."""
    return path.critical.force if path.critical else float(np.max(path.force))


def difference_to(path: Path, reference: Path) -> tuple[Array, Array]:
    """Difference of force at equal displacement over the reference's norm, where both paths reach.

    Both grids are used: on one grid alone the kink at a critical point would be cut off and show as a
    difference that is none.
    """
    end = min(path.s[-1], reference.s[-1])
    events = [event.s for event in (*path.events, *reference.events)]
    s = np.unique(np.concatenate([path.s, reference.s, events]))
    s = s[s <= end]
    gap = force_at(path, s) - force_at(reference, s)
    return s, gap / reference_force(reference)


def force_at(path: Path, s: Array) -> Array:
    """Force at displacements between the points of a path, with its events as points, N."""
    displacements = np.concatenate([path.s, [event.s for event in path.events]])
    force = np.concatenate([path.force, [event.force for event in path.events]])
    order = np.argsort(displacements, kind="stable")
    return np.interp(s, displacements[order], force[order])


def worst_difference(path: Path, reference: Path) -> float:
    """The largest relative difference of force to a reference along the common path."""
    return float(np.max(np.abs(difference_to(path, reference)[1])))


def draw_force(ax: Axes, label: str, path: Path, sign: int = 1) -> None:
    """One engine's force against displacement, kN and mm, with its critical points."""
    _line(ax, label, sign * path.s, sign * path.force / 1e3)
    for event in path.events:
        ax.plot(
            sign * event.s, sign * event.force / 1e3, EVENT_MARKERS[event.kind], ms=6.5, mew=1.5,
            mfc="white", mec=engine_style(label).colour, zorder=engine_style(label).order + 2.0,
            label=f"_of {label}",
        )  # fmt: skip


@dataclass(frozen=True)
class Window:
    """What part of the paths a panel shows: mm and N from zero."""

    s: float
    force: float

    @classmethod
    def around(cls, paths: Mapping[str, Path]) -> Window:
        """The part that holds every critical point and the lowest plateau at a readable size."""
        end = max(path.s[-1] for path in paths.values())
        critical = [path.critical for path in paths.values() if path.critical]
        width = min(end, max((REACH * event.s for event in critical), default=end))
        force = HEADROOM * min(float(np.max(path.force)) for path in paths.values())
        return cls(width, max([force, *(1.15 * event.force for event in critical)]))


def _drawn(paths: Mapping[str, Path]) -> dict[str, Path]:
    """The engines that get a line; all of them where none is known."""
    known = {label: path for label, path in paths.items() if label in DRAWN}
    return known or dict(paths)


def _line(ax: Axes, label: str, x: Array, y: Array) -> None:
    style = engine_style(label)
    ax.plot(x, y, color=style.colour, ls=style.line, lw=style.width, zorder=style.order, label=label)


def _say_what_leaves(ax: Axes, paths: Mapping[str, Path], window: Window) -> None:
    """What the paper's model and the finite elements reach, where their lines leave the panel at its top.

    The lower right corner is free: every path rises.
    """
    leaving = [
        f"{label} reaches {path.force[-1] / 1e3:.1f} kN at {path.s[-1]:g} mm"
        for label, path in paths.items()
        if label in (PAPER, FE) and np.any(path.force[path.s <= window.s] > window.force)
    ]
    ax.text(0.98, 0.04, "\n".join(leaving), transform=ax.transAxes, fontsize=7.5, ha="right", va="bottom")


def _published_point(ax: Axes, run: Run, posture: str) -> None:
    rows: Sequence[Mapping[str, Any]] = run.summary.get("published", ())
    published = {row["quantity"]: row["published"] for row in rows if row["posture"] == posture}
    if published.get("F_cr") is not None and published.get("d_cr") is not None:
        ax.plot(
            published["d_cr"], published["F_cr"] / 1e3, "*", ms=16, mfc="#F0E442", mec="black", mew=0.8, zorder=4.2
        )


def _sense(direction: Direction) -> str:
    return "along +x" if direction is Direction.TENSION else "along −x"


def legend(fig: Figure, axes: Sequence[Axes], *, events: bool = True) -> None:
    """One legend above all panels: each engine once, then the marks of critical points that occur."""
    handles = {str(line.get_label()): line for ax in axes for line in ax.get_lines()}
    handles = {label: line for label, line in handles.items() if not label.startswith("_")}
    entries = [handles[label] for label in sorted(handles, key=engine_order)]
    if events:
        used = {
            line.get_marker()
            for ax in axes
            for line in ax.get_lines()
            if np.max(np.asarray(line.get_xdata())[:1]) <= ax.get_xlim()[1]
        }
        entries += [
            Line2D([], [], ls="", marker=marker, mfc="white", mec="black", mew=1.4, label=str(kind))
            for kind, marker in EVENT_MARKERS.items()
            if marker in used
        ]
        if "*" in used:
            entries.append(Line2D([], [], ls="", marker="*", ms=10, mfc="#F0E442", mec="black", label="published"))
    fig.legend(handles=entries, loc="outside upper center", ncols=min(5, len(entries)), handlelength=3.2)
