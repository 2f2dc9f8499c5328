"""Losses that a few outliers do not move, scaled so that for clean Gaussian data they state the truth.

With ψ the derivative of a loss, minimising its sum estimates with the variance E ψ² / (E ψ')² of the clean
Gaussian's 1, the inverse of its efficiency. Multiplied by E ψ' / E ψ² a loss has an expected curvature that equals
the variance of its slope, both the efficiency: covariance, likelihood ratios and the balance with priors then hold
as they do for squares. (Huber and Ronchetti, *Robust Statistics*, 2nd ed., 2009, ch. 3 and 4.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array


@dataclass(frozen=True)
class Loss:
    """A robust loss ρ of whitened residuals.

    Attributes:
        name: of its kind.
        tuning: residual at which it bends off, or ends.
        rho: the loss itself.
        weight: ψ(r)/r.
        efficiency: on clean Gaussian data, against least squares.
        factor: E ψ' / E ψ², by which loss and weight are multiplied already.
    """

    name: str
    tuning: float
    rho: Callable[[Array], Array]
    weight: Callable[[Array], Array]
    efficiency: float
    factor: float


def _loss(name: str, c: float, rho: Callable[[Array], Array], weight: Callable[[Array], Array]) -> Loss:
    # ψ is continuous, so E ψ' = E r ψ for the Gaussian, by parts
    r = np.linspace(-12.0, 12.0, 240001)
    density = np.exp(-0.5 * r**2) / np.sqrt(2.0 * np.pi) * (r[1] - r[0])
    psi = r * weight(r)
    slope, square = float(np.sum(r * psi * density)), float(np.sum(psi**2 * density))
    factor = slope / square
    return Loss(name, c, lambda r: factor * rho(r), lambda r: factor * weight(r), slope**2 / square, factor)


def squares() -> Loss:
    """Least squares."""
    return _loss("least squares", float("inf"), lambda r: 0.5 * r**2, np.ones_like)


def huber(c: float = 1.345) -> Loss:
    """Squares up to ``c``, straight beyond; 95 % efficient at 1.345. Its minimum is unique."""
    return _loss(
        "Huber",
        c,
        lambda r: np.where(np.abs(r) <= c, 0.5 * r**2, c * np.abs(r) - 0.5 * c**2),
        lambda r: c / np.maximum(np.abs(r), c),
    )


def biweight(c: float = 6.0) -> Loss:
    """Tukey's biweight: nothing beyond ``c`` has any say; 98.1 % efficient at 6. To be started from Huber's fit."""
    return _loss(
        "Tukey's biweight",
        c,
        lambda r: c**2 / 6.0 * (1.0 - np.maximum(1.0 - (r / c) ** 2, 0.0) ** 3),
        lambda r: np.maximum(1.0 - (r / c) ** 2, 0.0) ** 2,
    )


SQUARES, HUBER, BIWEIGHT = squares(), huber(), biweight()
