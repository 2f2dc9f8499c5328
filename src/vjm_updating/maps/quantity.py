"""What a map asks, and the names and titles of its columns."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical, shown

NO_COMPLIANCE = numerical(1e-12)
"""Over the largest of a block: compliance that is none. Between that of a soft drive and of a stiff bearing lie
seven decades, and rounding is four below these."""
OK, LOST, UNSTABLE = "ok", "no equilibrium under these loads", "the equilibrium is unstable"


class MapQuantity(StrEnum):
    """What is mapped."""

    STIFFNESS = "stiffness"
    """Smallest and largest stiffness against a force, the platform free to turn, and against a moment, free to
    shift: over the eigenvalues of the two blocks of K⁻¹. Under the wrench, if one is given."""
    CRITICAL = "critical"
    """The smallest force, over all directions, at which the free platform loses its stability."""
    DEFLECTION = "deflection"
    """The platform's displacement under the wrench."""
    FREQUENCY = "frequency"
    """The lowest natural frequency about the loaded equilibrium."""
    SHARES = "shares"
    """The largest share of a part in the linear strain energy under the loads, and which part that is."""


COLUMNS: dict[MapQuantity, tuple[str, ...]] = {
    MapQuantity.STIFFNESS: ("kt_min_N_per_mm", "kt_max_N_per_mm", "kr_min_Nmm_per_rad", "kr_max_Nmm_per_rad"),
    MapQuantity.CRITICAL: ("F_cr_N", "direction_x", "direction_y", "direction_z"),
    MapQuantity.DEFLECTION: ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad", "u_mm"),
    MapQuantity.FREQUENCY: ("f1_Hz",),
    MapQuantity.SHARES: ("largest_share",),
}
NAMES = ("part", "kind")
"""Columns of text behind those of `MapQuantity.SHARES`."""
SHOWN = shown({
    MapQuantity.STIFFNESS: 0, MapQuantity.CRITICAL: 0, MapQuantity.DEFLECTION: 6, MapQuantity.FREQUENCY: 0,
    MapQuantity.SHARES: 0,
})  # fmt: skip
"""The column that the pictures show."""
TITLES = {
    MapQuantity.STIFFNESS: "smallest stiffness against a force, N/mm",
    MapQuantity.CRITICAL: "smallest critical force, N",
    MapQuantity.DEFLECTION: "deflection, mm",
    MapQuantity.FREQUENCY: "lowest natural frequency, Hz",
    MapQuantity.SHARES: "largest share in the strain energy",
}


def lost_by(error: NoConvergenceError) -> str:
    """Why there is no answer at a point whose path from no load did not lead to a stable equilibrium."""
    return UNSTABLE if "unstable" in str(error) else LOST


def principal(C: Array) -> Array:
    """Smallest and largest stiffness against forces (N/mm) and moments (N mm/rad) ``(g, 4)``.

    Infinite in a direction in which nothing moves.

    Args:
        C: compliances ``(g, 6, 6)``.
    """
    rows = []
    for part in (slice(0, 3), slice(3, 6)):
        block = C[:, part, part]
        values = np.linalg.eigvalsh(0.5 * (block + np.swapaxes(block, 1, 2)))
        with np.errstate(divide="ignore"):
            least = np.where(values[:, 0] > NO_COMPLIANCE * values[:, 2], values[:, 0], 0.0)
            rows += [1.0 / values[:, 2], 1.0 / least]
    return np.stack(rows, axis=1)


def moved(displacements: Array) -> Array:
    """Displacements ``(g, 6)`` and the sizes of their shifts ``(g, 7)``."""
    return np.column_stack([displacements, np.linalg.norm(displacements[:, :3], axis=1)])
