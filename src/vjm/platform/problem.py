"""A manipulator under a load case, as a problem whose path can be followed, and as an engine that follows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.continuation.arc_length import trace
from vjm.continuation.imperfections import buckling_shape
from vjm.continuation.loaded_problem import LoadedProblem
from vjm.continuation.path import Equilibrium, Path
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, LoadCase, PointControl
from vjm.platform.closure import RigidPose
from vjm.platform.leg_topology import turn_rate
from vjm.platform.loaded_manipulator import LoadedManipulator
from vjm.platform.manipulator import Manipulator
from vjm.platform.rigid import SINGULAR, inverse_kinematics, mobility
from vjm.platform.rigid_legs import refuse_rigid_legs
from vjm.rotations import Array
from vjm.statics.equilibrium import Configuration, solve_newton
from vjm.statics.stability import critical_modes, stability
from vjm.threads import single_threaded
from vjm.vjm_engine import VjmEngine


class ManipulatorProblem(LoadedProblem[LoadedManipulator]):
    """A manipulator under a load case: `vjm.continuation.problem.Problem`, Newton on platform and bodies.

    The ramp imposes the platform's displacement but for what the load case leaves free, or a dead wrench on it.
    """

    def __init__(
        self,
        manipulator: Manipulator,
        load_case: LoadCase,
        engine: VjmEngine,
        pose: RigidPose | None = None,
        bow: Array | None = None,
    ) -> None:
        """Set up the pose.

        Args:
            manipulator: the machine.
            load_case: what is done; its posture is the label of a pose, or the platform's displacement from home.
            engine: how beams become springs.
            pose: the rigid pose, where it is known.
            bow: deflection ``(n,)`` of the coordinates, of which that of the legs' springs is built into them.

        Raises:
            PoseError: the rigid machine cannot take the pose.
            RigidLegError: a leg does not deflect in all directions.
            ValueError: the load case asks for what only single chains do, or what is free leaves a mechanism.
            NoConvergenceError: constant loads or errors of assembly are more than the machine bears.
        """
        held, constant, ramped = on_platform(load_case)
        if pose is None:
            pose = inverse_kinematics(manipulator, manipulator.displacement(load_case.posture))
        # a pose is rigid: errors and offsets are those of the machine that is given
        pose = replace(pose, manipulator=manipulator)
        _refuse_mechanism(pose, held)
        model = LoadedManipulator(pose, engine, held, constant, ramped)
        refuse_rigid_legs(pose, model.models)
        if bow is not None:
            bent = [leg.bent(bow[where]) for leg, where in zip(model.models, model.layout.legs, strict=True)]
            model = LoadedManipulator(pose, engine, held, constant, ramped, bent)
        super().__init__(model, load_case, engine.label, model.labels(), pose.frames[0])
        self._x0 = model.at_rest
        self._constant, self._ramped = constant, ramped
        bare = LoadedManipulator(pose, engine, held, models=model.models)
        self._unloaded_eigenvalue = stability(Configuration(bare, self._x0, np.zeros(6), 0.0, 0)).eigenvalue
        # the legs' compiled models have seen the other whole's state
        self._built = (
            bow is not None or bool(np.any(constant)) or any(manipulator.errors) or any(manipulator.offsets)
        )

    def at_rest(self) -> Configuration[LoadedManipulator]:
        """The pose as drawn, under what acts all along: constant loads and the machine's errors.

        Raises:
            NoConvergenceError: it has no stable equilibrium.
        """
        if not self._built:
            return Configuration(self.model, self._x0, np.zeros(6), 0.0, 0)
        at = solve_newton(self.model, self._pose0, self._x0, np.zeros(6), load=0.0)
        if stability(at).unstable:
            raise NoConvergenceError("under its constant loads and errors of assembly the machine is unstable")
        return at

    @property
    def _softest(self) -> float:
        return self._unloaded_eigenvalue

    def _displacement(self, at: Configuration[LoadedManipulator], ramp: float) -> Array:
        return at.x[self.model.layout.platform].copy()

    def leg_wrenches(self, point: Equilibrium) -> Array:
        """Wrench ``(l, 6)`` that each leg bears at its end, N, N mm, world axes, about that end."""
        at = self.configuration(point)
        return self.model.network.leg_wrenches(at.x, at.wrench, at.load)

    def giving_way(self, critical: Equilibrium) -> dict[str, float]:
        """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

        What counts is how far a leg's springs deflect; a leg that only turns in its joints follows the others.
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

    def _wrench(self, at: Configuration[LoadedManipulator], ramp: float) -> Array:
        self.model.network.visit(at.x, at.wrench, at.load)
        return self.model.network.held_wrench(at.wrench) + self._constant + at.load * self._ramped

    def _tangent_stiffness(self, at: Configuration[LoadedManipulator], K: Array) -> float:
        try:
            dx, dF = self.rate(at)
        except np.linalg.LinAlgError:
            return 0.0 if self.load_case.load_driven else float("nan")
        if not self.load_case.load_driven:
            return float(self.load_case.direction @ dF)
        motion = dx[self.model.layout.platform].copy()
        motion[3:] = turn_rate(at.x[self.model.layout.platform][3:]) @ motion[3:]
        work = float(self._ramped @ motion)
        return 1.0 / work if work != 0.0 else float("inf")


def on_platform(load_case: LoadCase) -> tuple[Array, Array, Array]:
    """Which components ``(6,)`` are held, and the constant and ramped wrench ``(6,)`` on the platform.

    Raises:
        ValueError: the load case asks for what only single chains do; the message says what to do instead.
    """
    if load_case.gravity is not None:
        raise ValueError(
            "gravity: a manipulator file gives its platform no mass, so that it has no weight; put the weight on "
            "the platform as a constant load"
        )
    if isinstance(load_case.control, PointControl):
        raise ValueError(
            f"control by part '{load_case.control.part}': a manipulator is steered by its ramp or along its arc; "
            f"give ramp, arc or limit"
        )
    for load in load_case.loads:
        if load.part or load.follower:
            what = f"on part '{load.part}'" if load.part else "that follows"
            raise ValueError(f"load {what}: loads on a manipulator are dead wrenches on its platform; leave it out")
    held = np.array([name not in load_case.free for name in COMPONENTS])
    turns = int(np.count_nonzero(~held[3:]))
    if np.any(load_case.direction[3:]) and (turns or 0 < np.count_nonzero(~held[:3]) < 3):
        raise ValueError(
            "free components: a support that turns would take its hinge or slides with it; "
            "beside a driven turn free x, y, z or nothing"
        )
    constant, ramped = np.zeros(6), np.zeros(6)
    for load in load_case.loads:
        if load.ramped:
            ramped += load_case.sign * np.array(load.wrench)
        else:
            constant += np.array(load.wrench)
    if load_case.load_driven and not np.any(ramped[~held]):
        raise ValueError("the ramped load acts on held components only: free those that it drives, see --free")
    return held, constant, ramped


def _refuse_mechanism(pose: RigidPose, held: Array) -> None:
    """Refuse a machine without drives that moves in what is free without straining anything."""
    manipulator = pose.manipulator
    if np.all(held) or any(leg.drive for leg in manipulator.legs):
        return
    loose = mobility(pose).loose
    _, sizes, V = np.linalg.svd(loose[held], full_matrices=True)
    rank = int(np.count_nonzero(sizes > SINGULAR))
    if rank == loose.shape[1]:
        return
    twist = loose @ V[rank]
    first = COMPONENTS[int(np.argmax(np.abs(twist)))]
    raise ValueError(
        f"{manipulator.name}: with {', '.join(n for n, h in zip(COMPONENTS, held, strict=True) if not h)} free it "
        f"is a mechanism: nothing drives it, and it moves without straining a spring; hold {first}"
    )


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

    @single_threaded
    def problem(self, manipulator: Manipulator, load_case: LoadCase) -> ManipulatorProblem:
        """The manipulator under a load case, ready to be followed.

        An imperfection is built into the springs of the legs, in the shape of the mode in which the perfect machine
        buckles under the load case.
        """
        bow = None
        if load_case.imperfection:
            shape = buckling_shape(
                lambda perfect: ManipulatorProblem(manipulator, perfect, self.springs), load_case
            )
            bow = load_case.imperfection * shape
        return ManipulatorProblem(manipulator, load_case, self.springs, bow=bow)

    @single_threaded
    def trace(
        self, manipulator: Manipulator, load_case: LoadCase, progress: Callable[[float], None] | None = None
    ) -> Path:
        """Take the manipulator through the load case; see `vjm.continuation.arc_length.trace`."""
        path = trace(self.problem(manipulator, load_case), load_case, progress=progress)
        return replace(path, model=manipulator.name, model_sha256=manipulator.sha256)
