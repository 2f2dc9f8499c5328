"""What closes loops of a machine: frames that are held together, and joints that a transmission couples."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array


@dataclass(frozen=True)
class Closure:
    """Two frames of a machine that are held together, which closes a loop.

    A hinge, a slide or a universal joint between them is a passive joint before one of the two frames.

    Attributes:
        name: for people; unique among the closures.
        parts: names of the parts behind whose ends the two frames lie; empty for the base.
        frames: ``(2, 4, 4)`` mm, from the frame behind each part's end; from the world for the base. The ends
            themselves if left out.
        turns: whether one frame may turn against the other in all directions, as in a ball joint; else both are
            welded together.

    Example:
        >>> import vjm
        >>> [closure.name for closure in vjm.load("palletiser").closures]
        ['parallelogram']
    """

    name: str
    parts: tuple[str, str]
    frames: Array = field(default_factory=lambda: np.stack([np.eye(4)] * 2))
    turns: bool = False

    @property
    def rows(self) -> int:
        """Number of components that it holds: six of a weld, three of a ball joint."""
        return 3 if self.turns else 6


@dataclass(frozen=True)
class Coupling:
    """A rigid transmission between passive joints: ``Σ weight · coordinate = total``.

    Attributes:
        name: for people; unique among the couplings.
        terms: names of passive joints and their weights.
        total: of the weighted coordinates, rad or mm.

    Example:
        >>> import vjm
        >>> half = vjm.Coupling("equal", (("left", 1.0), ("right", -1.0)))
        >>> half.total
        0.0
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    total: float = 0.0
