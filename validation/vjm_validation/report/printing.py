"""A page as PDF, printed by Chromium where that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
SECONDS = 120.0
"""After which Chromium is given up."""


def chromium() -> str:
    """The browser's program, empty where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), "")


def print_page(page: Path, pdf: Path) -> None:
    """Print a page by its own style for paper; the file is written whole or not at all.

    Raises:
        OSError: there is no Chromium, or it did not print.
    """
    program = chromium()
    if not program:
        raise OSError("--pdf: no Chromium is installed: install it, or print the page from a browser")
    with tempfile.TemporaryDirectory(dir=pdf.parent) as folder:
        # what Chromium writes half is never under the file's own name
        temporary = Path(folder) / "page.pdf"
        arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer", "--no-first-run"]
        arguments += [f"--user-data-dir={folder}/profile", f"--print-to-pdf={temporary}", page.resolve().as_uri()]
        try:
            done = subprocess.run(
                [program, *arguments], capture_output=True, text=True, timeout=SECONDS, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise OSError(f"--pdf: Chromium did not print {page} within {SECONDS:g} s") from error
        if not temporary.is_file():
            last = done.stderr.strip().splitlines()[-1:] or ["no message"]
            raise OSError(f"--pdf: Chromium did not print {page}: {last[0][:200]}")
        os.replace(temporary, pdf)
