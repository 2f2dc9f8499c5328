"""A diagnosis in a few lines for the terminal."""

from __future__ import annotations

from vjm_updating.diagnosis.document import SURE, CandidateRow, CriticalPointRow, Diagnosis, ValueRow
from vjm_updating.experiment.data_file import POSE, WRENCH
from vjm_updating.inference.significance import ALL_ROUND, NORMAL_95

CONFIDENCE = (
    "confidence: posterior probability that the verdict is right, unknown causes included; probability: a "
    "candidate's share among those that the verdict leaves"
)


def lines(diagnosis: Diagnosis) -> list[str]:
    """The verdict, its parameters, its gain and what to measure next."""
    # what is unknown has guesses, which follow with their probabilities
    named = f": {', '.join(diagnosis.causes)}" if diagnosis.causes and diagnosis.verdict != "unknown" else ""
    result = [f"verdict: {diagnosis.verdict}{named} (confidence {diagnosis.confidence:.2f})"]
    result += diagnosis.findings.words
    if diagnosis.residual:
        result.append(diagnosis.residual)
    if diagnosis.noise is not None and diagnosis.noise.outliers:
        result.append(f"outliers, which do not count: {diagnosis.noise.outliers} of the samples")
    for candidate in diagnosis.candidates:
        where = [_or_elsewhere(diagnosis, place) for place in candidate.places] or placed(candidate)
        result.append(f"  {' + '.join(where)}, probability {candidate.probability:.2f}")
        for name, value in candidate.parameters.items():
            result.append(f"    {name} = {_text(name, value)}")
    if diagnosis.candidates and diagnosis.verdict != "none":
        result.append(f"  ({CONFIDENCE})")
    if diagnosis.gain is not None:
        g = diagnosis.gain
        result.append(
            f"held-out {g.split}: {g.rmse_before:.3g} {g.unit} before, {g.rmse_after:.3g} {g.unit} after "
            f"({g.before_in_sigma:.2f} and {g.after_in_sigma:.2f} of the noise)"
        )
        if g.after_in_sigma > NORMAL_95 * g.expected_in_sigma:
            result.append(
                f"  a right model would reach {g.expected_in_sigma:.2f} of the noise: a law of these causes is "
                "off, or something more acts"
            )
    for fold in diagnosis.gain.folds if diagnosis.gain is not None else ():
        result.append(
            f"  {fold.name}, {fold.readings} readings: {fold.rmse_before:.3g} before, {fold.rmse_after:.3g} after"
        )
    extended = diagnosis.verdict != "unknown"
    if not extended:
        result.append("no extended model is written: no cause of the catalogue explains the readings")
    for point in diagnosis.critical:
        if point.measured_N or point.nominal_N or (point.extended_N and extended):
            result.append(_critical(point, extended=extended))
    for row in diagnosis.transfer:
        error = "does not stand" if row.rmse is None else f"{row.rmse:.3g} {row.unit}"
        result.append(f"beside, by {' + '.join(row.causes)}: {row.what}: {error}")
    if diagnosis.next_experiment.why:
        n = diagnosis.next_experiment
        result.append(f"next: posture {n.posture}, {n.path}: {n.why}" if n.posture else f"next: {n.why}")
    return result


def _or_elsewhere(diagnosis: Diagnosis, place: str) -> str:
    """A place of a cause, with the others in which it may be as well."""
    for row in diagnosis.findings.causes:
        places = {each.place: each.probability for each in row.places}
        if places.get(place, 1.0) < SURE:
            # in two places at once both are sure
            others = (other for other, p in places.items() if other != place and 1.0 - SURE <= p < SURE)
            return " or ".join([place, *others])
    return place


def placed(candidate: CandidateRow) -> list[str]:
    """The causes, with the channel where one lies in an instrument."""
    result = []
    for cause in candidate.causes:
        channels = [
            name.split(".")[1]
            for name in candidate.parameters
            if name.startswith(f"{cause}.") and name.split(".")[1] in (*POSE, *WRENCH)
        ]
        result.append(f"{cause} ({', '.join(dict.fromkeys(channels))})" if channels else cause)
    return result


def _text(name: str, value: ValueRow | str) -> str:
    return value if isinstance(value, str) else no_value(name, value) or value.words


def no_value(name: str, value: ValueRow | str) -> str:
    """What is said of a parameter of which readings tell no value; empty where they do."""
    if isinstance(value, str):
        return value
    # a direction that is known no better than that it is one
    if name.endswith("_rad") and "direction" in name and value.std >= ALL_ROUND:
        return "any: these readings do not show it"
    return "" if value.limits == "both" else value.words


def _critical(row: CriticalPointRow, *, extended: bool) -> str:
    """Critical forces of one half-ray, of an extended model if there is one, and where the material would yield."""

    def point(force: float | None, kind: str) -> str:
        return "none" if force is None else f"{force:.4g} N ({kind})"

    measured = "none measured" if row.measured_N is None else f"measured {row.measured_N:.4g} N"
    yields = row.yields if row.yields_N is None else f"{row.yields_N:.4g} N, {row.yields}"
    models = f"nominal model {point(row.nominal_N, row.nominal)}"
    if extended:
        models += f", extended {point(row.extended_N, row.extended)}"
    reached = f"{measured} up to {row.reached_N:.4g} N"
    return f"critical, posture {row.posture}, {row.direction}: {reached}; {models}; first yield {yields}"
