"""The beam nearest to a compliance, and whether one meets every entry.

Two measures, both of the misfit in rounding half-widths: the sum of squares, which names the nearest beam, and the
worst entry. Its smallest possible value decides whether a beam meets the matrix: one at most, or none does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from vjm.model.parts import Beam
from vjm.rotations import Array, rotation_from_vector
from vjm_updating.constants import numerical
from vjm_updating.identify.candidates import UPPER, Form, Space, Target
from vjm_updating.identify.rounding import smallest

RANDOM_STARTS = numerical(12)
KEPT = numerical(4)
"""Local minima of the sum of squares from which the worst entry is minimised."""
MET = numerical(1.0 + 1e-6)
"""Worst misfit in rounding half-widths up to which every entry counts as met."""


@dataclass(frozen=True)
class BeamFit:
    """A beam and how it meets the target.

    Attributes:
        space: where it was sought.
        x: its coordinates there.
    """

    space: Space
    x: Array

    @property
    def beam(self) -> Beam:
        """The beam itself."""
        return self.space.beam(self.x)

    @property
    def misfit(self) -> Array:
        """Of every entry ``(6, 6)`` in rounding half-widths, the beam's minus the target's; zero where left out."""
        result = np.zeros((6, 6))
        result[UPPER] = self.space.residuals(self.x)
        return result + np.triu(result, 1).T

    @property
    def worst(self) -> float:
        """Largest misfit, in rounding half-widths."""
        return float(np.max(np.abs(self.space.residuals(self.x))))

    @property
    def squares(self) -> float:
        """Sum of squared misfits over the 21 entries."""
        r = self.space.residuals(self.x)
        return float(r @ r)

    @property
    def met(self) -> bool:
        """Whether every entry is met within its interval."""
        return self.worst <= MET


@dataclass(frozen=True)
class FormSearch:
    """What a search over one form of beam found.

    Attributes:
        nearest: the beam of least squares.
        levelled: beams whose worst entry is a local minimum, best first.
    """

    nearest: BeamFit
    levelled: tuple[BeamFit, ...]

    @property
    def worst(self) -> float:
        """The smallest possible misfit of the worst entry, in half-widths: above one, no beam meets all."""
        return self.levelled[0].worst

    @property
    def met(self) -> bool:
        """Whether some beam meets every entry."""
        return self.levelled[0].met

    @property
    def beam(self) -> BeamFit:
        """The beam to name: the nearest, or where only another one meets every entry, that one."""
        return self.levelled[0] if self.met and not self.nearest.met else self.nearest


def search(target: Target, form: Form, like: list[BeamFit] | None = None) -> FormSearch:
    """The nearest beam of a form, and the one whose worst entry is best; arguments as `nearest`."""
    found = nearest(target, form, like)
    levelled = sorted((_levelled(fit) for fit in distinct(found)[:KEPT]), key=lambda fit: fit.worst)
    return FormSearch(found[0], tuple(levelled))


def nearest(
    target: Target, form: Form, like: list[BeamFit] | None = None, *, robust: bool = False
) -> list[BeamFit]:
    """Beams of a form with a locally smallest sum of squares, best first.

    Args:
        target: to come near to.
        form: of the beams.
        like: beams to start from; by default those that the matrix itself suggests, and random ones.
        robust: the sum of ``ln(1 + r²)`` instead, on which a single misprint has little hold.
    """
    found: list[tuple[float, BeamFit]] = []
    for space, x in _starts(target, form) if like is None else _again(target, form, like):
        solution = least_squares(
            space.residuals, x, space.slopes, bounds=space.bounds, loss="cauchy" if robust else "linear",
            max_nfev=60, xtol=1e-10, ftol=1e-10,
        )  # fmt: skip
        found.append((float(solution.cost), BeamFit(space, np.asarray(solution.x))))
    return [fit for _, fit in sorted(found, key=lambda pair: pair[0])]


def _levelled(fit: BeamFit) -> BeamFit:
    """The worst misfit minimised from a fit: min w with −w ≤ r ≤ w."""
    space, n = fit.space, len(fit.x)
    worst = max(fit.worst, 1e-12)
    low, high = space.bounds

    def margins(y: Array) -> tuple[Array, Array]:
        r, J = space.residuals(y[:n]) / worst, space.slopes(y[:n]) / worst
        ones = np.ones((len(J), 1))
        return np.concatenate([y[n] - r, y[n] + r]), np.vstack([np.hstack([-J, ones]), np.hstack([J, ones])])

    goal = np.append(np.zeros(n), 1.0)
    y = smallest(
        lambda y: (float(y[n]), goal),
        np.append(fit.x, 1.0),
        (np.append(low, 0.0), np.append(high, np.inf)),
        margins,
        iterations=200,
        tolerance=1e-8,
    )
    other = BeamFit(space, y[:n])
    return other if other.worst < fit.worst else fit


def _again(target: Target, form: Form, like: list[BeamFit]) -> Iterator[tuple[Space, Array]]:
    """Beams found for another target, to begin from."""
    for fit in like:
        beam = fit.beam
        space = Space(target, form, beam.section_frame)
        yield space, space.point(beam)


def distinct(fits: list[BeamFit]) -> list[BeamFit]:
    """Fits of different quality, best first."""
    kept: list[BeamFit] = []
    for fit in fits:
        if not kept or abs(fit.squares - kept[-1].squares) > 0.01 * kept[-1].squares + 1e-9:
            kept.append(fit)
    return kept


def _starts(target: Target, form: Form) -> Iterator[tuple[Space, Array]]:
    """Beams to begin from."""
    rng = np.random.default_rng(20090)
    arm, size = target.middle, target.size
    reach = float(np.linalg.norm(arm))
    principal = np.linalg.eigh(target.matrix[3:, 3:])[1]
    principal = principal * np.sign(np.linalg.det(principal))
    if form is Form.OFFSET:
        for first in range(3):
            axes = np.roll(principal, -first, axis=1)
            # where two turning compliances are equal their axes are not distinguishable: begin between them too
            for about in (None, 0, 1, 2):
                for angle in (0.0,) if about is None else (0.4, 0.8, 1.2):
                    turn = np.zeros(3) if about is None else angle * np.eye(3)[about]
                    space = Space(target, form, axes @ rotation_from_vector(turn))
                    yield space, space.start(max(2.0 * reach, size), arm)
    else:
        for angle in (0.0, 0.4, 0.8, 1.2):
            for along in (arm, *principal.T, *-principal.T):
                if np.linalg.norm(along) > 0.0:
                    axes = _axes_along(along) @ rotation_from_vector([angle, 0.0, 0.0])
                    length = 2.0 * reach if along is arm else 1.7 * size
                    yield (
                        Space(target, form, axes),
                        Space(target, form, axes).start(length, 0.5 * length * axes[:, 0]),
                    )
    for _ in range(RANDOM_STARTS):
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        axes = axes * np.sign(np.linalg.det(axes))
        space = Space(target, form, axes)
        length = 1.7 * size * float(np.exp(rng.uniform(-1.0, 1.0)))
        yield space, space.start(length, arm if form is Form.OFFSET else 0.5 * length * axes[:, 0])


def _axes_along(direction: Array) -> Array:
    """A rotation ``(3, 3)`` whose x axis lies along a vector."""
    x = direction / np.linalg.norm(direction)
    y = np.cross(np.eye(3)[int(np.argmin(np.abs(x)))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])
