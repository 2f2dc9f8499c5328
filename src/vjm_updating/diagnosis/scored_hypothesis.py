"""A hypothesis that was tried, and what it is worth."""

from __future__ import annotations

from dataclasses import dataclass

from vjm_updating.inference.fitting import Fit


@dataclass(frozen=True, eq=False)
class Ranked:
    """A hypothesis with its fit and its worth.

    Attributes:
        fit: at its best.
        criterion: objective and what its parameters cost; the smaller the better.
    """

    fit: Fit
    criterion: float

    @property
    def labels(self) -> frozenset[str]:
        """Its effects."""
        return frozenset(effect.label for effect in self.fit.hypothesis)

    @property
    def causes(self) -> frozenset[str]:
        """Its causes."""
        return frozenset(effect.cause for effect in self.fit.hypothesis)
