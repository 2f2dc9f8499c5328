"""A page of one command: a sentence, figures and tables, in the style and with the script of the report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vjm.io.files import write_whole
from vjm_output.plot_style import Picture
from vjm_output.templating import environment
from vjm_validation.report.words import ReportTable, Tone


def write_small_page(
    file: Path,
    title: str,
    verdict: str,
    *,
    tone: Tone = Tone.NOTE,
    sentences: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
    tables: Sequence[ReportTable] = (),
) -> None:
    """Write the page, whole or not at all.

    Args:
        file: HTML.
        title: of the page.
        verdict: its first sentence.
        tone: of the verdict.
        sentences: below it.
        pictures: figures.
        tables: below the figures.
    """
    template = environment("vjm_validation.report").get_template("small.html.j2")
    text = template.render(
        title=title, verdict=verdict, tone=tone, sentences=sentences, pictures=pictures, tables=tables
    )
    write_whole(file, text.encode())
