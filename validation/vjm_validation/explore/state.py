"""What the sliders of a machine set, and what the machine answers; no page knows of it.

Every number is computed by what the commands compute it by, with the same springs: `validate stiffness` and
`validate modes` say the same of the same posture and load.
"""

from __future__ import annotations

import copy
import re
import shlex
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vjm.analysis import stiffness
from vjm.design.linear_state import LinearState, Question, question, state_of
from vjm.design.masses import total_mass
from vjm.design.modes import Modes, modes_of
from vjm.design.sensitivity import compliance
from vjm.design.shares import Shares, shares_of
from vjm.engines import EngineOptions, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.io.file_parameters import MachineFiles
from vjm.io.files import check_writable, write_together
from vjm.loaded_stiffness import held_by_itself
from vjm.machine.closing import Closing, home_label
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.postures import in_posture
from vjm.rotations import Array, displacement_between
from vjm.threads import single_threaded
from vjm.tree.critical_force import CriticalForce, Weakest
from vjm.vjm_engine import VjmEngine
from vjm_validation.explore.sliders import (
    displacement_sliders,
    force_sliders,
    joint_sliders,
    pose_sliders,
    size_slider,
)

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
        closing = Closing(machine, home_label(machine)) if machine.closes else None
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
            found = stiffness(asked.machine, asked.posture, displacement=asked.displacement, engine=self.engine)
            K, wrench = found.loaded, found.wrench
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
            return question(machine, label, displacement=setting.load, engine=self.engine)
        return question(machine, label, wrench=setting.load, gravity=weight, end=self.end, engine=self.engine)

    def _at_rest(self, setting: Setting) -> LinearState:
        """Without loads; the last one is kept, so that a load alone is answered faster."""
        key = (setting.coordinates, tuple(sorted(setting.sizes.items())))
        if self._built is None or self._built[0] != key:
            machine, label = self._standing(setting)
            held = (0.0,) * 6 if self.held else None
            state = state_of(question(machine, label, displacement=held, end=self.end, engine=self.engine))
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
        home, there = (tree.end_frames(tree.posture(each)[None])[0] for each in (home_label(machine), label))
        moved: list[float] = displacement_between(home, there).tolist()
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
    found = np.linalg.eigh(0.5 * (K + K.T))
    return found.eigenvalues, found.eigenvectors


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
