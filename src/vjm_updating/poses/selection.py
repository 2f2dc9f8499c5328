"""Stepwise selection: families added one after another, each by what it takes from the error of postures held out.

A family is added where postures held out, at random and by region, are predicted better by it. The mean distance of
the first must fall by `SURE` standard errors of the paired differences, that of the second may not rise, and the
evidence must be larger. Functions of the posture or the clock (`SECOND`) must save as surely at the ends of what
was measured. With other series of the machine beside, a family by which they are predicted worse is not added, also
where it is of its own series: there the others show what it does to the rest.

At the end each family that does not pay any more beside the others is taken out; one of the first order is never
judged beside functions of the posture. Drives are judged one by one, see `unneeded`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, shown, stated_level
from vjm_updating.observation.significance import LAW_ERROR, NORMAL_95
from vjm_updating.poses.ends import errors_at_ends
from vjm_updating.poses.families import CLOCK, COMPLIANCE, DRIVES, FACTOR, MASS, SECOND, TITLES
from vjm_updating.poses.fit import Blocks, PoseSolution, solve
from vjm_updating.poses.state import Errors, FittedState, Hypothesis
from vjm_updating.poses.study import Study, couplings
from vjm_updating.poses.transfer import Series

SURE = stated_level(3.5)
"""Standard errors: with a dozen families that are tried up to ten times, a false one in some thousand tests."""
LEAST_EVIDENCE = stated_level(5.0)
"""Natural logarithm of the ratio of evidences."""
OF_A_MEMBER = stated_level(0.5 * NORMAL_95**2)
"""The same of a single member: half the square of its standard deviations, as of a likelihood ratio."""
MOST_STEPS = numerical(12)
OF_THE_SIMPLER = stated_level(1.0)
"""Standard errors of the paired differences by which the same families with fewer members may predict worse and
still be as good (Breiman, Friedman, Olshen and Stone, Classification and Regression Trees, 1984)."""
NEAR = shown(1.0)
"""Standard errors by which a family may miss what it has to save and still be shown as a rival."""


@dataclass(frozen=True)
class Saving:
    """What errors held out are smaller than others of the same readings.

    Attributes:
        share: of the mean distance, and
        sure: over the standard error of the paired differences by postures.
    """

    share: float
    sure: float


@dataclass(frozen=True)
class Trial:
    """A family tried on top of a state.

    Attributes:
        name: of the family.
        solution: the linear fit with it.
        errors: with it.
        random: what it saves of postures held out at random, and
        region: of regions.
        evidence: natural logarithm of the ratio of evidences.
        ends: at the ends of what was measured; None where it was not asked.
        gain_beside: share saved of other series; None where there is none, or it was not asked.
    """

    name: str
    solution: PoseSolution
    errors: Errors
    random: Saving
    region: Saving
    evidence: float
    ends: Saving | None = None
    gain_beside: float | None = None

    @property
    def pays(self) -> bool:
        """Whether it is to be added."""
        return self._pays(0.0) and self.holds

    @property
    def holds(self) -> bool:
        """Whether it holds beside, where that was asked."""
        return self.gain_beside is None or self.gain_beside >= 0.0

    @property
    def rivals(self) -> bool:
        """Whether it misses a threshold by no more than its noise."""
        return not self.pays and self.holds and self._pays(NEAR)

    def _pays(self, by: float) -> bool:
        """Whether it would be added with its savings ``by`` standard errors larger."""
        # evidence is half a square of standard deviations, as is the likelihood ratio of one number
        root = np.sqrt(2.0 * max(self.evidence, 0.0)) + by
        enough = self.random.sure + by >= SURE and self.region.sure + by >= 0.0
        at_ends = self.ends is None or self.ends.sure + by >= SURE
        return enough and at_ends and 0.5 * root**2 >= LEAST_EVIDENCE

    @property
    def gain(self) -> float:
        """Mean of the shares saved at random and by region."""
        return 0.5 * (self.random.share + self.region.share)

    @property
    def family(self) -> str:
        """Of the name, without the joint that a coupling is of."""
        return self.name.partition(".")[0]

    @property
    def second(self) -> bool:
        """Whether it is a function of the posture or the clock."""
        return self.family in SECOND


@dataclass(frozen=True)
class Step:
    """A step of the selection.

    Attributes:
        added: what was.
        state: then.
        trials: all that was tried on top of it.
        ends: ``(g, k)`` distances at the ends of what was measured, held out.
        beside: ``(g, k)`` distances of each other series, nothing refitted but frames and zeros.
    """

    added: str
    state: FittedState
    trials: tuple[Trial, ...]
    ends: Array
    beside: tuple[Array, ...] = ()


def step_of(
    study: Study, added: str, state: FittedState, trials: Sequence[Trial], series: Sequence[Series]
) -> Step:
    """A step with its errors at ends and beside."""
    ends = errors_at_ends(study, state.blocks, state.solution, state.sigma)
    return Step(added, state, tuple(trials), ends, tuple(one.distances(study, state) for one in series))


def saved(before: Array, after: Array) -> float:
    """Share saved of mean distances ``(g, k)`` mm."""
    mean = float(np.nanmean(before))
    return 1.0 - float(np.nanmean(after)) / mean if mean > 0.0 else 0.0


def saving(before: Array, after: Array, sigma: Array) -> Saving:
    """What distances ``(g, k)`` are smaller than others.

    The standard error is of distances over the readings' standard deviations ``sigma`` (g, k, 3 or 6): a reading
    that scatters more, by its load or as an outlier, says less.
    """
    difference = (before - after) / np.sqrt(np.mean(sigma[..., :3] ** 2, axis=2))
    difference = np.nanmean(difference[np.isfinite(difference).any(axis=1)], axis=1)
    if len(difference) < 2:
        return Saving(0.0, 0.0)
    spread = float(difference.std(ddof=1)) / np.sqrt(len(difference))
    less = float(difference.mean())
    sure = less / spread if spread > 0.0 else float(np.copysign(np.inf, less)) if less else 0.0
    return Saving(saved(before, after), sure)


def trial(study: Study, step: Step, name: str) -> Trial:
    """What a family would bring on top of a step."""
    state = step.state
    solution, errors = study.tried(state, state.hypothesis.plus(name))
    random, region = savings(state.errors, errors, state.sigma)
    found = Trial(name, solution, errors, random, region, solution.log_evidence - state.solution.log_evidence)
    if not found.second or not (found.pays or found.rivals):
        return found
    # what follows the clock has to hold at the clock's ends: the joints' ends lie in the midst of its course
    clock_only = found.family in CLOCK
    ends = errors_at_ends(study, state.blocks, solution, state.sigma, clock_only=clock_only)
    before = step.ends
    if clock_only:
        before = errors_at_ends(study, state.blocks, state.solution, state.sigma, clock_only=True)
    return replace(found, ends=saving(before, ends, state.sigma))


def select_families(
    study: Study,
    names: Sequence[str] | None = None,
    told: Callable[[str], None] = lambda _: None,
    series: Sequence[Series] = (),
) -> list[Step]:
    """The stepwise selection of a test.

    Args:
        study: the test.
        names: families and couplings that are thought possible; None: all.
        told: told what is being done.
        series: other series of the same machine.
    """
    possible = [*study.families, *couplings(study)] if names is None else list(names)
    told("base frame and markers")
    steps = [step_of(study, "", study.settle(Hypothesis()), (), series)]
    for _ in range(MOST_STEPS):
        step = steps[-1]
        left = [name for name in possible if name not in step.state.hypothesis.names]
        trials = sorted((trial(study, step, name) for name in left), key=lambda one: -one.gain)
        above = None
        while above is None and (best := chosen(trials)) is not None:
            told(best.name)
            state = study.settle(step.state.hypothesis.plus(best.name), step.state)
            if _tells_drives(study, best.name):
                state = with_needed(study, state)
            elif best.name not in SECOND:
                state = released(study, state)
            above = step_of(study, best.name, state, (), series)
            if series:
                gain = float(np.mean([saved(*pair) for pair in zip(step.beside, above.beside, strict=True)]))
                trials[trials.index(best)] = replace(best, gain_beside=gain)
                above = above if gain >= 0.0 else None
        steps[-1] = replace(step, trials=tuple(trials))
        if above is None:
            break
        steps.append(above)
    return _thinned(study, steps, series)


def chosen(trials: Sequence[Trial]) -> Trial | None:
    """The family to be added; None where none pays.

    Of those of the first order that save about as much as the best, the first in the order of `TITLES`. Of
    those of the second order, where none of the first pays, the one with the most evidence: they imitate each
    other, and one that only imitates extrapolates badly, which hides what comes after it.
    """
    paying = [one for one in trials if one.pays]
    first = [one for one in paying if not one.second]
    if first:
        best = max(first, key=lambda one: one.gain)
        near = [one for one in first if within_laws(one, best)]
        return min(near, key=lambda one: list(TITLES).index(one.family))
    return max(paying, key=lambda one: one.evidence, default=None)


def within_laws(one: Trial, best: Trial) -> bool:
    """Whether a family saves as much as another but for the errors that both laws have."""
    return best.gain - one.gain <= LAW_ERROR * float(np.hypot(one.gain, best.gain))


def savings(before: Errors, after: Errors, sigma: Array) -> tuple[Saving, Saving]:
    """What is saved at random and by region."""
    return saving(before.random, after.random, sigma), saving(before.region, after.region, sigma)


def as_good(one: Errors, other: Errors, sigma: Array, by: float = NORMAL_95) -> bool:
    """Whether one hypothesis predicts what is held out no worse than another, but for some standard errors."""
    return all(found.sure < by for found in savings(one, other, sigma))


def replacing(study: Study, state: FittedState, without: Hypothesis) -> FittedState | None:
    """Another hypothesis settled from a state; None where what is held out is then predicted worse.

    The linear fit at the state only says whether to try. There a family borrows effects of the one left out, as
    masses do of compliances, which are gone once the fit has settled.
    """
    if not as_good(study.tried(state, without)[1], state.errors, state.sigma):
        return None
    settled = study.settle(without, state)
    return settled if as_good(settled.errors, state.errors, state.sigma) else None


def unneeded(study: Study, state: FittedState) -> tuple[str, ...]:
    """Compliances of drives without which what is held out is predicted as well: at random, by region, at the ends.

    A drive that bears little torque is seen where it is soft enough, as those of wrists are. But its column has the
    shape of other errors, too, which a long test fits to a small standard deviation. So it has to hold where it was
    not fitted, and by the evidence. It is judged without functions of the posture, bearings, links and masses,
    which share what it does; the weakest by the evidence is left out first, the sum against the fit with all.
    """
    names = tuple(name for name in state.hypothesis.families if _tells_drives(study, name))
    bare = replace(state.hypothesis, families=names, kept=())
    whole = state if bare == state.hypothesis else study.settle(bare, state)
    ends = errors_at_ends(study, whole.blocks, whole.solution, whole.sigma)

    def as_well(blocks: Blocks, solution: PoseSolution) -> bool:
        if whole.solution.log_evidence - solution.log_evidence < OF_A_MEMBER:
            return True
        if not as_good(study.errors(blocks, solution, whole.sigma), whole.errors, whole.sigma, OF_THE_SIMPLER):
            return False
        lost = saving(errors_at_ends(study, blocks, solution, whole.sigma), ends, whole.sigma)
        return lost.sure < OF_THE_SIMPLER

    left, kept = {m.name for m in study.members if m.family == DRIVES}, tuple[str, ...]()
    while left:
        without = {name: study.of(whole.blocks, replace(bare, kept=(*kept, name))) for name in left}
        fits = {name: solve(one, study.numbers(bare), whole.solution.sizes) for name, one in without.items()}
        weakest_first = sorted(left, key=lambda name: -fits[name].log_evidence)
        found = next((name for name in weakest_first if as_well(without[name], fits[name])), None)
        if found is None:
            break
        left.remove(found)
        kept = (*kept, found)
    return kept


def _tells_drives(study: Study, name: str) -> bool:
    """Whether drives are judged beside a family or coupling: no function of the posture, bearing, link or mass."""
    shares = {m.family for m in study.members if m.acts in (COMPLIANCE, FACTOR, MASS) and m.family != DRIVES}
    return name.partition(".")[0] not in (*SECOND, *shares)


def with_needed(study: Study, state: FittedState) -> FittedState:
    """A state whose drives that are not needed keep the model's compliance."""
    if DRIVES not in state.hypothesis.families:
        return state
    kept = unneeded(study, state)
    hypothesis = replace(state.hypothesis, kept=tuple(m.name for m in study.members if m.name in kept))
    return released(study, state if hypothesis == state.hypothesis else study.settle(hypothesis, state))


def released(study: Study, state: FittedState) -> FittedState:
    """A state in which no drive keeps the model's compliance that is needed beside all else that is fitted.

    What another family leaves may show a drive that was lost in what the family explains.
    """
    hypothesis, solution, errors = state.hypothesis, state.solution, state.errors
    ends = errors_at_ends(study, state.blocks, solution, state.sigma) if hypothesis.kept else np.zeros((0, 0))
    while hypothesis.kept:
        found = []
        for name in hypothesis.kept:
            wider = replace(hypothesis, kept=tuple(k for k in hypothesis.kept if k != name))
            fit, held = study.tried(state, wider)
            more = fit.log_evidence - solution.log_evidence
            if more < OF_A_MEMBER or as_good(errors, held, state.sigma, OF_THE_SIMPLER):
                continue
            there = errors_at_ends(study, study.of(state.blocks, wider), fit, state.sigma)
            if saving(ends, there, state.sigma).sure >= OF_THE_SIMPLER:
                found.append((more, wider, fit, held, there))
        if not found:
            break
        _, hypothesis, solution, errors, ends = max(found, key=lambda one: one[0])
    return state if hypothesis == state.hypothesis else study.settle(hypothesis, state)


def first_order(hypothesis: Hypothesis) -> Hypothesis:
    """A hypothesis without functions of the posture and the clock."""
    return replace(hypothesis, families=tuple(name for name in hypothesis.families if name not in SECOND))


def _thinned(study: Study, steps: list[Step], series: Sequence[Series]) -> list[Step]:
    """The selection with a last step without the families that pay no more beside those that came later."""
    state, dropped = steps[-1].state, []
    bare = first_order(state.hypothesis)
    # beside functions of the posture, which imitate them, those of the first order would not show
    judged = state if bare == state.hypothesis else study.settle(bare, state)
    for name in bare.names[:-1]:
        thinned = replacing(study, judged, judged.hypothesis.minus(name))
        if thinned is not None:
            judged = thinned
            state = study.settle(state.hypothesis.minus(name), state)
            dropped.append(name)
    for name in [name for name in state.hypothesis.families[:-1] if name in SECOND]:
        thinned = replacing(study, state, state.hypothesis.minus(name))
        if thinned is not None:
            state = thinned
            dropped.append(name)
    if not dropped:
        return steps
    last = step_of(study, "without " + ", ".join(dropped), state, (), series)
    left = [name for name in study.families if name not in state.hypothesis.names and name not in dropped]
    trials = sorted((trial(study, last, name) for name in left), key=lambda one: -one.gain)
    return [*steps, replace(last, trials=tuple(trials))]
