"""Programs as they are parsed, each once in a process."""

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def parsed(file: Path) -> ast.Module:
    """A program; the collector of cycles leaves its tree out, which is kept, and would visit it again and again."""
    gc.disable()
    try:
        return ast.parse(file.read_text(encoding="utf-8"))
    finally:
        gc.freeze()
        gc.enable()
