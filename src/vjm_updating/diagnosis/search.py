"""Which causes explain a test: forward, swap and backward moves over the catalogue, by evidence.

Every move is scored to first order, nuisances and the discrepancy of the laws integrated out; all pairs of effects
are scored jointly. The most promising are fitted in full.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical, stated_level
from vjm_updating.diagnosis.discrepancy import Misfit, discrepancy, marginalised, misfit
from vjm_updating.diagnosis.evidence import Costs, ScoredModel, SearchMove, choice, criterion
from vjm_updating.diagnosis.screening import (
    STRONG,
    Score,
    Signature,
    SignatureSet,
    best_pairs,
    projection,
    scores,
    signatures,
    threshold,
)
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, best_fit, shapes_cost
from vjm_updating.inference.model_error import NINE_IN_TEN
from vjm_updating.inference.parameters import (
    Hypothesis,
    alternative_starts,
    exclusive,
    linear,
    release_key,
    sizeless,
    towards_nothing,
    usual_shapes,
)
from vjm_updating.inference.refit import begun_anew
from vjm_updating.inference.significance import IMPROBABLE, chi2_sf
from vjm_updating.mechanisms.effect import Effect

WIDTH, BEAM, PAIRS = numerical(8), numerical(3), numerical(3)
"""Hypotheses that are fitted in full at each size, those of one size that are extended, and pairs from nothing."""
RIVAL = stated_level(16.0)
"""Criterion within which of the best a hypothesis may belong to its class: odds of 3000 to 1."""
UNSEEN = numerical(0.05)
"""Share of what the best explains of which a cause that acts shows more, even to first order by trials of a few
sizes."""
FIRST_ORDER = numerical(0.15)
"""Share of the squares explained by which a score to first order is wrong."""
START_WITHIN = numerical(1.5)
"""Sigmas of a nuisance from which fits begin at most: a wrong model has taken them along."""
FAINT = numerical(0.03)
"""Share of a trial with which a fit begins that must not be worse than one with a cause less."""
MOST_CAUSES = numerical(3)
"""Causes that are named together at most: with four laws, each with shapes of its own, any smooth residual is
explained, and a search for them takes minutes."""
CARRIED_ON = numerical(3)
"""Times that a fit which has not ended by itself is carried on, at most."""


@dataclass
class Search:
    """A search and what it has found.

    Attributes:
        samples: effective number of readings.
        known: what an earlier search found of the same test with its noise known less well, by effects.
        signed: what the effects do to the readings about a null near by.
    """

    fitter: LeastSquaresProblem
    null: Fit
    effects: Sequence[Effect]
    samples: float
    progress: Callable[[str], None] = lambda _: None
    known: Mapping[frozenset[str], ScoredModel] = field(default_factory=dict)
    signed: SignatureSet | None = None
    costs: Costs = field(default_factory=Costs)
    tried: dict[frozenset[str], ScoredModel] = field(default_factory=dict, init=False)
    alarm: float = field(default=0.0, init=False)
    first: list[Score] = field(default_factory=list, init=False)
    _near_null: Fit = field(init=False)
    _something: bool = field(default=True, init=False)
    _signatures: list[tuple[Fit, list[Signature]]] = field(default_factory=list, init=False)
    _beside: dict[frozenset[str], tuple[Fit, list[Score]]] = field(default_factory=dict, init=False)
    _exact_ones: set[frozenset[str]] = field(default_factory=set, init=False)

    def run(self, begun: Sequence[ScoredModel] = ()) -> ScoredModel:
        """The best hypothesis; the null where nothing is significant.

        It goes on from those that fewer readings of the same test left likely; where there are none, from nothing.
        """
        null = self.tried[frozenset()] = self.ranked(self.null)
        # what causes do beside nuisances that were taken far off says little
        self._near_null = self.fitter.near(self.null, START_WITHIN)
        self.first = self._scores(replace(null, fit=self._near_null))
        self.alarm = threshold(self.first)
        self._something = any(score.p < self.alarm for score in self.first) or self.is_wrong(self.rest(self.null))
        best, beam, pairs = null, [null], list[SearchMove]()
        if begun:
            self._fit(SearchMove(r.fit.hypothesis, self.null, [r.fit.values], -np.inf, 0.0) for r in begun)
            for size in {len(r.labels) for r in begun}:
                self._polished(size)
            best = self._best
            beam = self._polished(len(best.labels))[:BEAM]
        while beam and len(beam[0].labels) < MOST_CAUSES:
            size = len(beam[0].labels) + 1
            moves = [move for base in beam for move in self._forward(base)]
            if size == 2:
                moves += pairs
            self._fit(moves)
            level = self._polished(size)
            if size == 1:
                pairs = self._pairs(null)
                # two effects may be significant together where none is alone
                if not pairs and not any(self.significant(r) for r in level):
                    return null
            better = [r for r in level if r.criterion < best.criterion]
            # beside one cause, two others may be better than it
            beam = level[:BEAM] if better or size == 1 else []
            best = min([best, *better], key=lambda r: r.criterion)
        for _ in range(len(best.labels)):
            self._fit([*self._backward(best), *self._swaps(best)])
            self._polished(len(best.labels))
            before, best = best, min((r for r in self.tried.values() if r.labels), key=lambda r: r.criterion)
            if best.labels == before.labels:
                break
        return best if self.significant(best) else null

    def explained(self, fit: Fit) -> float:
        """By how much a fit lowers the objective, squares."""
        return max(self.null.objective - fit.objective, 0.0)

    def rest(self, fit: Fit) -> Misfit:
        """What a fit leaves beyond the noise, and beyond what its causes' laws may be wrong by."""
        return misfit(self.fitter, fit, self.costs.law_error, self.explained(fit))

    def is_wrong(self, rest: Misfit) -> bool:
        """Whether what a fit leaves, or what it takes of the nuisances, is rarer than an alarm."""
        return min(rest.p, rest.prior_p) < self.alarm

    def begun_anew(self, best: ScoredModel) -> ScoredModel:
        """The best hypothesis, once all that may be the best have been begun elsewhere in the shapes of their laws.

        A law has several optima: one that was begun at a stop as hard as usual does not come to a soft one. So
        nothing is unknown, and no cause is less probable than another, by where its fit began.
        """
        if best.labels:
            for near in [r for r in self.tried.values() if r.labels and r.criterion < best.criterion + RIVAL]:
                self.kept(begun_anew(self.fitter, near.fit))
            best = min((r for r in self.tried.values() if r.labels), key=lambda r: r.criterion)
        return best

    def settled(self, ranked: ScoredModel) -> ScoredModel:
        """The same, its fit carried on where it had not come to an end, as long as that makes it better."""
        for _ in range(CARRIED_ON):
            if ranked.fit.converged:
                break
            before = ranked.fit.objective
            self._polish(ranked)
            ranked = self.tried[ranked.labels]
            if ranked.fit.objective > before - self._resolution(ranked.fit):
                break
        return ranked

    def complete_parts(self, best: ScoredModel) -> None:
        """Fit what a hypothesis is without each of its causes, so that the share of each is known."""
        for move in self._backward(best):
            if move.labels not in self.tried:
                self._try(move)
            if move.labels in self.tried:
                self.settled(self.tried[move.labels])

    def complete_singles(self, best: ScoredModel) -> ScoredModel:
        """Fit every cause alone that to first order is not improbable beside the best; the best of them all.

        So what is said to be probable is so by a fit, and what is the most probable does not depend on whether it
        is significant.
        """
        moves = {move.labels: move for move in self._forward(self.tried[frozenset()])}
        best = best if best.labels else self._best
        for effect, value in sorted(self.singles().items(), key=lambda pair: pair[1]):
            labels = frozenset([effect.label])
            if labels in self.tried or value - best.criterion > IMPROBABLE:
                continue
            self._try(moves[labels])
            if labels in self.tried:
                own = self.settled(self.tried[labels])
                best = min(best, own, key=lambda r: r.criterion)
        return best

    def singles(self) -> dict[Effect, float]:
        """Criterion of every cause alone: of its fit where there is one, else to first order."""
        null = frozenset[str]()
        lower = self.tried[null].criterion - self.known[null].criterion if self.known else 0.0
        fitted = {labels: r.criterion + lower for labels, r in self.known.items()}
        fitted |= {labels: r.criterion for labels, r in self.tried.items()}
        moves = self._forward(self.tried[null])
        return {move.hypothesis[0]: fitted.get(move.labels, move.predicted_criterion) for move in moves}

    def significant(self, ranked: ScoredModel) -> bool:
        """Whether what causes explain is rare without any, over the whole catalogue."""
        gain = max(self.null.objective - ranked.fit.objective, 0.0)
        labels = [effect.label for effect in ranked.fit.hypothesis]
        own = [score for score in self.first if [score.effect.label] == labels]
        if own:
            return float(own[0].cone.p_value(np.array([gain]))[0]) < self.alarm
        free = sum(max(len(effect.quantities()), 1) for effect in ranked.fit.hypothesis)
        # so many more hypotheses there are of that size
        return float(chi2_sf(gain, free)) < self.alarm / max(len(self.effects), 1) ** (len(labels) - 1)

    def _scores(self, base: ScoredModel) -> list[Score]:
        """What every other effect explains beside a hypothesis, its laws right to some per cent only."""
        if base.labels in self._beside and self._beside[base.labels][0] is base.fit:
            return self._beside[base.labels][1]
        # what effects do about one fit tells what they do about another near by
        known = next(
            (own for fit, own in self._signatures if abs(fit.objective - base.fit.objective) < STRONG), None
        )
        if known is None:
            if not base.labels and self.signed is not None and self.signed.serves(self.fitter, base.fit):
                known = self.signed.signatures
            else:
                self.progress(f"signatures of {len(self.effects)} effects")
                known = signatures(self.fitter, base.fit, self.effects)
            self._signatures.append((base.fit, known))
        candidates = [s for s in known if s.effect.label not in base.labels]
        ranking = scores(
            self.fitter,
            marginalised(self.fitter, base.fit, self.costs.law_error, self.explained(base.fit)),
            candidates,
        )
        self._beside[base.labels] = base.fit, ranking
        return ranking

    def _forward(self, base: ScoredModel) -> list[SearchMove]:
        """One cause more."""
        moves = []
        for score in self._scores(base) if base.labels else self.first:
            if any(exclusive(e, score.effect) for e in base.fit.hypothesis):
                continue
            starts = [[*base.fit.values, v] for v in score.starts]
            # a slope at nothing says little of a large cause, where there is something at all
            reliable = base.labels or not self._something or linear(score.effect)
            hypothesis = (*base.fit.hypothesis, score.effect)
            promise = base.criterion - score.mixture + self._least_cost(base.fit.hypothesis, score.effect)
            moves.append(
                SearchMove(hypothesis, base.fit, starts, promise, FIRST_ORDER * score.explained, not reliable)
            )
        return moves

    def _pairs(self, null: ScoredModel) -> list[SearchMove]:
        """Of all pairs the best to first order, where they are significant."""
        rare = self.alarm / max(len(self.effects), 1)
        return [
            SearchMove(
                (a.effect, b.effect),
                null.fit,
                [[a.starts[0], b.starts[0]]],
                null.criterion - worth + self._least_cost((), a.effect) + self._least_cost((a.effect,), b.effect),
                FIRST_ORDER * worth,
            )
            for a, b, worth in best_pairs(projection(self.fitter, self._near_null), self.first, PAIRS)
            if chi2_sf(worth, a.cone.dimension + b.cone.dimension) < rare
        ]

    def _backward(self, best: ScoredModel) -> list[SearchMove]:
        """One cause less."""
        moves = []
        for i in range(len(best.labels) if len(best.labels) > 1 else 0):
            rest = tuple(e for k, e in enumerate(best.fit.hypothesis) if k != i)
            values = [v for k, v in enumerate(best.fit.values) if k != i]
            moves.append(SearchMove(rest, best.fit, [values], -np.inf, 0.0))
        return moves

    def _swaps(self, best: ScoredModel) -> list[SearchMove]:
        """Another cause in the place of one."""
        moves = []
        for effect in best.fit.hypothesis:
            rest = self.tried.get(best.labels - {effect.label})
            if rest is not None:
                # of a hypothesis of this size near the best the first order can be relied on
                moves += [
                    replace(move, criterion_error=0.0) for move in self._forward(rest) if move.labels != best.labels
                ]
        return moves

    def _least_cost(self, before: Hypothesis, effect: Effect) -> float:
        """What a further cause costs at least, whatever the readings narrow its parameters down to."""
        cost = choice((*before, effect), self.effects, self.costs) - choice(before, self.effects, self.costs)
        sizes = effect.quantities()[: effect.extent]
        free = release_key(effect) is not None or any(not (q.log or np.isfinite(q.spread)) for q in sizes)
        return cost + (float(np.log(self.samples)) if free else 0.0)

    def _fit(self, moves: Iterable[SearchMove]) -> None:
        """Fit the most promising hypotheses: larger ones that may be better than the best, others as good."""
        fitted, missed = 0, 0.0
        for move in sorted(moves, key=lambda move: move.predicted_criterion):
            # what the first order has missed of one it may miss of the next
            wanted = (move.always_fit and self._seen(move)) or (self._hopeful(move, missed) and fitted < WIDTH)
            if wanted and move.labels not in self.tried and not self._beaten(move):
                self._try(move)
                fitted += not move.always_fit
                if move.labels in self.tried and move.predicted_criterion > -np.inf:
                    missed = max(missed, move.predicted_criterion - self.tried[move.labels].criterion)

    @property
    def _best(self) -> ScoredModel:
        """Of what was tried."""
        return min(self.tried.values(), key=lambda r: r.criterion)

    def _hopeful(self, move: SearchMove, missed: float = 0.0) -> bool:
        """Whether to first order, which is wrong by so much at least, a hypothesis may be as good as the best."""
        best = self._best
        rival = RIVAL if len(move.labels) <= len(best.labels) else 0.0
        return move.predicted_criterion - max(move.criterion_error, missed) < best.criterion + rival

    def _seen(self, move: SearchMove) -> bool:
        """Whether a hypothesis may to first order explain a share of what the best does, rivals aside."""
        null = self.tried[frozenset()].criterion
        return null + RIVAL - move.predicted_criterion > UNSEEN * (null - self._best.criterion)

    def _beaten(self, move: SearchMove) -> bool:
        """Whether an earlier search found a hypothesis nearer to nothing than to the best.

        What the best is without one of its causes is always fitted.
        """
        if move.labels not in self.known or move.predicted_criterion == -np.inf:
            return False
        least, null = min(r.criterion for r in self.known.values()), self.known[frozenset()].criterion
        return self.known[move.labels].criterion > 0.5 * (least + null)

    def _try(self, move: SearchMove) -> None:
        """Fit a hypothesis."""
        hypothesis, base = move.hypothesis, move.base
        self.progress(" + ".join(effect.label for effect in hypothesis))
        m = len(self.fitter.nuisances)
        # what a wrong model has freed is its own affair
        held = np.array([np.isfinite(c.sigma) for c in base.parameters[:m]])
        begin = np.where(held, np.clip(base.evaluation.z[:m], -START_WITHIN, START_WITHIN), base.evaluation.z[:m])
        starts, begins = move.starts, [begin]
        earlier = self.known.get(move.labels)
        if earlier is not None and earlier.fit.hypothesis == hypothesis:
            starts, begins = [earlier.fit.values], [earlier.fit.evaluation.z[:m]]
        elif not base.hypothesis:
            begins += alternative_starts(hypothesis[-1], self.fitter.nuisances, begin)
        target = self._worth_reaching(base)
        enough, borrowed = move.predicted_criterion + move.criterion_error, self.fitter.machine_slopes(base)
        best: Fit | None = None
        for z, values in product(begins, starts):
            best = _lower(best, best_fit(self.fitter, hypothesis, z, values, borrowed=borrowed, target=target))
            if best is not None and best.objective < enough:
                break
        contains = {e.label for e in base.hypothesis} < move.labels
        worse = best is None or (contains and best.objective > base.objective and not sizeless(hypothesis[-1]))
        # begun at the base it follows the first order, which says how far that leads
        if worse and (best is None or self._hopeful(move)):
            best = _lower(best, self._from_base(hypothesis, base, move.starts[0], target))
        if best is not None:
            self.tried[move.labels] = self.ranked(self._as_usual(best, borrowed, target))

    def _as_usual(self, fit: Fit, borrowed: Array | None, target: float) -> Fit:
        """A fit begun anew with the usual shapes of its laws, as long as that makes it better.

        Size and shape may make up for one another along a curve, on which steps soon become too short. Where the
        usual shapes at no cost would not make it worth reaching, it stays.
        """
        for _ in range(CARRIED_ON):
            cost, resolution = shapes_cost(fit.parameters, fit.evaluation.z), self._resolution(fit)
            if cost < resolution or self.fitter.squares(fit.parameters, fit.evaluation) - cost > target:
                break
            usual = [usual_shapes(e, v) for e, v in zip(fit.hypothesis, fit.values, strict=True)]
            begin = fit.evaluation.z[: len(self.fitter.nuisances)]
            other = best_fit(self.fitter, fit.hypothesis, begin, usual, borrowed=borrowed, target=target)
            if other is None or other.objective > fit.objective - resolution:
                break
            fit = other
        return fit

    def _resolution(self, fit: Fit) -> float:
        """By how much less the objective of a better fit must be."""
        return self.fitter.resolution(self.fitter.squares(fit.parameters, fit.evaluation))

    def _worth_reaching(self, base: Fit) -> float:
        """Squares of a fit from which its laws' discrepancy may still make it as good as the best."""
        least = self._best.criterion
        by_laws = (NINE_IN_TEN * self.costs.law_error) ** 2 * max(self.null.objective - least, 0.0)
        constant = base.objective - self.fitter.squares(base.parameters, base.evaluation)
        return least + RIVAL + by_laws - constant

    def _from_base(
        self, hypothesis: Hypothesis, base: Fit, values: Sequence[Sequence[float]], target: float
    ) -> Fit | None:
        """A fit that begins at a hypothesis with a cause less, with next to none of that cause."""
        known = {effect.label: own for effect, own in zip(base.hypothesis, base.values, strict=True)}
        begin = [
            known.get(effect.label) or towards_nothing(effect, own, FAINT)
            for effect, own in zip(hypothesis, values, strict=True)
        ]
        own = base.evaluation.z[: len(self.fitter.nuisances)]
        borrowed = self.fitter.machine_slopes(base)
        return best_fit(self.fitter, hypothesis, own, begin, borrowed=borrowed, target=target)

    def _polished(self, size: int) -> list[ScoredModel]:
        """Hypotheses of one size, the best first; those that may be the best by exact fits."""
        while True:
            level = sorted((r for r in self.tried.values() if len(r.labels) == size), key=lambda r: r.criterion)
            open_ = [r for r in level[:BEAM] if r.labels not in self._exact_ones]
            if not open_:
                return level
            self._polish(open_[0])

    def _polish(self, ranked: ScoredModel) -> None:
        """The exact fit, by how the machine's own nuisances act beside the hypothesis' causes."""
        self._exact_ones.add(ranked.labels)
        m = len(self.fitter.nuisances)
        fit = best_fit(self.fitter, ranked.fit.hypothesis, ranked.fit.evaluation.z[:m], ranked.fit.values)
        if fit is not None and fit.objective < ranked.fit.objective + RIVAL:
            self.tried[ranked.labels] = self.ranked(fit)

    def kept(self, fit: Fit) -> ScoredModel:
        """A fit with what it is worth, among what was tried; a better one of the same effects stays there."""
        ranked = self.ranked(fit)
        known = self.tried.get(ranked.labels)
        if known is None or ranked.criterion < known.criterion:
            self.tried[ranked.labels] = ranked
        return self.tried[ranked.labels]

    def ranked(self, fit: Fit) -> ScoredModel:
        """A fit with what it is worth."""
        value = criterion(self.fitter, fit, self.effects, self.samples, self.costs)
        by_laws = discrepancy(self.fitter, fit, self.costs.law_error, self.explained(fit))
        return ScoredModel(fit, value + by_laws, value - fit.objective)


def _lower(*fits: Fit | None) -> Fit | None:
    """Of fits the best, where there is one."""
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.objective, default=None)
