"""Static equilibrium of a machine under an imposed pose, its stability and its stiffness: equations (5) to (18)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.mechanism import Kinematics, Mechanism
from vjm.rank import least_norm
from vjm.rotations import Array, displacement_between

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""
MAX_ITERATIONS = 30
"""Of Newton's method, after which it gives up."""


@dataclass(frozen=True)
class Configuration:
    """A state of a loaded model, in equilibrium when its residual is small.

    Attributes:
        model: a chain's or a manipulator's.
        x: joint coordinates ``(m,)``, mm and rad.
        wrench: ``(6,)`` on the end-effector, N and N mm, world axes.
        residual: largest scaled component of the equations (9) and of the pose error.
        iterations: that the solver took.
        load: factor on the model's ramped loads.
    """

    model: Mechanism
    x: Array
    wrench: Array
    residual: float
    iterations: int
    load: float = 0.0

    @cached_property
    def kinematics(self) -> Kinematics:
        """Geometry and Jacobian at ``x``, of a chain."""
        return self.model.kinematics(self.x)

    @cached_property
    def stiffness(self) -> Array:
        """Tangent stiffness ``(n, n)`` of a chain's springs, zero on the passive joints."""
        return self.model.stiffness_under(self.model.reactions(self.kinematics, self.wrench))

    @cached_property
    def hessian(self) -> Array:
        """Of a chain, ``H = ∂(Jᵀ F)/∂x`` ``(m, m)`` at constant wrench."""
        return self.kinematics.force_hessian(self.wrench)


def residual(model: Mechanism, x: Array, wrench: Array, target: Array) -> tuple[Kinematics, Array, Array]:
    """Residuals of statics and geometry.

    Args:
        model: the lumped model.
        x: joint coordinates ``(m,)``.
        wrench: ``(6,)`` N, N mm.
        target: end-effector frame ``(4, 4)``.

    Returns:
        The kinematics at ``x``; ``Jᵀ F − K θ`` ``(n,)``, eq. (9), zero at equilibrium; the displacement
        ``(6,)`` still missing to the target.
    """
    k = model.kinematics(x)
    return k, statics_residual(model, k, x, wrench), displacement_between(k.end, target)


def statics_residual(model: Mechanism, k: Kinematics, x: Array, wrench: Array) -> Array:
    """``Jᵀ F − K θ`` ``(n,)``, eq. (9); ``K (θ(Jᵀ F) − θ)`` with the tangent stiffness where a law is nonlinear."""
    reactions = model.reactions(k, wrench)
    passive = np.zeros(model.size)
    passive[model.passive] = reactions[model.passive]
    sprung = model.strain(reactions) - x
    sprung[model.passive] = 0.0
    return passive + model.stiffness_under(reactions) @ sprung


def scaled_norm(model: Mechanism, statics: Array, gap: Array, wrench: Array) -> float:
    """Largest component of the residuals ``(m,)`` and ``(6,)``, made dimensionless by the model's scales.

    Under a wrench of more than one unit it is relative to that wrench, as rounding is.
    """
    energy = model.wrench_scale[3]
    largest = max(np.abs(statics * model.coordinate_scale).max(), np.abs(gap * model.wrench_scale).max())
    return float(largest / energy / max(1.0, np.abs(wrench / model.wrench_scale).max()))


def newton_scale(model: Mechanism) -> Array:
    """Units of the unknowns ``(m + 6,)`` over the square root of the energy unit.

    Scaled by them from both sides, the tangent is dimensionless.
    """
    root_energy = np.sqrt(model.wrench_scale[3])
    return np.concatenate([model.coordinate_scale, model.wrench_scale]) / root_energy


def solve_newton(
    model: Mechanism,
    target: Array,
    x: Array,
    wrench: Array,
    *,
    load: float = 0.0,
    max_iterations: int = MAX_ITERATIONS,
) -> Configuration:
    """Equilibrium at an imposed pose by full Newton-Raphson.

    Args:
        model: a chain's or a manipulator's.
        target: end-effector frame ``(4, 4)`` to be held, mm.
        x: joint coordinates ``(m,)`` to start from.
        wrench: ``(6,)`` to start from.
        load: factor on the model's ramped loads.
        max_iterations: after which it gives up.

    Raises:
        NoConvergenceError: the scaled residual did not fall below `TOLERANCE`.
    """
    x, wrench, error, iterations, failure = model.compiled.newton(
        target, x, wrench, load, TOLERANCE, max_iterations
    )
    if failure:
        raise NoConvergenceError(f"Newton stopped {failure} at a scaled residual of {error:.1e}")
    return Configuration(model, x, wrench, error, iterations, load)


def solve_under_wrench(model: Mechanism, wrench: Array, x: Array, *, max_iterations: int = 60) -> Configuration:
    """Equilibrium of the free end-effector under a dead wrench: the converse of an imposed pose.

    Newton-Raphson on ``Jᵀ F = K x``. A single chain resists only wrenches that leave its passive joints
    without torque. Under any other it moves until they do. Motions that the wrench does not see (a tool that
    turns about its own joint) stay where they are: steps are the shortest that solve the equations.

    Args:
        model: the lumped model.
        wrench: ``(6,)`` N, N mm, fixed in the world.
        x: joint coordinates ``(m,)`` to start from.
        max_iterations: after which it gives up.

    Raises:
        NoConvergenceError: the chain found no position in which it balances the wrench.
    """
    scale = newton_scale(model)[: model.size]
    root_energy = np.sqrt(model.wrench_scale[3])
    for iteration in range(max_iterations + 1):
        k = model.kinematics(x)
        statics = statics_residual(model, k, x, wrench)
        error = scaled_norm(model, statics, np.zeros(6), wrench)
        if error < TOLERANCE:
            return Configuration(model, x, wrench, error, iteration)
        K = model.stiffness_under(model.reactions(k, wrench))
        A = (k.force_hessian(wrench) - K) * scale[:, None] * scale
        step = least_norm(A[None], -(statics * scale)[None])[0] / root_energy
        # a swinging chain goes in steps of at most a third of a radian
        step *= min(1.0, 0.3 / max(float(np.max(np.abs(step))), 1e-300))
        x = x + model.coordinate_scale * step
    raise NoConvergenceError(
        f"the chain did not balance this wrench within {max_iterations} iterations (scaled residual {error:.1e})"
    )


NO_MOTION = 1e-13
"""Motion that controls a path, over the sum of its terms' sizes: rounding."""
NEUTRAL = 1e-12
"""Eigenvalues below this fraction of the largest are zero but for rounding."""
ROUGH = 1e-4
"""Of eigenvalues of which one or two vanish: enough to tell how many; their motions are far better by then."""
NUDGES = (0.0, 1e-10, 1e-8, 1e-6)
"""Relative changes of the load, one of which makes a critical state regular enough to look for its modes."""
REAL = 1e-7
"""Imaginary part, over the magnitude, up to which an eigenvalue is real: two that nearly meet split by the root of
rounding."""
STILL = 1e-6
"""Deflection of a unit mode, over the characteristic length, below which the stations do not move."""
COINCIDENT = 1e-3
"""Two eigenvalues vanish together where the second is below this fraction of the third."""
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Stability:
    """The second variation's verdict.

    Attributes:
        eigenvalue: the smallest, or of several negative ones the one nearest zero; units of the model's energy.
        unstable: number of negative eigenvalues.
    """

    eigenvalue: float
    unstable: int


def stability(state: Configuration, device: Array | None = None) -> Stability:
    """Smallest eigenvalue and number of negative ones of the second variation on the null space of J.

    The number comes from the pivots of the factorisation. On a stable path the eigenvalue nearest zero is the
    smallest, and it is the one that passes zero at a bifurcation. Where J leaves no motion at all there is
    nothing to be unstable: nan and none.

    Loads that turn with their bodies, and moments that do not, are not conservative. With them the verdict is on
    divergence alone: real negative eigenvalues of the static tangent. The eigenvalue is then the one nearest zero,
    complex or not: its magnitude, which never jumps, negative where it is real and negative. Flutter needs masses.

    Args:
        state: an equilibrium.
        device: generalised forces ``(n,)`` of a device that holds a point where it is, one constraint more.
    """
    model = state.model
    if model.free <= 0:
        return Stability(float("nan"), 0)
    compiled = model.compiled
    if device is not None or len(model.applied_loads.turning):
        try:
            return _verdict(state, device)
        except np.linalg.LinAlgError:
            return Stability(0.0, 0)
    unstable = compiled.factorise(state.x, state.wrench, state.load)
    try:
        eigenvalue = compiled.smallest(state.x, state.wrench, state.load)
    except np.linalg.LinAlgError:
        return Stability(0.0, 0)
    count = 2 * unstable
    while unstable and eigenvalue > 0.0 and count < 2 * model.size:
        # a positive one lies nearer to zero: look further
        count *= 2
        eigenvalue = float(compiled.modes(state.x, state.wrench, count, state.load)[0].min())
    return Stability(eigenvalue, unstable)


def without_neutral(negative: int, neutral: int, conservative: bool) -> int:
    """Number of negative eigenvalues without those that are negative by rounding only.

    Without a potential the determinant decides. Where it has the sign of the unloaded one, negative eigenvalues
    come in pairs, however small one of a pair is: none is rounding. A cantilever that a moment of fixed direction
    rolls up is such: its determinant never vanishes, while one of two negative eigenvalues all but does.

    Args:
        negative: how many are negative.
        neutral: how many of them are within rounding of zero.
        conservative: whether all loads have a potential.
    """
    if conservative or negative % 2:
        return negative - neutral
    return negative


def _verdict(state: Configuration, device: Array | None) -> Stability:
    """The verdict of a constrained or unsymmetric tangent: by what is near zero, or by the whole spectrum.

    Raises:
        numpy.linalg.LinAlgError: the equilibrium is critical to the last digit.
    """
    near = state.model.compiled.near_zero(state.x, state.wrench, state.load, device)
    if near is not None:
        values, counted, odd = near
        negative = int(np.count_nonzero(_is_real(values) & (values.real < 0.0)))
        if negative == counted if counted is not None else negative % 2 == odd:
            return _of_values(values, negative, len(state.model.applied_loads.turning) > 0)
    values, _ = _spectrum(state, device)
    negative = int(np.count_nonzero(_is_real(values) & (values.real < 0.0)))
    return _of_values(values, negative, len(state.model.applied_loads.turning) > 0)


def _is_real(values: Array) -> np.ndarray:
    return np.abs(values.imag) <= REAL * np.abs(values)


def _of_values(values: Array, negative: int, turning: bool) -> Stability:
    """The verdict on eigenvalues ``(k,)``, so many of which are real and negative."""
    if turning:
        nearest = values[np.argmin(np.abs(values))]
        is_negative = nearest.real < 0.0 and abs(nearest.imag) <= REAL * abs(nearest)
        return Stability(float(-abs(nearest) if is_negative else abs(nearest)), negative)
    real = values[_is_real(values)].real
    return Stability(float(real[np.lexsort((np.abs(real), real > 0.0))][0]), negative)


def _spectrum(state: Configuration, device: Array | None) -> tuple[Array, Array]:
    """Eigenvalues ``(k,)`` and motions ``(n, k)`` of a constrained or unsymmetric tangent; complex in the latter.

    Raises:
        numpy.linalg.LinAlgError: the equilibrium is critical to the last digit.
    """
    S = state.model.compiled.inverse(state.x, state.wrench, state.load)
    whole = state.model.coordinate_scale
    moves = np.isfinite(whole)
    unit = whole[moves]
    if device is not None:
        b = device[moves] * unit
        held = S @ b
        S = S - np.outer(held, b @ S) / (b @ held)
    if len(state.model.applied_loads.turning):
        inverse, V = np.linalg.eig(S)
    else:
        inverse, V = np.linalg.eigh(0.5 * (S + S.T))
    # what the constraints take away has an inverse of zero
    felt = np.abs(inverse) > NEUTRAL * np.abs(inverse).max()
    values = 1.0 / inverse[felt]
    if not len(values) or not np.all(np.isfinite(values)):
        raise np.linalg.LinAlgError("the equilibrium is singular to the last digit")
    motions = np.zeros((len(whole), len(values)), dtype=V.dtype)
    motions[moves] = V[:, felt] * unit[:, None]
    return values, motions


def critical_modes(state: Configuration, device: Array | None = None) -> list[Array]:
    """Motions ``(m,)`` of the joints along which a critical point loses its stability: one, or two at once.

    Eigenvectors of the smallest eigenvalue, and of the next where it vanishes together with it (a bar that
    bends alike in both planes). Scaled by the model's coordinate units each has length one. Its sign makes the
    largest component of the deflection that it causes positive, or, where no station moves (one spring a
    link), of the motion itself.
    """
    unit = state.model.coordinate_scale
    if device is not None or len(state.model.applied_loads.turning):
        values, motions = _spectrum(state, device)
        # a complex one passes no zero at any load
        real = np.abs(values.imag) <= REAL * np.abs(values)
        values, motions = values[real].real, motions[:, real].real
        nearest = np.argsort(np.abs(values))[:3]
        values, motions = values[nearest], motions[:, nearest]
        motions = motions / np.linalg.norm(motions / unit[:, None], axis=0)
    else:
        values, motions = near_critical(
            state, lambda near: near.model.compiled.modes(near.x, near.wrench, 3, near.load, ROUGH)
        )
    together = 2 if len(values) == 3 and abs(values[1]) < COINCIDENT * abs(values[2]) else 1
    modes = []
    for mode in motions.T[:together]:
        deflection = state.model.velocities(state.x, mode).ravel()
        if np.abs(deflection).max(initial=0.0) < STILL * state.model.characteristic_length:
            deflection = mode / unit
        modes.append(mode * np.sign(deflection[np.argmax(np.abs(deflection))]))
    return modes


def near_critical(state: Configuration, ask: Callable[[Configuration], Answer]) -> Answer:
    """What is asked of a critical state, or of one whose load differs a little where that is singular.

    Raises:
        NoConvergenceError: neither has an answer.
    """
    for change in NUDGES:
        with suppress(np.linalg.LinAlgError):
            return ask(replace(state, wrench=state.wrench * (1.0 + change), load=state.load * (1.0 + change)))
    raise NoConvergenceError("the critical mode is lost in rounding: stiffnesses are too far apart")


def free_stability(state: Configuration) -> Stability:
    """The same verdict for an end-effector that is free under a dead wrench: nothing constrains the motions.

    Motions that cost nothing, such as a tool turning about its own joint, count as neither.
    """
    model = state.model
    unit = model.coordinate_scale
    A = (state.stiffness - state.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    values = np.linalg.eigvalsh(0.5 * (A + A.T))
    felt = values[np.abs(values) > NEUTRAL * np.max(np.abs(values))]
    return Stability(float(felt[0]), int(np.count_nonzero(felt < 0.0)))


def unloaded_stiffness(model: Mechanism, q: Array) -> Array:
    """Stiffness ``K`` ``(6, 6)`` of (5) at the passive coordinates ``q`` (n_q,), no load.

    Its rank is what the passive joints leave of six; N/mm, N, N mm.
    """
    return loaded_stiffness(Configuration(model, model.configuration(q), np.zeros(6), 0.0, 0))


def loaded_stiffness(state: Configuration) -> Array:
    """Stiffness ``K^F`` ``(6, 6)`` of (18) at a loaded equilibrium.

    The upper-left block of the inverse of

        [ J_θ k J_θᵀ          J_q + J_θ k H_θq    ]
        [ J_qᵀ + H_qθ k J_θᵀ  H_qq + H_qθ k H_θq  ],   k = (K_θ − H_θθ)⁻¹.

    It maps a displacement of the end-effector (shift and rotation vector, world axes) to the change of a
    wrench that is counted in world axes. A moment fixed in the world is not conservative, so that K^F is
    slightly asymmetric where moments act. It is singular by the passive joints, and is never inverted. The
    matrix is condensed spring by spring, see `vjm.kernels.elimination`.

    Returns:
        ``(6, 6)`` in N/mm, N, N mm.

    Raises:
        numpy.linalg.LinAlgError: the state is a critical point.
    """
    return state.model.compiled.end_stiffness(state.x, state.wrench, state.load)
