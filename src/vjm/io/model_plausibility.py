"""Mistakes in model files that are well-formed: other units, swapped axes, impossible materials.

What no robot can be is refused by the format itself, see `vjm.io.checks`; here stands what a machine could be, but
hardly is. Each rule names part and key, what was found and the likely mistake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.drawn_plausibility import drawings
from vjm.io.errors import printed
from vjm.io.fields import Turns
from vjm.io.findings import Finding, Grade, worst_first
from vjm.io.joint_tables import (
    ActuatedTable,
    ActuatorTable,
    CoupledTable,
    JointTable,
    MountTable,
    MovingTable,
    Offset,
    PayloadTable,
)
from vjm.io.manipulator_file import KIND, ManipulatorFile, leg_documents
from vjm.io.matrix_plausibility import matrices
from vjm.io.model_file import read_document
from vjm.io.schema import BeamTable, ModelFile
from vjm.io.sections import Shape, StiffnessSection
from vjm.model.parts import Beam

SOFTEST, STIFFEST = 300.0, 1.3e6
"""MPa; Young's modulus that a section implies. Thin tubes of plastic have 300, as the modulus is smeared
over their outline; solid steel in kN has 210. Diamond has 1.2e6."""
TORSION = (0.003, 0.6)
"""GJ over the smaller EI, and over their sum: an I-beam with flanges of a twentieth of their width has 0.004; an
isotropic section that narrows when pulled has at most 0.5."""
SPRING = 0.02
"""Length of a beam over that of the machine up to which it may stand for the spring of a joint."""
TINY_MM, LEAST_MM = 0.5, 1e-3
"""Lengths of a vector between which it is taken for metres: 500 mm, and 1 mm, the least that a link has. What is
shorter still is no length in any unit, but what a fit leaves of a zero."""
ODD_DRIVES = {"mm/N": (1e-8, 0.1), "rad/(N mm)": (1e-14, 1e-3)}
"""Compliances of drives outside: a block of steel of 1 m² is 5e-8 mm/N over 1 cm; a drive of 0.1 mm/N moves by 1 mm
under 10 N, and one of 1e-3 rad/(N mm) by a radian under 1 N at 1 m."""
SAG = 0.5
"""Turn of a joint under the weight of what it carries, rad, stretched out: no arm sags by a tenth of it."""
WEIGHT = 9.81
DENSEST, LIGHTEST, IMPOSSIBLE = 25000.0, 10.0, 2.5e5
"""kg/m³: above osmium, below foam; ten times osmium, which no fittings explain."""
HEAVY, FILLED = 50.0, 400.0
"""kg, and kg/m³ of the cube of the machine's length, that a part may have: a robot of 3 m and 5 t has 150."""
MANY_TURNS = 4.2 * np.pi
"""rad; limits beyond two turns each way are taken for degrees."""
NICE = 0.007
"""Of a twelfth of π: how near an angle has to be to a multiple, as 3.14 is to π."""
FOLDED = 2.0
"""rad; passive joints of spatial mechanisms end at 1.6 (a right angle), most at 0.8."""

Found = tuple[Grade, str, str]
Rule = Callable[[ModelFile], Iterator[Found]]


def findings_of(name_or_path: str | Path) -> list[Finding]:
    """What is implausible about a model of the library or a file, chain or manipulator, refusals first.

    Raises:
        ModelFileError: see `vjm.io.manipulator_file.load_model`.
    """
    document = read_document(name_or_path)
    if document.content.get("kind") != KIND:
        return model_findings(document.content, document.file)
    found = [Finding(g, f"{document.file}: {w}", t) for g, w, t in _machine(document.content)]
    for leg in leg_documents(name_or_path):
        found += model_findings(leg.content, leg.file)
    return worst_first(found)


def model_findings(content: Mapping[str, Any], file: str) -> list[Finding]:
    """What is implausible about a chain's document, refusals first.

    Args:
        content: a sound document, see `vjm.io.model_file.build_chain`.
        file: its name for messages.

    Raises:
        pydantic.ValidationError: it is not sound.
    """
    model = ModelFile.model_validate(content)
    return worst_first(Finding(g, f"{file}: {w}", t) for rule in RULES for g, w, t in rule(model))


def _machine(content: Mapping[str, Any]) -> Iterator[Found]:
    """Of a manipulator: how its legs stand, and how far its drives go."""
    table = ManipulatorFile.model_validate(content)
    for leg in table.legs:
        where = f"leg '{leg.name}'"
        yield from _turned(f"{where}, base", leg.base.turns)
        yield from _turned(f"{where}, attachment", leg.attachment.turns)
        if leg.drive_turns_about is not None and leg.drive_limits is not None:
            yield from _beyond(f"{where}, drive_limits", leg.drive_limits)
        for name, place in (("base", leg.base), ("attachment", leg.attachment)):
            yield from _tiny(f"{where}, {name}.position_mm", place.position_mm)


def _beams(model: ModelFile) -> Iterator[tuple[BeamTable, Beam]]:
    return ((part, part.part()) for part in model.parts if isinstance(part, BeamTable))


def materials(model: ModelFile) -> Iterator[Found]:
    """Poisson's ratios that hardly a solid has, and masses that no volume holds."""
    for table, _ in _beams(model):
        section, where = table.section, f"part '{table.name}'"
        if not isinstance(section, Shape):
            continue
        ratio = section.poissons_ratio
        if ratio is not None and ratio < 0.0:
            yield (
                Grade.DOUBTFUL,
                f"{where}, section.poissons_ratio",
                f"{printed(ratio)} is negative, which only foams have (steel 0.3): was the sign meant?",
            )
        E, G = section.youngs_modulus_MPa, section.shear_modulus
        if ratio is None and not E / 60.0 <= G <= 0.5 * E:
            yield (
                Grade.DOUBTFUL,
                f"{where}, section.shear_modulus_MPa",
                f"{printed(G)} is {printed(G / E, 2)} of youngs_modulus_MPa (metals 0.38): is one in another unit?",
            )


def sections(model: ModelFile) -> Iterator[Found]:
    """Stiffnesses that no material gives a section of that size."""
    for table, beam in _beams(model):
        if not isinstance(table.section, StiffnessSection) or beam.section is None:
            continue
        where, s = f"part '{table.name}', section", beam.section
        # EI/EA is the squared radius of gyration: a filled rectangle has the area 12 r_y r_z
        modulus = s.EA**2 / (12.0 * float(np.sqrt(s.EIy * s.EIz)))
        if not SOFTEST <= modulus <= STIFFEST:
            small = modulus < SOFTEST
            yield (
                Grade.DOUBTFUL,
                where,
                f"EA and EI together imply a Young's modulus of {printed(modulus, 3)} MPa, "
                f"{'softer than plastics' if small else 'stiffer than diamond'} (steel 2.1e5): "
                f"{'is EA_N, or are all, in kN' if small else 'is EI in N m², or EA in mN'}? Give N and N mm²",
            )
        low, high = s.GJ / min(s.EIy, s.EIz), s.GJ / (s.EIy + s.EIz)
        if low < TORSION[0] and modulus >= SOFTEST:
            yield (
                Grade.DOUBTFUL,
                f"{where}.GJ_Nmm2",
                f"{printed(s.GJ)} is {printed(low, 2)} of the smaller EI, which only thin open sections have: "
                "is it in kN mm² or N m²? Give N mm²",
            )
        if high > TORSION[1]:
            yield (
                Grade.DOUBTFUL,
                f"{where}.GJ_Nmm2",
                f"{printed(s.GJ)} is {printed(high, 2)} of EIy + EIz; an isotropic section has at most 0.5: "
                "is it in another unit?",
            )


def stubby(model: ModelFile) -> Iterator[Found]:
    """Beams shorter than their radius of gyration: springs of joints in a longer machine, else in metres."""
    made = [(table, beam) for table, beam in _beams(model) if beam.section is not None]
    size = sum(_length(part.part()) for part in model.parts)
    for table, beam in made:
        s = beam.section
        assert s is not None
        gyration = float(np.sqrt(max(s.EIy, s.EIz) / s.EA))
        if gyration <= beam.length:
            continue
        spring = beam.length < SPRING * size
        yield (
            Grade.NOTED if spring else Grade.DOUBTFUL,
            f"part '{table.name}', length_mm",
            f"{printed(beam.length)} is less than the section's radius of gyration √(EI/EA) of "
            f"{printed(gyration, 3)} mm: "
            + (
                "it is a spring, and no beam" if spring else "is it in metres, or EI or EA in another unit? Give mm"
            ),
        )


def _tiny(where: str, vector: list[float]) -> Iterator[Found]:
    size = float(np.linalg.norm(vector))
    if LEAST_MM <= size < TINY_MM:
        yield Grade.DOUBTFUL, where, f"{vector} is {printed(size, 3)} mm long: is it in metres? Give mm"


def _bodies(model: ModelFile) -> dict[str, float]:
    """Longest rigid piece of the body that each rigid piece is of, mm, by the piece's name."""
    longest: dict[str, float] = {}
    body: list[str] = []
    for part in model.parts:
        if not isinstance(part, Offset) or part.after is not None:
            body = []
        if isinstance(part, Offset):
            body.append(part.name)
            longest[part.name] = float(np.linalg.norm(part.translation_mm))
            longest |= dict.fromkeys(body, max(longest[name] for name in body))
    return longest


def offsets(model: ModelFile) -> Iterator[Found]:
    """Rigid arms of less than half a millimetre, which are metres.

    Pieces of one rigid body come in one unit: beside a long piece a tiny one is a correction, such as calibrations
    write.
    """
    yield from _tiny("[base] position_mm", model.base.position_mm)
    longest = _bodies(model)
    for part in model.parts:
        where = f"part '{part.name}'"
        if isinstance(part, BeamTable):
            yield from _tiny(f"{where}, end_offset_mm", part.end_offset_mm)
        elif isinstance(part, Offset) and longest[part.name] < TINY_MM:
            yield from _tiny(f"{where}, translation_mm", part.translation_mm)
        if isinstance(part, Offset | PayloadTable) and part.centre_of_mass_mm is not None:
            yield from _tiny(f"{where}, centre_of_mass_mm", part.centre_of_mass_mm)


def drives(model: ModelFile) -> Iterator[Found]:
    """Drives that are softer or stiffer than any, and that sag under what they carry."""
    for part in model.parts:
        if isinstance(part, ActuatorTable | MountTable):
            key, unit, value = "compliance_mm_per_N", "mm/N", part.compliance_mm_per_N
        elif isinstance(part, ActuatedTable | CoupledTable):
            key, unit, value = (
                ("compliance_mm_per_N", "mm/N", part.compliance_mm_per_N)
                if part.slides
                else ("compliance_rad_per_Nmm", "rad/(N mm)", part.compliance_rad_per_Nmm)
            )
        else:
            continue
        low, high = ODD_DRIVES[unit]
        if value > high:
            other = "µm/N or mm/kN" if unit == "mm/N" else "rad/(N m), or degrees"
            found = f"{printed(value)} {unit}: no drive is so soft; is it in {other}? Give {unit}"
            yield Grade.DOUBTFUL, f"part '{part.name}', {key}", found
        elif 0.0 < value < low:
            other = "m/N or a stiffness" if unit == "mm/N" else "a stiffness"
            found = (
                f"{printed(value)} {unit}: stiffer than a block of steel; is it in {other}? Write 0 for a rigid one"
            )
            yield Grade.DOUBTFUL, f"part '{part.name}', {key}", found
    yield from _sagging(model)


def _sagging(model: ModelFile) -> Iterator[Found]:
    """Turning joints whose own compliance lets the arm behind them fall, stretched out as far as it goes."""
    weight = torque = 0.0
    for part in reversed(model.parts):
        made = part.part()
        if isinstance(part, ActuatedTable) and not part.slides and part.compliance_rad_per_Nmm:
            sag = torque * part.compliance_rad_per_Nmm
            if sag > SAG:
                yield (
                    Grade.DOUBTFUL,
                    f"part '{part.name}', compliance_rad_per_Nmm",
                    f"{printed(part.compliance_rad_per_Nmm)} lets the arm sag by {printed(sag, 2)} rad under its "
                    "own weight: is it in rad/(N m), or a mass in g? Give rad/(N mm) and kg",
                )
        step = _length(made)
        mass = _mass(made)
        torque += weight * step + mass * WEIGHT * 0.5 * step
        weight += mass * WEIGHT


def _length(made: object) -> float:
    shift = made.tip if isinstance(made, Beam) else getattr(made, "transform", np.eye(4))[:3, 3]
    return float(np.linalg.norm(shift))


def _mass(made: object) -> float:
    return float(getattr(made, "mass", 0.0))


def masses(model: ModelFile) -> Iterator[Found]:
    """Masses that the part's volume, or the machine's size, cannot hold."""
    made = [(part, part.part()) for part in model.parts]
    size = sum(_length(one) for _, one in made)
    for part, one in made:
        where, mass = f"part '{part.name}', mass_kg", _mass(one)
        if isinstance(part, BeamTable) and part.mass_kg and isinstance(one, Beam) and one.section is not None:
            volume = one.count * one.length * _area(part, one)
            density = 1e9 * mass / volume
            if not LIGHTEST <= density <= DENSEST:
                dense = density > DENSEST
                yield (
                    Grade.REFUSED if density > IMPOSSIBLE else Grade.DOUBTFUL,
                    where,
                    f"{printed(mass)} kg in at most {printed(volume / 1000.0, 3)} cm³ make {printed(density, 3)} "
                    f"kg/m³, {'more than any metal' if dense else 'less than foam'} (steel 7850): "
                    f"{'is it in g' if dense else 'is it in t'}? Give kg",
                )
        elif mass > HEAVY + FILLED * (size / 1000.0) ** 3:
            yield (
                Grade.DOUBTFUL,
                where,
                f"{printed(mass)} kg on a machine whose parts are {printed(size, 3)} mm long together: is it in g? "
                "Give kg",
            )


def _area(part: BeamTable, beam: Beam) -> float:
    """Area of one member, mm²; of a section known by its stiffness that of the rectangle with its radii."""
    assert beam.section is not None
    if isinstance(part.section, Shape):
        return beam.section.EA / part.section.youngs_modulus_MPa
    return 12.0 * float(np.sqrt(beam.section.EIy * beam.section.EIz)) / beam.section.EA


def _turned(where: str, turns: Turns) -> Iterator[Found]:
    for turn in turns:
        angle = abs(turn.angle_deg)
        twelfths = angle / (np.pi / 12.0)
        if 0.25 < angle < 2.1 * np.pi and abs(twelfths - round(twelfths)) < NICE:
            yield (
                Grade.DOUBTFUL,
                f"{where}, angle_deg",
                f"{printed(turn.angle_deg)} is {printed(np.rad2deg(turn.angle_deg), 4)}° in rad: give degrees",
            )


def angles(model: ModelFile) -> Iterator[Found]:
    """Turns in radians where degrees are asked for."""
    yield from _turned("[base]", model.base.turns)
    for part in model.parts:
        if isinstance(part, BeamTable):
            yield from _turned(f"part '{part.name}', own_axes", part.own_axes)
            yield from _turned(f"part '{part.name}', section_axes", part.section_axes)
        elif isinstance(part, Offset):
            yield from _turned(f"part '{part.name}', turns", part.turns)


def _beyond(where: str, limits: list[float]) -> Iterator[Found]:
    largest = max(abs(v) for v in limits)
    if largest > MANY_TURNS:
        found = f"{limits} is {printed(largest / (2.0 * np.pi), 3)} turns: is it in degrees? Give rad"
        yield Grade.DOUBTFUL, where, found


def limits(model: ModelFile) -> Iterator[Found]:
    """Limits of turning joints in degrees."""
    for part in model.parts:
        if isinstance(part, MovingTable) and part.limits_rad is not None:
            yield from _beyond(f"part '{part.name}', limits_rad", part.limits_rad)


def postures(model: ModelFile) -> Iterator[Found]:
    """Coordinates in degrees that are small enough to pass for radians."""
    moving = {part.name: part for part in model.parts if isinstance(part, MovingTable) and not part.slides}
    for label in model.postures:
        given = {name: q for name, q in model.given(label).items() if name in moving}
        where = f"posture '{label}'"
        for name, q in given.items():
            if isinstance(moving[name], JointTable) and abs(q) > FOLDED:
                found = (
                    f"the passive joint {name} at {printed(q)} rad is turned by {printed(np.rad2deg(q), 3)}°: "
                    "is it in degrees? Give rad"
                )
                yield Grade.DOUBTFUL, where, found
        turned = [q for q in given.values() if q]
        if turned and max(map(abs, turned)) >= 3.0 and all(float(q).is_integer() for q in turned):
            found = "every coordinate is a whole number: are they degrees? Give rad"
            yield Grade.DOUBTFUL, where, found


RULES: tuple[Rule, ...] = (
    materials, sections, stubby, matrices, drawings, offsets, drives, masses, angles, limits, postures,
)  # fmt: skip
"""All rules of a chain's file."""
