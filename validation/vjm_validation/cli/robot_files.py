"""The commands on other programs' robot files.

``validate import`` writes a model file of a URDF, SDF, MJCF, DH table or calibration, ``validate export`` writes
these of a model. Both say what the other format does not hold.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.dh_table import Parallel
from vjm.io.files import check_outputs, write_whole
from vjm.io.machine_file import load_model
from vjm.io.robot import FileUnits, Reading
from vjm.io.robot_file import Description, cached_description, import_robot, parsed_units
from vjm.io.stiffness_file import stiffness_text
from vjm.model.machine import Machine
from vjm.model.parts import JointKind
from vjm.robots import DescriptionFormat, machine_of, robot_text
from vjm_output import terminal
from vjm_validation.cli import OK, UsageError
from vjm_validation.cli.options import Strict, considered


def import_(
    urdf: Annotated[
        Path | None, Parameter(help="URDF, SDF or MJCF file, DH table or calibration of a robot.")
    ] = None,
    *,
    from_description: Annotated[
        str | None, Parameter(help="In place of a file: a robot of robot_descriptions that is in its cache.")
    ] = None,
    tip: Annotated[str | None, Parameter(help="Link at the end; the whole tree where it is left out.")] = None,
    xacro: Annotated[bool, Parameter(help="Expand xacro macros first.", negative="")] = False,
    xacro_argument: Annotated[
        tuple[str, ...], Parameter(help="An argument of the macros, NAME=VALUE; may be given again.")
    ] = (),
    ur_type: Annotated[
        str, Parameter(help="Arm of Universal Robots, such as ur5e, whose controller's calibration.conf this is.")
    ] = "",
    fix_base: Annotated[
        bool, Parameter(help="Hold what floats, such as a trunk, where the file has it.", negative="")
    ] = False,
    strict: Annotated[
        bool, Parameter(help="Refuse what no machine can have, in place of repairing it.", negative="")
    ] = False,
    as_is: Annotated[
        bool, Parameter(help="Leave out what no machine can have, in place of repairing it.", negative="")
    ] = False,
    units: Annotated[
        str | None,
        Parameter(help="Of the file's lengths, masses and perhaps moments of inertia: mm,g or m,kg,kg*mm2."),
    ] = None,
    stiffness: Annotated[
        Path | None,
        Parameter(help="Stiffness of the drives, by joint; NAME.stiffness.toml beside the file by default."),
    ] = None,
    out: Annotated[Path | None, Parameter(help="Model file to write; NAME.toml beside you by default.")] = None,
) -> int:
    """Write a model file of a URDF, SDF or MJCF file, a DH table or a calibration; say what is not read."""
    description = _description(urdf, from_description, xacro or bool(xacro_argument), xacro_argument, ur_type)
    robot = import_robot(description, tip, _reading(fix_base, strict, as_is, units), stiffness)
    file = out or Path(f"{robot.document['name']}.toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another --out")
    chain = machine_of(robot)
    write_whole(file, robot.text())
    console = terminal.console()
    driven = [joint for joint in chain.moving if joint.kind is JointKind.ACTUATED]
    console.print(f"{file}: {len(chain.parts)} parts, {len(driven)} actuated joints", soft_wrap=True)
    lines = robot.notes.lines()
    if robot.ends:
        lines.append(f"ends: {', '.join(robot.ends)}; --tip takes the way to one of them")
    if robot.to_fill_in:
        lines.append(f"to be filled in, placeholders now: the compliance of {', '.join(robot.to_fill_in)}")
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False, markup=False)
    return OK


def _reading(fix_base: bool, strict: bool, as_is: bool, units: str | None) -> Reading:
    if strict and as_is:
        raise UsageError("--strict refuses what --as-is leaves out: give one of them")
    try:
        read_in = FileUnits() if units is None else parsed_units(units)
    except ValueError as error:
        raise UsageError(f"--units {units}: {error}") from error
    return Reading(fix_base, "refused" if strict else "left out" if as_is else "made", read_in)


def _description(
    urdf: Path | None, name: str | None, xacro: bool, arguments: tuple[str, ...], ur_type: str
) -> Description:
    if (urdf is None) == (name is None):
        raise UsageError("give a robot's file, or --from-description NAME" + (", not both" if name else ""))
    if name is not None:
        if xacro:
            raise UsageError("--xacro and --xacro-argument go with a file: leave them out")
        if ur_type:
            raise UsageError("--ur-type goes with a controller's calibration.conf: leave it out")
        return cached_description(name)
    assert urdf is not None
    given = {}
    for argument in arguments:
        key, equals, value = argument.partition("=")
        if not key or not equals:
            raise UsageError(f"--xacro-argument {argument}: write NAME=VALUE")
        given[key] = value
    return Description(urdf, xacro, given, ur_type)


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
