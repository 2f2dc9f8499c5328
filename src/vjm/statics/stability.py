"""Stability of an equilibrium under an imposed pose.

The second variation of the energy is ``K − H`` on the motions that leave the end-effector where it is, the
null space of ``J = [J_θ J_q]``. The equilibrium is stable where it is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm.statics.equilibrium import Configuration

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


@dataclass(frozen=True)
class Stability:
    """The second variation's verdict.

    Attributes:
        eigenvalue: the smallest, or of several negative ones the one nearest zero; units of the model's energy.
        unstable: number of negative eigenvalues.
    """

    eigenvalue: float
    unstable: int


def stability(at: Configuration, device: Array | None = None) -> Stability:
    """Smallest eigenvalue and number of negative ones of the second variation on the null space of J.

    The number comes from the pivots of the factorisation. On a stable path the eigenvalue nearest zero is the
    smallest, and it is the one that passes zero at a bifurcation. Where J leaves no motion at all there is
    nothing to be unstable: nan and none.

    Loads that turn with their bodies, and moments that do not, are not conservative. With them the verdict is on
    divergence alone: real negative eigenvalues of the static tangent. The eigenvalue is then the one nearest zero,
    complex or not: its magnitude, which never jumps, negative where it is real and negative. Flutter needs masses.

    Args:
        at: an equilibrium.
        device: generalised forces ``(n,)`` of a device that holds a point where it is, one constraint more.
    """
    model = at.model
    if model.free <= 0:
        return Stability(float("nan"), 0)
    compiled = model.compiled
    if device is not None or len(model.applied_loads.turning):
        try:
            return _verdict(at, device)
        except np.linalg.LinAlgError:
            return Stability(0.0, 0)
    unstable = compiled.visit(at.x, at.wrench, at.load)
    try:
        eigenvalue = compiled.smallest(at.x, at.wrench, at.load)
    except np.linalg.LinAlgError:
        return Stability(0.0, 0)
    count = 2 * unstable
    while unstable and eigenvalue > 0.0 and count < 2 * model.size:
        # a positive one lies nearer to zero: look further
        count *= 2
        eigenvalue = float(compiled.modes(at.x, at.wrench, count, at.load)[0].min())
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


def _verdict(at: Configuration, device: Array | None) -> Stability:
    """The verdict of a constrained or unsymmetric tangent: by what is near zero, or by the whole spectrum.

    Raises:
        numpy.linalg.LinAlgError: the equilibrium is critical to the last digit.
    """
    near = at.model.compiled.near_zero(at.x, at.wrench, at.load, device)
    if near is not None:
        values, counted, odd = near
        negative = int(np.count_nonzero(_is_real(values) & (values.real < 0.0)))
        if negative == counted if counted is not None else negative % 2 == odd:
            return _of_values(values, negative, len(at.model.applied_loads.turning) > 0)
    values, _ = _spectrum(at, device)
    negative = int(np.count_nonzero(_is_real(values) & (values.real < 0.0)))
    return _of_values(values, negative, len(at.model.applied_loads.turning) > 0)


def _is_real(values: Array) -> np.ndarray:
    result: np.ndarray = np.abs(values.imag) <= REAL * np.abs(values)
    return result


def _of_values(values: Array, negative: int, turning: bool) -> Stability:
    """The verdict on eigenvalues ``(k,)``, so many of which are real and negative."""
    if turning:
        nearest = values[np.argmin(np.abs(values))]
        is_negative = nearest.real < 0.0 and abs(nearest.imag) <= REAL * abs(nearest)
        return Stability(float(-abs(nearest) if is_negative else abs(nearest)), negative)
    real = values[_is_real(values)].real
    return Stability(float(real[np.lexsort((np.abs(real), real > 0.0))][0]), negative)


def _spectrum(at: Configuration, device: Array | None) -> tuple[Array, Array]:
    """Eigenvalues ``(k,)`` and motions ``(n, k)`` of a constrained or unsymmetric tangent; complex in the latter.

    Raises:
        numpy.linalg.LinAlgError: the equilibrium is critical to the last digit.
    """
    S = at.model.compiled.inverse(at.x, at.wrench, at.load)
    whole = at.model.coordinate_scale
    moves = np.isfinite(whole)
    unit = whole[moves]
    if device is not None:
        b = device[moves] * unit
        held = S @ b
        S = S - np.outer(held, b @ S) / (b @ held)
    if len(at.model.applied_loads.turning):
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


def critical_modes(at: Configuration, device: Array | None = None) -> list[Array]:
    """Motions ``(m,)`` of the joints along which a critical point loses its stability: one, or two at once.

    Eigenvectors of the smallest eigenvalue, and of the next where it vanishes together with it (a bar that
    bends alike in both planes). Scaled by the model's coordinate units each has length one. Its sign makes the
    largest component of the deflection that it causes positive, or, where no station moves (one spring a
    link), of the motion itself.
    """
    unit = at.model.coordinate_scale
    if device is not None or len(at.model.applied_loads.turning):
        values, motions = _spectrum(at, device)
        # a complex one passes no zero at any load
        real = np.abs(values.imag) <= REAL * np.abs(values)
        values, motions = values[real].real, motions[:, real].real
        nearest = np.argsort(np.abs(values))[:3]
        values, motions = values[nearest], motions[:, nearest]
        motions = motions / np.linalg.norm(motions / unit[:, None], axis=0)
    else:
        values, motions = _nearest_modes(at)
    together = 2 if len(values) == 3 and abs(values[1]) < COINCIDENT * abs(values[2]) else 1
    modes = []
    for mode in motions.T[:together]:
        deflection = at.model.velocities(at.x, mode).ravel()
        if np.abs(deflection).max(initial=0.0) < STILL * at.model.characteristic_length:
            deflection = mode / unit
        modes.append(mode * np.sign(deflection[np.argmax(np.abs(deflection))]))
    return modes


def _nearest_modes(at: Configuration) -> tuple[Array, Array]:
    for change in NUDGES:
        # singular to the last digit: a load that differs a little has the same modes
        near = 1.0 + change
        try:
            return at.model.compiled.modes(at.x, at.wrench * near, 3, at.load * near, ROUGH)
        except np.linalg.LinAlgError:
            pass
    raise NoConvergenceError("the critical mode is lost in rounding: stiffnesses are too far apart")


def free_stability(at: Configuration) -> Stability:
    """The same verdict for an end-effector that is free under a dead wrench: nothing constrains the motions.

    Motions that cost nothing, such as a tool turning about its own joint, count as neither.
    """
    model = at.model
    unit = model.coordinate_scale
    A = (at.stiffness - at.hessian) * unit[:, None] * unit / model.wrench_scale[3]
    values = np.linalg.eigvalsh(0.5 * (A + A.T))
    felt = values[np.abs(values) > NEUTRAL * np.max(np.abs(values))]
    return Stability(float(felt[0]), int(np.count_nonzero(felt < 0.0)))
