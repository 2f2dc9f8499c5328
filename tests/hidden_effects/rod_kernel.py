"""Kernels: elastic rods integrated along their length, and what is left over at the far end of a chain of two.

A chain is base, drive, foot, two crossing joints, link, two crossing joints. Given the wrench at the base and the
joints' angles everything follows by integration from the base (Kirchhoff's rod, extensible, with intrinsic strains;
S. S. Antman, Nonlinear Problems of Elasticity, 2nd ed., ch. 8):

    p' = R e₁ (1 + ε),   R' = R [κ]×,   n' = −w,   m' = −p' × n,   ε = ε₀ + φ N/EA,   κ = κ₀ + φ B⁻¹ Rᵀ m.

(n, m) is what the outer part exerts on the inner one. Ten unknowns, ten conditions: the pose of the end, and the
moments about the joints' axes. Since forces are unknowns, every element in series states its displacement outright.
Units N, mm, rad.
"""

from __future__ import annotations

import numpy as np

from vjm.kernels.compilation import kernel
from vjm.rotations import Array

# columns of a law in series: see `stretch`
LINEAR, STIFFENING, STIFFENING_FORCE, PLAY, PLAY_FORCE = 0, 1, 2, 3, 4
CONTACT, CONTACT_POWER, CONTACT_FORCE, PULL, PULL_FORCE = 5, 6, 7, 8, 9
SET, SET_FORCE, SET_POWER, SET_START, SET_NOW, SET_LARGEST, LAG, LAG_RATE = 10, 11, 12, 13, 14, 15, 16, 17
COLUMNS = 18
DRIVE, FOOT, LINK = 0, 1, 2
"""Rows of the laws: where an element sits."""
LENGTH, EA, GJ, EIY, EIZ, WEIGHT, FACTOR, FACTOR_PULL, FACTOR_FORCE, STEPS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
ROD = 10
"""Columns of a rod."""


@kernel
def cross(a: Array, b: Array) -> Array:
    """The cross product ``(3,)``."""
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@kernel
def turned_by(v: Array) -> Array:
    """Rotation matrix ``(3, 3)`` of a rotation vector ``(3,)``."""
    square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
    if square < 1e-12:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = b * v[i] * v[j]
        R[i, i] += 1.0 - b * square
    R[0, 1] -= a * v[2]
    R[1, 0] += a * v[2]
    R[0, 2] += a * v[1]
    R[2, 0] -= a * v[1]
    R[1, 2] -= a * v[0]
    R[2, 1] += a * v[0]
    return R


@kernel
def vector_of(R: Array) -> Array:
    """Rotation vector ``(3,)`` of a rotation well below half a turn."""
    v = np.empty(3)
    v[0], v[1], v[2] = 0.5 * (R[2, 1] - R[1, 2]), 0.5 * (R[0, 2] - R[2, 0]), 0.5 * (R[1, 0] - R[0, 1])
    sine = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    if sine > 1e-8:
        v *= np.arctan2(sine, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)) / sine
    return v


@kernel
def times(A: Array, B: Array) -> Array:
    """Product of two ``(3, 3)``."""
    C = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
    return C


@kernel
def on(A: Array, v: Array) -> Array:
    """``A v`` for ``(3, 3)`` and ``(3,)``."""
    w = np.empty(3)
    for i in range(3):
        w[i] = A[i, 0] * v[0] + A[i, 1] * v[1] + A[i, 2] * v[2]
    return w


@kernel
def back_on(A: Array, v: Array) -> Array:
    """``Aᵀ v``."""
    w = np.empty(3)
    for i in range(3):
        w[i] = A[0, i] * v[0] + A[1, i] * v[1] + A[2, i] * v[2]
    return w


@kernel
def stretch(force: float, law: Array) -> float:
    """Displacement of an element in series under a force, pull positive.

    A sum of: a linear spring; one that stiffens exponentially; play with a soft wall; contact whose displacement
    grows as a power of the force, or as its logarithm; a spring that is softer in pull than in push, with a soft
    change; a permanent set with gradual yield; what lags behind.
    """
    size, sign = abs(force), 1.0 if force >= 0.0 else -1.0
    u = law[LINEAR] * force
    if law[STIFFENING] != 0.0:
        f0 = law[STIFFENING_FORCE]
        u += sign * law[STIFFENING] * f0 * -np.expm1(-size / f0)
    if law[PLAY] != 0.0:
        u += 0.5 * law[PLAY] * np.tanh(force / law[PLAY_FORCE])
    if law[CONTACT] != 0.0:
        f0, p = law[CONTACT_FORCE], law[CONTACT_POWER]
        if p > 0.0:
            u += sign * law[CONTACT] * ((size + f0) ** p - f0**p) / 1000.0**p
        else:
            u += sign * law[CONTACT] * np.log1p(size / f0) / np.log1p(1000.0 / f0)
    if law[PULL] != 0.0:
        f0 = law[PULL_FORCE]
        u += law[PULL] * 0.5 * (force + np.sqrt(force**2 + f0**2) - f0)
    return u + law[LAG] + law[LAG_RATE] * force + permanent(force, law)


@kernel
def yielded(size: float, law: Array) -> float:
    """Permanent set ``law[SET] ((F − start)/F_y)^m`` of a first loading as far as a force."""
    over = (size - law[SET_START]) / law[SET_FORCE]
    return law[SET] * over ** law[SET_POWER] if over > 0.0 else 0.0


@kernel
def permanent(force: float, law: Array) -> float:
    """The set under a force: it grows where the force exceeds all before it, whatever its sign."""
    u = law[SET_NOW]
    if law[SET] != 0.0 and abs(force) > law[SET_LARGEST]:
        grown = yielded(abs(force), law) - yielded(law[SET_LARGEST], law)
        u += grown if force > 0.0 else -grown
    return u


@kernel
def integrated(p: Array, R: Array, n: Array, m: Array, rod: Array, down: Array, rate: float,
               strain: Array, loads: Array) -> Array:  # fmt: skip
    """March along a rod; ``p, n, m`` become those of its end in place.

    Args:
        p: position ``(3,)`` of the root.
        R: orientation ``(3, 3)`` there, the rod along the first axis.
        n: force ``(3,)``.
        m: moment ``(3,)``.
        rod: ``(ROD,)``.
        down: direction ``(3,)`` of the weight.
        rate: compliance that is added to one, of what answers late.
        strain: ``(2 k + 1, 4)`` intrinsic ε₀ and κ₀ at the ends and middles of the k steps.
        loads: the same shape; becomes N and Rᵀ m there.

    Returns:
        Orientation of the end.
    """
    steps = int(rod[STEPS])
    h = rod[LENGTH] / steps
    axial = n[0] * R[0, 0] + n[1] * R[1, 0] + n[2] * R[2, 0]
    soft = rod[FACTOR]
    if rod[FACTOR_PULL] != 0.0:
        soft *= 1.0 + rod[FACTOR_PULL] * 0.5 * (1.0 + np.tanh(axial / rod[FACTOR_FORCE]))
    soft += rate * rod[FACTOR]
    ca, ct = soft / rod[EA], soft / rod[GJ]
    cy, cz = soft / rod[EIY], soft / rod[EIZ]
    dp, dq, dm = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3))
    q, fn, mk, E, S = np.zeros(3), np.empty(3), np.empty(3), np.empty((3, 3)), R.copy()
    for i in range(steps):
        for k in range(4):
            # Munthe-Kaas: rotation vectors from the step's root, as exact to fourth order as the rest
            t = 0.0 if k == 0 else (1.0 if k == 3 else 0.5)
            before = max(k - 1, 0)
            node = 2 * i + (0 if k == 0 else (2 if k == 3 else 1))
            for j in range(3):
                q[j] = t * h * dq[before, j] if k > 0 else 0.0
                fn[j] = n[j] - down[j] * rod[WEIGHT] * t * h
                mk[j] = m[j] + t * h * dm[before, j]
            turn_by(R, q, E, S)
            nx = fn[0] * S[0, 0] + fn[1] * S[1, 0] + fn[2] * S[2, 0]
            m0 = mk[0] * S[0, 0] + mk[1] * S[1, 0] + mk[2] * S[2, 0]
            m1 = mk[0] * S[0, 1] + mk[1] * S[1, 1] + mk[2] * S[2, 1]
            m2 = mk[0] * S[0, 2] + mk[1] * S[1, 2] + mk[2] * S[2, 2]
            if k != 2:
                loads[node, 0], loads[node, 1], loads[node, 2], loads[node, 3] = nx, m0, m1, m2
            e = 1.0 + strain[node, 0] + ca * nx
            k0, k1, k2 = strain[node, 1] + ct * m0, strain[node, 2] + cy * m1, strain[node, 3] + cz * m2
            a0, a1, a2 = S[0, 0] * e, S[1, 0] * e, S[2, 0] * e
            dp[k, 0], dp[k, 1], dp[k, 2] = a0, a1, a2
            dm[k, 0], dm[k, 1], dm[k, 2] = a2 * fn[1] - a1 * fn[2], a0 * fn[2] - a2 * fn[0], a1 * fn[0] - a0 * fn[1]
            # inverse of the exponential's derivative: κ + q×κ/2 + q×(q×κ)/12, body axes
            w0, w1, w2 = q[1] * k2 - q[2] * k1, q[2] * k0 - q[0] * k2, q[0] * k1 - q[1] * k0
            dq[k, 0] = k0 + 0.5 * w0 + (q[1] * w2 - q[2] * w1) / 12.0
            dq[k, 1] = k1 + 0.5 * w1 + (q[2] * w0 - q[0] * w2) / 12.0
            dq[k, 2] = k2 + 0.5 * w2 + (q[0] * w1 - q[1] * w0) / 12.0
        for j in range(3):
            p[j] += h * (dp[0, j] + 2.0 * dp[1, j] + 2.0 * dp[2, j] + dp[3, j]) / 6.0
            m[j] += h * (dm[0, j] + 2.0 * dm[1, j] + 2.0 * dm[2, j] + dm[3, j]) / 6.0
            q[j] = h * (dq[0, j] + 2.0 * dq[1, j] + 2.0 * dq[2, j] + dq[3, j]) / 6.0
            n[j] -= down[j] * rod[WEIGHT] * h
        turn_by(R, q, E, S)
        R[:] = S
    return R


@kernel
def turn_by(R: Array, v: Array, E: Array, S: Array) -> None:
    """``S = R exp [v]×`` with ``E`` as room, in place; v below some tenths of a rad."""
    x, y, z = v[0], v[1], v[2]
    square = x * x + y * y + z * z
    # the series is exact to rounding below 0.3
    if square < 0.09:
        a = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
        b = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0 * (1.0 - square / 90.0)))
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    E[0, 0], E[1, 1], E[2, 2] = 1.0 - b * (y * y + z * z), 1.0 - b * (x * x + z * z), 1.0 - b * (x * x + y * y)
    E[0, 1], E[1, 0] = b * x * y - a * z, b * x * y + a * z
    E[0, 2], E[2, 0] = b * x * z + a * y, b * x * z - a * y
    E[1, 2], E[2, 1] = b * y * z - a * x, b * y * z + a * x
    for i in range(3):
        for j in range(3):
            S[i, j] = R[i, 0] * E[0, j] + R[i, 1] * E[1, j] + R[i, 2] * E[2, j]


@kernel
def shifted(p: Array, n: Array, m: Array, step: Array) -> None:
    """Go rigidly along ``step`` (3,), in place."""
    p += step
    m -= cross(step, n)


@kernel
def sprung(p: Array, R: Array, n: Array, m: Array, compliance: Array) -> Array:
    """Pass a lumped spring of law (22): shifts along its axes, then turns about x, y, z; in place.

    Args:
        p: position ``(3,)``.
        R: ``(3, 3)`` the spring's own axes.
        n: force.
        m: moment.
        compliance: ``(6, 6)`` in its own axes.

    Returns:
        Orientation behind it.
    """
    f, turn = back_on(R, n), np.zeros(3)
    reaction, theta = np.zeros(6), np.zeros(6)
    Rx, Ry = np.eye(3), np.eye(3)
    for _ in range(8):
        Rx, Ry = turned_by(np.array([turn[0], 0.0, 0.0])), turned_by(np.array([0.0, turn[1], 0.0]))
        here = back_on(R, m - cross(on(R, theta[:3]), n))
        zz = on(Rx, Ry[:, 2])
        reaction[:3] = f
        reaction[3] = here[0]
        reaction[4] = Rx[1, 1] * here[1] + Rx[2, 1] * here[2]
        reaction[5] = zz[0] * here[0] + zz[1] * here[1] + zz[2] * here[2]
        for i in range(6):
            theta[i] = 0.0
            for j in range(6):
                theta[i] += compliance[i, j] * reaction[j]
        turn = theta[3:].copy()
    shifted(p, n, m, on(R, theta[:3]))
    Rx, Ry = turned_by(np.array([turn[0], 0.0, 0.0])), turned_by(np.array([0.0, turn[1], 0.0]))
    return times(times(times(R, Rx), Ry), turned_by(np.array([0.0, 0.0, turn[2]])))
