"""Which causes explain a test: forward search with pairs, backward deletion, and when to stop.

A cause is added only if it is significant over the whole catalogue, and if it explains more than what a slightly
wrong law of the causes before it leaves behind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vjm.rotations import Array
from vjm_updating.diagnose.evidence import Costs, criterion
from vjm_updating.diagnose.fitting import Fit, Fitter
from vjm_updating.diagnose.model_adequacy import Misfit, misfit
from vjm_updating.diagnose.parameters import Hypothesis, afar, bent, towards_nothing
from vjm_updating.diagnose.scored_hypothesis import Ranked
from vjm_updating.diagnose.screening import (
    STRONG,
    Score,
    Signature,
    Signed,
    best_pairs,
    far_off,
    projection,
    scores,
    signatures,
    threshold,
)
from vjm_updating.diagnose.stopping import (
    CLOSE,
    FALLEN,
    HOPEFUL,
    WORTH_A_LOOK,
    WRONG_LAW,
    chance,
    far_behind,
    hopeless,
    in_one_reading,
    no_cause_left,
    no_shape_left,
)
from vjm_updating.mechanisms.effect import Effect

MOST_CAUSES = 3
SHORT = 5
"""Causes that are fitted in full at each step."""
PAIRS = 3
"""Pairs that are fitted in full."""
PAYS = 6.0
"""Squares that a pair must explain beyond the best cause, to first order, to be fitted."""
STRAINED = 1.5
"""Sigmas of a nuisance from which fits begin at most."""
STUCK, FAINT = 2.0, 0.03
"""Objective above that of a hypothesis with a cause less from which a fit has missed its best, and the share of the
first trial with which it begins again."""
PROMISED, SHORT_OF, SMALLER = 400.0, 9.0, 0.3
"""Squares explained up to which a score to first order can be relied on, by how much a fit that explains less has
missed its best, and the share of the trials with which it begins again."""
RESTARTS = 3
"""Times that a search begins anew because a hypothesis has led the null to a better optimum."""
NEARLY, ROUGHLY, MOST_ALIKE = 4.0, 0.15, 12
"""Strength by which, to first order, effects that may be one class differ, the share of the squares by which large
ones do, and how many causes are fitted."""
CARRIED_ON = 3
"""Times that a fit which has not ended by itself is carried on, at most."""
POLISHED, ASTRAY = 3, 2
"""Hypotheses of one size whose fits are made exact, and of those further behind that had not come to an end."""
ALONE = 0.5
"""Share of what a further cause explains that may be of a single reading."""


@dataclass
class Search:
    """A search and what it has found.

    Attributes:
        fitter: of the test.
        null: fit of the sheet's tolerances alone.
        effects: the catalogue.
        samples: effective number of readings.
        progress: told what is being tried.
        hints: fits of an earlier search, by their effects, from which to begin.
        signed: what the effects do to the readings about a null near by.
        costs: what a choice of causes costs in this kind of test.
    """

    fitter: Fitter
    null: Fit
    effects: Sequence[Effect]
    samples: float
    progress: Callable[[str], None] = lambda _: None
    hints: Mapping[frozenset[str], Ranked] = field(default_factory=dict)
    signed: Signed | None = None
    costs: Costs = field(default_factory=Costs)
    tried: dict[frozenset[str], Ranked] = field(default_factory=dict)
    alarm: float = 0.0
    restarts: int = 0
    first: list[Score] = field(default_factory=list)
    _rest: tuple[Fit, Misfit] | None = None

    def run(self) -> Ranked:
        """The best hypothesis; the null where nothing is significant."""
        best = self.tried[frozenset()] = Ranked(self.null, self._criterion(self.null))
        self.fitter.differentiate_near(self.null, STRAINED)
        found = self._signatures(best)
        for step in range(MOST_CAUSES):
            base = best.fit
            gained = self.null.objective - base.objective
            ranked = self._scores(best, found)
            if step == 0:
                self.alarm, self.first = threshold(ranked), ranked
            elif no_cause_left(ranked, gained, self.alarm) and no_shape_left(self.rest(base), gained, self.alarm):
                if step > 1:
                    break
                # beside this cause; two others may be better than it
                ranked = []
            else:
                if gained > STRONG:
                    found = self._signatures(best)
                    ranked = self._scores(best, found)
                if hopeless(self.fitter, base, ranked[: MOST_CAUSES - step]):
                    break
            if step == MOST_CAUSES - 1 and far_off(self.fitter, base):
                break
            # signatures about nuisances dragged far along say little of what is there or is not
            dragged = step == 0 and self.fitter.dragged(self.null)
            for k, score in enumerate(ranked):
                promising = (k < SHORT or bent(score.effect)) and score.p < HOPEFUL * self.alarm
                unsized = dragged and not score.effect.quantities()
                if (promising or unsized) and not self._beaten(best.labels | {score.effect.label}):
                    self._try(
                        (*base.hypothesis, score.effect),
                        base,
                        [[*base.values, v] for v in score.starts],
                        score.explained,
                    )
            if dragged:
                # nor is what they can imitate to first order thereby impossible
                shown = {score.effect.label for score in ranked}
                for effect in (e for e in self.effects if e.label not in shown):
                    if not self._beaten(frozenset([effect.label])):
                        self._try((effect,), base, [[trial] for trial in effect.trials()])
            if step == 1:
                self._pairs(best, found)
            if step == 0 and self.restarts < RESTARTS and self._null_from(base):
                self.restarts += 1
                return self.run()
            better = self._better(best, step + 1)
            if better is None:
                break
            best = self._pruned(better)
            if len(best.labels) <= step:
                break
        return best

    def rest(self, fit: Fit) -> Misfit:
        """What a fit leaves."""
        if self._rest is None or self._rest[0] is not fit:
            self._rest = fit, misfit(self.fitter, fit)
        return self._rest[1]

    def _beaten(self, labels: frozenset[str]) -> bool:
        """Whether an earlier search has left a hypothesis so far behind that no better noise brings it back."""
        if labels not in self.hints:
            return False
        least = min(r.criterion for r in self.hints.values() if len(r.labels) == len(labels))
        return far_behind(self.hints[labels].criterion, least, self.hints[frozenset()].criterion)

    def _null_from(self, base: Fit) -> bool:
        """Whether the null fits better from where a hypothesis with hardly any effect has led."""
        m = len(self.fitter.nuisances)
        for ranked in sorted(self.tried.values(), key=lambda r: r.fit.objective)[:3]:
            if not ranked.labels or ranked.fit.objective < base.objective - WORTH_A_LOOK:
                continue
            null = self.fitter.fit((), ranked.fit.at.z[:m], [])
            if null is not None and null.objective < base.objective - 1.0:
                self.null = null
                self.tried = {}
                return True
        return False

    def _signatures(self, best: Ranked) -> list[Signature]:
        if not best.labels and self.signed is not None and self.signed.serves(self.fitter, best.fit):
            return self.signed.found
        self.progress(f"signatures of {len(self.effects)} effects")
        return signatures(self.fitter, best.fit, [e for e in self.effects if e.label not in best.labels])

    def _scores(self, best: Ranked, found: Sequence[Signature]) -> list[Score]:
        here = [s for s in found if s.effect.label not in best.labels]
        return scores(self.fitter, projection(self.fitter, best.fit), here)

    def alike(self, best: Ranked) -> None:
        """Fit the effects that, in the place of one of the best hypothesis', would show nearly the same."""
        for i in range(len(best.fit.hypothesis)):
            rest = tuple(e for k, e in enumerate(best.fit.hypothesis) if k != i)
            base = self.tried.get(frozenset(e.label for e in rest))
            if base is None:
                continue
            found = self.first if not rest else self._scores(base, self._signatures(base))
            own = best.fit.hypothesis[i]
            level = max((s.explained for s in found if s.effect.label == own.label), default=np.inf)
            seen = {own.cause}
            for score in found:
                far = score.explained < level - max(NEARLY**2, ROUGHLY * level) and not bent(score.effect)
                if far or score.effect.cause in seen or len(seen) > MOST_ALIKE:
                    continue
                # of each cause the label that explains most
                seen.add(score.effect.cause)
                self._try((*rest, score.effect), base.fit, [[*base.fit.values, v] for v in score.starts[:1]])
                known = self.tried.get(frozenset(e.label for e in (*rest, score.effect)))
                if known is None or far_behind(known.criterion, best.criterion, self.null.objective):
                    continue
                if not far_off(self.fitter, known.fit):
                    self.settled(known)

    def _pairs(self, best: Ranked, found: Sequence[Signature]) -> None:
        """Pairs that to first order are better than the best cause: together, or one beside a rival of the best."""
        null = self.null
        for a, b, worth in best_pairs(projection(self.fitter, null), self.first[:14], PAIRS):
            promises = null.objective - worth < best.fit.objective - PAYS
            if promises and not self._beaten(frozenset([a.effect.label, b.effect.label])):
                self._try((a.effect, b.effect), null, [[a.starts[0], b.starts[0]]])
        rivals = [r for r in self.tried.values() if len(r.labels) == 1 and r.criterion < best.criterion + CLOSE]
        promised = [
            (rival.criterion - score.mixture, rival, score)
            for rival in sorted(rivals, key=lambda r: r.criterion)[:SHORT]
            for score in self._scores(rival, found)
            if rival.criterion - score.mixture < best.criterion - PAYS and score.effect.cause not in rival.causes
        ]
        seen: set[frozenset[str]] = set()
        for _, rival, score in sorted(promised, key=lambda p: p[0]):
            causes = rival.causes | {score.effect.cause}
            if causes in seen or len(seen) == PAIRS or self._beaten(rival.labels | {score.effect.label}):
                continue
            seen.add(causes)
            starts = [[*rival.fit.values, v] for v in score.starts]
            self._try((*rival.fit.hypothesis, score.effect), rival.fit, starts, score.explained)

    def _try(
        self,
        hypothesis: Hypothesis,
        base: Fit,
        starts: Sequence[Sequence[Sequence[float]]],
        promised: float = 0.0,
    ) -> None:
        """Fit a hypothesis unless that was done, or a part has one cause by two laws: a gauge that drifts, by one.

        Args:
            hypothesis: the causes.
            base: a fit of other causes, to begin at.
            starts: values of each effect.
            promised: squares that its last effect explains beside the base's, to first order.
        """
        key = frozenset(effect.label for effect in hypothesis)
        if key in self.tried or len({(e.cause, e.part) for e in hypothesis}) < len(hypothesis):
            return
        self.progress(" + ".join(effect.label for effect in hypothesis))
        m = len(self.fitter.nuisances)
        # a wrong model has dragged the nuisances along; what it has freed is its own affair
        held = np.array([np.isfinite(c.sigma) for c in base.found[:m]])
        begin = np.where(held, np.clip(base.at.z[:m], -STRAINED, STRAINED), base.at.z[:m])
        hint = self.hints.get(key)
        if hint is not None and hint.fit.hypothesis == hypothesis and hint.fit.converged:
            begin, starts = hint.fit.at.z[:m], [hint.fit.values]
        rivals = [r.fit for r in self.tried.values() if len(r.labels) == len(key)]
        least = min((self.fitter.squares(fit.found, fit.at) for fit in rivals), default=np.inf)
        # of what is known by a slope that says little, so do the first steps
        target = np.inf if bent(hypothesis[-1]) else least + CLOSE
        best = self._fitted(hypothesis, begin, starts, target)
        if not base.hypothesis and hint is None:
            for far in afar(hypothesis[-1], self.fitter.nuisances, begin):
                best = _lower(best, self._fitted(hypothesis, far, starts, target))
        hoped = base.objective - promised
        counts = promised < PROMISED and hoped < min((fit.objective for fit in rivals), default=np.inf) + NEARLY**2
        if counts and (best is None or best.objective >= hoped + SHORT_OF):
            smaller = [[*values[:-1], towards_nothing(hypothesis[-1], values[-1], SMALLER)] for values in starts]
            best = _lower(best, self._fitted(hypothesis, begin, smaller, target, hoped + SHORT_OF))
            if best is None or best.objective >= hoped + SHORT_OF:
                # slopes by the machine's nuisances have led it astray
                best = _lower(best, self._exact(hypothesis, begin, starts[0]))
        if (
            best is not None
            and key > {e.label for e in base.hypothesis}
            and best.objective > base.objective + STUCK
        ):
            # it contains the base, and cannot be worse
            best = _lower(best, self._from_base(hypothesis, base, starts[0]))
        if best is not None:
            self.tried[key] = Ranked(best, self._criterion(best))

    def _fitted(
        self,
        hypothesis: Hypothesis,
        begin: Array,
        starts: Sequence[Sequence[Sequence[float]]],
        target: float,
        enough: float = -np.inf,
    ) -> Fit | None:
        """The best fit from several starts, up to one whose objective is small enough."""
        best: Fit | None = None
        for values in starts:
            best = _lower(best, self.fitter.fit(hypothesis, begin, values, rough=True, target=target))
            if best is not None and best.objective < enough:
                break
        return best

    def _from_base(self, hypothesis: Hypothesis, base: Fit, values: Sequence[Sequence[float]]) -> Fit | None:
        """A fit that begins at a hypothesis with a cause less, with next to none of that cause."""
        known = {effect.label: own for effect, own in zip(base.hypothesis, base.values, strict=True)}
        begin = [
            known.get(effect.label) or towards_nothing(effect, own, FAINT)
            for effect, own in zip(hypothesis, values, strict=True)
        ]
        return self.fitter.fit(hypothesis, base.at.z[: len(self.fitter.nuisances)], begin, rough=True)

    def _better(self, best: Ranked, size: int) -> Ranked | None:
        """The best of one size, where it is significantly better."""
        left = [r for r in self.tried.values() if len(r.labels) == size]
        if not left:
            return None
        left.sort(key=lambda r: r.criterion)
        top = left[0].criterion
        near = [r for r in left if r.criterion < top + CLOSE][:POLISHED]
        # where the null has dragged nuisances far along, rough slopes may have led the right one astray
        reach = FALLEN * (self.null.objective - top) if self.fitter.dragged(self.null) else 0.0
        astray = [r for r in left if r not in near and not r.fit.converged and r.criterion < top + reach]
        for ranked in (*near, *astray[:ASTRAY]):
            self._polish(ranked)
        left = [r for r in self.tried.values() if len(r.labels) == size]
        new = min(left, key=lambda r: r.criterion)
        if size == 1:
            # one of them must stand out of noise; which it is, and how many there are, is what the criterion says
            return new if any(chance(self.first, best.fit, r.fit) < self.alarm for r in left) else None
        gain = best.fit.objective - new.fit.objective
        explained = self.null.objective - best.fit.objective
        # several causes are no explanation of a single reading
        counts = gain > WRONG_LAW * explained and in_one_reading(self.fitter, best.fit, new.fit) < ALONE * gain
        return new if new.criterion < best.criterion and counts else None

    def settled(self, ranked: Ranked) -> Ranked:
        """The same, its fit carried on where it had not come to an end."""
        for _ in range(CARRIED_ON):
            if ranked.fit.converged:
                break
            self._polish(ranked)
            ranked = self.tried[ranked.labels]
        return ranked

    def _polish(self, ranked: Ranked) -> None:
        """The exact fit, by how the machine's own nuisances act beside the hypothesis' causes."""
        m = len(self.fitter.nuisances)
        fit = self._exact(ranked.fit.hypothesis, ranked.fit.at.z[:m], ranked.fit.values)
        if fit is not None:
            self.tried[ranked.labels] = Ranked(fit, self._criterion(fit))

    def _exact(self, hypothesis: Hypothesis, begin: Array, values: Sequence[Sequence[float]]) -> Fit | None:
        """A fit with slopes by the machine's nuisances of its own; the others keep theirs."""
        slopes = self.fitter.machine_slopes
        fit = self.fitter.fit(hypothesis, begin, values, fresh=True)
        self.fitter.machine_slopes = slopes
        return fit

    def _pruned(self, best: Ranked) -> Ranked:
        """Without causes that the others have made superfluous."""
        if len(best.labels) < 2:
            return best
        for i in range(len(best.labels)):
            rest = tuple(e for k, e in enumerate(best.fit.hypothesis) if k != i)
            values = [v for k, v in enumerate(best.fit.values) if k != i]
            self._try(rest, best.fit, [values])
            without = self.tried.get(frozenset(e.label for e in rest))
            if without is None:
                continue
            loss = without.fit.objective - best.fit.objective
            explained = self.null.objective - without.fit.objective
            if without.criterion <= best.criterion or loss < WRONG_LAW * explained:
                return self._pruned(without)
        return best

    def _criterion(self, fit: Fit) -> float:
        return criterion(self.fitter, fit, self.effects, self.samples, self.costs)


def _lower(*fits: Fit | None) -> Fit | None:
    """Of fits the best, where there is one."""
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.objective, default=None)
