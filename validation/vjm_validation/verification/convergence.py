"""Solution verification: observed order, Richardson's extrapolation and the grid convergence index.

Roache, *Verification and Validation in Computational Science and Engineering* (1998); ASME V&V 20-2009, section 2;
for meshes that do not grow by one ratio Celik et al., *J. Fluids Eng.* 130 (2008), 078001. With h = 1/n and meshes
f₁, f₂, f₃ from coarse to fine,

    (f₁ − f₂)/(f₂ − f₃) = (h₁ᵖ − h₂ᵖ)/(h₂ᵖ − h₃ᵖ),   f = f₃ + (f₃ − f₂)/(rᵖ − 1),   GCI = 1.25 |f₃ − f₂|/(rᵖ − 1),

r = h₂/h₃. Where the answer is known exactly, p is the slope of the logarithms of all errors instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

SAFETY = 1.25
"""Roache's factor for three meshes or more."""
ABOVE = 1e-8
"""Relative error from which digits tell of the mesh, and not of events' places (found to 1e-9 of the path) or of
rounding."""
FLOOR = 2e-9
"""Relative change between meshes below which it says nothing."""
LOWEST_ORDER = 0.5
"""An observed order below is replaced by this in the error estimate: it would grow without bounds."""
HIGHEST_ORDER = 16.0
"""Orders are sought up to here; the springs' tenth is the highest in the house."""
ORDER_TOLERANCE = 0.2
"""How far the observed order may be from that of theory."""
MESHLESS = 0.05
"""An order of errors nearer to zero than this has nothing to do with meshes."""
EXACT = "exact at every mesh"
SAME = "the same error at every mesh"
TOO_FEW = "too few meshes above 1e-8 for an order"


@dataclass(frozen=True)
class Convergence:
    """What a sequence of meshes says.

    Attributes:
        order: observed; None where there are too few meshes above the floor, or where the values oscillate.
        extrapolated: Richardson's limit; None without three meshes.
        gci: in the values' unit, not relative; None without three meshes.
        flag: empty where the meshes converge as theory says; else in words.
    """

    order: float | None
    extrapolated: float | None
    gci: float | None
    flag: str = ""

    def as_theory_says(self, theory: float | None) -> bool:
        """Whether the order is within `ORDER_TOLERANCE` of ``theory``, or no mesh has an error to speak of."""
        if self.flag == EXACT:
            return True
        return theory is None or (self.order is not None and abs(self.order - theory) <= ORDER_TOLERANCE)


def convergence(
    meshes: Sequence[int], values: Sequence[float], size: float, theory: float | None, exact: float | None = None
) -> Convergence:
    """Observed order, limit and error estimate of a quantity.

    Args:
        meshes: from coarse to fine.
        values: one a mesh.
        size: to which relative figures refer, in the values' unit.
        theory: order by theory, where it is known.
        exact: the answer, where it is known exactly.
    """
    if len(values) < 3:
        return Convergence(None, None, None, "fewer than three meshes")
    f1, f2, f3 = values[-3:]
    coarse, fine = f2 - f1, f3 - f2
    floor = FLOOR * size
    if exact is not None:
        errors = [abs(value - exact) / size for value in values]
        order = fitted_order(meshes, errors)
        flag = _flag_of_errors(errors, order, theory)
        if order is not None and abs(order) < MESHLESS:
            order, flag = None, SAME
    else:
        order = three_mesh_order(meshes[-3:], coarse, fine) if abs(fine) > floor else None
        flag = _flag_of_changes(order, theory, coarse, fine, floor)
    used = theory if theory is not None else 2.0
    if order is not None:
        # a lucky order would make the estimate too small, one near zero would blow it up
        used = float(np.clip(order, LOWEST_ORDER, max(theory, LOWEST_ORDER) if theory is not None else order))
    gain = (meshes[-1] / meshes[-2]) ** max(used, LOWEST_ORDER) - 1.0
    return Convergence(order, f3 + fine / gain, SAFETY * abs(fine) / gain, flag)


def fitted_order(meshes: Sequence[int], errors: Sequence[float]) -> float | None:
    """Slope of log error by −log mesh, by least squares over the errors above `ABOVE`; None with under three."""
    used = [(n, error) for n, error in zip(meshes, errors, strict=True) if error > ABOVE]
    if len(used) < 3:
        return None
    n, error = np.log(np.array(used, dtype=float)).T
    return float(-np.polyfit(n, error, 1)[0])


def three_mesh_order(meshes: Sequence[int], coarse: float, fine: float) -> float | None:
    """Order from the differences of three meshes; None where they oscillate or shrink too slowly or too fast.

    Args:
        meshes: three, from coarse to fine.
        coarse: f₂ − f₁.
        fine: f₃ − f₂.
    """
    if fine == 0.0 or coarse / fine <= 0.0:
        return None
    ratio = coarse / fine
    h1, h2, h3 = (1.0 / n for n in meshes)

    def excess(order: float) -> float:
        return float((h1**order - h2**order) / (h2**order - h3**order)) - ratio

    low = 1e-3
    if excess(low) > 0.0 or excess(HIGHEST_ORDER) < 0.0:
        return None
    return brentq(excess, low, HIGHEST_ORDER)


def _flag_of_errors(errors: Sequence[float], order: float | None, theory: float | None) -> str:
    if max(errors) <= ABOVE:
        return EXACT
    if order is None:
        return TOO_FEW
    return _compared(order, theory)


def _flag_of_changes(order: float | None, theory: float | None, coarse: float, fine: float, floor: float) -> str:
    if abs(fine) <= floor:
        return "at the rounding floor"
    if coarse * fine < 0.0:
        return "oscillates"
    if order is None:
        return "no order within the three meshes"
    return _compared(order, theory)


def _compared(order: float, theory: float | None) -> str:
    if theory is None or abs(order - theory) <= ORDER_TOLERANCE:
        return ""
    return "slower than theory" if order < theory else "faster than theory"
