"""Small displacements of cantilevers and of an L-shaped frame by the unit load method, in closed form.

Timoshenko's beam: the strain energy ½ ∫ (N²/EA + Q²/GA + M²/EI + T²/GJ) ds, and a displacement is its derivative by
the load (Castigliano 1879). N, mm, rad.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Bar:
    """A straight prismatic bar with equal bending stiffness in both planes.

    Attributes:
        length: mm.
        EI: bending stiffness, N mm².
        EA: axial stiffness, N.
        GA: shear stiffness, N.
        GJ: torsional stiffness, N mm².
    """

    length: float
    EI: float
    EA: float = float("inf")
    GA: float = float("inf")
    GJ: float = float("inf")

    def __post_init__(self) -> None:
        for name in ("length", "EI", "EA", "GA", "GJ"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"bar: {name} is {getattr(self, name)}: it must be above 0")


def cantilever(bar: Bar) -> NDArray[np.float64]:
    """Tip compliance ``(2, 2)``: (deflection, turn) by (transverse force, moment); mm/N, 1/N, rad/(N mm).

    L³/3EI + L/GA, L²/2EI, L/EI.
    """
    L = bar.length
    mixed = L**2 / (2.0 * bar.EI)
    return np.array([[L**3 / (3.0 * bar.EI) + L / bar.GA, mixed], [mixed, L / bar.EI]])


def l_frame_in_plane(first: Bar, second: Bar) -> NDArray[np.float64]:
    """Tip compliance ``(3, 3)`` of an L-shaped frame in its plane: (x, y, turn) by (F_x, F_y, M).

    The first bar, of length a, is clamped at the origin and lies along x. The second, of length b, is joined to it
    rigidly at (a, 0) and lies along y. Its free end is at (a, b). Turns from x to y are positive. The tip's load
    bends the second bar by M − F_x t, t from the tip, and the first by M − F_x b + F_y s, s from the corner.
    """
    a, b = first.length, second.length
    x = b**3 / (3.0 * second.EI) + b / second.GA + a * b**2 / first.EI + a / first.EA
    y = a**3 / (3.0 * first.EI) + a / first.GA + b / second.EA
    turn = a / first.EI + b / second.EI
    xy = -(a**2) * b / (2.0 * first.EI)
    x_turn = -(b**2) / (2.0 * second.EI) - a * b / first.EI
    y_turn = a**2 / (2.0 * first.EI)
    return np.array([[x, xy, x_turn], [xy, y, y_turn], [x_turn, y_turn, turn]])


def l_frame_out_of_plane(first: Bar, second: Bar) -> NDArray[np.float64]:
    """Tip compliance ``(3, 3)`` of the same frame out of its plane: (z, turn about x, about y) by (F_z, M_x, M_y).

    The second bar's bending turns the tip about x, and so does the first one's torsion: z = a³/3EI₁ + b³/3EI₂ +
    a b²/GJ₁ and shear.
    """
    a, b = first.length, second.length
    z = a**3 / (3.0 * first.EI) + a / first.GA + b**3 / (3.0 * second.EI) + b / second.GA + a * b**2 / first.GJ
    about_x = a / first.GJ + b / second.EI
    about_y = a / first.EI + b / second.GJ
    z_x = b**2 / (2.0 * second.EI) + a * b / first.GJ
    z_y = -(a**2) / (2.0 * first.EI)
    return np.array([[z, z_x, z_y], [z_x, about_x, 0.0], [z_y, 0.0, about_y]])


def cantilever_on_springs(bar: Bar, lateral: float, rotational: float) -> float:
    """Tip deflection per transverse force, mm/N, of a cantilever whose root is elastic.

    L³/3EI + L/GA + 1/k + L²/c.

    Args:
        bar: the cantilever.
        lateral: k of the root, N/mm.
        rotational: c of the root, N mm/rad.

    Raises:
        ValueError: a spring is not above 0.
    """
    if not (lateral > 0.0 and rotational > 0.0):
        raise ValueError(f"root springs {lateral} N/mm, {rotational} N mm/rad: both must be above 0")
    return float(cantilever(bar)[0, 0]) + 1.0 / lateral + bar.length**2 / rotational


def springs_in_series(stiffnesses: Iterable[float]) -> float:
    """Stiffness of springs one behind the other: the reciprocal of the sum of their compliances.

    Raises:
        ValueError: there is none, or one is not above 0.
    """
    values = list(stiffnesses)
    if not values or not all(value > 0.0 for value in values):
        raise ValueError(f"springs in series {values}: each must be above 0, and there must be one")
    return 1.0 / sum(1.0 / value for value in values)
