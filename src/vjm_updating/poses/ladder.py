"""The ladder: families added one after another, each by what it takes from the error of postures held out.

A family is added where postures held out, at random and by region, are predicted better by it: the mean distance
of both by a share of `LEAST_GAIN`, that of the first by `SURE` standard errors of the paired differences, that of
the second not worse, and the evidence larger. At the end each family that does not pay any more beside the others
is taken out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.poses.families import SECOND, TITLES
from vjm_updating.poses.fit import Solution
from vjm_updating.poses.study import Errors, Hypothesis, State, Study, couplings

LEAST_GAIN = 0.01
SURE = 3.5
"""Standard errors: with a dozen families that are tried up to ten times, a false one in some thousand tests."""
LEAST_EVIDENCE = 5.0
"""Natural logarithm of the ratio of evidences."""
MOST_STEPS = 12
ALIKE = 0.85
"""Share of the best family's saving from which on another saves about the same."""
LOST = 0.003
"""Share of the error held out that a family must save at the end to be kept."""


@dataclass(frozen=True)
class Trial:
    """A family tried on top of a state.

    Attributes:
        name: of the family.
        solution: the linear fit with it.
        errors: with it.
        gain_random: share of the mean distance at random that it saves, and
        sure: over the standard error of the paired differences.
        gain_region: of regions.
        evidence: natural logarithm of the ratio of evidences.
    """

    name: str
    solution: Solution
    errors: Errors
    gain_random: float
    sure: float
    gain_region: float
    evidence: float

    @property
    def pays(self) -> bool:
        """Whether it is to be added."""
        enough = self.gain >= LEAST_GAIN and self.sure >= SURE and self.gain_region >= 0.0
        return enough and self.evidence >= LEAST_EVIDENCE

    @property
    def gain(self) -> float:
        """Mean of the shares saved at random and by region."""
        return 0.5 * (self.gain_random + self.gain_region)

    @property
    def family(self) -> str:
        """Of the name, without the joint that a coupling is of."""
        return self.name.partition(".")[0]


@dataclass(frozen=True)
class Step:
    """A rung: what was added, the state then, and all that was tried."""

    added: str
    state: State
    trials: tuple[Trial, ...]


def paired(before: Array, after: Array, sigma: Array) -> tuple[float, float]:
    """Share saved of mean distances ``(g, k)``, and the saving over its standard error by postures.

    The second is of distances over the readings' standard deviations ``sigma`` (g, k, 6): a reading that scatters
    more, by its load or as an outlier, says less.
    """
    mean = float(np.nanmean(before))
    difference = np.nanmean((before - after) / np.sqrt(np.mean(sigma[..., :3] ** 2, axis=2)), axis=1)
    difference = difference[np.isfinite(difference)]
    if mean <= 0.0 or len(difference) < 2:
        return 0.0, 0.0
    share = 1.0 - float(np.nanmean(after)) / mean
    spread = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    saved = float(difference.mean())
    return share, saved / spread if spread > 0.0 else (np.inf if saved > 0.0 else 0.0)


def trial(study: Study, state: State, name: str) -> Trial:
    """What a family would bring."""
    solution, errors = study.tried(state, state.hypothesis.plus(name))
    gain, sure = paired(state.errors.random, errors.random, state.sigma)
    region, _ = paired(state.errors.region, errors.region, state.sigma)
    return Trial(name, solution, errors, gain, sure, region, solution.log_evidence - state.solution.log_evidence)


def climb(
    study: Study, names: Sequence[str] | None = None, told: Callable[[str], None] = lambda _: None
) -> list[Step]:
    """The ladder of a test.

    Args:
        study: the test.
        names: families and couplings that are thought possible; None: all.
        told: told what is being done.
    """
    possible = [*study.families, *couplings(study)] if names is None else list(names)
    told("base frame and markers")
    state = study.settle(Hypothesis())
    steps: list[Step] = []
    added = ""
    for _ in range(MOST_STEPS):
        left = [name for name in possible if name not in state.hypothesis.names]
        trials = tuple(sorted((trial(study, state, name) for name in left), key=_rank))
        steps.append(Step(added, state, trials))
        best = chosen(trials)
        if best is None:
            break
        told(best.name)
        added = best.name
        state = study.settle(state.hypothesis.plus(added), state)
    return _thinned(study, steps)


def _rank(one: Trial) -> float:
    """The largest saving first."""
    return -one.gain


def chosen(trials: Sequence[Trial]) -> Trial | None:
    """The family to be added; None where none pays.

    Of those of the first order that pay about as much as the best, the first in the order of `TITLES`; those of the
    second order where none of the first pays.
    """
    for second in (False, True):
        paying = [one for one in trials if one.pays and (one.family in SECOND) == second]
        if paying:
            near = [one for one in paying if one.gain >= ALIKE * max(o.gain for o in paying)]
            return min(near, key=lambda one: list(TITLES).index(one.family))
    return None


def _thinned(study: Study, steps: list[Step]) -> list[Step]:
    """The ladder with a last rung without the families that pay no more beside those that came later."""
    state, dropped = steps[-1].state, []
    for name in state.hypothesis.names[:-1]:
        _, errors = study.tried(state, state.hypothesis.minus(name))
        lost, sure = paired(errors.random, state.errors.random, state.sigma)
        worse, _ = paired(errors.region, state.errors.region, state.sigma)
        if (lost < LOST or sure < 2.0) and worse < LOST:
            state = study.settle(state.hypothesis.minus(name), state)
            dropped.append(name)
    if not dropped:
        return steps
    left = [name for name in study.families if name not in state.hypothesis.names]
    trials = tuple(sorted((trial(study, state, name) for name in left if name not in dropped), key=_rank))
    return [*steps, Step("without " + ", ".join(dropped), state, trials)]
