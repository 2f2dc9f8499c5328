"""A robot's description: URDF, SDF, MJCF, xacro macros, or a robot of the package ``robot_descriptions``.

A description in mm, cm, inches or g is told by what machines weigh for their size.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from vjm.child_process import ChildError
from vjm.io.bounded_xml import XmlElement, XmlFile, parse_xml, read_xml
from vjm.io.dh_table import dh_robot
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.foreign_readers import expanded_xacro
from vjm.io.inertia import inertia_matrix
from vjm.io.mjcf import mjcf_robot
from vjm.io.robot import USUAL, Body, FileUnits, Reading, Robot
from vjm.io.robot_document import Imported, robot_document
from vjm.io.sdf import sdf_robot
from vjm.io.stiffness_file import beside, fill_in
from vjm.io.ur_calibration import controller_robot, kinematics_robot
from vjm.io.urdf import urdf_robot

DENSITY, SIZE, GYRATION = (2.2, 56.0), (0.23, 2.9), (0.013, 0.58)
"""kg/m³, m, and a share of the size: the least and the most of these robots."""
MARGIN = 3.0
"""By which other machines may lie beyond these radii: less than a tenth of what a mistaken unit does."""
UNLIKE = 8.0
"""Both twice as far from the middle as robots are, squared and added: what is so in every unit is no robot."""
LIGHTEST = 0.1
"""kg: the lightest of these robots has 0.6. What would weigh less in g is in kg, and heavy for its size."""
NAMED = 5
"""Links that are named; of more it is said how many."""
LENGTHS = {"m": Decimal(1000), "mm": Decimal(1), "cm": Decimal(10), "in": Decimal("25.4")}
MASSES = {"kg": Decimal(1), "g": Decimal("0.001")}
"""In mm and kg."""
MOMENTS = {f"{mass}*{length}2": MASSES[mass] * LENGTHS[length] ** 2 for mass, length in product(MASSES, LENGTHS)}
"""In kg mm²."""
TOLD = ("kg*m2", "g*m2", "kg*mm2", "g*mm2")
"""Units of moments that are told by radii of gyration, beside those of a file's own lengths."""


def parsed_units(text: str) -> FileUnits:
    """Units as an option has them: of lengths, masses and perhaps moments of inertia, ``mm,g`` or ``m,kg,kg*mm2``.

    Moments are those of the two others where they are left out.

    Raises:
        ValueError: one is not known.

    Example:
        >>> parsed_units("in,kg").length, parsed_units("mm,g").moments
        (Decimal('25.4'), Decimal('0.001'))
    """
    words = text.split(",")
    if len(words) not in (2, 3) or words[0] not in LENGTHS or words[1] not in MASSES:
        raise ValueError(f"give lengths ({', '.join(LENGTHS)}) and masses ({', '.join(MASSES)}), as in mm,g")
    moments = words[2] if len(words) == 3 else f"{words[1]}*{words[0]}2"
    if moments not in MOMENTS:
        raise ValueError(f"give moments of inertia as one of {', '.join(MOMENTS)}")
    return FileUnits(LENGTHS[words[0]], MASSES[words[1]], MOMENTS[moments])


@dataclass(frozen=True)
class Extent:
    """How large and how heavy a robot is as its file has it.

    Attributes:
        size: m, the diagonal of the box around its joints and centres of mass, or its longest way from the base.
        mass: kg, of all bodies.
        gyration: m, the median radius of gyration of its bodies; zero where they have no moments of inertia.
    """

    size: float
    mass: float
    gyration: float


def _extent(robot: Robot) -> Extent:
    """How large and how heavy a robot is."""
    places, ways = {robot.root: np.eye(4)}, {robot.root: 0.0}
    for joint in robot.joints:
        places[joint.child] = places[joint.parent] @ joint.placing.frame
        ways[joint.child] = ways[joint.parent] + float(np.linalg.norm(joint.placing.shift))
    heavy = [body for body in robot.bodies.values() if body.mass]
    points = [T[:3, 3] for T in places.values()]
    points += [(places[body.name] @ [*body.centre, 1.0])[:3] for body in heavy]
    lengths = [ways[body.name] + float(np.linalg.norm(body.centre)) for body in heavy]
    size = max(float(np.linalg.norm(np.ptp(points, axis=0))), *ways.values(), *lengths)
    radii = [radius for body in heavy if (radius := _gyration(body))]
    return Extent(1e-3 * size, sum(body.mass for body in heavy), 1e-3 * median(radii) if radii else 0.0)


def _gyration(body: Body) -> float:
    """Radius of gyration of a body, mm, about the mean of its axes; zero where it is not known."""
    trace = sum(body.inertia[:3]) if body.inertia else 0.0
    return math.sqrt(trace / (2.0 * body.mass)) if trace > 0.0 else 0.0


def units_note(robot: Robot, root: XmlElement, units: FileUnits, *, scales: bool = True) -> str:
    """What is doubtful about the units of a robot's file, with the option that reads it otherwise; mostly none."""
    totals = _extent(robot)
    if not totals.size or not totals.mass or all(joint.kind == "fixed" for joint in robot.joints):
        # a body alone is a thing of any density
        return ""
    own = _names(units)
    fits = {(length, mass): _misfit(totals, units, length, mass) for length in LENGTHS for mass in MASSES}
    # lengths in inches with masses in g are nobody's, and near to a large machine in m and kg
    likely = sorted(fits if own[:2] == ("in", "g") else fits.keys() - {("in", "g")}, key=lambda one: fits[one])
    length, mass = likely[0] if fits[likely[0]] < UNLIKE else own[:2]
    said, options = [], []
    if (length, mass) != own[:2]:
        named = [f"the lengths in {length}"] * (length != own[0]) + [f"the masses in {mass}"] * (mass != own[1])
        said.append(
            f"{' and '.join(named)}, for as it is read its size is {printed(totals.size, 3)} m and its mass "
            f"{printed(totals.mass, 3)} kg, {printed(totals.mass / totals.size**3, 2)} kg/m³ over the cubed size. "
            f"Robots have {SIZE[0]:g} to {SIZE[1]:g} m, and {DENSITY[0]:g} to {DENSITY[1]:g}"
        )
        options = [",".join(one) for one in likely[1:] if one != own[:2] and _is_robots(totals, units, *one)]
    shares = {
        unit: totals.gyration
        / totals.size
        * math.sqrt(MOMENTS[unit] / units.moments * units.mass / MASSES[mass])
        * float(units.length / LENGTHS[length])
        for unit in dict.fromkeys((*TOLD, f"{mass}*{length}2", own[2]))
        if unit != "g*m2" or mass == "g"
    }
    usual = own[2] if (length, mass) == own[:2] else f"{mass}*{length}2"
    moments = _likely(shares, usual)
    if moments != usual:
        said.append(
            f"the moments of inertia in {moments}, for the radius of gyration of its links is "
            f"{printed(shares[usual], 2)} of its size. Robots have {GYRATION[0]:g} to {GYRATION[1]:g}"
        )
    if not said:
        return ""
    doubt = f"the file seems to have {'; and '.join(said)}{_meshes(root, length)}"
    if not scales:
        return f"{doubt}. Nothing is scaled: write the file in m and kg"
    options.insert(0, f"{length},{mass}" + (f",{moments}" if moments != f"{mass}*{length}2" else ""))
    return f"{doubt}. Nothing is scaled: --units {' or --units '.join(options)} reads it so"


def _in(totals: Extent, units: FileUnits, length: str, mass: str) -> tuple[float, float, float]:
    """Size, mass and density of a robot, m and kg, were its file in other units than those in which it was read."""
    size = totals.size * float(LENGTHS[length] / units.length)
    heavy = totals.mass * float(MASSES[mass] / units.mass)
    return size, heavy, heavy / size**3


def _misfit(totals: Extent, units: FileUnits, length: str, mass: str) -> float:
    """How far size and density are from the middle of robots: squares of logarithms, 1 at the end of their range.

    Infinite of what is lighter than any robot.
    """
    size, heavy, density = _in(totals, units, length, mass)
    if heavy < LIGHTEST and MASSES[mass] < units.mass:
        return math.inf
    return sum(
        ((2.0 * math.log(value) - math.log(low * high)) / math.log(high / low)) ** 2
        for value, (low, high) in ((size, SIZE), (density, DENSITY))
    )


def _is_robots(totals: Extent, units: FileUnits, length: str, mass: str) -> bool:
    size, heavy, density = _in(totals, units, length, mass)
    return heavy >= LIGHTEST and SIZE[0] <= size <= SIZE[1] and DENSITY[0] <= density <= DENSITY[1]


def _names(units: FileUnits) -> tuple[str, str, str]:
    """Of units of lengths, masses and moments, as the option has them."""
    length, mass, moments = (
        next(name for name, unit in known.items() if unit == own)
        for known, own in ((LENGTHS, units.length), (MASSES, units.mass), (MOMENTS, units.moments))
    )
    return length, mass, moments


def _likely(shares: Mapping[str, float], usual: str) -> str:
    """The unit of moments that is likely, of those with a radius of gyration as a share of the size."""
    if not shares[usual] or GYRATION[0] / MARGIN <= shares[usual] <= GYRATION[1] * MARGIN:
        return usual
    middle = math.log10(GYRATION[0] * GYRATION[1]) / 2.0
    return min(shares, key=lambda unit: abs(math.log10(shares[unit]) - middle))


def _meshes(root: XmlElement, length: str) -> str:
    """What the scales of a file's meshes add to that, where its lengths are not in metres."""
    scales, todo = list[str](), [root]
    while todo:
        element = todo.pop()
        todo += element.children
        if element.tag == "mesh":
            inner = element.first("scale")
            given = inner.text if inner is not None else element.attributes.get("scale", "")
            scales.append(given.strip() or "1 1 1")
    if not scales or length == "m":
        return ""
    metre = LENGTHS[length] / LENGTHS["m"]
    scaled = sum(_is_number(scale.split()[0], metre) for scale in scales)
    if scaled:
        return f". {scaled} of {len(scales)} meshes have the scale {metre}, which makes m of {length}"
    return f". None of its {len(scales)} meshes has the scale {metre}"


def _is_number(word: str, value: Decimal) -> bool:
    try:
        return Decimal(word) == value
    except InvalidOperation:
        return False


def _gyration_note(robot: Robot) -> str:
    """Which links have a radius of gyration beyond the size of the robot; mostly none."""
    size = 1e3 * _extent(robot).size
    far = {body.name: radius for body in robot.bodies.values() if body.mass and (radius := _largest(body)) > size}
    if not far or not size:
        return ""
    named = [f"{name} ({printed(1e-3 * radius, 3)} m)" for name, radius in list(far.items())[:NAMED]]
    more = f" and {len(far) - NAMED} more" if len(far) > NAMED else ""
    return (
        f"moments of inertia whose radius of gyration exceeds the robot, which is {printed(1e-3 * size, 3)} m "
        f"large: links {', '.join(named)}{more}"
    )


def _largest(body: Body) -> float:
    """The largest radius of gyration of a body about an axis, mm."""
    if not body.inertia:
        return 0.0
    return math.sqrt(max(0.0, float(np.linalg.eigvalsh(inertia_matrix(body.inertia))[-1])) / body.mass)


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
        >>> robot = import_robot(Description(Path("scene.xml")), "hand")  # doctest: +SKIP
        >>> robot.notes.lines()  # doctest: +SKIP
    """
    path = description.path
    imported = _imported(description, tip, reading)
    if (file := stiffness or beside(path)) is not None:
        fill_in(imported, file)
    if imported.impossible:
        # only here, for few files need what computes frequencies
        from vjm.io.repair_effect import say_effect

        say_effect(imported)
    return imported


def _imported(description: Description, tip: str | None, reading: Reading) -> Imported:
    path, suffix = description.path, description.suffix
    if description.ur_type and suffix != ".conf":
        raise ModelFileError(f"{path.name}: --ur-type goes with a controller's calibration.conf: leave it out")
    if suffix in (".toml", ".csv", ".yaml", ".yml", ".conf") and not description.xacro:
        if tip is not None:
            raise ModelFileError(f"{path.name}: is a table of joints, which has one end: leave out --tip")
        if reading.units != FileUnits():
            raise ModelFileError(f"{path.name}: says its units itself: leave out --units")
        if suffix == ".conf":
            return robot_document(controller_robot(path, reading, description.ur_type))
        table = dh_robot if suffix in (".toml", ".csv") else kinematics_robot
        return robot_document(table(path, reading))
    xml = expanded(path, description.arguments) if description.xacro else read_xml(path)
    if xml.root.tag == "mujoco":
        if reading.units != FileUnits():
            raise ModelFileError(f"{path.name}: MuJoCo reads it in m and kg: scale the file in place of --units")
        return _in_its_units(mjcf_robot(path, tip, reading), xml, tip, reading, scales=False)
    read = sdf_robot if xml.root.tag == "sdf" else urdf_robot
    return _in_its_units(read(xml, path.name, tip, reading), xml, tip, reading)


def _in_its_units(
    robot: Robot, xml: XmlFile, tip: str | None, reading: Reading, *, scales: bool = True
) -> Imported:
    """The document of a robot, and what its masses and moments of inertia say of the units of its file."""
    note = units_note(robot, xml.root, reading.units, scales=scales)
    if doubt := note or _gyration_note(robot):
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
