"""Where a chain's material would yield: stresses of beam theory along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind, Path, driven_force
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm_updating.mechanisms.modified_chain import springs_of


@dataclass(frozen=True)
class First:
    """Where the first fibre yields.

    Attributes:
        force: driven force there, N; None where none does, or it cannot be said.
        words: where, or why not.
    """

    force: float | None
    words: str


@dataclass(frozen=True)
class Fibre:
    """A section's outermost fibres and its material.

    Attributes:
        area: mm².
        modulus_y: section modulus of bending about y, mm³.
        modulus_z: and about z.
        limit: yield stress, MPa.
    """

    area: float
    modulus_y: float
    modulus_z: float
    limit: float

    def stress(self, reaction: Array, length: float) -> float:
        """Largest stress in MPa in a segment of ``length`` mm under the reactions ``(6,)`` at its middle."""
        N, Qy, Qz, _, My, Mz = np.abs(reaction)
        # towards its ends the moments change by the shear forces
        bending = (Mz + 0.5 * length * Qy) / self.modulus_z + (My + 0.5 * length * Qz) / self.modulus_y
        return float(N / self.area + bending)


def fibre_of(table: Mapping[str, Any]) -> Fibre | str:
    """The outermost fibres of a beam's table in a model document; else why they are not known."""
    section, name = table.get("section") or {}, table["name"]
    if section.get("shape") == "rectangle":
        w, t = float(section["width_mm"]), float(section["thickness_mm"])
        area, by_y, by_z = w * t, t * w**2 / 6.0, w * t**2 / 6.0
    elif section.get("shape") == "square_tube":
        w = float(section["width_mm"])
        core = w - 2.0 * float(section["wall_mm"])
        area = w**2 - core**2
        by_y = by_z = (w**4 - core**4) / (6.0 * w)
    else:
        return f"not known: the model says no shape of the section of {name}"
    limit = section.get("yield_stress_MPa")
    if limit is None:
        return f"not known: the model says no yield stress of {name}"
    return Fibre(area, by_y, by_z, float(limit))


def first_yield(problem: LumpedProblem, path: Path, document: Mapping[str, Any]) -> First:
    """Where the first beam's first fibre yields along a path as far as its critical point, or its end.

    Args:
        problem: of the path.
        path: traced.
        document: of the model, with shapes and yield stresses.
    """
    model = problem.model
    fibres: dict[str, Fibre] = {}
    unknown = []
    for table in document["parts"]:
        if table.get("kind") == "beam":
            fibre = fibre_of(table)
            if isinstance(fibre, Fibre):
                fibres[table["name"]] = fibre
            else:
                unknown.append(fibre)
    split = {part.name: part for part in model.chain.parts if isinstance(part, Beam) and part.segments}
    known = {name: fibre for name, fibre in fibres.items() if name in split}
    if not known:
        return First(None, unknown[-1] if unknown else "not known: one spring has no stresses")
    # a bend-over ends nothing
    event = next((e for e in path.events if e.kind is not EventKind.BEND_OVER), None)
    points = [p for p in path.points if event is None or p.s < event.s]
    if event is not None and event.point is not None:
        points.append(event.point)
    last, force = 0.0, 0.0
    for point in points:
        at = problem.configuration(point)
        reactions = model.reactions(at.kinematics, at.wrench)
        if len(model.applied_loads):
            acting = model.compiled.acting(at.x, at.wrench, at.load)
            reactions = reactions + model.compiled.load_forces(at.x, at.wrench, at.load, acting)
        share = max(_share(reactions, problem, split[name], fibre) for name, fibre in known.items())
        here = driven_force(path.load_case, point)
        if share >= 1.0:
            part = (1.0 - last) / (share - last)
            return First(force + part * (here - force), "on the way")
        last, force = share, here
    there = f"at the {event.kind}" if event is not None else f"at {force:.4g} N"
    return First(None, f"not before: {100.0 * last:.0f} % of the yield stress is reached {there}")


def _share(reactions: Array, problem: LumpedProblem, beam: Beam, fibre: Fibre) -> float:
    """Largest stress over the yield stress in one of a beam's members."""
    assert beam.segments
    own = [reactions[where] / beam.count for where in springs_of(problem.model, beam.name)]
    return max(fibre.stress(one, beam.length / beam.segments) for one in own) / fibre.limit
