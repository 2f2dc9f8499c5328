"""The scene that a page turns: models over each other along their paths, as the data that its script draws."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vjm.continuation.path import Equilibrium, Path
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_output.plot_style import FE, engine_style
from vjm_validation.report.figures import force_at
from vjm_validation.report.skeleton import Camera, Skeleton, magnification, picture_axes, skeleton

STATES = 24
"""Along the path."""
ASPECT = 1.6
"""Width over height of what the script draws on."""
THIN = 0.012
"""Radius of what has no section, such as a rigid arm, over the chain's extent."""


Draw = Callable[[Path, Equilibrium], Skeleton]
"""The lines of a path's machine at one of its points."""


def turnable(chain: Machine, paths: Mapping[str, Path]) -> str:
    """JSON of a chain's scene, see `scene`.

    Args:
        chain: whose parts are drawn.
        paths: by engine label; the first one's unloaded shape is shown too.
    """
    return scene(paths, lambda path, point: skeleton(chain, path, point), radii_of(chain), picture_axes)


def scene(
    paths: Mapping[str, Path],
    draw: Draw,
    radii: Mapping[str, float],
    axes: Callable[[Sequence[Skeleton]], tuple[Array, Array]],
) -> str:
    """JSON of a scene, see ``vjm_output/templates/scene.js``; mm and N.

    Args:
        paths: by engine label; the first one's unloaded shape is shown too.
        draw: what is drawn.
        radii: of the tubes, mm, by part; what has none is thin.
        axes: right and up ``(3,)`` of the first view by what is seen at the paths' ends.
    """
    critical = [path.critical.s for path in paths.values() if path.critical and path.critical.point]
    end = min(path.s[-1] for path in paths.values())
    s = np.unique(np.concatenate([np.linspace(0.0, end, STATES), [v for v in critical if v <= end]]))
    shapes = {label: _along(draw, path, s) for label, path in paths.items()}
    ends = [moved[-1] for moved in shapes.values()]
    times = [magnification([moved[k] for moved in shapes.values()]) for k in range(len(s))]
    start = int(np.argmin(np.abs(s - min(critical)))) if critical and min(critical) <= end else len(s) - 1
    right, up = axes(ends)
    camera = Camera.framing(right, up, [moved[start] for moved in shapes.values()], times[start])
    extent = float(np.max(np.ptp(ends[0].points, axis=0)))
    gap = _gaps(shapes) if FE in shapes and len(shapes) == 2 else None
    compared = next((label for label in shapes if label != FE), "")
    document = {
        "s": _rounded(s),
        "start": start,
        "times": times,
        "right": _rounded(right, 5),
        "up": _rounded(up, 5),
        "focus": _rounded(camera.focus),
        "size": round(1.2 * max(camera.half_width, ASPECT * camera.half_height), 3),
        "joint": round(THIN * extent, 3),
        "largest": 0.0 if gap is None else round(float(gap.max()), 6),
        "models": [
            {
                "name": label,
                "colour": engine_style(label).colour,
                "rest": _rounded(along[0].points),
                "pieces": _pieces(radii, along[0], THIN * extent),
                "joints": list(along[0].joints),
                "moved": [_rounded(one.moved, 4) for one in along],
                "force": _rounded(force_at(paths[label], s), 2),
                "gap": _rounded(gap, 5) if gap is not None and label == compared else None,
            }
            for label, along in shapes.items()
        ],
    }
    return json.dumps(document, separators=(",", ":"))


def radii_of(chain: Machine) -> dict[str, float]:
    """Radius of the tube that stands for each beam whose section is known, mm.

    That of the full circle whose two radii of gyration have the product of the section's, so that a flat bar shows
    by its mean thickness.
    """
    radii = {}
    for beam in chain.beams:
        if beam.section is not None:
            gyration = np.sqrt(np.sqrt(beam.section.EIy * beam.section.EIz) / beam.section.EA)
            radii[beam.name] = 2.0 * float(gyration)
    return radii


def _rounded(values: Array, digits: int = 3) -> Any:  # noqa: ANN401
    return np.round(values, digits).tolist()


def _along(draw: Draw, path: Path, s: Array) -> list[Skeleton]:
    """The machine's lines at displacements ``(k,)``, linear between the points of the path."""
    points: list[Equilibrium] = [*path.points, *(e.point for e in path.events if e.point is not None)]
    points.sort(key=lambda point: point.s)
    at = np.array([point.s for point in points])
    result = []
    for value in s:
        high = int(np.clip(np.searchsorted(at, value), 1, len(at) - 1))
        low = high - 1
        share = (value - at[low]) / (at[high] - at[low]) if at[high] > at[low] else 1.0
        a, b = (draw(path, points[k]) for k in (low, high))
        moved = a.moved + np.clip(share, 0.0, 1.0) * (b.moved - a.moved)
        result.append(Skeleton(b.points, moved, b.pieces, b.joints, b.beads, b.parts))
    return result


def _gaps(shapes: Mapping[str, list[Skeleton]]) -> Array:
    """Distance ``(k, points)`` of the other model's line from the finite elements' at equal length along it, mm."""
    (other,) = (along for label, along in shapes.items() if label != FE)
    theirs = shapes[FE]

    def lengths(one: Skeleton) -> Array:
        steps = np.linalg.norm(np.diff(one.points, axis=0), axis=1)
        # points that lie on each other keep their order
        return np.concatenate([[0.0], np.cumsum(steps + 1e-9)])

    ours, reference = lengths(other[0]), lengths(theirs[0])
    result = []
    for a, b in zip(other, theirs, strict=True):
        there = np.stack([np.interp(ours, reference, b.moved[:, d]) for d in range(3)], axis=1)
        result.append(np.linalg.norm(a.moved - there, axis=1))
    return np.array(result)


def _pieces(radii: Mapping[str, float], one: Skeleton, thin: float) -> list[list[float]]:
    """(first row, last row + 1, radius) of each line; lines of one radius end where the part does."""
    found: list[list[float]] = []
    for first, last, fine in one.pieces:
        begin = first
        for row in range(first + 1, last):
            if row == last - 1 or one.parts[row + 1] != one.parts[row]:
                radius = 0.5 * thin if fine else radii.get(one.parts[row], thin)
                found.append([begin, row + 1, round(radius, 3)])
                begin = row
    return found
