"""Compiled linear algebra of a chain: factors its linearised equilibrium block by block, and solves with them.

See `vjm.kernels.recursion` for the recursion and `vjm.kernels.packed_model` for the arrays.
"""

from __future__ import annotations

from vjm.kernels.beam_column import beam_column
from vjm.kernels.compilation import kernel
from vjm.kernels.factorization import bunch_parlett, bunch_parlett_solve, pivoted, pivoted_solve
from vjm.kernels.packed_model import LINEAR, PASSIVE, Floats, PackedModel, Workspace
from vjm.kernels.recursion import apply_loads


@kernel
def _coupling(model: PackedModel, block: int, force: Floats, work: Workspace, A: Floats) -> None:
    """Jacobian and coupling of a block's coordinates, their reactions in ``s1``, and ``A = −H`` among them."""
    c0, c1 = model.first[block], model.first[block + 1]
    j0, j1 = model.joints[block], model.joints[block + 1]
    w, v, J, G = work.w, work.v, work.J, work.G
    k = c1 - c0
    loaded = len(model.point_joint) > 0
    for i in range(k):
        work.s1[i] = 0.0
        for a in range(6):
            J[c0 + i, a] = 0.0
        for a in range(3):
            G[c0 + i, a] = 0.0
        for c in range(k):
            A[i, c] = 0.0
    f0, f1, f2, m0, m1, m2 = force[0], force[1], force[2], 0.5 * force[3], 0.5 * force[4], 0.5 * force[5]
    for j in range(j0, j1):
        c, s = model.coordinate[j], model.factor[j]
        v0, v1, v2 = s * v[j, 0], s * v[j, 1], s * v[j, 2]
        J[c, 0] += v0
        J[c, 1] += v1
        J[c, 2] += v2
        # g = v × f + ½ w × m: the moment by which this joint's motion loads any rotation before it
        g0, g1, g2 = v1 * f2 - v2 * f1, v2 * f0 - v0 * f2, v0 * f1 - v1 * f0
        if loaded:
            g0, g1, g2 = g0 + s * work.hung[j, 0], g1 + s * work.hung[j, 1], g2 + s * work.hung[j, 2]
            work.s1[c - c0] += s * work.hung[j, 3]
        if model.rotary[j]:
            w0, w1, w2 = s * w[j, 0], s * w[j, 1], s * w[j, 2]
            J[c, 3] += w0
            J[c, 4] += w1
            J[c, 5] += w2
            # on itself the moment does no work
            A[c - c0, c - c0] -= w0 * g0 + w1 * g1 + w2 * g2
            g0 += w1 * m2 - w2 * m1
            g1 += w2 * m0 - w0 * m2
            g2 += w0 * m1 - w1 * m0
        G[c, 0] += g0
        G[c, 1] += g1
        G[c, 2] += g2
        for i in range(j0, j):
            if model.rotary[i]:
                h = model.factor[i] * (w[i, 0] * g0 + w[i, 1] * g1 + w[i, 2] * g2)
                d = model.coordinate[i] - c0
                A[c - c0, d] -= h
                A[d, c - c0] -= h


@kernel
def factor(model: PackedModel, x: Floats, force: Floats, work: Workspace) -> int:
    """Linearise at coordinates ``x`` (n,) and wrench ``force`` (6,), and factor.

    Writes the Jacobian, the statics' residual, the blocks' factors and the condensed matrix (18) with its factor.

    Returns:
        Number of negative eigenvalues of the second variation on the null space of J; −1 where a pivot is zero.
    """
    n_q = len(work.z)
    Q, Y, Z, X, A = work.Q, work.Y_end, work.Z, work.X, work.A
    K, t, r, strain = work.K, work.s1, work.s2, work.s3
    Q[:, :] = 0.0
    Y[:, :] = 0.0
    Z[:, :] = 0.0
    negative = 0
    passive = 0
    if len(model.point_joint) > 0:
        apply_loads(model, work, work.acting)
    for block in range(len(model.kind)):
        c0, c1 = model.first[block], model.first[block + 1]
        k = c1 - c0
        _coupling(model, block, force, work, A)
        J, G = work.J[c0:c1], work.G[c0:c1]
        for i in range(k):
            s = t[i]
            for a in range(6):
                s += J[i, a] * force[a]
            t[i] = s
        for a in range(6):
            for p in range(n_q):
                work.Y[block, a, p] = Y[a, p]
        if model.kind[block] == PASSIVE:
            work.residual[c0] = t[0]
            g = G[0]
            for p in range(passive):
                s = g[0] * Y[3, p] + g[1] * Y[4, p] + g[2] * Y[5, p]
                Z[passive, p] -= s
                Z[p, passive] -= s
            s = A[0, 0]
            for a in range(3):
                for b in range(3):
                    s -= g[a] * Q[3 + a, 3 + b] * g[b]
            Z[passive, passive] = s
            for a in range(6):
                Y[a, passive] = J[0, a] + Q[a, 3] * g[0] + Q[a, 4] * g[1] + Q[a, 5] * g[2]
            passive += 1
            continue
        if model.kind[block] == LINEAR:
            for i in range(k):
                s = t[i]
                for c in range(k):
                    s -= model.K[block, i, c] * (x[c0 + c] - model.natural[c0 + c])
                    A[i, c] += model.K[block, i, c]
                work.residual[c0 + i] = s
        else:
            for i in range(k):
                strain[i] = x[c0 + i] - model.natural[c0 + i]
            beam_column(model.beam[block], t, strain, K, r)
            for i in range(k):
                work.residual[c0 + i] = r[i]
                for c in range(k):
                    A[i, c] += K[i, c]
        U = work.U[block]
        for i in range(k):
            for a in range(6):
                U[a, i] = J[i, a] + Q[a, 3] * G[i, 0] + Q[a, 4] * G[i, 1] + Q[a, 5] * G[i, 2]
        for i in range(k):
            for c in range(i + 1):
                s = 0.0
                for a in range(3):
                    s += G[i, a] * (U[3 + a, c] - J[c, 3 + a])
                A[i, c] -= s
                A[c, i] = A[i, c]
        found = pivoted(A, k, work.L[block], work.D[block], work.order[block])
        if found < 0:
            return -1
        negative += found
        # half-way: L⁻¹ [Uᵀ, Gᵀ Y] in the pivots' order; then all products are with D⁻¹
        L, D, order = work.L[block], work.D[block], work.order[block]
        for i in range(k):
            o = order[i]
            for a in range(6):
                s = U[a, o]
                for c in range(i):
                    s -= L[i, c] * X[c, a]
                X[i, a] = s
            for p in range(passive):
                s = G[o, 0] * Y[3, p] + G[o, 1] * Y[4, p] + G[o, 2] * Y[5, p]
                for c in range(i):
                    s -= L[i, c] * X[c, 6 + p]
                X[i, 6 + p] = s
        for i in range(k):
            d = 1.0 / D[i]
            for a in range(6):
                s = d * X[i, a]
                for b in range(a + 1):
                    Q[a, b] += s * X[i, b]
                for p in range(passive):
                    Y[a, p] += s * X[i, 6 + p]
            for p in range(passive):
                s = d * X[i, 6 + p]
                for b in range(p + 1):
                    Z[p, b] -= s * X[i, 6 + b]
        for a in range(6):
            for b in range(a):
                Q[b, a] = Q[a, b]
        for p in range(passive):
            for b in range(p):
                Z[b, p] = Z[p, b]
    for a in range(6):
        for b in range(6):
            work.T[a, b] = Q[a, b]
        for p in range(n_q):
            work.T[a, 6 + p] = Y[a, p]
            work.T[6 + p, a] = Y[a, p]
    for p in range(n_q):
        for b in range(n_q):
            work.T[6 + p, 6 + b] = -Z[p, b]
    found = bunch_parlett(work.T, work.F, work.swaps, work.pivots)
    if found < 0:
        return -1
    return negative + n_q - found


@kernel
def substitute(model: PackedModel, work: Workspace, load: Floats, gap: Floats) -> None:
    """Solve the factored system: ``(K − H) δx − Jᵀ λ = load`` (n,), ``J δx = gap`` (6,).

    Writes ``work.step`` (n,), and ``work.right``: λ (6,) before the moment's correction, then δq (n_q,).
    """
    n_q = len(work.z)
    z, b, y, mu = work.z, work.s1, work.s2, work.s3
    a = mu
    a[:] = 0.0
    passive = 0
    for block in range(len(model.kind)):
        c0, c1 = model.first[block], model.first[block + 1]
        G = work.G[c0:c1]
        for i in range(6):
            work.a[block, i] = a[i]
        if model.kind[block] == PASSIVE:
            z[passive] = -load[c0] - (G[0, 0] * a[3] + G[0, 1] * a[4] + G[0, 2] * a[5])
            passive += 1
            continue
        k = c1 - c0
        for i in range(k):
            b[i] = load[c0 + i] + G[i, 0] * a[3] + G[i, 1] * a[4] + G[i, 2] * a[5]
        pivoted_solve(work.L[block], work.D[block], work.order[block], k, b, y)
        for i in range(k):
            for j in range(6):
                a[j] += work.U[block, j, i] * y[i]
            for p in range(passive):
                s = G[i, 0] * work.Y[block, 3, p] + G[i, 1] * work.Y[block, 4, p] + G[i, 2] * work.Y[block, 5, p]
                z[p] -= s * y[i]
    for i in range(6):
        work.right[i] = gap[i] - a[i]
    for p in range(n_q):
        work.right[6 + p] = z[p]
    bunch_parlett_solve(work.F, work.swaps, work.pivots, work.right.reshape((len(work.right), 1)))
    q = work.right[6:]
    for i in range(6):
        mu[i] = work.right[i]
    for block in range(len(model.kind) - 1, -1, -1):
        c0, c1 = model.first[block], model.first[block + 1]
        k = c1 - c0
        G = work.G[c0:c1]
        if model.kind[block] == PASSIVE:
            passive -= 1
            y[0] = q[passive]
        else:
            # rotation before the block that does not come from the wrench
            r0, r1, r2 = work.a[block, 3], work.a[block, 4], work.a[block, 5]
            for p in range(passive):
                r0 += work.Y[block, 3, p] * q[p]
                r1 += work.Y[block, 4, p] * q[p]
                r2 += work.Y[block, 5, p] * q[p]
            for i in range(k):
                s = load[c0 + i] + G[i, 0] * r0 + G[i, 1] * r1 + G[i, 2] * r2
                for j in range(6):
                    s += work.U[block, j, i] * mu[j]
                b[i] = s
            pivoted_solve(work.L[block], work.D[block], work.order[block], k, b, y)
        for i in range(k):
            work.step[c0 + i] = y[i]
            for j in range(3):
                mu[3 + j] += G[i, j] * y[i]
