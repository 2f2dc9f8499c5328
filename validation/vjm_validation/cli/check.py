"""The command ``validate check``."""

from __future__ import annotations

from vjm.io.errors import ModelFileError
from vjm.io.manipulator_file import load_manipulator
from vjm.io.model_file import load_chain, read_document
from vjm.io.model_report import errors_of, summary_of
from vjm.platform.manipulator import Manipulator
from vjm.platform.rigid import PoseError, inverse_kinematics
from vjm_output import terminal
from vjm_validation.cli.doubts import Strict, considered
from vjm_validation.cli.options import Model
from vjm_validation.cli.status import BAD_INPUT, OK


def check_(model: Model, *, strict: Strict = False) -> int:
    """List every error of a model file, or say what machine it describes and what is doubtful about it."""
    console = terminal.console()
    if read_document(model).content.get("kind") == "manipulator":
        machine = load_manipulator(model)
        unreached = _unreached(machine)
        for line in unreached:
            terminal.error(line)
        if unreached:
            return BAD_INPUT
        considered(model, strict)
        console.print(terminal.two_columns(f"{machine.name}: {machine.title}", dict(_platform(machine))))
        return OK
    try:
        errors = errors_of(model)
    except ModelFileError as error:
        errors = [str(error)]
    for line in errors:
        terminal.error(line)
    if errors:
        return BAD_INPUT
    chain = load_chain(model)
    considered(model, strict)
    console.print(terminal.two_columns(f"{chain.name}: {chain.title}", _merged(summary_of(chain))))
    return OK


def _unreached(machine: Manipulator) -> list[str]:
    """Why the rigid machine does not close at home, or which of its poses it cannot take."""
    lines: dict[str, None] = {}
    for pose in machine.poses.values():
        try:
            inverse_kinematics(machine, pose)
        except PoseError as error:
            lines[str(error)] = None
    return list(lines)


def _merged(rows: list[tuple[str, str]]) -> dict[str, str]:
    """Rows of one name under each other."""
    table: dict[str, str] = {}
    for name, value in rows:
        table[name] = f"{table[name]}\n{value}" if name in table else value
    return table


def _platform(machine: Manipulator) -> list[tuple[str, str]]:
    return [
        ("legs", f"{len(machine.legs)}: {', '.join(leg.name for leg in machine.legs)}"),
        *((f"leg {leg.name}", f"{leg.chain.name}, {len(leg.chain.parts)} parts") for leg in machine.legs),
        ("poses", ", ".join(machine.poses)),
    ]
