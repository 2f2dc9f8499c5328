"""From a search to a verdict: none, named, class or unknown, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.discrepancy import Misfit, blocks_of, marginalised, misfit
from vjm_updating.diagnosis.document import (
    SURE,
    FindingsRow,
    GainRow,
    PosteriorSample,
    acting,
    by_hypotheses,
    credible,
    findings_of,
    groups_of,
    shares_of,
)
from vjm_updating.diagnosis.evidence import ScoredModel
from vjm_updating.diagnosis.screening import Projection
from vjm_updating.diagnosis.search import RIVAL, Search
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem, weighed
from vjm_updating.inference.model_error import NODES, WEIGHTS, largest, smooth_shapes
from vjm_updating.inference.significance import LAW_ERROR, NORMAL_95, RARER
from vjm_updating.mechanisms.effect import Effect

# --- The hypothesis that a cause acts which no catalogue has: shapes without a name, each kind of its own size
#
# What the sheet's tolerances leave is then noise and zero-mean Gaussian shapes. There are smooth ones along the
# ramp, in time, while held, and between loading and unloading, and sudden ones
# (`vjm_updating.inference.model_error`). They act in one channel, or in all where something deflects along the
# displacement, or rough. Some one kind is expected to act; of its size nothing is known, and it is integrated out.
# What remains is an evidence like any cause's, so that nothing but the posterior says whether a cause is named.

SIZES = numerical(np.geomspace(0.5, 500.0, 40))
"""Standard deviations of a kind's shapes, in units of the noise's, evenly by their logarithms: from what no test
can see to the strongest that there is."""
EVENLY = numerical(np.full(len(SIZES), 1.0 / len(SIZES)))
"""Weights of the sizes."""
OVERLAP = numerical(0.05)
"""Singular value below which a direction belongs to the kinds before."""


def unmodelled(fitter: LeastSquaresProblem, fit: Fit, law_error: float = 0.0, explained: float = 0.0) -> float:
    """What shapes without a name add to the criterion of a fit, beside which they act.

    A nuisance that lies where its sheet does not let it be is one of the shapes. What the laws of the fit's causes
    may be wrong by, see `marginalised`, is noise; in the shapes of readings their errors compete besides.
    ``law_error`` is relative; ``explained`` are the squares that the causes explain.
    """
    own = replace(fitter, whitening=weighed(fitter.whitening, fitter.forward.observed, fit.evaluation))
    space = marginalised(own, fit, law_error, explained)
    beyond = np.eye(len(space.residual))[:, sorted(set(space.released.values()))]
    of_readings = [*_deflection_shapes(own, fit, space), *(block.directions for block in blocks_of(own, space))]
    of_sheet = [column[:, None] for column in space.rest(beyond).T]
    kinds = [*of_readings, *of_sheet]
    basis = np.empty((len(space.residual), sum(min(kind.shape) for kind in kinds)), order="F")
    known = basis[:, :0]
    parts = []
    for number, directions in enumerate(kinds):
        free = directions - known @ (known.T @ directions)
        U, sizes, _ = np.linalg.svd(free - known @ (known.T @ free), full_matrices=False)
        U = U[:, sizes > OVERLAP]
        basis[:, known.shape[1] : known.shape[1] + U.shape[1]] = U
        known = basis[:, : known.shape[1] + U.shape[1]]
        if U.shape[1]:
            by_laws = number < len(of_readings)
            parts.append((U.shape[1], float(np.sum((U.T @ space.residual) ** 2)), by_laws))
    # and what is rough has no shape at all
    left = len(space.residual) - space.basis.shape[1] - known.shape[1]
    rough = float(space.residual @ space.residual) - sum(squares for _, squares, _ in parts)
    parts.append((left, rough, True))
    chance = 1.0 / (1 + len(parts))
    add = 0.0
    for dimension, squares, by_laws in parts:
        add += kind_present(dimension, squares, chance)
        if by_laws and explained > 0.0:
            # the same squares in all, spread over the shapes
            wrong = law_error * NODES * (explained / dimension) ** 0.5
            add -= kind_present(dimension, squares, chance, wrong, WEIGHTS)
    return add


def _deflection_shapes(fitter: LeastSquaresProblem, fit: Fit, space: Projection) -> list[Array]:
    """What the readings show where something deflects along the displacement, by kinds of smooth shapes."""
    observed = fitter.forward.observed
    along = np.zeros((len(observed.imposed), 6))
    for ray in observed.rays:
        along[ray.index] = ray.direction
    force = np.einsum("nij,nj->ni", fit.evaluation.stiffness, along)
    shapes, names = smooth_shapes(observed)
    raw = fitter.whitening.flat(np.where(observed.present, force, 0.0)[:, :, None] * shapes[:, None, :])
    columns = space.rest(np.vstack([raw, np.zeros((len(space.residual) - space.rows, raw.shape[1]))]))
    size = np.linalg.norm(columns, axis=0)
    seen = size > OVERLAP * np.linalg.norm(raw, axis=0)
    kinds: dict[str, list[int]] = {}
    for i in np.flatnonzero(seen):
        kinds.setdefault(names[i].partition(": ")[2], []).append(int(i))
    return [columns[:, own] / size[own] for own in kinds.values()]


def kind_present(
    dimension: int, squares: float, chance: float, sizes: Array = SIZES, weights: Array = EVENLY
) -> float:
    """Twice the negative logarithm of the evidence with a kind of shapes that may act, over that of noise alone.

    Its shapes span so many dimensions, with ``squares`` of the whitened residual. It may have ``sizes`` (k,) by
    their ``weights`` (k,): standard deviations in units of the noise's.
    """
    variance = sizes**2
    by_size = 0.5 * (squares * variance / (1.0 + variance) - dimension * np.log1p(variance))
    acts = np.logaddexp.reduce(by_size + np.log(weights))
    return -2.0 * float(np.logaddexp(np.log1p(-chance), np.log(chance) + acts))


RIVALS = numerical(12)
"""Hypotheses that are compared with the best at most."""


@dataclass(frozen=True)
class Verdict:
    """What a search says.

    Attributes:
        kind: none, named, class or unknown.
        members: hypotheses that remain possible, the most probable first.
        confidence: posterior probability that kind and set are right.
        places: of each member the hypotheses that have its causes elsewhere: the likeliest, see
            `credible_places`.
        doubt: why causes that fit are not named, in words; empty where that is not so.
        more_than_noise: whether the best leaves more than noise, or takes more than the sheet's tolerances.
        within_law_error: whether it is noise only beside what the causes' laws may be wrong by.
    """

    kind: str
    members: tuple[ScoredModel, ...]
    probabilities: tuple[float, ...]
    confidence: float
    others: tuple[tuple[ScoredModel, float], ...]
    rest: Misfit
    places: tuple[tuple[ScoredModel, ...], ...] = ()
    doubt: str = ""
    posterior: Posterior | None = None
    more_than_noise: bool = False
    within_law_error: bool = False

    @property
    def findings(self) -> FindingsRow:
        """What the posterior says in words; nothing is said to act where the verdict is unknown."""
        if self.posterior is None:
            return FindingsRow()
        posterior = self.posterior
        p, places = posterior.causes
        return findings_of(
            p,
            posterior.shares,
            groups_of(posterior.hypotheses),
            explained=posterior.explained,
            left=posterior.left,
            more_than_noise=self.more_than_noise,
            within_law_error=self.within_law_error,
            trusted=self.kind != "unknown",
            places=places,
            nothing=posterior.nothing,
            # the residual, and what was held out, speak beyond the posterior
            unknown=self.confidence if self.kind == "unknown" else posterior.unknown,
            within_law=dict.fromkeys(posterior.unsure, posterior.main),
        )


def judge(search: Search, best: ScoredModel) -> Verdict:
    """The verdict on a search's best hypothesis, and the findings that it follows from."""
    fitter = search.fitter
    # among as many causes as the catalogue has
    choice = 2.0 * float(np.log(len({effect.cause for effect in search.effects}) or 1))
    alone = ScoredModel(search.null, search.null.objective + unmodelled(fitter, search.null) + choice, choice)
    best = _settled(search, search.complete_singles(best), alone.criterion)
    rest = search.rest(best.fit)
    if best.labels:
        search.complete_parts(best)
        for near in [r for r in search.tried.values() if r.criterion < best.criterion + RIVAL]:
            search.settled(near)
    # or an unknown one acts beside the causes found
    inexact = search.costs.law_error > 0.0 and any(not effect.exact for effect in best.fit.hypothesis)
    explained = search.explained(best.fit) if inexact else 0.0
    beside = ScoredModel(best.fit, np.inf)
    if best.labels:
        further, cost = unmodelled(fitter, best.fit, search.costs.law_error, explained), choice + RARER
        beside = ScoredModel(best.fit, best.criterion + further + cost, best.cost + cost)
    power = coarsening(explained, search.costs.law_error) if search.costs.other_shapes else 1.0
    posterior = posterior_of(search, best, alone, beside, power)
    weights = weights_of(search.tried.values(), best)
    wrong = posterior.unknown > 0.5 or search.is_wrong(rest)
    within = not wrong and rest.law_error > 0.0 and search.is_wrong(misfit(fitter, best.fit))
    bare = Verdict(
        "none", (), (), posterior.nothing, (), rest, posterior=posterior, more_than_noise=wrong,
        within_law_error=within,
    )  # fmt: skip
    # what a law's error may leave, and what it costs to take a nuisance off its sheet, is in the posterior; beyond
    # the largest error that a law has, more than noise is no error of a law
    farthest = rest.law_error == largest(search.costs.law_error)
    refused = not best.fit.converged or (wrong and (farthest or not inexact))
    # a cause is named where it is sure that one acts
    sound = not best.labels or posterior.nothing > 1.0 - SURE
    if posterior.unknown > 0.5 or (refused and not sound):
        # a residual that is more than noise is a reason beyond the posterior's: even odds at least
        sure = max(0.5, posterior.unknown)
        return replace(bare, kind="unknown", confidence=sure, others=_others(weights, []))
    if sound:
        return replace(bare, others=_others(weights, []))
    # in whichever place it is, it is that cause; those beside the main one that are not sure to act are not named
    unsure = posterior.unsure
    less = [r for r in weights if r.causes == best.causes - unsure]
    best, unsure = (min(less, key=lambda r: r.criterion), unsure) if less else (best, frozenset())
    named = {r: r.causes - unsure or r.causes for r in weights}
    total = {r: sum(w for other, w in weights.items() if named[other] == r.causes) for r in weights}
    members = credible_causes(best, total)
    own = np.array([total[m] for m in members])
    share = own / own.sum()
    return replace(
        bare,
        kind="class" if len(members) > 1 else "named",
        members=tuple(members),
        probabilities=tuple(float(v) for v in share),
        confidence=float(own.sum()) * (1.0 - posterior.unknown),
        others=_others(weights, members),
        places=tuple(credible_places(weights, member) for member in members),
    )


def credible_causes(best: ScoredModel, total: Mapping[ScoredModel, float]) -> list[ScoredModel]:
    """The fewest sets of causes of which one is right with 95 %, the best one among them and first.

    A set that says the same as a member with more causes or parameters counts as that member. One without a cause
    does not count. ``total`` has the probability of each one's causes, in whichever places.
    """
    sets = {best.causes: best}
    for rival in sorted(total, key=lambda r: (-total[r], r.criterion)):
        if rival.labels and rival.fit.converged:
            sets.setdefault(rival.causes, rival)
    p = {one: total[one] for one in sets.values()}
    return credible(best, p, needless, RIVALS)


@dataclass(frozen=True)
class Posterior:
    """Probabilities of all hypotheses of a search, nothing and the unknown among them.

    Attributes:
        hypotheses: causes in their places; those beside which an unknown cause acts are among them.
        unknown: that something acts that no catalogue has, alone or beside the best.
        shares: of what the nominal model misses, by cause, in the likeliest hypothesis with it.
        explained: of that, by the best.
        left: root mean square of what the best leaves, over the noise.
        held: of each cause beside the main one of the best, the probability that it acts for all data as near as
            laws are right, given that the main one does; see `coarsening`.
        main: cause of the best with the largest share; empty where there is none.
    """

    hypotheses: tuple[PosteriorSample, ...]
    nothing: float
    unknown: float
    shares: Mapping[str, float]
    explained: float
    left: float
    held: Mapping[str, float] = field(default_factory=dict)
    main: str = ""

    @property
    def unsure(self) -> frozenset[str]:
        """Causes of the best beside its main one that are not sure to act, nor of a group of which one is."""
        exchanged = {cause for row in groups_of(self.hypotheses) for cause in row.causes}
        return frozenset(cause for cause, p in self.held.items() if p < SURE and cause not in exchanged)

    @property
    def causes(self) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
        """Probability that each cause acts, also where laws are not quite right, and that of every place of it."""
        p, places = by_hypotheses(self.hypotheses)
        return {cause: min(own, self.held.get(cause, own)) for cause, own in p.items()}, places


def coarsening(explained: float, law_error: float) -> float:
    """The power of the likelihood under laws that are right to some per cent only, whatever shape they are off in.

    Readings of a machine whose law is wrong by ε of what it explains, S squares, lie by ``ε² S/2`` off the model's
    distribution (Kullback's divergence). What is probable for all data as near as that has the likelihood to the
    power ``1/(1 + ε² S/2)`` (Miller and Dunson, J. Am. Stat. Assoc. 114, 1113, 2019; that is the mean of the
    divergence's exponential prior). A strong cause stays as sure as it was. What is a few per cent of it does not.
    The squares S that such laws explain are ``explained``; ε is ``law_error``, scale of the relative error's
    half-Cauchy prior, which is its median.

    Example:
        >>> coarsening(0.0, 0.03), round(coarsening(10_000.0, 0.03), 2)
        (1.0, 0.18)
    """
    return 1.0 / (1.0 + 0.5 * law_error**2 * explained)


def posterior_of(
    search: Search, best: ScoredModel, alone: ScoredModel, beside: ScoredModel, power: float = 1.0
) -> Posterior:
    """Probabilities of what was tried, of single causes that were not, and of an unknown one.

    The unknown cause acts ``alone``, or ``beside`` the best's; ``power`` is that of the likelihood in
    `Posterior.held`.
    """
    tried = {
        r.labels: r for r in search.tried.values() if r.fit.converged or r.labels in (frozenset(), best.labels)
    }
    places = {labels: _places(r.fit.hypothesis) for labels, r in tried.items()}
    worth = dict(tried)
    for effect, value in search.singles().items():
        labels = frozenset([effect.label])
        # what was not worth a fit is not worth more than its promise; what promised more than the best was tried,
        # and its fit failed
        if labels not in worth and value > best.criterion:
            worth[labels], places[labels] = ScoredModel(search.null, value), _places((effect,))

    def weighed(power: float) -> tuple[list[PosteriorSample], float, float]:
        """Hypotheses, nothing, and the unknown."""
        values = np.array([r.coarsened(power).criterion for r in (*worth.values(), alone, beside)])
        w = np.exp(-0.5 * np.minimum(values - values.min(), 1400.0))
        *own, only, further = (w / w.sum()).tolist()
        known = [PosteriorSample(places[labels], v) for labels, v in zip(worth, own, strict=True) if labels]
        known.append(PosteriorSample(_places(best.fit.hypothesis), further))
        return known, next(v for labels, v in zip(worth, own, strict=True) if not labels), only + further

    known, nothing, unknown = weighed(1.0)
    fitter = search.fitter
    number = int(fitter.whitening.present.sum())
    squares = {r.labels: fitter.squares(r.fit.parameters, r.fit.evaluation) for r in search.tried.values()}
    missed = squares[frozenset()] - number
    shares: dict[str, float] = {}
    for r in sorted(tried.values(), key=lambda r: r.criterion):
        for cause, share in _shares(r, squares, missed).items():
            shares.setdefault(cause, share)
    main = max(sorted(best.causes), key=lambda cause: shares.get(cause, 0.0), default="")
    residual = fitter.whitening.flat(best.fit.evaluation.residual)
    return Posterior(
        hypotheses=tuple(known),
        nothing=nothing,
        unknown=unknown,
        shares=shares,
        explained=_explained(squares[best.labels], squares, missed),
        left=float(np.sqrt(residual @ residual / max(number - len(best.fit.parameters), 1))),
        held=_held(weighed(power)[0], main, best.causes) if main else {},
        main=main,
    )


def _held(coarsened: Sequence[PosteriorSample], main: str, causes: frozenset[str]) -> dict[str, float]:
    """Probability of each cause of the best beside its main one, given that one."""
    with_main = [h for h in coarsened if main in h.places]
    whole = max(sum(h.probability for h in with_main), 1e-300)
    return {cause: acting(with_main, [cause]) / whole for cause in sorted(causes - {main})}


def _places(hypothesis: Sequence[Effect]) -> dict[str, list[str]]:
    places: dict[str, list[str]] = {}
    for effect in hypothesis:
        places.setdefault(effect.cause, []).append(effect.place)
    return places


def _explained(left: float, squares: Mapping[frozenset[str], float], missed: float) -> float:
    """Share of what the nominal model misses beyond its noise; none where it misses nothing."""
    return float(np.clip((squares[frozenset()] - left) / missed, 0.0, 1.0)) if missed > 0.0 else 0.0


def _shares(ranked: ScoredModel, squares: Mapping[frozenset[str], float], missed: float) -> dict[str, float]:
    """What each cause of a hypothesis explains: what is missed without it, of all that they explain together.

    Where it is not known what is missed without one of them, none has a share.
    """
    lost: dict[str, float] = {}
    for effect in ranked.fit.hypothesis:
        less = ranked.labels - {effect.label}
        if less not in squares:
            return {}
        lost[effect.cause] = lost.get(effect.cause, 0.0) + max(squares[less] - squares[ranked.labels], 0.0)
    return shares_of(_explained(squares[ranked.labels], squares, missed), lost)


def _settled(search: Search, best: ScoredModel, strange: float) -> ScoredModel:
    """The best hypothesis whose fit has come to an end, for of another there is no evidence; else the best."""
    settled = search.settled(best)
    if settled.fit.converged or not settled.labels:
        return settled
    for other in sorted(search.tried.values(), key=lambda r: r.criterion):
        if other.labels and other.labels != best.labels and other.criterion < strange:
            other = search.settled(other)
            if other.fit.converged:
                return other
    return settled


def proved(verdict: Verdict, gain: GainRow) -> Verdict:
    """What the prediction of readings held out makes of a verdict.

    Causes that predict them worse than the sheet's tolerances alone, by more than their scatter, are an accident.
    But where what was held out lies so far from the rest that a right model could hardly do better, it proves
    nothing: readings held out together are wrong together, by one error of a normal distribution.

    Laws are off by a largest share at most, see `vjm_updating.inference.model_error.NODES`. Causes that leave more
    of what was held out than such laws would are not those that act.
    """
    causes = " + ".join(sorted(verdict.members[0].causes))
    if predicts_worse(gain) and gain.after_in_sigma > NORMAL_95 * gain.expected_in_sigma:
        return withdrawn(verdict, f"{causes} fits, but predicts what was held out worse than no cause does")
    most = float(np.hypot(gain.expected_in_sigma, largest(LAW_ERROR) * gain.before_in_sigma))
    if gain.after_in_sigma > NORMAL_95 * most:
        return withdrawn(verdict, f"{causes} fits, but explains hardly anything of what was held out")
    return verdict


def predicts_worse(gain: GainRow) -> bool:
    """Whether causes predict what was held out worse than the tolerances alone, by more than their scatter."""
    return gain.interval95[1] < 0.0 and gain.after_in_sigma > gain.before_in_sigma


def withdrawn(verdict: Verdict, doubt: str) -> Verdict:
    """Unknown instead of a verdict that names causes, and why, in words; they stay among what is less likely."""
    named = tuple(zip(verdict.members, verdict.probabilities, strict=True))
    return replace(
        verdict,
        kind="unknown",
        members=(),
        probabilities=(),
        confidence=max(0.5, 1.0 - verdict.confidence),
        others=(*named, *verdict.others),
        places=(),
        doubt=doubt,
    )


def needless(best: ScoredModel, rival: ScoredModel) -> bool:
    """Whether a rival that is no better says the same with more causes, or with a parameter more."""
    if len(rival.labels) > len(best.labels) or rival.labels > best.labels:
        return True
    others = [effect for effect in best.fit.hypothesis if effect.label not in rival.labels]
    contained = {name for effect in rival.fit.hypothesis for name in effect.contains}
    return bool(others) and all(contained.intersection((effect.cause, effect.label)) for effect in others)


def weights_of(tried: Iterable[ScoredModel], best: ScoredModel) -> dict[ScoredModel, float]:
    """Probability of every hypothesis tried, by its criterion.

    Supersets of the best, which say the same with more, and fits that have not come to an end have none.
    """
    ranked = [
        r
        for r in tried
        if r.labels == best.labels or (r.fit.converged and not (best.labels and r.labels > best.labels))
    ]
    criteria = np.array([r.criterion for r in ranked])
    w = np.exp(-0.5 * np.minimum(criteria - criteria.min(), 1400.0))
    return {r: float(v) for r, v in zip(ranked, w / w.sum(), strict=True)}


def credible_places(weights: Mapping[ScoredModel, float], member: ScoredModel) -> tuple[ScoredModel, ...]:
    """The likeliest hypotheses that have a member's causes elsewhere: with it, a credible set of 95 %.

    So intervals of parameters hold what they say also where it is not known which place it is.
    """
    w = {r: own for r, own in weights.items() if r is member or in_other_places(r, member)}
    together = sum(w.values())
    return tuple(r for r in credible(member, {r: own / together for r, own in w.items()}) if r is not member)


def in_other_places(ranked: ScoredModel, member: ScoredModel) -> bool:
    """Whether a hypothesis has a member's causes in other places."""
    same = ranked.causes == member.causes and len(ranked.labels) == len(member.labels)
    return same and ranked.labels != member.labels and ranked.fit.converged


def _others(weights: dict[ScoredModel, float], members: list[ScoredModel]) -> tuple[tuple[ScoredModel, float], ...]:
    inside = {m.causes for m in members}
    left = [(r, w) for r, w in weights.items() if r.causes not in inside and r.labels]
    return tuple(sorted(left, key=lambda pair: -pair[1])[:5])
