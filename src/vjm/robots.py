"""Robots' descriptions, URDF, SDF, MJCF and tables of joints, as machines, and machines as descriptions."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from vjm.engines import refuse_unbuildable
from vjm.io.dh_table import Parallel, dh_table, dh_text, said_parallel
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_document import Imported
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import (
    mjcf_leaves_out,
    mjcf_text,
    not_in_table,
    serial_chain,
    urdf_leaves_out,
    urdf_text,
)
from vjm.io.ur_calibration import kinematics_text, not_held
from vjm.model.machine import Machine
from vjm.postures import check_machine

DescriptionFormat: TypeAlias = Literal["urdf", "mjcf", "dh", "mdh", "ur-kinematics"]


class DescriptionText(NamedTuple):
    """A machine as a description.

    Attributes:
        text: of the file.
        said: what is said of it.
        left_out: what of the machine it does not hold, a line each.
    """

    text: str
    said: list[str]
    left_out: list[str]


def read_robot(
    file: Path | str, *, tip: str | None = None, stiffness: Path | None = None, fix_base: bool = False
) -> Machine:
    """The machine of a robot's description.

    Args:
        file: a URDF, SDF or MJCF file, a DH table or a controller's calibration.
        tip: name of the link at which the way to one end stops; the whole robot if left out.
        stiffness: file that says how stiff its drives are; that beside the description if left out. Without one the
            drives' compliance is a placeholder.
        fix_base: what floats is held where the file shows it.

    Raises:
        ModelFileError: it cannot be read, or what it describes makes no machine.

    Example:
        >>> import tempfile, vjm
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = Path(folder) / "arm.urdf"
        ...     _ = file.write_text(vjm.robot_text(vjm.load("ur10"), "urdf").text)
        ...     [joint.name for joint in vjm.read_robot(file).held_joints][:2]
        ['shoulder-pan', 'shoulder-lift']
    """
    return machine_of(import_robot(Description(Path(file)), tip, Reading(fix_base), stiffness))


def machine_of(imported: Imported) -> Machine:
    """The machine of what was read, built as every command builds it.

    Raises:
        ModelFileError: it is none; the message names the description.
    """
    try:
        machine = build_chain(imported.document, imported.file)
        refuse_unbuildable(machine)
    except ValueError as error:
        said = str(error).removeprefix(f"{imported.file}: ")
        raise ModelFileError(
            f"{imported.file}: what it describes makes no machine, so nothing is written: {said}"
        ) from error
    return machine


def robot_text(
    machine: Machine, form: DescriptionFormat, *, end: str = "", parallel: Parallel = "beta", suffix: str = ".toml"
) -> DescriptionText:
    """A machine's geometry, joints, limits and masses as a description, and what that does not hold.

    Args:
        machine: see `vjm.load`; a URDF and a table have no closed loops.
        form: ``urdf``, ``mjcf``, ``dh``, ``mdh`` or ``ur-kinematics``.
        end: name of the end frame to which a table leads; behind the last part if left out.
        parallel: nearly parallel axes of a table: Hayati's ``beta``, or ``offsets`` that cancel.
        suffix: of a table's file: ``.toml`` or ``.csv``.

    Raises:
        ValueError: the description cannot hold the machine's joints.

    Example:
        >>> import vjm
        >>> description = vjm.robot_text(vjm.load("planar-2r"), "dh")
        >>> "shoulder" in description.text, description.said
        (True, ['2 joints'])
    """
    check_machine(machine)
    if form == "urdf":
        if machine.closures:
            names = ", ".join(closure.name for closure in machine.closures)
            raise ValueError(f"the closures {names} close loops, and a URDF is a tree: take mjcf instead")
        return DescriptionText(urdf_text(machine), [], urdf_leaves_out(machine))
    if form == "mjcf":
        return DescriptionText(mjcf_text(machine), [], mjcf_leaves_out(machine))
    serial = serial_chain(machine, end)
    said, left_out = [f"{len(serial.joints)} joints"], not_in_table(machine, serial)
    if form == "ur-kinematics":
        if parallel != "beta":
            raise ValueError("parallel goes with dh or mdh: leave it out")
        return DescriptionText(kinematics_text(serial), said, left_out + not_held(serial))
    table = dh_table(serial, form, parallel)
    said += said_parallel(table)
    if any(row.beta for row in table.rows):
        said.append("--parallel offsets writes a plain table, with offsets that cancel in place of beta")
    return DescriptionText(dh_text(table, machine.source, suffix), said, left_out)
