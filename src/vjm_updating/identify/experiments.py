"""Virtual experiments: a body's 6×6 compliance from nonlinear finite element solutions at finite loads.

Forces and moments of both signs act on the tip, one at a time, in two sizes. The odd part of the answer loses what
is quadratic in the load; the two sizes show what is cubic, and take it out. Three meshes take out what the mesh
does. Whatever is taken out counts as uncertainty, or a bound on it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.identify.specimens import POSTURE, Specimen

if TYPE_CHECKING:
    from vjm_fea.exudyn.problem import ExudynProblem

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
