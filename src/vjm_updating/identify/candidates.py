"""Uniform beams as points of a space in which a compliance matrix can be fitted.

A uniform beam's compliance is diagonal at its middle, in its section's axes. So a beam is a rotation R to those
axes, an arm p from its middle to the tip, and the diagonal:

    D = diag(a, L² c_z/12 + s_y, L² c_y/12 + s_z, t, c_y, c_z),    C = G D Gᵀ,  G = [R, −p̃ R; 0, R]

with a = L/EA, t = L/GJ, c = L/EI and s = L/GA. Straight means p = ½ L R e_x; a rigid offset at the end adds to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vjm.model.parts import Beam, Section
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import definition, numerical

Numbers = NDArray[Any]
"""An array of real numbers, or of complex ones for derivatives."""
UPPER = definition(np.triu_indices(6))
"""The 21 entries of a symmetric matrix, row by row."""
COMPLEX_STEP = numerical(1e-30)
UNSEEN = numerical(1e-3)
"""Share of the smallest rounding half-width below which a compliance counts as none: no entry shows it."""
AT_THE_BOUND = numerical(0.7)
"""Logarithm over its lower bound up to which an optimiser has left a coordinate there."""


class Form(StrEnum):
    """What kind of beam."""

    STRAIGHT = "straight"
    """Straight, rigid in shear."""
    SHEARED = "straight, with shear"
    OFFSET = "with a rigid offset at its end"
    """Rigid in shear: with the offset free, its length and its two shear stiffnesses answer two entries only."""


@dataclass(frozen=True)
class Target:
    """A symmetric compliance to fit.

    Attributes:
        matrix: ``(6, 6)``, mm, N, rad.
        half: ``(6, 6)`` half the interval for which each entry stands; infinite where an entry is left out.
    """

    matrix: Array
    half: Array

    @cached_property
    def middle(self) -> Array:
        """Arm ``(3,)`` from the elastic centre to the tip: C_uφ C_φφ⁻¹ = −p̃, as nearly as it is skew."""
        S = self.matrix[:3, 3:] @ np.linalg.inv(self.matrix[3:, 3:])
        return 0.5 * np.array([S[1, 2] - S[2, 1], S[2, 0] - S[0, 2], S[0, 1] - S[1, 0]])

    @cached_property
    def size(self) -> float:
        """A length in mm that goes with the matrix: of a cantilever it is L/√3."""
        return float(np.sqrt(np.trace(self.matrix[:3, :3]) / np.trace(self.matrix[3:, 3:])))


@dataclass(frozen=True)
class Space:
    """The beams of one form, as vectors: turn (3), ln L, offset over size (3), ln a, t, c_y, c_z, ln s_y, s_z.

    Attributes:
        target: what they are measured against.
        form: of the beams.
        axes: rotation ``(3, 3)`` to the section's axes from which the turn counts.
    """

    target: Target
    form: Form
    axes: Array

    @property
    def _offsets(self) -> int:
        return 3 if self.form is Form.OFFSET else 0

    @cached_property
    def _least(self) -> Array:
        """Smallest shift by a force and turn by a moment ``(2,)`` that are looked for."""
        result: Array = UNSEEN * np.min(np.diag(self.target.half).reshape(2, 3), axis=1)
        return result

    def shows(self, compliance: float, *, turn: bool) -> bool:
        """Whether some entry tells a compliance, shift by force or turn by moment, from none."""
        return bool(compliance > np.exp(AT_THE_BOUND) * self._least[int(turn)])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates: turns of less than 180° and numbers that some entry could still show."""
        size = self.target.size
        largest = np.max(np.diag(self.target.matrix).reshape(2, 3), axis=1)
        shift, turn = np.log(np.column_stack([self._least, 10.0 * largest]))
        rows = [[-10.0, 10.0]] * 3 + [list(np.log([1e-2 * size, 1e2 * size]))] + [[-10.0, 10.0]] * self._offsets
        rows += [list(shift)] + [list(turn)] * 3 + [list(shift)] * (2 if self.form is Form.SHEARED else 0)
        low, high = np.array(rows).T
        return low, high

    def start(self, length: float, arm: Array) -> Array:
        """Point with these axes, this length in mm and this arm ``(3,)`` from middle to tip, nearest the target."""
        R = self.axes
        G = np.zeros((6, 6))
        G[:3, :3] = G[3:, 3:] = R.T
        p = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
        G[:3, 3:] = R.T @ p
        a, y, z, t, cy, cz = np.diag(G @ self.target.matrix @ G.T)
        tiny = 1e-300
        parts: list[Any] = [np.zeros(3), np.log(length)]
        if self.form is Form.OFFSET:
            parts.append((arm - 0.5 * length * R[:, 0]) / self.target.size)
        parts.append(np.log(np.maximum([a, t, cy, cz], tiny)))
        if self.form is Form.SHEARED:
            excess = np.array([y - length**2 * cz / 12.0, z - length**2 * cy / 12.0])
            parts.append(np.log(np.maximum(excess, tiny)))
        low, high = self.bounds
        inside = 1e-3 * (high - low)
        result: Array = np.clip(np.hstack(parts), low + inside, high - inside)
        return result

    def _compliances(self, x: Numbers) -> Numbers:
        """Compliances ``(k, 6, 6)`` of points ``(k, n)``, real or complex."""
        R = self.axes @ _rotations(x[:, :3])
        k, m = len(x), 4 + self._offsets
        L = np.exp(x[:, 3])
        p = 0.5 * L[:, None] * R[:, :, 0]
        if self.form is Form.OFFSET:
            p = p + x[:, 4:7] * self.target.size
        a, t, cy, cz = np.exp(x[:, m : m + 4]).T
        s = np.exp(x[:, m + 4 :]).T if self.form is Form.SHEARED else np.zeros((2, k))
        D = np.stack([a, L**2 * cz / 12.0 + s[0], L**2 * cy / 12.0 + s[1], t, cy, cz], axis=1)
        G = np.zeros((k, 6, 6), dtype=x.dtype)
        G[:, :3, :3] = G[:, 3:, 3:] = R
        G[:, :3, 3:] = -_skews(p) @ R
        return (G * D[:, None, :]) @ np.swapaxes(G, 1, 2)

    def residuals(self, x: Array) -> Array:
        """Misfit ``(21,)`` of the entries `UPPER` in rounding half-widths."""
        C = self._compliances(x[None])[0]
        result: Array = ((C - self.target.matrix) / self.target.half)[UPPER]
        return result

    def slopes(self, x: Array) -> Array:
        """Derivative ``(21, n)`` of `residuals`, by complex steps, exact to rounding."""
        C = self._compliances(x + 1j * COMPLEX_STEP * np.eye(len(x)))
        result: Array = (np.imag(C) / COMPLEX_STEP / self.target.half)[:, *UPPER].T
        return result

    def entry(self, x: Array, i: int, j: int) -> tuple[float, Array]:
        """Entry (i, j) of the compliance at a point, and its derivative ``(n,)``."""
        C = self._compliances(x + 1j * COMPLEX_STEP * np.eye(len(x)))[:, i, j]
        return float(np.real(C[0])), np.imag(C) / COMPLEX_STEP

    def direction(self, x: Array) -> tuple[Array, Array]:
        """Direction ``(3,)`` of the beam at a point, and its derivative ``(3, n)``."""
        steps = x + 1j * COMPLEX_STEP * np.eye(len(x))
        D = np.imag(self.axes @ _rotations(steps[:, :3])[:, :, :1])[:, :, 0].T / COMPLEX_STEP
        return self.axes @ _rotations(x[None, :3])[0][:, 0], D

    def point(self, beam: Beam) -> Array:
        """Coordinates of a beam whose section's axes are this space's."""
        assert beam.section is not None
        s, L = beam.section, beam.length
        parts: list[Any] = [np.zeros(3), np.log(L)]
        if self.form is Form.OFFSET:
            parts.append(beam.end_offset / self.target.size)
        stiffnesses = [s.EA, s.GJ, s.EIy, s.EIz, *([s.GAy, s.GAz] if self.form is Form.SHEARED else [])]
        with np.errstate(divide="ignore"):
            parts.append(np.log(L / np.array(stiffnesses)))
        result: Array = np.clip(np.hstack(parts), *self.bounds)
        return result

    def beam(self, x: Array) -> Beam:
        """The beam at a point; a shear stiffness that no entry shows is infinite."""
        m = 4 + self._offsets
        L = float(np.exp(x[3]))
        offset = x[4:7] * self.target.size if self.form is Form.OFFSET else np.zeros(3)
        a, t, cy, cz, *shear = np.exp(x[m:]).tolist()
        GA = [L / s if self.shows(s, turn=False) else float("inf") for s in shear]
        R = self.axes @ _rotations(x[None, :3])[0]
        return Beam(
            "beam", L, section_frame=R, end_offset=offset, section=Section(L / a, L / t, L / cy, L / cz, *GA)
        )


def as_people_write_it(beam: Beam) -> Beam:
    """The same compliance in other words: of all its writings, the one that is easiest to picture.

    The beam that runs back from its far end has the same compliance with another offset: the shorter offset is
    taken. A quarter turn swaps y and z: they are taken nearest to the matrix's own.
    """
    assert beam.section is not None
    R, s = beam.section_frame, beam.section
    offset = beam.end_offset
    back = offset + beam.length * R[:, 0]
    if np.linalg.norm(back) < np.linalg.norm(offset):
        offset, R = back, R * np.array([-1.0, 1.0, -1.0])
    quarters = [R @ rotation_from_vector([0.5 * np.pi * k, 0.0, 0.0]) for k in range(4)]
    k = int(np.argmax([Q[1, 1] + Q[2, 2] for Q in quarters]))
    if k % 2:
        s = replace(s, EIy=s.EIz, EIz=s.EIy, GAy=s.GAz, GAz=s.GAy)
    return replace(beam, section_frame=quarters[k], end_offset=offset, section=s)


def _rotations(w: Numbers) -> Numbers:
    """Rotations ``(k, 3, 3)`` of twice Gibbs' vectors ``(k, 3)``: rational, so that a complex step goes through."""
    h = 0.5 * w
    S = _skews(h)
    scale = 2.0 / (1.0 + np.sum(h * h, axis=1))
    return np.eye(3) + scale[:, None, None] * (S + S @ S)


def _skews(v: Numbers) -> Numbers:
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)
