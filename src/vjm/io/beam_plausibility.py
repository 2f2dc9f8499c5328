"""Mistakes in the beams of model files: materials, sections, slenderness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vjm.io.errors import printed
from vjm.io.findings import Grade
from vjm.io.schema import BeamTable, ModelFile
from vjm.io.sections import StiffnessSection
from vjm.io.shapes import Shape
from vjm.model.parts import Beam

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


def area_of(part: BeamTable, beam: Beam) -> float:
    """Area of one member, mm²; of a section known by its stiffness that of the rectangle with its radii."""
    assert beam.section is not None
    if isinstance(part.section, Shape):
        return part.section.area
    return 12.0 * float(np.sqrt(beam.section.EIy * beam.section.EIz)) / beam.section.EA
