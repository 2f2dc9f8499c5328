"""`validate identify --solid`: a part's compliance from its drawing, and the beam behind it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from vjm import __version__
from vjm.io.drawn_plausibility import LIKE, THIN, bonded_bodies
from vjm.rotations import Array, rotate_matrix6
from vjm_fea.solid.compliance import RootSupport, TipLoad
from vjm_fea.solid.identify import Bound, SolidCompliance
from vjm_output.number_text import number, percent
from vjm_updating.constants import numerical, physical_bound, tuned
from vjm_updating.identify.candidates import Target
from vjm_updating.identify.report import BeamDocument
from vjm_updating.identify.results import beam_document, scaling, searches
from vjm_updating.identify.solid_report import (
    BoundDocument,
    MeshDocument,
    SolidDocument,
    StressDocument,
    TaperDocument,
)

# --- A straight tapered beam like a compliance: bending stiffness at root and end in both planes, in closed form

EXTREME = physical_bound(np.log(50.0))
"""Logarithm of the largest ratio of bending stiffnesses that is sought."""
POINTS, WEIGHTS = numerical(np.polynomial.legendre.leggauss(40))


def tapered(C: Array, reach: Array) -> TaperDocument | None:
    """The tapered beam along a line, or None where the part does not bend like one.

    Bending stiffness runs as ``EI(s) = EI_0 (EI_1/EI_0)^(s/L)``. A cantilever's end turns by ``m ∫ds/EI`` and moves
    by ``m ∫(L−s)ds/EI``: their ratio, the lever, gives the ratio of the stiffnesses, the turn their size; what the
    end moves under a force, ``∫(L−s)²ds/EI``, is then left to compare.

    Args:
        C: compliance ``(6, 6)`` at the end, mm, N, rad.
        reach: from root to end ``(3,)``, mm.
    """
    L = float(np.linalg.norm(reach))
    if L == 0.0:
        return None
    x = reach / L
    across = np.linalg.svd(x[None, :])[2][1:].T
    # the principal directions of bending across the line
    turns = across @ np.linalg.eigh(across.T @ C[3:, 3:] @ across)[1]
    axes = np.column_stack([x, turns[:, 0], np.cross(x, turns[:, 0])])
    own = rotate_matrix6(C, axes.T)
    scale = np.sqrt(np.diag(own))
    found, misses = [], []
    for move, turn, sign in ((2, 4, -1.0), (1, 5, 1.0)):
        lever = sign * own[move, turn] / own[turn, turn] / L
        if not _lever(-EXTREME) < lever < _lever(EXTREME):
            return None
        k = float(brentq(lambda k, lever=lever: _lever(k) - lever, -EXTREME, EXTREME))
        root = L * _moment(k, 0) / own[turn, turn]
        found.append([float(root), float(root * np.exp(k))])
        deflection = L**3 * _moment(k, 2) / root
        misses.append(abs(deflection - own[move, move]) / scale[move] ** 2)
    return TaperDocument(length_mm=L, EIy_Nmm2=found[0], EIz_Nmm2=found[1], worst_scaled=float(max(misses)))


def _moment(k: float, power: int) -> float:
    """``∫ (1 − t)^power e^(−k t) dt`` from 0 to 1."""
    t = 0.5 * (POINTS + 1.0)
    return 0.5 * float(np.sum(WEIGHTS * (1.0 - t) ** power * np.exp(-k * t)))


def _lever(k: float) -> float:
    """Lever of the end's turning over the length; rises with k, one half for a uniform beam."""
    return _moment(k, 1) / _moment(k, 0)


# ------------------------------------------------------------------------------------------------------------------


LIKE_A_BEAM = tuned(5e-3)
"""Scaled half-interval within which a beam counts as the part's, where the bounds are closer."""
DEPTHS = physical_bound(6.0)
"""Length over the mean depth below which plane sections do not stay plane: 20 radii of gyration of a rectangle."""
TAPERS = tuned(0.05)
"""Scaled difference up to which a tapered beam is named."""


def solid_document(
    found: SolidCompliance, stress: StressDocument | None = None, *, bonded: bool = False
) -> SolidDocument:
    """What was found, with the beams that are like it, as a document.

    Args:
        found: the part.
        stress: where a wrench was given.
        bonded: whether bodies that touch are meant to be one.
    """
    task, bounds = found.task, found.bounds
    beams = beams_of(found)
    taper = tapered(middle(found), found.at - found.base_centre)
    buckling = buckling_of(found, beams)
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
        bodies=found.bodies,
        buckling_N=buckling.force,
        warnings=_warnings(found, beams, bonded),
        findings=_findings(found, beams, taper, buckling),
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


def _bound(tip: TipLoad, bound: Bound) -> BoundDocument:
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


def _warnings(found: SolidCompliance, beams: list[BeamDocument], bonded: bool) -> list[str]:
    beam = beams[-1]
    texts = []
    if found.relative > found.task.accuracy:
        why = (
            "more unknowns than --largest"
            if found.stopped == "size"
            else "more working memory than this machine has free"
        )
        texts.append(
            f"the asked accuracy of {percent(found.task.accuracy)} is not met: {percent(found.relative)} are left, "
            f"and the next mesh needs {why}"
        )
    if found.bodies > 1 and not bonded:
        texts.append(f"{bonded_bodies(found.bodies)}: --bonded says that this is meant")
    sections = found.sections
    if sections is not None and sections.straight:
        depth = float(np.mean(sections.depth))
        if sections.length < DEPTHS * depth:
            texts.append(
                f"too stubby for a beam: {number(sections.length, 3)} mm from base to tip with a depth of "
                f"about {number(depth, 2)} mm; take the 6×6 compliance, not the beam"
            )
        if sections.gyration > THIN * found.thickness:
            texts.append(
                f"walls of about {number(found.thickness, 3)} mm at a radius of gyration of "
                f"{number(sections.gyration, 3)} mm. They may buckle by themselves, which neither the 6×6 "
                "compliance nor a beam knows"
            )
    if not beam.met:
        texts.append(
            f"no uniform beam is like this part: the best misses {beam.worst_entry} by "
            f"{number(beam.worst_misfit, 3)} half-widths, {percent(beam.worst_scaled)} of √(c_ii c_jj)"
        )
    return texts


@dataclass(frozen=True)
class PartBuckling:
    """Compression in N under which a part buckles, held at its base and free at its tip; None where undecided."""

    force: float | None
    words: str


def buckling_of(found: SolidCompliance, beams: Sequence[BeamDocument]) -> PartBuckling:
    """By whichever is nearer to the part: the column of its own sections, or the uniform beam of its own length.

    Euler's load goes with the stiffness and with the length to the power of −2: its error is about the column's
    misfit in bending, or twice the beam's in length, and that of the compliance. Above `LIKE` nothing is said
    of the force.
    """
    sections, beam, ways = found.sections, beams[-1], []
    if found.column is not None:
        miss = found.column.misfit
        ways.append(
            (miss, found.column.force, f"a column of its own sections, whose bending misses by {percent(miss)}")
        )
    EI = [value for value in (beam.EIy_Nmm2, beam.EIz_Nmm2) if value is not None]
    if beam.met and len(EI) == 2 and sections is not None and sections.straight:
        off = 2.0 * abs(beam.length_mm / sections.length - 1.0)
        euler = float(np.pi**2 * min(EI) / (4.0 * beam.length_mm**2))
        ways.append((off, euler, f"that uniform beam, whose length misses the part's by {percent(0.5 * off)}"))
    if found.relative > LIKE:
        known = f"the compliance is known to {percent(found.relative)} only"
        return PartBuckling(None, f"whether it buckles, and when, is undecided: {known}")
    if not ways or min(ways)[0] + found.relative > LIKE:
        return PartBuckling(
            None, "whether it buckles, and when, is undecided: it bends like no beam of its own length"
        )
    _, force, like = min(ways)
    return PartBuckling(
        force, f"free at its tip, without shear, it buckles at {number(force, 3)} N of compression as {like}"
    )


def _findings(
    found: SolidCompliance, beams: list[BeamDocument], taper: TaperDocument | None, buckling: PartBuckling
) -> list[str]:
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
    if found.bodies > 1:
        lines.append(bonded_bodies(found.bodies))
    lines.append(buckling.words)
    if taper is not None and not beams[0].met and taper.worst_scaled < TAPERS:
        lines.append(
            f"as a straight tapered beam from base to tip: EIy {number(taper.EIy_Nmm2[0], 3)} to "
            f"{number(taper.EIy_Nmm2[1], 3)}, EIz {number(taper.EIz_Nmm2[0], 3)} to "
            f"{number(taper.EIz_Nmm2[1], 3)} N mm². "
            f"Its bending misses by {percent(taper.worst_scaled)} at most"
        )
    lines.append(
        "linear. A load that turns the tip by θ shortens the part's reach by about θ²/6 of it, 0.17 % at 0.1 rad, "
        "which this matrix does not know"
    )
    if found.task.held is RootSupport.CLAMPED:
        lines.append("the base is held at every point; a real joint deflects more")
    return lines
