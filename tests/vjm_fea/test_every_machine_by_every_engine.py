"""Five kinds of machines by every engine: what each says is the independent solver's, or a limit with its reason.

The independent solver is virtual work with tangents by complex steps, see `helpers.virtual_work`. Engines of
springs are held to it with the same springs, linear ones at a small load, finite elements with many springs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.closed_machines import MACHINES as SMALL
from helpers.closed_machines import apart
from helpers.virtual_work import Solution, Statics, posture_values

import vjm
from vjm.engines import EngineOptions, VjmEngine, engine_by_name
from vjm.limits import LIMITS
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, rotation_from_vector, translation

ENGINES = ("vjm", "vjm-paper", "vjm-linear", "msa", "exudyn", "opensees")
LINEAR = ("vjm-linear", "msa")
SPRINGS = 4
"""In every beam of engine ``vjm`` here; its truth has the same."""
FINE = 16
"""In every beam of the truth of finite elements: errors of the second order, 1/16² of a share of the answer."""
ELEMENTS = 8
SMALL_LOAD = 1e-4
"""Of the load: at which what is not linear is that share of the answer."""
PUSH = np.array([1.0, -2.0, 1.5, 0.0, 0.0, 0.0])
"""N, before it is scaled to what moves the end by a thousandth of the machine's length."""
PULL = np.array([0.3, -0.2, 0.25, 0.0, 0.0, 0.0])
"""mm: the imposed pose of a chain that is a mechanism."""

SPRINGS_AGREE, ELEMENTS_AGREE, LINEAR_AGREE = 1e-6, 2e-3, 1e-3
"""Relative. Residuals of 1e-11 times a condition of 1e5; 16 springs a beam; ten times the small load's share."""


def strip() -> Machine:
    """An arm of three flat bars that twist and bend, on two gears."""
    bar = Section(EA=2e7, GJ=4e8, EIy=3e8, EIz=2e9)
    turns = ((0.2, -0.4, 0.1), (0.0, 0.9, 0.3), (-0.5, 0.2, -0.7))
    beams = [
        Beam(f"bar-{k}", 200.0, own_frame=rotation_from_vector(turn), section=bar) for k, turn in enumerate(turns)
    ]
    joints = [Joint("j0", AXES["z"], compliance=2e-8), Joint("j1", AXES["y"], compliance=5e-8)]
    parts = (joints[0], beams[0], joints[1], *beams[1:])
    return Machine("strip", parts, postures={"p": np.zeros(0)}, held={"p": {"j0": 0.3, "j1": -0.5}})


def fork() -> Machine:
    """A stem that carries two arms, the second with a weight."""
    bar = Section(EA=2e7, GJ=4e8, EIy=3e8, EIz=2e9, mass=1e-3)
    parts = (
        Beam("stem", 250.0, own_frame=rotation_from_vector((0.0, -1.1, 0.0)), section=bar),
        Joint("right", AXES["x"], compliance=3e-8),
        RigidOffset("counter", translation([0.0, 150.0, 60.0]), 2.0),
        Joint("left", AXES["y"], compliance=4e-8),
        Beam("hand", 220.0, own_frame=rotation_from_vector((0.1, 0.5, 0.4)), section=bar),
    )
    return Machine(
        "fork", parts, postures={"p": np.zeros(0)}, held={"p": {"right": 0.3, "left": 0.2}}, after={"left": "stem"}
    )


def of_library(name: str) -> Callable[[], Machine]:
    return lambda: vjm.load(name)


def strut() -> Machine:
    return vjm.load(Path(vjm.__file__).parent / "models" / "manipulators" / "chains" / "puu-strut.toml")


MACHINES: dict[str, dict[str, Callable[[], Machine]]] = {
    "chain": {
        "orthoglide-chain": of_library("orthoglide-chain"),
        "pinned-column": of_library("pinned-column"),
        "puu-strut": strut,
    },
    "arm": {"planar-2r": of_library("planar-2r"), "ur10": of_library("ur10"), "strip": strip},
    "tree": {"y-tree": SMALL["y_tree"], "bridged-tree": SMALL["bridged_tree"], "fork": fork},
    "platform": {name: of_library(name) for name in ("orthoglide", "3-puu", "isoglide")},
    "loops": {
        "four-bar": SMALL["four_bar"],
        "two-legs": SMALL["two_legs"],
        "coupled": SMALL["coupled"],
        "palletiser": of_library("palletiser"),
        "hexapod": of_library("hexapod"),
    },
}
"""By kind and name."""
CELLS = [(kind, name, engine) for kind, machines in MACHINES.items() for name in machines for engine in ENGINES]


@dataclass(frozen=True)
class Question:
    """A machine in its last posture and what is done to it.

    Attributes:
        machine: rigid in shear, as the elements of OpenSees are.
        chain: the same as parts and closures.
        label: posture.
        mechanism: whether it is a mechanism with its end free, so that a pose is imposed.
        wrench: ``(6,)`` N on the end-effector.
    """

    machine: Machine
    chain: Machine
    label: str
    mechanism: bool
    wrench: np.ndarray

    def load_case(self, share: float) -> LoadCase:
        """What is done, or a share of it."""
        if self.mechanism:
            size = float(np.linalg.norm(PULL))
            return LoadCase(self.label, share * size, tuple(PULL / size), steps=2)
        load = Load(tuple(self.wrench))
        return LoadCase(self.label, share, "load", loads=(load,), free=COMPONENTS, steps=2)

    def truth(self, springs: VjmEngine | None, share: float) -> Solution:
        """By the independent solver; None: every beam is one spring at its tip."""
        chain = self.chain if springs is None else springs.split(self.chain)
        own = {"imposed": share * PULL} if self.mechanism else {"wrenches": {"": share * self.wrench}}
        return Statics(chain, posture_values(self.chain, self.label), **own).solve()

    def answer(self, found: Solution) -> np.ndarray:
        """What is compared: the deflection of a free end, else the wrench that holds it."""
        return found.wrench if self.mechanism else found.displacements[""]


@cache
def question(kind: str, name: str) -> Question:
    machine = MACHINES[kind][name]().rigid_in_shear()
    chain = machine
    label = list(machine.postures)[-1]
    if kind == "chain":
        return Question(machine, chain, label, True, np.zeros(6))
    unit = Statics(chain, posture_values(chain, label), wrenches={"": 1e-6 * PUSH}).solve()
    moved = 1e6 * float(np.linalg.norm(unit.displacements[""][:3]))
    return Question(machine, chain, label, False, PUSH * 1e-3 * chain.characteristic_length / moved)


def engine_of(name: str, machine: Machine):
    segments = SPRINGS if name == "vjm" else ELEMENTS if name in ("exudyn", "opensees") else None
    options = EngineOptions(segments) if segments else EngineOptions()
    return engine_by_name(name, options, machine)


def springs_of(engine: str, chain: Machine) -> VjmEngine | None:
    """The springs of an engine's truth: one a beam for ``vjm-paper`` and linear engines."""
    if engine == "vjm":
        return VjmEngine(SPRINGS)
    if engine in ("exudyn", "opensees"):
        # elements split beams too that have a number of springs of their own
        return VjmEngine(FINE, parts=tuple((beam.name, FINE) for beam in chain.beams if beam.section))
    return None


def refused(engine: str, said: str) -> bool:
    """Whether a refusal is one of the engine's limits, or says what physics does not allow."""
    own = [limit for limit in LIMITS.get(engine, ()) if limit.what in said and limit.why in said]
    return bool(own) or any(reason in said for reason in PHYSICS)


PHYSICS = ("a direction in which it is held", "in every direction in which it is held", "is singular")
"""No engine has an answer there: a rigid direction, or a posture in which the machine is loose."""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name", "engine"), CELLS)
def test_every_machine_by_every_engine(kind: str, name: str, engine: str):
    asked = question(kind, name)
    small = engine in LINEAR
    share = SMALL_LOAD if small else 1.0
    springs = springs_of(engine, asked.chain)
    own = asked.truth(springs, share)
    while own.negative:
        # a path goes on behind a bifurcation on another branch: what both find is stable
        share *= 0.1
        own = asked.truth(springs, share)
    said = ""
    try:
        path = engine_of(engine, asked.machine).trace(asked.machine, asked.load_case(share))
    except ValueError as error:
        said = str(error)
    if said:
        assert refused(engine, said), said
        return
    assert path.complete, path.stopped
    point = path.points[-1]
    found, expected = (point.wrench if asked.mechanism else point.displacement), asked.answer(own)
    size = np.repeat(np.abs(expected.reshape(2, 3)).max(axis=1), 3)
    # turns of a machine that does not turn, and moments of one that bears none, by the other half's size
    length = asked.chain.characteristic_length
    unit = np.repeat([1.0, length], 3) if asked.mechanism else np.repeat([length, 1.0], 3)
    size = np.maximum(size, 1e-3 * float((np.abs(expected) / unit).max()) * unit)
    close = LINEAR_AGREE if small else ELEMENTS_AGREE if engine in ("exudyn", "opensees") else SPRINGS_AGREE
    assert np.abs((found - expected) / size).max() < close
    K = own.stiffness[""]
    if point.stiffness is not None and np.isfinite(K).all() and np.isfinite(point.stiffness).all():
        assert apart(point.stiffness, K) < close
