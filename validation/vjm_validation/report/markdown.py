"""The findings of a run as Markdown beside its figures: short enough to be kept in a repository."""

from __future__ import annotations

from collections.abc import Sequence

from vjm_output.plot_style import Picture
from vjm_validation.report.words import ReportFinding
from vjm_validation.studies.study_results import Run


def findings_markdown(run: Run, found: Sequence[ReportFinding], pictures: Sequence[Picture]) -> str:
    """Findings with the pictures that prove them, which lie in ``figures`` beside the text.

    Args:
        run: what was computed.
        found: its findings.
        pictures: shown under the findings.
    """
    lines = [f"# {run.chain.title}", "", f"Written by `{run.summary.get('command')}`.", ""]
    for finding in found:
        lines += [f"## {finding.title}", "", *(f"- {sentence}" for sentence in finding.sentences), ""]
    for picture in pictures:
        lines += [
            f"![{picture.title}](figures/{picture.name}.png)",
            "",
            f"**{picture.title}** {picture.caption}",
            "",
        ]
    versions = ", ".join(f"{name} {version}" for name, version in run.summary.get("versions", {}).items())
    return "\n".join([*lines, versions, ""])
