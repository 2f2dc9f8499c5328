"""Units of a whole file: a description in mm, cm, inches or g is told by what machines weigh for their size.

Robots are the 66 URDFs of the package example-robot-data, from hands to humanoids. Their mass over the cubed size
is 2.2 to 56 kg/m³, their size 0.23 to 2.9 m. The median radius of gyration of their links is 0.013 to 0.58 of the
size. A mistaken unit changes the radius by 31 times at least, and the density by 1000 times at least; that of
inches for cm alone changes it by 16.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import product
from statistics import median

import numpy as np

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import printed
from vjm.io.inertia import inertia_matrix
from vjm.io.robot import Body, FileUnits, Robot, turned
from vjm.rotations import frame

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


def units_note(robot: Robot, root: XmlElement, units: FileUnits, *, scales: bool = True) -> str:
    """What is doubtful about the units of a robot's file, with the option that reads it otherwise; mostly nothing.

    Args:
        robot: as it was read.
        root: of its file, for the scales of meshes.
        units: in which it was read.
        scales: whether an option reads it in others.
    """
    found = extent(robot)
    if not found.size or not found.mass or all(joint.kind == "fixed" for joint in robot.joints):
        # a body alone is a thing of any density
        return ""
    own = _names(units)
    fits = {(length, mass): _misfit(found, units, length, mass) for length in LENGTHS for mass in MASSES}
    # lengths in inches with masses in g are nobody's, and near to a large machine in m and kg
    likely = sorted(fits if own[:2] == ("in", "g") else fits.keys() - {("in", "g")}, key=lambda one: fits[one])
    length, mass = likely[0] if fits[likely[0]] < UNLIKE else own[:2]
    said, options = [], []
    if (length, mass) != own[:2]:
        named = [f"the lengths in {length}"] * (length != own[0]) + [f"the masses in {mass}"] * (mass != own[1])
        said.append(
            f"{' and '.join(named)}, for as it is read its size is {printed(found.size, 3)} m and its mass "
            f"{printed(found.mass, 3)} kg, {printed(found.mass / found.size**3, 2)} kg/m³ over the cubed size. "
            f"Robots have {SIZE[0]:g} to {SIZE[1]:g} m, and {DENSITY[0]:g} to {DENSITY[1]:g}"
        )
        options = [",".join(one) for one in likely[1:] if one != own[:2] and _is_robots(found, units, *one)]
    shares = {
        unit: found.gyration
        / found.size
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


def _in(found: Extent, units: FileUnits, length: str, mass: str) -> tuple[float, float, float]:
    """Size, mass and density of a robot, m and kg, were its file in other units than those in which it was read."""
    size = found.size * float(LENGTHS[length] / units.length)
    heavy = found.mass * float(MASSES[mass] / units.mass)
    return size, heavy, heavy / size**3


def _misfit(found: Extent, units: FileUnits, length: str, mass: str) -> float:
    """How far size and density are from the middle of robots: squares of logarithms, 1 at the end of their range.

    Infinite of what is lighter than any robot.
    """
    size, heavy, density = _in(found, units, length, mass)
    if heavy < LIGHTEST and MASSES[mass] < units.mass:
        return math.inf
    return sum(
        ((2.0 * math.log(value) - math.log(low * high)) / math.log(high / low)) ** 2
        for value, (low, high) in ((size, SIZE), (density, DENSITY))
    )


def _is_robots(found: Extent, units: FileUnits, length: str, mass: str) -> bool:
    size, heavy, density = _in(found, units, length, mass)
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
