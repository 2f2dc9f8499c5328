"""Mistakes in model files that are well-formed: other units, swapped axes, impossible materials.

What no robot can be is refused by the format itself, see `vjm.io.checks`; here stands what a machine could be, but
hardly is. Each rule names part and key, what was found and the likely mistake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vjm.io.checks import EXCHANGED, SWAPPED, bending_apart, fits_exchanged
from vjm.io.errors import ModelFileError, printed
from vjm.io.fields import LONGEST_MM, StiffnessSection, Turns
from vjm.io.findings import Finding, Grade, worst_first
from vjm.io.joint_tables import (
    CALIBRATED,
    ActuatorTable,
    ElasticJointTable,
    JointTable,
    MountTable,
    MovingTable,
    Offset,
    PayloadTable,
)
from vjm.io.manipulator_file import KIND, LegTable, ManipulatorFile, leg_documents, read_table
from vjm.io.model_file import Model, ModelDocument, checked, read_document
from vjm.io.schema import BeamTable, ModelFile
from vjm.io.shapes import Shape
from vjm.io.solid_compliance import drawings
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import Array

# --- Whether a part's matrix and its section are of one part ------------------------------------------------------

LIKELY = 0.5
"""Of the distance between matrix and section: a mistake that leaves less explains it."""


def matrices(model: ModelFile) -> Iterator[tuple[Grade, str, str]]:
    """A matrix far from its part's section: axes exchanged, an offset in metres, or another modulus.

    Some engines take the matrix and some the section, so that a difference between the two is one between engines.
    Rounding to two digits, as papers print, makes 3 %. Where fillets, tapers or holes make another part of it, the
    section is not that part's, and is doubted too. `drawings` judges what stands for a drawing.
    """
    for table in model.parts:
        if not isinstance(table, BeamTable) or table.drawing is not None:
            continue
        beam = table.part()
        if beam.section is None or beam.compliance is None:
            continue
        where, given, theory = f"part '{table.name}'", beam.tip_compliance(), beam.beam_compliance()
        own = bending_apart(given, theory)
        if own <= SWAPPED:
            continue
        longer = replace(beam, end_offset=1000.0 * beam.end_offset)
        if fits_exchanged(beam):
            yield Grade.DOUBTFUL, f"{where}, section", EXCHANGED
        elif np.any(beam.end_offset) and bending_apart(given, longer.beam_compliance()) < LIKELY * own:
            yield (
                Grade.DOUBTFUL,
                f"{where}, end_offset_mm",
                "the matrix fits the section with an offset a thousand times as long: is it in metres?",
            )
        else:
            yield Grade.DOUBTFUL, f"{where}, compliance", _of_two_parts(given, theory)


def _of_two_parts(given: Array, theory: Array) -> str:
    """How a matrix ``(6, 6)`` differs from that of its section, and the likely mistake."""
    ratios = np.diag(given)[[1, 2, 4, 5]] / np.diag(theory)[[1, 2, 4, 5]]
    logs = np.log(ratios)
    # a modulus and a number of members act on all entries alike, which no change of shape does
    if float(np.std(logs)) < LIKELY * float(np.sqrt(np.mean(logs**2))):
        factor = float(np.exp(np.mean(logs)))
        return (
            f"the matrix is {printed(factor, 3)} times as compliant in bending as the section: is the modulus, or "
            "count, another one? Engines take the one or the other; make them the same part's"
        )
    k = int(np.argmax(np.abs(logs)))
    row = (2, 3, 5, 6)[k]
    return (
        f"({row},{row}) is {printed(float(ratios[k]), 3)} times what the section gives: engines take the one or "
        "the other; make them the same part's, or leave the section out"
    )


# --- Mistakes in the beams of model files: materials, sections, slenderness ---------------------------------------

LOWEST_MODULUS, HIGHEST_MODULUS = 300.0, 1.3e6
"""MPa; Young's modulus that a section implies. Thin tubes of plastic have 300, as the modulus is smeared
over their outline; solid steel in kN has 210. Diamond has 1.2e6."""
TORSION = (0.003, 0.6)
"""GJ over the smaller EI, and over their sum: an I-beam with flanges of a twentieth of their width has 0.004; an
isotropic section that narrows when pulled has at most 0.5."""
SPRING = 0.02
"""Length of a beam over that of the machine up to which it may stand for the spring of a joint."""
METALS = {"aluminium": (2700.0, 7e4), "titanium": (4430.0, 1.14e5), "steel": (7850.0, 2.07e5)}
"""kg/m³ and MPa; their alloys differ by little, and no other solid of a machine has these densities."""
SAME_DENSITY, OTHER_MODULUS = 0.03, 2.0
"""Of a metal's density, what its alloys differ by; and the factor of its modulus that none of them has."""
LEAST_STRAIN = 1e-4
"""Yield stress over modulus, below which no solid yields: annealed pure aluminium and copper do at 3e-4."""
WARPS = 0.05
"""√(E I_w/(G J)) over the length above which it is said: by that share torsion is stiffer with one end held.
A beam stands for a part from a drawing up to the same 5 %."""
SLENDER = 2000.0
"""Length over the smaller radius of gyration that only wires and foils have: 300 mm of a foil of 0.5 mm."""

Found = tuple[Grade, str, str]


def beams(model: ModelFile) -> Iterator[tuple[BeamTable, Beam]]:
    """The beams of a chain's file, each as its table and as the part that it describes."""
    return ((part, part.part()) for part in model.parts if isinstance(part, BeamTable))


def materials(model: ModelFile) -> Iterator[Found]:
    """Moduli, Poisson's ratios and yield stresses that hardly a solid has."""
    for table, _ in beams(model):
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
        yield from _modulus(where, section)
        if section.yield_stress_MPa is not None and section.yield_stress_MPa < LEAST_STRAIN * E:
            yield (
                Grade.DOUBTFUL,
                f"{where}, section.yield_stress_MPa",
                f"{printed(section.yield_stress_MPa)} is {printed(section.yield_stress_MPa / E, 2)} of "
                "youngs_modulus_MPa, at which no solid yields (steel 0.001): is it in GPa? Give MPa",
            )


def _modulus(where: str, section: Shape) -> Iterator[Found]:
    """Young's modulus that is softer than plastics, or not that of the metal whose density is given."""
    E, density, key = section.youngs_modulus_MPa, section.density_kg_per_m3, f"{where}, section.youngs_modulus_MPa"
    if E < LOWEST_MODULUS:
        text = f"{printed(E)} MPa is softer than plastics (steel 2.1e5): is it in GPa? Give MPa"
        yield Grade.DOUBTFUL, key, text
        return
    for metal, (own, modulus) in METALS.items():
        if density is None or abs(density / own - 1.0) > SAME_DENSITY:
            continue
        if not 1.0 / OTHER_MODULUS < E / modulus < OTHER_MODULUS:
            other = "ksi or kgf/mm²" if modulus > E else "another unit"
            yield (
                Grade.DOUBTFUL, key,
                f"{printed(E)} MPa with a density of {printed(density)} kg/m³, which is that of {metal} "
                f"({printed(modulus, 3)} MPa): is the modulus in {other}, or the density another material's?",
            )  # fmt: skip


def sections(model: ModelFile) -> Iterator[Found]:
    """Stiffnesses that no material gives a section of that size."""
    for table, beam in beams(model):
        if not isinstance(table.section, StiffnessSection) or beam.section is None:
            continue
        where, s = f"part '{table.name}', section", beam.section
        # EI/EA is the squared radius of gyration: a filled rectangle has the area 12 r_y r_z
        modulus = s.EA**2 / (12.0 * float(np.sqrt(s.EIy * s.EIz)))
        if not LOWEST_MODULUS <= modulus <= HIGHEST_MODULUS:
            small = modulus < LOWEST_MODULUS
            yield (
                Grade.DOUBTFUL,
                where,
                f"EA and EI together imply a Young's modulus of {printed(modulus, 3)} MPa, "
                f"{'softer than plastics' if small else 'stiffer than diamond'} (steel 2.1e5): "
                f"{'is EA_N, or are all, in kN' if small else 'is EI in N m², or EA in mN'}? Give N and N mm²",
            )
        low, high = s.GJ / min(s.EIy, s.EIz), s.GJ / (s.EIy + s.EIz)
        if low < TORSION[0] and modulus >= LOWEST_MODULUS:
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


def warping(model: ModelFile) -> Iterator[Found]:
    """Shapes whose ends, where they cannot warp, make the beam noticeably stiffer in torsion.

    Vlasov's torsion of a bar of length L with the warping length ``λ = √(E I_w/(G J))``, held from warping at one
    end or at both: ``G J/(1 − tanh(L/λ) λ/L)`` and ``G J/(1 − 2 tanh(L/2λ) λ/L)``.
    """
    for table, beam in beams(model):
        if not isinstance(table.section, Shape):
            continue
        share = table.section.warping_length / beam.length
        if share <= WARPS:
            continue
        one, both = (1.0 / (1.0 - n * share * float(np.tanh(1.0 / (n * share)))) - 1.0 for n in (1, 2))
        yield (
            Grade.NOTED,
            f"part '{table.name}', section",
            f"torsion is that of ends that are free to warp; √(E I_w/(G J)) is {printed(share * beam.length, 3)} "
            f"of {printed(beam.length)} mm. With one end held from warping the beam is stiffer in torsion by "
            f"{printed(100.0 * one, 2)} %, with both by {printed(100.0 * both, 2)} %",
        )


def stubby(model: ModelFile) -> Iterator[Found]:
    """Beams shorter than they are deep, which are springs of joints or in another unit, and those like wires."""
    made = [(table, beam) for table, beam in beams(model) if beam.section is not None]
    size = sum(length_of(part.part()) for part in model.parts)
    for table, beam in made:
        s, where = beam.section, f"part '{table.name}', length_mm"
        assert s is not None
        thin, gyration = (float(np.sqrt(EI / s.EA)) for EI in sorted((s.EIy, s.EIz)))
        # stiffness values may stand for the spring of a joint, or for a pin; a shape is a beam
        shaped = isinstance(table.section, Shape)
        spring = beam.length < SPRING * size and not shaped
        if beam.length > SLENDER * thin:
            yield (
                Grade.DOUBTFUL, where,
                f"{printed(beam.length)} is {printed(beam.length / thin, 2)} times the section's smaller radius of "
                "gyration, as of a wire: is the section in inches or cm, or EI in another unit? Give mm and N mm²",
            )  # fmt: skip
        elif (deepest := max(table.section.sides) if isinstance(table.section, Shape) else gyration) > beam.length:
            deep = f"the depth of its section, {printed(deepest, 3)} mm"
            radius = f"the section's radius of gyration √(EI/EA) of {printed(gyration, 3)} mm"
            likely = "it is a spring, and no beam"
            other = "is it in metres, cm or inches, or EI or EA in another unit? Give mm"
            yield (
                Grade.NOTED if spring else Grade.DOUBTFUL, where,
                f"{printed(beam.length)} is less than {deep if shaped else radius}: {likely if spring else other}",
            )  # fmt: skip


def length_of(made: object) -> float:
    """How far a part carries the chain on, mm."""
    shift = made.tip if isinstance(made, Beam) else getattr(made, "transform", np.eye(4))[:3, 3]
    return float(np.linalg.norm(shift))


def mass_of(made: object) -> float:
    """Mass of a part, kg."""
    return float(getattr(made, "mass", 0.0))


TINY_MM, TINY_INSIDE_MM, LEAST_MM = 2.0, 0.5, 1e-3
"""Lengths of vectors below which they are taken for metres, from part to part and within one, and above which: 1 mm
is the least that a link has. What is shorter still is no length in any unit, but what a fit leaves of a zero."""
METRE_DIGITS = 6
"""Decimals of a length in metres that drawings and data sheets give: the last is 1 µm."""
SMALLEST_MM = 10.0
"""Of a machine, all its parts together: below it is taken for metres."""
ODD_DRIVES = {"mm/N": (1e-8, 0.1), "rad/(N mm)": (1e-14, 1e-3)}
"""Compliances of drives outside are doubted. A block of steel of 1 m² is 5e-8 mm/N over 1 cm. A drive of 0.1 mm/N
moves by 1 mm under 10 N, and one of 1e-3 rad/(N mm) by a radian under 1 N at 1 m."""
SAG = 0.1
"""Turn of a joint or a beam under the weight of what it carries, rad, stretched out: a tip that falls by a tenth of
its reach. Arms are made for a hundredth of it."""
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

Rule = Callable[[ModelFile], Iterator[Found]]


def findings_of(name_or_path: Model) -> list[Finding]:
    """What is implausible about a model of the library or a file, chain or manipulator, refusals first.

    Raises:
        ModelFileError: see `vjm.io.machine_file.load_model`.
    """
    document = read_document(name_or_path)
    if document.content.get("kind") != KIND:
        return model_findings(document.content, document.file)
    table = read_table(document)
    findings = [Finding(g, f"{document.file}: {w}", t) for g, w, t in standing_findings(table)]
    for name, leg in leg_documents(name_or_path).items():
        used = [one for one in table.legs if one.chain == name]
        findings += model_findings(_as_used(leg, used), leg.file, may_be_rigid=True)
    return worst_first(findings)


def _as_used(document: ModelDocument, legs: Sequence[LegTable]) -> dict[str, Any]:
    """A chain's document with the postures alone in which legs stand: labels of its own, or coordinates at home."""
    content = document.content
    own = content["postures"]
    used: dict[str, Any] = {}
    for leg in legs:
        if isinstance(leg.posture, str):
            if leg.posture not in own:
                known = ", ".join(own)
                raise ModelFileError(
                    f"{document.file}: leg '{leg.name}': no posture '{leg.posture}': it has {known}"
                )
            used[leg.posture] = own[leg.posture]
        elif any(part.get("kind") in ("actuated", "sprung", "coupled") for part in content.get("parts", [])):
            # what is held stands as in the first posture
            label = next(iter(own))
            used[label] = own[label]
        else:
            used[f"home-of-{leg.name}"] = leg.posture
    return {**content, "postures": used}


def model_findings(content: Mapping[str, Any], file: str, *, may_be_rigid: bool = False) -> list[Finding]:
    """What is implausible about a chain's document, refusals first.

    Raises:
        ModelFileError: it is not sound.
    """
    model = checked(content, file, may_be_rigid=may_be_rigid)
    return worst_first(Finding(g, f"{file}: {w}", t) for rule in RULES for g, w, t in rule(model))


def weight_findings(machine: Machine, file: str) -> list[Finding]:
    """What is implausible about a machine of a file under its own weight: that it has none."""
    if any(part.mass for part in machine.parts if isinstance(part, Beam | RigidOffset)):
        return []
    message = "no part has a mass, so that under --gravity it weighs nothing: give its links mass_kg"
    return [Finding(Grade.DOUBTFUL, file, message)]


def standing_findings(table: ManipulatorFile) -> Iterator[Found]:
    """Of a manipulator: how its legs stand, and how far its drives go."""
    if (box := table.workspace) is not None:
        yield from _tiny("[workspace]", (np.array(box.max_mm) - np.array(box.min_mm)).tolist())
    for label, pose in table.poses.items():
        yield from _tiny(f"pose '{label}'", pose[:3], TINY_INSIDE_MM)
    for leg in table.legs:
        where = f"leg '{leg.name}'"
        yield from _turned(f"{where}, base", leg.base.turns)
        yield from _turned(f"{where}, attachment", leg.attachment.turns)
        if leg.drive_turns_about is not None and leg.drive_limits is not None:
            yield from _beyond(f"{where}, drive_limits", leg.drive_limits)
        for name, place in (("base", leg.base), ("attachment", leg.attachment)):
            yield from _tiny(f"{where}, {name}.position_mm", place.position_mm)


def _tiny(where: str, vector: list[float], least: float = TINY_MM) -> Iterator[Found]:
    size = float(np.linalg.norm(vector))
    if LEAST_MM <= size < least:
        yield Grade.DOUBTFUL, where, f"{vector} is {printed(size, 3)} mm long: is it in metres? Give mm"


def _bodies(model: ModelFile) -> dict[str, float]:
    """Longest rigid piece of the body that each one is of, mm, by its name: each lies behind the one before."""
    longest: dict[str, float] = {}
    body: dict[str, str] = {}
    before = model.predecessors
    for part in model.parts:
        if isinstance(part, Offset):
            body[part.name] = body.get(before[part.name], part.name)
            own = float(np.linalg.norm(part.translation_mm))
            longest[body[part.name]] = max(longest.get(body[part.name], 0.0), own)
    return {name: longest[root] for name, root in body.items()}


def offsets(model: ModelFile) -> Iterator[Found]:
    """Rigid arms and whole machines so small that they are in metres, and masses far outside of the machine.

    Pieces of one rigid body come in one unit: beside a long piece a tiny one is a correction, such as calibrations
    write. Elsewhere it is one where its source says so, or its digits are finer than any in metres.
    """
    size = sum(length_of(part.part()) for part in model.parts)
    if 0.0 < size < SMALLEST_MM:
        text = f"all parts together are {printed(size, 3)} mm long: is the machine in metres? Give mm"
        yield Grade.DOUBTFUL, "[[parts]]", text
    yield from _tiny("[base] position_mm", model.base.position_mm)
    longest = _bodies(model)
    for part in model.parts:
        where = f"part '{part.name}'"
        if isinstance(part, BeamTable):
            yield from _tiny(f"{where}, end_offset_mm", part.end_offset_mm, TINY_INSIDE_MM)
        elif isinstance(part, Offset) and longest[part.name] < TINY_MM:
            vector = part.translation_mm
            # digits below 1 µm are those of a fit
            fitted = part.source.startswith(CALIBRATED) or any(
                abs(v - round(v, METRE_DIGITS)) > 1e-12 for v in vector
            )
            yield from () if fitted else _tiny(f"{where}, translation_mm", vector)
        if isinstance(part, Offset | PayloadTable) and part.centre_of_mass_mm is not None:
            yield from _tiny(f"{where}, centre_of_mass_mm", part.centre_of_mass_mm, TINY_INSIDE_MM)
            away = float(np.linalg.norm(part.centre_of_mass_mm))
            if away > size > 0.0:
                yield (
                    Grade.DOUBTFUL,
                    f"{where}, centre_of_mass_mm",
                    f"{part.centre_of_mass_mm} is {printed(away, 3)} mm away, on a machine whose parts are "
                    f"{printed(size, 3)} mm long together: is it in another unit? Give mm",
                )


def drives(model: ModelFile) -> Iterator[Found]:
    """Drives that are softer or stiffer than any, and that sag under what they carry."""
    for part in model.parts:
        if isinstance(part, MountTable) and part.compliance_rad_per_Nmm is not None:
            key, unit, value = "compliance_rad_per_Nmm", "rad/(N mm)", part.compliance_rad_per_Nmm
        elif isinstance(part, ActuatorTable | MountTable):
            key, unit, value = "compliance_mm_per_N", "mm/N", part.compliance_mm_per_N or 0.0
        elif isinstance(part, ElasticJointTable):
            key, unit = ("compliance_mm_per_N", "mm/N") if part.slides else ("compliance_rad_per_Nmm", "rad/(N mm)")
            value = part.own
        else:
            continue
        low, high = ODD_DRIVES[unit]
        if value > high:
            other = "µm/N or mm/kN" if unit == "mm/N" else "rad/(N m), or degrees"
            message = f"{printed(value)} {unit}: no drive is so soft; is it in {other}? Give {unit}"
            yield Grade.DOUBTFUL, f"part '{part.name}', {key}", message
        elif 0.0 < value < low:
            other = "m/N or a stiffness" if unit == "mm/N" else "a stiffness"
            message = (
                f"{printed(value)} {unit}: stiffer than a block of steel; is it in {other}? Write 0 for a rigid one"
            )
            yield Grade.DOUBTFUL, f"part '{part.name}', {key}", message
    yield from _sagging(model)


def springs(model: ModelFile) -> Iterator[Found]:
    """Springs of passive joints that are stiffer than any, or wound up by more than a turn."""
    for part in model.parts:
        if not isinstance(part, JointTable) or not part.stiffness:
            continue
        unit, key = ("mm/N", "stiffness_N_per_mm") if part.slides else ("rad/(N mm)", "stiffness_Nmm_per_rad")
        if 1.0 / part.stiffness < ODD_DRIVES[unit][0]:
            text = f"{printed(part.stiffness)} is stiffer than a block of steel: is it in another unit?"
            yield Grade.DOUBTFUL, f"part '{part.name}', {key}", text
        wound = abs(part.preload_Nmm) / part.stiffness
        if not part.slides and wound > 2.0 * np.pi:
            yield (
                Grade.DOUBTFUL,
                f"part '{part.name}', preload_Nmm",
                f"{printed(part.preload_Nmm)} winds its spring up by {printed(wound, 3)} rad: is either in N m?",
            )


def _sagging(model: ModelFile) -> Iterator[Found]:
    """Joints and beams whose own compliance lets the arm behind them fall, stretched out as far as it goes."""
    before = model.predecessors
    # N and N mm of all that lies behind a part, each branch stretched out by itself
    carried: dict[str, tuple[float, float]] = {}
    for part in reversed(model.parts):
        made = part.part()
        step, own = length_of(made), mass_of(made) * WEIGHT
        weight, torque = carried.get(part.name, (0.0, 0.0))
        if isinstance(part, ElasticJointTable) and not part.slides:
            given = {
                "compliance_rad_per_Nmm": part.compliance_rad_per_Nmm,
                "lateral_rad_per_Nmm": max(part.lateral_rad_per_Nmm),
            }
            for key, compliance in given.items():
                if torque * compliance > SAG:
                    yield (
                        Grade.DOUBTFUL,
                        f"part '{part.name}', {key}",
                        f"{printed(compliance)} lets the arm sag by {printed(torque * compliance, 2)} rad under "
                        "its own weight: is it in rad/(N m) or degrees, or a mass in g? Give rad/(N mm) and kg",
                    )
        elif isinstance(made, Beam) and made.section is not None:
            # edgewise: a strip that bends in the horizontal plane alone is no mistake
            EI = max(made.section.EIy, made.section.EIz) * made.count
            sag = (torque + 0.5 * weight * step + own * step / 6.0) * step / EI
            if sag > SAG:
                yield (
                    Grade.DOUBTFUL,
                    f"part '{part.name}', section",
                    f"it bends by {printed(sag, 2)} rad under the weight of what it carries. Is a length in cm "
                    "or m, EI or a modulus in another unit, or a mass in g?",
                )
        if model.closures:
            # others bear a part of it, and what a loop holds along its length does not bend
            continue
        # what rides on a beam may stand at its end
        on = (part.rides_on if isinstance(part, MovingTable) else None) or before[part.name]
        others = carried.get(on, (0.0, 0.0))
        carried[on] = others[0] + weight + own, others[1] + torque + weight * step + 0.5 * own * step


def masses(model: ModelFile) -> Iterator[Found]:
    """Masses that the part's volume, or the machine's size, cannot hold."""
    made = [(part, part.part()) for part in model.parts]
    size = sum(length_of(one) for _, one in made)
    for part, one in made:
        where, mass = f"part '{part.name}', mass_kg", mass_of(one)
        if isinstance(part, BeamTable) and part.mass_kg and isinstance(one, Beam) and one.section is not None:
            # of a section known by its stiffness the area is that of the rectangle with its radii
            rectangle = 12.0 * float(np.sqrt(one.section.EIy * one.section.EIz)) / one.section.EA
            area = part.section.area if isinstance(part.section, Shape) else rectangle
            volume = one.count * one.length * area
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
        elif isinstance(part, Offset) and not part.source.startswith(CALIBRATED):
            yield from _turned(f"part '{part.name}', turns", part.turns)


def _beyond(where: str, limits: list[float]) -> Iterator[Found]:
    # as a file writes that there is none on one side
    largest = max((abs(v) for v in limits if abs(v) < LONGEST_MM), default=0.0)
    if largest > MANY_TURNS:
        message = f"{limits} is {printed(largest / (2.0 * np.pi), 3)} turns: is it in degrees? Give rad"
        yield Grade.DOUBTFUL, where, message


def limits(model: ModelFile) -> Iterator[Found]:
    """Limits of turning joints in degrees; those of joints that ride on beams, beyond the beams."""
    beams = {part.name: part for part in model.parts if isinstance(part, BeamTable)}
    for part in model.parts:
        if isinstance(part, MovingTable) and part.rides_on in beams and part.limits_mm is not None:
            (low, high), length = part.limits_mm, beams[part.rides_on].length_mm
            if low < 0.0 or high > length:
                text = (
                    f"{part.limits_mm} go beyond the beam '{part.rides_on}': it stops at 0 and {printed(length)} mm"
                )
                yield Grade.DOUBTFUL, f"part '{part.name}', limits_mm", text
        if isinstance(part, MovingTable) and part.limits_rad is not None:
            yield from _beyond(f"part '{part.name}', limits_rad", part.limits_rad)


def postures(model: ModelFile) -> Iterator[Found]:
    """Coordinates in degrees that are small enough to pass for radians.

    Degrees are typed round; radians of a folded machine come from its geometry, and 135° has no short decimal in
    rad. A coordinate within limits that the file gives in rad is in rad.
    """
    moving = {part.name: part for part in model.parts if isinstance(part, MovingTable) and not part.slides}
    for label in model.postures:
        given = {name: q for name, q in model.given(label).items() if name in moving}
        where = f"posture '{label}'"
        turned = [q for q in given.values() if q]
        # multiples of a tenth, as degrees are typed
        for name, q in given.items() if all(abs(q - round(q, 1)) <= 1e-12 for q in turned) else ():
            if isinstance(moving[name], JointTable) and abs(q) >= FOLDED and moving[name].limits is None:
                message = (
                    f"the passive joint {name} at {printed(q)} rad is turned by {printed(np.rad2deg(q), 3)}°, and "
                    "all coordinates are round numbers: is it in degrees? Give rad"
                )
                yield Grade.DOUBTFUL, where, message
        if turned and max(map(abs, turned)) >= 3.0 and all(float(q).is_integer() for q in turned):
            message = "every coordinate is a whole number: are they degrees? Give rad"
            yield Grade.DOUBTFUL, where, message


def calibrated(model: ModelFile) -> Iterator[Found]:
    """Why a file was written by force alone."""
    for reason in model.calibrated.not_for_use:
        yield Grade.DOUBTFUL, "[calibrated] not_for_use", f"{reason}; `validate calibrate --force` wrote it"


RULES: tuple[Rule, ...] = (
    materials, sections, stubby, warping, matrices, drawings, offsets, drives, springs, masses, angles, limits,
    postures, calibrated,
)  # fmt: skip
"""All rules of a chain's file."""
