"""Virtual experiments: a body's 6×6 compliance from nonlinear finite element solutions at finite loads.

Forces and moments of both signs act on the tip, one at a time, in two sizes. The odd part of the answer loses what
is quadratic in the load; the two sizes show what is cubic, and take it out. Three meshes take out what the mesh
does. Whatever is taken out counts as uncertainty, or a bound on it does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, assert_never

import numpy as np

from vjm.io.errors import did_you_mean
from vjm.model.joints import Joint
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part, RigidOffset
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance, translation
from vjm_updating.constants import numerical

if TYPE_CHECKING:
    from vjm_fea.exudyn.problem import ExudynProblem


# --- What virtual experiments are made on: parts of a chain between passive joints, taken out and clamped ---------

BETWEEN = ".."
"""Stands between the first and the last part of a range."""
POSTURE = "-"
"""Label of the only posture of a chain without joints."""


@dataclass(frozen=True)
class Specimen:
    """An elastic body between a clamped root and a loaded tip.

    Attributes:
        name: of the part or range.
        axes: in words, those of the compliance.
        meshed: the body and the number of elements for each of its beams, at refinement n.
        theory: its compliance ``(6, 6)`` by linear beam theory.
        given: the compliance ``(6, 6)`` that the model file states, where it does.
    """

    name: str
    axes: str
    meshed: Callable[[int], tuple[Machine, int]]
    theory: Array
    given: Array | None = None


def part_specimen(chain: Machine, name: str) -> Specimen:
    """One part, or the parts ``first..last``, of a chain.

    One beam is taken alone, as one member, in its own axes, as the model file states its compliance. A range is
    taken whole, with all members, in the axes of the chain frame at its root.

    Raises:
        ValueError: no such part, nothing elastic in it, a passive joint inside, or a beam without a section.
    """
    first, _, last = name.partition(BETWEEN)
    names = [part.name for part in chain.parts]
    for one in (first, last or first):
        if one not in names:
            raise ValueError(
                f"--part: {chain.name} has no part '{one}' (it has {', '.join(names)}){did_you_mean(one, names)}"
            )
    start, end = names.index(first), names.index(last or first)
    if end < start:
        raise ValueError(f"--part: '{last}' comes before '{first}' in {chain.name}: write {last}{BETWEEN}{first}")
    parts = chain.parts[start : end + 1]
    if len(parts) == 1 and isinstance(parts[0], Beam):
        member = replace(parts[0], own_frame=np.eye(3), count=1)
        body = _alone(name, (member,))
        return Specimen(name, "the part's own", _same(body), member.beam_compliance(), member.compliance)
    _check_range(name, parts)
    body = _alone(name, parts)
    return Specimen(name, f"chain frame at the root of '{first}'", _same(body), series_compliance(body))


def series_compliance(chain: Machine) -> Array:
    """Compliance ``(6, 6)`` at the tip of beams, offsets and drives in series, base axes, by linear beam theory.

    Raises:
        ValueError: a beam without a section, or a joint, which has a coordinate or moves freely.
    """
    frames, T = [], chain.base
    for part in chain.parts:
        frames.append(T)
        match part:
            case RigidOffset():
                T = T @ part.transform
            case Beam():
                T = T @ translation(part.tip)
            case Joint(free=True):
                raise ValueError(f"part '{part.name}' is a passive joint: it moves freely")
            case Joint(fixed=False):
                raise ValueError(f"part '{part.name}' is a joint with a coordinate: name the beams beside it alone")
            case Joint():
                pass
            case _:
                assert_never(part)
    C = np.zeros((6, 6))
    for part, at in zip(chain.parts, frames, strict=True):
        R, p = at[:3, :3], at[:3, 3]
        if isinstance(part, Beam):
            own = rotate_matrix6(part.beam_compliance(), R @ part.own_frame)
            C += shift_compliance(own, T[:3, 3] - p - R @ part.tip)
        elif isinstance(part, Joint):
            axis = R @ part.axis
            moves = np.append(axis, np.zeros(3))
            if not part.slides:
                moves = np.append(np.cross(axis, T[:3, 3] - p), axis)
            C += part.compliance * np.outer(moves, moves)
    return C


def _check_range(name: str, parts: tuple[Part, ...]) -> None:
    joints = [part.name for part in parts if isinstance(part, Joint) and part.free]
    if joints:
        raise ValueError(
            f"--part {name}: '{joints[0]}' is a passive joint, which moves freely: take parts between joints"
        )
    if not any(isinstance(part, Beam) for part in parts):
        raise ValueError(f"--part {name}: nothing in it is a beam: it deflects in no direction that can be meshed")


def _alone(name: str, parts: tuple[Part, ...]) -> Machine:
    for part in parts:
        if isinstance(part, Beam):
            part.effective_section()
    return Machine(name, parts, base=frame(), postures={POSTURE: np.zeros(0)})


def _same(body: Machine) -> Callable[[int], tuple[Machine, int]]:
    return lambda n: (body, n)


MESHES = numerical((4, 8, 16))
"""Refinements, each twice the one before."""
TURN = numerical(4e-3)
"""Rad, about: no load turns the tip by more, and an axial one is 1/600 of what would buckle a cantilever."""
CORRECTIONS = numerical(6)
"""Newton steps from the linear answer to the pose at which the tip carries the wanted wrench."""
AGREED = numerical(1e-10)
"""Correction of a pose, relative to its size, at which the wrench counts as the wanted one."""
POLISHES = numerical(2)
"""Chord steps behind each solution, each of which takes off what it finds but for some `TURN` of it."""
NOISE = numerical(1e-7)
"""Scaled change of the compliance from mesh to mesh below which no order can be observed."""
NEAR_ORDER = numerical(0.3)
"""How far from a whole number an observed order may be."""


@dataclass(frozen=True)
class ComplianceMeasurement:
    """A compliance with what is known of its errors.

    Scaled means entry over √(c_ii c_jj), which makes shifts and turns comparable.

    Attributes:
        compliance: ``(6, 6)``, symmetric, mm, N, rad.
        uncertainty: ``(6, 6)`` of every entry, the sum of the three below.
        linearity: ``(6, 6)`` what the second size of load took out.
        discretisation: ``(6, 6)`` what is open after the extrapolation over the meshes.
        rounding: ``(6, 6)`` from the largest scaled asymmetry.
        asymmetry: largest scaled difference of mirrored entries that was removed.
        order: observed order of convergence; None where the meshes agree to rounding, or too irregularly.
        extrapolated: whether the order was used to extrapolate.
        smallest_eigenvalue: of the scaled compliance; above zero, or the measurement is no compliance.
        loads: size ``(6,)`` of the larger loads, N and N mm.
    """

    compliance: Array
    uncertainty: Array
    linearity: Array
    discretisation: Array
    rounding: Array
    asymmetry: float
    order: float | None
    extrapolated: bool
    smallest_eigenvalue: float
    loads: Array


def measure(
    specimen: Specimen, meshes: tuple[int, int, int] = MESHES, *, corrected: bool = True
) -> ComplianceMeasurement:
    """Compliance of a body at its tip, with the uncertainty of every entry.

    Args:
        specimen: the body.
        meshes: three refinements, each twice the one before.
        corrected: the finite element's residual-flexibility correction, see `vjm_fea.common.mesh.Mesh`.

    Raises:
        NoConvergenceError: a solution at finite load was not found.
        ValueError: a beam that cannot be meshed.
    """
    sizes = _sizes(specimen.theory)
    found = [_on_mesh(specimen, n, sizes, corrected) for n in meshes]
    coarse, middle, fine = (C for C, _ in found)
    linearity = np.abs(found[-1][1])
    scale = np.sqrt(np.outer(np.diag(fine), np.diag(fine)))
    order, C, discretisation = _extrapolated([coarse, middle, fine], scale)
    skew = 0.5 * np.abs(C - C.T)
    asymmetry = 2.0 * float(np.max(skew / scale))
    C = 0.5 * (C + C.T)
    rounding = 0.5 * asymmetry * scale
    linearity, discretisation = (np.maximum(part, part.T) for part in (linearity, discretisation))
    return ComplianceMeasurement(
        compliance=C,
        uncertainty=linearity + discretisation + rounding,
        linearity=linearity,
        discretisation=discretisation,
        rounding=rounding,
        asymmetry=asymmetry,
        order=order,
        extrapolated=_whole(order) is not None,
        smallest_eigenvalue=float(np.linalg.eigvalsh(C / scale)[0]),
        loads=sizes,
    )


def _sizes(compliance: Array) -> Array:
    """Size ``(6,)`` of the loads, N and N mm: the most compliant turn by `TURN`, at an arm that suits the body."""
    most_compliant = float(np.linalg.eigvalsh(compliance[3:, 3:])[-1])
    # a cantilever's length over √3; a force at the whole length then turns the tip by less than a moment does
    arm = float(np.sqrt(np.linalg.eigvalsh(compliance[:3, :3])[-1] / most_compliant))
    return TURN / most_compliant / np.repeat([np.sqrt(3.0) * arm, 1.0], 3)


def _on_mesh(specimen: Specimen, n: int, sizes: Array, corrected: bool) -> tuple[Array, Array]:
    """Compliance ``(6, 6)``, column by column, and the cubic part that was taken out of it."""
    # Exudyn is an extra, which solids and matrices do not need
    from vjm_fea.exudyn.engine import ExudynEngine

    chain, elements = specimen.meshed(n)
    engine = ExudynEngine(elements=elements, shear=True, corrected=corrected)
    bench = _Bench(engine.problem(chain, LoadCase(POSTURE, 1.0)))
    whole, half = (
        np.column_stack([bench.odd_part(f * e) / f for f, e in zip(s, np.eye(6), strict=True)])
        for s in (sizes, 0.5 * sizes)
    )
    return (4.0 * half - whole) / 3.0, (whole - half) / 3.0


class _Bench:
    """A meshed body under imposed wrenches."""

    def __init__(self, problem: ExudynProblem) -> None:
        self.problem = problem
        self.unloaded = problem.unloaded()
        self.tangent = problem.statics.tangent(self.unloaded.state)
        self.guess = np.linalg.inv(np.asarray(self.unloaded.stiffness))

    def odd_part(self, wrench: Array) -> Array:
        """Half the difference ``(6,)`` of the displacements under a wrench and its opposite."""
        return 0.5 * (self.answer(wrench) - self.answer(-wrench))

    def answer(self, wrench: Array) -> Array:
        """Displacement ``(6,)`` of the tip under a wrench that keeps its direction.

        The finite elements impose the pose; it is corrected, with the unloaded compliance, until the reaction is
        the wanted wrench.
        """
        pose = correction = self.guess @ wrench
        here = self.unloaded
        for _ in range(CORRECTIONS):
            here = self.problem.solve_pose(pose, here)
            correction = self.guess @ (wrench - self._wrench(here.state))
            pose = pose + correction
            if np.max(np.abs(correction[:3])) <= AGREED * np.max(np.abs(pose[:3])) and np.max(
                np.abs(correction[3:])
            ) <= AGREED * np.max(np.abs(pose[3:])):
                break
        return pose

    def _wrench(self, state: Array) -> Array:
        """Wrench ``(6,)`` on the tip, once what the solver leaves of the residual is gone.

        Its tolerance suits loads near buckling; against loads as small as these it would show.
        """
        statics = self.problem.statics
        for _ in range(POLISHES):
            motion = np.zeros(len(statics.unit))
            motion[statics.free] = self.tangent.solve(-statics.residual(state)[statics.free])
            state = statics.moved(state, motion)
        return statics.wrench(state)


def _whole(order: float | None) -> int | None:
    """The whole number that an observed order means, where it means one."""
    if order is None or abs(order - round(order)) > NEAR_ORDER or round(order) not in (1, 2, 3, 4):
        return None
    return round(order)


def _extrapolated(C: list[Array], scale: Array) -> tuple[float | None, Array, Array]:
    """Observed order, the compliance for ever finer meshes, and a bound on its error."""
    first, second = C[1] - C[0], C[2] - C[1]
    small, large = (float(np.max(np.abs(d / scale))) for d in (second, first))
    order = float(np.log2(large / small)) if min(small, large) > NOISE else None
    p = _whole(order)
    if p is None:
        return order, C[2], np.abs(second)
    factor = 2.0**p - 1.0
    before, after = C[1] + first / factor, C[2] + second / factor
    # the next order's error in `after` is a fraction of this
    return order, after, np.abs(after - before)
