"""The command ``validate new``.

It writes a commented model file that runs as it is, or the test sheet of a machine with its postures, channels and
the columns of its readings.
"""

from __future__ import annotations

import os
import re
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, assert_never

from cyclopts import Parameter

from vjm.io.errors import ModelFileError
from vjm.io.files import write_whole
from vjm.io.machine_file import load_model
from vjm.model.joint_limits import joint_limits
from vjm.model.machine import Machine
from vjm_output import terminal
from vjm_validation.cli import OK, UsageError

KindOfTest = Literal["displacements", "poses", "frequencies"]
"""Kinds of test whose sheet can be made of a machine."""
INSTRUMENTS = """\
# Errors of each instrument, 1 sigma: of one reading, of a constant zero error, of the scale (relative).
# A channel that was not read goes; others are uy_mm, uz_mm, rx_rad, ry_rad, rz_rad, mx_Nmm, my_Nmm, mz_Nmm.
[instrument.ux_mm]
noise = 0.001
zero = 0.002
scale = 0.001
source = "made up; say here where your numbers come from"

[instrument.fx_N]
noise = 2.0
zero = 3.0
scale = 0.003

[instrument.fy_N]
noise = 2.0
zero = 3.0
scale = 0.003

[instrument.fz_N]
noise = 2.0
zero = 3.0
scale = 0.003

# What the manufacturer promises of the machine, 1 sigma.
[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
"""


def sheet_for(model: str, file: Path, test: KindOfTest | None = None) -> str:
    """The text of a sheet that `validate calibrate` takes for a machine, and mostly `validate diagnose`.

    An arm gets a sheet of ``kind = "poses"``, with readings of where a marker is; any other machine, a platform for
    example, one of imposed displacements, with all postures of its file.

    Args:
        model: a name of the library, or a model file.
        file: the sheet; a model file is named as seen from its folder.
        test: of an arm poses, where a marker is read, and of any other chain imposed displacements if left out.

    Raises:
        ModelFileError: no such model, or one that is not tested so: poses are read of what drives alone move, and
            displacements imposed on what they do not.
    """
    machine = load_model(model)
    path = Path(model)
    name = Path(os.path.relpath(path, file.parent)).as_posix() if path.is_file() else model
    of_poses = bool(machine.held_joints) and not machine.closes
    kind: KindOfTest = test or ("poses" if of_poses else "displacements")
    match kind:
        case "frequencies":
            return _of_frequencies(machine, name, file.stem)
        case "poses":
            if not of_poses:
                raise ModelFileError(f"{model}: its drives alone do not set its pose: take displacements")
            return _of_poses(machine, name, file.stem)
        case "displacements":
            if of_poses:
                raise ModelFileError(f"{model}: drives move its end, and nothing else does: take poses")
            return _of_displacements(machine, name, file.stem)
        case _:
            assert_never(kind)


def _of_displacements(chain: Machine, name: str, title: str) -> str:
    label = next(iter(chain.postures))
    if chain.closes:
        known = ", ".join(chain.postures)
        places = f"""\
# The model has the postures {known}. More of them: displacements of the end-effector from {label}, mm and rad.
# The drives are held where the rigid machine has them there.
[poses]
# near = [10.0, 0.0, 0.0]"""
    else:
        rows = "\n".join(f"{label} = {q.tolist()}" for label, q in chain.postures.items())
        joints = ", ".join(joint.name for joint in chain.joints) or "none"
        places = f"""\
# Coordinates of the passive joints, mm or rad, from base to tool: {joints}.
[postures]
{rows}"""
    return f"""\
# A test of {chain.name} by imposed displacements. It is read as it is; put in your own numbers.
# READINGS.csv has one row a reading, with these columns:
#     posture,ux_mm,fx_N,fy_N,fz_N
#     {label},0.1,…
#     validate calibrate READINGS.csv --sheet THIS --out DIR     compliances and their uncertainty
#     validate diagnose READINGS.csv --sheet THIS --out DIR      what the model lacks, and the gain
# docs/measured-data.md has every key and every column.

[test]
title = "{title}"
model = "{name}"
control = "displacement"            # the pose was imposed and the wrench measured; "force" is the reverse

{places}

{INSTRUMENTS}"""


def _of_frequencies(chain: Machine, name: str, title: str) -> str:
    joints = [joint for joint in chain.moving if joint.name in joint_limits(chain).given]
    # joints of closed loops follow from one another: their postures have labels
    where = ["posture"] if chain.closes else [f"{j.name}.{'q_mm' if j.slides else 'q_rad'}" for j in joints]
    columns = ",".join([*where, "f1_Hz", "f2_Hz", "f3_Hz"])
    return f"""\
# A test of {chain.name}: its natural frequencies, read by tapping it in several postures, drives and brakes held.
# It is read as it is; put in your own numbers. READINGS.csv has one row a posture, with these columns:
#     {columns}
# or `posture`, a label of the model or of [postures], in place of the joints. A blank cell is a mode not seen.
#     validate calibrate READINGS.csv --sheet THIS --out DIR     compliances and their uncertainty
# docs/calibration.md has every key and every column.

kind = "frequencies"

[test]
title = "{title}"
model = "{name}"
# gravity = [0.0, 0.0, -9.81]       # m/s², where its weight bends it much

# 1 sigma of a frequency: a fixed part and one of its value. Columns f1_std_Hz and so on say it for each.
[frequencies]
noise_Hz = 0.05
noise_rel = 0.0
missing = 0                         # modes that may not have been seen in a posture; 0: column f2_Hz is mode 2
source = "made up; say here where your numbers come from"

# How well each part's mass is known, 1 sigma: frequencies tell stiffnesses over masses.
[tolerance]
mass_rel = 0.02

# What the machine carries in the test and the model does not have, such as the sensor. A column payload_kg says it
# for each row.
[payload]
position_mm = [0.0, 0.0, 0.0]       # in the frame behind the last part; else `on` names the part
mass_kg = 0.0
"""


def _of_poses(chain: Machine, name: str, title: str) -> str:
    joints = [f"{joint.name}.{'q_mm' if joint.slides else 'q_rad'}" for joint in chain.held_joints]
    columns = ",".join([*joints, "tool.x_mm", "tool.y_mm", "tool.z_mm"])
    return f"""\
# A test of {chain.name}: where a marker on its last part is, in many postures, seen by a tracker.
# It is read as it is; put in your own numbers. READINGS.csv has one row a posture, with these columns:
#     {columns}
#     validate calibrate READINGS.csv --sheet THIS --out DIR     compliances and their uncertainty
#     validate diagnose READINGS.csv --sheet THIS --out DIR      what the model lacks, and the gain
# docs/poses.md has every key and every column.

kind = "poses"

[test]
title = "{title}"
model = "{name}"
joints = "commanded"                # what the columns of the joints are; or "measured"
order = "as taken"                  # in which the rows stand; or "unknown"
gravity = [0.0, 0.0, -9.81]         # m/s², in the axes of the robot's base

# Names of columns, where they differ from the model's joints.
[joints]
# my_column = "{chain.held_joints[0].name}"

# The marker: where it is in the frame behind the last part, and how well that is known. Else `on` names the part.
[markers.tool]
position_mm = [0.0, 0.0, 0.0]
sigma_mm = 300.0

# 1 sigma of a coordinate of a position.
[tracker]
noise_mm = 0.05
source = "made up; say here where your numbers come from"
"""


def new_(
    kind: Annotated[
        Literal[
            "chain", "arm", "platform", "bodies", "gantry", "boom", "axis", "scara", "five-bar", "delta", "sheet"
        ],
        Parameter(help="What machine to begin with, or the sheet of a test."),
    ],
    file: Annotated[Path, Parameter(help="To write; it must not exist yet.")],
    *,
    for_: Annotated[
        str | None,
        Parameter(name="--for", help="Of a sheet: the machine that is tested. A model's name or file."),
    ] = None,
    test: Annotated[
        KindOfTest | None,
        Parameter(help="Of a sheet --for a machine: what is read; by default poses of an arm, else displacements."),
    ] = None,
) -> int:
    """Write a commented model file, or the sheet of a test, that runs as it is.

    A platform comes with the file of its legs beside it.
    """
    if for_ is not None and kind != "sheet":
        raise UsageError(f"--for is for a sheet, and this is a {kind}: leave it out")
    if test is not None and for_ is None:
        raise UsageError("--test goes with --for MODEL: say which machine is tested")
    _check_new(file)
    files = {file: _template(kind).replace("NAME", file.stem)}
    if kind == "sheet" and for_ is not None:
        files = {file: sheet_for(for_, file, test)}
    if kind == "platform":
        leg = file.with_name(f"{file.stem}-leg.toml")
        _check_new(leg)
        files = {leg: _template("chain").replace("NAME", leg.stem), file: files[file].replace("LEG", leg.name)}
    for path, text in files.items():
        write_whole(path, text)
    console = terminal.console()
    what = {"arm": "an arm", "axis": "a linear axis", "bodies": "bodies and joints"}.get(kind, f"a {kind}")
    for path in files:
        console.print(f"{path}: {what if path == file else 'its legs'}; put in your own numbers", soft_wrap=True)
    if kind == "sheet":
        nexts = f"validate diagnose READINGS.csv --sheet {file} --out DIR, validate calibrate with the same words"
        if test == "frequencies":
            nexts = f"validate calibrate READINGS.csv --sheet {file} --out DIR"
    else:
        nexts = f"validate check {file}, validate stiffness {file}, validate show {file}, validate all {file}"
    console.print(f"next: {nexts}", soft_wrap=True, highlight=False)
    return OK


def _template(kind: str) -> str:
    return resources.files("vjm_validation").joinpath("cli", "templates", f"{kind}.toml").read_text("utf-8")


def _check_new(file: Path) -> None:
    """Raise a `UsageError` where a file cannot be begun."""
    if file.suffix != ".toml":
        raise UsageError(f"{file}: a model file or sheet ends in .toml")
    if file.exists():
        raise UsageError(f"{file}: exists already; give another name, or remove it first")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", file.stem):
        raise UsageError(f"{file}: its name must start with a letter and go on with letters, digits, '_' or '-'")
