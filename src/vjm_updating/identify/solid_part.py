"""`validate identify --solid`: a part's compliance from its drawing, and the beam behind it."""

from __future__ import annotations

import hashlib

import numpy as np

from vjm import __version__
from vjm.io.drawn_plausibility import STUBBY, THIN
from vjm.rotations import Array
from vjm_fea.solid.compliance import Base, Tip
from vjm_fea.solid.identify import Bound, SolidCompliance
from vjm_output.number_text import number, percent
from vjm_updating.identify.candidates import Target
from vjm_updating.identify.documents import BeamDocument
from vjm_updating.identify.results import beam_document, scaling, searches
from vjm_updating.identify.solid_documents import (
    BoundDocument,
    MeshDocument,
    SolidDocument,
    StressDocument,
    TaperDocument,
)
from vjm_updating.identify.taper import tapered

LIKE_A_BEAM = 5e-3
"""Scaled half-interval within which a beam counts as the part's, where the bounds are closer."""
TAPERS = 0.05
"""Scaled difference up to which a tapered beam is named."""


def solid_document(found: SolidCompliance, stress: StressDocument | None = None) -> SolidDocument:
    """What was found, with the beams that are like it, as a document; ``stress`` where a wrench was given."""
    task, bounds = found.task, found.bounds
    beams = beams_of(found)
    taper = tapered(middle(found), found.at - found.base_centre)
    warnings = _warnings(found, beams)
    return SolidDocument(
        version=__version__,
        name=task.path.name,
        sha256=hashlib.sha256(task.path.read_bytes()).hexdigest(),
        youngs_modulus_MPa=task.material.youngs_modulus,
        poissons_ratio=task.material.poissons_ratio,
        density_kg_per_m3=1e9 * task.material.density or None,
        base_faces=list(found.ends.base),
        tip_faces=list(found.ends.tip),
        base_held=task.held.value,
        base_centre_mm=found.base_centre.tolist(),
        tip_centre_mm=found.tip_centre.tolist(),
        read_at_mm=found.at.tolist(),
        meshes=[
            MeshDocument(size_mm=size, unknowns=unknowns)
            for size, unknowns in zip(found.sizes, found.unknowns, strict=True)
        ],
        stopped=found.stopped,
        accuracy_asked=task.accuracy,
        accuracy_reached=found.relative,
        bounds=[_bound(tip, bound) for tip, bound in bounds.items()],
        bounds_apart=apart(found),
        volume_mm3=found.volume,
        mass_kg=found.mass or None,
        centre_of_mass_mm=found.centre.tolist(),
        beams=beams,
        taper=taper,
        stress=stress,
        warnings=warnings,
        findings=_findings(found, beams, taper),
    )


def middle(found: SolidCompliance) -> Array:
    """Mean ``(6, 6)`` of the bounds."""
    result: Array = np.mean([bound.limit.compliance for bound in found.bounds.values()], axis=0)
    return result


def apart(found: SolidCompliance) -> float:
    """Largest scaled difference of the bounds; zero where there is one only."""
    matrices = [bound.limit.compliance for bound in found.bounds.values()]
    return float(np.max(np.abs(matrices[0] - matrices[-1]) / scaling(matrices[0])))


def beams_of(found: SolidCompliance) -> list[BeamDocument]:
    """The uniform beams nearest to the mean of the bounds, which count as met between them or within 0.5 %."""
    C = middle(found)
    matrices = [bound.limit.compliance for bound in found.bounds.values()]
    half = np.max([bound.limit.interval for bound in found.bounds.values()], axis=0)
    half = half + 0.5 * np.abs(matrices[0] - matrices[-1])
    return [beam_document(one) for one in searches(Target(C, np.maximum(half, LIKE_A_BEAM * scaling(C))))]


def _bound(tip: Tip, bound: Bound) -> BoundDocument:
    C, last = bound.limit.compliance, bound.meshes[-1]
    return BoundDocument(
        tip=tip.value,
        compliance=C.tolist(),
        interval=bound.limit.interval.tolist(),
        order=[[None if np.isnan(p) else float(p) for p in row] for row in bound.limit.order],
        last_mesh=last.tolist(),
        fitted=bound.fitted.tolist(),
        fitted_difference=float(np.max(np.abs(bound.fitted - last) / scaling(last))),
        left_out=bound.left_out,
        smallest_eigenvalue=float(np.linalg.eigvalsh(C / scaling(C))[0]),
    )


def _warnings(found: SolidCompliance, beams: list[BeamDocument]) -> list[str]:
    beam = beams[-1]
    texts = []
    if found.relative > found.task.accuracy:
        why = (
            "more unknowns than --largest" if found.stopped == "size" else "more memory than this machine has free"
        )
        texts.append(
            f"the asked accuracy of {percent(found.task.accuracy)} is not met: {percent(found.relative)} are left, "
            f"and the next mesh needs {why}"
        )
    if beam.EA_N is not None:
        EI = [value for value in (beam.EIy_Nmm2, beam.EIz_Nmm2) if value is not None]
        gyration = float(np.sqrt(max(EI) / beam.EA_N)) if EI else 0.0
        if gyration > 0.0 and beam.length_mm / gyration < STUBBY:
            texts.append(
                f"too stubby for a beam: {number(beam.length_mm, 3)} mm long with a radius of gyration of "
                f"{number(gyration, 3)} mm; take the 6×6 compliance, not the beam"
            )
        if gyration > THIN * found.thickness:
            texts.append(
                f"walls of about {number(found.thickness, 3)} mm at a radius of gyration of {number(gyration, 3)} "
                "mm: they may buckle by themselves, which neither the 6×6 compliance nor a beam knows"
            )
    if not beam.met:
        texts.append(
            f"no uniform beam is like this part: the best misses {beam.worst_entry} by "
            f"{number(beam.worst_misfit, 3)} half-widths, {percent(beam.worst_scaled)} of √(c_ii c_jj)"
        )
    return texts


def _findings(found: SolidCompliance, beams: list[BeamDocument], taper: TaperDocument | None) -> list[str]:
    lines = [
        f"between a rigid tip and a wrench spread over its face: {percent(apart(found))} of √(c_ii c_jj) at most"
        if len(found.bounds) > 1
        else "one kind of tip only: no bounds",
    ]
    for tip, bound in found.bounds.items():
        difference = np.max(np.abs(bound.fitted - bound.meshes[-1]) / scaling(bound.meshes[-1]))
        lines.append(
            f"{tip.value} tip: the displacement field's rigid motion differs from virtual work by "
            f"{percent(float(difference))}, {percent(bound.left_out)} of the nodes left out"
        )
    beam = beams[-1]
    EI = [value for value in (beam.EIy_Nmm2, beam.EIz_Nmm2) if value is not None]
    if EI and beam.met:
        euler = np.pi**2 * min(EI) / (4.0 * beam.length_mm**2)
        lines.append(f"as that beam, free at its tip, it buckles at {number(float(euler), 3)} N of compression")
    if taper is not None and not beams[0].met and taper.worst_scaled < TAPERS:
        lines.append(
            f"as a straight tapered beam from base to tip: EIy {number(taper.EIy_Nmm2[0], 3)} to "
            f"{number(taper.EIy_Nmm2[1], 3)}, EIz {number(taper.EIz_Nmm2[0], 3)} to "
            f"{number(taper.EIz_Nmm2[1], 3)} N mm²; "
            f"its bending misses by {percent(taper.worst_scaled)} at most"
        )
    lines.append(
        "linear: a load that turns the tip by θ shortens the part's reach by about θ²/6 of it, 0.17 % at 0.1 rad, "
        "which this matrix does not know"
    )
    if found.task.held is Base.CLAMPED:
        lines.append("the base is held at every point; a real joint deflects more")
    return lines
