"""How far two paths of the same chain lie apart."""

from __future__ import annotations

import numpy as np

from vjm.continuation.path import Path
from vjm.rotations import Array
from vjm_validation.metrics import force_at


def force_difference(path: Path, reference: Path) -> float:
    """Largest difference in N between two paths' forces at equal displacement, as far as both go."""
    end = min(path.points[-1].s, reference.points[-1].s)
    nodes = np.unique(np.concatenate([path.s, reference.s, [e.s for e in (*path.events, *reference.events)]]))
    return max(abs(force_at(path, s) - force_at(reference, s)) for s in nodes[nodes <= end])


def deflection(path: Path, index: int = -1) -> dict[tuple[str, float], Array]:
    """Displacement ``(3,)`` in mm of every station from the unloaded shape, by part and fraction."""
    moved = path.points[index].shape - path.points[0].shape
    labels = [(label.part, round(label.fraction, 9)) for label in path.stations]
    return dict(zip(labels, moved, strict=True))


def shape_difference(path: Path, reference: Path) -> float:
    """Largest distance between the deflected shapes at the two paths' ends, over the reference's amplitude.

    Compared at the stations that both have.

    Raises:
        ValueError: the paths end at different displacements or share no station.
    """
    if not np.isclose(path.points[-1].s, reference.points[-1].s, rtol=1e-9):
        raise ValueError(f"{path.engine} and {reference.engine} end at different displacements")
    ours, theirs = deflection(path), deflection(reference)
    shared = sorted(ours.keys() & theirs.keys())
    if not shared:
        raise ValueError(f"{path.engine} and {reference.engine} share no station")
    amplitude = max(float(np.linalg.norm(v)) for v in theirs.values())
    return max(float(np.linalg.norm(ours[label] - theirs[label])) for label in shared) / amplitude
