"""The beam-column spring of `vjm.springs`, compiled."""

from __future__ import annotations

import numpy as np

from vjm.compilation import kernel
from vjm.kernels import Floats
from vjm.springs import ROTATION, SHIFT

_RA, _RB, _RC, _RE = ROTATION
_SA, _SB, _SC, _SE = SHIFT


@kernel
def _bounded(z: float, z1: float, z2: float, a: float, b: float, c: float, e: float) -> tuple[float, float, float]:
    """`vjm.springs._bounded`."""
    root = np.sqrt(1.0 + z * z * (a + z * (b + z * c)))
    half = 0.5 * z * (2.0 * a + z * (3.0 * b + 4.0 * c * z)) / root
    curvature = (a + z * (3.0 * b + 6.0 * c * z) - half * half) / root
    slope = half + e
    return root + e * z, slope * z1, curvature * z1 * z1 + slope * z2


@kernel
def _plane(N: float, EA: float, EI: float, h: float) -> tuple[float, float, float, float, float, float]:
    """Rotational and bending part of the transverse compliance of one plane, with two derivatives by N."""
    kappa = h * h / (4.0 * EI)
    stretch = 1.0 + N / EA
    z, z1, z2 = -kappa * N * stretch, -kappa * (1.0 + 2.0 * N / EA), -2.0 * kappa / EA
    q, q1, q2 = 1.0 + z * N / EA, (z1 * N + z) / EA, (z2 * N + 2.0 * z1) / EA
    f, f1, f2 = _bounded(z, z1, z2, _RA, _RB, _RC, _RE)
    g, g1, g2 = _bounded(z, z1, z2, _SA, _SB, _SC, _SE)
    p, p1, p2 = stretch * stretch, 2.0 * stretch / EA, 2.0 / (EA * EA)
    c, d = h / EI, h**3 / (12.0 * EI)
    return (
        c * f * q,
        c * (f1 * q + f * q1),
        c * (f2 * q + 2.0 * f1 * q1 + f * q2),
        d * g * p,
        d * (g1 * p + g * p1),
        d * (g2 * p + 2.0 * g1 * p1 + g * p2),
    )


@kernel
def beam_column(beam: Floats, t: Floats, theta: Floats, K: Floats, r: Floats) -> None:
    """Tangent stiffness ``K`` (6, 6) under reactions ``t`` (6,) and residual ``r = K (θ(t) − θ)``.

    The tangent compliance is diagonal but for the row of the axial force, so its inverse is explicit.
    """
    EA, GJ, EIy, EIz, h = beam[0], beam[1], beam[2], beam[3], beam[4]
    N, Qy, Qz, My, Mz = t[0], t[1], t[2], t[4], t[5]
    cz, cz1, cz2, dy, dy1, dy2 = _plane(N, EA, EIz, h)
    cy, cy1, cy2, dz, dz1, dz2 = _plane(N, EA, EIy, h)
    dy += beam[5]
    dz += beam[6]
    axial = h / EA + 0.5 * (cz2 * Mz * Mz + dy2 * Qy * Qy + cy2 * My * My + dz2 * Qz * Qz)
    # compliances 1 to 5 and their coupling to the axial one
    k1, k2, k3, k4, k5 = dy, dz, h / GJ, cy, cz
    b1, b2, b4, b5 = dy1 * Qy, dz1 * Qz, cy1 * My, cz1 * Mz
    s = axial - b1 * b1 / k1 - b2 * b2 / k2 - b4 * b4 / k4 - b5 * b5 / k5
    for i in range(6):
        for j in range(6):
            K[i, j] = 0.0
    g1, g2, g4, g5 = b1 / k1, b2 / k2, b4 / k4, b5 / k5
    K[0, 0] = 1.0 / s
    K[0, 1] = K[1, 0] = -g1 / s
    K[0, 2] = K[2, 0] = -g2 / s
    K[0, 4] = K[4, 0] = -g4 / s
    K[0, 5] = K[5, 0] = -g5 / s
    K[1, 1], K[2, 2], K[3, 3] = 1.0 / k1 + g1 * g1 / s, 1.0 / k2 + g2 * g2 / s, 1.0 / k3
    K[4, 4], K[5, 5] = 1.0 / k4 + g4 * g4 / s, 1.0 / k5 + g5 * g5 / s
    K[1, 2] = K[2, 1] = g1 * g2 / s
    K[1, 4] = K[4, 1] = g1 * g4 / s
    K[1, 5] = K[5, 1] = g1 * g5 / s
    K[2, 4] = K[4, 2] = g2 * g4 / s
    K[2, 5] = K[5, 2] = g2 * g5 / s
    K[4, 5] = K[5, 4] = g4 * g5 / s
    bow = 0.5 * (cz1 * Mz * Mz + dy1 * Qy * Qy + cy1 * My * My + dz1 * Qz * Qz)
    e0 = h * N / EA + bow - theta[0]
    e1, e2, e3 = dy * Qy - theta[1], dz * Qz - theta[2], h / GJ * t[3] - theta[3]
    e4, e5 = cy * My - theta[4], cz * Mz - theta[5]
    for i in range(6):
        r[i] = K[i, 0] * e0 + K[i, 1] * e1 + K[i, 2] * e2 + K[i, 3] * e3 + K[i, 4] * e4 + K[i, 5] * e5
