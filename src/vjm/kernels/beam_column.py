"""The beam-column spring of `vjm.model.springs.BeamColumnSpring`."""

from __future__ import annotations

import numpy as np

from vjm.kernels.arrays import Floats
from vjm.kernels.compilation import entry, kernel

# Coefficients (a, b, c, e) from the Taylor series of φ and ψ about z = 0, with 1 + e z + f₂ z² + f₃ z³ + f₄ z⁴:
# a = 2 f₂, b = 2 f₃, c = 2 f₄ + a²/4. √z cot √z = 1 − z/3 − z²/45 − 2z³/945 − z⁴/4725 − 2z⁵/93555.
_RA, _RB, _RC, _RE = 14 / 15, -68 / 105, 9467 / 14175, -2 / 3
_SA, _SB, _SC, _SE = 34 / 105, 124 / 945, 5777 / 72765, 2 / 5
NEARLY_UNLOADED = 0.02
"""−z up to which the root form of ψ is used in tension too: it is as near as 1e-10, and free of 0/0."""


@kernel
def _rooted(z: float, z1: float, z2: float, a: float, b: float, c: float, e: float) -> tuple[float, float, float]:
    """``√(1 + a z² + b z³ + c z⁴) + e z`` and its derivatives by a variable by which z has z1 and z2."""
    root = np.sqrt(1.0 + z * z * (a + z * (b + z * c)))
    half = 0.5 * z * (2.0 * a + z * (3.0 * b + 4.0 * c * z)) / root
    curvature = (a + z * (3.0 * b + 6.0 * c * z) - half * half) / root
    slope = half + e
    return root + e * z, slope * z1, curvature * z1 * z1 + slope * z2


@kernel
def _shift(z: float, z1: float, z2: float) -> tuple[float, float, float]:
    """ψ and its derivatives by a variable by which z has the derivatives z1 and z2."""
    if z >= -NEARLY_UNLOADED:
        return _rooted(z, z1, z2, _SA, _SB, _SC, _SE)
    root = np.sqrt(-z)
    G = root / np.tanh(root)
    G1 = (G - z - G * G) / (2.0 * z)
    G2 = -(G1 + 1.0 + 2.0 * G * G1) / (2.0 * z)
    f = 3.0 * (1.0 / G - 1.0) / z
    f1 = (-3.0 * G1 / (G * G) - f) / z
    f2 = (3.0 * (2.0 * G1 * G1 / (G * G * G) - G2 / (G * G)) - 2.0 * f1) / z
    return f, f1 * z1, f2 * z1 * z1 + f1 * z2


@kernel
def _plane(
    N: float, EA: float, EI: float, h: float, slip: float
) -> tuple[float, float, float, float, float, float]:
    """Rotational and transverse compliance of one plane, each with two derivatives by N; ``slip`` is h/GA."""
    kappa, nu = h * h / (4.0 * EI), 1.0 / EA - slip / h
    stretch = 1.0 + nu * N
    z, z1, z2 = -kappa * N * stretch, -kappa * (1.0 + 2.0 * nu * N), -2.0 * kappa * nu
    f, f1, f2 = _rooted(z, z1, z2, _RA, _RB, _RC, _RE)
    g, g1, g2 = _shift(z, z1, z2)
    # 1/c = EI/h (1/φ + η)
    k = 1.0 / f + kappa * nu * N * N
    k1 = -f1 / (f * f) + 2.0 * kappa * nu * N
    k2 = -f2 / (f * f) + 2.0 * f1 * f1 / (f * f * f) + 2.0 * kappa * nu
    p, p1, p2 = stretch * stretch, 2.0 * nu * stretch, 2.0 * nu * nu
    c, d = h / EI, h**3 / (12.0 * EI)
    return (
        c / k,
        -c * k1 / (k * k),
        c * (2.0 * k1 * k1 / (k * k * k) - k2 / (k * k)),
        d * g * p + slip,
        d * (g1 * p + g * p1),
        d * (g2 * p + 2.0 * g1 * p1 + g * p2),
    )


@entry
def planes(N: Floats, EA: float, EI: float, h: float, slip: float, out: Floats) -> None:
    """Write ``out`` (k, 6), see `_plane`, of axial forces ``N`` (k,)."""
    for i in range(len(N)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = _plane(N[i], EA, EI, h, slip)


@kernel
def beam_column(beam: Floats, t: Floats, theta: Floats, K: Floats, r: Floats) -> None:
    """Tangent stiffness ``K`` (6, 6) under reactions ``t`` (6,) and residual ``r = K (θ(t) − θ)``.

    The tangent compliance is diagonal but for the row of the axial force, so its inverse is explicit.
    """
    EA, GJ, EIy, EIz, h = beam[0], beam[1], beam[2], beam[3], beam[4]
    N, Qy, Qz, My, Mz = t[0], t[1], t[2], t[4], t[5]
    cz, cz1, cz2, dy, dy1, dy2 = _plane(N, EA, EIz, h, beam[5])
    cy, cy1, cy2, dz, dz1, dz2 = _plane(N, EA, EIy, h, beam[6])
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


@kernel
def _plane_by_length(N: float, EA: float, EI: float, h: float, slip: float) -> tuple[float, float, float, float]:
    """Derivatives by h of `_plane`'s rotational and transverse compliance, and of their derivatives by N."""
    kappa, nu = h * h / (4.0 * EI), 1.0 / EA - slip / h
    stretch = 1.0 + nu * N
    z, zN = -kappa * N * stretch, -kappa * (1.0 + 2.0 * nu * N)
    zh, zNh = 2.0 * z / h, 2.0 * zN / h
    f, f1, f2 = _rooted(z, 1.0, 0.0, _RA, _RB, _RC, _RE)
    g, g1, g2 = _shift(z, 1.0, 0.0)
    k = 1.0 / f + kappa * nu * N * N
    kN = -f1 * zN / (f * f) + 2.0 * kappa * nu * N
    kh = -f1 * zh / (f * f) + 2.0 * kappa * nu * N * N / h
    kNh = 2.0 * f1 * f1 * zN * zh / (f * f * f) - (f2 * zN * zh + f1 * zNh) / (f * f) + 4.0 * kappa * nu * N / h
    p, pN = stretch * stretch, 2.0 * nu * stretch
    c, d = h / EI, h**3 / (12.0 * EI)
    return (
        c / (h * k) - c * kh / (k * k),
        -c * kN / (h * k * k) - c * (kNh / (k * k) - 2.0 * kN * kh / (k * k * k)),
        3.0 * d / h * g * p + d * g1 * zh * p + slip / h,
        3.0 * d / h * (g1 * zN * p + g * pN) + d * (g2 * zN * zh * p + g1 * zNh * p + g1 * zh * pN),
    )


@kernel
def beam_column_by_length(beam: Floats, t: Floats, r: Floats) -> None:
    """What a unit of the length adds to the residual before it is multiplied by K: ``r = ∂θ/∂h`` (6,) at ``t``."""
    EA, GJ, EIy, EIz, h = beam[0], beam[1], beam[2], beam[3], beam[4]
    N, Qy, Qz, My, Mz = t[0], t[1], t[2], t[4], t[5]
    cz, czN, dy, dyN = _plane_by_length(N, EA, EIz, h, beam[5])
    cy, cyN, dz, dzN = _plane_by_length(N, EA, EIy, h, beam[6])
    r[0] = N / EA + 0.5 * (czN * Mz * Mz + dyN * Qy * Qy + cyN * My * My + dzN * Qz * Qz)
    r[1], r[2], r[3], r[4], r[5] = dy * Qy, dz * Qz, t[3] / GJ, cy * My, cz * Mz
