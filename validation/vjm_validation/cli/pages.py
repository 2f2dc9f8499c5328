"""``--json``, ``--plot``, ``--report`` and ``--strict``: how a command shows what it found."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar

from cyclopts import Parameter
from rich.console import Console

from vjm.io.files import check_outputs, write_whole
from vjm_output import terminal
from vjm_output.documents import Row, as_json
from vjm_output.optional_drawing import why_no_page
from vjm_validation.cli import UsageError
from vjm_validation.cli.options import Json, Strict
from vjm_validation.documents import UnderLoads
from vjm_validation.page_content import Content

LINES, IMAGES, PAGES = (".png", ".svg"), (".png",), (".html", ".htm")
"""Endings of the files of line plots, and of other figures."""
Plot = Annotated[Path | None, Parameter(name="--plot", help="Write the figure to this file, .png or .svg.")]
Image = Annotated[Path | None, Parameter(name="--plot", help="Write the figure to this file, .png.")]
"""`Plot` of what is no line plot."""
Report = Annotated[Path | None, Parameter(name="--report", help="Write a page to this file, .html.")]


@Parameter(name="*")
@dataclass(frozen=True)
class ResultOutput:
    """How a result is shown."""

    json: Json = False
    plot: Plot = None
    report: Report = None

    endings: ClassVar[Sequence[str]] = LINES

    def check(self, **others: Path | None) -> None:
        """Refuse files that cannot be written before anything is computed.

        Args:
            others: further files of the command, by the names of their options.

        Raises:
            UsageError: an ending that the figure cannot have, or what draws is not installed.
            ValueError: two are one file.
            OSError: one is a folder, or its folder cannot be written to.
        """
        if self.plot is not None and self.plot.suffix not in self.endings:
            why = "this figure is no line plot: " if self.plot.suffix in LINES else ""
            raise UsageError(f"--plot {self.plot}: {why}write a file that ends in {' or '.join(self.endings)}")
        files = {"--plot": self.plot, "--report": self.report}
        for option, file in files.items():
            if file is not None and (why := why_no_page()):
                raise UsageError(f"{option} {file}: {why}")
        check_outputs(files | {f"--{name}": file for name, file in others.items()})
        if self.report is not None and self.report.suffix not in PAGES:
            raise UsageError(f"--report {self.report}: write a file that ends in {' or '.join(PAGES)}")

    def show(
        self, document: Row, content: Callable[[], Content], told: Callable[[Console], None] | None = None
    ) -> None:
        """Print a result as one JSON document or for people, and write its figure and its page.

        Args:
            document: the result; of one under loads these are said, too.
            content: makes what is printed, drawn and written.
            told: prints something else for people.
        """
        loads = document.loads if isinstance(document, UnderLoads) else []
        under = [f"Under {'; '.join(loads)}."] if loads else []

        def whole() -> Content:
            made = content()
            return replace(made, lines=[*made.lines, *under])

        if self.json:
            sys.stdout.write(as_json(document))
        elif told is None:
            whole().print(terminal.console())
        else:
            told(terminal.console())
            for line in under:
                terminal.console().print(line, soft_wrap=True, highlight=False)
        self.draw(whole)

    def draw(self, content: Callable[[], Content]) -> None:
        """Write the figure and the page that are asked for, and name them where no document is printed."""
        if self.plot is None and self.report is None:
            return
        made = content()
        pictures = made.draw()
        if self.plot is not None:
            if not pictures:
                raise UsageError(f"--plot {self.plot}: this result has no figure: leave --plot out")
            drawing = pictures[0].drawing
            if self.plot.suffix != ".svg":
                write_whole(self.plot, drawing.png)
            elif drawing.vector is not None:
                write_whole(self.plot, drawing.vector.file)
            else:
                raise UsageError(f"--plot {self.plot}: this figure is no line plot: write a file that ends in .png")
        if self.report is not None:
            from vjm_validation.report.command_pages import write_small_page

            verdict, *sentences = made.lines
            write_small_page(
                self.report, made.title, verdict, sentences=sentences, pictures=pictures, tables=made.tables
            )
        if not self.json:
            for name, file in (("figure", self.plot), ("page", self.report)):
                if file is not None:
                    terminal.console().print(f"{name}: {file}", soft_wrap=True)


@Parameter(name="*")
@dataclass(frozen=True)
class Output(ResultOutput):
    """How a result is shown, and whether what is doubtful about an input is refused."""

    strict: Strict = False


@Parameter(name="*")
@dataclass(frozen=True)
class ImageOutput(Output):
    """`Output` of a command whose figure is no line plot."""

    plot: Image = None
    endings: ClassVar[Sequence[str]] = IMAGES


RESULT_OUTPUT, OUTPUT, IMAGE_OUTPUT = ResultOutput(), Output(), ImageOutput()
