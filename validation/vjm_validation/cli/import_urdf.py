"""The command ``validate import``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vjm.io.files import write_whole
from vjm.io.robot import FileUnits, Reading
from vjm.io.robot_file import Description, cached_description, import_robot
from vjm.io.robot_units import parsed_units
from vjm.model.joints import JointKind
from vjm.robots import machine_of
from vjm_output import terminal
from vjm_validation.cli.status import OK, UsageError


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
    found = import_robot(description, tip, _reading(fix_base, strict, as_is, units), stiffness)
    file = out or Path(f"{found.document['name']}.toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another --out")
    chain = machine_of(found)
    write_whole(file, found.text())
    console = terminal.console()
    driven = [joint for joint in chain.moving if joint.kind is JointKind.ACTUATED]
    console.print(f"{file}: {len(chain.parts)} parts, {len(driven)} actuated joints", soft_wrap=True)
    lines = found.notes.lines()
    if found.ends:
        lines.append(f"ends: {', '.join(found.ends)}; --tip takes the way to one of them")
    if found.to_fill_in:
        lines.append(f"to be filled in, placeholders now: the compliance of {', '.join(found.to_fill_in)}")
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
