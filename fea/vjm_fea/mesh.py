"""How beams become elements, and what an element's section is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.parts import Section
from vjm.rotations import Array


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
