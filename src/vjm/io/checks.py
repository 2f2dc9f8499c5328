"""What no type can check: whether a compliance, a beam, a posture or the size of a machine makes mechanical sense.

Calibrations write offsets beyond 100 m that lead along axes and back: what counts is how far the axes are from one
another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.io.errors import printed
from vjm.io.fields import LONGEST_MM
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Section
from vjm.rank import NEGLIGIBLE, null_space, rank_of
from vjm.rotations import Array


@dataclass(frozen=True)
class PlacedPiece:
    """A rigid piece, or a joint at zero.

    Attributes:
        name: of it; steps have different names.
        before: name of the step behind which it begins; empty for the base.
        frame: ``(4, 4)`` of its end where it begins, mm.
        moves: whether it is a joint.
        axis: ``(3,)`` about which it turns, where it does.
    """

    name: str
    before: str
    frame: Array
    moves: bool = False
    axis: Array | None = None


def far_steps(steps: Sequence[PlacedPiece]) -> list[tuple[str, float]]:
    """Names and lengths in mm of the pieces that lead farther away than a machine is long.

    A piece may do so along the axis of a joint beside it, where the next joint's axis is nearly parallel to that.
    Both axes stay less than 100 m from one another all that way.

    Args:
        steps: parents before children.
    """
    far = [step for step in steps if np.abs(step.frame[:3, 3]).max() > LONGEST_MM]
    if not far:
        return []
    by_name = {step.name: step for step in steps}
    turns: dict[str, Array] = {"": np.eye(3)}
    for step in steps:
        turns[step.name] = turns[step.before] @ step.frame[:3, :3]
    axes = {step.name: turns[step.before] @ step.axis for step in steps if step.axis is not None}
    pairs: list[tuple[str, str]] = []
    beside: dict[str, set[str]] = {step.name: set() for step in steps}
    for step in (step for step in steps if step.moves):
        way = list(_pieces_before(step, by_name))
        before = by_name[way[-1] if way else step.name].before
        pairs += [(step.name, before)] if before else []
        for name in way:
            beside[name] |= {step.name, before}
    for step in far:
        # behind the last joint of a branch
        way = list(_pieces_before(step, by_name))
        beside[step.name].add(by_name[way[-1] if way else step.name].before)

    def parallel(name: str, along: float) -> bool:
        others = {one for pair in pairs if name in pair for one in pair} - {name}
        sines = (np.linalg.norm(np.cross(axes[name], axes[other])) for other in others & axes.keys())
        return any(along * sine <= LONGEST_MM for sine in sines)

    def leads_along(step: PlacedPiece) -> bool:
        shift = turns[step.before] @ step.frame[:3, 3]
        for name in beside[step.name] & axes.keys():
            along = float(axes[name] @ shift)
            if np.linalg.norm(shift - along * axes[name]) <= LONGEST_MM and parallel(name, abs(along)):
                return True
        return False

    return [(step.name, float(np.linalg.norm(step.frame[:3, 3]))) for step in far if not leads_along(step)]


def _pieces_before(step: PlacedPiece, by_name: dict[str, PlacedPiece]) -> Iterator[str]:
    """Names of the rigid pieces between a step and the joint before it, the nearest first."""
    while step.before and not by_name[step.before].moves:
        step = by_name[step.before]
        yield step.name


SYMMETRY = 1e-6
"""Largest difference of mirrored entries over √(c_ii c_jj): both are typed, or printed by a finite element
program to some seven digits, so anything larger is a misprint and not rounding."""

DEFINITE = 1e-9
"""Smallest eigenvalue of a compliance scaled to a unit diagonal. Below it the matrix is singular to the
digits that a file carries, and its inverse, the stiffness, is noise."""

SMALLEST = 1e-30
"""Of a compliance's diagonal: less is no number that a part has (1 mm of 1 m² of steel: 1e-16 rad/(N mm))."""

FACTOR = 30.0
"""Between a given compliance and beam theory. The wrong unit is off by 1000; the shape of a real part is not
off by 30, or it is no beam."""

METRES = 1e-5
"""Smallest plausible translation over rotation times length², as squares sum. About 0.1 for a beam, 1e-3 for
one of a soft open section; a matrix in m, N and rad has 1e-7."""

SLENDEREST = 2e4
"""Length over radius of gyration: a foil of 0.1 mm has 1e4 over 300 mm; an EI in N m² gives a bar 5e4."""

SWAPPED = 0.3
"""Root mean square of the logarithms of matrix over section from which on they differ: 35 %."""

EXCHANGED = (
    "the matrix fits the section with EIy_Nmm2 and EIz_Nmm2 exchanged, not as they stand (bending about y "
    "deflects along z): are they swapped?"
)

_UNITS = "mm/N, 1/N and rad/(N mm)"


def checked_compliance(matrix: Array) -> Array:
    """A compliance ``(6, 6)``, made exactly symmetric.

    Raises:
        ValueError: not symmetric or not positive definite; the text goes on after the word 'compliance'.
    """
    for i in range(6):
        if matrix[i, i] <= SMALLEST:
            raise ValueError(
                f"has ({i + 1},{i + 1}) = {printed(matrix[i, i])} on its diagonal: it must be above 0, "
                "as a load moves its point its own way"
            )
    # unit diagonal: entries of different units become comparable
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    scaled = matrix / scale
    skewness = np.abs(scaled - scaled.T)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(skewness), (6, 6)))
    if skewness[i, j] > SYMMETRY:
        raise ValueError(
            f"is not symmetric: ({i + 1},{j + 1}) = {printed(matrix[i, j])} "
            f"but ({j + 1},{i + 1}) = {printed(matrix[j, i])}; make them equal"
        )
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    if values[0] < DEFINITE:
        raise ValueError(
            f"is not positive definite: its smallest eigenvalue, scaled to a unit diagonal, is "
            f"{printed(float(values[0]), 3)}; {_culprit(matrix, scaled, vectors[:, 0])}"
        )
    return 0.5 * (matrix + matrix.T)


def checked_part_compliance(matrix: Array) -> Array:
    """A part's or a joint's compliance ``(6, 6)``, whose rigid directions have zeros in their row and column.

    Raises:
        ValueError: as `checked_compliance`, of what is not zero.
    """
    gives = matrix.any(axis=0) | matrix.any(axis=1)
    if not gives.any():
        raise ValueError("is zero: leave it out, or write a rigid part as an offset")
    filled = matrix.copy()
    # rigid directions are made regular and uncoupled, to be judged with the others
    filled[~gives, ~gives] = np.abs(np.diag(matrix)).max()
    return np.where(np.outer(gives, gives), checked_compliance(filled), 0.0)


def _culprit(matrix: Array, scaled: Array, vector: Array) -> str:
    """Which entries make a matrix indefinite: a pair above its diagonal, or the rows of the bad mode."""
    coupling = np.abs(scaled - np.diag(np.diag(scaled)))
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(coupling), (6, 6)))
    if coupling[i, j] >= 1.0 - DEFINITE:
        limit = float(np.sqrt(matrix[i, i] * matrix[j, j]))
        return (
            f"({i + 1},{j + 1}) = {printed(matrix[i, j])} must stay below {printed(limit)} in size, "
            f"√(({i + 1},{i + 1})·({j + 1},{j + 1}))"
        )
    rows = [str(k + 1) for k in range(6) if abs(vector[k]) > 0.2]
    return f"check the entries among rows {', '.join(rows)}"


def check_compliance_units(beam: Beam) -> None:
    """Refuse a compliance whose translations and rotations cannot be in mm, N and rad.

    Raises:
        ValueError: naming the sums that do not fit.
    """
    assert beam.compliance is not None
    diagonal = np.diag(beam.compliance)
    if not diagonal.all():
        return  # some directions are rigid: the others need not be a beam's
    reach = max(beam.length, float(np.linalg.norm(beam.tip)))
    translation, rotation = float(np.sum(diagonal[:3])), float(np.sum(diagonal[3:])) * reach**2
    if translation < METRES * rotation:
        raise ValueError(
            f"compliance sums to {printed(translation, 3)} over its first three diagonal entries, but its "
            f"rotations over {printed(reach)} mm make {printed(rotation, 3)}: is it in metres? Give {_UNITS}"
        )


def check_section_units(section: Section, length: float) -> None:
    """Refuse a section that no beam of this length has.

    Raises:
        ValueError: the radius of gyration does not suit the length, or torsion does not suit bending.
    """
    for axis, EI in (("y", section.EIy), ("z", section.EIz)):
        gyration = float(np.sqrt(EI / section.EA))
        what = f"section has a radius of gyration √(EI{axis}/EA) of {printed(gyration, 3)} mm"
        if gyration * SLENDEREST < length:
            raise ValueError(
                f"{what}, less than 1/{SLENDEREST:.0f} of length_mm = {printed(length)}: is EI in N m²? "
                "Give mm, N and N mm²"
            )
    ratio = section.GJ / (section.EIy + section.EIz)
    # GJ ≤ E(Iy + Iz)/2 for every isotropic material that narrows when pulled
    if ratio > FACTOR:
        raise ValueError(
            f"section has GJ = {printed(section.GJ)}, {printed(ratio, 2)} times EIy + EIz, where "
            "an isotropic beam has at most half of it: is the unit right? Give N mm²"
        )


def bending_apart(given: Array, theory: Array) -> float:
    """Root mean square of the logarithms of two compliances' ``(6, 6)`` four bending entries on the diagonal."""
    ratio = np.diag(given)[[1, 2, 4, 5]] / np.diag(theory)[[1, 2, 4, 5]]
    return float(np.sqrt(np.mean(np.log(ratio) ** 2)))


def fits_exchanged(beam: Beam) -> bool:
    """Whether a part's compliance fits its section far better with the two bending stiffnesses exchanged."""
    s = beam.section
    assert s is not None
    own = bending_apart(beam.tip_compliance(), beam.beam_compliance())
    turned = replace(beam, section=replace(s, EIy=s.EIz, EIz=s.EIy, GAy=s.GAz, GAz=s.GAy))
    return own > SWAPPED and bending_apart(beam.tip_compliance(), turned.beam_compliance()) < 0.5 * own


def check_against_section(beam: Beam) -> None:
    """Refuse a compliance that is far from the same part's section by beam theory.

    Raises:
        ValueError: naming the entry, 1-based, with both values.
    """
    given = beam.tip_compliance() * beam.count
    theory = beam.beam_compliance() * beam.count
    scale = np.sqrt(np.outer(np.diag(theory), np.diag(theory)))
    for i in range(6):
        for j in [i, *range(i)]:
            # couplings that are small in beam theory are small differences or absent in the real part
            if abs(theory[i, j]) < 0.3 * scale[i, j]:
                continue
            name = f"({min(i, j) + 1},{max(i, j) + 1})"
            values = f"compliance {name} = {printed(given[i, j])} but the section gives {printed(theory[i, j])}"
            ratio = abs(given[i, j] / theory[i, j])
            if not 1.0 / FACTOR < ratio < FACTOR:
                if fits_exchanged(beam):
                    raise ValueError(f"{values}: {EXCHANGED}")
                times = f"{printed(ratio, 2)} times" if ratio else "nothing of"
                raise ValueError(f"{values}, so it is {times} beam theory: is the unit right ({_UNITS})?")
            if given[i, j] * theory[i, j] < 0.0:
                raise ValueError(f"{values}, of the other sign: do both use the part's own axes?")


def check_postures(chain: Machine) -> None:
    """Refuse a posture in which the passive joints do not move the tool independently.

    There ``J_q`` loses rank, the paper's matrix in (18) is singular, and a joint can turn with the tool held.

    Raises:
        ValueError: naming the posture and the joints.
    """
    names = [joint.name for joint in chain.joints]
    if not names:
        return
    if chain.is_tree:
        return  # a tree is judged where its equilibrium is sought
    # a bow asks for more springs than one, and moves no joint
    straight = tuple(replace(part, bow=(0.0, 0.0)) if isinstance(part, Beam) else part for part in chain.parts)
    for label, q in chain.postures.items():
        model = Mechanism(replace(chain, parts=straight).at(label))
        J = model.kinematics(model.configuration(q)).jacobian[:, model.passive].copy()
        J[:3] /= chain.characteristic_length
        together = null_space(J)
        if not together.shape[1]:
            continue
        for i in range(len(names)):
            for j in range(i):
                if rank_of(J[:, [j, i]]).rank < 2:
                    raise ValueError(
                        f"posture '{label}': joints {names[j]} and {names[i]} turn about the same line: "
                        "the chain folds; change the posture or leave one joint out"
                    )
        moving = [name for name, rate in zip(names, together[:, -1], strict=True) if abs(rate) > NEGLIGIBLE]
        raise ValueError(
            f"posture '{label}': joints {', '.join(moving)} can turn together with the tool held: "
            "the chain is not determined; change the posture or leave one joint out"
        )
