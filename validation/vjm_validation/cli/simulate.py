"""The command ``validate simulate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_updating.simulate.command import DATA, SHEET, simulate, words
from vjm_validation.cli.measured_data import EffectFiles, tell_what_runs
from vjm_validation.cli.options import Model
from vjm_validation.cli.status import OK


def simulate_(
    model: Model,
    *,
    test: Annotated[Path, Parameter(help="Test sheet, TOML: instruments, tolerances, postures.")],
    hide: Annotated[
        tuple[str, ...],
        Parameter(
            help="An effect: CAUSE, CAUSE=VALUE of its first parameter, or CAUSE.PARAMETER=VALUE, such as "
            "link_bow=1.0; may be repeated. docs/effects.md lists them."
        ),
    ] = (),
    effects: EffectFiles = (),
    engine: Annotated[
        Literal["lumped", "exudyn"],
        Parameter(
            help="What the machine is made of: the sheet's lumped model, or geometrically exact beams. Those share "
            "nothing with the model that a diagnosis fits and carry some of the effects."
        ),
    ] = "lumped",
    noise: Annotated[
        Literal["sheet", "none"], Parameter(help="The sheet's noise and tolerances, or none.")
    ] = "sheet",
    seed: Annotated[int, Parameter(help="Of noise and tolerances; the same seed gives the same readings.")] = 0,
    ramp: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Ramps out, held and back: POSTURE:END or POSTURE:AXIS:END in mm or rad, such as A:-2. By default "
            "every posture is pulled and pushed, short of where the model turns critical.",
        ),
    ] = (),
    out: Annotated[Path, Parameter(help="Folder for readings.csv, sheet.toml and truth.json.")] = Path("simulated"),
    json: Annotated[bool, Parameter(negative="", help="Print truth.json and nothing else.")] = False,
) -> int:
    """Make the readings of a machine with a hidden effect, and say how strong it is in that test."""
    tell_what_runs(effects)
    truth = simulate(
        model, test, out, hide=hide, noise=noise, seed=seed, ramps=ramp, plug_ins=effects,
        engine=engine.replace("lumped", ""),
    )  # fmt: skip
    if json:
        sys.stdout.write(as_json(truth))
        return OK
    console = terminal.console()
    for line in words(truth):
        console.print(line, soft_wrap=True)
    diagnosis = f"validate diagnose {out / DATA} --sheet {out / SHEET} --out {out / 'diagnosis'}"
    console.print(f"next: {diagnosis}", soft_wrap=True)
    return OK
