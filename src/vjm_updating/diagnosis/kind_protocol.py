"""What a kind of test is to a diagnosis: every step asks the kind for what differs, and none asks which it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from vjm_updating.diagnosis.critical import Critical
from vjm_updating.diagnosis.document import ExperimentRow, ValueRow
from vjm_updating.diagnosis.estimates import Estimate
from vjm_updating.diagnosis.evidence import Costs
from vjm_updating.diagnosis.holdout import Gain
from vjm_updating.diagnosis.holdout_folds import Fold
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.forward import Predictor
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.observation.observed import Observed

HoldOut = Callable[[Fit], tuple[Gain, list[Fold]]]
"""Gain of a fit on readings held out, and each part of them on its own."""


class KindOfTest(Protocol):
    """A kind of test. A further one is a class with these methods, and a line in `vjm_updating.diagnosis.kinds`."""

    @property
    def name(self) -> str:
        """In one word."""

    @property
    def costs(self) -> Costs:
        """What a choice of causes costs in a test of this kind."""

    def applies(self, measurement: Measurement) -> bool:
        """Whether a test is of this kind."""

    def observe(self, measurement: Measurement) -> Observed:
        """The readings to be explained, and the channels of the displacement.

        Raises:
            ValueError: the test cannot be diagnosed; one line.
        """

    def forward(self, observed: Observed) -> Predictor:
        """The forward model of the readings."""

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The catalogue of causes, those of ``more`` included where the kind takes them."""

    def without_outliers(self, observed: Observed, outliers: np.ndarray) -> Observed:
        """The readings that count, where samples ``(n, 6)`` stand out."""

    def reweighted(self, fitter: Fitter, everything: Observed, best: Fit) -> Observed | None:
        """All readings with the noise that a fit shows; None where the fit is too far off to show any."""

    def completed(self, search: Search, best: Ranked) -> Ranked:
        """The hypothesis that a search ends with, once what it leaves out on purpose was tried."""

    def hold_out(self, fitter: Fitter, null: Fit) -> HoldOut:
        """How readings are held out, with what the sheet's tolerances alone predict of them."""

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[Critical]:
        """Critical loads: measured, of the nominal model and of the extended one."""

    def parameters(self, fitter: Fitter, fit: Fit, found: Mapping[str, Estimate]) -> dict[str, ValueRow | str]:
        """What follows from a fit's parameters in a test of this kind."""

    def scatter(self, observed: Observed) -> str:
        """In words, how far the noise found exceeds the sheet's; empty where it does not or is not asked."""

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """What tells the members of a class apart."""
