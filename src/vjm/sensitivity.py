"""Derivatives of wrenches and of critical points with respect to a chain's parameters.

With ``y = (x, F)`` the joint coordinates and the wrench, an equilibrium at the imposed pose of path parameter s is

    R(y, s, p) = ( Jᵀ F − K θ ;  target(s, p) − g(x, p) ) = 0,    A = [H − K, Jᵀ; J, 0],

with A the tangent of Newton's method, and its derivative by a parameter p follows from the implicit function
theorem, ``A ∂y/∂p = (−∂(Jᵀ F − K θ)/∂p ; ∂(target − g)/∂p)``, on the right at constant x and F. The unloaded pose,
from which the imposed displacement is counted, changes with the geometry.

A critical point is where a number ``c(y, s, p)`` vanishes along the path. For each kind its change is ``aᵀ dA b``
(see `critical_sensitivity`), so that

    ds/dp = −(aᵀ A_p b) / (aᵀ A_s b),    dF/dp = ∂F/∂p + ∂F/∂s ds/dp,

where A_p and A_s are the derivatives of A along the path's own motion: y changes with it.

A parameter reaches R in two ways: it moves the rigid pieces between the joints, each by a twist, whose effect on g
and Jᵀ F is exact; and it changes the springs' laws ``θ(τ)``. These twists and laws, and A along a motion, are
differentiated by central differences over `STEP` of the parameter's scale, of the explicit functions and not of the
solver. Wrenches agree with differences of whole solutions to 1e-6, mostly to 1e-9, and critical points to 1e-6. The
cost is one factorisation a point, whatever the number of parameters, and at a critical point two evaluations of A
besides for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve, svd

from vjm.chain import Chain
from vjm.equilibrium import Configuration, newton_matrix, newton_scale
from vjm.lumped import LumpedModel
from vjm.parameters import Parameter
from vjm.paths import Equilibrium, Event, EventKind, Path
from vjm.rotations import Array, displacement_between, rotation_from_vector
from vjm.springs import BeamColumnSpring, Spring
from vjm.vjm_engine import LumpedProblem, VjmEngine

STEP = 1e-5
"""Half the width of a difference over the parameter's scale: near the cube root of rounding, the best of it."""
SYMMETRIC = 1e-7
"""A parameter keeps the symmetry if its scale loads the critical mode by less than this fraction of the ramp."""
DRIFT = 0.03
"""Nor does it break the symmetry if this amplitude of the mode, or less, in an inexact state accounts for its load.

Near a bifurcation a solver leaves up to 3e-4 of the mode, which has length one in scaled units; a parameter that
breaks the symmetry acts on the mode by hardly more than its load, and would need an amplitude far above one.
"""
TWOFOLD = 1e-4
"""Two singular values of the tangent vanish together where the second is below this fraction of the third."""
KINK = "two modes become unstable together: which of them is first has a kink here"


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


def wrench_sensitivity(engine: VjmEngine, chain: Chain, path: Path, parameters: Sequence[Parameter]) -> Array:
    """Derivatives of the wrench at every point of a path, at the same displacement from the unloaded pose.

    On the branch that the path is on: behind a bifurcation the branch's own change, which grows beyond all bounds
    towards the bifurcation.

    Args:
        engine: that walked the path.
        chain: that it walked.
        path: its equilibria.
        parameters: of this chain.

    Returns:
        ``(points, 6, n_p)``, N and N mm per unit of the parameter.

    Raises:
        ValueError: the path is not of this engine and chain, or a parameter changes the number of coordinates.
        numpy.linalg.LinAlgError: a point is a critical point.
    """
    family = _Family(engine, chain, path, parameters)
    result = np.empty((len(path.points), 6, len(parameters)))
    states = [family.configuration(point) for point in path.points]
    strains = family.strains(np.array([at.model.reactions(at.kinematics, at.wrench) for at in states]))
    for i, at in enumerate(states):
        result[i] = _Tangent(at).solve(family.load(at, path.points[i].s, strains[i]))[at.model.size :]
    return result


def critical_sensitivity(
    engine: VjmEngine, chain: Chain, path: Path, parameters: Sequence[Parameter]
) -> list[CriticalSensitivity]:
    """Derivatives of the force and the displacement of every event of a path.

    - Bifurcation: A has the null vectors ``aᵀ A = 0`` and ``A b = 0``, and the eigenvalue that vanishes changes as
      ``aᵀ dA b``. The singular system has the path's derivative for its solution, which has no part in b, if the
      parameter does not load the mode, ``aᵀ ∂R/∂p = 0``: it keeps the symmetry that lets two branches cross. Any
      other one breaks the bifurcation up, and the load at which the path turns aside then changes by its power 2/3:
      there is no derivative.
    - Limit: the stiffness ``t = dF/ds`` vanishes. With d the ramp's direction, ``A b = (0; d)`` and
      ``aᵀ A = (0; d)ᵀ``, it changes as ``−aᵀ dA b``.
    - Bend-over: t falls through half of the unloaded stiffness, which changes with the parameters likewise.

    At a bifurcation the state must be symmetric but for a small amplitude of the mode, as located ones are: its
    square is the relative error (1e-7 where the solver left 3e-4).

    Args:
        engine: that walked the path.
        chain: that it walked.
        path: with its events, each with its state.
        parameters: of this chain.

    Raises:
        ValueError: the path is not of this engine and chain, an event has no state, or a parameter changes the
            number of coordinates.
    """
    family = _Family(engine, chain, path, parameters)
    return [family.at_event(event) for event in path.events]


class _Family:
    """A problem and its neighbours: each parameter a little less and a little more than it is."""

    def __init__(self, engine: VjmEngine, chain: Chain, path: Path, parameters: Sequence[Parameter]) -> None:
        self.path = path
        self.parameters = parameters
        self.problem = LumpedProblem(engine.model(chain), path.programme, engine.label)
        model = self.problem.model

        self.neighbours: list[tuple[LumpedProblem, LumpedProblem]] = []
        for parameter in parameters:
            h = STEP * parameter.scale
            less, more = (
                LumpedProblem(engine.model(parameter.apply(chain, value)), path.programme, engine.label)
                for value in (parameter.value - h, parameter.value + h)
            )
            for changed in (less.model, more.model):
                if changed.size != model.size or not np.array_equal(changed.passive, model.passive):
                    raise ValueError(f"parameter '{parameter.name}' changes the chain's coordinates")
            self.neighbours.append((less, more))
        self.motions = [_Motion(p, model, *pair) for p, pair in zip(parameters, self.neighbours, strict=True)]

    def configuration(self, point: Equilibrium) -> Configuration:
        """The state of a point of the path."""
        if len(point.state) != self.problem.model.size + 6:
            raise ValueError(
                f"the path of {self.path.engine} is not of this engine and chain: its states have "
                f"{len(point.state)} components, not {self.problem.model.size + 6}"
            )
        return self.problem.configuration(point)

    def strains(self, reactions: Array) -> Array:
        """``∂θ/∂p`` ``(k, m, n_p)`` of the springs at constant reactions ``(k, m)``, in k states at once."""
        result = np.zeros((*reactions.shape, len(self.parameters)))
        model = self.problem.model
        ends = np.cumsum([len(spring.unloaded) for spring in model.springs])
        places = np.split(model.elastic, ends[:-1])
        for i, (parameter, (less, more)) in enumerate(zip(self.parameters, self.neighbours, strict=True)):
            # the segments of a beam have one law
            alike: dict[object, tuple[Spring, Spring, list[Array]]] = {}
            for a, b, place in zip(less.model.springs, more.model.springs, places, strict=True):
                if not _same_law(a, b):
                    key = (a, b) if isinstance(a, BeamColumnSpring) else id(a)
                    alike.setdefault(key, (a, b, []))[2].append(place)
            for a, b, where in alike.values():
                index = np.array(where)
                tau = reactions[:, index].reshape(-1, index.shape[1]).T
                change = (b.strain(tau) - a.strain(tau)) / (2.0 * STEP * parameter.scale)
                result[:, index, i] = change.T.reshape(len(reactions), *index.shape)
        return result

    def load(self, at: Configuration, s: float, strain: Array | None = None) -> Array:
        """``(−∂(Jᵀ F − K θ)/∂p ; ∂(target − g)/∂p)`` ``(m + 6, n_p)`` at constant x and F.

        In equilibrium ``K (θ(τ) − θ)`` changes by ``dτ + K ∂θ/∂p``, since ``K dθ(τ) = dτ``: K itself stays.

        Args:
            at: the state.
            s: path parameter there.
            strain: ``∂θ/∂p`` ``(m, n_p)`` of the springs, where known already.
        """
        m, k = at.model.size, at.kinematics
        if strain is None:
            strain = self.strains(at.model.reactions(k, at.wrench)[None])[0]
        result = np.empty((m + 6, len(self.parameters)))
        turned = rotation_from_vector(self.path.programme.displacement(s)[3:])
        for i, motion in enumerate(self.motions):
            reactions, end = motion.apply(at)
            result[:m, i] = -reactions
            result[m:, i] = np.concatenate([motion.start[:3], turned @ motion.start[3:]]) - end
        result[:m] -= at.stiffness @ strain
        return result

    def ramp(self, at: Configuration) -> Array:
        """``(0 ; d)`` ``(m + 6,)``: the change of the imposed pose with s."""
        return np.concatenate([np.zeros(at.model.size), self.path.programme.direction])

    def at_event(self, event: Event) -> CriticalSensitivity:
        """Derivatives of one event."""
        if event.point is None:
            raise ValueError(f"the {event.kind} at {event.s:.6g} has no state to be differentiated at")
        at = self.configuration(event.point)
        load, ramp = self.load(at, event.s), self.ramp(at)
        reasons = [""] * len(self.parameters)
        if event.kind is EventKind.BIFURCATION:
            critical = _CriticalTangent(at)
            a, b = critical.left, critical.right
            along = critical.solve(np.column_stack([load, ramp]))
        else:
            tangent = _Tangent(at)
            along = tangent.solve(np.column_stack([load, ramp]))
            a, b = tangent.solve(ramp, transposed=True), along[:, -1]
        y_p, y_s = along[:, :-1], along[:, -1]
        c_p = self.bilinear_by_parameters(at, a, b, y_p)
        c_s = self.bilinear_by_s(at, event.s, a, b, y_s)
        if event.kind is EventKind.BIFURCATION:
            twofold = event.multiplicity > 1 or critical.twofold
            reasons = [KINK] * len(reasons) if twofold else self.broken_symmetry(a @ load, c_p, ramp, event.s, at)
        if event.kind is EventKind.BEND_OVER:
            c_p = c_p - 0.5 * self.unloaded_by_parameters()
        s_p = -c_p / c_s
        wrench_p = y_p[at.model.size :] + y_s[at.model.size :, None] * s_p
        force_p = self.path.programme.direction @ wrench_p
        exists = np.array([not reason for reason in reasons], dtype=bool)
        return CriticalSensitivity(
            event, np.where(exists, force_p, np.nan), np.where(exists, s_p, np.nan), tuple(reasons)
        )

    def broken_symmetry(self, mode_load: Array, c_p: Array, ramp: Array, s: float, at: Configuration) -> list[str]:
        """Why a bifurcation has no derivative by a parameter that loads its mode, empty where it does not.

        Args:
            mode_load: load of the parameters on the mode ``aᵀ ∂R/∂p`` ``(n_p,)``.
            c_p: ``aᵀ A_p b`` ``(n_p,)``: what ``mode_load`` would gain with an amplitude of the mode.
            ramp: load of the ramp ``(m + 6,)``.
            s: path parameter at the bifurcation.
            at: the state there.
        """
        share = np.abs(mode_load) * [p.scale for p in self.parameters]
        share /= s * float(np.linalg.norm(newton_scale(at.model) * ramp))
        broken = (share > SYMMETRIC) & (np.abs(mode_load) > DRIFT * np.abs(c_p))
        return [
            f"breaks the symmetry: by its scale it loads the mode with {part:.1e} of the ramp's load" if no else ""
            for part, no in zip(share, broken, strict=True)
        ]

    def unloaded_by_parameters(self) -> Array:
        """``aᵀ A_p b`` ``(n_p,)`` without load, where the stiffness t changes as ``−aᵀ dA b``."""
        start = self.path.points[0]
        at = self.configuration(start)
        tangent, ramp = _Tangent(at), self.ramp(at)
        along = tangent.solve(np.column_stack([self.load(at, start.s), ramp]))
        a, b = tangent.solve(ramp, transposed=True), along[:, -1]
        return self.bilinear_by_parameters(at, a, b, along[:, :-1])

    def bilinear_by_parameters(self, at: Configuration, a: Array, b: Array, y_p: Array) -> Array:
        """``aᵀ A_p b`` ``(n_p,)``, where the state changes by the columns of ``y_p`` ``(m + 6, n_p)``."""
        result = np.empty(len(self.parameters))
        for i, (parameter, (less, more)) in enumerate(zip(self.parameters, self.neighbours, strict=True)):
            h = STEP * parameter.scale
            change = h * y_p[:, i]
            above, below = _bilinear(more.model, at, change, a, b), _bilinear(less.model, at, -change, a, b)
            result[i] = (above - below) / (2.0 * h)
        return result

    def bilinear_by_s(self, at: Configuration, s: float, a: Array, b: Array, y_s: Array) -> float:
        """``aᵀ A_s b``, where the state changes by ``y_s`` ``(m + 6,)``."""
        h = STEP * s
        return (_bilinear(at.model, at, h * y_s, a, b) - _bilinear(at.model, at, -h * y_s, a, b)) / (2.0 * h)


def _same_law(a: Spring, b: Spring) -> bool:
    """Whether two springs of one kind have one law."""
    if isinstance(a, BeamColumnSpring):
        return a == b
    return np.array_equal(a.unloaded, b.unloaded)


class _Motion:
    """How a parameter moves the rigid pieces of a chain, per unit of the parameter.

    The transform ``(4, 4)`` before each joint, and the one behind the last, changes by a twist of its far end, in
    that end's axes. An axis that turns by δ is one that turns with what is behind it, which turns back by δ.

    Attributes:
        start: twist ``(6,)`` of the unloaded pose, world axes.
    """

    def __init__(self, parameter: Parameter, model: LumpedModel, less: LumpedProblem, more: LumpedProblem) -> None:
        width = 2.0 * STEP * parameter.scale
        self.start = displacement_between(less.target(0.0), more.target(0.0)) / width
        self._pieces = np.concatenate([model.before, model.tail[None]])
        R = self._pieces[:, :3, :3].transpose(0, 2, 1)
        d = (
            np.concatenate([more.model.before - less.model.before, (more.model.tail - less.model.tail)[None]])
            / width
        )
        spin = R @ d[:, :3, :3]
        self._turn = 0.5 * np.stack([spin[:, k, j] - spin[:, j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=1)
        self._shift = np.einsum("jab,jb->ja", R, d[:, :3, 3])
        self._back = np.cross(model.axis, (more.model.axis - less.model.axis) / width)
        self._turn[:-1] += self._back
        self._still = not (self._turn.any() or self._shift.any())

    def apply(self, at: Configuration) -> tuple[Array, Array]:
        """Changes of the reactions ``Jᵀ F`` ``(m,)`` and of the end-effector's pose ``(6,)`` at constant x and F.

        As in `Kinematics.force_hessian`: a motion before a joint turns its column as a whole, one behind it moves
        the end of its lever.
        """
        k = at.kinematics
        if self._still:
            return np.zeros(at.model.size), np.zeros(6)
        frames = k.behind @ self._pieces
        turn = np.einsum("jab,jb->ja", frames[:, :3, :3], self._turn)
        shift = np.einsum("jab,jb->ja", frames[:, :3, :3], self._shift)
        shift += np.cross(turn, k.end[:3, 3] - frames[:, :3, 3])
        back = -np.einsum("jab,jb->ja", k.behind[1:, :3, :3], self._back)
        turn[1:] += back
        shift[1:] += np.cross(back, k.end[:3, 3] - k.behind[1:, :3, 3])
        turned, shifted = np.cumsum(turn, axis=0), np.cumsum(shift, axis=0)
        force, moment = at.wrench[:3], at.wrench[3:]
        tau = np.cross(turned[:-1], k.joint_jacobian[:3].T) @ force
        about = np.cross(turned[:-1], k.axes) @ moment + np.cross(k.axes, shifted[-1] - shifted[:-1]) @ force
        tau += np.where(k.rotary, about, 0.0)
        return k.drive.T @ tau, np.concatenate([shifted[-1], turned[-1]])


def _bilinear(model: LumpedModel, at: Configuration, change: Array, a: Array, b: Array) -> float:
    """``aᵀ A b`` of a model at the state ``at`` changed by ``(m + 6,)``."""
    state = np.concatenate([at.x, at.wrench]) + change
    x, wrench = state[: model.size], state[model.size :]
    scale = newton_scale(model)
    return float((a / scale) @ newton_matrix(model, model.kinematics(x), wrench) @ (b / scale))


class _Tangent:
    """``A`` at a regular equilibrium, factorised."""

    def __init__(self, at: Configuration) -> None:
        self._scale = newton_scale(at.model)
        lu, pivots = lu_factor(newton_matrix(at.model, at.kinematics, at.wrench))
        if np.abs(np.diag(lu)).min() == 0.0:
            raise np.linalg.LinAlgError("the tangent is singular: a critical point")
        self._factors = lu, pivots

    def solve(self, right: Array, *, transposed: bool = False) -> Array:
        """``A⁻¹ r`` or ``A⁻ᵀ r`` for ``(m + 6,)`` or ``(m + 6, k)``."""
        scale = self._scale if right.ndim == 1 else self._scale[:, None]
        return scale * lu_solve(self._factors, scale * right, trans=1 if transposed else 0)


class _CriticalTangent:
    """``A`` at a bifurcation, where it is singular in one direction.

    Attributes:
        left: null vector a ``(m + 6,)``, ``aᵀ A = 0``.
        right: null vector b ``(m + 6,)``, ``A b = 0``.
        twofold: whether there is a second pair.
    """

    def __init__(self, at: Configuration) -> None:
        self._scale = newton_scale(at.model)
        U, values, Vt = svd(newton_matrix(at.model, at.kinematics, at.wrench))
        self._left, self._values, self._right = U[:, :-1], values[:-1], Vt[:-1].T
        self.left = self._scale * U[:, -1]
        self.right = self._scale * Vt[-1]
        # the last is zero but for how well the event was located: see whether the one before it is, too
        self.twofold = bool(values[-2] < TWOFOLD * values[-3])

    def solve(self, right: Array) -> Array:
        """The solution ``(m + 6, k)`` without a part in b, in scaled units, of ``A y = r`` without its part in a.

        The same as that of the regular system that a and b border.
        """
        scale = self._scale[:, None]
        solution: Array = self._right @ ((self._left.T @ (scale * right)) / self._values[:, None])
        return scale * solution
