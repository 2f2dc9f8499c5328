"""How beams become elements, and what an element's section is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vjm.model.parts import Beam, Section
from vjm.rotations import Array
from vjm_fea.common.points import NEAR


@dataclass(frozen=True)
class Mesh:
    """How beams become elements.

    Attributes:
        elements: of every beam that is meshed.
        shear: whether the section's own shear stiffness counts; else beams are shear-rigid.
        corrected: residual-flexibility correction ``1/GA* = 1/GA + h²/(12 EI)``. The one-point element alone
            is of second order; with it, bending in a plane is of fourth, and shear-rigid beams are possible.
        foot_spring: the foot as one 6×6 spring at its tip instead of a beam.
    """

    elements: int = 16
    shear: bool = False
    corrected: bool = True
    foot_spring: bool = False

    def __post_init__(self) -> None:
        if self.elements < 1:
            raise ValueError(f"a beam needs at least one element, not {self.elements}")
        if not self.corrected and not self.shear:
            raise ValueError("the plain element needs a finite shear stiffness: ask for shear=True")

    def grid(self, points: Sequence[float] = ()) -> Array:
        """Fractions ``(n + 1,)`` of a beam at which its nodes are; see `grid`."""
        return grid(self.elements, points)

    def section_stiffness(self, section: Section, h: float, name: str) -> Array:
        """Stiffness ``(6, 6)`` of an element ``h`` mm long: EA, GA*y, GA*z, GJ, EIy, EIz on the diagonal.

        Raises:
            ValueError: the plain element, and a section without a finite shear stiffness.
        """
        # GAy lets the beam deflect along y, as bending about z does
        flexibility = np.array([1.0 / section.GAy, 1.0 / section.GAz]) if self.shear else np.zeros(2)
        if self.corrected:
            flexibility = flexibility + h**2 / (12.0 * np.array([section.EIz, section.EIy]))
        if not np.all(flexibility > 0.0):
            raise ValueError(f"part '{name}': the plain element needs finite GAy and GAz")
        GAy, GAz = 1.0 / flexibility
        return np.diag([section.EA, GAy, GAz, section.GJ, section.EIy, section.EIz])


def grid(elements: int, points: Sequence[float] = ()) -> Array:
    """Fractions ``(n + 1,)`` of a beam at which its nodes are: equal elements between points that need a node.

    Args:
        elements: of the whole beam; where points need nodes of their own there may be more.
        points: fractions from 0 to 1; others are left out.
    """
    inside = [at for at in sorted(points) if NEAR < at < 1.0 - NEAR]
    uniform = np.arange(elements + 1) / elements
    if all(np.abs(uniform - at).min() < NEAR for at in inside):
        return uniform
    ends = [0.0, *(at for at, before in zip(inside, [0.0, *inside], strict=False) if at - before > NEAR), 1.0]
    spans = [
        np.linspace(a, b, max(1, round((b - a) * elements)) + 1)[1:] for a, b in pairwise(ends)
    ]  # fmt: skip
    return np.concatenate([[0.0], *spans])


def lumped_mass(beam: Beam, fractions: Array, i: int) -> tuple[float, float]:
    """A node's share of a beam's mass in kg, and how far ahead of the node its centre is in mm.

    Half of an element's mass is lumped at either node, a sixth of the element's length inside. These are the force
    and moment by which beam theory replaces an even load, q h/2 and q h²/12, so that nodes are where it has them.
    """
    steps = np.diff(fractions)
    before = float(steps[i - 1]) if i > 0 else 0.0
    after = float(steps[i]) if i < len(steps) else 0.0
    mass = 0.5 * beam.mass * (before + after)
    # mean of ± h/6, each weighted by its half element
    offset = beam.length * (after**2 - before**2) / (6.0 * (before + after))
    return mass, offset
