"""A loaded equilibrium with its stiffness, and those of end-effectors that nothing holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg

from vjm.design.linear_state import equilibrium_of, question
from vjm.errors import NoConvergenceError
from vjm.model.law_states import law_states
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.outcome import Outcome
from vjm.rank import NEGLIGIBLE, beyond, null_space
from vjm.rotations import Array, displacement_between, frame
from vjm.statics.equilibrium import solve_under_wrench
from vjm.statics.stability import free_stability
from vjm.statics.stiffness import loaded_stiffness, unloaded_stiffness
from vjm.statics.wrench_closure import cable_words
from vjm.threads import single_threaded
from vjm.tree.equilibria import Equilibria, largest_residual
from vjm.vjm_engine import VjmEngine

if TYPE_CHECKING:
    from vjm.notebook import Axes, DataFrame

DISPLACEMENT, WRENCH = "displacement", "wrench"
"""What is imposed on the end-effector."""
MISSED = 1e-5
"""Share of the acting forces that an equilibrium may lack: results are told to five digits."""


@dataclass(frozen=True, repr=False)
class LoadedStiffness(Outcome):
    """A stable loaded equilibrium with its stiffness, world axes.

    Attributes:
        model: name.
        model_sha256: hash of its file.
        engine: label.
        posture: label.
        control: what is imposed: ``displacement`` or ``wrench``.
        displacement: ``(6,)`` of the end-effector: translation and rotation vector, mm and rad.
        wrench: ``(6,)`` on the end-effector, N and N mm.
        loaded: ``(6, 6)`` K^F of eq. (18), N/mm, N, N mm.
        unloaded: ``(6, 6)`` K of eq. (5); nan where it has none, as its springs' laws have no slope there.
        eigenvalue: smallest of the second variation, in units of the engine's energy scale; nan if not computed.
        iterations: of the solver; None if not counted.
        residual: largest scaled component of the equilibrium equations.
        events: critical points that were passed on the way, in words.
        eigenvalue_relative: the same eigenvalue over that of the unloaded machine, as a path has it: 1 unloaded, 0
            at a critical point; nan if not computed.
        end: name of the end frame; empty where the machine names none.
        gravity: ``(3,)`` m/s², where the parts have their weight.
        loaded_compliance: ``(6, 6)`` inverse of K^F, mm/N, 1/N, rad/(N mm), of a machine that carries its free end;
            where a wrench moves nothing, K^F is infinite and this is not.
        unloaded_compliance: ``(6, 6)`` inverse of K, likewise.
        rigid: ``(k, 6)`` unit wrenches that move nothing where the machine stands under its loads.
        torques: what holds each joint of such a machine, N mm or N, by its name.
        pulls: of the springs between points, N, by their names; what pushes is negative.
        laws: where each law of a spring is, in words; K^F has its tangent there.
        stable: None where the engine does not examine it; an unstable equilibrium is refused.

    Example:
        >>> import vjm
        >>> found = vjm.stiffness(vjm.load("planar-2r"), "stretched", wrench=(0, -50, 0, 0, 0, 0))
        >>> f"{found.displacement[1]:.2f} mm"
        '-28.80 mm'
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    control: str
    displacement: Array
    wrench: Array
    loaded: Array
    unloaded: Array
    eigenvalue: float
    iterations: int | None
    residual: float
    events: tuple[str, ...] = ()
    eigenvalue_relative: float = float("nan")
    end: str = ""
    gravity: Gravity | None = None
    loaded_compliance: Array | None = None
    unloaded_compliance: Array | None = None
    rigid: Array | None = None
    torques: Mapping[str, float] | None = None
    pulls: Mapping[str, float] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    stable: bool | None = True

    def __post_init__(self) -> None:
        """Refuse what is no equilibrium.

        Raises:
            NoConvergenceError: forces are left over.
        """
        if not self.residual <= MISSED:
            raise NoConvergenceError(
                f"{self.model}, posture {self.posture}: not converged: {self.residual:.1e} of the acting forces is "
                "left over. It is no equilibrium"
            )

    def __repr__(self) -> str:
        from vjm.notebook import rounded

        diagonal, wrench = rounded(np.diag(self.loaded)), rounded(self.wrench)
        return (
            f"<LoadedStiffness {self.model}, posture {self.posture}, {self.engine}, imposed {self.control}\n"
            f" wrench {wrench} N, N mm\n"
            f" diagonal of K^F {diagonal} N/mm, N mm/rad>"
        )

    def _repr_html_(self) -> str:
        from vjm.notebook import stiffness_html

        return stiffness_html(self)

    def table(self) -> list[dict[str, Any]]:
        """The loaded matrix, a row for each component of the wrench."""
        from vjm.notebook import stiffness_rows

        return stiffness_rows(self)

    def to_frame(self) -> DataFrame:
        """The loaded matrix as a pandas DataFrame, rows wrench components, columns displacements.

        Raises:
            ImportError: pandas is not installed.
        """
        from vjm.notebook import stiffness_frame

        return stiffness_frame(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The diagonals of K and K^F side by side, as ratios.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.notebook import stiffness_plot

        return stiffness_plot(self, ax)


@single_threaded
def under_wrench(chain: Machine, engine: VjmEngine, posture: str, wrench: tuple[float, ...]) -> LoadedStiffness:
    """The stable equilibrium of the free end-effector under a dead wrench ``(6,)`` N, N mm."""
    chain = chain.at(posture)
    model = engine.model(chain)
    x = model.configuration(chain.posture(posture))
    at = solve_under_wrench(model, np.array(wrench, dtype=float), x)
    rest = solve_under_wrench(model, np.zeros(6), x)
    moved = displacement_between(model.kinematics(x).end, at.kinematics.end)
    verdict = free_stability(at)
    if verdict.unstable:
        raise NoConvergenceError(
            f"under this wrench the free end-effector has an equilibrium, but it is unstable in "
            f"{verdict.unstable} motions; hold the pose instead, `validate stiffness --displacement`"
        )
    return LoadedStiffness(
        model=chain.name,
        model_sha256=chain.sha256,
        engine=engine.label,
        posture=posture,
        control=WRENCH,
        displacement=moved,
        wrench=at.wrench,
        loaded=loaded_stiffness(at),
        unloaded=unloaded_stiffness(model, chain.posture(posture)),
        eigenvalue=verdict.eigenvalue,
        iterations=at.iterations,
        residual=at.residual,
        laws=tuple(map(str, law_states(model, at.x))),
        eigenvalue_relative=verdict.eigenvalue / free_stability(rest).eigenvalue,
    )


def held_by_itself(chain: Machine, posture: str = "") -> bool:
    """Whether a machine carries a wrench on its free end: with its drives held, no passive joint lets that move.

    Args:
        chain: the machine; springs between points hold too.
        posture: label; the first where it is empty.
    """
    if not chain.joints:
        return True
    if not chain.is_tree:
        return False
    # imported when it is asked for: closing loops takes linear algebra that no chain needs
    from vjm.machine.closing import Closing

    closing = Closing(chain, posture or next(iter(chain.postures)))
    return closing.mobility(closing.home).loose.shape[1] == 0


@single_threaded
def of_free_end(
    chain: Machine,
    engine: VjmEngine,
    posture: str,
    wrench: Sequence[float],
    *,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
) -> LoadedStiffness:
    """The equilibrium of a machine whose end frame is free, under a dead wrench, weight and loads on its parts.

    Args:
        chain: arm or tree; springs between points and couplings of loaded joints are welcome.
        engine: that splits its beams.
        posture: label.
        wrench: ``(6,)`` N, N mm on the end frame.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.

    Raises:
        NoConvergenceError: there is no equilibrium near, or it is unstable.
        ValueError: no such end frame, posture or part.
    """
    asked = question(chain, posture, wrench=wrench, gravity=gravity, loads=loads, end=end, engine=engine)
    model = engine.model(chain.at(posture))
    index = model.ends.index(asked.end)
    at = equilibrium_of(asked, model, compliance=True)
    if not at.stable[0]:
        raise NoConvergenceError(f"{chain.name}, posture {posture}: the equilibrium under these loads is unstable")
    passive = {joint.name for joint in chain.joints}
    x = model.configuration(chain.posture(posture))
    rigid0 = _rigid_at(model, x, asked.end)
    x[: model.coordinates] += at.x[0]
    rigid = _rigid_at(model, x, asked.end)
    laws = (*map(str, law_states(model, x)), *cable_words(model, x))
    K, C = _of_end(at, index, rigid)
    try:
        K0, C0 = _of_end(equilibrium_of(asked.unloaded, model, compliance=True), index, rigid0)
    except NoConvergenceError as error:
        if not laws:
            raise
        K0, C0 = np.full((6, 6), np.nan), np.full((6, 6), np.nan)
        laws += (f"there is no unloaded stiffness: {error}",)
    pulls = dict(zip((spring.name for spring in chain.point_springs), model.pulls(x).tolist(), strict=True))
    return LoadedStiffness(
        model=chain.name,
        model_sha256=chain.sha256,
        engine=engine.label,
        posture=posture,
        control=WRENCH,
        displacement=_moved(at, posture, index),
        wrench=np.array(wrench, dtype=float),
        loaded=K,
        unloaded=K0,
        eigenvalue=float("nan"),
        iterations=None,
        residual=largest_residual(at, gravity=gravity, loads=asked.acting),
        end=asked.end,
        gravity=gravity,
        loaded_compliance=C,
        unloaded_compliance=C0,
        rigid=rigid,
        torques={
            name: torque
            for name, torque in zip(model.joints, at.torques[0].tolist(), strict=True)
            if name not in passive
        },
        pulls=pulls,
        laws=laws,
    )


def _moved(at: Equilibria, posture: str, index: int) -> Array:
    """Displacement ``(6,)`` of an end frame: of the end-effector from where it is as designed."""
    chain = at.model.chain
    designed = chain.nominal_ends.get(posture)
    last = chain.parts[-1].name
    if designed is None or chain.ends.get(at.model.ends[index], last) != last:
        return at.deflection[0, index]
    return displacement_between(designed, frame(at.rotation[0, index], at.position[0, index]))


def _of_end(at: Equilibria, end: int, rigid: Array) -> tuple[Array, Array]:
    """Stiffness and compliance ``(6, 6)`` of an end frame, of which ``rigid`` (k, 6) wrenches move nothing."""
    assert at.stiffness is not None
    assert at.compliance is not None
    K, C = at.stiffness[0, end], at.compliance[0, end]
    # what rounding leaves of a compliance that is none has an inverse, which means nothing
    return (np.full((6, 6), np.inf) if len(rigid) else K), C


def _rigid_at(model: Mechanism, x: Array, end: str) -> Array:
    """Wrenches ``(k, 6)`` that move nothing at coordinates ``(size,)``."""
    k = model.kinematics(x)
    there = model.at_point(k, *model.find(end, 1.0))
    return rigid_wrenches(beyond(model.pose_rows(there), model.closing_rows(k)), model.characteristic_length)


def rigid_wrenches(motions: Array, length: float) -> Array:
    """Wrenches ``(k, 6)`` that move nothing: those that do no work on any motion of the end.

    Each has one component that the others lack (reduced echelon form), and largest component 1: of a planar
    mechanism, the force across its plane and the moments in it stand alone.

    Args:
        motions: ``(6, m)`` of the end by what deflects, shifts over the length.
        length: mm, by which moments become forces.
    """
    basis = null_space(motions.T).T
    *_, order = scipy.linalg.qr(basis, pivoting=True)
    own = order[: len(basis)]
    found: Array = np.linalg.solve(basis[:, own], basis) * np.repeat([1.0, length], 3)
    found[np.abs(found) < NEGLIGIBLE * np.abs(found).max(axis=1, keepdims=True)] = 0.0
    largest = np.abs(found).argmax(axis=1, keepdims=True)
    # no negative zeros
    return (found / np.take_along_axis(found, largest, axis=1))[np.argsort(largest[:, 0])] + 0.0
