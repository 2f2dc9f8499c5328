"""The command ``validate diagnose``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_output.optional_page import page_line
from vjm_updating import diagnose, load_data
from vjm_updating.mechanisms.catalogue import plug_in
from vjm_validation.cli.doubts import Strict
from vjm_validation.cli.measured_data import (
    Beside,
    EffectFiles,
    Readings,
    Sheets,
    load_series,
    tell_what_runs,
    telling,
)

PAGE = "diagnosis.html"


def diagnose_(
    data: Readings,
    *,
    sheet: Sheets,
    out: Annotated[Path, Parameter(help="Folder for diagnosis.json, diagnosis.html, extended-model.toml.")],
    effects: EffectFiles = (),
    only: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="The causes that are thought possible; else all.")
    ] = (),
    without: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="Causes that are ruled out beforehand.")
    ] = (),
    beside: Beside = (),
    json: Annotated[bool, Parameter(negative="", help="Print diagnosis.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Show what the model gets wrong, name the cause, extend the model and measure the gain."""
    tell_what_runs(effects)
    makers = [plug_in(path) for path in effects]
    with telling("diagnosis", out, quiet=json) as (told, tell):
        found = diagnose(
            load_series(data, sheet),
            effects=makers,
            only=only,
            without=without,
            beside=[load_data(*files) for files in beside],
            strict=strict,
            warn=told,
            progress=tell,
        )
        found.write(out)
    if json:
        sys.stdout.write(as_json(found.found))
        return 0
    console = terminal.console()
    for line in found.lines():
        console.print(line, soft_wrap=True)
    console.print(page_line(out / PAGE), soft_wrap=True)
    return 0
