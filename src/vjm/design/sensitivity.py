"""How a deflection, a stiffness, a critical load, a frequency or the mass changes with any parameter of a machine.

The equilibrium changes by the implicit function theorem: ``[A, −J_cᵀ; J_c, 0] (x', λ') = (∂r/∂p, −∂g/∂p)``. Here A
is the tangent, J_c the closures' derivative, r the forces that an equilibrium lacks and g the closures' gaps. What
is asked for is then differenced along this change of state. No equilibrium is solved again, so that the differences
hold no error of a solver.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, assert_never

import numpy as np
from scipy.optimize import Bounds, brentq, minimize

from vjm.design.changes import (
    STEP,
    ByParameter,
    Directions,
    asked_with,
    changed,
    difference,
    gaps,
    posed,
    state_rate,
)
from vjm.design.critical import critical_derivative, critical_state
from vjm.design.linear_state import LinearState, Question, loaded_posture, state_of
from vjm.design.modes import eigenmodes, frequency_rates, total_mass
from vjm.design.space import Designed, LoadCases, design_space
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.machine.inverse_kinematics import ranges_of
from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.model.load_case import COMPONENTS, Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.model.parameters import Parameter
from vjm.outcome import Outcome
from vjm.postures import Posture
from vjm.rank import NEGLIGIBLE, SUM_ROUNDING
from vjm.rotations import Array, displacement_between
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.outcome import Axes


# --- The reach of an arm: how far its tool comes from the origin of its base --------------------------------------

STARTS = 8
"""Random postures from which the farthest one is looked for."""
TIGHT: Any = {"ftol": 1e-16, "gtol": 1e-12}
"""A distance is differenced by a machine's numbers: it is computed to rounding."""


def reach(machine: Machine) -> float:
    """The largest distance of the unloaded tool from the base's origin, within the joints' limits, mm.

    By a gradient method from some postures: a larger one may be missed, and joints that other joints drive are
    held to the limits of those alone.

    Args:
        machine: an arm or a tree, whose tool is its end-effector.

    Raises:
        ValueError: it has closed loops.

    Example:
        >>> import vjm
        >>> round(reach(vjm.load("planar-2r")), 6)
        900.0
    """
    if machine.closes:
        raise ValueError(f"{machine.name}: has closed loops: a reach is of an arm")
    rigid, ranges = RigidMechanism(machine), ranges_of(Mechanism(machine))
    bounds = Bounds(ranges.low, ranges.high)

    def at(q: Array) -> tuple[Array, Array]:
        _, _, frame, motion = rigid.linearised(q[None])
        return frame[0, :3, 3] / rigid.length, motion[0, :3] / rigid.unit

    def near(q: Array) -> float:
        place, _ = at(q)
        return -float(place @ place)

    def rate(q: Array) -> Array:
        place, motion = at(q)
        return -2.0 * (place @ motion)

    least = min(
        float(minimize(near, q, jac=rate, bounds=bounds, method="L-BFGS-B", options=TIGHT).fun)
        for q in ranges.random(STARTS, 0)
    )
    return float(rigid.length * np.sqrt(-least))


# --- Derivatives against machines that are solved again: one central difference for each --------------------------

APART = 1e-3
"""Relative change of a parameter: a central difference errs by its square. Modes no farther apart are equal."""
SOLVED = 1e-8
"""Relative error of a quantity that is solved for, at most."""


class SolvedAgain(NamedTuple):
    """What a difference says of a derivative.

    Attributes:
        difference: the central difference; None where there is none.
        why: why there is none, or why the derivative is doubtful; empty where both agree.
    """

    difference: float | None
    why: str

    @property
    def doubtful(self) -> bool:
        """Whether the two disagree beyond the error of both."""
        return self.difference is not None and bool(self.why)


NOT_ASKED = SolvedAgain(None, "not asked for")


def verified(quantity: Callable[[float], float], value: float, centre: float, derivative: float) -> SolvedAgain:
    """A derivative beside a central difference.

    The difference errs by less than it differs from the one-sided ones, which are nearer the corner of a quantity
    that has one, and by the error of the solutions over the step.

    Args:
        quantity: the quantity at a value of the parameter, solved again.
        value: of the quantity as it is.
        centre: value of the parameter.
        derivative: to be verified, per unit of the parameter.
    """
    step = APART * abs(centre)
    if not step:
        return SolvedAgain(None, "the parameter is zero, of which no share can be taken")
    try:
        ahead, behind = quantity(centre + step), quantity(centre - step)
    except (ValueError, NoConvergenceError) as error:
        return SolvedAgain(None, " ".join(str(error).split()))
    difference = (ahead - behind) / (2.0 * step)
    allowed = abs(ahead - 2.0 * value + behind) / (2.0 * step) + SOLVED * abs(value) / step
    if abs(derivative - difference) <= allowed:
        return SolvedAgain(difference, "")
    return SolvedAgain(difference, f"machines solved again give {difference:.5g}, not {derivative:.5g}")


# ------------------------------------------------------------------------------------------------------------------


CLOSED = 1e-9
"""Gap of a closure, over the characteristic length, up to which it is closed."""
KEPT = 8
"""Equilibria that are remembered: all parameters of a machine change the same one."""
MOST = 10.0
"""Factor on a parameter beyond which it is said that it alone is not enough."""


class DesignQuantity(StrEnum):
    """What is differentiated."""

    DEFLECTION = "deflection"
    """A component of the end's displacement under the loads, mm or rad."""
    STIFFNESS = "stiffness"
    """One over the loaded compliance of the free end along a component, N/mm or N mm/rad."""
    FREQUENCY = "frequency"
    """The lowest natural frequency, Hz; of equal ones the derivative lies between theirs."""
    CRITICAL = "critical"
    """The smallest factor on the wrench and the loads at which stability is lost; the weight stays."""
    MASS = "mass"
    """Of all parts, kg."""
    REACH = "reach"
    """Of an arm, mm: the largest distance of the unloaded tool from the base's origin."""
    COST = "cost"
    """By the formula of a design space, see `vjm.design.space.Cost`."""


GOALS = {
    DesignQuantity.DEFLECTION: 0.5, DesignQuantity.STIFFNESS: 2.0, DesignQuantity.FREQUENCY: 2.0,
    DesignQuantity.CRITICAL: 2.0, DesignQuantity.MASS: 0.5, DesignQuantity.REACH: 2.0, DesignQuantity.COST: 0.5,
}  # fmt: skip
"""Factor on each quantity that is asked for."""
UNITS = {
    DesignQuantity.FREQUENCY: "Hz", DesignQuantity.CRITICAL: "times the load", DesignQuantity.MASS: "kg",
    DesignQuantity.REACH: "mm", DesignQuantity.COST: "",
}  # fmt: skip
"""Of the quantities that have no component."""
UNLOADED = (DesignQuantity.MASS, DesignQuantity.REACH, DesignQuantity.COST)
"""Quantities that no load and no posture changes."""
WITHOUT_COMPONENT = (DesignQuantity.CRITICAL, DesignQuantity.FREQUENCY, *UNLOADED)


@dataclass(frozen=True)
class QuantitySensitivity:
    """The derivative of a quantity by one parameter.

    Attributes:
        parameter: its name.
        unit: of the parameter.
        value: of the parameter.
        derivative: of the quantity, in its unit per unit of the parameter.
        relative: per cent of the quantity per per cent of the parameter.
        factor: on the parameter that alone brings the quantity to its goal, see `GOALS`; None where none up to
            `MOST` does, or where it was not asked for.
        verification: a difference of machines that were solved again.
        geometric: whether the parameter moves a point of the unloaded machine, as a length does.
    """

    parameter: str
    unit: str
    value: float
    derivative: float
    relative: float
    factor: float | None = None
    verification: SolvedAgain = NOT_ASKED
    geometric: bool = False


@dataclass(frozen=True)
class Sensitivities(Outcome):
    """The derivatives of a quantity of a machine in one posture.

    Attributes:
        model: name.
        model_sha256: hash of its file.
        engine: label.
        posture: label.
        quantity: what is differentiated.
        along: component, of a deflection or a stiffness; empty else.
        value: of the quantity.
        rows: a derivative for each parameter, the largest relative one first.
        left_out: parameters that have no derivative, and why.

    Example:
        >>> import vjm
        >>> sensitivities = vjm.sensitivities("planar-2r", ["tool.mass_kg"], of="mass")
        >>> sensitivities.unit, [round(row["derivative"], 6) for row in sensitivities.table()]
        ('kg', [1.0])
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    quantity: DesignQuantity
    along: str
    value: float
    rows: tuple[QuantitySensitivity, ...]
    left_out: tuple[tuple[str, str], ...] = ()

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return unit_of(self.quantity, self.along)

    def plot(self, ax: Axes | None = None) -> Axes:
        """A bar for each parameter: per cent of the quantity per per cent of the parameter.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import bars

        label = f"% of the {self.quantity} {self.along} by 1 %".replace("  ", " ")
        return bars([row.parameter for row in self.rows], np.array([row.relative for row in self.rows]), label, ax)

    def table(self) -> list[dict[str, Any]]:
        """One row a parameter."""
        return [
            {
                "parameter": row.parameter, "unit": row.unit, "value": row.value, "derivative": row.derivative,
                "relative": row.relative, "factor": row.factor, "difference": row.verification.difference,
                "doubt": row.verification.why, "geometric": row.geometric,
            }
            for row in self.rows
        ]  # fmt: skip


@lru_cache(maxsize=KEPT)
def solved(asked: Question) -> LinearState:
    """The stable equilibrium of a question, which may have been asked before.

    Raises:
        NoConvergenceError: there is none near, or it is unstable.
    """
    state = state_of(asked)
    if not state.stable:
        raise NoConvergenceError(
            f"{asked.machine.name}, posture {asked.posture}: the equilibrium under these loads is unstable"
        )
    return state


def unit_of(quantity: DesignQuantity, along: str) -> str:
    """Unit of a quantity along a component."""
    shifts = along in COMPONENTS[:3]
    by_component = {
        DesignQuantity.DEFLECTION: "mm" if shifts else "rad",
        DesignQuantity.STIFFNESS: "N/mm" if shifts else "N mm/rad",
    }
    return (UNITS | by_component)[quantity]


@single_threaded
def sensitivity(
    machine: Machine,
    parameters: Sequence[Parameter],
    quantity: DesignQuantity | str,
    posture: Posture = "",
    *,
    along: str = "",
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
    factors: int = 0,
    leave_out: bool = False,
) -> Sensitivities:
    """Derivatives of a quantity of a loaded machine, whose end is free, by parameters.

    Args:
        machine: see `vjm.load`.
        parameters: see `vjm.model.parameters` and `vjm.io.file_parameters`.
        quantity: ``deflection``, ``stiffness``, ``critical``, ``frequency`` or ``mass``.
        posture: label or coordinates; the first one if left out.
        along: component x, y, z, rx, ry or rz of a deflection or a stiffness; of a deflection the largest shift, of
            a stiffness x if left out.
        wrench: ``(6,)`` on the end, N and N mm.
        gravity: m/s².
        loads: on parts.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as the engine ``vjm`` if left out.
        factors: for how many of the parameters with the largest relative derivatives it is looked for which factor
            on them alone brings the quantity to its goal, see `GOALS`. As many of those that leave the geometry
            as it is are added.
        leave_out: parameters without a derivative are listed with the reason; else they are an error.

    Raises:
        ValueError: no such component, nothing deflects along it, a parameter changes which springs the machine has,
            or it opens a closed loop in the unloaded posture.
        NoConvergenceError: there is no equilibrium under the loads.
    """
    quantity = DesignQuantity(quantity)
    asked = loaded_posture(machine, posture, wrench=wrench, gravity=gravity, loads=loads, end=end, engine=engine)
    along = _component(asked, quantity, along)
    value = value_at(asked, quantity, along)
    if quantity is DesignQuantity.DEFLECTION:
        base = solved(asked)
        unit = np.repeat([1.0, base.model.characteristic_length], 3)
        k, size = COMPONENTS.index(along), float(np.abs(_moved(base) * unit).max())
        if abs(value) * unit[k] <= SUM_ROUNDING * size:
            raise ValueError(f"{asked.machine.name}, posture {asked.posture}: its deflection along {along} is zero")
    if quantity is DesignQuantity.MASS and not value:
        raise ValueError(f"{asked.machine.name}: no part has a mass")
    if not value:
        raise ValueError(
            f"{asked.machine.name}, posture {asked.posture}: its {quantity} is zero: no change of it is relative"
        )
    rows, left_out = [], []
    for parameter in parameters:
        try:
            derivative = derivative_at(asked, parameter, quantity, along)
        except ValueError as error:
            if not leave_out:
                raise
            left_out.append((parameter.name, " ".join(str(error).split())))
            continue
        rows.append(
            QuantitySensitivity(
                parameter.name, parameter.unit, parameter.value, derivative, derivative * parameter.value / value,
                verification=verified(
                    partial(_at, asked, parameter, quantity, along), value, parameter.value, derivative
                ),
                geometric=_moves(asked, parameter),
            )
        )  # fmt: skip
    by_name = {parameter.name: parameter for parameter in parameters}
    rows.sort(key=lambda row: -abs(row.relative))
    offered = {row.parameter for row in (*rows[:factors], *[row for row in rows if not row.geometric][:factors])}
    rows = [
        replace(row, factor=_factor(asked, by_name[row.parameter], quantity, along, value, row.relative))
        if row.parameter in offered
        else row
        for row in rows
    ]
    return Sensitivities(
        asked.machine.name, asked.machine.sha256, asked.engine.label, asked.posture, quantity, along, value,
        tuple(rows), tuple(left_out),
    )  # fmt: skip


def sensitivities(
    model: Designed,
    by: Sequence[str] = (),
    *,
    of: DesignQuantity | str = DesignQuantity.DEFLECTION,
    along: str = "",
    posture: Posture = "",
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
    factors: int = 0,
) -> Sensitivities:
    """Derivatives of a quantity of a loaded machine, whose end is free, by its numbers.

    Args:
        model: as for `vjm.load`, or a machine, or a function that makes one of its arguments.
        by: keys of the numbers, see `vjm.sweep`; all that have a derivative if left out.
        of: ``deflection``, ``stiffness``, ``critical``, ``frequency`` or ``mass``.
        along: component x, y, z, rx, ry or rz of a deflection or a stiffness; of a deflection the largest shift, of
            a stiffness x if left out.
        posture: label or coordinates; the first one if left out.
        wrench: ``(6,)`` on the end, N and N mm.
        gravity: m/s².
        loads: on parts.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as the engine ``vjm`` if left out.
        factors: for how many numbers it is looked for which factor alone halves or doubles the quantity, and for
            how many of those that leave the geometry as it is.

    Raises:
        ModelFileError: there is no such file or number.
        ValueError: no such quantity, component or posture, or a number of ``by`` has no derivative.
        NoConvergenceError: there is no equilibrium under the loads.

    Example:
        >>> import vjm
        >>> sensitivities = vjm.sensitivities("planar-2r", ["upper.length_mm"], of="mass")
        >>> [(row["parameter"], f"{row['derivative']:.5g}") for row in sensitivities.table()]
        [('upper.length_mm', '0.0018468')]
    """
    on_end = () if wrench is None else [wrench]
    space = design_space(model, by, LoadCases([posture] if posture else (), on_end, gravity, loads, end, engine))
    (case,) = space.cases
    parameters = [space.files.parameter(key, case.posture) for key in by or space.files.keys()]
    return sensitivity(
        space.files.machine(case.posture), parameters, of, case.posture, along=along, wrench=case.wrench,
        gravity=gravity, loads=loads, end=end, engine=engine, factors=factors, leave_out=not by,
    )  # fmt: skip


def _component(asked: Question, quantity: DesignQuantity, along: str) -> str:
    """The component of a quantity that has one.

    Raises:
        ValueError: there is none of the name.
    """
    if quantity in WITHOUT_COMPONENT:
        if along:
            raise ValueError(f"a {quantity} has no component: leave '{along}' out")
        return ""
    if along and along not in COMPONENTS:
        raise ValueError(f"component '{along}' is none of {', '.join(COMPONENTS)}")
    if along or quantity is not DesignQuantity.DEFLECTION:
        return along or COMPONENTS[0]
    return COMPONENTS[int(np.argmax(np.abs(_moved(solved(asked))[:3])))]


def value_at(
    asked: Question, quantity: DesignQuantity, along: str, state: Callable[[Question], LinearState] = solved
) -> float:
    """A quantity of a machine under loads.

    Args:
        asked: the machine, and what is done to it.
        quantity: what is asked for.
        along: component of a deflection or a stiffness; empty for the size of the end's shift.
        state: finds the equilibrium.

    Raises:
        ValueError: there is none, such as the lowest frequency of an unstable machine.
        NoConvergenceError: there is no equilibrium under the loads.
    """
    match quantity:
        case DesignQuantity.CRITICAL:
            return critical_state(asked).factor
        case DesignQuantity.MASS:
            return total_mass(asked)
        case DesignQuantity.REACH:
            return reach(asked.machine)
        case DesignQuantity.COST:
            raise ValueError("a cost is of numbers that vary: ask `vjm.sweep` or `vjm.optimise`, with a formula")
        case DesignQuantity.DEFLECTION | DesignQuantity.STIFFNESS | DesignQuantity.FREQUENCY:
            return value_of(state(asked), quantity, along)
        case _:
            assert_never(quantity)


def value_of(state: LinearState, quantity: DesignQuantity, along: str) -> float:
    """A quantity of a machine in equilibrium, but a critical load, which has an equilibrium of its own.

    Args:
        state: the equilibrium.
        quantity: what is asked for.
        along: component of a deflection or a stiffness; empty for the size of the end's shift.

    Raises:
        ValueError: there is none, such as the lowest frequency of an unstable machine.
    """
    match quantity:
        case DesignQuantity.DEFLECTION:
            moved = _moved(state)
            return float(moved[COMPONENTS.index(along)] if along else np.linalg.norm(moved[:3]))
        case DesignQuantity.STIFFNESS:
            k = COMPONENTS.index(along)
            soft = float(compliance(state)[k, k])
            # of the most that the end could move by if nothing held its springs and joints
            rounding = SUM_ROUNDING * float(np.sum((state.jacobian[k] * state.unit) ** 2))
            if soft == np.inf:
                raise ValueError(f"{state.model.name}: its end moves along {along} without straining a spring")
            if not abs(soft) > rounding:
                raise ValueError(f"{state.model.name}: its end does not deflect along {along}")
            return 1.0 / soft
        case DesignQuantity.FREQUENCY:
            value = float(np.real(eigenmodes(state, 1)[0][0]))
            if value < 0.0:
                raise ValueError(f"{state.model.name}: its equilibrium is unstable: it has no lowest frequency")
            return float(np.sqrt(value)) / (2.0 * np.pi)
        case DesignQuantity.CRITICAL | DesignQuantity.MASS | DesignQuantity.REACH | DesignQuantity.COST:
            raise ValueError(f"a {quantity} is no quantity of an equilibrium")
        case _:
            assert_never(quantity)


def compliance(state: LinearState) -> Array:
    """Derivative ``(6, 6)`` of the free end's pose by a wrench on it, mm/N, 1/N, rad/(N mm), world axes.

    Columns of wrenches that move the end without straining a spring are infinite.
    """
    forces = state.jacobian.T
    motions, _, left = state.respond(state.solver, forces)
    loose = np.linalg.norm(left, axis=0) > NEGLIGIBLE * np.linalg.norm(state.unit[:, None] * forces, axis=0)
    return np.where(loose, np.inf, state.jacobian @ motions)


def _moved(state: LinearState) -> Array:
    """Displacement ``(6,)`` of the end from the unloaded posture.

    Raises:
        ValueError: closed loops are open there.
    """
    model = state.model
    x0 = model.configuration(model.chain.posture(state.question.posture))
    unloaded = replace(state, x=x0)
    if np.abs(gaps(unloaded)).max(initial=0.0) > CLOSED * model.characteristic_length:
        raise ValueError(
            f"{model.name}: with another value of a parameter its loops are open in posture "
            f"{state.question.posture}: deflections are differentiated by what leaves them closed"
        )
    return displacement_between(unloaded.end.end, state.end.end)


def derivative_at(asked: Question, parameter: Parameter, quantity: DesignQuantity, along: str) -> float:
    """Total derivative of a quantity, see `value_at`, by a parameter, per its unit.

    Raises:
        ValueError: there is none, such as by what adds a spring.
    """
    if quantity is DesignQuantity.CRITICAL:
        return critical_derivative(critical_state(asked), parameter)
    h = STEP * parameter.scale
    if quantity in UNLOADED:

        def unloaded(step: float) -> Array:
            return np.array([value_at(asked_with(asked, parameter, parameter.value + step), quantity, along)])

        return float(difference(unloaded, h)[0])
    base = solved(asked)
    if quantity is DesignQuantity.FREQUENCY and (lowest := _lowest(base)) is not None:
        return float(frequency_rates(base, [parameter], *lowest).mean())
    if quantity is DesignQuantity.STIFFNESS:
        return _stiffness_rate(base, parameter, COMPONENTS.index(along))
    rate = state_rate(base, parameter)

    def value(step: float, x: Array) -> Array:
        return np.array([value_of(changed(base, parameter, parameter.value + step, x), quantity, along)])

    if quantity is DesignQuantity.DEFLECTION and along in COMPONENTS[:3]:
        # differences of the end's place would lose a small shift in the rounding of large lengths
        moves = float(base.jacobian[COMPONENTS.index(along)] @ rate[: base.n])
        return moves + float(difference(lambda step: value(step, base.x), h)[0])
    return float(difference(lambda step: value(step, base.x + step * rate), h)[0])


def _stiffness_rate(base: LinearState, parameter: Parameter, k: int) -> float:
    """Derivative of one over the compliance ``c = fᵀ B⁻¹ f`` of the free end along a component.

    With what f brings about, v, and by the transposed tangent, w, it is ``c' = f'ᵀ (v + w) − wᵀ B' v``.
    """
    directions, n = Directions(base), base.n
    force = directions.scaled(base.jacobian[k], np.zeros(len(base.constraints)))[:, None]
    v, w = (base.solver.solve(force, transposed=turned)[0] for turned in (False, True))
    stiffness, both = directions.stiffness(w, v), base.unit * (v + w)[:n, 0]
    change = ByParameter(directions, base, base.x, parameter)
    softened = change.along(
        lambda state: stiffness(state) - state.jacobian[k] @ both, change.way(base.solver.solve)
    )
    return float(softened[0]) / float(np.sum(force * v)) ** 2


def _moves(asked: Question, parameter: Parameter) -> bool:
    """Whether a parameter moves a point of the unloaded machine."""
    changed = asked_with(asked, parameter, parameter.value + STEP * parameter.scale)
    places = []
    for model in (asked.model, changed.model):
        k = model.kinematics(model.configuration(model.chain.posture(asked.posture)))
        # where a part ends that is rigid, no station is
        ends = [(k.behind[end.joint + 1] @ end.frame)[:3, 3] for end in model.built.ends.values()]
        places.append(np.vstack([model.shape(k), *ends]))
    length = asked.model.characteristic_length
    return places[0].shape != places[1].shape or bool(np.abs(places[1] - places[0]).max() > CLOSED * length)


@lru_cache(maxsize=KEPT)
def _lowest(base: LinearState) -> tuple[Array, Array] | None:
    """Values ``(k,)`` and motions ``(n, k)`` of the lowest modes, which are equal; None where there is no rate."""
    values, motions = eigenmodes(base, 2) if base.conservative else (np.zeros(1), np.zeros(1))
    if values[0] <= 0.0:
        return None
    equal = values <= values[0] * (1.0 + APART)
    return values[equal], motions[:, equal]


def _at(asked: Question, parameter: Parameter, quantity: DesignQuantity, along: str, value: float) -> float:
    """The quantity of the machine with another value of a parameter, solved anew."""
    again = replace(asked, machine=posed(asked, parameter, value))
    # it is asked for once, and its matrices are not to be kept
    return value_at(again, quantity, along, solved.__wrapped__)


def _factor(
    asked: Question, parameter: Parameter, quantity: DesignQuantity, along: str, value: float, relative: float
) -> float | None:
    """The factor on a parameter that alone brings a quantity to its goal; None where none up to `MOST` does."""
    goal = GOALS[quantity]
    if not relative:
        return None

    def missing(log_factor: float) -> float:
        new_value = _at(asked, parameter, quantity, along, parameter.value * float(np.exp(log_factor)))
        return float(np.log(max(new_value / (goal * value), np.finfo(float).tiny)))

    far = float(np.sign(np.log(goal) / relative) * np.log(MOST))
    try:
        # each is a machine of its own, whose critical load takes a path: none is computed twice
        known = {0.0: -float(np.log(goal)), far: missing(far)}
        if known[far] * known[0.0] > 0.0:
            return None
        return float(np.exp(brentq(lambda at: known[at] if at in known else missing(at), 0.0, far, rtol=1e-6)))
    except (ValueError, NoConvergenceError):
        # such a machine is none, or it does not bear its loads
        return None
