"""The command ``validate export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.dh_table import Parallel
from vjm.io.files import check_outputs, write_whole
from vjm.io.machine_file import load_model
from vjm.io.stiffness_file import stiffness_text
from vjm.model.machine import Machine
from vjm.robots import DescriptionFormat, robot_text
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.status import OK, UsageError

SUFFIXES: dict[DescriptionFormat, tuple[str, ...]] = {
    "urdf": (".urdf",),
    "mjcf": (".xml",),
    "dh": (".dh.toml", ".toml", ".csv"),
    "mdh": (".mdh.toml", ".toml", ".csv"),
    "ur-kinematics": (".kinematics.yaml", ".yaml", ".yml"),
}
"""Of files, by which import tells formats; the first is that of a file that is not named."""


def export_(
    model: Annotated[str, Parameter(help="Library model or model file; a URDF and a table have no closed loops.")],
    *,
    format: Annotated[
        DescriptionFormat | None,
        Parameter(help="Format of --out: URDF, MJCF, a DH table, distal or Craig's, or kinematics of a UR arm."),
    ] = None,
    out: Annotated[
        Path | None,
        Parameter(help="File to write in --format; a table is .toml or .csv. NAME with its ending else."),
    ] = None,
    parallel: Annotated[
        Parallel,
        Parameter(help="Nearly parallel axes of a table: Hayati's beta, or plain rows with offsets that cancel."),
    ] = "beta",
    end: Annotated[
        str, Parameter(help="End frame of a tree to which a table leads; behind the last part else.")
    ] = "",
    urdf: Annotated[Path | None, Parameter(help="URDF file to write.")] = None,
    mjcf: Annotated[Path | None, Parameter(help="MJCF file to write, with joints' springs.")] = None,
    stiffness: Annotated[
        Path | None,
        Parameter(
            help="File to write of the drives' stiffness; import reads NAME.stiffness.toml beside NAME.urdf."
        ),
    ] = None,
    force: Annotated[bool, Parameter(help="Write over a file that is there.", negative="")] = False,
    strict: Strict = False,
) -> int:
    """Write a machine's geometry, joints, limits and masses as URDF, MJCF or DH table; say what is not held."""
    chain = load_model(model)
    if format is not None:
        out = _named(out, format, chain.name)
    elif out is not None:
        raise UsageError(f"--out {out}: say in which --format: {', '.join(SUFFIXES)}")
    if format in ("urdf", "mjcf"):
        if (urdf if format == "urdf" else mjcf) is not None:
            raise UsageError(f"--format {format} and --{format} are the same: give one of them")
        urdf, mjcf = (out, mjcf) if format == "urdf" else (urdf, out)
        out = None
    if out is None and (parallel != "beta" or end):
        raise UsageError("--parallel and --end go with --format dh, mdh or ur-kinematics: leave them out")
    if chain.closures and urdf is not None:
        names = ", ".join(closure.name for closure in chain.closures)
        raise UsageError(
            f"--urdf: the closures {names} of {model} close loops, and a URDF is a tree. Give --mjcf instead"
        )
    files = {"--urdf": urdf, "--mjcf": mjcf, "--stiffness": stiffness, "--out": out}
    if not any(files.values()):
        raise UsageError(
            "give the file to write: --format FORMAT, --urdf FILE, --mjcf FILE, --stiffness FILE, or several"
        )
    for option, file in files.items():
        if file is not None and file.exists() and not force:
            raise UsageError(f"{file}: exists already; give another {option}, or --force")
    check_outputs(files)
    table = _table(chain, model, format, parallel, end, out.suffix) if out is not None and format else None
    considered(model, strict)
    console = terminal.console()
    written: tuple[tuple[Path | None, DescriptionFormat], ...] = ((urdf, "urdf"), (mjcf, "mjcf"))
    for name, form in written:
        if name is None:
            continue
        made = robot_text(chain, form)
        write_whole(name, made.text)
        console.print(f"{name}: {len(chain.parts)} parts", soft_wrap=True)
        for line in made.left_out:
            console.print(f"left out: {line}", soft_wrap=True, highlight=False, markup=False)
    if out is not None and table is not None:
        content, lines = table
        write_whole(out, content)
        for line in (f"{out}: {lines[0]}", *lines[1:]):
            console.print(line, soft_wrap=True, highlight=False, markup=False)
    if stiffness is not None:
        write_whole(stiffness, stiffness_text(chain))
        console.print(f"{stiffness}: what deflects in the drives", soft_wrap=True)
    return OK


def _named(out: Path | None, format_name: DescriptionFormat, machine: str) -> Path:
    endings = SUFFIXES[format_name]
    if out is None:
        return Path(f"{machine}{endings[0]}")
    if format_name not in ("urdf", "mjcf") and out.suffix not in endings:
        raise UsageError(f"--out {out}: import tells formats by the file's ending: give {' or '.join(endings[1:])}")
    return out


def _table(
    chain: Machine, model: str, form: DescriptionFormat, parallel: Parallel, end: str, suffix: str
) -> tuple[str, list[str]]:
    """The text of a table, and what is said of it."""
    if form == "ur-kinematics" and parallel != "beta":
        raise UsageError("--parallel goes with --format dh or mdh: leave it out")
    try:
        made = robot_text(chain, form, end=end, parallel=parallel, suffix=suffix)
    except ValueError as error:
        raise UsageError(f"--format {form}: {model}: {error}") from error
    return made.text, made.said + [f"left out: {line}" for line in made.left_out]
