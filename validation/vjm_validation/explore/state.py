"""What the sliders of a machine set, what the machine answers, and a second machine beside it under the same load.

No page knows of it. Every number is computed by what the commands compute it by, with the same springs.
"""

from __future__ import annotations

import copy
import re
import shlex
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from vjm.analysis import held_by_itself, stiffness
from vjm.design.best_machine import optimise
from vjm.design.linear_state import LinearState, Question, loaded_posture, state_of
from vjm.design.modes import Modes, modes_of, total_mass
from vjm.design.optimum import Optimum
from vjm.design.sensitivity import compliance
from vjm.design.shares import Shares, shares_of
from vjm.design.space import LoadCases
from vjm.design.sweep import asked, signs
from vjm.engines import EngineOptions, VjmEngine, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.file_parameters import MachineFiles, unit_of_key
from vjm.io.files import check_writable, write_together
from vjm.io.shapes import Shape
from vjm.machine.critical_force import CriticalForce, Weakest
from vjm.machine.rigid_mechanism import LoopClosure, RigidMechanism, home_label
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.postures import in_posture
from vjm.rotations import Array, displacement_between
from vjm.threads import single_threaded

FULL_LOAD = 1e-3
"""Shift of the end over the machine's extent under the largest force of a slider: what a stiff machine works at."""
FULL_DISPLACEMENT = 1e-2
"""Of the characteristic length, and rad: the largest displacement of a slider that holds the end."""
POSE_RANGE = 0.1
"""Of the extent, and rad: how far sliders of a pose go where the file has no workspace."""
SIZE_RANGE = 2.0
"""Factor on a number of the file, up and down, to which its slider goes."""
STEPS = 1000
"""Of a slider, at most."""
FINEST = 1e-5
"""Step of a slider as it is shown: viser's page writes seven digits behind the point."""
LENGTH, TURN = "mm", "rad"


@dataclass(frozen=True)
class Slider:
    """A number that can be set.

    Attributes:
        name: of the joint, the component or the number of the file.
        unit: of it.
        low: smallest value.
        high: largest value.
        value: to begin with.
    """

    name: str
    unit: str
    low: float
    high: float
    value: float

    @property
    def step(self) -> float:
        """A round step of which there are some hundreds; one where the number cannot be changed."""
        return round_number(self.high - self.low) / STEPS if self.high > self.low else 1.0

    @property
    def ends(self) -> tuple[float, float]:
        """The first and last multiple of the step within the limits, further out for the value to begin with."""
        if self.high <= self.low:
            return self.value, self.value
        step = self.step
        low, high = np.ceil(self.low / step - 1e-9) * step, np.floor(self.high / step + 1e-9) * step
        # without the minus of a zero
        return min(float(low) + 0.0, self.value), max(float(high) + 0.0, self.value)

    def readable(self) -> tuple[Slider, float]:
        """The slider with numbers that a page can write: small ones in a unit that has a power of ten.

        Returns:
            The slider, and its unit in that of this one.
        """
        if self.step >= FINEST:
            return self, 1.0
        scale = 10.0 ** float(np.floor(np.log10(max(abs(self.low), abs(self.high)))))
        # a double's last digits would be shown
        low, high, value = (float(f"{number / scale:.12g}") for number in (self.low, self.high, self.value))
        return Slider(self.name, f"{scale:.0e} {self.unit}".strip(), low, high, value), scale


def joint_sliders(machine: Machine, label: str) -> list[Slider]:
    """Sliders of the joints within their limits; of closed loops those of the drives, which the others follow.

    Args:
        machine: any.
        label: of the posture to begin with.
    """
    limits = joint_limits(machine)
    names = [joint.name for joint in machine.held_joints] if machine.closes else list(limits.given)
    stands = dict(machine.held.get(label, {}))
    stands |= dict(zip((joint.name for joint in machine.joints), machine.posture(label).tolist(), strict=True))
    sliders = []
    for name in names:
        k = limits.names.index(name)
        free = np.pi if limits.units[k] == TURN else machine.characteristic_length
        low, high = float(limits.low[k]), float(limits.high[k])
        low, high = low if np.isfinite(low) else -free, high if np.isfinite(high) else free
        value = float(stands[name])
        sliders.append(Slider(name, limits.units[k], min(low, value), max(high, value), value))
    return sliders


def pose_sliders(
    machine: Machine, label: str, closing: LoopClosure, freedom: int, workspace: Mapping[str, Any] | None
) -> list[Slider]:
    """Sliders of the end's displacement from home: of its place, and of its turn where it has all six freedoms.

    Args:
        machine: with closed loops.
        label: of the pose to begin with.
        closing: of its loops.
        freedom: of its end.
        workspace: the file's table, where it has one.
    """
    tree, length = closing.tree, machine.characteristic_length
    frame = tree.end_frames(tree.posture(label)[None])[0]
    moved = displacement_between(closing.end, frame).tolist()
    sliders = []
    for k, name in enumerate(COMPONENTS[: 6 if freedom == 6 else 3]):
        full = POSE_RANGE * (tree.length if k < 3 else 1.0)
        low, high = -full, full
        if k < 3 and workspace is not None:
            low, high = float(workspace["min_mm"][k]), float(workspace["max_mm"][k])
        unit = length if k < 3 else 1.0
        # closed loops leave rounding in a pose
        value = round(moved[k] / unit, 9) * unit
        sliders.append(Slider(name, LENGTH if k < 3 else TURN, min(low, value), max(high, value), value))
    return sliders


def displacement_sliders(length: float) -> list[Slider]:
    """Sliders of the displacement of an end that is held.

    Args:
        length: characteristic length of the machine, mm.
    """
    size = round_number(FULL_DISPLACEMENT * length)
    return [
        Slider(f"u{name}", LENGTH, -size, size, 0.0)
        if k < 3
        else Slider(name, TURN, -FULL_DISPLACEMENT, FULL_DISPLACEMENT, 0.0)
        for k, name in enumerate(COMPONENTS)
    ]


def force_sliders(smallest_stiffness: float, extent: float, wrench: Sequence[float] | None) -> list[Slider]:
    """Sliders of the wrench on a free end.

    Args:
        smallest_stiffness: smallest stiffness against a force, N/mm.
        extent: of the machine, mm.
        wrench: ``(6,)`` to begin with, N and N mm; zeros if left out.
    """
    start = (0.0,) * 6 if wrench is None else tuple(float(value) for value in wrench)
    force = FULL_LOAD * extent * (smallest_stiffness if np.isfinite(smallest_stiffness) else 1.0)
    force = round_number(max(force, *(abs(value) for value in start[:3])))
    moment = round_number(max(force * extent, *(abs(value) for value in start[3:])))
    return [
        Slider(name, unit, -full, full, value)
        for name, unit, full, value in (
            (f"{kind}{axis}", unit, full, start[3 * turns + k])
            for turns, (kind, unit, full) in enumerate((("f", "N", force), ("m", "N mm", moment)))
            for k, axis in enumerate("xyz")
        )
    ]


def size_slider(key: str, value: float) -> Slider:
    """The slider of a number of a model file, by its key."""
    ends = value / SIZE_RANGE, value * SIZE_RANGE
    return Slider(key, unit_of_key(key), min(ends), max(ends), value)


def round_number(value: float) -> float:
    """The next of 1, 2, 5, 10 … from a positive value on.

    Example:
        >>> round_number(0.03), round_number(200.0)
        (0.05, 200.0)
    """
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if m * decade >= value * (1.0 - 1e-9)))


# --- Files that the page writes: only where it was asked to, and over nothing -------------------------------------

FILE_NAME = re.compile(r"[^\W_][\w.-]{0,98}\.toml")
"""Names of files: none is hidden, none is an option, and no shell reads more than a name in them."""
LABEL = re.compile(r"[^\W\d_][\w-]{0,59}")
"""Labels of postures: none is read as coordinates."""


def keep(
    files: MachineFiles, file: Path, posture: tuple[str, Mapping[str, float] | list[float]] | None = None
) -> list[Path]:
    """Write the files of a machine, all of them or none.

    Args:
        files: of the machine.
        file: its name, ``.toml``.
        posture: label and coordinates of a posture more.

    Returns:
        The files that were written, the machine's last.

    Raises:
        ValueError: the name has other characters than letters, digits, ``-``, ``_`` and ``.``, does not end in
            ``.toml``, begins with a point, or is that of a file; the label is no word, or that of a posture.
        OSError: it cannot be written.
    """
    if not FILE_NAME.fullmatch(file.name):
        raise ValueError(
            f"'{file.name}': write a name of letters, digits, -, _ and . that begins with a letter or a digit and "
            f"ends in .toml"
        )
    if posture is not None:
        label, coordinates = posture
        if not LABEL.fullmatch(label):
            raise ValueError(f"'{label}': write a label of letters, digits, - and _ that begins with a letter")
        if any(label in files.document.content.get(key, {}) for key in ("postures", "poses")):
            raise ValueError(f"{files.name} has a posture '{label}' already: write another label")
        files = files.with_posture(label, coordinates)
    head = f"# {files.document.file} with other numbers, saved by `validate explore`.\n"
    texts = files.texts(file, head, str(files.document.content["title"]))
    for each in texts:
        # a link that leads nowhere does not exist, and would be written through
        if each.exists() or each.is_symlink():
            raise ValueError(f"{each.name} exists already: write another name")
    check_writable(file.parent)
    write_together(texts)
    return list(texts)


# ------------------------------------------------------------------------------------------------------------------


SEGMENTS = "2"
"""Springs in each beam unless another number is asked for: a beam's first frequency is right to a thousandth."""
MOST = 1e6
"""N: largest force tried for a critical one, as for maps."""


@dataclass(frozen=True)
class Setting:
    """What the sliders stand at.

    Attributes:
        coordinates: of the joints, or of the pose.
        load: ``(6,)`` on the end, N and N mm; of an end that is held its displacement, mm and rad.
        weighed: whether the parts have their weight.
        sizes: numbers of the file that are changed, by key.
    """

    coordinates: tuple[float, ...]
    load: tuple[float, ...] = (0.0,) * 6
    weighed: bool = False
    sizes: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class ExplorerAnswer:
    """What the machine does in a setting.

    Attributes:
        posture: as ``--posture`` takes it.
        deflection: ``(6,)`` of the end, mm and rad.
        wrench: ``(6,)`` on the end, N and N mm.
        stiffness: ``(6, 6)`` K^F, N/mm, N, N mm; nan where the end is rigid in a direction.
        principal: ``(3,)`` stiffnesses of the end against a force, N/mm, the smallest first; infinite where rigid.
        axes: ``(3, 3)`` their directions, in columns.
        shares: of the parts in the deflection, to first order; None without a load.
        modes: the lowest mode; None where there is none.
        mass: kg of all parts.
        rest: without loads.
        loaded: the equilibrium.
        said: sentences on what is not there, and why.
    """

    posture: str
    deflection: Array
    wrench: Array
    stiffness: Array
    principal: Array
    axes: Array
    shares: Shares | None
    modes: Modes | None
    mass: float
    rest: LinearState
    loaded: LinearState
    said: tuple[str, ...]

    @property
    def frequency(self) -> float | None:
        """The first natural frequency, Hz; None where there is none."""
        return None if self.modes is None else float(self.modes.frequencies[0])


class Explorer:
    """A machine whose posture, loads and sizes are set, and which answers.

    Attributes:
        model: its name or path, as commands take it.
        files: its files.
        held: whether its end is held, as a chain with passive joints carries no load on a free end.
        posed: whether the coordinates are the displacement of the end from home, instead of joints.
        coordinates: sliders of the joints or the pose.
        load: sliders of the components of the load, or of the end's displacement.
        sizes: sliders of the file's numbers.
        gravity: m/s², where the weight acts.
        end: name of the end frame.
        segments: as ``--segments`` takes it.
    """

    def __init__(
        self,
        model: str,
        posture: str | None = None,
        *,
        wrench: Sequence[float] | None = None,
        gravity: Gravity = (0.0, 0.0, -9.81),
        end: str = "",
        options: EngineOptions | None = None,
        segments: str = SEGMENTS,
    ) -> None:
        """Load a machine.

        Args:
            model: of the library, or a path.
            posture: to begin with: a label or coordinates; the first one if left out.
            wrench: ``(6,)`` on the free end to begin with, N and N mm.
            gravity: m/s².
            end: name of the end frame; the first if left out.
            options: the number of springs; ``segments`` as the engine takes it.
            segments: the same as ``--segments`` takes it.

        Raises:
            ModelFileError: no such model.
            ValueError: no such posture or end frame, or a wrench on an end that is held.
            NoConvergenceError: it has no equilibrium in the posture.
        """
        self.model, self.gravity, self.segments = model, gravity, segments
        self.files = MachineFiles.read(model)
        self._machine = machine = self.files.machine()
        self._sizes: dict[str, float] = {}
        self._built: tuple[object, LinearState] | None = None
        self._stands: tuple[object, tuple[Machine, str]] | None = None
        # what is kept from the last answer is of one setting at a time
        self._one_at_a_time = threading.RLock()
        engine = engine_by_name("vjm", options or EngineOptions(int(segments)), machine)
        assert isinstance(engine, VjmEngine)
        self.engine = engine
        if end and end not in machine.ends:
            known = ", ".join(machine.ends) or "none"
            raise ValueError(f"--end: {machine.name} has no end frame '{end}' (it has {known})")
        self.end = end
        machine, label = in_posture(machine, posture or next(iter(machine.postures)))
        self._label, self._labelled = label, machine
        closing = LoopClosure(machine, home_label(machine)) if machine.closes else None
        freedom = 0 if closing is None else closing.mobility(closing.home).freedom
        # what no drive holds moves without strain
        self.held = not held_by_itself(machine) or freedom > len(machine.held_joints)
        if self.held and wrench is not None:
            raise ValueError(
                f"--wrench: {machine.name} has passive joints and carries no load on a free end: its end is held, "
                f"and the page has sliders of its displacement"
            )
        self.posed = closing is not None and freedom >= 3
        self.coordinates = (
            pose_sliders(machine, label, closing, freedom, self.files.document.content.get("workspace"))
            if closing is not None and self.posed
            else joint_sliders(machine, label)
        )
        self.start = Setting(tuple(each.value for each in self.coordinates))
        state = self._at_rest(self.start)
        if state.free:
            if not any(wrench or ()):
                raise ValueError(
                    f"{machine.name}: without load {state.free}: begin with a load that brings contact, --wrench"
                )
            state = state.in_contact
        self.extent = max(1.0, float(np.ptp(state.model.shape(state.kinematics), axis=0).max(initial=0.0)))
        self.load = (
            displacement_sliders(state.model.characteristic_length)
            if self.held
            else force_sliders(float(principal(compliance(state)[:3, :3])[0][0]), self.extent, wrench)
        )
        self.start = Setting(self.start.coordinates, tuple(each.value for each in self.load))
        self.sizes = [size_slider(key, self.files.number(key)) for key in self.files.keys()]  # noqa: SIM118
        self.answer(self.start)

    # --- answers ------------------------------------------------------------------------------------------

    def again(self) -> Explorer:
        """The same machine with the same sliders, which remembers answers of its own."""
        twin = copy.copy(self)
        twin._built, twin._stands, twin._one_at_a_time = None, None, threading.RLock()
        return twin

    @single_threaded
    def answer(self, setting: Setting, *, shares: bool = True) -> ExplorerAnswer:
        """What the machine does.

        Args:
            setting: what the sliders stand at.
            shares: whether the parts' shares are asked for.

        Raises:
            ValueError: out of reach, or the numbers make no machine.
            NoConvergenceError: there is no stable equilibrium.
        """
        with self._one_at_a_time:
            rest = self._at_rest(setting)
            asked = self._asked(setting)
        said: list[str] = []
        loaded = state_of(asked, rest)
        if loaded.free:
            raise NoConvergenceError(f"nothing determines where it stands: {loaded.free}")
        if not loaded.stable:
            raise NoConvergenceError("the equilibrium under these loads is unstable")
        if self.held:
            held_stiffness = stiffness(
                asked.machine, asked.posture, displacement=asked.displacement, engine=self.engine
            )
            K, wrench = held_stiffness.loaded, held_stiffness.wrench
            stiff, axes = _stiffest(K[:3, :3])
        else:
            C = compliance(loaded)
            stiff, axes = principal(C[:3, :3])
            K, wrench = _inverse(C), np.array(setting.load)
        parts = None
        try:
            parts = shares_of(rest, asked, loaded, both=False) if shares else None
        except ValueError as error:
            said.append(_no_shares(error, setting, held=self.held))
        modes = None
        try:
            modes = modes_of(loaded, 1)
        except ValueError as error:
            said.append(f"No frequency: {_sentence(error, loaded.model.name)}")
        mass = total_mass(rest.question)
        if setting.weighed and not mass:
            said.append("No part has a mass: the weight is nothing.")
        return ExplorerAnswer(
            asked.posture, loaded.moved, wrench, K, stiff, axes, parts, modes, mass, rest, loaded, tuple(said)
        )

    def critical(self, setting: Setting) -> Weakest:
        """The smallest force on the free end at which the machine loses its stability, over all directions.

        Its beams have as many springs as the file asks for: with few of them links buckle late.

        Raises:
            ValueError: the end is held, or out of reach.
        """
        if self.held:
            raise ValueError("the end is held: follow a path with `validate buckling`")
        with self._one_at_a_time:
            asked = self._asked(setting)
        model = VjmEngine(*asked.machine.usual_segments).model(asked.machine)
        end = model.ends.index(asked.end) if asked.end else 0
        search = CriticalForce(model, end, MOST, gravity=asked.gravity)
        return search.weakest(model.posture(asked.posture))

    def _asked(self, setting: Setting) -> Question:
        machine, label = self._standing(setting)
        weight = self.gravity if setting.weighed and not self.held else None
        if self.held:
            return loaded_posture(machine, label, displacement=setting.load, engine=self.engine)
        return loaded_posture(machine, label, wrench=setting.load, gravity=weight, end=self.end, engine=self.engine)

    def _at_rest(self, setting: Setting) -> LinearState:
        """Without loads; the last one is kept, so that a load alone is answered faster."""
        key = (setting.coordinates, tuple(sorted(setting.sizes.items())))
        if self._built is None or self._built[0] != key:
            machine, label = self._standing(setting)
            held = (0.0,) * 6 if self.held else None
            state = state_of(loaded_posture(machine, label, displacement=held, end=self.end, engine=self.engine))
            self._built = (key, state)
        return self._built[1]

    def _standing(self, setting: Setting) -> tuple[Machine, str]:
        """The machine with its sizes, in its posture."""
        sizes = dict(setting.sizes)
        if sizes != self._sizes:
            # what is refused leaves the last machine as it is
            self._machine, self._sizes = self.files.with_numbers(sizes).machine(), sizes
        key = (self.posture(setting), tuple(sorted(sizes.items())))
        if self._stands is None or self._stands[0] != key:
            self._stands = (key, in_posture(self._machine, key[0]))
        return self._stands[1]

    def posture(self, setting: Setting) -> str:
        """As ``--posture`` takes it: the label where the machine stands in that posture."""
        if setting.coordinates == tuple(each.value for each in self.coordinates):
            return self._label
        values = [f"{value:.12g}" for value in setting.coordinates]
        if self._labelled.closes and not self.posed:
            return ",".join(f"{each.name}={value}" for each, value in zip(self.coordinates, values, strict=True))
        return ",".join(values)

    # --- what is taken away -------------------------------------------------------------------------------

    def command(self, setting: Setting, model: str = "") -> str:
        """The command that says the same numbers.

        Args:
            setting: what the sliders stand at.
            model: file in which changed sizes are saved; the model itself if left out.
        """
        words = ["validate stiffness", shlex.quote(model or self.model)]
        words.append(shlex.quote(f"--posture={self.posture(setting)}"))
        load = ",".join(f"{value:.12g}" for value in setting.load)
        words.append(f"--displacement={load}" if self.held else f"--wrench={load}")
        if setting.weighed and not self.held:
            words.append("--gravity=" + ",".join(f"{value:.12g}" for value in self.gravity))
        if self.end:
            words.append(f"--end {shlex.quote(self.end)}")
        words.append(f"--segments {self.segments}")
        if any(setting.load) or setting.weighed:
            words.append("--shares")
        return " ".join(words)

    def outdated(self) -> bool:
        """Whether the model's files are no longer what they were when they were read."""
        try:
            return MachineFiles.read(self.model) != self.files
        except ValueError:
            return True

    def coordinates_of(self, setting: Setting) -> dict[str, float] | list[float]:
        """A posture as files have it: all joints' coordinates; of legs on bodies the displacement from home.

        A file of bodies and joints has those of the held joints, which its loops follow.

        Raises:
            ValueError: it is out of reach.
        """
        machine, label = self._standing(setting)
        values = {name: float(value) for name, value in machine.held.get(label, {}).items()}
        if self.files.of_bodies and machine.closes:
            return values
        passive = [joint.name for joint in machine.joints]
        values |= dict(zip(passive, machine.posture(label).tolist(), strict=True))
        if not self.files.legs:
            return values
        tree = RigidMechanism(machine)
        home, frame = (tree.end_frames(tree.posture(each)[None])[0] for each in (home_label(machine), label))
        moved: list[float] = displacement_between(home, frame).tolist()
        return moved

    def save(self, setting: Setting, file: Path, posture: str | None = None) -> list[Path]:
        """Write the machine with its present sizes, over no file and no posture that was there before.

        Args:
            setting: what the sliders stand at.
            file: ``.toml``.
            posture: label under which the present posture is kept in the file, too; none if left out.

        Returns:
            The files that were written, the machine's last.

        Raises:
            ValueError: the sizes make no machine, or see `vjm_validation.explore.state.keep`.
            OSError: it cannot be written.
        """
        files = self.files.with_numbers(setting.sizes)
        files.machine()
        return keep(files, file, None if posture is None else (posture, self.coordinates_of(setting)))


def principal(C: Array) -> tuple[Array, Array]:
    """Stiffnesses ``(3,)`` against a force, the smallest first, and directions ``(3, 3)``, by a compliance."""
    values, vectors = np.linalg.eigh(0.5 * (C + C.T))
    values, vectors = values[::-1], vectors[:, ::-1]
    with np.errstate(divide="ignore"):
        stiff = np.where(values > 1e-12 * values[0], 1.0 / np.maximum(values, 1e-300), np.inf)
    return stiff, vectors


def _stiffest(K: Array) -> tuple[Array, Array]:
    """The same of an end that is held, by its stiffness."""
    decomposition = np.linalg.eigh(0.5 * (K + K.T))
    return decomposition.eigenvalues, decomposition.eigenvectors


def _inverse(C: Array) -> Array:
    """K^F ``(6, 6)``; nan where the end is rigid against a wrench."""
    try:
        return np.array(np.linalg.inv(C), dtype=float)
    except np.linalg.LinAlgError:
        return np.full((6, 6), np.nan)


def _sentence(error: Exception, name: str) -> str:
    text = " ".join(str(error).split())
    return text.removeprefix(f"{name}: ") + "."


def _no_shares(error: ValueError, setting: Setting, *, held: bool) -> str:
    if not any(setting.load) and not setting.weighed:
        return "No shares: set a displacement." if held else "No shares: set a load."
    return "No shares: " + " ".join(str(error).split()) + "."


MINIMISE = "minimise"
EVERY = 0.25
"""s between two lines on how far an optimisation is."""


@dataclass(frozen=True)
class ComparedMachine:
    """The second machine.

    Attributes:
        explorer: of the machine.
        name: for people.
        sizes: numbers of its file that are changed, by key.
    """

    explorer: Explorer
    name: str
    sizes: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def shapes(self) -> dict[str, Shape]:
        """Of its beams, by name."""
        return self.explorer.files.with_numbers(self.sizes).sections()

    def answer(self, first: Explorer, setting: Setting) -> ExplorerAnswer:
        """What it does under the load of the first machine's setting, its coordinates of like names being alike.

        Raises:
            ValueError: out of reach.
            NoConvergenceError: there is no stable equilibrium.
        """
        given = {each.name: value for each, value in zip(first.coordinates, setting.coordinates, strict=True)}
        coordinates = tuple(given.get(each.name, each.value) for each in self.explorer.coordinates)
        own_setting = Setting(coordinates, setting.load, setting.weighed, self.sizes)
        return self.explorer.answer(own_setting, shares=False)


def beside_file(first: Explorer, model: str, second: Explorer) -> ComparedMachine:
    """Another file beside the first one.

    Raises:
        ValueError: the end of one of them is held, and that of the other bears a load.
    """
    if first.held is not second.held:
        held, free = (first.model, model) if first.held else (model, first.model)
        raise ValueError(
            f"{held} has passive joints and its end is held; {free} bears a load: compare like machines"
        )
    return ComparedMachine(second, second.files.document.content["name"])


def compared(names: tuple[str, str], first: ExplorerAnswer, second: ExplorerAnswer) -> str:
    """Both answers and their difference as an HTML table; every number has an id of its own."""
    rows = []
    for name, unit, id_, of in (
        ("shift of the end", "mm", "shift", lambda a: float(np.linalg.norm(a.deflection[:3]))),
        ("least stiffness", "N/mm", "stiffness", lambda a: float(a.principal[0])),
        ("first frequency", "Hz", "frequency", lambda a: a.frequency),
        ("mass", "kg", "mass", lambda a: a.mass),
    ):
        values = [of(answer) for answer in (first, second)]
        shown = ["–" if v is None else "rigid" if not np.isfinite(v) else f"{v:.5g}" for v in values]
        a, b = values
        change = "–"
        if a is not None and b is not None and np.isfinite([a, b]).all() and a != 0.0:
            change = f"{b / a - 1.0:+.1%}"
        cells = f"<td>{shown[0]}</td><td id='beside-{id_}'>{shown[1]}</td><td>{change}</td>"
        rows.append(f"<tr><td>{name}, {unit}</td>{cells}</tr>")
    head = f"<tr><td></td><td><b>{escape(names[0])}</b></td><td><b>{escape(names[1])}</b></td><td></td></tr>"
    style = "width:100%;font-size:0.85em;padding:0 0.8em"
    return f"<table id='compared' style='{style}'>{head}{''.join(rows)}</table>"


@dataclass(frozen=True)
class Wish:
    """What an optimisation is asked for.

    Attributes:
        numbers: keys of the file, separated by commas; each goes from end to end of its slider.
        best: quantity that is made best.
        limits: on other quantities.
    """

    numbers: str
    best: str
    limits: str

    def bounds(self, explorer: Explorer) -> dict[str, tuple[float, float]]:
        """Of the numbers.

        Raises:
            ValueError: one is none of the page's.
        """
        ends = {each.name: (each.low, each.high) for each in explorer.sizes}
        keys = [word.strip() for word in self.numbers.split(",") if word.strip()]
        for key in keys:
            if key not in ends:
                raise ValueError(f"'{key}' is no number of the tab Sizes: write keys such as {next(iter(ends))}")
        if not keys:
            raise ValueError("write which numbers vary: keys of the tab Sizes, separated by commas")
        return {key: ends[key] for key in keys}

    def _direction(self) -> str:
        return MINIMISE if signs([asked(self.best)])[0] > 0.0 else "maximise"

    def command(self, explorer: Explorer, setting: Setting) -> str:
        """The command that finds the same."""
        words = [
            "validate optimise",
            shlex.quote(explorer.model),
            f"--{self._direction()} {shlex.quote(self.best)}",
        ]
        if self.limits:
            words.append(f"--such-that {shlex.quote(self.limits)}")
        words.append("--vary " + " ".join(f"{k}={a:.12g}:{b:.12g}" for k, (a, b) in self.bounds(explorer).items()))
        words.append(shlex.quote(f"--posture={explorer.posture(setting)}"))
        if any(setting.load):
            words.append("--wrench=" + ",".join(f"{value:.12g}" for value in setting.load))
        if setting.weighed:
            words.append("--gravity=" + ",".join(f"{value:.12g}" for value in explorer.gravity))
        if explorer.end:
            words.append(f"--end {shlex.quote(explorer.end)}")
        return " ".join([*words, f"--segments {explorer.segments} --starts 1"])

    def optimum(
        self, explorer: Explorer, setting: Setting, said: Callable[[str], None], stopped: Callable[[], bool]
    ) -> Optimum:
        """The best machine in a setting, from the numbers that the sliders stand at.

        Args:
            explorer: of the machine.
            setting: its posture, load and sizes.
            said: takes a line on how far it is.
            stopped: whether to end with the best so far.

        Raises:
            ValueError: no such number or quantity.
            NoConvergenceError: no machine has the quantities.
        """
        due = 0.0

        def progress(machines: int, best: float | None) -> None:
            nonlocal due
            if stopped():
                raise KeyboardInterrupt
            if time.monotonic() > due:
                due = time.monotonic() + EVERY
                value = "none keeps the limits so far" if best is None else f"best {self.best} {best:.5g}"
                said(f"{machines} machines, {value}")

        least = self._direction() == MINIMISE
        cases = LoadCases(
            [explorer.posture(setting)], [setting.load] if any(setting.load) else [],
            explorer.gravity if setting.weighed else None, end=explorer.end, engine=explorer.engine,
        )  # fmt: skip
        return optimise(
            explorer.files.with_numbers(setting.sizes), self.bounds(explorer), minimise=self.best if least else "",
            maximise="" if least else self.best, such_that=self.limits, starts=1, cases=cases, progress=progress,
        )  # fmt: skip
