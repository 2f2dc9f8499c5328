"""The readings that a hypothesis predicts: nuisances, effects and the machine's own equilibria put together.

Axes that nobody drove are taken at their means: what their gauges read is noise and no displacement.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.comparison import Ray
from vjm_updating.inference.instruments import ThermalDrift
from vjm_updating.inference.noise import whiten
from vjm_updating.inference.observed import Observed, RampRegression, commanded, is_noise, observe, straightened
from vjm_updating.inference.parameters import (
    Evaluation,
    FitParameter,
    Hypothesis,
    coordinates,
    deflects,
    instrument_errors,
    nuisance_coordinates,
    of_effect,
    release_key,
)
from vjm_updating.inference.significance import CUT, NORMAL_95, median_sigma
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, PathTable, Sheaf, beside, first_force, tabulate
from vjm_updating.mechanisms.hysteresis import friction_torques
from vjm_updating.mechanisms.modified_chain import AxialSigns, ModifiedMachine
from vjm_updating.mechanisms.relaxation import OnRay, relaxing
from vjm_updating.mechanisms.series_elements import Memoryless, SeriesElement, balance, deflection

LEAST = numerical(3)
"""Readings of a ray from which on an axis has a scatter beside its mean, and second differences."""


def at_their_means(observed: Observed, evaluation: Evaluation) -> Observed:
    """The same with idle axes at their means along each ray, where the forces do not follow their gauges.

    So are those whose forces are too small to tell, and which scatter no more than their gauges do. Several
    displacements were imposed and read. Of the nominal machine's ``evaluation`` matters the stiffness, and what
    forces miss from reading to reading.
    """
    regressions = {}
    for k in observed.slots.values():
        lines = _levels(observed, k)
        on = lines.any(axis=1)
        if not on.any() or observed.noise.pose[k] <= 0.0:
            continue
        off = (observed.imposed[:, k] - lines @ (lines.T @ observed.imposed[:, k]))[on]
        share = followed_share(observed, evaluation, k)
        # of an axis that stood still the share is 0, of one that went where its gauge says 1
        if share < 1.0 - share and is_noise(off / observed.noise.pose[k]):
            regressions[k] = RampRegression(lines, observed.readings.sequence, np.where(on, share, 1.0))
    return commanded(observed, regressions) if regressions else observed


def _levels(observed: Observed, k: int) -> Array:
    """Orthonormal columns ``(n, s)``: a level on each ray along which displacement k does not change."""
    columns = []
    for ray in observed.rays:
        if ray.direction[k] == 0.0 and len(ray.index) >= LEAST:
            column = np.zeros(len(observed.imposed))
            column[ray.index] = 1.0 / np.sqrt(len(ray.index))
            columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((len(observed.imposed), 0))


def followed_share(observed: Observed, evaluation: Evaluation, k: int) -> float:
    """Share of what a gauge reads beside its mean while idle that forces follow; 0 where they cannot tell.

    Forces change along a ramp, and a model that lacks a cause misses smooth parts of that. Second differences from
    reading to reading have little of these. The ``evaluation`` is the nominal machine's; ``k`` counts among the six
    displacements.
    """
    lines = _levels(observed, k)
    off = np.where(lines.any(axis=1), observed.imposed[:, k] - lines @ (lines.T @ observed.imposed[:, k]), 0.0)
    others = np.where(np.arange(6) == k, 0.0, observed.noise.pose)
    sigmas = np.broadcast_to(others, observed.imposed.shape)
    white = whiten(sigmas, observed.noise.wrench, evaluation.sensitivity, observed.present)
    # the residual is at the gauge's own reading: at the mean it has what the axis adds
    shift = np.where(observed.present, evaluation.sensitivity[:, :, k] * off[:, None], 0.0)
    both = np.einsum("nij,njs->nis", white, np.stack([shift, evaluation.residual + shift], axis=2))
    followed = whole = unsure = 0.0
    for ray in observed.rays:
        if ray.direction[k] != 0.0 or len(ray.index) < LEAST:
            continue
        for c in range(observed.present.shape[1]):
            own = ray.index[observed.present[ray.index, c]]
            if len(own) < LEAST:
                continue
            follow, missed = np.diff(both[own, c], n=2, axis=0).T
            usual = max(median_sigma(missed), 1.0)
            followed += float(follow @ np.clip(missed, -CUT * usual, CUT * usual))
            whole += float(follow @ follow)
            unsure += float(np.sum(_twice(follow, len(own)) ** 2)) * max(usual**2 / 6.0, 1.0)
    # an axis that reads the same throughout says nothing
    if whole <= 2.0 * NORMAL_95 * unsure**0.5 or followed < NORMAL_95 * unsure**0.5:
        return 0.0
    return followed / whole


def _twice(differences: Array, count: int) -> Array:
    """Second differences ``(count − 2,)`` taken back to readings ``(count,)``: the transpose of taking them."""
    result = np.zeros(count)
    for shift, weight in enumerate((1.0, -2.0, 1.0)):
        result[shift : shift + len(differences)] += weight * differences
    return result


MARGIN = numerical(1.05)
"""How far beyond the furthest reading tables go."""
KEPT = numerical(2000)
"""Tables that are kept."""
AT_HAND = numerical(16)
"""Machines of which all tables are kept side by side: those of one differentiation."""
ROUNDS = numerical(3)
"""Of friction, relaxation and elements in turn."""

Key = tuple[tuple[object, ...], HalfRay, tuple[object, ...] | None]
"""Of a table: its machine, its half-ray, and the machine near by whose equilibria it was made from, if so."""


@dataclass(frozen=True)
class Ramp:
    """Readings along one ray and against it.

    Attributes:
        index: of the readings ``(k,)``.
        reach: how far tables go along the ray, and against it.
        branches: that loading and unloading take behind a bifurcation.
        places: at which tables have equilibria in any case, along the ray and against it.
    """

    ray: Ray
    index: np.ndarray
    reach: tuple[float, float]
    branches: tuple[int, int]
    places: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())


@dataclass
class Predictor(ABC):
    """What predicts the readings of a kind of test; here no equilibrium has a second branch.

    Attributes:
        branches: which of two mirrored branches a half-ray takes, by (ray, sign); +1 by default.
    """

    observed: Observed
    branches: dict[tuple[int, int], int] = field(default_factory=dict, kw_only=True)

    def machine(self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> ModifiedMachine:
        """The machine of a hypothesis."""
        return machine_of(self.observed, unknowns, z, hypothesis)

    @abstractmethod
    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis; a little ``beside`` coordinates (n_z,) whose tables will do."""

    def reading(self, observed: Observed) -> Self:
        """The same for other readings of the same test."""
        return replace(self, observed=observed, branches=dict(self.branches))

    def branched(self, ray: Ray, sign: int, reach: float) -> bool:
        """Whether a half-ray has a bifurcation within its reach, behind which readings could lie."""
        return False

    def behind_bifurcation(self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> np.ndarray:
        """Whether each reading ``(n,)`` is, of the machine of coordinates ``(n_z,)``."""
        return np.zeros(len(self.observed.imposed), dtype=bool)


@dataclass
class Forward(Predictor):
    """Predicts readings; keeps the tables that it has made.

    Attributes:
        at_readings: whether tables have equilibria at the very displacements that were read, and must reach them.
    """

    at_readings: bool = field(default=False, kw_only=True)
    _tables: OrderedDict[Key, PathTable] = field(default_factory=OrderedDict)
    _known_pulls: dict[tuple[str, tuple[float, ...]], Array] = field(default_factory=dict)
    _known_ramps: dict[tuple[tuple[int, int], ...], list[Ramp]] = field(default_factory=dict, init=False)
    _sheaves: OrderedDict[tuple[object, ...], tuple[Sheaf, list[OnRay]]] = field(
        default_factory=OrderedDict, init=False
    )

    def branched(self, ray: Ray, sign: int, reach: float) -> bool:
        """Whether a half-ray has a bifurcation within its reach, in any table made so far."""
        d = HalfRay.of(ray.posture, sign * ray.direction, reach).direction
        return any(
            table.bifurcation < reach
            for (_, half, near), table in self._tables.items()
            if near is None and (half.posture, half.direction) == (ray.posture, d)
        )

    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis.

        Where a derivative is made, ``beside`` are values a little beside: tables are along their displacements,
        from where the stiffness leads on, and at the equilibria of their machine moved by what differs.

        Raises:
            NoConvergenceError: the machine does not stand.
        """
        observed = self.observed
        machine = self.machine(unknowns, z, hypothesis)
        values = values_of(unknowns, z, hypothesis)
        errors = instrument_errors(unknowns, z, observed.slots)
        of_pose, of_wrench = drifted(observed, hypothesis, values)
        place = errors.true_displacement(observed.imposed - of_pose)
        own = own_effects(unknowns, z, hypothesis)
        for effect, v in own:
            place = effect.imposed(place, v)
        if beside is None:
            sheaf, tables = self._lookup(machine, own)
        else:
            reference = self.machine(unknowns, beside, hypothesis)
            sheaf, tables = self._lookup(machine, own_effects(unknowns, beside, hypothesis), reference)
        look = sheaf.at
        elements = [element for effect, v in own for element in effect.elements(machine, v)]
        limit = sum((np.asarray(effect.friction(v)) for effect, v in own), np.zeros(1))
        histories = [
            relaxing(tables, observed.history, r) for e, v in own if (r := e.relaxation(machine, v)) is not None
        ]
        if limit.any():
            presliding = max(effect.presliding(v) for effect, v in own)
            histories.append(lambda u: self._friction(sheaf, u, limit, presliding))
        if histories:
            wrench, stiffness = self._with_history(look, place, elements, histories)
        elif elements:
            balanced = balance(look, place, elements, observed.history)
            wrench, stiffness = balanced.wrench, balanced.stiffness
        else:
            wrench, stiffness = look(place)
        local = not histories and all(isinstance(element.law, Memoryless) for element in elements)
        exact = partial(self._slope, unknowns, z, hypothesis, machine, wrench, errors.gain[:, None] * stiffness)
        turned = along = np.eye(6)
        for effect, v in own:
            turned = effect.imposed(turned, v)
        stiffness = stiffness if turned is along else stiffness @ turned.T
        residual = errors.residual(observed.measured - of_wrench, wrench)
        return Evaluation(z, residual, wrench, stiffness, place, errors, exact if local else None)

    def _slope(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, machine: ModifiedMachine,
        wrench: Array, stiffness: Array, i: int,
    ) -> Array | None:  # fmt: skip
        """Derivative ``(n, 6)`` of the residuals by coordinate ``i`` of what deflects in series; else None.

        Without a history ``u = u_chain(W) + v(W, p)`` gives ``dW = −K dv``: the wrench W is held in v, and K is the
        ``stiffness`` (n, 6, 6) of chain and elements together, as the gauges read it.
        """
        moved = deflected(
            unknowns, z, hypothesis, machine, i, lambda own: deflection(own, wrench, self.observed.history)
        )
        if moved is None:
            return None
        change, width = moved
        return np.where(self.observed.present, np.einsum("nij,nj->ni", stiffness, change) / width, 0.0)

    def _lookup(
        self,
        machine: ModifiedMachine,
        own: Sequence[tuple[Effect, Sequence[float]]],
        reference: ModifiedMachine | None = None,
    ) -> tuple[Sheaf, list[OnRay]]:
        """The tables of all rays, to be looked up by displacement, and the rays' tables of both signs.

        Of a machine near a ``reference`` the tables are as exact as a derivative needs. Hypotheses that differ in
        laws alone share them.
        """
        ramps = self._ramps
        directions = np.array([ramp.ray.direction for ramp in ramps])
        for effect, v in own:
            directions = effect.imposed(directions, v)
        if reference is not None and reference.key == machine.key:
            reference = None
        near = None if reference is None else reference.key
        key = machine.key, near, directions.tobytes(), tuple(self.branches.items())
        known = self._sheaves.pop(key, None)
        if known is None:
            known = self._tabulated(machine, ramps, directions, reference)
        self._sheaves[key] = known
        if len(self._sheaves) > AT_HAND:
            self._sheaves.popitem(last=False)
        return known

    def _tabulated(
        self, machine: ModifiedMachine, ramps: Sequence[Ramp], directions: Array, reference: ModifiedMachine | None
    ) -> tuple[Sheaf, list[OnRay]]:
        """As of `_lookup`, for ramps along ``directions`` (r, 6)."""
        tables = []
        for ramp, d in zip(ramps, directions, strict=True):
            measure = ramp.ray.measure @ _turned(ramp.ray.direction, d)
            up, down = (
                self._table(machine, HalfRay.of(ramp.ray.posture, sign * d, reach, branch, places), reference)
                for sign, reach, branch, places in zip((1, -1), ramp.reach, ramp.branches, ramp.places, strict=True)
            )
            self._check_reach(up, ramp.places[0])
            self._check_reach(down, ramp.places[1])
            tables.append((ramp.index, measure, up, down, d))

        n = len(self.observed.imposed)
        both, measures, along = np.zeros((n, 2), dtype=np.int64), np.empty((n, 6)), np.empty((n, 6))
        for k, (index, measure, _, _, d) in enumerate(tables):
            both[index] = 2 * k, 2 * k + 1
            measures[index], along[index] = measure, d
        sheaf = Sheaf([table for _, _, *two, _ in tables for table in two], both, measures, along)
        return sheaf, [(index, measure, up, down) for index, measure, up, down, _ in tables]

    def behind_bifurcation(self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> np.ndarray:
        """Whether each reading ``(n,)`` lies behind a bifurcation of the machine of coordinates ``(n_z,)``."""
        place = instrument_errors(unknowns, z, self.observed.slots).true_displacement(self.observed.imposed)
        _, tables = self._lookup(self.machine(unknowns, z, hypothesis), own_effects(unknowns, z, hypothesis))
        result = np.zeros(len(place), dtype=bool)
        for index, measure, up, down in tables:
            s = place[index] @ measure
            result[index] = (s > up.bifurcation) | (-s > down.bifurcation)
        return result

    @staticmethod
    def _check_reach(table: PathTable, places: Sequence[float]) -> None:
        """That a table goes as far as the places that it is to have.

        Raises:
            NoConvergenceError: it does not.
        """
        if places and table.s[-1] < places[-1] * (1.0 - 1e-9):
            raise NoConvergenceError(f"posture {table.problem.load_case.posture}: {table.stopped}")

    @property
    def _ramps(self) -> list[Ramp]:
        """The rays of the test, those of all runs along one on the same branches together."""
        branches = tuple(
            (self.branches.get((number, 1), 1), self.branches.get((number, -1), 1))
            for number in range(len(self.observed.rays))
        )
        if branches not in self._known_ramps:
            self._known_ramps[branches] = _ramps(self.observed, branches, at_readings=self.at_readings)
        return self._known_ramps[branches]

    def _table(
        self, machine: ModifiedMachine, half: HalfRay, reference: ModifiedMachine | None = None
    ) -> PathTable:
        near = None if reference is None else reference.key
        for key in ((machine.key, half, None), (machine.key, half, near)):
            if key in self._tables:
                self._tables.move_to_end(key)
                return self._tables[key]
        pulls = self._pulls(machine, half) if machine.asymmetry else ()
        table = None
        if reference is not None:
            table = beside(machine, half, pulls, self._table(reference, half))
        self._tables[key] = table = table or tabulate(machine, half, pulls)
        if len(self._tables) > KEPT:
            self._tables.popitem(last=False)
        return table

    def _pulls(self, machine: ModifiedMachine, half: HalfRay) -> AxialSigns:
        """What a ramp does to each part that differs between pull and push."""
        key = half.posture, tuple(np.round(half.direction, 3).tolist())
        if key not in self._known_pulls:
            self._known_pulls[key] = first_force(machine, half.posture, np.array(half.direction))
        return machine.axial_signs(half.posture, self._known_pulls[key])

    def _with_history(
        self,
        look: Callable[[Array], tuple[Array, Array]],
        place: Array,
        elements: Sequence[SeriesElement],
        histories: Sequence[Callable[[Array], Array]],
    ) -> tuple[Array, Array]:
        """The equilibrium with wrenches that follow from the history of the chain's own displacements."""
        own, extension = place, None
        for _ in range(ROUNDS if elements else 1):
            extra = np.sum([history(own) for history in histories], axis=0)

            def with_extra(u: Array, extra: Array = extra) -> tuple[Array, Array]:
                W, K = look(u)
                return W + extra, K

            balanced = balance(with_extra, place, elements, self.observed.history, extension)
            own, extension = balanced.pose, balanced.extension
        return balanced.wrench, balanced.stiffness

    def _friction(self, sheaf: Sheaf, own: Array, limit: Array, presliding: float) -> Array:
        free, give, bear, rest = sheaf.yielding(own)
        tau = friction_torques(free, give, limit, self.observed.history.begins, rest, presliding)
        return np.einsum("nij,nj->ni", bear, tau)


def _ramps(observed: Observed, branches: Sequence[tuple[int, int]], *, at_readings: bool) -> list[Ramp]:
    groups: dict[tuple[object, ...], list[int]] = {}
    for number, ray in enumerate(observed.rays):
        groups.setdefault((ray.posture, tuple(ray.direction.tolist()), branches[number]), []).append(number)
    result = []
    for numbers in groups.values():
        ray = observed.rays[numbers[0]]
        alike = [
            r for r in observed.rays if r.posture == ray.posture and np.array_equal(r.direction, ray.direction)
        ]
        # one length for all runs along one ray
        s = np.concatenate([observed.imposed[r.index] @ r.measure for r in alike])
        up, down = (
            max(float((sign * s).max()) * MARGIN, 0.0) + 0.02 * float(np.abs(s).max()) + 1e-3 for sign in (1, -1)
        )
        index = np.concatenate([observed.rays[k].index for k in numbers])
        both = tuple(np.unique(way[way > 0.0]).tolist() for way in (s, -s)) if at_readings else ((), ())
        result.append(Ramp(ray, index, (up, down), branches[numbers[0]], (tuple(both[0]), tuple(both[1]))))
    return result


def deflected(
    unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, machine: ModifiedMachine, i: int,
    by: Callable[[Sequence[SeriesElement]], Array],
) -> tuple[Array, float] | None:  # fmt: skip
    """What elements deflect more from one side of coordinate ``i`` to the other, and how far these lie apart.

    None where its cause does something else.
    """
    c = unknowns[i]
    number = int(c.subject) if c.kind == "effect" else -1
    if number < 0 or not deflects(hypothesis[number]):
        return None
    step = c.difference * max(1.0, abs(z[i]))
    ends, moved = (max(z[i] - step, c.low), min(z[i] + step, c.high)), []
    for end in ends:
        values = values_of(unknowns, np.where(np.arange(len(z)) == i, end, z), hypothesis)[number]
        moved.append(by(hypothesis[number].elements(machine, values)))
    return moved[1] - moved[0], ends[1] - ends[0]


def drifted(observed: Observed, hypothesis: Hypothesis, values: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """What drift adds to readings of what was imposed ``(n, 6)``, and of what was read ``(n, m)``."""
    imposed, read = np.zeros_like(observed.imposed), np.zeros_like(observed.measured)
    for effect, v in zip(hypothesis, values, strict=True):
        if not isinstance(effect, ThermalDrift):
            continue
        drift = effect.course(observed.warmth, observed.clock, v)
        if effect.part in observed.columns:
            read[:, observed.columns.index(effect.part)] += drift
        else:
            k = observed.slots[effect.part]
            # the gauge's drift went the way of its noise
            imposed[:, k] += observed.steady[k].regressed(drift) if k in observed.steady else drift
    return imposed, read


def own_effects(
    unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis
) -> list[tuple[Effect, list[float]]]:
    """The effects that free no nuisance, with their values."""
    values = values_of(unknowns, z, hypothesis)
    return [(effect, v) for effect, v in zip(hypothesis, values, strict=True) if release_key(effect) is None]


def _turned(before: Array, after: Array) -> Array:
    """Matrix that takes displacements along ``after`` back to those along ``before``."""
    if np.array_equal(before, after):
        return np.eye(6)
    a, b = before[:3], after[:3]
    axis = np.cross(b, a)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    S = np.cross(axis, np.eye(3)).T / size
    R = np.eye(3) + S + S @ S / (1.0 + cosine / size) if sine > 0.0 else np.eye(3)
    result = np.eye(6)
    result[:3, :3] = R
    return result


def machine_of(
    observed: Observed, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis
) -> ModifiedMachine:
    """The nominal machine with the nuisances and effects of a hypothesis."""
    machine = ModifiedMachine(observed.measurement.chain, observed.measurement.engine)
    for c, value in zip(unknowns, z, strict=True):
        if c.kind == "modulus":
            machine = machine.times(c.subject, 1.0 / (1.0 + c.value(value)))
        elif c.kind == "length":
            machine = machine.longer(c.subject, c.value(value))
    for effect, values in zip(hypothesis, values_of(unknowns, z, hypothesis), strict=True):
        if release_key(effect) is None:
            machine = effect.machine(machine, values)
    return machine


def values_of(unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> list[list[float]]:
    """Each effect's values; a released nuisance's own value, as its cause reports it."""
    result: list[list[float]] = []
    for i, effect in enumerate(hypothesis):
        key = release_key(effect)
        if key is None:
            result.append([unknowns[k].value(z[k]) for k in of_effect(unknowns, i)])
            continue
        k = next(k for k, c in enumerate(unknowns) if (c.kind, c.subject) == key)
        value = unknowns[k].value(float(z[k]))
        result.append([1.0 / (1.0 + value) if key[0] == "modulus" else value])
    return result


# --- Readings of ramps as a calibration and a diagnosis take them: displacements as they were imposed -------------


def observe_ramps(measurement: Measurement) -> Observed:
    """What there is to be explained, displacements as commanded where that was steadily, idle axes at their means.

    At what a gauge of an idle axis reads, the slopes of the forces by a stiffness have that gauge's noise in them.
    They would explain the very noise that they are made of.

    Raises:
        ValueError: no displacement of the end-effector was read, or it cannot be used; see `observe`.
        vjm.errors.NoConvergenceError: the nominal machine has no equilibrium at the readings.
    """
    observed = straightened(observe(measurement))
    if len(observed.slots) < 2 or measurement.sheet.test.control != "displacement":
        return observed
    nuisances = nuisance_coordinates(observed)
    evaluation = Forward(observed).evaluate(coordinates(nuisances, ()), np.zeros(len(nuisances)), ())
    return at_their_means(observed, evaluation)
