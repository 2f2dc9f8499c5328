"""The commands on measured data.

``validate calibrate`` fits compliances, ``validate diagnose`` names what the model gets wrong, ``validate
simulate`` makes the readings of a machine with a hidden effect. They share files of readings, test sheets, effects
of one's own, and what is said while they work.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vjm.io.files import check_writable
from vjm.io.findings import Finding
from vjm_output import terminal
from vjm_output.documents import as_json
from vjm_output.optional_drawing import page_line
from vjm_updating import calibrate, diagnose, load_data
from vjm_updating.calibration.document import Calibration, tables
from vjm_updating.data_set import FREQUENCIES, DataSet
from vjm_updating.mechanisms.catalogue import errors_within, plug_in
from vjm_updating.result import CALIBRATED
from vjm_updating.simulate import DATA, SHEET, simulate, words
from vjm_validation.cli import NOT_ACCEPTED, OK
from vjm_validation.cli.options import Model, Strict, warn

Readings = Annotated[
    tuple[Path, ...],
    Parameter(
        help="Readings, CSV; see docs/measured-data.md and docs/poses.md. Of poses and deflections also several "
        "series of one machine."
    ),
]
Sheets = Annotated[
    tuple[Path, ...],
    Parameter(consume_multiple=True, help="Test sheet, TOML: one for all series, or one each in their order."),
]
Beside = Annotated[
    tuple[tuple[Path, Path], ...],
    Parameter(
        help="DATA SHEET of another test that judges what is found. Of poses and deflections: another series of "
        "the machine, only frames and zeros refitted; more than once. A ramp, in `diagnose` only: another "
        "specimen, nothing fitted anew."
    ),
]


def load_series(data: Sequence[Path], sheets: Sequence[Path]) -> list[DataSet]:
    """The series of a command.

    Args:
        data: files of readings.
        sheets: one for all, or one each in their order.

    Raises:
        ValueError: as many sheets as fit neither, or a file cannot be used; one line.
    """
    if not data:
        raise ValueError("no data file: give at least one CSV file of readings")
    if len(sheets) not in (1, len(data)):
        raise ValueError(
            f"--sheet: {len(sheets)} sheets for {len(data)} data files: give one for all, or one each in order"
        )
    each = list(sheets) * len(data) if len(sheets) == 1 else list(sheets)
    return [load_data(*files) for files in zip(data, each, strict=True)]


# --- What the commands on measured data say while they work: doubts first, then how far they are ------------------

Telling = tuple[Callable[[Sequence[Finding]], None], Callable[[str], None]]


@contextmanager
def telling(stage: str, out: Path, *, quiet: bool) -> Iterator[Telling]:
    """Refuse a folder that cannot be written to, say what is implausible, and show how many steps are done.

    What is refused is refused before anything is displayed, in one line.

    Args:
        stage: word before the display.
        out: folder that is written to in the end.
        quiet: whether nothing is displayed.
    """
    check_writable(out)
    with ExitStack() as stack:
        display: Callable[[str, int, int], None] | None = None
        done = 0

        def tell(_: str) -> None:
            nonlocal display, done
            display = display or stack.enter_context(terminal.progress(quiet=quiet))
            done += 1
            display(stage, done, 0)

        yield warn, tell


# --- Files with effects of one's own, which commands run ----------------------------------------------------------

EffectFiles = Annotated[
    tuple[Path, ...],
    Parameter(
        consume_multiple=True, help="Python files with effects of your own, which are run; see docs/effects.md."
    ),
]


def tell_what_runs(files: Sequence[Path]) -> None:
    """Warn that a file of effects is a program."""
    for path in filter(Path.is_file, files):
        terminal.error(f"warning: --effects runs the program {path} with all your rights: only what you trust")


CALIBRATION_PAGE = "calibration.html"


def calibrate_(
    data: Readings,
    *,
    sheet: Sheets,
    out: Annotated[Path, Parameter(help="Folder for calibration.json, calibrated-model.toml, calibration.html.")],
    fit: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="What to look for: part.factor, part.section, part.EIz, part.diagonal, part.C11, part.matrix, "
            "actuator.compliance, of frequencies also part.mass; by default one factor for every elastic part. "
            "Of tests of poses or deflections: families, see docs/poses.md.",
        ),
    ] = (),
    next_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--next",
            consume_multiple=True,
            help="Feasible next ramps, POSTURE:END or POSTURE:AXIS:END in mm or rad, such as D:-12 "
            "or B:y:2. Of tests of "
            "poses or deflections: a CSV file of postures, of deflections also loads.",
        ),
    ] = (),
    figure: Annotated[
        str, Parameter(help="Predicted figure to make certain next, such as D:compression:F_cr.")
    ] = "",
    beside: Beside = (),
    for_: Annotated[
        str,
        Parameter(
            name="--for",
            help="Of tests of poses or deflections, where the file will be used: x=400,y=0:200,z=300 in mm of the "
            "end in the base's axes, or a CSV file of postures. The error there is predicted.",
        ),
    ] = "",
    force: Annotated[
        bool,
        Parameter(
            negative="",
            help="Write the calibrated model also where it does not explain the readings, these are mistaken, or "
            "it is no better than the model before it. The file says so.",
        ),
    ] = False,
    json: Annotated[bool, Parameter(negative="", help="Print calibration.json and nothing else.")] = False,
    strict: Strict = False,
) -> int:
    """Fit compliances to measured displacements, poses or natural frequencies, with their uncertainty."""
    with telling("calibration", out, quiet=json) as (warn, tell):
        tests = load_series(data, sheet)
        result = calibrate(
            tests,
            fit=fit,
            next_tests=next_,
            figure=figure,
            asked=for_ if "=" in for_ else Path(for_) if for_ else "",
            beside=[load_data(*files) for files in beside],
            force=force,
            strict=strict,
            warn=warn,
            progress=tell,
        )
        earlier = (out / CALIBRATED).exists()
        result.write(out)
    document = result.figures
    status = OK if any(result.models.values()) else NOT_ACCEPTED
    if json:
        sys.stdout.write(as_json(document))
        return status
    console = terminal.console()
    items = tables(document) if isinstance(document, Calibration) else result.lines()
    for item in items:
        console.print(item, soft_wrap=isinstance(item, str))
    if result.draw is not None:
        console.print(page_line(out / CALIBRATION_PAGE), soft_wrap=True)
    if status != OK and isinstance(document, Calibration):
        look = ["validate", "diagnose", *map(str, data), "--sheet", *map(str, sheet), "--out", str(out)]
        # frequencies have no causes
        frequencies = tests[0].kind == FREQUENCIES
        why = _not_written(document, "" if frequencies else shlex.join(look), earlier=earlier)
        console.print(why, soft_wrap=True)
    return status


def _not_written(document: Calibration, look: str, *, earlier: bool) -> str:
    """Why no model was written, and what to do: ``look`` is the command that says more, if there is one.

    The model of an ``earlier`` run in the same folder was removed, if there was one.
    """
    remedies = ["--force writes it all the same"]
    if look and not document.fit.fits:
        remedies.insert(0, f"`{look}` looks for what it lacks")
    removed = ", and that of an earlier run was removed" if earlier else ""
    return f"No calibrated model was written{removed}: {'; '.join([*document.unfit, *remedies])}."


DIAGNOSIS_PAGE = "diagnosis.html"


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
    with errors_within(effects), telling("diagnosis", out, quiet=json) as (warn, tell):
        diagnosis = diagnose(
            load_series(data, sheet),
            effects=makers,
            only=only,
            without=without,
            beside=[load_data(*files) for files in beside],
            strict=strict,
            warn=warn,
            progress=tell,
        )
        diagnosis.write(out)
    if json:
        sys.stdout.write(as_json(diagnosis.figures))
        return 0
    console = terminal.console()
    for line in diagnosis.lines():
        console.print(line, soft_wrap=True)
    console.print(page_line(out / DIAGNOSIS_PAGE), soft_wrap=True)
    return 0


def simulate_(
    model: Model,
    *,
    test: Annotated[Path, Parameter(help="Test sheet, TOML: instruments, tolerances, postures.")],
    hide: Annotated[
        tuple[str, ...],
        Parameter(
            help="An effect: CAUSE, CAUSE=VALUE of its first parameter, or CAUSE.PARAMETER=VALUE, such as "
            "link_bow=1.0; may be repeated. docs/measured-data.md lists them."
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
    with errors_within(effects):
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
