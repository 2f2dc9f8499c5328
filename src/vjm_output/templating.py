"""The templates of the pages, and how they write numbers and pictures."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from typing import Any

import jinja2
from markupsafe import Markup, escape

from vjm_output.number_text import number
from vjm_output.plots import Picture, Vector

CODE = re.compile("`([^`]+)`")
SHORT_TABLE = 12
"""Rows up to which a table of the record is unfolded."""


@cache
def environment(package: str) -> jinja2.Environment:
    """Where the templates are, and the filters that they use.

    Args:
        package: whose folder ``templates`` has the pages; what all pages share comes from `vjm_output`.
    """
    result = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(package), jinja2.PackageLoader("vjm_output")]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    result.filters["number"] = number
    result.filters["given"] = lambda value: number(None) if value is None else f"{value:g}"
    result.filters["prose"] = _prose
    result.filters["data_uri"] = _data_uri
    result.filters["inline_svg"] = _inline_svg
    result.filters["csv_uri"] = _csv_uri
    result.globals["script"] = Markup(page_script())  # the suite's own
    result.globals["script_hash"] = _hash(page_script())
    result.filters["flat"] = lambda tree: list(_flat(tree))
    result.globals["symbols"] = {
        "K0": ("K", "0"), "K1": ("K", "1"), "K2": ("K", "2"), "K3": ("K", "3"), "F1": ("F", "1"),
        "F_cr": ("F", "cr"), "d_cr": ("Δ", "cr"), "F_end": ("F", "end"), "d_end": ("Δ", "end"),
    }  # fmt: skip
    result.globals["short_table"] = SHORT_TABLE
    result.globals["units"] = {"K": "N/mm", "F": "N", "d": "mm"}
    return result


def _prose(text: str) -> Markup:
    """Words with what stands between backticks as code, as Markdown has it."""
    return Markup(CODE.sub(r"<code>\1</code>", str(escape(text))))


def _data_uri(picture: Picture) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.content).decode()}"


def _inline_svg(vector: Vector, title: str) -> Markup:
    """The element with its title for those who hear it; matplotlib has escaped its texts."""
    start, rest = vector.svg.split(">", 1)
    return Markup(f'{start} role="img" aria-label="{escape(title)}">{rest}')


def _csv_uri(vector: Vector) -> str:
    return f"data:text/csv;charset=utf-8;base64,{base64.b64encode(vector.csv.encode()).decode()}"


@cache
def page_script() -> str:
    """The script of every page, as it stands in its element."""
    folder = resources.files("vjm_output") / "templates"
    return "".join((folder / name).read_text(encoding="utf-8") for name in ("page.js", "plots.js", "scene.js"))


def _hash(script: str) -> str:
    """What a content security policy allows this script by, and none that got into a page otherwise."""
    return f"sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}"


def _flat(tree: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Leaves of nested mappings with their keys joined: ('paths / A / tension', 0.2)."""
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            yield from _flat(value, f"{prefix} / {key}" if prefix else str(key))
    else:
        yield prefix, tree
