"""A command's page is written where what draws it is installed; its numbers do not depend on that."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

DRAWN_BY = ("jinja2", "matplotlib")
"""Of the extra ``report``: the page's template and its figures."""


def why_not(*modules: str) -> str:
    """What to install before what needs these modules of the extra is made; empty where they are there."""
    missing = [name for name in modules if find_spec(name) is None]
    return f"it needs {' and '.join(missing)}: pip install 'vjm-stiffness[report]'" if missing else ""


def why_no_page() -> str:
    """What to install before pages are written; empty where they are."""
    return why_not(*DRAWN_BY)


def page_of(file: Path, make: Callable[[], str]) -> dict[Path, str]:
    """A page by its file, or nothing where it cannot be made; one of an earlier run is then removed.

    Args:
        file: of the page.
        make: imports what draws, and returns the page as HTML.
    """
    if why_no_page():
        file.unlink(missing_ok=True)
        return {}
    return {file: make()}


def page_line(file: Path) -> str:
    """Where the page is, or why there is none: a line for the terminal."""
    why = why_no_page()
    return f"no page: {why}" if why else f"page: {file}"
