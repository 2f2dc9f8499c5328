"""A robot's description: URDF, SDF, MJCF, xacro macros, or a robot of the package ``robot_descriptions``.

A table of Denavit and Hartenberg and a calibration of a controller are descriptions, too.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vjm.child_process import ChildError
from vjm.io.bounded_xml import XmlFile, parse_xml, read_xml
from vjm.io.dh_file import dh_robot
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.foreign_readers import expanded_xacro
from vjm.io.mjcf import mjcf_robot
from vjm.io.robot import USUAL, FileUnits, Reading, Robot
from vjm.io.robot_document import Imported, robot_document
from vjm.io.robot_units import gyration_note, units_note
from vjm.io.sdf import sdf_robot
from vjm.io.stiffness_file import beside, fill_in
from vjm.io.ur_calibration import controller_robot, kinematics_robot
from vjm.io.urdf import urdf_robot

PACKAGE = "robot_descriptions"


@dataclass(frozen=True)
class Description:
    """A file that describes a robot.

    Attributes:
        path: of the file.
        xacro: whether it holds macros that are to be expanded.
        arguments: of its macros, by name.
        ur_type: type of an arm of Universal Robots, to whose nominal table a controller's file adds.
    """

    path: Path
    xacro: bool = False
    arguments: Mapping[str, str] = field(default_factory=dict)
    ur_type: str = ""

    @property
    def suffix(self) -> str:
        """Ending of the file's name, by which tables are told from URDF and MJCF files."""
        return self.path.suffix.lower()


def import_robot(
    description: Description, tip: str | None = None, reading: Reading = USUAL, stiffness: Path | None = None
) -> Imported:
    """The model document of a robot's description: the whole tree, or what leads from the root to one link.

    Args:
        description: the file. ``.toml`` and ``.csv`` are tables of Denavit and Hartenberg, ``.yaml`` and ``.conf``
            calibrations of Universal Robots; of all others the outermost element tells URDF, SDF and MJCF apart.
        tip: name of the link or body at the end.
        reading: how it is read.
        stiffness: a file with the stiffness of its drives, see `vjm.io.stiffness_file`; None: one beside it.

    Raises:
        ModelFileError: no such file or link, or what is to be read of it makes no machine.
        ImportError: an optional extra that it needs is not installed.

    Example:
        >>> found = import_robot(Description(Path("scene.xml")), "hand")  # doctest: +SKIP
        >>> found.notes.lines()  # doctest: +SKIP
    """
    path = description.path
    found = _imported(description, tip, reading)
    if (file := stiffness or beside(path)) is not None:
        fill_in(found, file)
    if found.impossible:
        # only here, for few files need what computes frequencies
        from vjm.io.repair_effect import say_effect

        say_effect(found)
    return found


def _imported(description: Description, tip: str | None, reading: Reading) -> Imported:
    path, suffix = description.path, description.suffix
    if description.ur_type and suffix != ".conf":
        raise ModelFileError(f"{path.name}: --ur-type goes with a controller's calibration.conf: leave it out")
    if suffix in (".toml", ".csv", ".yaml", ".yml", ".conf") and not description.xacro:
        if tip is not None:
            raise ModelFileError(f"{path.name}: is a table of joints, which has one end: leave out --tip")
        if reading.units != FileUnits():
            raise ModelFileError(f"{path.name}: says its units itself: leave out --units")
        return robot_document(_of_table(description, reading))
    xml = expanded(path, description.arguments) if description.xacro else read_xml(path)
    if xml.root.tag == "mujoco":
        if reading.units != FileUnits():
            raise ModelFileError(f"{path.name}: MuJoCo reads it in m and kg: scale the file in place of --units")
        return _in_its_units(mjcf_robot(path, tip, reading), xml, tip, reading, scales=False)
    read = sdf_robot if xml.root.tag == "sdf" else urdf_robot
    return _in_its_units(read(xml, path.name, tip, reading), xml, tip, reading)


def _of_table(description: Description, reading: Reading) -> Robot:
    path, suffix = description.path, description.suffix
    if suffix == ".conf":
        return controller_robot(path, reading, description.ur_type)
    return dh_robot(path, reading) if suffix in (".toml", ".csv") else kinematics_robot(path, reading)


def _in_its_units(
    robot: Robot, xml: XmlFile, tip: str | None, reading: Reading, *, scales: bool = True
) -> Imported:
    """The document of a robot, and what its masses and moments of inertia say of the units of its file."""
    note = units_note(robot, xml.root, reading.units, scales=scales)
    if doubt := note or gyration_note(robot):
        robot.notes.doubtful.append(doubt)
    if reading.units != FileUnits():
        robot.notes.changed.append(
            "lengths, masses and moments of inertia are in the units of --units; springs, gains and rotors are in "
            "N, m and kg"
        )
    try:
        return robot_document(robot, tip)
    except ModelFileError as error:
        # what is too large or too heavy for a machine has its reason there
        if not note:
            raise
        raise ModelFileError(f"{error}; {note}") from error


def expanded(path: Path, arguments: Mapping[str, str]) -> XmlFile:
    """The elements of a file behind its xacro macros.

    Raises:
        ModelFileError: they cannot be expanded.
        ImportError: xacro, an optional extra, is not installed.
    """
    read_xml(path)
    try:
        text = expanded_xacro(path, arguments)
    except ChildError as error:
        raise ModelFileError(str(error)) from error
    except ValueError as error:
        raise ModelFileError(f"{path.name}: its xacro macros cannot be expanded: {error}") from error
    return parse_xml(text.encode(), path.name)


def cached_description(name: str) -> Description:
    """A robot of the package ``robot_descriptions``, from its cache; nothing is downloaded.

    Raises:
        ModelFileError: there is no such robot, or its files are not in the cache.
        ImportError: the package, an optional extra, is not installed.
    """
    known: Mapping[str, Any] = importlib.import_module(f"{PACKAGE}._descriptions").DESCRIPTIONS
    if name not in known and f"{name}_description" in known:
        name = f"{name}_description"
    if name not in known:
        hint = did_you_mean(name, known) or "; see its page for the names"
        raise ModelFileError(f"{PACKAGE} has no robot '{name}'{hint}")
    repository = importlib.import_module(f"{PACKAGE}._repositories").REPOSITORIES.get(known[name].repository)
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
    fetch = f"fetch them where there is a network: python -c 'import {PACKAGE}.{name}'"
    # to import the robot's module downloads what is not there
    if repository is None or not (cache / repository.cache_path / ".git").is_dir():
        raise ModelFileError(f"the files of '{name}' are not in the cache {cache}: {fetch}")
    try:
        module = importlib.import_module(f"{PACKAGE}.{name}")
    except Exception as error:  # git's errors, and the package's own
        why = " ".join(str(error).split()) or type(error).__name__
        raise ModelFileError(
            f"the files of '{name}' in the cache {cache} cannot be used ({why}): {fetch}"
        ) from error
    for key in ("URDF_PATH", "MJCF_PATH"):
        if hasattr(module, key):
            return Description(Path(getattr(module, key)))
    if hasattr(module, "XACRO_PATH"):
        return Description(Path(module.XACRO_PATH), True, dict(getattr(module, "XACRO_ARGS", {})))
    raise ModelFileError(f"{PACKAGE} has '{name}' neither as URDF nor as MJCF")
