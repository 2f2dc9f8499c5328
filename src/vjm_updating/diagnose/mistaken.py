"""Mistakes of the instruments in a diagnosis: named beside the causes found in the readings without them."""

from __future__ import annotations

from collections.abc import Sequence

from vjm_updating.diagnose.document import CandidateRow, Diagnosis, ValueRow
from vjm_updating.experiment.mistakes import TITLES, Mistake


def with_mistakes(document: Diagnosis, mistakes: Sequence[Mistake]) -> Diagnosis:
    """A diagnosis of mended readings as one of the readings as they were.

    A mistake is exact, a factor between units or a sign; it has no standard deviation. Where nothing else is found,
    the mistakes are the verdict. Where what is left is unknown, it stays so, and the mistakes are in its words.

    Args:
        document: of the readings without the mistakes.
        mistakes: that were undone.
    """
    if not mistakes:
        return document
    causes = sorted({mistake.cause for mistake in mistakes})
    parameters: dict[str, ValueRow | str] = {}
    for mistake in mistakes:
        if mistake.exchanged:
            parameters[f"{mistake.cause}.columns"] = " and ".join(mistake.exchanged)
        for name, value in mistake.parameters.items():
            parameters[name] = ValueRow(value=value, std=0.0, interval95=[value, value])
    undone = "undone before anything was fitted: " + ", ".join(TITLES[cause] for cause in causes)
    residual = "; ".join(text for text in (document.residual, undone) if text)
    if document.verdict == "unknown":
        return document.model_copy(update={"residual": residual})
    if document.verdict == "none":
        alone = CandidateRow(causes=causes, probability=1.0, parameters=parameters, gain=None)
        return document.model_copy(
            update={
                "verdict": "named", "causes": causes, "candidates": [alone], "parameters": parameters,
                "residual": residual,
            }
        )  # fmt: skip
    candidates = [
        row.model_copy(update={"causes": sorted({*row.causes, *causes}), "parameters": parameters | row.parameters})
        for row in document.candidates
    ]
    return document.model_copy(
        update={
            "causes": sorted({*document.causes, *causes}),
            "candidates": candidates,
            "parameters": candidates[0].parameters,
            "residual": residual,
        }
    )
