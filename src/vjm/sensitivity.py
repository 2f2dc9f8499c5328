"""Derivatives of wrenches and of critical points by the parameters of a chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from vjm.continuation.path import Equilibrium, Event, EventKind, Path
from vjm.engines import VjmEngine
from vjm.kernels.compilation import entry
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parameters import Parameter
from vjm.model.springs import BeamColumnSpring, LawSpring, Spring
from vjm.rotations import Array, displacement_between, rotation_from_vector, skew, translation, turn
from vjm.statics import Configuration, critical_modes, newton_scale


class Links(NamedTuple):
    """A lumped model's m joints and the m + 1 rigid pieces before, between and behind them.

    Attributes:
        rotary: ``(m,)`` whether a joint turns.
        axis: ``(m, 3)`` in its own frame.
        R: ``(m + 1, 3, 3)`` and
        p: ``(m + 1, 3)``, mm, the transform of each piece.
        coordinate: ``(m,)`` which coordinate drives a joint.
        factor: ``(m,)`` how much of it.
    """

    rotary: np.ndarray
    axis: Array
    R: Array
    p: Array
    coordinate: np.ndarray
    factor: Array


class Placed(NamedTuple):
    """The links at one state.

    Attributes:
        R: ``(m + 1, 3, 3)`` and
        p: ``(m + 1, 3)`` the frames at the far ends of the pieces, the end-effector's last; world, mm.
        screws: ``(m, 6)`` linear and angular velocity of the end-effector by the joints' velocities.
    """

    R: Array
    p: Array
    screws: Array

    @property
    def end(self) -> Array:
        """Frame ``(4, 4)`` of the end-effector."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.R[-1], self.p[-1]
        return T


def links_of(model: Mechanism) -> Links:
    """The joints that deflect, and the pieces between them: other joints stand where they are commanded to."""
    driven = model.drive.coordinate >= 0
    pieces, T = [], np.eye(4)
    for before, axis, rotary, value, deflects in zip(
        model.before, model.axis, model.joint_rotary, model.command, driven, strict=True
    ):
        T = T @ before @ (turn(axis, value) if rotary else translation(axis * value))
        if deflects:
            pieces.append(T)
            T = np.eye(4)
    all_pieces = np.array([*pieces, T @ model.tail])
    return Links(
        model.joint_rotary[driven],
        np.ascontiguousarray(model.axis[driven]),
        np.ascontiguousarray(all_pieces[:, :3, :3]),
        np.ascontiguousarray(all_pieces[:, :3, 3]),
        model.drive.coordinate[driven],
        model.drive.factor[driven],
    )


def place(links: Links, x: Array) -> Placed:
    """The links at the coordinates ``x`` (n,), mm and rad."""
    m = len(links.rotary)
    placed = Placed(np.empty((m + 1, 3, 3)), np.empty((m + 1, 3)), np.empty((m, 6)))
    _place(*links, x, *placed)
    return placed


def reactions(links: Links, placed: Placed, wrench: Array, size: int) -> Array:
    """``Jᵀ F`` ``(n,)`` of a wrench ``(6,)`` on the ``size`` coordinates."""
    weights = links.factor * (placed.screws @ wrench)
    result: Array = np.bincount(links.coordinate, weights, size).astype(float, copy=False)
    return result


def changes(links: Links, placed: Placed, wrench: Array, twists: Array, rates: Array) -> tuple[Array, Array]:
    """What motions of the chain do to the reactions and to the end-effector, at constant wrench.

    Args:
        links: the chain.
        placed: its state.
        wrench: ``(6,)``, N, N mm.
        twists: ``(k, m + 1, 6)`` of the pieces' far ends in their own axes, for each of k motions.
        rates: ``(k, n)`` of the coordinates.

    Returns:
        Changes of ``Jᵀ F`` ``(k, n)``, and of the end-effector's pose ``(k, 6)``.
    """
    load, end = np.zeros_like(rates), np.empty((len(rates), 6))
    _changes(links.rotary, links.coordinate, links.factor, *placed, wrench, twists, rates, load, end)
    return load, end


def twists_between(less: Links, more: Links, middle: Links, width: float) -> Array:
    """Twists ``(m + 1, 6)`` of the pieces' far ends, in their own axes, per unit of a parameter.

    Args:
        less: links at the lower value.
        more: and at the higher one.
        middle: and between the two.
        width: difference of the two values.
    """
    spin = middle.R.transpose(0, 2, 1) @ (more.R - less.R) / width
    turn = 0.5 * np.stack([spin[:, k, j] - spin[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
    shift = np.einsum("jba,jb->ja", middle.R, more.p - less.p) / width
    back = np.cross(middle.axis, (more.axis - less.axis) / width)
    turn[:-1] += back
    turn[1:] -= np.einsum("jba,jb->ja", middle.R[1:], back)
    shift[1:] -= np.einsum("jba,jb->ja", middle.R[1:], np.cross(back, middle.p[1:]))
    return np.hstack([shift, turn])


class Laws:
    """How the springs' laws change between two values of a parameter."""

    def __init__(self, less: Mechanism, more: Mechanism, width: float) -> None:
        # the segments of a beam have one law: they are evaluated together
        alike: dict[object, tuple[Spring, Spring, list[slice]]] = {}
        for (a, place), (b, _) in zip(less.blocks, more.blocks, strict=True):
            if not _same_law(a, b):
                key = (a, b) if isinstance(a, BeamColumnSpring) else id(a)
                alike.setdefault(key, (a, b, []))[2].append(place)
        self._width = width
        self._changed = [
            (a, b, np.array([np.arange(place.start, place.stop) for place in places]))
            for a, b, places in alike.values()
        ]

    def strains(self, reactions: Array) -> Array:
        """``∂θ/∂p`` ``(k, n)`` at constant reactions ``(k, n)``, in k states at once."""
        result = np.zeros_like(reactions)
        for a, b, index in self._changed:
            tau = reactions[:, index].reshape(-1, index.shape[1]).T
            change = (b.strain(tau) - a.strain(tau)) / self._width
            result[:, index] = change.T.reshape(len(reactions), *index.shape)
        return result


def _same_law(a: Spring, b: Spring) -> bool:
    """Whether two springs of one kind have one law."""
    if isinstance(a, BeamColumnSpring):
        return a == b
    if isinstance(a, LawSpring) or isinstance(b, LawSpring):
        return a == b
    return np.array_equal(a.unloaded, b.unloaded)


@entry
def _place(
    rotary: np.ndarray,
    axis: Array,
    R0: Array,
    p0: Array,
    coordinate: np.ndarray,
    factor: Array,
    x: Array,
    R_out: Array,
    p_out: Array,
    screws: Array,
) -> None:
    """Kinematics (1), (2) of the joints in a row."""
    m = len(rotary)
    R, p, w, u = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for j in range(m + 1):
        for a in range(3):
            p[a] += R[a, 0] * p0[j, 0] + R[a, 1] * p0[j, 1] + R[a, 2] * p0[j, 2]
        for a in range(3):
            u[0], u[1], u[2] = R[a, 0], R[a, 1], R[a, 2]
            for b in range(3):
                R[a, b] = u[0] * R0[j, 0, b] + u[1] * R0[j, 1, b] + u[2] * R0[j, 2, b]
        for a in range(3):
            p_out[j, a] = p[a]
            for b in range(3):
                R_out[j, a, b] = R[a, b]
        if j == m:
            break
        for a in range(3):
            w[a] = R[a, 0] * axis[j, 0] + R[a, 1] * axis[j, 1] + R[a, 2] * axis[j, 2]
            screws[j, a] = w[a]
            screws[j, 3 + a] = w[a] if rotary[j] else 0.0
        value = factor[j] * x[coordinate[j]]
        if not rotary[j]:
            for a in range(3):
                p[a] += value * w[a]
            continue
        # each column of R by Rodrigues' formula
        c, s = np.cos(value), np.sin(value)
        for b in range(3):
            u[0], u[1], u[2] = R[0, b], R[1, b], R[2, b]
            d = (1.0 - c) * (w[0] * u[0] + w[1] * u[1] + w[2] * u[2])
            for a in range(3):
                k, q = (a + 1) % 3, (a + 2) % 3
                R[a, b] = c * u[a] + s * (w[k] * u[q] - w[q] * u[k]) + d * w[a]
    for j in range(m):
        if rotary[j]:
            for a in range(3):
                k, q = (a + 1) % 3, (a + 2) % 3
                screws[j, a] = screws[j, 3 + k] * (p[q] - p_out[j, q]) - screws[j, 3 + q] * (p[k] - p_out[j, k])


@entry
def _changes(
    rotary: np.ndarray,
    coordinate: np.ndarray,
    factor: Array,
    R: Array,
    p: Array,
    screws: Array,
    wrench: Array,
    twists: Array,
    rates: Array,
    load: Array,
    end: Array,
) -> None:
    """Write the changes of the reactions ``load`` (k, n) and of the pose ``end`` (k, 6), see `changes`."""
    m = len(rotary)
    # the change of J_j · F by a turn of its column, and by a shift of its lever's end
    turned, levered, upto, t = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 6)), np.zeros(6)
    for j in range(m):
        for a in range(3):
            k, q = (a + 1) % 3, (a + 2) % 3
            turned[j, a] = screws[j, k] * wrench[q] - screws[j, q] * wrench[k]
            turned[j, a] += screws[j, 3 + k] * wrench[3 + q] - screws[j, 3 + q] * wrench[3 + k]
            levered[j, a] = wrench[k] * screws[j, 3 + q] - wrench[q] * screws[j, 3 + k]
    for i in range(len(rates)):
        total = end[i]
        total[:] = 0.0
        for j in range(m + 1):
            moves = False
            for a in range(6):
                moves = moves or twists[i, j, a] != 0.0
            if moves:
                for a in range(3):
                    t[a] = t[3 + a] = 0.0
                    for b in range(3):
                        t[a] += R[j, a, b] * twists[i, j, b]
                        t[3 + a] += R[j, a, b] * twists[i, j, 3 + b]
                for a in range(3):
                    k, q = (a + 1) % 3, (a + 2) % 3
                    total[a] += t[a] + t[3 + k] * (p[m, q] - p[j, q]) - t[3 + q] * (p[m, k] - p[j, k])
                    total[3 + a] += t[3 + a]
            if j < m:
                for a in range(6):
                    upto[j, a] = total[a]
                rate = factor[j] * rates[i, coordinate[j]]
                if rate != 0.0:
                    for a in range(6):
                        total[a] += rate * screws[j, a]
        for j in range(m):
            tau = 0.0
            for a in range(3):
                tau += turned[j, a] * upto[j, 3 + a] + levered[j, a] * (total[a] - upto[j, a])
            load[i, coordinate[j]] += factor[j] * tau


# --- The tangent of an equilibrium at an imposed pose, ``A = [H − K, Jᵀ; J, 0]``: solutions with it and with Aᵀ
#
# Both come from the chain's block factorisation and are linear in the number of springs, at a bifurcation too.

NUDGE = 1e-10
"""Change of the wrench that makes a tangent regular which is singular to the last digit."""


@dataclass(frozen=True)
class State:
    """An equilibrium, its geometry, and the tangent A there.

    Attributes:
        at: the equilibrium.
        s: path parameter.
        links: of its model.
        placed: the links at its coordinates.
    """

    at: Configuration
    s: float
    links: Links
    placed: Placed

    @property
    def reactions(self) -> Array:
        """``Jᵀ F`` ``(n,)``."""
        return reactions(self.links, self.placed, self.at.wrench, self.at.model.size)

    @cached_property
    def _moment(self) -> Array:
        """``m ×`` ``(3, 3)`` of the wrench's moment."""
        return skew(self.at.wrench[3:])

    def response(self, load: Array, gap: Array, *, transposed: bool = False) -> tuple[Array, Array]:
        """``(δx, δF)`` of ``A (δx; δF) = (−load; gap)``, or of Aᵀ, for ``load`` (n,) and ``gap`` (6,).

        The two differ by ``(m × δΩ) · δΩ'`` over the end-effector's turns, for its moment m, fixed in the world, is
        not conservative; so their answers differ by the moment that this makes of the turn in ``gap``.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        configuration = self.at
        dx, dF = configuration.model.compiled.response(configuration.x, configuration.wrench, load, gap)
        if transposed:
            dF[3:] += self._moment @ gap[3:]
        return dx, dF

    def adjoint(self) -> tuple[Array, Array]:
        """``u`` ``(6, n)`` and ``v`` ``(6, 6)`` with ``Aᵀ (u_k; v_k) = (0; e_k)``: what the wrench is sensitive to.

        Raises:
            numpy.linalg.LinAlgError: the state is a critical point.
        """
        still = np.zeros_like(self.at.x)
        u, v = zip(*(self.response(still, gap, transposed=True) for gap in np.eye(6)), strict=True)
        return np.array(u), np.array(v)

    def solve(self, right: Array, *, transposed: bool = False) -> Array:
        """``A⁻¹ r`` or ``A⁻ᵀ r`` for each row of ``(k, n + 6)``."""
        n = self.at.model.size
        return np.array([np.concatenate(self.response(-r[:n], r[n:], transposed=transposed)) for r in right])


class Mode:
    """The null vector of A at a bifurcation, and A without it.

    Attributes:
        vector: b ``(n + 6,)`` with ``A b = 0`` and ``bᵀ A = 0``, of unit length in scaled units.
        twofold: whether there is a second one.
    """

    def __init__(self, state: State) -> None:
        configuration, n = state.at, state.at.model.size
        modes = critical_modes(configuration)
        if configuration.model.compiled.visit(configuration.x, configuration.wrench) < 0:
            configuration = replace(configuration, wrench=configuration.wrench * (1.0 + NUDGE))
        self._state = replace(state, at=configuration)
        self.twofold = len(modes) > 1
        scale = newton_scale(configuration.model)
        vector = np.concatenate([modes[0], np.zeros(6)])
        # of the mode and its wrench by inverse iteration, which hardly turns what is known to many digits
        for _ in range(2):
            vector[n:] = 0.0
            vector = self._state.solve((vector / scale**2)[None])[0]
            vector /= np.linalg.norm(vector / scale)
        self.vector = vector
        self._border = vector / scale**2

    def without(self, states: Array) -> Array:
        """States ``(k, n + 6)`` without their part in b, in scaled units."""
        return states - np.outer(states @ self._border, self.vector)

    def solve(self, right: Array) -> Array:
        """The solution without a part in b of ``A y = r`` without r's part in b, for each row of ``(k, n + 6)``.

        It is that of the regular system which b borders. Mixed block elimination (Govaerts and Pryce 1993) gets it
        from solutions with the nearly singular A and Aᵀ as accurately as its own factors would.
        """
        border = self._border
        left = self._state.solve(border[None], transposed=True)[0]
        plain = self._state.solve(border[None])[0]
        lacking = right - np.outer(right @ left / (left @ border), border)
        result = self._state.solve(lacking)
        return result - np.outer(result @ border / (plain @ border), plain)


# ------------------------------------------------------------------------------------------------------------------


STEP = 1e-5
"""Half the width of a difference over the parameter's scale: near the cube root of rounding, the best of it."""
SYMMETRIC = 1e-7
"""A parameter keeps the symmetry if its scale loads the critical mode by less than this fraction of the ramp."""
DRIFT = 0.03
"""Nor does it break the symmetry if this amplitude of the mode, or less, in an inexact state accounts for its load.

Near a bifurcation a solver leaves up to 3e-4 of the mode, which has length one in scaled units. A parameter that
breaks the symmetry acts on the mode by hardly more than its load, and would need an amplitude far above one.
"""
KINK = "two modes become unstable together: which of them is first has a kink here"

NOT_SERIAL = (
    "of critical points in branches, closed loops and springs between parts no derivative is computed here; "
    "`validate sensitivity` has them"
)
"""What these derivatives do not know: they follow one line of bodies."""


@dataclass(frozen=True)
class CriticalSensitivity:
    """How a critical point moves with the parameters.

    Attributes:
        event: the critical point.
        force: derivative ``(n_p,)`` of its driven force, N (N mm for a driven rotation) per unit of the parameter.
        s: derivative ``(n_p,)`` of its displacement, mm (rad) per unit of the parameter.
        reasons: for each parameter why there is no derivative, which then is nan; empty where there is one.
    """

    event: Event
    force: Array
    s: Array
    reasons: tuple[str, ...]


def by_posture(engine: VjmEngine, chain: Machine, parameters: Sequence[Parameter]) -> Callable[[str], Sensitivity]:
    """The `Sensitivity` of the paths in a posture by its label, made once: one for all where no joint is held."""

    @cache
    def made(posture: str | None) -> Sensitivity:
        return Sensitivity(engine, chain, parameters, posture)

    return lambda posture: made(posture if chain.held_joints else None)


def wrench_sensitivity(engine: VjmEngine, chain: Machine, path: Path, parameters: Sequence[Parameter]) -> Array:
    """`Sensitivity.wrench` of one path ``(points, 6, n_p)``."""
    return Sensitivity(engine, chain, parameters, path.load_case.posture).wrench(path)


@dataclass(frozen=True)
class _Neighbour:
    """The chain with another value of a parameter, and its model."""

    chain: Machine
    model: Mechanism
    links: Links


class Sensitivity:
    """A chain and its neighbours: each parameter a little less and a little more than it is.

    Making them costs as much as the derivatives of a path do; they serve every path of the chain, of one with held
    joints every path in a posture. See `by_posture`.

    Args:
        engine: that traces the paths.
        chain: whose paths they are.
        parameters: of this chain.
        posture: label of the posture that held joints are in.

    Raises:
        ValueError: a parameter changes the number of coordinates, or the machine is no serial chain.
    """

    def __init__(
        self, engine: VjmEngine, chain: Machine, parameters: Sequence[Parameter], posture: str | None = None
    ) -> None:
        if chain.is_tree:
            raise ValueError(f"{chain.name}: {NOT_SERIAL}")
        self.parameters = tuple(parameters)
        self._posture = posture
        chain = self._posed(chain)
        model = engine.model(chain)
        self._here = _Neighbour(chain, model, links_of(model))
        self._neighbours: list[tuple[_Neighbour, _Neighbour]] = []
        self._laws: list[Laws] = []
        self._width = np.array([2.0 * STEP * parameter.scale for parameter in parameters])
        self._twists = np.empty((len(self.parameters), len(self._here.links.p), 6))
        for i, parameter in enumerate(parameters):
            less, more = (
                self._neighbour(engine, parameter, parameter.value + sign * STEP * parameter.scale)
                for sign in (-1.0, 1.0)
            )
            self._neighbours.append((less, more))
            self._laws.append(Laws(less.model, more.model, self._width[i]))
            self._twists[i] = twists_between(less.links, more.links, self._here.links, self._width[i])

    def _posed(self, chain: Machine) -> Machine:
        return chain if self._posture is None else chain.at(self._posture)

    def _neighbour(self, engine: VjmEngine, parameter: Parameter, value: float) -> _Neighbour:
        nominal = self._here
        chain = self._posed(parameter.apply(nominal.chain, value))
        unmoved = chain.base is nominal.chain.base and len(chain.parts) == len(nominal.chain.parts)
        if unmoved and all(a is b for a, b in zip(chain.parts, nominal.chain.parts, strict=True)):
            return _Neighbour(chain, nominal.model, nominal.links)  # only its postures differ
        model = engine.model(chain)
        if model.size != nominal.model.size or not np.array_equal(model.passive, nominal.model.passive):
            raise ValueError(f"parameter '{parameter.name}' changes the chain's coordinates")
        return _Neighbour(chain, model, links_of(model))

    def wrench(self, path: Path) -> Array:
        """Derivatives of the wrench at every point of a path, at the same displacement from the unloaded pose.

        On the branch that the path is on: behind a bifurcation the branch's own change, which grows beyond all
        bounds towards the bifurcation.

        Returns:
            ``(points, 6, n_p)``, N and N mm per unit of the parameter.

        Raises:
            ValueError: the path is not of this engine and chain, or its load case is more than a ramp of the pose.
            numpy.linalg.LinAlgError: a point is a critical point.
        """
        ramp = self._ramp(path)
        states = [ramp.state(point) for point in path.points]
        strains = self._strains(np.array([state.reactions for state in states]))
        result = np.empty((len(states), 6, len(self.parameters)))
        for i, state in enumerate(states):
            load, gap = self._right(ramp, state, strains[i])
            u, v = state.adjoint()
            result[i] = v @ gap.T - u @ load.T
        return result

    def critical(self, path: Path) -> list[CriticalSensitivity]:
        """Derivatives of the force and the displacement of every event of a path.

        - Bifurcation: A has the null vector ``A b = 0``, and ``bᵀ A = 0`` too, since what is unsymmetric in A does
          no work on motions that leave the end-effector where it is. The eigenvalue that vanishes changes as
          ``bᵀ dA b``. The singular system has the path's derivative for its solution, which has no part in b, if
          the parameter does not load the mode, ``bᵀ ∂R/∂p = 0``: it keeps the symmetry that lets two branches
          cross. Any other one breaks the bifurcation up, and the load at which the path turns aside then changes
          by its power 2/3: there is no derivative.
        - Limit: the stiffness ``t = dF/ds`` vanishes. With d the ramp's direction, ``A b = (0; d)`` and
          ``aᵀ A = (0; d)ᵀ``, it changes as ``−aᵀ dA b``.
        - Stiffness knee: t falls through half of the unloaded stiffness, which changes with the parameters too.

        At a bifurcation the state must be symmetric but for a small amplitude of the mode, as located ones are: its
        square is the relative error (1e-7 where the solver left 3e-4).

        Raises:
            ValueError: as for `wrench`, or an event has no state.
        """
        ramp = self._ramp(path)
        return [self._at_event(ramp, event) for event in path.events]

    def _ramp(self, path: Path) -> _Ramp:
        """What the parameters do to the unloaded pose of a path."""
        nominal, load_case = self._here, path.load_case
        if not load_case.pose_only:
            raise ValueError(
                "derivatives are of ramps of the whole imposed pose only: no loads, free components, imperfections "
                "or other control than the ramp"
            )
        start = np.empty((len(self.parameters), 6))
        for i, pair in enumerate(self._neighbours):
            less, more = (
                place(n.links, n.model.configuration(n.chain.posture(load_case.posture))).end for n in pair
            )
            start[i] = displacement_between(less, more) / self._width[i]
        return _Ramp(path, nominal.model, nominal.links, start)

    def _strains(self, reactions: Array) -> Array:
        """``∂θ/∂p`` ``(k, n_p, n)`` of the springs at constant reactions ``(k, n)``, in k states at once."""
        result = np.empty((len(reactions), len(self.parameters), reactions.shape[1]))
        for i, laws in enumerate(self._laws):
            result[:, i] = laws.strains(reactions)
        return result

    def _right(self, ramp: _Ramp, state: State, strain: Array) -> tuple[Array, Array]:
        """``∂(Jᵀ F)/∂p`` ``(n_p, n)`` and ``∂(target − g)/∂p`` ``(n_p, 6)``, the springs moved by ``strain``."""
        load, end = changes(state.links, state.placed, state.at.wrench, self._twists, strain)
        turned = rotation_from_vector(ramp.path.load_case.displacement(state.s)[3:])
        start = np.hstack([ramp.start[:, :3], ramp.start[:, 3:] @ turned.T])
        return load, start - end

    def _at_event(self, ramp: _Ramp, event: Event) -> CriticalSensitivity:
        """Derivatives of one event."""
        if event.point is None:
            raise ValueError(f"the {event.kind} at {event.s:.6g} has no state to be differentiated at")
        state = ramp.state(event.point)
        reasons = [""] * len(self.parameters)
        right, strain = self._system(ramp, state)
        if event.kind is EventKind.BIFURCATION:
            mode = Mode(state)
            a = b = mode.vector
            along = mode.without(mode.solve(right) + strain)
        else:
            a, along = state.solve(ramp.load[None], transposed=True)[0], state.solve(right) + strain
            b = along[-1]
        y_p, y_s = along[:-1], along[-1]
        c_p = self._bilinear_by_parameters(state, a, b, y_p)
        h = STEP * event.s
        above, below = (_bilinear(self._here, state, change, a, b) for change in (h * y_s, -h * y_s))
        c_s = (above - below) / (2.0 * h)
        if event.kind is EventKind.BIFURCATION:
            twofold = event.multiplicity > 1 or mode.twofold
            reasons = [KINK] * len(reasons) if twofold else self._broken_symmetry(right[:-1] @ a, c_p, ramp, state)
        if event.kind is EventKind.STIFFNESS_KNEE:
            c_p = c_p - 0.5 * self._unloaded_by_parameters(ramp)
        s_p = -c_p / c_s
        force = along[:, state.at.model.size :] @ ramp.path.load_case.direction
        force_p = force[:-1] + force[-1] * s_p
        exists = np.array([not reason for reason in reasons], dtype=bool)
        return CriticalSensitivity(
            event, np.where(exists, force_p, np.nan), np.where(exists, s_p, np.nan), tuple(reasons)
        )

    def _system(self, ramp: _Ramp, state: State) -> tuple[Array, Array]:
        """Right sides ``(n_p + 1, n + 6)`` of the parameters and, last, of s; and alike what the springs move."""
        n = state.at.model.size
        strain = np.zeros((len(self.parameters) + 1, n + 6))
        strain[:-1, :n] = self._strains(state.reactions[None])[0]
        load, gap = self._right(ramp, state, np.ascontiguousarray(strain[:-1, :n]))
        return np.vstack([np.hstack([-load, gap]), ramp.load]), strain

    def _broken_symmetry(self, mode_load: Array, c_p: Array, ramp: _Ramp, state: State) -> list[str]:
        """Why a bifurcation has no derivative by a parameter that loads its mode, empty where it does not.

        Args:
            mode_load: load of the parameters on the mode ``bᵀ ∂R/∂p`` ``(n_p,)``.
            c_p: ``bᵀ A_p b`` ``(n_p,)``: what ``mode_load`` would gain with an amplitude of the mode.
            ramp: the path's.
            state: at the bifurcation.
        """
        share = np.abs(mode_load) * [p.scale for p in self.parameters]
        share /= state.s * float(np.linalg.norm(newton_scale(state.at.model) * ramp.load))
        broken = (share > SYMMETRIC) & (np.abs(mode_load) > DRIFT * np.abs(c_p))
        return [
            f"breaks the symmetry: by its scale it loads the mode with {part:.1e} of the ramp's load" if no else ""
            for part, no in zip(share, broken, strict=True)
        ]

    def _unloaded_by_parameters(self, ramp: _Ramp) -> Array:
        """``aᵀ A_p b`` ``(n_p,)`` without load, where the stiffness t changes as ``−aᵀ dA b``."""
        state = ramp.state(ramp.path.points[0])
        right, strain = self._system(ramp, state)
        along = state.solve(right) + strain
        a = state.solve(ramp.load[None], transposed=True)[0]
        return self._bilinear_by_parameters(state, a, along[-1], along[:-1])

    def _bilinear_by_parameters(self, state: State, a: Array, b: Array, y_p: Array) -> Array:
        """``aᵀ A_p b`` ``(n_p,)``, where the state changes by ``y_p`` ``(n_p, n + 6)``."""
        result = np.empty(len(self.parameters))
        for i, (less, more) in enumerate(self._neighbours):
            change = 0.5 * self._width[i] * y_p[i]
            above, below = _bilinear(more, state, change, a, b), _bilinear(less, state, -change, a, b)
            result[i] = (above - below) / self._width[i]
        return result


def _bilinear(neighbour: _Neighbour, state: State, change: Array, a: Array, b: Array) -> float:
    """``aᵀ A b`` of a model at a state changed by ``(n + 6,)``."""
    model, links, n = neighbour.model, neighbour.links, neighbour.model.size
    x, wrench = state.at.x + change[:n], state.at.wrench + change[n:]
    placed = place(links, x)
    still = np.zeros((1, len(links.p), 6))
    load, end = changes(links, placed, wrench, still, np.ascontiguousarray(b[None, :n]))
    tau = reactions(links, placed, wrench, n)
    value = a[:n] @ (load[0] + reactions(links, placed, b[n:], n)) + a[n:] @ end[0]
    for spring, where in model.blocks:
        value -= a[where] @ (spring.tangent(tau[where]) @ b[where])
    return float(value)


@dataclass(frozen=True)
class _Ramp:
    """A path, its model, and the twists ``start`` ``(n_p, 6)`` of its unloaded pose by the parameters; world."""

    path: Path
    model: Mechanism
    links: Links
    start: Array

    @property
    def load(self) -> Array:
        """``(0 ; d)`` ``(n + 6,)``: the change of the imposed pose with s."""
        return np.concatenate([np.zeros(self.model.size), self.path.load_case.direction])

    def state(self, point: Equilibrium) -> State:
        """The state of a point of the path."""
        n = self.model.size
        if len(point.state) != n + 7:
            raise ValueError(
                f"the path of {self.path.engine} is not of this engine and chain: its states have "
                f"{len(point.state)} components, not {n + 7}"
            )
        x, wrench = point.state[:n], point.state[n : n + 6]
        configuration = Configuration(self.model, x, wrench, point.residual, point.iterations)
        return State(configuration, point.s, self.links, place(self.links, configuration.x))
