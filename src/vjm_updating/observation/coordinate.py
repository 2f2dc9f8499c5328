"""What a fit looks for: numbers with a prior and bounds, the nuisances of the test among them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment import Kind
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.observation.instrument_errors import InstrumentErrors


@dataclass(frozen=True)
class Coordinate:
    """One number z that a fit looks for, in units of ``scale``.

    Attributes:
        name: for people.
        kind: a `vjm_updating.experiment.Kind`, or what else it is of.
        subject: channel or part; of an effect its index in the hypothesis, as text.
        scale: of the coordinate; a nuisance's sigma.
        mean: of its prior.
        sigma: of its prior, in units of the scale; infinite where there is none, zero where it is fixed.
        low: bound.
        high: bound.
        difference: step of z, or share of it, by which what it does is differentiated.
    """

    difference: ClassVar[float] = 0.03

    name: str
    kind: str
    subject: str
    scale: float
    mean: float = 0.0
    sigma: float = 1.0
    low: float = -np.inf
    high: float = np.inf

    @property
    def of_instrument(self) -> bool:
        """Whether it is a zero or a scale of a channel; else the machine's."""
        return self.kind in (Kind.ZERO, Kind.SCALE)

    def value(self, z: float) -> float:
        """In its own unit; of a modulus or a mass relative, which counts by its logarithm."""
        return float(np.expm1(z * self.scale)) if self.kind in (Kind.MODULUS, Kind.MASS) else z * self.scale

    def slope(self, z: float) -> float:
        """Derivative of the value by z."""
        return self.scale * (1.0 + self.value(z)) if self.kind in (Kind.MODULUS, Kind.MASS) else self.scale

    def coordinate(self, value: float) -> float:
        """The converse of `value`."""
        return (float(np.log1p(value)) if self.kind in (Kind.MODULUS, Kind.MASS) else value) / self.scale


def uncertain(found: Sequence[Coordinate]) -> np.ndarray:
    """Which of coordinates ``(n_z,)`` the sheet does not give exactly."""
    result: np.ndarray = np.array([c.sigma != 0.0 for c in found], dtype=bool)
    return result


def instrument_errors(
    found: Sequence[Coordinate], z: Array, slots: Mapping[str, int], columns: tuple[str, ...] = WRENCH
) -> InstrumentErrors:
    """Zeros and scales among coordinates ``(n_z,)``.

    Args:
        found: coordinates.
        z: their values.
        slots: the displacement's components by channel.
        columns: names of the channels that were read.
    """
    values = {(c.kind, c.subject): c.value(v) for c, v in zip(found, z, strict=True) if c.of_instrument}
    return InstrumentErrors.of(values, slots, columns)
