"""What acts, what may act, and the residual, by the probabilities of a selection's hypotheses."""

from __future__ import annotations

from vjm_updating.findings import FindingsRow, by_hypotheses, findings_of, groups_of
from vjm_updating.poses.selection import Selection
from vjm_updating.poses.verdict import PoseVerdict


def pose_findings(selection: Selection, verdict: PoseVerdict) -> FindingsRow:
    """The findings in rows and words.

    Args:
        selection: of families.
        verdict: on it.
    """
    study, state = selection.study, selection.state
    probability, _ = by_hypotheses(verdict.weighed)
    missed: dict[str, float] = {}
    for name in verdict.causes:
        errors = study.tried(state, state.hypothesis.minus(name))[1]
        missed[name] = max(sum(errors.judged) - sum(state.errors.judged), 0.0)
    explained, together = max(verdict.explained, 0.0), sum(missed.values())
    return findings_of(
        probability,
        {name: explained * m / together if together else 0.0 for name, m in missed.items()},
        groups_of(verdict.weighed),
        explained=explained,
        left=verdict.remainder.over_noise,
        more_than_noise=verdict.remainder.significant,
        trusted=verdict.kind != "unknown",
    )
