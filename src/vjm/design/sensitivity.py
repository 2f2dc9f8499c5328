"""How a deflection, a stiffness, a frequency or the mass of a loaded machine changes with any of its parameters.

The equilibrium changes by the implicit function theorem: ``[A, −J_cᵀ; J_c, 0] (x', λ') = (∂r/∂p, −∂g/∂p)`` with the
tangent A, the closures' derivative J_c, the forces r that an equilibrium lacks and the closures' gaps g. What is
asked for is then differenced along this change of state. No equilibrium is solved again, so that the differences
hold no error of a solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, assert_never

import numpy as np
from scipy.optimize import brentq

from vjm.design.linear_state import CARRIED, ROUNDING, LinearState, Question, loading, question, state_of
from vjm.design.masses import total_mass
from vjm.design.modes import eigenmodes
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, Load
from vjm.model.lumped import LumpedModel
from vjm.model.parameters import Parameter
from vjm.model.pieces import closure_sites
from vjm.platform.manipulator import Machine
from vjm.postures import Posture, in_posture_of
from vjm.rotations import Array, displacement_between
from vjm.threads import single_threaded
from vjm.tree.model import Gravity
from vjm.vjm_engine import VjmEngine

STEP = 1e-3
"""Change of a parameter, over its scale, of the wider of two central differences: errors of its fourth power,
1e-12, and of rounding over it, 1e-13."""
CLOSED = 1e-9
"""Gap of a closure, over the characteristic length, up to which it is closed."""
MOST = 10.0
"""Factor on a parameter beyond which it is said that it alone is not enough."""


class Quantity(StrEnum):
    """What is differentiated."""

    DEFLECTION = "deflection"
    """A component of the end's displacement under the loads, mm or rad."""
    STIFFNESS = "stiffness"
    """One over the loaded compliance of the free end along a component, N/mm or N mm/rad."""
    FREQUENCY = "frequency"
    """The lowest natural frequency, Hz; of equal ones the derivative lies between theirs."""
    MASS = "mass"
    """Of all parts, kg."""


GOALS = {Quantity.DEFLECTION: 0.5, Quantity.STIFFNESS: 2.0, Quantity.FREQUENCY: 2.0, Quantity.MASS: 0.5}
"""Factor on each quantity that is asked for."""


@dataclass(frozen=True)
class Sensitivity:
    """The derivative of a quantity by one parameter.

    Attributes:
        parameter: its name.
        unit: of the parameter.
        value: of the parameter.
        derivative: of the quantity, in its unit per unit of the parameter.
        relative: per cent of the quantity per per cent of the parameter.
        factor: on the parameter that alone brings the quantity to its goal, see `GOALS`; None where none up to
            `MOST` does, or where it was not asked for.
    """

    parameter: str
    unit: str
    value: float
    derivative: float
    relative: float
    factor: float | None = None


@dataclass(frozen=True)
class Sensitivities:
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
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    quantity: Quantity
    along: str
    value: float
    rows: tuple[Sensitivity, ...]

    @property
    def unit(self) -> str:
        """Of the quantity."""
        return unit_of(self.quantity, self.along)

    def table(self) -> list[dict[str, Any]]:
        """One row a parameter."""
        return [
            {
                "parameter": row.parameter, "unit": row.unit, "value": row.value, "derivative": row.derivative,
                "relative": row.relative, "factor": row.factor,
            }
            for row in self.rows
        ]  # fmt: skip


def unit_of(quantity: Quantity, along: str) -> str:
    """Unit of a quantity along a component."""
    shifts = along in COMPONENTS[:3]
    match quantity:
        case Quantity.DEFLECTION:
            return "mm" if shifts else "rad"
        case Quantity.STIFFNESS:
            return "N/mm" if shifts else "N mm/rad"
        case Quantity.FREQUENCY:
            return "Hz"
        case Quantity.MASS:
            return "kg"
        case _:
            assert_never(quantity)


@single_threaded
def sensitivity(
    machine: Machine,
    parameters: Sequence[Parameter],
    quantity: Quantity | str,
    posture: Posture = "",
    *,
    along: str = "",
    wrench: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
    factors: int = 0,
) -> Sensitivities:
    """Derivatives of a quantity of a loaded machine, whose end is free, by parameters.

    Args:
        machine: see `vjm.load`.
        parameters: see `vjm.model.parameters` and `vjm.io.file_parameters`.
        quantity: ``deflection``, ``stiffness``, ``frequency`` or ``mass``.
        posture: label or coordinates; the first one if left out.
        along: component x, y, z, rx, ry or rz of a deflection or a stiffness; of a deflection the largest shift, of
            a stiffness x if left out.
        wrench: ``(6,)`` on the end, N and N mm.
        gravity: m/s².
        loads: on parts.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as the engine ``vjm`` if left out.
        factors: for how many of the parameters with the largest relative derivatives it is looked for which factor
            on them alone brings the quantity to its goal, see `GOALS`.

    Raises:
        ValueError: no such component, nothing deflects along it, a parameter changes which springs the machine has,
            or it opens a closed loop in the unloaded posture.
        NoConvergenceError: there is no equilibrium under the loads.
    """
    quantity = Quantity(quantity)
    asked = question(machine, posture, wrench=wrench, gravity=gravity, loads=loads, end=end, engine=engine)
    base = state_of(asked)
    along = _component(base, quantity, along)
    value = value_of(base, quantity, along)
    if quantity is Quantity.DEFLECTION:
        unit = np.repeat([1.0, base.model.characteristic_length], 3)
        k, size = COMPONENTS.index(along), float(np.abs(_moved(base) * unit).max())
        if abs(value) * unit[k] <= ROUNDING * size:
            raise ValueError(f"{asked.machine.name}, posture {asked.posture}: its deflection along {along} is zero")
    if quantity is Quantity.MASS and not value:
        raise ValueError(f"{asked.machine.name}: no part has a mass")
    rows = []
    for parameter in parameters:
        derivative = derivative_of(base, parameter, quantity, along)
        rows.append(
            Sensitivity(
                parameter.name, parameter.unit, parameter.value, derivative, derivative * parameter.value / value
            )
        )
    by_name = {parameter.name: parameter for parameter in parameters}
    rows.sort(key=lambda row: -abs(row.relative))
    rows[:factors] = [
        replace(row, factor=_factor(asked, by_name[row.parameter], quantity, along, value, row.relative))
        for row in rows[:factors]
    ]
    return Sensitivities(
        asked.machine.name, asked.machine.sha256, asked.engine.label, asked.posture, quantity, along, value,
        tuple(rows),
    )  # fmt: skip


def _component(base: LinearState, quantity: Quantity, along: str) -> str:
    """The component of a quantity that has one.

    Raises:
        ValueError: there is none of the name.
    """
    if quantity in (Quantity.FREQUENCY, Quantity.MASS):
        if along:
            raise ValueError(f"a {quantity} has no component: leave '{along}' out")
        return ""
    if along and along not in COMPONENTS:
        raise ValueError(f"component '{along}' is none of {', '.join(COMPONENTS)}")
    largest = int(np.argmax(np.abs(_moved(base)[:3]))) if quantity is Quantity.DEFLECTION else 0
    return along or COMPONENTS[largest]


def value_of(state: LinearState, quantity: Quantity, along: str) -> float:
    """A quantity of a machine in equilibrium.

    Args:
        state: the equilibrium.
        quantity: what is asked for.
        along: component of a deflection or a stiffness; empty for the size of the end's shift.

    Raises:
        ValueError: there is none, such as the lowest frequency of an unstable machine.
    """
    match quantity:
        case Quantity.DEFLECTION:
            moved = _moved(state)
            return float(moved[COMPONENTS.index(along)] if along else np.linalg.norm(moved[:3]))
        case Quantity.STIFFNESS:
            k = COMPONENTS.index(along)
            soft = float(compliance(state)[k, k])
            if not soft > 0.0:
                raise ValueError(f"{state.model.name}: its end does not deflect along {along}, or it is unstable")
            return 1.0 / soft
        case Quantity.FREQUENCY:
            value = float(np.real(eigenmodes(state, 1)[0][0]))
            if value < 0.0:
                raise ValueError(f"{state.model.name}: its equilibrium is unstable: it has no lowest frequency")
            return float(np.sqrt(value)) / (2.0 * np.pi)
        case Quantity.MASS:
            return total_mass(state)
        case _:
            assert_never(quantity)


def compliance(state: LinearState) -> Array:
    """Derivative ``(6, 6)`` of the free end's pose by a wrench on it, mm/N, 1/N, rad/(N mm), world axes."""
    N = state.motions
    J = state.jacobian @ N
    result: Array = J @ np.linalg.lstsq(N.T @ state.tangent @ N, J.T, rcond=CARRIED)[0]
    return result


def _moved(state: LinearState) -> Array:
    """Displacement ``(6,)`` of the end from the unloaded posture.

    Raises:
        ValueError: closed loops are open there.
    """
    model = state.model
    x0 = model.configuration(model.chain.posture(state.question.posture))
    unloaded = replace(state, x=x0)
    if np.abs(_gaps(unloaded)).max(initial=0.0) > CLOSED * model.characteristic_length:
        raise ValueError(
            f"{model.name}: with another value of a parameter its loops are open in posture "
            f"{state.question.posture}: deflections are differentiated by what leaves them closed"
        )
    return displacement_between(unloaded.end.end, state.end.end)


def derivative_of(base: LinearState, parameter: Parameter, quantity: Quantity, along: str) -> float:
    """Total derivative of a quantity, see `value_of`, by a parameter, per its unit."""
    right, result = np.zeros(base.n + len(_gaps(base))), 0.0
    shares = ((STEP * parameter.scale, -1.0 / 3.0), (0.5 * STEP * parameter.scale, 4.0 / 3.0))
    for h, share in shares:
        ahead, behind = (_changed(base, parameter, parameter.value + s, base.x) for s in (h, -h))
        right[: base.n] += share / (2.0 * h) * (_lacking(ahead) - _lacking(behind))
        right[base.n :] -= share / (2.0 * h) * (_gaps(ahead) - _gaps(behind))
    rate = _rate(base, right)
    for h, share in shares:
        ahead, behind = (_changed(base, parameter, parameter.value + s, base.x + s * rate) for s in (h, -h))
        result += share / (2.0 * h) * (value_of(ahead, quantity, along) - value_of(behind, quantity, along))
    return result


def _rate(base: LinearState, right: Array) -> Array:
    """Change ``(size,)`` of the coordinates and the closures' wrenches, from the right side ``(size,)``."""
    rows = base.constraints * base.unit
    size = np.abs(rows).max(axis=1, initial=0.0)
    scale = np.concatenate([base.unit, 1.0 / np.where(size > 0.0, size, 1.0)])
    n, total = base.n, len(right)
    A = np.zeros((total, total))
    A[:n, :n], A[:n, n:], A[n:, :n] = base.tangent, base.constraints.T, base.constraints
    y = scale * np.linalg.lstsq(A * scale[:, None] * scale, scale * right, rcond=CARRIED)[0]
    return np.concatenate([y[:n], -y[n:]])


def _changed(base: LinearState, parameter: Parameter, value: float, x: Array) -> LinearState:
    """The machine with another value of a parameter, at a state ``(size,)``.

    Raises:
        ValueError: it has other springs or joints then.
    """
    asked = replace(base.question, machine=_posed(base.question, parameter, value))
    model = LumpedModel(asked.engine.split(asked.machine.at(asked.posture)))
    if model.size != base.model.size:
        raise ValueError(f"parameter '{parameter.name}' adds or takes away a spring: it has no derivative")
    x0 = model.configuration(model.chain.posture(asked.posture))
    return LinearState(asked, model, x, np.zeros(6), loading(asked, model, x0), np.full(6, np.nan))


def _posed(asked: Question, parameter: Parameter, value: float) -> Chain:
    """The machine with another value of a parameter, with the posture that is asked for."""
    return in_posture_of(parameter.apply(asked.machine, value), asked.posture, asked.machine)


def _lacking(state: LinearState) -> Array:
    """Generalised forces ``(n,)`` that a state lacks to be an equilibrium."""
    model, reactions = state.model, state.reactions
    sprung = model.strain(reactions) - state.x
    sprung[model.passive] = 0.0
    result: Array = state.spring_stiffness @ sprung[: state.n]
    result[model.passive] = reactions[model.passive]
    return result


def _gaps(state: LinearState) -> Array:
    """What closures and couplings miss ``(c,)``, in the order of `LinearState.constraints`; mm and rad."""
    chain, gaps = state.model.chain, []
    joints, frames = closure_sites(chain, state.model.built)
    for closure, on, own in zip(chain.closures, joints, frames, strict=True):
        first, second = (state.kinematics.behind[j + 1] @ T for j, T in zip(on, own, strict=True))
        gaps.append(displacement_between(first, second)[: closure.rows])
    for coupling in chain.couplings:
        terms = (weight * state.x[state.model.built.spans[joint].start] for joint, weight in coupling.terms)
        gaps.append(np.array([sum(terms) - coupling.total]))
    return np.concatenate(gaps) if gaps else np.zeros(0)


def _factor(
    asked: Question, parameter: Parameter, quantity: Quantity, along: str, value: float, relative: float
) -> float | None:
    """The factor on a parameter that alone brings a quantity to its goal; None where none up to `MOST` does."""
    goal = GOALS[quantity]
    if not relative:
        return None

    def missing(log_factor: float) -> float:
        changed = replace(asked, machine=_posed(asked, parameter, parameter.value * float(np.exp(log_factor))))
        found = value_of(state_of(changed), quantity, along)
        return float(np.log(max(found / (goal * value), np.finfo(float).tiny)))

    far = float(np.sign(np.log(goal) / relative) * np.log(MOST))
    try:
        if missing(far) * missing(0.0) > 0.0:
            return None
        return float(np.exp(brentq(missing, 0.0, far, rtol=1e-6)))
    except (ValueError, NoConvergenceError):
        # such a machine is none, or it does not bear its loads
        return None
