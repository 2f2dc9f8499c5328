"""Errors of readings held out, part by part: each posture, direction, cycle or set of marks on its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.diagnosis.holdout import Split
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.inference.fitting import Fitter
from vjm_updating.observation.observed import Observed


@dataclass(frozen=True)
class Fold:
    """What was held out together.

    Attributes:
        name: posture, direction, cycle, or the first of the marks.
        readings: how many forces were read; a reading of three components has three.
        force: root mean square of the forces that were read, N.
        before: of the nominal model's errors.
        after: of the extended model's, which had not seen them.
    """

    name: str
    readings: int
    force: float
    before: float
    after: float


def folds(fitter: Fitter, split: Split, before: Array, after: Array) -> list[Fold]:
    """Every part of a split, of the residuals ``(n, 6)`` that `vjm_updating.diagnosis.holdout.gain` takes."""
    observed = fitter.forward.observed
    own_channels, _ = observed.scored
    before, after = before[:, own_channels], after[:, own_channels]
    on = fitter.whitening.present[:, own_channels]
    force = np.where(on, np.nan_to_num(observed.wrench[:, own_channels]), 0.0)
    found = []
    for number in np.unique(split.fold):
        own = split.fold == number
        count = int(on[own].sum())
        if count:
            size = [float(np.sqrt((np.where(on, e, 0.0)[own] ** 2).sum() / count)) for e in (force, before, after)]
            found.append(Fold(_name(observed, split, int(number)), count, *size))
    return found


def _name(observed: Observed, split: Split, number: int) -> str:
    own = np.flatnonzero(split.fold == number)
    first = int(own[0])
    if split.name == "postures":
        return f"posture {observed.readings.posture[first]}"
    if split.name == "directions":
        if observed.columns != WRENCH:
            return "one way" if number == 0 else "the other way"
        return "compression" if observed.pose[first, 0] < 0.0 else "tension"
    if split.name == "cycles":
        return f"cycle {observed.readings.run[first]}"
    return "marks " + _some([int(k) + 1 for k in own])


def _some(numbers: Sequence[int]) -> str:
    return ", ".join(str(n) for n in numbers[:3]) + (", …" if len(numbers) > 3 else "")
