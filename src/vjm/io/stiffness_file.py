"""``ROBOT.stiffness.toml``: how stiff the drives are of a robot whose description does not say it.

It stands beside the description and has a table for each joint, by the joint's name there::

    [joints.shoulder]
    stiffness_Nm_per_rad = 31000.0
    lateral_rad_per_Nmm = [2e-9, 2e-9]
    rotor_kg_mm2 = 2.1e6
    source = "the gear's data sheet"
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.joint_tables import Compliance, Pair
from vjm.io.robot_document import COMPLIANCE, ROTOR, Imported
from vjm.io.sections import Table
from vjm.io.toml_parsing import parse_toml
from vjm.io.toml_text import toml_text
from vjm.model.machine import Machine

SUFFIX = ".stiffness.toml"
Stiff = Annotated[float, Field(gt=0.0, le=1e15)]


class JointStiffness(Table):
    """What is known of one joint's drive: a stiffness or a compliance about or along its axis, and more."""

    stiffness_Nm_per_rad: Stiff | None = Field(None, description="about its axis, where it turns")  # noqa: N815
    stiffness_N_per_mm: Stiff | None = Field(None, description="along its axis, where it slides")  # noqa: N815
    compliance_rad_per_Nmm: Compliance | None = None  # noqa: N815
    compliance_mm_per_N: Compliance | None = None  # noqa: N815
    lateral_rad_per_Nmm: Pair | None = Field(None, description="about the two other axes")  # noqa: N815
    rotor_kg_mm2: float | None = Field(None, ge=0.0, description="inertia times the squared gear ratio")
    rotor_kg: float | None = Field(None, ge=0.0, description="the same of a joint that slides")
    source: str = Field("", description="where the numbers are from")

    @model_validator(mode="after")
    def _once(self) -> JointStiffness:
        given = [
            key for key in type(self).model_fields if key.startswith(("stiff", "compl")) and getattr(self, key)
        ]
        if len(given) > 1:
            raise ValueError(f"has {' and '.join(given)}: give one of them")
        return self

    def keys(self, slides: bool) -> dict[str, Any]:
        """Of the joint's table in a model file.

        Raises:
            ValueError: one is of a joint that moves otherwise.
        """
        kind, other = ("slides", "turns") if slides else ("turns", "slides")
        stiff = {"turns": "stiffness_Nm_per_rad", "slides": "stiffness_N_per_mm"}
        for key in (stiff[other], COMPLIANCE[other], ROTOR[other]):
            if getattr(self, key) is not None:
                raise ValueError(f"has {key}, but it {kind}")
        named = COMPLIANCE[kind], "lateral_rad_per_Nmm", ROTOR[kind], "source"
        found = {key: value for key in named if (value := getattr(self, key)) not in (None, "")}
        if (stiffness := getattr(self, stiff[kind])) is not None:
            # N m are 1e3 N mm
            found[COMPLIANCE[kind]] = 1.0 / (stiffness if slides else 1e3 * stiffness)
        return found


class StiffnessFile(Table):
    """The whole file."""

    joints: dict[str, JointStiffness]


def beside(description: Path) -> Path | None:
    """The file beside a robot's description, ``arm.stiffness.toml`` beside ``arm.urdf``; None where none is."""
    name = description.name.removesuffix(".xacro")
    file = description.with_name(Path(name).stem + SUFFIX)
    return file if file.is_file() else None


def fill_in(found: Imported, file: Path) -> None:
    """Put what a file says of joints into an imported document, and say it.

    Raises:
        ModelFileError: the file cannot be read, has other keys, or a joint of it has no drive or moves otherwise.
    """
    try:
        content = parse_toml(file.read_text("utf-8-sig"))
        tables = StiffnessFile.model_validate(content).joints
    except OSError as error:
        raise ModelFileError(f"{file}: cannot be read: {error.strerror}") from error
    except pydantic.ValidationError as error:
        raise ModelFileError(
            f"{file.name}: {one_line(error, content, lambda _: JointStiffness.model_fields)}"
        ) from error
    except ValueError as error:
        raise ModelFileError(f"{file.name}: {error}") from error
    parts = {part["name"]: part for part in found.document["parts"]}
    for joint, given in tables.items():
        part = parts.get(found.joints.get(joint, ""))
        if part is None:
            known = did_you_mean(joint, found.joints)
            found.notes.doubtful.append(
                f"{file.name} names the joint '{joint}', which is not in the machine{known}"
            )
            continue
        if part["kind"] == "joint":
            raise ModelFileError(f"{file.name}: joint '{joint}' has no drive: its spring stands in {found.file}")
        try:
            keys = given.keys(part.get("motion") == "slides")
        except ValueError as error:
            raise ModelFileError(f"{file.name}: joint '{joint}' {error}") from error
        part |= keys
        if part["name"] in found.to_fill_in and keys.keys() & set(COMPLIANCE.values()):
            found.to_fill_in.remove(part["name"])
    read = [joint for joint in tables if joint in found.joints]
    found.notes.changed.append(f"the stiffness of {', '.join(read) or 'no joint'} is that of {file.name}")
    found.document["source"] = f"{found.file} and {file.name}{found.unfilled}"


def stiffness_text(machine: Machine) -> str:
    """The file of a machine's drives: own and lateral compliance, and rotors; what import reads back."""
    tables = {}
    for joint in machine.moving:
        if joint.passive or joint.matrix is not None:
            continue
        kind = "slides" if joint.slides else "turns"
        known = {
            COMPLIANCE[kind]: joint.compliance,
            "lateral_rad_per_Nmm": list(joint.lateral) if any(joint.lateral) else None,
            ROTOR[kind]: joint.rotor,
        }
        if table := {key: value for key, value in known.items() if value}:
            tables[joint.name] = table
    return toml_text({"joints": tables})
