"""The best coordinates of a hypothesis: Gauss-Newton within a trust region of what makes the machine another one.

A machine's equilibria are traced into tables, which is what a prediction costs. So each round is two. First come
the best coordinates with the tables of one machine, from where what makes it another one leads on by its slopes.
Then come the tables there, which tell how far those slopes can be trusted (Conn, Gould and Toint 2000, section
6.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fit, Fitter, HeldTables
from vjm_updating.inference.normal_equations import bounded_step, inverse
from vjm_updating.inference.parameters import Hypothesis, coordinates, of_effect, remakes, start
from vjm_updating.observation.coordinate import Coordinate, Evaluation, uncertain

ROUNDS, STEPS, HALVINGS = numerical(25), numerical(20), numerical(6)
"""Rounds at most, steps of Gauss-Newton in each, and dampings that are tried for a step."""
ENOUGH = numerical(0.1)
"""Fall of the squares, to be expected, at which a fit ends; in units of the predictions' rounding."""
LEARNT = numerical(10.0)
"""Fall of the squares from which a step tells more of the slopes than its rounding hides; likewise."""
RENEWED = numerical(3)
"""Steps from one differentiation to the next; Broyden's updates do in between."""
PATIENT, HOPE, LOST = numerical(1), numerical(5.0), numerical(8)
"""A fit is given up after so many rounds where so many like the last would not reach its target; and where it has
not reached it after so many."""
POOR, GOOD = numerical(0.25), numerical(0.75)
"""Shares of the fall to be expected below which slopes are made anew, and from which the region grows."""
SHRINKS, GROWS, SMALLEST = numerical(0.25), numerical(2.0), numerical(1e-3)
"""What the region is multiplied by, and the size at which no descent is found."""


@dataclass
class Descent:
    """A fit on its way.

    Attributes:
        fitter: of the test.
        hypothesis: the causes.
        found: its coordinates.
        at: the readings where it is, by tables of their own.
        J: derivatives ``(n, 6, n_z)`` of the raw residuals.
        worth: squares there.
        own: indices of the coordinates that make the machine another one.
    """

    fitter: Fitter
    hypothesis: Hypothesis
    found: Sequence[Coordinate]
    at: Evaluation
    J: Array
    worth: float
    own: Sequence[int]

    def round(self, radius: float) -> tuple[Evaluation, Array, float]:
        """The best by this machine's tables, within a radius: where, with which slopes and squares."""
        fitter, own = self.fitter, self.own
        held = HeldTables(own, self.at.z[own], self.J[:, :, own])
        low, high = (np.array([getattr(c, end) for c in self.found]) for end in ("low", "high"))
        far = radius * (1.0 + np.abs(held.at))
        low[own], high[own] = np.maximum(low[own], held.at - far), np.minimum(high[own], held.at + far)
        at, J, best, damping, exact = self.at, self.J.copy(), self.worth, 1e-3, True
        for count in range(STEPS):
            there, damping = self._step(at, J, best, damping, held, low, high)
            fall = 0.0
            if there is not None:
                value = fitter.squares(self.found, there)
                fall = best - value
                if fall > LEARNT * fitter.rounding:
                    self._learn(J, at, there)
                    exact = False
                at, best = there, value
            ended = fall < ENOUGH * fitter.rounding
            if ended and exact:
                break
            exact = ended or count % RENEWED == 0
            if exact:
                fitter.renew(J, self.found, at, self.hypothesis, [], held)
        return at, J, best

    def promise(self) -> float:
        """Fall of the squares by a whole step, to first order, were no step too long."""
        A, b = self.fitter.system(self.found, self.at, self.J)
        return float(b @ inverse(A, uncertain(self.found), rcond=1e-10) @ b)

    def _step(
        self, at: Evaluation, J: Array, best: float, damping: float, held: HeldTables, low: Array, high: Array
    ) -> tuple[Evaluation | None, float]:
        """A damped step that makes the squares smaller, if there is one, and the damping to go on with."""
        found = self.found
        fixed = np.array([c.sigma == 0.0 for c in found])
        linear = np.array([c.kind in ("zero", "scale") for c in found])
        A, b = self.fitter.system(found, at, J)
        for _ in range(HALVINGS):
            move = bounded_step(A, b, damping, fixed, linear, at.z, low, high)
            if float(move @ b) < 0.5 * ENOUGH * self.fitter.rounding:
                break
            z = np.clip(at.z + move, low, high)
            there = self.fitter.evaluate(found, z, self.hypothesis, held=held)
            if there is not None and self.fitter.squares(found, there) < best:
                return there, max(damping * 0.1, 1e-9)
            damping = max(damping * 10.0, 1e-3)
        return None, damping

    def _learn(self, J: Array, before: Evaluation, at: Evaluation) -> None:
        """What a step tells of the effects' slopes: Broyden's update."""
        own = np.array([c.kind == "effect" and i not in self.own for i, c in enumerate(self.found)])
        move = np.where(own, at.z - before.z, 0.0)
        size = float(move @ move)
        if size > 0.0:
            missed = at.residual - before.residual - J @ (at.z - before.z)
            J += np.where(self.fitter.whitening.present, missed, 0.0)[:, :, None] * (move / size)


def best_fit(
    fitter: Fitter,
    hypothesis: Hypothesis,
    nuisances: Array,
    values: Sequence[Sequence[float]],
    *,
    borrowed: Array | None = None,
    target: float = np.inf,
) -> Fit | None:
    """The best coordinates from a start; None where the machine does not stand there.

    Args:
        fitter: of the test.
        hypothesis: the causes.
        nuisances: to start from ``(m,)``.
        values: of each effect.
        borrowed: slopes by the machine's nuisances ``(n, 6, m)`` of a fit near by, made anew only where they lead
            astray: they only choose a direction, since at the best of a right model the residual is noise. Without,
                the fit's
            own, to the end.
        target: squares worth reaching; a fit that will hardly come so far is given up.
    """
    found = coordinates(fitter.nuisances, hypothesis)
    # what a hypothesis frees is its parameter, and no slope of another fit tells what it does
    freed = [i for i in fitter.of_machine if not np.isfinite(found[i].sigma)]
    made = [i for k, e in enumerate(hypothesis) if remakes(e) for i in of_effect(found, k)]
    own = [*fitter.of_machine, *made]
    at = fitter.evaluate(found, start(found, hypothesis, nuisances, values), hypothesis)
    if at is None:
        return None
    J = fitter.slopes(found, at, hypothesis, borrowed)
    now = Descent(fitter, hypothesis, found, at, J, fitter.squares(found, at), own)
    rounding, enough = fitter.rounding, ENOUGH * fitter.rounding
    # whether all slopes are of this very place
    current, radius, converged = borrowed is None, 1.0, False
    fall = 0.0
    for count in range(ROUNDS):
        if now.worth > target and count > PATIENT:
            out_of_reach = now.worth - HOPE * max(fall, 0.0) > target and now.worth - now.promise() > target
            if out_of_reach or count > LOST:
                break
        there, J, expected = now.round(radius)
        moved = bool((there.z[own] != now.at.z[own]).any())
        expected = now.worth - expected
        exact = fitter.evaluate(found, there.z, hypothesis) if moved else there
        value = np.inf if exact is None else fitter.squares(found, exact)
        fall = now.worth - value
        if exact is not None and fall > 0.0 and (fall >= 0.1 * expected or expected < rounding):
            now.at, now.J, now.worth = exact, J, value
            radius = radius * GROWS if fall >= GOOD * expected else radius
            if expected >= enough and fall < POOR * expected:
                fitter.renew(now.J, found, exact, hypothesis, fitter.of_machine)
                current = True
            elif moved:
                fitter.renew(now.J, found, exact, hypothesis, freed)
                current = False
        elif expected >= rounding and current:
            radius *= SHRINKS
            if radius < SMALLEST:
                break
            continue
        elif expected >= rounding:
            fitter.renew(now.J, found, now.at, hypothesis, fitter.of_machine)
            current = True
            continue
        if expected < (enough if fall > 0.0 else rounding):
            if current or borrowed is not None:
                converged = True
                break
            fitter.renew(now.J, found, now.at, hypothesis, fitter.of_machine)
            current = True
            continue
    if borrowed is None and not current:
        fitter.renew(now.J, found, now.at, hypothesis, fitter.of_machine)
    return Fit(hypothesis, tuple(found), now.at, now.J, fitter.objective(found, now.at), converged)
