"""Tests of a pinned column that is controlled by the deflection of its middle: a kind of test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vjm_updating.constants import shown
from vjm_updating.diagnosis.column import (
    ColumnForward,
    column_effects,
    is_column,
    observe_column,
    with_noise_found,
)
from vjm_updating.diagnosis.column_experiment import direct
from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow, ValueRow
from vjm_updating.diagnosis.estimates import estimates
from vjm_updating.diagnosis.evidence import Costs
from vjm_updating.diagnosis.holdout import HoldOut, hold_out, split_of_marks
from vjm_updating.diagnosis.mark_selection import completed
from vjm_updating.diagnosis.ramp_kind import RampTest
from vjm_updating.diagnosis.scored_hypothesis import Ranked
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.observation.observed import Observed
from vjm_updating.observation.significance import NORMAL_95

FIRST_YIELD, DEPARTS = "plasticity.yield_N", "plasticity.departs_mm"
HANDBOOK = "plasticity.handbook"
MANY = shown(6.0)
"""Noise of the load over the sheet's from which on it is reported."""


class ColumnTest(RampTest):
    """Marks of deflection with a load each.

    Every column is bowed, however little, and yields in the end: a cause whose own parameter may as well be nothing
    costs nothing more. The elastica's law is exact, and marks scatter by a noise that is found.
    """

    name = "column"
    costs = Costs(third=0.0, disguised=0.0, law_error=0.0)

    def applies(self, measurement: Measurement) -> bool:
        """Where a point of a body controls the test and the end's displacement was not read."""
        return is_column(measurement)

    def observe(self, measurement: Measurement) -> Observed:
        """What settled at each mark, as long as the deflection grows."""
        return observe_column(measurement)

    def forward(self, observed: Observed) -> ColumnForward:
        """The elastica with a bow and with bending beyond yield."""
        return ColumnForward(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The column's own; effects of a file are made for chains and are not taken."""
        return column_effects(observed)

    def without_outliers(self, observed: Observed, outliers: np.ndarray) -> Observed:
        """All: there are few marks, and each was set by hand."""
        return observed

    def reweighted(self, fitter: Fitter, everything: Observed, best: Fit) -> Observed | None:
        """With the noise of mark and load as the fit's residuals have it."""
        return with_noise_found(everything, best)

    def completed(self, search: Search, best: Ranked) -> Ranked:
        """With further causes as long as each pays; see `vjm_updating.diagnosis.mark_selection`."""
        return completed(search, best)

    def hold_out(self, fitter: Fitter, null: Fit) -> HoldOut:
        """Every third mark in turn."""
        return hold_out(fitter, null, split_of_marks(fitter.forward.observed))

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """The column's largest load, where the readings fall again behind it."""
        forward = self.forward(fitter.forward.observed)
        observed = forward.observed
        on = observed.present[:, 0]
        read = -observed.wrench[on, 0]
        predicted = read + fit.at.residual[on, 0]
        tops = [int(np.argmax(load)) for load in (read, predicted)]
        turned = [top < len(read) - 2 for top in tops]
        euler = float(forward.evaluate_nominal(np.zeros(1))[0])
        largest = float(predicted[tops[1]]) if turned[1] else None
        here = forward.first_yield(fit.found, fit.at.z, fit.hypothesis, handbook=True)
        return [
            CriticalPointRow(
                posture=str(observed.readings.posture[0]),
                direction="compression",
                reached_N=float(read[tops[0]]),
                measured_N=float(read[tops[0]]) if turned[0] else None,
                before_N=euler,
                after_N=largest,
                nominal="bifurcation",
                nominal_N=euler,
                extended="limit" if turned[1] else "",
                extended_N=largest,
                yields_N=None if here is None else here[0],
                yields=forward.yield_unknown() if here is None else f"at {here[1]:.3g} mm of deflection",
            )
        ]

    def parameters(self, fitter: Fitter, fit: Fit, found: Mapping[str, ValueRow]) -> dict[str, ValueRow | str]:
        """Where the column begins to yield, and from where on that shows."""
        result: dict[str, ValueRow | str] = {}
        forward = self.forward(fitter.forward.observed)
        here = forward.first_yield(fit.found, fit.at.z, fit.hypothesis)
        if here is not None:
            stress = found["plasticity.yield_stress_MPa"]
            std = abs(here[0]) * stress.std / stress.value
            ends = [here[0] - NORMAL_95 * std, here[0] + NORMAL_95 * std]
            result[FIRST_YIELD] = ValueRow(value=here[0], std=std, interval95=ends)
            result[HANDBOOK] = forward.handbook_yield()
        departs = forward.departs(fit)
        if departs is not None:
            result[DEPARTS] = f"{departs:.3g}, where yield takes a hundredth of the load"
        return result

    def scatter(self, observed: Observed) -> str:
        """Where loads at marks scatter more than the sheet says: the residual is not explained, only bounded."""
        sheet = observed.measurement.sheet
        said, found = float(sheet.sigma(WRENCH[0]).noise), float(observed.noise.wrench[0])
        if found < MANY * said:
            return ""
        return (
            f"the residual scatters by {found:.3g} N of load, {found / said:.2g} times the sheet's noise: so much "
            "of the curve no cause explains"
        )

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """Of the direct measurements the one that would show most, of a cause that not all members have."""
        observed = fitter.forward.observed
        common = frozenset.intersection(*(member.causes for member in verdict.members))
        load, posture = float(np.nanmax(np.abs(observed.wrench[:, 0]))), str(observed.readings.posture[0])
        ways = [
            way
            for member in verdict.members
            for cause in sorted(member.causes - common)
            if (way := direct(observed.measurement, posture, cause, estimates(fitter, member.fit, 0.0), load))
        ]
        if not ways:
            why = "turned over, a bow changes sides while errors of the instruments and the stiffness stay"
            return ExperimentRow(
                why=why, posture=posture, path="the same marks with the specimen turned half a turn"
            )
        return max(ways, key=lambda way: (way.difference is not None, way.strength or 0.0))
