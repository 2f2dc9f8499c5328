"""What to do next with a column: the direct measurement that distinguishes explanations, and what it would show."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vjm_updating.diagnosis.estimates import Estimate
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import WRENCH


@dataclass(frozen=True)
class Direct:
    """A measurement that shows one cause and not the others.

    Attributes:
        path: what is done.
        why: what it would show.
        difference: from what the sheet expects, in the unit of ``channel``; None where it is no reading.
        channel: that it would be read on.
        strength: the difference over the sheet's sigma; None where the sheet has none.
    """

    path: str
    why: str
    difference: float | None
    channel: str
    strength: float | None


def direct(measurement: Measurement, cause: str, found: Mapping[str, Estimate], load: float) -> Direct | None:
    """The measurement that shows a cause directly; None where there is none.

    Args:
        measurement: of the test.
        cause: to be shown.
        found: parameters of the hypothesis that has it.
        load: largest one of the test, N.
    """
    ways: dict[str, Callable[[Measurement, str, Estimate, float], Direct]] = {
        "instrument_zero": _zero,
        "instrument_scale": _scale,
        "link_compliance": _stiffness,
        "link_length": _length,
    }
    name = next((n for n in found if n.startswith(f"{cause}.")), None)
    if cause not in ways or name is None:
        return None
    return ways[cause](measurement, name.partition(".")[2], found[name], load)


def _over(difference: float, sigma: float) -> float | None:
    return difference / sigma if sigma > 0.0 else None


def _zero(measurement: Measurement, channel: str, e: Estimate, load: float) -> Direct:
    known = measurement.sheet.sigma(channel)
    what = "load cell" if channel == WRENCH[0] else "ruler"
    size = abs(e.value)
    return Direct(
        f"take the column out of the rig and read the {what}",
        f"an error of zero of the {what} would show as {e.value:.3g} there, against the sheet's ±{known.zero:.3g}; "
        "a column that is stiffer or longer would not",
        size,
        channel,
        _over(size, known.zero),
    )


def _scale(measurement: Measurement, channel: str, e: Estimate, load: float) -> Direct:
    known = measurement.sheet.sigma(channel)
    if channel != WRENCH[0]:
        return Direct(
            "lay a second ruler beside the first", f"it would be off by {100.0 * e.value:.2g} %",
            None, channel, _over(abs(e.value), known.scale),
        )  # fmt: skip
    size = abs(e.value) * load
    return Direct(
        f"load the cell with a known weight of some {load:.3g} N",
        f"an error of its scale would show as {size:.3g} N; a column that is stiffer or longer would not",
        size,
        channel,
        _over(abs(e.value), known.scale),
    )


def _stiffness(measurement: Measurement, _: str, e: Estimate, load: float) -> Direct:
    return Direct(
        "lay the column on two supports and bend it by a known weight at its middle",
        f"it would deflect by {100.0 * abs(1.0 - e.value):.2g} % {'less' if e.value < 1.0 else 'more'} than the "
        "model says; errors of zero and scale of the rig do not change it",
        None,
        "",
        _over(abs(1.0 / e.value - 1.0), measurement.sheet.tolerance.modulus_rel),
    )


def _length(measurement: Measurement, _: str, e: Estimate, load: float) -> Direct:
    return Direct(
        "measure the distance between the knife edges with calipers",
        f"it would be off by {e.value:.3g} mm",
        None,
        "",
        _over(abs(e.value), measurement.sheet.tolerance.link_length_mm),
    )
