"""Which families explain a test: by evidence, as causes of ramps do, and by what they predict of postures held out.

Families are added, taken out and exchanged as long as the evidence grows. It is that of the readings with their
noise, over the sizes of the families. What the choice costs is in it: of so many families one acts in the mean, and
machines that lack two are rarer than those that lack one. The first search takes the readings as independent. What
its best hypothesis leaves shows how those of like postures are correlated, and the search goes on with that.

What is held out takes back: a family with which postures held out are predicted worse is not named, whatever its
evidence. So is one by which other series of the machine are predicted worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.document import SURE, PosteriorSample
from vjm_updating.inference.significance import RARER
from vjm_updating.poses.families import DRIVES
from vjm_updating.poses.held_out import distances_of, errors_at_ends, saved, worse_with
from vjm_updating.poses.state import FittedState, Hypothesis
from vjm_updating.poses.study import SeriesStudy, Study, couplings

MOST_STEPS = numerical(16)
AGAIN = numerical(2)
"""Searches more at most, each with the noise that the last one's best shows."""


@dataclass(frozen=True)
class Move:
    """A hypothesis one step off another.

    Attributes:
        name: in words, what is added, taken out or exchanged.
        hypothesis: then.
        gain: of the logarithm of the evidence, costs of the choice included.
    """

    name: str
    hypothesis: Hypothesis
    gain: float


@dataclass(frozen=True)
class Step:
    """A step of the selection.

    Attributes:
        added: what was done.
        state: then.
        moves: all that were looked at from there, the best first.
        ends: ``(g, k)`` distances at the ends of what was measured, held out.
        beside: ``(g, k)`` distances of each other series, nothing refitted but frames and zeros.
    """

    added: str
    state: FittedState
    moves: tuple[Move, ...]
    ends: Array
    beside: tuple[Array, ...] = ()


@dataclass
class Selection:
    """A selection of families.

    Attributes:
        study: the test.
        possible: families and couplings that are thought possible.
        progress: hears what is being done.
        series: other series of the same machine.
        steps: from nothing to the last.
        refused: families that were taken back, with the reason.
    """

    study: Study
    possible: Sequence[str]
    progress: Callable[[str], None] = lambda _: None
    series: Sequence[SeriesStudy] = ()
    steps: list[Step] = field(default_factory=list, init=False)
    refused: dict[str, str] = field(default_factory=dict, init=False)

    @property
    def state(self) -> FittedState:
        """The last one."""
        return self.steps[-1].state

    def run(self) -> Selection:
        """Search, look at the noise, search on; then take back what does not hold where it was held out."""
        self.progress("base frame and markers")
        self._add("", self.study.gauss_newton(Hypothesis()))
        self._climb()
        for _ in range(AGAIN):
            before = set(self.state.hypothesis.names)
            # the fit stays, and with it what it predicts
            self.steps[-1] = replace(self.steps[-1], state=self.study.judged(self.state))
            self._climb()
            if set(self.state.hypothesis.names) == before:
                break
        while (worst := self._worst()) is not None:
            name, self.refused[name] = worst
            self._add(f"without {name}", self.study.gauss_newton(self.state.hypothesis.minus(name), self.state))
            self._climb()
        if DRIVES in self.state.hypothesis.families:
            self._replace(with_needed(self.study, self.state))
            for name in [m.name for m in self.study.members if m.family == DRIVES]:
                h = self.state.hypothesis
                less = replace(h, kept=(*h.kept, name))
                if name not in h.kept and (reason := self._worse_beside(less)):
                    self.refused[name] = reason
                    self._replace(self.study.gauss_newton(less, self.state))
        return self

    def worth(self, state: FittedState, hypothesis: Hypothesis) -> float:
        """Logarithm of the evidence of a hypothesis where another one has settled, with what its choice costs.

        Drives of which the sheet sets the model's compliance aside are known to deflect.
        """
        chosen = [name for name in hypothesis.names if not (name == DRIVES and self.study.sheet.test.rigid)]
        cost = len(chosen) * float(np.log(max(len(self.possible), 1))) + 0.5 * RARER * max(len(chosen) - 1, 0)
        return self.study.evidence(state, hypothesis) - cost

    def weighed(self) -> list[PosteriorSample]:
        """The last hypothesis and those one move off, with their probabilities.

        Of those that are near, or seem better, the evidence is that of their own fit. At another one, a family
        borrows effects of the one that it stands for, as masses do of compliances, which are gone once it has
        settled.
        """
        last = self.steps[-1]
        gains = {frozenset(self.state.hypothesis.names): 0.0}
        for move in last.moves:
            gain, larger = move.gain, len(move.hypothesis.names) > len(self.state.hypothesis.names)
            if gain > (0.0 if larger else np.log(1.0 - SURE)):
                gain = self._gain(self.study.gauss_newton(move.hypothesis, self.state), self.state.hypothesis)
            gains[frozenset(move.hypothesis.names)] = gain
        # what was refused, or found to be worse once it had settled, is not likelier than what was chosen
        w = np.exp(np.minimum(list(gains.values()), 0.0))
        return [
            PosteriorSample({name: [name] for name in sorted(names)}, float(p))
            for names, p in zip(gains, w / w.sum(), strict=True)
        ]

    def _gain(self, state: FittedState, other: Hypothesis) -> float:
        """Logarithm of the evidence of a state over that of another hypothesis, where the first one has settled.

        Both are of the same readings with the same weights.
        """
        return self.worth(state, state.hypothesis) - self.worth(state, other)

    def _climb(self) -> None:
        """Make the best move as long as one makes the evidence larger."""
        seen = {frozenset(self.state.hypothesis.names)}
        for _ in range(MOST_STEPS):
            step = self.steps[-1]
            worth = self.worth(step.state, step.state.hypothesis)
            self.steps[-1] = replace(step, moves=self._moves(step.state, worth))
            for move in self.steps[-1].moves:
                if move.gain <= 0.0:
                    return
                names = frozenset(move.hypothesis.names)
                if names in seen:
                    continue
                seen.add(names)
                self.progress(move.name)
                state = self.study.gauss_newton(move.hypothesis, step.state)
                if self._gain(state, step.state.hypothesis) > 0.0:
                    self._add(move.name, state)
                    break
            else:
                return

    def _moves(self, state: FittedState, worth: float) -> tuple[Move, ...]:
        """One family more, one less, or one in the place of another."""
        h = state.hypothesis
        left = [name for name in self.possible if name not in h.names and name not in self.refused]
        near = {name: h.plus(name) for name in left} | {f"without {name}": h.minus(name) for name in h.names}
        moves = [self._move(name, other, state, worth) for name, other in near.items()]
        if all(move.gain <= 0.0 for move in moves):
            bases = {"": h} | {f"{m.name} and ": m.hypothesis for m in moves if m.gain > np.log(1.0 - SURE)}
            exchanged = {
                f"{name}{new} in place of {old}": base.minus(old).plus(new)
                for name, base in bases.items()
                for old in h.names
                for new in left
                if old in base.names and new not in base.names
            }
            moves += [self._move(name, other, state, worth) for name, other in exchanged.items()]
        return tuple(sorted(moves, key=lambda move: -move.gain))

    def _move(self, name: str, hypothesis: Hypothesis, state: FittedState, worth: float) -> Move:
        return Move(name, hypothesis, self.worth(state, hypothesis) - worth)

    def _worst(self) -> tuple[str, str] | None:
        """The last added family that does not hold where it was held out, and the reason."""
        state, ends = self.state, self.steps[-1].ends
        for name in reversed(state.hypothesis.names):
            less = state.hypothesis.minus(name)
            if reason := worse_with(self.study, state, ends, name) or self._worse_beside(less):
                return name, reason
        return None

    def _worse_beside(self, less: Hypothesis) -> str:
        """How much worse the other series are predicted than with less, in words; empty where they are not."""
        state = self.state
        z = self.study.tried(state, less)[0].z[state.blocks.nuisances :]
        # the linear fit only says whether to fit anew
        if self._gain_beside(replace(state, hypothesis=less, z=z)) >= 0.0:
            return ""
        gain = self._gain_beside(self.study.gauss_newton(less, state))
        return f"the other series are predicted worse with it, by {-gain:.1%}" if gain < 0.0 else ""

    def _gain_beside(self, less: FittedState) -> float:
        """Share of the other series' distances that the last state saves of another one's; none without series."""
        pairs = zip(self.series, self.steps[-1].beside, strict=True)
        gains = [saved(distances_of(one, self.study, less), own) for one, own in pairs]
        return float(np.mean(gains)) if gains else 0.0

    def _add(self, added: str, state: FittedState) -> None:
        self.steps.append(step_of(self.study, added, state, self.series))

    def _replace(self, state: FittedState) -> None:
        if state is self.state:
            return
        last = self.steps.pop()
        self._add(last.added, state)
        self.steps[-1] = replace(self.steps[-1], moves=last.moves)


def step_of(study: Study, added: str, state: FittedState, series: Sequence[SeriesStudy] = ()) -> Step:
    """A step with its errors at ends and beside, its moves not looked at."""
    beside = tuple(distances_of(one, study, state) for one in series)
    return Step(added, state, (), errors_at_ends(study, state), beside)


def select_families(
    study: Study,
    names: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    series: Sequence[SeriesStudy] = (),
) -> Selection:
    """The selection of a test among named families and couplings, of all where none is given; see `Selection`."""
    possible = [*study.families, *couplings(study)] if names is None else list(names)
    return Selection(study, possible, progress, series).run()


def with_needed(study: Study, state: FittedState) -> FittedState:
    """A state whose drives keep the model's compliance where that is as probable as another one.

    The one whose evidence is the smallest goes first, so that of several that do the same one stays.
    """
    hypothesis = state.hypothesis
    evidence = study.compared(state, hypothesis)[-1].log_evidence
    while left := [m.name for m in study.members if m.family == DRIVES and m.name not in hypothesis.kept]:
        others = {name: replace(hypothesis, kept=(*hypothesis.kept, name)) for name in left}
        worth = {name: study.compared(state, other)[-1].log_evidence for name, other in others.items()}
        name = max(worth, key=lambda one: worth[one])
        if worth[name] < evidence:
            break
        hypothesis, evidence = others[name], worth[name]
    kept = tuple(m.name for m in study.members if m.name in hypothesis.kept)
    return state if kept == state.hypothesis.kept else study.gauss_newton(replace(hypothesis, kept=kept), state)
