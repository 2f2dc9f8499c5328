"""Motions of the rigid machine from postures to postures, many at once, in steps that keep its branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from vjm.machine.rigid_mechanism import RigidMechanism
from vjm.rotations import Array

CLOSED = 1e-11
"""Gap over the machine's length at which loops are closed: some hundred times rounding."""
LARGEST_TURN = 0.3
"""rad by which a passive joint may turn, or lengths by which it may slide, in one step of a way."""
SMALLEST_STEP = 1e-3
"""Share of a way below which its end counts as out of reach."""
DAMPED = 1e-13
"""Of the largest diagonal entry of a Gram matrix: what rounding leaves of motions that nothing holds."""
REAL = 1e-6
"""Imaginary part of an eigenvalue over the largest that is rounding: what is one value twice comes as a pair."""

Step: TypeAlias = Callable[[np.ndarray, Array, Array], tuple[Array, Array]]
"""Of motions by their numbers ``(k,)``, from coordinates ``(k, n)`` nearby, at shares ``(k,)``: the coordinates
closed there, and the gap that remains ``(k,)``."""


@dataclass(frozen=True)
class RigidMotions:
    """How g motions ended.

    Attributes:
        q: coordinates ``(g, n)`` where they did.
        done: shares ``(g,)`` of the motions; one where they came to their ends.
        tried: coordinates ``(g, n)`` of the next steps, which were not taken.
        left: what these leave open ``(g,)``.
        turned: shares ``(g,)`` at which the drives were found to answer the other way; nan where they were not.
        answers: `moved_by_drives` where they ended ``(g, 6, d)``; without columns where the drives are not watched.
    """

    q: Array
    done: Array
    tried: Array
    left: Array
    turned: Array
    answers: Array

    @property
    def arrived(self) -> np.ndarray:
        """Which motions came to their ends ``(g,)``."""
        return np.asarray(self.done == 1.0)


def follow(
    tree: RigidMechanism, start: Array, closed: Step, *, watch: bool, answers: Array | None = None
) -> RigidMotions:
    """Follow motions from coordinates ``(g, n)``, each in steps of its own.

    Args:
        tree: the rigid machine.
        start: closed.
        closed: see `Step`.
        watch: whether the drives, as many as the end-effector's freedoms, must not turn back on the way: between
            lies a singularity, and behind it another branch.
        answers: `moved_by_drives` at the start ``(g, 6, d)``, where it is known; overwritten.
    """
    g = len(start)
    q, tried = start.copy(), start.copy()
    done, step, left, turned = np.zeros(g), np.ones(g), np.zeros(g), np.full(g, np.nan)
    if not watch:
        answers = np.zeros((g, 6, 0))
    elif answers is None:
        answers = moved_by_drives(tree, q)
    going = np.arange(g)
    while len(going):
        to = np.minimum(1.0, done[going] + step[going])
        there, miss = closed(going, q[going], to)
        # drives that turn, too: by a whole turn the loops are closed as before, and a screw would stay behind
        moves = np.abs((there - q[going]) / tree.unit)[:, tree.passive | ~tree.slides].max(axis=1, initial=0.0)
        good = (miss < CLOSED) & (moves <= LARGEST_TURN)
        back = np.zeros(len(going), dtype=bool)
        if watch and np.any(good):
            now = moved_by_drives(tree, there[good])
            back[good] = _turned_back(answers[going[good]], now)
            answers[going[good & ~back]] = now[~back[good]]
        tried[going], left[going] = there, miss
        turned[going[back]] = to[back]
        gone = going[good & ~back]
        step[going] = np.where(good, 2.0, 0.5) * (to - done[going])
        q[gone], done[gone] = there[good & ~back], to[good & ~back]
        going = going[~back & (done[going] < 1.0) & (step[going] >= SMALLEST_STEP)]
    return RigidMotions(q, done, tried, left, turned, answers)


def moved_by_drives(tree: RigidMechanism, q: Array) -> Array:
    """Motions ``(g, 6, d)`` of the end-effector by the held joints at coordinates ``(g, n)``, the loops closed.

    Lengths are over the machine's, coordinates over their units.
    """
    from vjm.machine.rigid_kernel import answers

    passive, driven = np.flatnonzero(tree.passive), np.flatnonzero(~tree.passive)
    result = np.empty((len(q), 6, len(driven)))
    answers(tree.arrays, np.ascontiguousarray(q), passive, driven, DAMPED, result)
    return result


def _turned_back(before: Array, after: Array) -> np.ndarray:
    """Whether the end-effector answers the drives ``(g, 6, d)`` the other way in some direction ``(g,)``."""
    Bt = np.swapaxes(before, 1, 2)
    values = np.linalg.eigvals(np.linalg.solve(Bt @ before, Bt @ after))
    real = np.abs(values.imag) < REAL * np.abs(values).max(axis=1, initial=0.0, keepdims=True)
    return np.asarray(np.any(real & (values.real < 0.0), axis=1))
