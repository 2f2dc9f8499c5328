"""What a map asks at each pose, and its answer."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, lru_cache
from typing import NamedTuple, assert_never

import numpy as np

from vjm.analysis import LoadedStiffness, of_free_end, stiffness
from vjm.design.linear_state import LinearState, Question, loaded_posture, state_in, state_of, with_doubts
from vjm.design.modes import ModesVerdict, modes_of
from vjm.design.shares import shares_of
from vjm.engines import Engine, VjmEngine
from vjm.errors import NoConvergenceError
from vjm.limits import LIMITS
from vjm.machine.critical_force import CriticalForce
from vjm.machine.inverse_kinematics import end_index
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm_updating.constants import numerical, shown

# --- What a map asks, and the names and titles of its columns -----------------------------------------------------

NO_COMPLIANCE = numerical(1e-12)
"""Over the largest of a block: compliance that is none. Between that of a soft drive and of a stiff bearing lie
seven decades, and rounding is four below these."""
OK, LOST, UNSTABLE = "ok", "no equilibrium", "the equilibrium is unstable"


class MapQuantity(StrEnum):
    """What is mapped."""

    STIFFNESS = "stiffness"
    """Smallest and largest stiffness against a force, the platform free to turn, and against a moment, free to
    shift: over the eigenvalues of the two blocks of K⁻¹. Under the wrench, if one is given."""
    CRITICAL = "critical"
    """The smallest force, over all directions, at which the free platform loses its stability."""
    DEFLECTION = "deflection"
    """The platform's displacement under the wrench."""
    FREQUENCY = "frequency"
    """The lowest natural frequency about the loaded equilibrium."""
    SHARES = "shares"
    """The largest share of a part in the linear strain energy under the loads, and which part that is."""


COLUMNS: dict[MapQuantity, tuple[str, ...]] = {
    MapQuantity.STIFFNESS: ("kt_min_N_per_mm", "kt_max_N_per_mm", "kr_min_Nmm_per_rad", "kr_max_Nmm_per_rad"),
    MapQuantity.CRITICAL: ("F_cr_N", "direction_x", "direction_y", "direction_z"),
    MapQuantity.DEFLECTION: ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad", "u_mm"),
    MapQuantity.FREQUENCY: ("f1_Hz",),
    MapQuantity.SHARES: ("largest_share",),
}
NAMES = ("part", "kind")
"""Columns of text behind those of `MapQuantity.SHARES`."""
SHOWN = shown({
    MapQuantity.STIFFNESS: 0, MapQuantity.CRITICAL: 0, MapQuantity.DEFLECTION: 6, MapQuantity.FREQUENCY: 0,
    MapQuantity.SHARES: 0,
})  # fmt: skip
"""The column that the pictures show."""
TITLES = {
    MapQuantity.STIFFNESS: "smallest stiffness against a force, N/mm",
    MapQuantity.CRITICAL: "smallest critical force, N",
    MapQuantity.DEFLECTION: "deflection, mm",
    MapQuantity.FREQUENCY: "lowest natural frequency, Hz",
    MapQuantity.SHARES: "largest share in the strain energy",
}


def lost_by(error: NoConvergenceError) -> str:
    """Why there is no answer at a point whose path from no load did not lead to a stable equilibrium."""
    return UNSTABLE if "unstable" in str(error) else LOST


def principal(C: Array) -> Array:
    """Smallest and largest stiffness against forces (N/mm) and moments (N mm/rad) ``(g, 4)``.

    Infinite in a direction in which nothing moves. ``C`` (g, 6, 6) are compliances.
    """
    rows = []
    for part in (slice(0, 3), slice(3, 6)):
        block = C[:, part, part]
        values = np.linalg.eigvalsh(0.5 * (block + np.swapaxes(block, 1, 2)))
        with np.errstate(divide="ignore"):
            least = np.where(values[:, 0] > NO_COMPLIANCE * values[:, 2], values[:, 0], 0.0)
            rows += [1.0 / values[:, 2], 1.0 / least]
    return np.stack(rows, axis=1)


def moved(displacements: Array) -> Array:
    """Displacements ``(g, 6)`` and the sizes of their shifts ``(g, 7)``."""
    return np.column_stack([displacements, np.linalg.norm(displacements[:, :3], axis=1)])


# --- What a map asks, by any engine, posture by posture -----------------------------------------------------------


def refuse(engine: Engine, quantity: MapQuantity) -> None:
    """Refuse a map of what only the engine ``vjm`` has: others count no negative eigenvalues and know no parts.

    Raises:
        ValueError: it is asked for.
    """
    if quantity in (MapQuantity.FREQUENCY, MapQuantity.SHARES):
        what = "natural frequencies" if quantity is MapQuantity.FREQUENCY else "shares of parts"
        raise ValueError(f"--quantity {quantity}: {engine.label} has no {what}: take vjm-<n>")
    if quantity is MapQuantity.CRITICAL:
        why = (
            "is linear and knows no loss of stability" if engine.label in LINEAR else "follows one force at a time"
        )
        raise ValueError(
            f"--quantity critical: {engine.label} {why}: take vjm-<n> here, or `validate buckling --force` along "
            "one direction"
        )


LINEAR = tuple(name for name, limits in LIMITS.items() if any("linear" in limit.why for limit in limits))
"""Engines that are linear about the unloaded machine."""


@dataclass(frozen=True)
class MapSetting:
    """What is asked of a machine at each point.

    Attributes:
        engine: ``vjm`` solves for all points in one batch; another engine goes from point to point.
        wrench: ``(6,)`` on the end, N, N mm.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.
        most: largest force tried for a critical one, N.
    """

    machine: Machine
    engine: Engine
    quantity: MapQuantity
    wrench: tuple[float, ...] = (0.0,) * 6
    gravity: Gravity | None = None
    loads: tuple[Load, ...] = ()
    end: str = ""
    most: float = 20_000.0

    @cached_property
    def model(self) -> Mechanism:
        """The machine by the engine's springs; of another engine than ``vjm``, whose coordinates are the same."""
        springs = self.engine if isinstance(self.engine, VjmEngine) else VjmEngine()
        return springs.model(self.machine)

    def __getstate__(self) -> dict[str, object]:
        """What a task takes along: without the model, which each process makes once."""
        return {name: value for name, value in self.__dict__.items() if name != "model"}

    @property
    def index(self) -> int:
        """Number of the end frame."""
        return end_index(self.model, self.end)

    @property
    def on_ends(self) -> Array:
        """The wrench on its end among those ``(e, 6)`` on all."""
        result = np.zeros((len(self.model.ends), 6))
        result[self.index] = self.wrench
        return result

    def standing(self, q: Array) -> tuple[Machine, str]:
        """The machine with one posture, of coordinates ``(n_joints,)``, and its label."""
        values = dict(zip(self.model.joints, q.tolist(), strict=True))
        passive = np.array([values.pop(joint.name) for joint in self.machine.joints])
        return replace(self.machine, postures={"point": passive}, held={"point": values}, poses={}), "point"

    def check(self) -> None:
        """Refuse what cannot be asked.

        Raises:
            ValueError: the machine has no such end frame, or the engine not the quantity or the loads.
        """
        if self.end and self.end not in self.model.ends:
            raise ValueError(
                f"--end: {self.machine.name} has no end frame '{self.end}' (it has {', '.join(self.model.ends)})"
            )
        if isinstance(self.engine, VjmEngine):
            return
        refuse(self.engine, self.quantity)
        if self.gravity is not None or self.loads or self.end:
            raise ValueError(
                f"--engine {self.engine.label}: maps by it have a wrench on the end alone: leave --gravity, --load "
                "and --end out"
            )


class MapTask(NamedTuple):
    """Some points of a map, neighbours next to one another; ``q`` (n, n_joints) are their coordinates."""

    number: int
    setting: MapSetting
    q: Array


class MapRows(NamedTuple):
    """Answers at some points.

    Attributes:
        values: ``(n, c)`` in the order of `COLUMNS`, nan where there is no answer.
        why: ``(n,)`` `OK`, or why there is none.
        names: of the shares, ``(n,)`` part and kind, empty where there is no answer; else none at all.
    """

    task: int
    values: Array
    why: list[str]
    names: list[tuple[str, str]]


def evaluate(task: MapTask) -> MapRows:
    """The rows of a task; a point without an answer says why and stops no other."""
    setting, names = _kept(pickle.dumps(task.setting)), list[tuple[str, str]]()
    if not isinstance(setting.engine, VjmEngine):
        return MapRows(task.number, *_by_engine(setting, task.q), names)
    match setting.quantity:
        case MapQuantity.STIFFNESS | MapQuantity.DEFLECTION:
            values, why = _equilibria(setting, task.q)
        case MapQuantity.CRITICAL:
            search = CriticalForce(
                setting.model, setting.index, setting.most, gravity=setting.gravity, loads=setting.loads
            )
            weak = search.each(task.q)
            values, why = np.array([[one.force, *one.direction] for one in weak]), [one.why or OK for one in weak]
        case MapQuantity.FREQUENCY | MapQuantity.SHARES:
            values, why, names = _of_design(setting, task.q)
        case _:
            assert_never(setting.quantity)
    return MapRows(task.number, values, why, names)


@lru_cache(maxsize=4)
def _kept(pickled: bytes) -> MapSetting:
    """A setting with its model, which tasks bring along one after another."""
    return pickle.loads(pickled)


def _by_engine(setting: MapSetting, q: Array) -> tuple[Array, list[str]]:
    """Stiffness or deflection by an engine that goes from point to point.

    Raises:
        ValueError: another quantity is asked for.
    """
    refuse(setting.engine, setting.quantity)
    values, why = np.full((len(q), len(COLUMNS[setting.quantity])), np.nan), []
    for k, row in enumerate(q):
        machine, label = setting.standing(row)
        try:
            values[k] = _row(setting, stiffness(machine, label, wrench=setting.wrench, engine=setting.engine))
            why.append(OK)
        except (ValueError, NoConvergenceError, np.linalg.LinAlgError) as error:
            why.append(" ".join(str(error).split()))
    return values, why


def _row(setting: MapSetting, result: LoadedStiffness) -> Array:
    """Stiffness or deflection at one point."""
    if setting.quantity is MapQuantity.DEFLECTION:
        return moved(result.displacement[None])[0]
    C = result.loaded_compliance
    return principal((np.asarray(np.linalg.inv(result.loaded), dtype=float) if C is None else C)[None])[0]


@single_threaded
def _of_design(setting: MapSetting, q: Array) -> tuple[Array, list[str], list[tuple[str, str]]]:
    """Lowest natural frequencies, or largest shares in the strain energy with the part and the kind that has each.

    All loaded equilibria are found in one batch.
    """
    assert isinstance(setting.engine, VjmEngine)
    equilibria, doubtful = with_doubts(
        setting.model, q, gravity=setting.gravity, wrench=setting.on_ends, loads=setting.loads, compliance=False
    )
    values, why, names = np.full((len(q), 1), np.nan), [OK] * len(q), [("", "")] * len(q)
    for row in range(len(q)):
        machine, label = setting.standing(q[row])
        asked = loaded_posture(
            machine, label, wrench=setting.wrench, gravity=setting.gravity, loads=setting.loads, end=setting.end,
            engine=setting.engine,
        )  # fmt: skip
        try:
            state = state_of(asked) if doubtful[row] else state_in(asked, equilibria, row)
            if setting.quantity is MapQuantity.FREQUENCY:
                values[row] = _lowest(state)
            else:
                values[row], part, kind = _largest(asked, state)
                names[row] = part, kind
        except NoConvergenceError as error:
            why[row] = lost_by(error)
        except ValueError as error:
            why[row] = str(error).removeprefix(machine.name).removeprefix(f", posture {label}").removeprefix(": ")
    return values, why, names if setting.quantity is MapQuantity.SHARES else []


def _lowest(state: LinearState) -> float:
    """Lowest natural frequency, Hz.

    Raises:
        ValueError: as `modes_of`, or the equilibrium is unstable.
    """
    # loads without a potential: any motion may be the one that grows
    modes = modes_of(state, 1 if state.conservative else state.n)
    if modes.verdict in (ModesVerdict.DIVERGENCE, ModesVerdict.FLUTTER):
        raise ValueError(UNSTABLE if state.conservative else f"{UNSTABLE}: {modes.verdict}")
    return float(modes.frequencies.min())


def _largest(asked: Question, state: LinearState) -> tuple[float, str, str]:
    """Largest share in the linear strain energy, and the part and the kind that has it.

    Raises:
        ValueError: as `shares_of`, or the equilibrium is unstable, or nothing deflects.
        NoConvergenceError: there is no equilibrium without loads.
    """
    if not state.stable:
        raise ValueError(UNSTABLE)
    shares = shares_of(state_of(asked.unloaded, state), asked, state, both=False)
    energies = shares.energies
    if np.isnan(energies).all():
        raise ValueError("nothing deflects under these loads")
    worst = int(np.argmax(energies))
    return float(energies[worst]), shares.rows[worst].part, shares.rows[worst].kind


def _equilibria(setting: MapSetting, q: Array) -> tuple[Array, list[str]]:
    """Stiffness or deflection of all points in one batch."""
    stiff = setting.quantity is MapQuantity.STIFFNESS
    equilibria, doubtful = with_doubts(
        setting.model, q, gravity=setting.gravity, wrench=setting.on_ends, loads=setting.loads, compliance=stiff
    )
    good = np.asarray(equilibria.converged & equilibria.stable)
    values = np.full((len(q), len(COLUMNS[setting.quantity])), np.nan)
    if stiff:
        assert equilibria.compliance is not None
        values[good] = principal(equilibria.compliance[good, setting.index])
    else:
        values[good] = moved(equilibria.deflection[good, setting.index])
    why = [
        OK if stable else UNSTABLE if converged else LOST
        for stable, converged in zip(good, equilibria.converged, strict=True)
    ]
    for row in np.flatnonzero(doubtful):
        values[row], why[row] = _by_path(setting, q[row])
    return values, why


def _by_path(setting: MapSetting, q: Array) -> tuple[Array, str]:
    """Stiffness or deflection at one point, on the path from no load; nan where that does not lead so far."""
    assert isinstance(setting.engine, VjmEngine)
    machine, label = setting.standing(q)
    try:
        result = of_free_end(
            machine, setting.engine, label, setting.wrench, gravity=setting.gravity, loads=setting.loads,
            end=setting.end,
        )  # fmt: skip
    except NoConvergenceError as error:
        return np.full(len(COLUMNS[setting.quantity]), np.nan), lost_by(error)
    return _row(setting, result), OK
