"""Units of a whole file: a description in mm or g is told by what machines weigh for their size.

Robots are the 66 URDFs of the package example-robot-data, from hands to humanoids. Their mass over the cubed size
is 2.2 to 56 kg/m³. The median radius of gyration of their links is 0.013 to 0.58 of the size. A mistaken unit
changes the radius by 31 times at least, and the density by 1000 times at least.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median

import numpy as np

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import printed
from vjm.io.inertia import inertia_matrix
from vjm.io.robot import Body, FileUnits, Robot, turned
from vjm.rotations import frame

DENSITY, GYRATION = (2.2, 56.0), (0.013, 0.58)
"""kg/m³, and a share of the size: the least and the most of these robots."""
MARGIN = 3.0
"""By which other machines may lie beyond these radii: less than a tenth of what a mistaken unit does."""
LIGHTEST = 0.1
"""kg: the lightest of these robots has 0.6. What would weigh less in g is in kg, and heavy for its size."""
NAMED = 5
"""Links that are named; of more it is said how many."""
LENGTHS, MASSES = {"m": 3, "mm": 0}, {"kg": 0, "g": -3}
"""Powers of ten, to mm and kg."""
MOMENTS = {"kg*m2": 6, "g*m2": 3, "kg*mm2": 0, "g*mm2": -3}
"""To kg mm²."""


def parsed_units(text: str) -> FileUnits:
    """Units as an option has them: of lengths, masses and perhaps moments of inertia, ``mm,g`` or ``m,kg,kg*mm2``.

    Moments are those of the two others where they are left out.

    Raises:
        ValueError: one is not known.

    Example:
        >>> parsed_units("mm,g")
        FileUnits(length=0, mass=-3, moments=-3)
    """
    words = text.split(",")
    if len(words) not in (2, 3) or words[0] not in LENGTHS or words[1] not in MASSES:
        raise ValueError(f"give lengths ({', '.join(LENGTHS)}) and masses ({', '.join(MASSES)}), as in mm,g")
    length, mass = LENGTHS[words[0]], MASSES[words[1]]
    if len(words) == 3 and words[2] not in MOMENTS:
        raise ValueError(f"give moments of inertia as one of {', '.join(MOMENTS)}")
    return FileUnits(length, mass, MOMENTS[words[2]] if len(words) == 3 else mass + 2 * length)


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


def extent(robot: Robot) -> Extent:
    """How large and how heavy a robot is."""
    places, ways = {robot.root: np.eye(4)}, {robot.root: 0.0}
    for joint in robot.joints:
        places[joint.child] = places[joint.parent] @ frame(turned(joint.placing.turns), joint.placing.shift)
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


def units_note(robot: Robot, root: XmlElement, units: FileUnits) -> str:
    """What is doubtful about the units of a robot's file, with the option that reads it otherwise; mostly nothing.

    Args:
        robot: as it was read.
        root: of its file, for the scales of meshes.
        units: in which it was read.
    """
    found = extent(robot)
    if not found.size or not found.mass:
        return ""
    said = []
    density = found.mass / found.size**3
    own = _names(units)
    # of ten, how many times the density of the right reading that of this one is, where those units are right
    mistaken = {(k, m): units.mass - MASSES[m] - 3 * (units.length - LENGTHS[k]) for k in LENGTHS for m in MASSES}
    middle = math.log10(DENSITY[0] * DENSITY[1]) / 2.0
    length, mass = min(mistaken, key=lambda one: abs(math.log10(density) - middle - mistaken[one]))
    if own[1] == "kg" and mass == "g" and found.mass * 1e-3 < LIGHTEST:
        length, mass = own[:2]
    if (length, mass) != own[:2]:
        named = [f"the lengths in {length}"] * (length != own[0]) + [f"the masses in {mass}"] * (mass != own[1])
        said.append(
            f"{' and '.join(named)}, for as it is read its size is {printed(found.size, 3)} m and its mass "
            f"{printed(found.mass, 3)} kg, {printed(density, 2)} kg/m³ over the cubed size. Robots have "
            f"{DENSITY[0]:g} to {DENSITY[1]:g}"
        )
    shares = {
        unit: _share(found)
        * 10.0 ** (0.5 * (power - units.moments - MASSES[mass] + units.mass) - LENGTHS[length] + units.length)
        for unit, power in MOMENTS.items()
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
    option = f"{length},{mass}" + (f",{moments}" if moments != f"{mass}*{length}2" else "")
    return (
        f"the file seems to have {'; and '.join(said)}{_meshes(root, length)}. Nothing is scaled: --units {option} "
        "reads it so"
    )


def _names(units: FileUnits) -> tuple[str, str, str]:
    """Of units of lengths, masses and moments, as the option has them."""
    length, mass, moments = (
        next(name for name, power in powers.items() if power == own)
        for powers, own in ((LENGTHS, units.length), (MASSES, units.mass), (MOMENTS, units.moments))
    )
    return length, mass, moments


def _share(found: Extent) -> float:
    return found.gyration / found.size


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
    small = sum(scale.split()[0] in ("0.001", ".001", "1e-3", "1e-03", "1.0e-3") for scale in scales)
    if small:
        return f". {small} of {len(scales)} meshes have the scale 0.001, which makes m of mm"
    return f". None of its {len(scales)} meshes has the scale 0.001"


def gyration_note(robot: Robot) -> str:
    """Which links have a radius of gyration beyond the size of the robot; mostly none."""
    size = 1e3 * extent(robot).size
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
