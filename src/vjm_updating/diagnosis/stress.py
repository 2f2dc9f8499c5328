"""Where a chain's material would yield: stresses of beam theory, or of a part's solid, along a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind, Path, driven_force
from vjm.io.schema import DrawnTable
from vjm.io.shapes import SHAPES, Shape
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm_updating.mechanisms.modified_chain import springs_of


@dataclass(frozen=True)
class First:
    """Where the material yields first.

    Attributes:
        force: driven force there, N; None where none does, or it cannot be said.
        words: where, or why not.
        known: whether any part's yield stress is known.
    """

    force: float | None
    words: str
    known: bool = True


@dataclass(frozen=True)
class Fibre:
    """A section's outermost fibres and its material.

    Attributes:
        area: mm².
        modulus_y: section modulus of bending about y, mm³.
        modulus_z: and about z.
        limit: yield stress, MPa.
        round: whether the two bendings meet in no corner.
    """

    area: float
    modulus_y: float
    modulus_z: float
    limit: float
    round: bool = False

    def share(self, beam: Beam, lengths: list[float], reactions: list[Array]) -> float:
        """Largest stress in MPa over the yield stress.

        ``lengths`` are of a member's segments, mm, ``reactions`` (6,) those at its springs, one in each.
        """
        assert beam.segments
        return max(map(self.stress, reactions, lengths)) / self.limit

    def stress(self, reaction: Array, length: float) -> float:
        """Largest stress in MPa in a segment of ``length`` mm under the reactions ``(6,)`` at its middle."""
        N, Qy, Qz, _, My, Mz = np.abs(reaction)
        # towards its ends the moments change by the shear forces
        y, z = (My + 0.5 * length * Qz) / self.modulus_y, (Mz + 0.5 * length * Qy) / self.modulus_z
        return float(N / self.area + (np.hypot(y, z) if self.round else y + z))


@dataclass(frozen=True)
class Solid:
    """Von Mises stress of a part from its drawing.

    Attributes:
        points: ``(k, 3)``, own axes, mm from the root.
        forms: ``(k, 6, 6)`` of them, see `vjm.io.schema.DrawnTable.stress_forms`.
        limit: yield stress, MPa.
    """

    points: Array
    forms: Array
    limit: float

    def share(self, beam: Beam, lengths: list[float], reactions: list[Array]) -> float:
        """Largest stress in MPa over the yield stress, see `Fibre.share`."""
        ends = np.cumsum([0.0, *lengths])
        wrenches = np.array([self._at_tip(beam, *each) for each in zip(ends[:-1], lengths, reactions, strict=True)])
        # a point bears what the spring of its own segment bears
        along = (self.points @ beam.section_frame)[:, 0]
        local_wrenches = wrenches[np.clip(np.searchsorted(ends, along, side="right") - 1, 0, len(reactions) - 1)]
        squares = np.einsum("ki,kij,kj->k", local_wrenches, self.forms, local_wrenches)
        return float(np.sqrt(max(0.0, squares.max()))) / self.limit

    def _at_tip(self, beam: Beam, root: float, length: float, reaction: Array) -> Array:
        """The wrench ``(6,)`` at the tip, own axes, that loads the spring of a segment as it is loaded."""
        if not beam.segments:
            return reaction
        S = beam.section_frame
        force, moment = S @ reaction[:3], S @ reaction[3:]
        back = S @ np.array([root + beam.placement.fraction * length - beam.length, 0.0, 0.0]) - beam.end_offset
        return np.concatenate([force, moment + np.cross(back, force)])


def fibre_of(table: Mapping[str, Any]) -> Fibre | str:
    """The outermost fibres of a beam's table in a model document; else why they are not known."""
    shape, name = shape_of(table), table["name"]
    if shape is None:
        return f"not known: the model says no shape of the section of {name}"
    if shape.yield_stress_MPa is None:
        return f"not known: the model says no yield stress of {name}"
    return Fibre(shape.area, *shape.section_moduli, shape.yield_stress_MPa, shape.rounded)


def shape_of(table: Mapping[str, Any]) -> Shape | None:
    """The shape of a beam's section by its table in a model document; None where the document says none."""
    section = table.get("section") or {}
    kind = SHAPES.get(section.get("shape", ""))
    return None if kind is None else kind.model_validate(section)


def material_of(table: Mapping[str, Any]) -> Fibre | Solid | str:
    """What a beam's table says of its stress, its drawing's where it has one; else why that is not known."""
    if "drawing" not in table:
        return fibre_of(table)
    drawn = DrawnTable.model_validate(table["drawing"])
    if drawn.yield_stress_MPa is None:
        return f"not known: the model says no yield stress of {table['name']}"
    return Solid(np.array(drawn.stress_at_mm), drawn.forms(), drawn.yield_stress_MPa)


def first_yield(problem: LumpedProblem, path: Path, parts: Sequence[Mapping[str, Any]]) -> First:
    """Where the first part yields along a path as far as its critical point, or its end.

    ``parts`` are tables of the model's parts, with shapes or drawings, and yield stresses.
    """
    model = problem.model
    beams = {part.name: part for part in model.chain.parts if isinstance(part, Beam)}
    materials: dict[str, Fibre | Solid] = {}
    unknown = []
    for table in parts:
        if table.get("kind") == "beam":
            material = material_of(table)
            if isinstance(material, str):
                unknown.append(material)
            elif isinstance(material, Solid) or beams[table["name"]].segments:
                materials[table["name"]] = material
    if not materials:
        return First(None, unknown[-1] if unknown else "not known: one spring has no stresses", known=False)
    # a stiffness knee ends nothing
    event = next((e for e in path.events if e.kind is not EventKind.STIFFNESS_KNEE), None)
    points = [p for p in path.points if event is None or p.s < event.s]
    if event is not None and event.point is not None:
        points.append(event.point)
    springs = {name: springs_of(model, name) for name in materials}
    last, force = 0.0, 0.0
    for point in points:
        state = problem.configuration(point)
        reactions = model.reactions(state.kinematics, state.wrench)
        if len(model.applied_loads):
            acting = model.compiled.acting(state.x, state.wrench, state.load)
            reactions = reactions + model.compiled.load_forces(state.x, state.wrench, state.load, acting)
        shares = {
            name: one.share(
                beams[name],
                model.built.lengths.get(name, [beams[name].length]),
                [reactions[where] / beams[name].count for where in springs[name]],
            )
            for name, one in materials.items()
        }
        share = max(shares.values())
        next_force = driven_force(path.load_case, point)
        if share >= 1.0:
            part = (1.0 - last) / (share - last)
            first = max(shares, key=lambda name: shares[name])
            return First(force + part * (next_force - force), f"on the way, in {first}")
        last, force = share, next_force
    place = f"at the {event.kind}" if event is not None else f"at {force:.4g} N"
    return First(None, f"not before: {100.0 * last:.0f} % of the yield stress is reached {place}")
