"""What a fit looks for: numbers with a prior and bounds.

They are the nuisances under the sheet's priors, and the parameters of the causes that are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, assert_never

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.experiment import Kind, Nuisance
from vjm_updating.experiment.data_file import WRENCH
from vjm_updating.experiment.measured import possible_nuisances
from vjm_updating.inference.instruments import (
    InstrumentErrors,
    InstrumentScale,
    InstrumentZero,
    ThermalDrift,
    size_of,
)
from vjm_updating.inference.observed import Observed
from vjm_updating.mechanisms.effect import Effect, Quantity
from vjm_updating.mechanisms.modified_chain import beam_of
from vjm_updating.mechanisms.structure import FootCompliance, LinkCompliance, LinkLength


@dataclass(frozen=True)
class FitParameter:
    """One number z that a fit looks for, in units of ``scale``; its value is the nominal one and as much more.

    Attributes:
        kind: a `vjm_updating.experiment.Kind`, or what else it is of.
        subject: channel or part; of an effect its index in the hypothesis, as text.
        scale: of the coordinate; a nuisance's sigma.
        sigma: of its prior, in units of the scale; infinite where there is none, zero where it is fixed.
        nominal: value at z = 0.
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
    nominal: float = 0.0

    @property
    def of_instrument(self) -> bool:
        """Whether it is a zero or a scale of a channel; else the machine's."""
        return self.kind in (Kind.ZERO, Kind.SCALE)

    def value(self, z: float) -> float:
        """In its own unit; of a modulus or a mass relative, which counts by its logarithm."""
        relative = self.kind in (Kind.MODULUS, Kind.MASS)
        return float(np.expm1(z * self.scale)) if relative else self.nominal + self.scale * z

    def slope(self, z: float) -> float:
        """Derivative of the value by z."""
        return self.scale * (1.0 + self.value(z)) if self.kind in (Kind.MODULUS, Kind.MASS) else self.scale

    def coordinate(self, value: float) -> float:
        """The converse of `value`."""
        relative = self.kind in (Kind.MODULUS, Kind.MASS)
        return (float(np.log1p(value)) if relative else value - self.nominal) / self.scale


def uncertain(unknowns: Sequence[FitParameter]) -> np.ndarray:
    """Which of coordinates ``(n_z,)`` the sheet does not give exactly."""
    return np.array([c.sigma != 0.0 for c in unknowns], dtype=bool)


def instrument_errors(
    unknowns: Sequence[FitParameter], z: Array, slots: Mapping[str, int], columns: tuple[str, ...] = WRENCH
) -> InstrumentErrors:
    """Zeros and scales among coordinates ``(n_z,)``.

    ``slots`` has the displacement's components by channel, ``columns`` names the channels that were read.
    """
    values = {(c.kind, c.subject): c.value(v) for c, v in zip(unknowns, z, strict=True) if c.of_instrument}
    return InstrumentErrors.of(values, slots, columns)


# --- A model at the readings of a test, and how its residuals change with the errors of the instruments -----------


@dataclass(frozen=True)
class Evaluation:
    """A model at n readings.

    Attributes:
        z: unknowns ``(n_z,)``.
        residual: reading minus prediction ``(n, 6)``, N, N mm; zero where there is no reading.
        prediction: of the machine ``(n, 6)``, N, N mm.
        stiffness: its derivative by the displacement ``(n, 6, 6)``.
        place: true displacements ``(n, 6)``, mm, rad.
        exact: derivative ``(n, 6)`` of the residuals by the coordinate of an index, where a model knows it; None
            where it is to be differentiated.
    """

    z: Array
    residual: Array
    prediction: Array
    stiffness: Array
    place: Array
    errors: InstrumentErrors
    exact: Callable[[int], Array | None] | None = None

    @property
    def sensitivity(self) -> Array:
        """By how much residuals grow ``(n, 6, 6)`` with what the displacement's gauges read too much."""
        return self.errors.gain[:, None] * self.stiffness / self.errors.gain_u

    def slope(self, kind: str, channel: str, slots: Mapping[str, int]) -> Array:
        """Derivative ``(n, 6)`` of the residuals by a zero, in its unit, or by a scale error.

        ``kind`` is `Kind.ZERO` or `Kind.SCALE`; ``slots`` has the displacement's components by channel. Residuals
        do not depend on channels that are neither of the wrench nor of these.
        """
        result = np.zeros(self.prediction.shape)
        if channel in self.errors.columns:
            k = self.errors.columns.index(channel)
            result[:, k] = -1.0 if kind == Kind.ZERO else -self.prediction[:, k]
        elif channel in slots:
            k = slots[channel]
            result = self.sensitivity[:, :, k] * (1.0 if kind == Kind.ZERO else self.place[:, [k]])
        return result


Hypothesis = tuple[Effect, ...]
"""Causes that act together; empty: nothing but the sheet's tolerances."""
FARTHEST = prior_scale(60.0)
"""Sigmas of the sheet beyond which an instrument or a length is not off but another one."""
PARTS = prior_scale(5.0)
"""Times that a part may be softer or stiffer than the sheet says."""
ALTERNATIVE_FACTOR = numerical(2.0)
"""Times that a part is softer or stiffer where a fit of its modulus begins besides."""
SHARE = prior_scale(0.1)
"""Of a link's length, up to which it may be longer or shorter, however little of it the sheet allows."""
LOST = prior_scale(0.9)
"""Of a channel's scale, relative."""
USUAL = prior_scale({Kind.SCALE: 0.01, Kind.MODULUS: 0.02, Kind.LENGTH: 0.2, Kind.MASS: 0.02})
"""Units of nuisances for which the sheet has no tolerance, mm and relative."""


@dataclass(frozen=True, kw_only=True)
class EffectParameter(FitParameter):
    """Of a quantity of an effect."""

    quantity: Quantity

    def value(self, z: float) -> float:
        """In the quantity's unit."""
        return self.quantity.value(z)

    def slope(self, z: float) -> float:
        """Derivative of the value by z."""
        return self.value(z) if self.quantity.log else self.scale

    def coordinate(self, value: float) -> float:
        """The converse of `value`."""
        return self.quantity.coordinate(value)


def release_key(effect: Effect) -> tuple[Kind, str] | None:
    """The nuisance that an effect frees of its prior; None for an effect with parameters of its own."""
    if isinstance(effect, InstrumentZero):
        return Kind.ZERO, effect.part
    if isinstance(effect, InstrumentScale):
        return Kind.SCALE, effect.part
    if isinstance(effect, FootCompliance | LinkCompliance):
        return Kind.MODULUS, effect.beam
    if isinstance(effect, LinkLength):
        return Kind.LENGTH, effect.beam
    return None


def remakes(effect: Effect) -> bool:
    """Whether an effect's parameters make the machine another one, or the path along which it is taken."""
    own = type(effect)
    return release_key(effect) is None and (own.machine is not Effect.machine or own.imposed is not Effect.imposed)


def deflects(effect: Effect) -> bool:
    """Whether an effect's parameters do nothing but deflect elements in series."""
    own = type(effect)
    plain = own.friction is Effect.friction and own.relaxation is Effect.relaxation
    return plain and own.elements is not Effect.elements and not remakes(effect)


def sizeless(effect: Effect) -> bool:
    """Whether an effect either is or is not, as a spring that is split."""
    return release_key(effect) is None and not effect.quantities()


def exclusive(one: Effect, other: Effect) -> bool:
    """Whether only one of two effects acts: laws of one cause in one part, or of one spring."""
    if one.in_place_of and one.in_place_of == other.in_place_of:
        return True
    return (one.cause, one.part) == (other.cause, other.part)


def linear(effect: Effect) -> bool:
    """Whether readings are linear in an effect's size, so that slopes tell all of it: errors of the instruments."""
    return isinstance(effect, InstrumentZero | InstrumentScale | ThermalDrift)


def alternative_starts(effect: Effect, nuisances: Sequence[FitParameter], begin: Array) -> list[Array]:
    """Starts ``(m,)`` from a stiffness far off, besides ``begin``: of a bar's there may be several optima.

    A softer bar has its critical point within the readings, a stiffer one has none there, and no step leads across.
    """
    key = release_key(effect)
    result = []
    for i, c in enumerate(nuisances):
        if (c.kind, c.subject) == key and c.kind == "modulus":
            for sign in (1.0, -1.0):
                far = begin.copy()
                far[i] = sign * np.log(ALTERNATIVE_FACTOR) / c.scale
                result.append(far)
    return result


def towards_nothing(effect: Effect, values: Sequence[float], share: float) -> list[float]:
    """An effect's values with only a share of it."""
    result = list(values)
    for i, q in enumerate(effect.quantities()[: effect.extent]):
        if q.neutral is not None:
            nothing, current = (q.coordinate(v) if v > 0.0 or not q.log else 0.0 for v in (q.neutral, values[i]))
            result[i] = q.value(nothing + share * (current - nothing))
    return result


def usual_shapes(effect: Effect, values: Sequence[float]) -> list[float]:
    """An effect's values with the shapes of its law as they usually are; what frees a nuisance has no shape."""
    if release_key(effect) is not None:
        return list(values)
    return [
        q.usual if i >= effect.extent and np.isfinite(q.spread) else v
        for i, (q, v) in enumerate(zip(effect.quantities(), values, strict=True))
    ]


def nuisance_coordinates(observed: Observed) -> list[FitParameter]:
    """Every nuisance that there could be; those that the sheet does not allow are fixed at zero."""
    measurement = observed.measurement
    channels = (*observed.pose_channels, *observed.wrench_channels)
    return [
        _coordinate(nuisance, observed)
        for nuisance in possible_nuisances(measurement.sheet, channels, measurement.chain)
    ]


def _coordinate(nuisance: Nuisance, observed: Observed) -> FitParameter:
    kind, subject = nuisance.kind, nuisance.subject
    scale = nuisance.sigma or (size_of(subject) if kind is Kind.ZERO else USUAL[kind])
    most = FARTHEST * scale
    match kind:
        case Kind.MODULUS:
            most = float(np.log(PARTS))
        case Kind.SCALE:
            most = min(LOST, most)
        case Kind.LENGTH:
            most = max(SHARE * beam_of(observed.measurement.chain, subject).length, most)
        case Kind.ZERO | Kind.MASS:
            pass
        case _:
            assert_never(kind)
    low, high = -most, most
    if kind is Kind.ZERO:
        low, high = observed.zeros.get(subject, (low, high))
    spread = 1.0 if nuisance.sigma > 0.0 else 0.0
    return FitParameter(nuisance.name, kind, subject, scale, 0.0, spread, low / scale, high / scale)


def coordinates(nuisances: Sequence[FitParameter], hypothesis: Hypothesis) -> list[FitParameter]:
    """The coordinates of a hypothesis: the nuisances first, then its effects' quantities in their order."""
    free = {release_key(effect) for effect in hypothesis}
    unknowns = [c if (c.kind, c.subject) not in free else replace(c, mean=0.0, sigma=np.inf) for c in nuisances]
    for i, effect in enumerate(hypothesis):
        if release_key(effect) is not None:
            continue
        for q in effect.quantities():
            mean = q.coordinate(q.usual) if q.log or np.isfinite(q.spread) else 0.0
            sigma = q.spread if q.log else q.spread / q.scale
            unknowns.append(
                EffectParameter(
                    name=f"{effect.label} {q.name}",
                    kind="effect",
                    subject=str(i),
                    scale=q.scale,
                    mean=mean,
                    sigma=sigma,
                    low=q.coordinate(q.low),
                    high=q.coordinate(q.high),
                    quantity=q,
                )
            )
    return unknowns


def of_effect(unknowns: Sequence[FitParameter], number: int) -> list[int]:
    """Indices of an effect's coordinates, by its place in the hypothesis: those of its size before its shape's."""
    return [i for i, c in enumerate(unknowns) if c.kind == "effect" and c.subject == str(number)]


def start(
    unknowns: Sequence[FitParameter], hypothesis: Hypothesis, nuisances: Array, values: Sequence[Sequence[float]]
) -> Array:
    """Coordinates ``(n_z,)`` from nuisances' ``(m,)`` and each effect's values."""
    z = [*nuisances.tolist()]
    for effect, own in zip(hypothesis, values, strict=True):
        if release_key(effect) is None:
            z += [q.coordinate(v) for q, v in zip(effect.quantities(), own, strict=True)]
    low, high = (np.array([getattr(c, end) for c in unknowns]) for end in ("low", "high"))
    return np.clip(np.array(z), low, high)
