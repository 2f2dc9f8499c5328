"""Hypotheses of a search: one that is worth a fit, and one that was tried with what it is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.parameters import Hypothesis


@dataclass(frozen=True, eq=False)
class Ranked:
    """A hypothesis with its fit and its worth.

    Attributes:
        fit: at its best.
        criterion: what the data say against it, and what its parameters cost; the smaller the better.
        cost: of its parameters and its choice, whatever the data say.
    """

    fit: Fit
    criterion: float
    cost: float = 0.0

    def coarsened(self, power: float) -> Ranked:
        """The same with its likelihood to a power, see `vjm_updating.diagnosis.verdict.coarsening`."""
        return replace(self, criterion=self.cost + power * (self.criterion - self.cost))

    @property
    def labels(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(effect.label for effect in self.fit.hypothesis)

    @property
    def causes(self) -> frozenset[str]:
        """Its causes."""
        return frozenset(effect.cause for effect in self.fit.hypothesis)


@dataclass(frozen=True)
class SearchMove:
    """A hypothesis that is worth a fit.

    Attributes:
        hypothesis: its causes.
        base: fit of other causes, to begin at.
        starts: values of each effect, one list for each start.
        promise: its criterion to first order, with the least that it can cost.
        unsure: by how much that may be off.
        surely: whether it is to be fitted whatever the first order says.
    """

    hypothesis: Hypothesis
    base: Fit
    starts: Sequence[Sequence[Sequence[float]]]
    promise: float
    unsure: float
    surely: bool = False

    @property
    def labels(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(effect.label for effect in self.hypothesis)
