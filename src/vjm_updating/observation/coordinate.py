"""What a fit looks for: numbers with a prior and bounds, the nuisances of the test among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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


# --- A model at the readings of a test, and how its residuals change with the errors of the instruments -----------


@dataclass(frozen=True)
class Evaluation:
    """A model at n readings.

    Attributes:
        z: unknowns ``(n_z,)``.
        residual: reading minus prediction ``(n, 6)``, N, N mm; zero where there is no reading.
        wrench: of the machine ``(n, 6)``, N, N mm.
        stiffness: its derivative by the displacement ``(n, 6, 6)``.
        place: true displacements ``(n, 6)``, mm, rad.
        errors: of the instruments.
        exact: derivative ``(n, 6)`` of the residuals by the coordinate of an index, where a model knows it; None
            where it is to be differentiated.
    """

    z: Array
    residual: Array
    wrench: Array
    stiffness: Array
    place: Array
    errors: InstrumentErrors
    exact: Callable[[int], Array | None] | None = None

    @property
    def sensitivity(self) -> Array:
        """By how much residuals grow ``(n, 6, 6)`` with what the displacement's gauges read too much."""
        result: Array = self.errors.gain[:, None] * self.stiffness / self.errors.gain_u
        return result

    def slope(self, kind: str, channel: str, slots: Mapping[str, int]) -> Array:
        """Derivative ``(n, 6)`` of the residuals by a zero, in its unit, or by a scale error.

        Args:
            kind: `Kind.ZERO` or `Kind.SCALE`.
            channel: of the wrench or the displacement; residuals do not depend on others.
            slots: component of the displacement by channel.
        """
        result = np.zeros(self.wrench.shape)
        if channel in self.errors.columns:
            k = self.errors.columns.index(channel)
            result[:, k] = -1.0 if kind == Kind.ZERO else -self.wrench[:, k]
        elif channel in slots:
            k = slots[channel]
            result = self.sensitivity[:, :, k] * (1.0 if kind == Kind.ZERO else self.place[:, [k]])
        return result
