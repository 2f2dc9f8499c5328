"""``--plot`` and ``--report``: the figures of a command as a file, and as a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from rich.console import Console

from vjm.io.files import check_outputs, write_whole
from vjm_output.optional_drawing import why_no_page
from vjm_validation.cli import UsageError

if TYPE_CHECKING:
    # matplotlib takes a second to import, which a command without a figure does not need
    from vjm_output.plots import Picture
    from vjm_validation.report.words import ReportTable

Plot = Annotated[Path | None, Parameter(name="--plot", help="Write the figure to this file, .png or .svg.")]
Image = Annotated[Path | None, Parameter(name="--plot", help="Write the figure to this file, .png.")]
"""`Plot` of what is no line plot."""
Report = Annotated[Path | None, Parameter(name="--report", help="Write a page to this file, .html.")]
ENDINGS = (".png", ".svg")
IMAGES = (".png",)


@dataclass(frozen=True)
class Content:
    """What is drawn and written.

    Attributes:
        title: of the page.
        verdict: its first sentence.
        pictures: the first one is the plot.
        tables: of the page.
        sentences: of the page.
    """

    title: str
    verdict: str
    pictures: Sequence[Picture]
    tables: Sequence[ReportTable] = ()
    sentences: Sequence[str] = ()


def check(plot: Path | None, report: Path | None, endings: Sequence[str] = ENDINGS, **others: Path | None) -> None:
    """Refuse files that cannot be written before anything is computed.

    Args:
        plot: file of the figure.
        report: file of the page.
        endings: that the figure can have; `IMAGES` for what is no line plot.
        others: further files of the command, by the names of their options.

    Raises:
        UsageError: an ending that is none of these, or what draws is not installed.
        ValueError: two are one file.
        OSError: one is a folder, or its folder cannot be written to.
    """
    if plot is not None and plot.suffix not in endings:
        why = "this figure is no line plot: " if plot.suffix in ENDINGS else ""
        raise UsageError(f"--plot {plot}: {why}write a file that ends in {' or '.join(endings)}")
    for option, file in (("--plot", plot), ("--report", report)):
        if file is not None and (why := why_no_page()):
            raise UsageError(f"{option} {file}: {why}")
    check_outputs({"--plot": plot, "--report": report} | {f"--{name}": file for name, file in others.items()})


def draw(plot: Path | None, report: Path | None, content: Callable[[], Content], console: Console | None) -> None:
    """Write what is asked for.

    Args:
        plot: file of the figure.
        report: file of the page.
        content: makes what they show.
        console: to name the files on; None where nothing but a document is printed.
    """
    if plot is None and report is None:
        return
    made = content()
    if plot is not None:
        drawing = made.pictures[0].drawing
        if plot.suffix != ".svg":
            write_whole(plot, drawing.png)
        elif drawing.vector is not None:
            write_whole(plot, drawing.vector.file)
        else:
            raise UsageError(f"--plot {plot}: this figure is no line plot: write a file that ends in .png")
    if report is not None:
        from vjm_validation.report.command_pages import write_small_page

        write_small_page(
            report, made.title, made.verdict, sentences=made.sentences, pictures=made.pictures, tables=made.tables
        )
    if console is not None:
        for name, file in (("figure", plot), ("page", report)):
            if file is not None:
                console.print(f"{name}: {file}", soft_wrap=True)
