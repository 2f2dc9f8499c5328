"""What a map asks at each pose, and its answer."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple, assert_never

import numpy as np

from vjm.design.linear_state import with_doubts
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.loaded_stiffness import of_free_end
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.rotations import Array
from vjm.tree.critical_force import CriticalForce
from vjm.tree.inverse_kinematics import end_index
from vjm.vjm_engine import VjmEngine
from vjm_updating.maps.by_engine import refuse, rows_by
from vjm_updating.maps.design_rows import design_rows
from vjm_updating.maps.quantity import COLUMNS, LOST, OK, UNSTABLE, MapQuantity, lost_by, moved, principal


@dataclass(frozen=True)
class MapSetting:
    """What is asked of a machine at each point.

    Attributes:
        machine: of any kind.
        engine: ``vjm`` solves for all points in one batch; another engine goes from point to point.
        quantity: what is mapped.
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
    """Some points of a map.

    Attributes:
        number: of the task.
        setting: what is asked.
        q: coordinates ``(n, n_joints)``, neighbours next to one another.
    """

    number: int
    setting: MapSetting
    q: Array


class MapRows(NamedTuple):
    """Answers at some points.

    Attributes:
        task: its number.
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
    setting = _kept(pickle.dumps(task.setting))
    engine, names = setting.engine, list[tuple[str, str]]()
    if not isinstance(engine, VjmEngine):
        machines = [setting.standing(row) for row in task.q]
        values, why = rows_by(engine, machines, setting.quantity, setting.wrench)
        return MapRows(task.number, values, why, names)
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
            rows = design_rows(
                engine, setting.model, task.q, [setting.standing(row) for row in task.q], setting.quantity,
                wrench=setting.wrench, gravity=setting.gravity, loads=setting.loads, end=setting.end,
            )  # fmt: skip
            values, why = np.array([[row.value] for row in rows]), [row.why for row in rows]
            if setting.quantity is MapQuantity.SHARES:
                names = [(row.part, row.kind) for row in rows]
        case _:
            assert_never(setting.quantity)
    return MapRows(task.number, values, why, names)


@lru_cache(maxsize=4)
def _kept(pickled: bytes) -> MapSetting:
    """A setting with its model, which tasks bring along one after another."""
    setting: MapSetting = pickle.loads(pickled)
    return setting


def _equilibria(setting: MapSetting, q: Array) -> tuple[Array, list[str]]:
    """Stiffness or deflection of all points in one batch."""
    on_ends = np.zeros((len(setting.model.ends), 6))
    on_ends[setting.index] = setting.wrench
    stiff = setting.quantity is MapQuantity.STIFFNESS
    found, doubtful = with_doubts(
        setting.model, q, gravity=setting.gravity, wrench=on_ends, loads=setting.loads, compliance=stiff
    )
    good = np.asarray(found.found & found.stable)
    values = np.full((len(q), len(COLUMNS[setting.quantity])), np.nan)
    if stiff:
        assert found.compliance is not None
        values[good] = principal(found.compliance[good, setting.index])
    else:
        values[good] = moved(found.deflection[good, setting.index])
    why = [OK if stable else UNSTABLE if there else LOST for stable, there in zip(good, found.found, strict=True)]
    for row in np.flatnonzero(doubtful):
        values[row], why[row] = _by_path(setting, q[row])
    return values, why


def _by_path(setting: MapSetting, q: Array) -> tuple[Array, str]:
    """Stiffness or deflection at one point, on the path from no load; nan where that does not lead so far."""
    assert isinstance(setting.engine, VjmEngine)
    machine, label = setting.standing(q)
    try:
        found = of_free_end(
            machine, setting.engine, label, setting.wrench, gravity=setting.gravity, loads=setting.loads,
            end=setting.end,
        )  # fmt: skip
    except NoConvergenceError as error:
        return np.full(len(COLUMNS[setting.quantity]), np.nan), lost_by(error)
    if setting.quantity is MapQuantity.DEFLECTION:
        return moved(found.displacement[None])[0], OK
    assert found.loaded_compliance is not None
    return principal(found.loaded_compliance[None])[0], OK
