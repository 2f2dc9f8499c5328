"""A diagnosis in a few lines for the terminal."""

from __future__ import annotations

from vjm_validation.diagnosis.document import Diagnosis


def lines(found: Diagnosis) -> list[str]:
    """The verdict, its parameters, its gain and what to measure next."""
    named = f": {', '.join(found.causes)}" if found.causes else ""
    result = [f"verdict: {found.verdict}{named} (confidence {found.confidence:.2f})"]
    if found.residual:
        result.append(found.residual)
    for candidate in found.candidates:
        result.append(f"  {' + '.join(candidate.causes)}, probability {candidate.probability:.2f}")
        for name, value in candidate.parameters.items():
            text = value if isinstance(value, str) else f"{value.value:.5g} ± {value.std:.2g}"
            result.append(f"    {name} = {text}")
    if found.gain is not None:
        g = found.gain
        result.append(
            f"held-out {g.split}: {g.rmse_before:.3g} N before, {g.rmse_after:.3g} N after "
            f"({g.before_in_sigma:.2f} and {g.after_in_sigma:.2f} of the noise)"
        )
    if found.next_experiment.why:
        n = found.next_experiment
        result.append(f"next: posture {n.posture}, {n.path}: {n.why}")
    return result
