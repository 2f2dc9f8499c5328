"""Mistakes of the instruments in a diagnosis, named beside the causes found in the readings without them.

A factor near that between two units, or a sign, may as well be a machine's. So a mistake is named only where the
readings without it leave no more than noise. Else it is a guess beside `unknown`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from vjm_updating.diagnosis.document import AlternativeRow, CandidateRow, Diagnosis, ValueRow
from vjm_updating.diagnosis.verdict import Verdict, withdrawn
from vjm_updating.experiment.mistakes import TITLES, Mistake
from vjm_updating.findings import CauseRow, Word, words
from vjm_updating.observation.significance import FALSE_ALARMS


def unless_unexplained(verdict: Verdict, mistakes: Sequence[Mistake]) -> Verdict:
    """The verdict on readings whose mistakes were undone; unknown where these still leave more than noise.

    Args:
        verdict: on the readings without the mistakes.
        mistakes: that were undone.
    """
    rest = verdict.rest
    if not mistakes or verdict.kind == "unknown" or min(rest.p, rest.prior_p) >= FALSE_ALARMS:
        return verdict
    left = f"takes {rest.farthest}" if rest.prior_p < rest.p else f"leaves {rest.worst or 'a rough residual'}"
    doubt = f"a mistake of the instruments alone is a guess: without it what fits best {left}"
    return replace(withdrawn(verdict, doubt), more_than_noise=True)


def with_mistakes(document: Diagnosis, mistakes: Sequence[Mistake]) -> Diagnosis:
    """A diagnosis of corrected readings as one of the readings as they were.

    A mistake is exact, a factor between units or a sign; it has no standard deviation. Where nothing else is found,
    the mistakes are the verdict. Where the residual is unknown, it stays so, and the mistakes are in its words and
    beside each alternative.

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
    found = document.findings
    if found.trusted:
        # found before anything was fitted, and named where the readings without it leave noise alone
        rows_of = [CauseRow(cause=cause, probability=1.0, share=None, word=Word.ACTS) for cause in causes]
        found = found.model_copy(update={"causes": [*rows_of, *found.causes]})
        document = document.model_copy(update={"findings": found.model_copy(update={"words": words(found)})})
    undone = "undone before anything was fitted: " + ", ".join(TITLES[cause] for cause in causes)
    residual = "; ".join(text for text in (document.residual, undone) if text)
    if document.verdict == "unknown":
        rows = [
            row.model_copy(update={"causes": sorted({*row.causes, *causes})}) for row in document.alternatives
        ] or [AlternativeRow(causes=causes, places=causes, confidence=1.0 - document.confidence)]
        return document.model_copy(update={"residual": residual, "alternatives": rows})
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
