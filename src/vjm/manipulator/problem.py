"""A manipulator under a programme, as a problem whose path can be followed, and as an engine that follows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.arc_length import walk
from vjm.equilibrium import Configuration, NoConvergenceError, solve_newton
from vjm.hand import Hand
from vjm.loads import NO_LOADING
from vjm.lumped_problem import LumpedProblem
from vjm.manipulator.bodies import turn_rate
from vjm.manipulator.closure import RigidPose
from vjm.manipulator.manipulator import Manipulator
from vjm.manipulator.rigid import inverse_kinematics
from vjm.manipulator.whole import Whole
from vjm.paths import Equilibrium, Path
from vjm.programme import COMPONENTS, PointControl, Programme
from vjm.rotations import Array
from vjm.stability import critical_modes, stability
from vjm.vjm_engine import VjmEngine


class ManipulatorProblem(LumpedProblem):
    """A manipulator in a pose under a programme: a `vjm.following.Problem` with Newton on platform and bodies.

    The ramp imposes the platform's displacement but for what the programme leaves free, or a dead wrench on it.

    Attributes:
        model: the whole.
    """

    model: Whole

    def __init__(
        self, manipulator: Manipulator, programme: Programme, engine: VjmEngine, pose: RigidPose | None = None
    ) -> None:
        """Set up the pose.

        Args:
            manipulator: the machine.
            programme: what is done; its posture is the label of a pose, or the platform's displacement from home.
            engine: how beams become springs.
            pose: the rigid pose, where it is known.

        Raises:
            PoseError: the rigid machine cannot take the pose.
            ValueError: the programme asks for what only single chains do.
            NoConvergenceError: constant loads or errors of assembly are more than the machine bears.
        """
        self.label = engine.label
        self.programme = programme
        held, constant, ramped = on_platform(programme)
        if pose is None:
            pose = inverse_kinematics(manipulator, manipulator.displacement(programme.posture))
        # a pose is rigid: errors and offsets are those of the machine that is given
        pose = replace(pose, manipulator=manipulator)
        self.model = Whole(pose, engine, held, constant, ramped)
        self.stations = self.model.labels()
        self._loading, self._on_tool, self._watched = NO_LOADING, np.zeros(0, dtype=bool), -1
        self._pose0 = pose.frames[0]
        self._hand = Hand(self.model, self._pose0, ())
        self._x0 = self.model.at_rest
        self._constant, self._ramped = constant, ramped
        at_rest = Configuration(Whole(pose, engine, held, models=self.model.models), self._x0, np.zeros(6), 0.0, 0)
        self._softest = stability(at_rest).eigenvalue
        # the legs' compiled models have seen the other whole's state
        self._built = bool(np.any(constant)) or any(manipulator.errors) or any(manipulator.offsets)

    def unloaded(self) -> Equilibrium:
        """The pose as drawn, under what acts all along: constant loads and the machine's errors.

        Raises:
            NoConvergenceError: it has no stable equilibrium.
        """
        at = Configuration(self.model, self._x0, np.zeros(6), 0.0, 0)
        if self._built:
            at = solve_newton(self.model, self._pose0, self._x0, np.zeros(6), load=0.0)
            if stability(at).unstable:
                raise NoConvergenceError("under its constant loads and errors of assembly the machine is unstable")
        return self.equilibrium(0.0, at, 0.0)

    def equilibrium(self, s: float, at: Configuration, ramp: float) -> Equilibrium:
        """What the path keeps of a configuration; the stiffness is the platform's, its whole pose imposed."""
        found = super().equilibrium(s, at, ramp)
        return replace(found, displacement=at.x[self.model.layout.platform].copy())

    def leg_wrenches(self, point: Equilibrium) -> Array:
        """Wrench ``(l, 6)`` that each leg bears at its end, N, N mm, world axes, about that end."""
        at = self.configuration(point)
        return self.model.network.leg_wrenches(at.x, at.wrench, at.load)

    def giving_way(self, critical: Equilibrium) -> dict[str, float]:
        """Which legs give way at a critical point: each one's share of the mode, their squares adding up to one.

        What counts is how far a leg's springs give way; a leg that only turns in its joints follows the others.
        """
        mode = critical_modes(self.configuration(critical))[0] / self.model.coordinate_scale
        sizes = np.array(
            [
                np.linalg.norm(mode[where][model.elastic])
                for where, model in zip(self.model.layout.legs, self.model.models, strict=True)
            ]
        )
        names = [leg.name for leg in self.model.pose.manipulator.legs]
        return dict(zip(names, (sizes / np.linalg.norm(sizes)).tolist(), strict=True))

    def _wrench(self, at: Configuration, hand: Array) -> Array:
        """What acts on the platform ``(6,)``: what holds it and the loads on it."""
        return at.wrench + self._constant + at.load * self._ramped

    def _tangent_stiffness(self, at: Configuration, K: Array) -> float:
        try:
            dx, dF = self.rate(at)
        except np.linalg.LinAlgError:
            return 0.0 if self.programme.load_driven else float("nan")
        if not self.programme.load_driven:
            return float(self.programme.direction @ dF)
        motion = dx[self.model.layout.platform].copy()
        motion[3:] = turn_rate(at.x[self.model.layout.platform][3:]) @ motion[3:]
        work = float(self._ramped @ motion)
        return 1.0 / work if work != 0.0 else float("inf")


def on_platform(programme: Programme) -> tuple[Array, Array, Array]:
    """Which components ``(6,)`` are held, and the constant and ramped wrench ``(6,)`` on the platform."""
    if programme.gravity is not None or programme.imperfection or isinstance(programme.control, PointControl):
        raise ValueError("a manipulator knows no weight, imperfection or control by a point: use its chain's model")
    if any(load.part or load.follower for load in programme.loads):
        raise ValueError("loads on a manipulator are dead wrenches on its platform: leave part and follower out")
    turns = [name for name in programme.free if len(name) == 2]
    if len(turns) not in (0, 3):
        raise ValueError("a platform's turns are free all three or not at all: rx, ry, rz go together")
    held = np.array([name not in programme.free for name in COMPONENTS])
    constant, ramped = np.zeros(6), np.zeros(6)
    for load in programme.loads:
        if load.ramped:
            ramped += programme.sign * np.array(load.wrench)
        else:
            constant += np.array(load.wrench)
    if programme.load_driven and not np.any(ramped[~held]):
        raise ValueError("the ramped load acts on held components only: free those that it drives, see --free")
    return held, constant, ramped


@dataclass(frozen=True)
class ManipulatorEngine:
    """The virtual joint method on whole manipulators.

    Attributes:
        springs: how the legs' beams become springs.
    """

    springs: VjmEngine = field(default_factory=VjmEngine)

    @property
    def label(self) -> str:
        """That of the springs: ``vjm-paper``, ``vjm-16``, ``vjm-16f16``."""
        return self.springs.label

    def problem(self, manipulator: Manipulator, programme: Programme) -> ManipulatorProblem:
        """The manipulator under a programme, ready to be followed."""
        return ManipulatorProblem(manipulator, programme, self.springs)

    def walk(
        self, manipulator: Manipulator, programme: Programme, progress: Callable[[float], None] | None = None
    ) -> Path:
        """Take the manipulator through the programme; see `vjm.arc_length.walk`."""
        path = walk(self.problem(manipulator, programme), programme, progress=progress)
        return replace(path, model=manipulator.name, model_sha256=manipulator.sha256)
