"""``validate simulate``: readings of the sheet's machine with a hidden effect, as a test would take them.

To plan a test, and to try a diagnosis. The machine may be made of geometrically exact beams, with the effect
built into it.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from vjm import __version__
from vjm.continuation.path import EventKind
from vjm.continuation.path import Path as EquilibriumPath
from vjm.engines import Engine, EngineOptions, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.errors import did_you_mean
from vjm.io.files import check_writable, write_whole
from vjm.model.load_case import COMPONENTS, Direction, LoadCase, ramp_end
from vjm.model.machine import Machine
from vjm.model.parts import Part
from vjm.outcome import Outcome
from vjm.rotations import Array, rotation_from_vector
from vjm_output.documents import Row, as_json
from vjm_updating.constants import numerical, stated_level
from vjm_updating.data_set import DataSet, load_data
from vjm_updating.diagnosis.experiment import left_over, out_and_back, short_of_critical
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.ramp_kind import RampTest
from vjm_updating.experiment import Kind, Readings, read_sheet
from vjm_updating.experiment.data_file import POSE, POSTURE, RUN, TEMPERATURE, TIME, WRENCH, SheetError, split_point
from vjm_updating.experiment.measurement import planned_measurement
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.inference.fitting import LeastSquaresProblem, whitening_of
from vjm_updating.inference.instruments import InstrumentErrors
from vjm_updating.inference.load_forward import LoadForward
from vjm_updating.inference.observed import Observed, observe_loads
from vjm_updating.inference.parameters import FitParameter, coordinates, nuisance_coordinates, release_key, start
from vjm_updating.mechanisms.catalogue import plug_in
from vjm_updating.mechanisms.drives import ActuatorCompliance
from vjm_updating.mechanisms.effect import Effect, Quantity
from vjm_updating.mechanisms.loads import Gravity, LoadMisalignment
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, standing_free
from vjm_updating.mechanisms.structure import BaseCompliance, LinkBow

Hidden = tuple[Effect, list[float]]
"""An effect with the values of its quantities."""


def parsed_effects(texts: Sequence[str], effects: Sequence[Effect]) -> list[Hidden]:
    """The effects that are hidden.

    Args:
        texts: each ``cause``, ``cause=value`` for its principal parameter, or ``cause.parameter=value``; where a
            cause can sit in several places ``cause.place`` stands for the cause. Several parameters of one cause
            are several texts.
        effects: the catalogue of the test.

    Raises:
        ValueError: there is no such effect or parameter in this test, or its value is out of bounds; one line.
    """
    hidden: dict[str, Hidden] = {}
    for text in texts:
        name, given, number = text.partition("=")
        effect, parameter = _effect(name.strip(), effects)
        quantities = sizes(effect)
        # who names one component of a size means the others to be none
        size = 0 if parameter else 1
        _, values = hidden.setdefault(effect.label, (effect, _usual(effect, size)))
        if not given:
            continue
        names = [q.name for q in quantities]
        if not names:
            raise ValueError(
                f"--hide {text}: {effect.label} is there or not and has no size: leave '={number}' out"
            )
        if parameter and parameter not in names:
            hint = did_you_mean(parameter, names)
            raise ValueError(
                f"--hide {text}: {effect.label} has no parameter '{parameter}'{hint}; it has {', '.join(names)}"
            )
        k = names.index(parameter) if parameter else 0
        try:
            value = float(number)
        except ValueError:
            raise ValueError(f"--hide {text}: '{number}' is no number") from None
        q = quantities[k]
        if not q.low <= value <= q.high:
            raise ValueError(f"--hide {text}: {q.name} must be from {q.low:g} to {q.high:g}")
        values[k] = value
    return list(hidden.values())


def sizes(effect: Effect) -> tuple[Quantity, ...]:
    """The parameters of an effect; an error of an instrument, which has no bounds, is one number."""
    quantities = effect.quantities()
    if not quantities and release_key(effect) is not None:
        return (Quantity("error", float("-inf"), float("inf"), 1.0),)
    return quantities


def _effect(name: str, effects: Sequence[Effect]) -> tuple[Effect, str]:
    """The effect whose label begins a name, and the parameter behind it; empty where there is none."""
    labels = {effect.label: effect for effect in reversed(effects)}
    for label in sorted(labels, key=len, reverse=True):
        if name == label or name.startswith(f"{label}."):
            return labels[label], name[len(label) + 1 :]
    cause = name.partition(".")[0]
    places = [label for label in labels if label.startswith(f"{cause}.")]
    if places:
        raise ValueError(f"--hide {name}: say where it sits: {', '.join(sorted(places))}")
    known = sorted({effect.cause for effect in effects})
    raise ValueError(
        f"--hide {name}: no such effect in this test{did_you_mean(cause, known)}; there are {', '.join(known)}"
    )


def _usual(effect: Effect, size: int) -> list[float]:
    """Values where nothing is said: those of the catalogue's first trial, with ``size`` components of its size."""
    values = list(effect.trials()[0]) or [0.0] * len(sizes(effect))
    for k, q in enumerate(effect.quantities()):
        if size <= k < effect.extent and q.neutral is not None:
            values[k] = q.neutral
        elif k >= effect.extent and np.isfinite(q.spread):
            values[k] = q.usual
    return values


OF_INSTRUMENTS = ("instrument_zero", "instrument_scale")
OF_PARTS = ("foot_compliance", "link_compliance", "link_length")
"""Come as what is off within a test, see `BeamMachine.wrench`."""
BY_NATURE = ("foot_lumping", "link_lumping")
"""Beams have no springs: they are what the sheet's model lacks."""
CARRIED = (
    *("actuator_compliance", "base_compliance", *OF_PARTS, *BY_NATURE, "gravity", *OF_INSTRUMENTS),
    *("link_bow", "load_misalignment"),
)  # fmt: skip
"""Causes that the beams can carry."""
ELEMENTS = numerical(16)
"""Of every beam; a bowed one is as many chords, whose error is of the second order in their length."""
STEPS = numerical(40)
"""Points of a path between which readings are interpolated, by cubics through values and slopes."""


@dataclass(frozen=True)
class BeamMachine:
    """A machine of beams in a test.

    Attributes:
        posture: label of each reading ``(n,)``.
        run: number of each reading's ramp, out and back on one side of the unloaded pose ``(n,)``.
        pose: displacement that the gauges are to show at each reading ``(n, 6)``, mm and rad.
    """

    chain: Machine
    posture: np.ndarray
    run: np.ndarray
    pose: Array
    hidden: tuple[Hidden, ...]
    engine: str = "exudyn"

    def wrench(self, off: Mapping[tuple[str, str], float]) -> Array:
        """Readings ``(n, 6)`` without noise, N and N mm.

        ``off`` has zero and scale errors of channels, relative moduli and lengths in mm of parts, by kind and
        subject.

        Raises:
            NoConvergenceError: the machine does not stand at the readings.
            ValueError: the finite elements cannot be made of this chain.
        """
        errors = InstrumentErrors.of(off)
        place = errors.true_displacement(self.pose)
        machine = ModifiedMachine(self.chain, VjmEngine())
        for (kind, name), value in off.items():
            if kind == Kind.LENGTH:
                machine = machine.longer(name, value)
            elif kind == Kind.MODULUS:
                machine = machine.times(name, 1.0 / (1.0 + value))
        bows: dict[str, Sequence[float]] = {}
        for effect, values in self.hidden:
            if isinstance(effect, LoadMisalignment):
                place = effect.imposed(place, values)
            elif isinstance(effect, LinkBow):
                bows[effect.beam] = values
            elif isinstance(effect, Gravity):
                machine = effect.machine(machine, values)
        chain = machine.chain()
        for effect, values in self.hidden:
            if isinstance(effect, ActuatorCompliance | BaseCompliance):
                chain = effect.built(chain, values)
        if bows:
            chain = _in_pieces(chain, bows)
        engine = engine_by_name(self.engine, EngineOptions(segments=1 if bows else ELEMENTS), chain)
        wrench = np.zeros_like(place)
        lengthened = chain.closes and any(kind == "length" and value for (kind, _), value in off.items())
        for run in dict.fromkeys(self.run.tolist()):
            own = np.flatnonzero(self.run == run)
            posture = str(self.posture[own[0]])
            stands = _settled(chain, posture) if lengthened else chain
            wrench[own] = _along(engine, stands, posture, place[own], machine.weighing)
        return errors.reading(wrench)


# --- changes of the chain ---------------------------------------------------------------------------------


def _replaced(chain: Machine, name: str, parts: Sequence[Part]) -> Machine:
    """The chain with others in a part's place."""
    kept = [part for part in chain.parts for part in (parts if part.name == name else [part])]
    return replace(chain, parts=tuple(kept))


def _settled(chain: Machine, posture: str) -> Machine:
    """The chain in one posture, its loops with other lengths than drawn: gauges are zeroed where it stands free.

    Where it stands is by springs, as fine as the elements: both tend to the same beams.

    Raises:
        NoConvergenceError: it does not stand.
    """
    alone = replace(chain, postures={posture: chain.posture(posture)}, held={posture: chain.held[posture]})
    return standing_free(alone, VjmEngine(ELEMENTS))


def _in_pieces(chain: Machine, bows: Mapping[str, Sequence[float]]) -> Machine:
    """With every beam as chords of a half sine wave, its ends where they were, for one element in each.

    ``bows`` are amplitudes at mid-span along the section's y and z axes, mm, by beam; the others are straight.
    """
    t = np.linspace(0.0, 1.0, ELEMENTS + 1)
    # the chords and the wave bound the same area
    area = 2.0 / np.pi * ELEMENTS * np.tan(0.5 * np.pi / ELEMENTS)
    for beam in chain.beams:
        wave = area * np.outer(np.sin(np.pi * t), bows.get(beam.name, (0.0, 0.0)))
        line = np.column_stack([beam.length * t, wave])
        pieces = []
        for k, chord in enumerate(np.diff(line, axis=0)):
            length = float(np.linalg.norm(chord))
            # turned from x by the smallest rotation
            axis = np.cross([1.0, 0.0, 0.0], chord / length)
            sine = float(np.linalg.norm(axis))
            turn = axis * (np.arcsin(sine) / sine if sine > 0.0 else 1.0)
            pieces.append(
                replace(
                    beam,
                    name=f"{beam.name} {k + 1}",
                    length=length,
                    section_frame=beam.section_frame @ rotation_from_vector(turn),
                    end_offset=beam.end_offset if k == ELEMENTS - 1 else np.zeros(3),
                    compliance=None,
                )
            )
        chain = _replaced(chain, beam.name, pieces)
    return chain


# --- the readings along paths -----------------------------------------------------------------------------


def _along(
    engine: Engine, chain: Machine, posture: str, place: Array, gravity: tuple[float, float, float] | None
) -> Array:
    """The wrench ``(k, 6)`` at displacements ``(k, 6)`` along one half-line.

    What lies beside the line, by the gauges' zero errors, goes by the stiffness there.
    """
    furthest = place[int(np.argmax(np.linalg.norm(place, axis=1)))]
    reach = float(np.linalg.norm(furthest))
    direction = furthest / reach
    path = engine.trace(chain, LoadCase(posture, reach, tuple(direction.tolist()), STEPS, gravity=gravity))
    if not path.complete:
        raise NoConvergenceError(f"posture {posture}: {path.stopped}")
    s = np.clip(place @ direction, 0.0, reach)
    wrench, K = _interpolated(path, s, direction)
    return wrench + np.einsum("kij,kj->ki", K, place - np.outer(s, direction))


def _interpolated(path: EquilibriumPath, positions: Array, direction: Array) -> tuple[Array, Array]:
    """Wrench ``(k, 6)`` and stiffness ``(k, 6, 6)`` of a path; cubics do not lead across a bifurcation."""
    s = path.s
    wrench = np.array([point.wrench for point in path.points])
    K = np.array([np.zeros((6, 6)) if point.stiffness is None else point.stiffness for point in path.points])
    breaks = [event.s for event in path.events if event.kind is EventKind.BIFURCATION]
    side, mine = (np.searchsorted(breaks, v, side="right") for v in (s, positions))
    result, stiffness = np.zeros((len(positions), 6)), np.zeros((len(positions), 6, 6))
    for k in range(len(breaks) + 1):
        own, rows = side == k, mine == k
        if not rows.any():
            continue
        if own.sum() < 2:
            own = np.ones_like(own)
        result[rows] = CubicHermiteSpline(s[own], wrench[own], K[own] @ direction)(positions[rows])
        for i, row in zip(np.flatnonzero(rows), positions[rows], strict=True):
            stiffness[i] = K[own][int(np.argmin(np.abs(s[own] - row)))]
    return result, stiffness


# --- Where a simulated test takes its readings: ramps out, held and back in each posture --------------------------

INTERVAL, ROOM = numerical(10.0), numerical(20.0)
"""Seconds between two readings, and the temperature, °C, at which all of them are taken."""


@dataclass(frozen=True)
class PlannedRamp:
    """One way out and back.

    Attributes:
        axis: component that is driven, of the displacement or under force control of the load.
        end: of the ramp, mm or rad; N or N mm.
    """

    posture: str
    axis: str
    end: float

    def channel(self, sheet: Sheet) -> str:
        """The column that is driven."""
        return (WRENCH if sheet.test.by_force else POSE)[COMPONENTS.index(self.axis)]


def parsed_ramp(text: str) -> PlannedRamp:
    """A ramp as ``POSTURE:END`` along x or ``POSTURE:AXIS:END``.

    Raises:
        ValueError: it is none; one line.
    """
    posture, *axis, end = text.split(":") if text.count(":") in (1, 2) else ["", "", ""]
    name = axis[0] if axis else "x"
    try:
        if not posture or name not in COMPONENTS or not 0.0 < abs(float(end)) < float("inf"):
            raise ValueError
    except ValueError:
        raise ValueError(
            f"--ramp: '{text}' is no ramp: write POSTURE:END or POSTURE:AXIS:END, such as A:-2 or B:y:0.5"
        ) from None
    return PlannedRamp(posture, name, float(end))


def usual_ramps(chain: Machine, engine: VjmEngine, labels: Sequence[str]) -> list[PlannedRamp]:
    """Every posture pulled and pushed along x, short of where the nominal machine turns critical."""
    ramps = []
    for label, direction in product(labels, Direction):
        end = ramp_end(chain, label, direction)
        reached = short_of_critical(engine.trace(chain, LoadCase(label, end)), abs(end))
        ramps.append(PlannedRamp(label, COMPONENTS[0], round(direction.sign * float(reached), 4)))
    return ramps


def planned_readings(sheet: Sheet, ramps: Sequence[PlannedRamp]) -> Readings:
    """The readings' places, in the order of time; wrench channels zero.

    Raises:
        SheetError: an instrument cannot be simulated, or one that is needed is missing.
    """
    by_force = sheet.test.by_force
    for name, known in sheet.instrument.items():
        if known.held or (split_point(name)[0] and not by_force):
            raise SheetError(
                f"{sheet.file}: [instrument.{name}]: only instruments at the end-effector can be simulated, at a "
                "point only under force control, and none that stops at marks. Leave it out"
            )
    for ramp in ramps:
        sheet.sigma(ramp.channel(sheet))
    imposed, read = (WRENCH, POSE) if by_force else (POSE, WRENCH)
    if not any(split_point(name)[1] in read for name in sheet.instrument):
        raise SheetError(
            f"{sheet.file}: {'no displacement' if by_force else 'no force'} is read: add "
            f"[instrument.{'uz_mm' if by_force else 'fx_N'}] with its noise"
        )
    ways = [out_and_back(ramp.end) for ramp in ramps]
    counts = np.array([len(way) for way in ways], dtype=int)
    n = int(counts.sum())
    number = np.repeat(np.arange(1, len(ways) + 1), counts)
    driven = {name: np.zeros(n) for name in imposed if name in sheet.instrument}
    for k, (ramp, way) in enumerate(zip(ramps, ways, strict=True), 1):
        driven[ramp.channel(sheet)][number == k] = way
    values: dict[str, Array] = {TIME: INTERVAL * np.arange(n, dtype=float), **driven}
    values |= {name: np.zeros(n) for name in sheet.instrument if split_point(name)[1] in read}
    if TEMPERATURE in sheet.instrument:
        values[TEMPERATURE] = np.full(n, ROOM)
    labels = np.repeat(np.array([ramp.posture for ramp in ramps]), counts)
    return Readings("simulated.csv", np.arange(2, n + 2), labels, number, values)


DATA, SHEET, TRUTH = "readings.csv", "sheet.toml", "truth.json"
SURE, LOST = stated_level(4.0), stated_level(2.0)
"""Strength from which a diagnosis sees an effect for sure, and below which it does not."""


class Truth(Row):
    """The content of ``truth.json``: what a diagnosis has to find."""

    version: str
    model: str
    engine: str
    hidden: dict[str, float | None]
    """By effect and parameter; null for an effect without parameters."""
    seed: int
    noise: str
    """``sheet``: the sheet's noise and tolerances; ``none``."""
    nuisances: dict[str, float]
    """What was drawn within the sheet's tolerances, in each one's own unit; moduli relative."""
    ramps: list[str]
    readings: int
    strength: float
    """Of what the tolerances cannot make up for, in standard deviations of the readings' noise."""
    largest: float
    """Largest change of a reading by the hidden effects."""
    left: float
    """Largest change of that channel's readings that the tolerances cannot make up for."""
    channel: str


@dataclass(frozen=True)
class _Machine:
    """The machine with what is hidden in it, at the planned readings; beams where it has the name of an engine."""

    kind: RampTest
    observed: Observed
    nuisances: tuple[FitParameter, ...]
    effects: tuple[Effect, ...]
    values: list[list[float]]
    engine: str = ""

    def wrench(self, drawn: Array) -> Array:
        """Readings ``(n, 6)`` without noise, with nuisances ``(m,)`` in their sigmas."""
        if self.engine:
            released = self._released(drawn)
            off = {(c.kind, c.subject): c.value(float(z)) for c, z in zip(self.nuisances, released, strict=True)}
            readings, hidden = self.observed.readings, tuple(zip(self.effects, self.values, strict=True))
            chain = self.observed.measurement.chain
            beams = BeamMachine(chain, readings.posture, readings.run, self.observed.imposed, hidden, self.engine)
            return beams.wrench(off)
        unknowns = coordinates(self.nuisances, self.effects)
        z = start(unknowns, self.effects, self._released(drawn), self.values)
        evaluation = self.kind.forward(self.observed).evaluate(unknowns, z, self.effects)
        return self.observed.measured - evaluation.residual

    def _released(self, drawn: Array) -> Array:
        """Nuisances with those that an effect sets, which has no coordinate of its own."""
        result = drawn.copy()
        for effect, own in zip(self.effects, self.values, strict=True):
            key = release_key(effect)
            for i, c in enumerate(self.nuisances):
                if (c.kind, c.subject) == key:
                    result[i] = c.coordinate(1.0 / own[0] - 1.0 if c.kind == "modulus" else own[0])
        return result


@dataclass(frozen=True)
class Simulation(Outcome):
    """The readings of a machine with something hidden in it.

    Attributes:
        truth: what is hidden, and how strong it is in the test.
        files: content of `DATA`, `SHEET` and `TRUTH` by their names.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import simulated
        >>> sheet = files("vjm_validation") / "examples/soft-springs/sheet.toml"
        >>> made = simulated("orthoglide-chain", sheet, hide=["link_bow=1.0"], seed=7, ramps=["A:-1"])
        >>> made.table()[0]["value"]
        1.0
    """

    truth: Truth
    files: Mapping[str, bytes]

    @property
    def data(self) -> DataSet:
        """The test, as `vjm_updating.load_data` gives it."""
        header, *rows = csv.reader(self.files[DATA].decode().splitlines())
        columns = dict(zip(header, zip(*rows, strict=True), strict=True))
        return load_data(columns, tomllib.loads(self.files[SHEET].decode()))

    def table(self) -> list[dict[str, Any]]:
        """A row for each hidden quantity."""
        return [{"hidden": name, "value": value} for name, value in self.truth.hidden.items()]

    def to_dict(self) -> dict[str, Any]:
        """The truth, as `TRUTH` has it."""
        return self.truth.model_dump(mode="json")

    def write(self, out: Path | str) -> None:
        """Write the files into a folder.

        Raises:
            OSError: it cannot be written to.
        """
        for name, content in self.files.items():
            write_whole(Path(out) / name, content)


def simulate(model: str, sheet: Path, out: Path, **options: Any) -> Truth:  # noqa: ANN401
    """Write a test's two files and the truth behind them into a folder; see `simulated`.

    Raises:
        ValueError: an input cannot be used; one line.
        vjm.errors.NoConvergenceError: the machine does not stand at the readings.
    """
    check_writable(out)
    made = simulated(model, sheet, **options)
    made.write(out)
    return made.truth


def simulated(
    model: str, sheet: Path | str, *, hide: Sequence[str], noise: str = "sheet", seed: int = 0,
    ramps: Sequence[str] = (), plug_ins: Sequence[Path] = (), engine: str = "",
) -> Simulation:  # fmt: skip
    """The readings of a machine with hidden effects in a test, and how strong these are in it.

    Args:
        model: that the sheet is for; takes the place of the model that it names.
        sheet: test sheet, TOML.
        hide: effects, see `vjm_updating.simulate.parsed_effects`.
        noise: ``sheet`` or ``none``.
        seed: of noise and tolerances.
        ramps: ``POSTURE:END`` or ``POSTURE:AXIS:END``; every posture pulled and pushed where none is given.
        plug_ins: files with effects of one's own, see docs/effects.md.
        engine: of the finite elements that the machine is made of; empty for the sheet's lumped model. Whatever
            these differ in counts as hidden, such as one spring a link of the sheet's model.

    Raises:
        ValueError: an input cannot be used; one line.
        vjm.errors.NoConvergenceError: the machine does not stand at the readings.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import simulated
        >>> sheet = files("vjm_validation") / "examples/soft-springs/sheet.toml"
        >>> made = simulated("orthoglide-chain", sheet, hide=["link_bow=1.0"], seed=7, ramps=["A:-1"])
        >>> made.table()[0], made.data.kind
        ({'hidden': 'link_bow.along_y_mm', 'value': 1.0}, 'ramps')
    """
    sheet = Path(sheet)
    more = [plug_in(path) for path in plug_ins]
    page = read_sheet(sheet)
    name = str(Path(model).resolve()) if Path(model).is_file() else model
    page = page.model_copy(update={"test": page.test.model_copy(update={"model": name})})
    if page.kind == "joint":
        raise ValueError(
            f"{sheet.name}: is a test of one joint, and ramps of a chain are simulated: take another sheet"
        )
    kind, observed, plan = _planned(page, [parsed_ramp(text) for text in ramps])
    if engine and observed.measurement.loaded:
        raise ValueError(
            f"--engine {engine}: takes imposed displacements, and {page.file} imposes loads: leave it out"
        )
    nominal = _Machine(kind, observed, tuple(nuisance_coordinates(observed)), (), [])
    rest = np.zeros(len(nominal.nuisances))
    # effects know the test by its forces
    scene = replace(observed, measured=np.where(observed.present, nominal.wrench(rest), np.nan))
    hidden = parsed_effects(hide, kind.effects(scene, more))
    for effect, _ in hidden if engine else ():
        if effect.cause not in CARRIED:
            raise ValueError(
                f"--hide {effect.label}: the beams of --engine {engine} cannot carry it; they carry "
                f"{', '.join(sorted(CARRIED))}. Leave --engine out for the lumped model, which carries all"
            )
    machine = replace(nominal, effects=tuple(e for e, _ in hidden), values=[v for _, v in hidden], engine=engine)
    strength, largest, left, channel = _strength(nominal, machine)
    rng = np.random.default_rng(seed)
    allowed = np.array([c.sigma > 0.0 for c in nominal.nuisances])
    drawn = np.where(allowed & (noise == "sheet"), rng.standard_normal(len(allowed)), 0.0)
    try:
        wrench = machine.wrench(drawn)
    except NoConvergenceError as error:
        raise NoConvergenceError(
            f"with {', '.join(hide)} the machine does not stand at the readings: {error}"
        ) from error
    readings = _read(observed, page, wrench, rng, noise)
    truth = Truth(
        version=__version__,
        model=observed.measurement.chain.name,
        engine=engine or observed.measurement.engine.label,
        hidden=_named(hidden),
        seed=seed,
        noise=noise,
        nuisances={c.name: c.value(float(z)) for c, z in zip(nominal.nuisances, drawn, strict=True) if z},
        ramps=[f"{ramp.posture} {ramp.channel(page)} {ramp.end:g}" for ramp in plan],
        readings=len(readings),
        strength=strength,
        largest=largest,
        left=left,
        channel=channel,
    )
    return Simulation(truth, {DATA: _csv(readings), SHEET: _sheet(sheet, name), TRUTH: as_json(truth).encode()})


def words(truth: Truth) -> list[str]:
    """What a terminal shows."""
    hidden = ", ".join(name if value is None else f"{name} = {value:g}" for name, value in truth.hidden.items())
    unit = truth.channel.rpartition("_")[2]
    verdict = (
        "a diagnosis sees it for sure" if truth.strength >= SURE
        else "a diagnosis will hardly see it" if truth.strength < LOST
        else "a diagnosis may see it or not"
    )  # fmt: skip
    return [
        f"{truth.readings} readings of {truth.model} ({truth.engine}) with {hidden or 'nothing hidden'}, "
        f"seed {truth.seed}",
        f"ramps: {'; '.join(truth.ramps)}",
        f"it changes {truth.channel} by up to {truth.largest:.3g} {unit}; the sheet's tolerances can make up for "
        f"all but {truth.left:.3g} {unit}",
        f"strength {truth.strength:.2f} standard deviations of the noise: {verdict} (sure from "
        f"{SURE:g}, lost below {LOST:g})",
    ]


def _planned(page: Sheet, ramps: list[PlannedRamp]) -> tuple[RampTest, Observed, list[PlannedRamp]]:
    if not ramps and page.test.by_force:
        raise ValueError(
            f"{page.file}: loads are imposed, and nothing says how large: give --ramp POSTURE:AXIS:LOAD, such as "
            "bench:z:100, in N or N mm"
        )
    if not ramps:
        bare = planned_measurement(page, planned_readings(page, []))
        labels = list(page.postures) or list(bare.chain.postures)
        ramps = usual_ramps(bare.chain, bare.engine, labels)
    readings = planned_readings(page, ramps)
    measurement = planned_measurement(page, readings)
    if page.test.by_force and not measurement.loaded:
        # displacements say what a machine with free joints does: those of the nominal one under the loads
        under = observe_loads(measurement)
        nuisances = nuisance_coordinates(under)
        evaluation = LoadForward(under).evaluate(nuisances, np.zeros(len(nuisances)), ())
        moved = dict(zip(under.columns, evaluation.prediction.T, strict=True))
        measurement = planned_measurement(page, replace(readings, values=readings.values | moved))
    kind = kind_of(measurement)
    return kind, kind.observe(measurement), ramps


def _strength(nominal: _Machine, machine: _Machine) -> tuple[float, float, float, str]:
    """Strength, largest change, its residual, and the channel where most is left."""
    observed = nominal.observed
    unknowns = coordinates(nominal.nuisances, ())
    rest = np.zeros(len(unknowns))
    forward = machine.kind.forward(observed)
    evaluation = forward.evaluate(unknowns, rest, ())
    fitter = LeastSquaresProblem(forward, nominal.nuisances, whitening_of(observed, evaluation))
    change = np.where(observed.present, machine.wrench(rest) - nominal.wrench(rest), 0.0)
    known = np.diag([1.0 if c.sigma > 0.0 else 0.0 for c in unknowns])
    strength, left = left_over(fitter, change, fitter.slopes(unknowns, evaluation, ()), known, unknowns)
    left = np.where(observed.present, left, 0.0)
    k = int(np.argmax(np.abs(left).max(axis=0) / observed.noise.wrench))
    return strength, float(np.abs(change[:, k]).max()), float(np.abs(left[:, k]).max()), observed.columns[k]


def _named(hidden: Sequence[Hidden]) -> dict[str, float | None]:
    result: dict[str, float | None] = {}
    for effect, values in hidden:
        quantities = sizes(effect)
        result |= {f"{effect.label}.{q.name}": v for q, v in zip(quantities, values, strict=True)}
        if not quantities:
            result[effect.label] = None
    return result


def _read(observed: Observed, page: Sheet, wrench: Array, rng: np.random.Generator, noise: str) -> Readings:
    """The readings with the instruments' noise."""
    readings = observed.readings
    values = dict(readings.values)
    for k, name in enumerate(observed.columns):
        if name in values:
            values[name] = wrench[:, k]
    usual = (*POSE, *WRENCH, TEMPERATURE)
    # the same seed gives the same readings, in whatever order the sheet has its instruments
    for name in (*usual, *(name for name in page.instrument if name not in usual)):
        if name in values and noise == "sheet":
            values[name] = values[name] + page.instrument[name].noise * rng.standard_normal(len(readings))
    return replace(readings, values=values)


def _csv(readings: Readings) -> bytes:
    names = list(readings.values)
    lines = [",".join([names[0], POSTURE, RUN, *names[1:]])]
    for k in range(len(readings)):
        first, *others = (f"{readings.values[name][k]:.6f}" for name in names)
        lines.append(",".join([first, str(readings.posture[k]), str(readings.run[k]), *others]))
    return ("\n".join(lines) + "\n").encode()


def _sheet(path: Path, model: str) -> bytes:
    """The sheet's text with the model that was simulated."""
    text = path.read_text(encoding="utf-8-sig")
    quoted = '"' + model.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return re.sub(
        r"(?m)^(\s*model\s*=\s*)(\"[^\"\n]*\"|'[^'\n]*')", lambda m: m[1] + quoted, text, count=1
    ).encode()
