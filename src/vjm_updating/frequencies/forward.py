"""The natural frequencies that a machine has where a test was made, and their exact derivatives.

Also which computed mode each measured frequency is.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from vjm.design.linear_state import LinearState, loaded_posture, state_of
from vjm.design.modes import eigenmodes, frequency_rates
from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.rotations import Array
from vjm_updating.calibration.parameters import CalibrationParameter, OfUnknowns
from vjm_updating.constants import numerical
from vjm_updating.frequencies.measurement import FrequencyMeasurement
from vjm_updating.inference.forward import Predictor
from vjm_updating.inference.instruments import InstrumentErrors
from vjm_updating.inference.parameters import Evaluation, FitParameter, Hypothesis


def pairings(read: np.ndarray, missing: int) -> np.ndarray:
    """Every pairing ``(a, k)`` of a row's columns with modes, counted from 0; −1 where none was read.

    Args:
        read: ``(k,)`` which columns have a frequency.
        missing: modes below the highest one read that may not have been seen; none: a column is its own mode.

    Example:
        >>> pairings(np.array([True, True]), 1).tolist()
        [[0, 1], [0, 2], [1, 2]]
    """
    columns = np.flatnonzero(read)
    ways = list(combinations(range(len(columns) + missing), len(columns))) if missing else [tuple(columns.tolist())]
    result = np.full((len(ways), len(read)), -1)
    result[:, columns] = ways
    return result


def unlikeliness(
    frequency: Array, sigma: Array, computed: Array, ways: np.ndarray, shared: Array | None = None
) -> Array:
    """Twice the negative logarithm ``(a,)`` of the likelihood of pairings of a row, but for a constant.

    Args:
        frequency: ``(k,)`` Hz; nan where none was read.
        sigma: ``(k,)`` Hz.
        computed: ``(m,)`` Hz, ascending; nan where the machine has no such mode.
        ways: ``(a, k)``, see `pairings`.
        shared: ``(m, p)`` Hz, what p independent errors of the machine, of unit variance, make of the modes.
    """
    columns = np.flatnonzero(ways[0] >= 0)
    own = ways[:, columns]
    off = frequency[columns] - computed[own]
    C = np.eye(len(columns)) * sigma[columns] ** 2
    if shared is not None:
        G = np.nan_to_num(shared)[own]
        C = C + G @ np.swapaxes(G, 1, 2)
    else:
        C = np.broadcast_to(C, (len(own), *C.shape))
    finite = np.isfinite(off).all(axis=1)
    clean = np.where(finite[:, None], off, 0.0)
    cost = np.einsum("ak,ak->a", clean, np.linalg.solve(C, clean[..., None])[..., 0])
    return np.where(finite, cost + np.linalg.slogdet(C)[1], np.inf)


def probability(cost: Array, way: int) -> float:
    """Of one of a row's pairings among all that are allowed, by their `unlikeliness` ``(a,)``."""
    return float(1.0 / np.sum(np.exp(-0.5 * (cost - cost[way]))))


def skipping(read: np.ndarray, mode: int) -> np.ndarray:
    """The pairing ``(k,)`` of a row in which one mode, counted from 0, was not seen and all others were."""
    columns = np.flatnonzero(read)
    result = np.full(len(read), -1)
    result[columns] = [k + (k >= mode) for k in range(len(columns))]
    return result


KEPT = numerical(8)
"""Machines whose modes are remembered: a fit asks for the one that it is at again and again."""


@dataclass(frozen=True)
class Standing:
    """A machine in one posture with its modes.

    Attributes:
        state: its equilibrium.
        values: ``(m,)`` squares of angular frequencies, 1/s².
        motions: ``(n, m)``.
    """

    state: LinearState
    values: Array
    motions: Array

    @property
    def frequencies(self) -> Array:
        """Hz ``(m,)``."""
        return np.sqrt(self.values) / (2.0 * np.pi)


@dataclass(frozen=True)
class Tapped:
    """A machine in all postures of a test.

    Attributes:
        frequencies: ``(n, m)`` Hz of each row, nan where it has no such mode.
        standing: in each posture and with each payload of the test.
        place: ``(n,)`` which of them each row is.
    """

    frequencies: Array
    standing: tuple[Standing, ...]
    place: np.ndarray


@dataclass
class FrequencyForward(OfUnknowns, Predictor):
    """Predicts frequencies.

    Attributes:
        measurement: the test.
        pairs: ``(n, k)`` mode that each reading is, from 0; −1 where there is none.
        rival: another pairing ``(n, k)`` with parameters of its own, and its probability beside this one; None
            where no other one was found.
    """

    measurement: FrequencyMeasurement
    pairs: np.ndarray
    rival: tuple[np.ndarray, float] | None = None
    _known: OrderedDict[bytes, Tapped] = field(default_factory=OrderedDict)
    _rates: OrderedDict[tuple[bytes, int], Array] = field(default_factory=OrderedDict)

    def paired(self, pairs: np.ndarray) -> FrequencyForward:
        """The same with another pairing ``(n, k)``."""
        return replace(self, pairs=pairs)

    def tapped(self, z: Array) -> Tapped:
        """The machine of the unknowns ``(n_z,)`` in all postures.

        Raises:
            NoConvergenceError: it has no stable equilibrium in one of them.
        """
        key = z.tobytes()
        if key not in self._known:
            self._known[key] = tapped(self.measurement, self.unknowns.build(z))
            while len(self._known) > KEPT:
                gone, _ = self._known.popitem(last=False)
                for name in [name for name in self._rates if name[0] == gone]:
                    del self._rates[name]
        self._known.move_to_end(key)
        return self._known[key]

    def rates(self, z: Array, index: int) -> Array:
        """Derivative ``(n, m)`` of all modes' frequencies by an unknown, Hz per unit of its z."""
        key = z.tobytes(), index
        if key not in self._rates:
            self._rates[key] = self._rates_of(self.tapped(z), z, index)
        return self._rates[key]

    def _rates_of(self, tapped: Tapped, z: Array, index: int) -> Array:
        order = self.unknowns.on_chain.tolist()
        parameter = self.unknowns.sensitivity_parameters(z)[order.index(index)]
        own = self.unknowns.all[index]
        if isinstance(own, CalibrationParameter) and own.linear and own.low > 0.0:
            # a step must not make it rigid
            parameter = replace(parameter, scale=float(z[index]))
        table = np.full((len(tapped.standing), tapped.frequencies.shape[1]), np.nan)
        masses = dict(zip(tapped.place.tolist(), self.measurement.payload.tolist(), strict=True))
        for k, one in enumerate(tapped.standing):
            loaded = self._loaded(parameter, masses[k])
            table[k, : len(one.values)] = frequency_rates(one.state, [loaded], one.values, one.motions)[:, 0]
        return table[tapped.place]

    def _loaded(self, parameter: Parameter, mass: float) -> Parameter:
        """A parameter of the machine as one of the machine with a payload in kg."""
        change = parameter.apply
        return replace(parameter, apply=lambda chain, value: self.measurement.carrying(change(chain, value), mass))

    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against the machine of the unknowns.

        Raises:
            NoConvergenceError: it has no stable equilibrium in a posture, or lacks a mode that was read.
        """
        n, k = self.pairs.shape
        read = self.pairs >= 0
        computed = _picked(self.tapped(z).frequencies, self.pairs)
        if not np.isfinite(computed[read]).all():
            raise NoConvergenceError(f"{self.unknowns.chain.name}: it has fewer modes than were read")
        computed = np.where(read, computed, 0.0)
        errors = InstrumentErrors.of({}, {}, self.observed.columns)
        residual = np.where(read, np.nan_to_num(self.observed.measured) - computed, 0.0)

        def exact(index: int) -> Array:
            return np.where(read, -_picked(self.rates(z, index), self.pairs), 0.0)

        return Evaluation(z, residual, computed, np.zeros((n, k, 6)), np.zeros((n, 6)), errors, exact)


def tapped(measurement: FrequencyMeasurement, chain: Machine) -> Tapped:
    """A machine in all postures of a test, with as many modes as pairings may name.

    Raises:
        NoConvergenceError: it has no stable equilibrium in one of them.
    """
    read, missing = np.isfinite(measurement.frequency), measurement.sheet.frequencies.missing
    modes = int(read.sum(axis=1).max()) + missing if missing else read.shape[1]
    where = list(zip(measurement.readings.posture.tolist(), measurement.payload.tolist(), strict=True))
    distinct = list(dict.fromkeys(where))
    standing = tuple(
        _standing(measurement, measurement.carrying(chain, mass), label, modes) for label, mass in distinct
    )
    place = np.array([distinct.index(one) for one in where])
    table = np.full((len(standing), modes), np.nan)
    for row, one in zip(table, standing, strict=True):
        row[: len(one.values)] = one.frequencies
    return Tapped(table[place], standing, place)


def _standing(measurement: FrequencyMeasurement, chain: Machine, label: str, modes: int) -> Standing:
    gravity = measurement.sheet.test.gravity
    weight = None if gravity is None else (gravity[0], gravity[1], gravity[2])
    asked = loaded_posture(chain, label, gravity=weight, engine=measurement.engine)
    state = state_of(asked)
    values, motions = eigenmodes(state, modes)
    if not np.all(np.real(values) > 0.0):
        raise NoConvergenceError(f"{chain.name}, posture {label}: its equilibrium is not stable: no frequencies")
    return Standing(state, np.real(values), np.real(motions))


def _picked(table: Array, pairs: np.ndarray) -> Array:
    """Values ``(n, k)`` of a table of modes ``(n, m)`` for a pairing ``(n, k)``."""
    return np.take_along_axis(table, np.maximum(pairs, 0), axis=1)
