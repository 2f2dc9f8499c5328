"""A diagnosis in a few lines for the terminal."""

from __future__ import annotations

from vjm_updating.diagnose.document import CriticalPointRow, Diagnosis


def lines(found: Diagnosis) -> list[str]:
    """The verdict, its parameters, its gain and what to measure next."""
    named = f": {', '.join(found.causes)}" if found.causes else ""
    result = [f"verdict: {found.verdict}{named} (confidence {found.confidence:.2f})"]
    if found.residual:
        result.append(found.residual)
    for candidate in found.candidates:
        result.append(
            f"  {' + '.join(candidate.places or candidate.causes)}, probability {candidate.probability:.2f}"
        )
        for name, value in candidate.parameters.items():
            text = value if isinstance(value, str) else f"{value.value:.5g} ± {value.std:.2g}"
            result.append(f"    {name} = {text}")
    if found.gain is not None:
        g = found.gain
        result.append(
            f"held-out {g.split}: {g.rmse_before:.3g} N before, {g.rmse_after:.3g} N after "
            f"({g.before_in_sigma:.2f} and {g.after_in_sigma:.2f} of the noise)"
        )
    for fold in found.gain.folds if found.gain is not None else ():
        result.append(f"  {fold.name}: {fold.rmse_before:.3g} N before, {fold.rmse_after:.3g} N after")
    result += [_critical(row) for row in found.critical if row.measured_N or row.nominal_N or row.extended_N]
    for row in found.transfer:
        error = "does not stand" if row.rmse is None else f"{row.rmse:.3g} N"
        result.append(f"beside, by {' + '.join(row.causes)}: {row.what}: {error}")
    if found.next_experiment.why:
        n = found.next_experiment
        result.append(f"next: posture {n.posture}, {n.path}: {n.why}")
    return result


def _critical(row: CriticalPointRow) -> str:
    """Critical forces of one half-ray, and where the material would yield."""

    def point(force: float | None, kind: str) -> str:
        return "none" if force is None else f"{force:.4g} N ({kind})"

    measured = "none measured" if row.measured_N is None else f"measured {row.measured_N:.4g} N"
    yields = row.yields if row.yields_N is None else f"{row.yields_N:.4g} N, {row.yields}"
    return (
        f"critical, posture {row.posture}, {row.direction}: {measured} up to {row.reached_N:.4g} N; nominal model "
        f"{point(row.nominal_N, row.nominal)}, extended {point(row.extended_N, row.extended)}; first yield {yields}"
    )
