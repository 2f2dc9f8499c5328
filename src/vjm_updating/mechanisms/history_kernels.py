"""What depends on the history of a test or is looked up at every reading, compiled.

Tables, springs whose stiffness changes, friction, creep and yield, and the wrenches of
`vjm_updating.mechanisms.relaxation` along a history.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.kernels.statics import law_at, law_inverse
from vjm.rotations import Array
from vjm_updating.constants import numerical

Packed = tuple[Array, Array, Array, Array, Array]
"""Of tables, one after the other: s ``(m,)``, wrench ``(m, 6)``, its slope by s and by the coordinate in which a
piece is interpolated ``(m, 6)``, stiffness ``(m, 6, 6)``."""


@kernel
def _node(s: Array, first: int, last: int, place: float) -> int:
    """Index of the node before a place, of the nodes from ``first`` up to but for ``last``."""
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if s[middle] <= place:
            low = middle
        else:
            high = middle
    return low


@kernel
def _interval(s: Array, first: int, last: int, bifurcation: float, place: float) -> tuple[int, float, float]:
    """Node before a place between a table's ends, place in the interval from 0 to 1, and the interval's width.

    Behind a bifurcation both are of the root of the distance from it.
    """
    i = _node(s, first, last, place)
    a, b = s[i], s[i + 1]
    if a >= bifurcation:
        origin = bifurcation * (1.0 - 1e-12)
        a, b, place = (
            np.sqrt(max(a - origin, 0.0)),
            np.sqrt(max(b - origin, 0.0)),
            np.sqrt(max(place - origin, 0.0)),
        )
    return i, (place - a) / (b - a), b - a


@entry
def interpolated(
    tables: Packed, first: int, last: int, bifurcation: float, place: float, wrench: Array, stiffness: Array
) -> None:
    """Wrench ``(6,)`` and stiffness ``(6, 6)`` of a table at a place; straight on beyond its ends."""
    s, W, slope, own, K = tables
    end = -1
    if place > s[last - 1]:
        end = last - 1
    elif place < 0.0:
        end = first
    if end >= 0:
        wrench[:] = W[end] + (place - s[end]) * slope[end]
        stiffness[:] = K[end]
        return
    i, t, width = _interval(s, first, last, bifurcation, place)
    h00, h10 = (1.0 + 2.0 * t) * (1.0 - t) ** 2, t * (1.0 - t) ** 2 * width
    h01, h11 = t**2 * (3.0 - 2.0 * t), t**2 * (t - 1.0) * width
    for k in range(6):
        wrench[k] = h00 * W[i, k] + h01 * W[i + 1, k] + h10 * own[i, k] + h11 * own[i + 1, k]
        for m in range(6):
            stiffness[k, m] = (1.0 - t) * K[i, k, m] + t * K[i + 1, k, m]


@entry
def looked_up(
    tables: Packed, first: np.ndarray, bifurcation: Array, both: np.ndarray, measure: Array, along: Array, u: Array
) -> tuple[Array, Array]:
    """Wrenches ``(n, 6)`` and stiffnesses ``(n, 6, 6)`` at displacements.

    Args:
        tables: packed.
        first: index ``(T + 1,)`` of the first node of each table, and of the end.
        bifurcation: of each table ``(T,)``.
        both: tables ``(n, 2)`` of each reading, on its ray and on the opposite one.
        measure: ``(n, 6)``, a displacement times it is its place on the ray.
        along: direction ``(n, 6)`` of the ray.
        u: displacements ``(n, 6)``.
    """
    n = len(u)
    wrench, stiffness = np.empty((n, 6)), np.empty((n, 6, 6))
    for r in range(n):
        s = 0.0
        for k in range(6):
            s += u[r, k] * measure[r, k]
        table = both[r, 0] if s >= 0.0 else both[r, 1]
        interpolated(tables, first[table], first[table + 1], bifurcation[table], abs(s), wrench[r], stiffness[r])
        for m in range(6):
            off = u[r, m] - s * along[r, m]
            if off != 0.0:
                for k in range(6):
                    wrench[r, k] += stiffness[r, k, m] * off
    return wrench, stiffness


@entry
def on_chords(
    s: Array, first: np.ndarray, bifurcation: Array, both: np.ndarray, places: Array, values: Array
) -> Array:
    """What tables have at their nodes ``(m, k)``, linearly between them, at places ``(n,)`` on rays: ``(n, k)``.

    Behind a bifurcation linear in the root of the distance; beyond the ends as at them. Of a place below zero it is
    the opposite ray's. Other arguments as of `looked_up`.
    """
    n, width = len(places), values.shape[1]
    result = np.empty((n, width))
    for r in range(n):
        table = both[r, 0] if places[r] >= 0.0 else both[r, 1]
        begin, end = first[table], first[table + 1]
        i, t, _ = _interval(s, begin, end, bifurcation[table], min(abs(places[r]), s[end - 1]))
        for k in range(width):
            result[r, k] = (1.0 - t) * values[i, k] + t * values[i + 1, k]
    return result


NEWTON_STEPS, LAST_STEP = numerical(60), numerical(1e-13)
"""Of Newton's method for a spring, and its last step over the deflection at the largest force."""


@entry
def curve_deflections(forces: Array, knots: Array, pieces: Array) -> tuple[Array, Array]:
    """Deflections ``(n,)`` at forces ``(n,)``, and tangents, of a `vjm.model.laws.Curve` that rises everywhere."""
    first = np.array([0, len(knots)])
    u, tangent, largest = np.empty(len(forces)), np.empty(len(forces)), 0.0
    for i in range(len(forces)):
        u[i] = law_inverse(first, knots, pieces, 0, forces[i], 0.0)
        largest = max(largest, abs(u[i]))
    for i in range(len(forces)):
        for _ in range(NEWTON_STEPS):
            force, tangent[i] = law_at(first, knots, pieces, 0, u[i])
            step = (forces[i] - force) / tangent[i]
            u[i] += step
            if abs(step) <= LAST_STEP * largest:
                break
    return u, tangent


@entry
def hardening_deflections(shares: Array, ratio: float, power: float) -> tuple[Array, Array]:
    """Deflections ``(n,)`` and their slopes at shares of the largest load, of unit compliance at no load.

    The load is ``s (1 + a s^power)``; its tangent at the largest load is ``ratio`` times that at none. Beyond the
    largest load the tangent goes straight on.
    """
    a = (ratio - 1.0) / (power + 1.0)
    most = 1.0 / (1.0 + a)
    x, slope = np.empty(len(shares)), np.empty(len(shares))
    for i in range(len(shares)):
        size = abs(shares[i])
        inside = min(size, 1.0)
        s = inside
        bend = a * s**power
        for _ in range(NEWTON_STEPS):
            step = (s * (1.0 + bend) * most - inside) / ((1.0 + (power + 1.0) * bend) * most)
            s = min(max(s - step, 0.0), 1.0)
            bend = a * s**power
            if abs(step) < LAST_STEP:
                break
        slope[i] = 1.0 / (1.0 + (power + 1.0) * bend)
        x[i] = np.sign(shares[i]) * (most * s + (size - inside) / ratio)
    return x, slope


@entry
def friction_along(
    free: Array, give: Array, limit: Array, begins: np.ndarray, rest: Array, sweeps: int, enough: float
) -> Array:
    """Torques ``(n, n_q)`` of dry friction, by projected Gauss-Seidel iteration at every reading."""
    n, joints = free.shape
    result = np.zeros((n, joints))
    tau, stands, turn = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    for k in range(n):
        if begins[k]:
            tau[:] = 0.0
            stands[:] = rest[k]
        most = 0.0
        for j in range(joints):
            most = max(most, give[k, j, j])
        for _ in range(sweeps):
            largest, size = 0.0, 0.0
            for j in range(joints):
                # a joint that cannot turn while the end-effector is held needs no torque to stand
                if give[k, j, j] <= 1e-9 * most:
                    size = max(size, abs(tau[j]))
                    continue
                own = free[k, j] - stands[j]
                for i in range(joints):
                    own += give[k, j, i] * tau[i]
                new = min(max(tau[j] - own / give[k, j, j], -limit[j]), limit[j])
                largest = max(largest, abs(new - tau[j]))
                tau[j] = new
                size = max(size, abs(new))
            if largest <= enough * size:
                break
        for j in range(joints):
            turn[j] = free[k, j]
            for i in range(joints):
                turn[j] += give[k, j, i] * tau[i]
        stands[:] = turn
        result[k] = tau
    return result


@entry
def decaying(decay: Array, gain: Array, begins: np.ndarray) -> Array:
    """``x_k = d_k x_{k−1} + g_k`` ``(n,)``, from zero where a history begins."""
    x, last = np.empty(len(decay)), 0.0
    for k in range(len(decay)):
        last = 0.0 if begins[k] else decay[k] * last + gain[k]
        x[k] = last
    return x


@entry
def flowing(force: Array, begins: np.ndarray, limit: float, compliance: float, grows: float) -> tuple[Array, Array]:
    """Plastic slip ``(n,)`` with linear hardening, and its slope by the force.

    Of the hardening a share ``grows`` widens the elastic range, the rest moves it.
    """
    n = len(force)
    slip, middle, half = 0.0, 0.0, limit
    x, slope = np.empty(n), np.zeros(n)
    for k in range(n):
        if begins[k]:
            slip, middle, half = 0.0, 0.0, limit
        beyond = abs(force[k] - middle) - half
        if beyond > 0.0:
            way = 1.0 if force[k] > middle else -1.0
            slip += compliance * beyond * way
            middle += (1.0 - grows) * beyond * way
            half += grows * beyond
            slope[k] = compliance
        x[k] = slip
    return x, slope


@kernel
def _solve(A: Array, b: Array) -> None:
    """Put the solutions of a small system ``A`` (e, e) into its right sides ``b`` (e, k); both are written to."""
    e, many = b.shape
    for i in range(e):
        pivot = i
        for r in range(i + 1, e):
            if abs(A[r, i]) > abs(A[pivot, i]):
                pivot = r
        for k in range(e):
            A[i, k], A[pivot, k] = A[pivot, k], A[i, k]
        for k in range(many):
            b[i, k], b[pivot, k] = b[pivot, k], b[i, k]
        for r in range(i + 1, e):
            share = A[r, i] / A[i, i]
            for k in range(i, e):
                A[r, k] -= share * A[i, k]
            for k in range(many):
                b[r, k] -= share * b[i, k]
    for i in range(e - 1, -1, -1):
        for k in range(many):
            for r in range(i + 1, e):
                b[i, k] -= A[i, r] * b[r, k]
            b[i, k] /= A[i, i]


@kernel
def _reach(stiffness: Array, motions: Array, slopes: Array, pushed: Array, matrix: Array) -> None:
    """Of one reading the wrenches ``K bᵀ`` (e, 6) by extensions, and ``1 + slope b K bᵀ`` (e, e)."""
    e = len(slopes)
    for i in range(e):
        for k in range(6):
            pushed[i, k] = 0.0
            for m in range(6):
                pushed[i, k] += stiffness[k, m] * motions[i, m]
    for i in range(e):
        for j in range(e):
            along = 0.0
            for k in range(6):
                along += motions[i, k] * pushed[j, k]
            matrix[i, j] = slopes[i] * along + (1.0 if i == j else 0.0)


@entry
def driven(pulls: Array, levers: Array, x: Array, wrench: Array) -> Array:
    """What drives elements ``(e, n)`` that have the extensions x ``(n, e)``; see `stepped`."""
    n, e = x.shape
    result = np.zeros((e, n))
    for r in range(n):
        for i in range(e):
            for k in range(6):
                result[i, r] += (pulls[r, i, k] + x[r, i] * levers[r, i, k]) * wrench[r, k]
    return result


@entry
def stepped(
    gap: Array, still: np.ndarray, slopes: Array, stiffness: Array, motions: Array, bends: Array, most: Array,
    bracketed: np.ndarray, pose: Array, x: Array, low: Array, high: Array, own: Array,
) -> None:  # fmt: skip
    """A bracketed step of Newton's method of the extensions; see `vjm_updating.mechanisms.series_elements.balance`.

    Args:
        gap: by how much laws ask for more than the extensions ``(n, e)``.
        still: readings ``(n,)`` in balance, which stay.
        slopes: of the laws ``(n, e)``.
        stiffness: of the chain ``(n, 6, 6)``.
        motions: by the extensions ``(n, e, 6)``, and
        bends: by their squares, twice.
        most: bounds ``(e,)`` of the extensions, and
        bracketed: which of them are held in brackets.
        pose: imposed displacements ``(n, 6)``.
        x: extensions ``(n, e)``, written to, as are
        low: the brackets' lower ends ``(n, e)``,
        high: their upper ends, and
        own: the displacements ``(n, 6)`` that are left to the chain.
    """
    n, e = x.shape
    pushed, matrix, move = np.empty((e, 6)), np.empty((e, e)), np.empty((e, 1))
    for r in range(n):
        if still[r]:
            continue
        _reach(stiffness[r], motions[r], slopes[r], pushed, matrix)
        move[:, 0] = gap[r]
        _solve(matrix, move)
        own[r] = pose[r]
        for i in range(e):
            if gap[r, i] > 0.0:
                low[r, i] = max(low[r, i], x[r, i])
            elif gap[r, i] < 0.0:
                high[r, i] = min(high[r, i], x[r, i])
            new = x[r, i] + move[i, 0]
            outside = bracketed[i] and (new <= low[r, i] or new >= high[r, i])
            # other elements have moved since: a bracket that has become empty is opened again
            if outside and high[r, i] - low[r, i] < 1e-6:
                low[r, i], high[r, i] = -most[i], most[i]
            elif outside and np.isfinite(low[r, i]) and np.isfinite(high[r, i]):
                new = 0.5 * (low[r, i] + high[r, i])
            x[r, i] = min(max(new, -most[i]), most[i])
            for k in range(6):
                own[r, k] -= x[r, i] * (motions[r, i, k] + 0.5 * x[r, i] * bends[r, i, k])


@entry
def softened(stiffness: Array, motions: Array, slopes: Array) -> Array:
    """Stiffnesses ``(1 + K S)⁻¹ K`` (n, 6, 6) with ``S = Σ slope b bᵀ``, by an unknown an element (Woodbury).

    Arguments are those of `stepped`.
    """
    n, e = slopes.shape
    pushed, matrix, softer = np.empty((e, 6)), np.empty((e, e)), np.empty((e, 6))
    result = stiffness.copy()
    for r in range(n):
        _reach(stiffness[r], motions[r], slopes[r], pushed, matrix)
        for i in range(e):
            for k in range(6):
                softer[i, k] = 0.0
                for m in range(6):
                    softer[i, k] += slopes[r, i] * motions[r, i, m] * stiffness[r, m, k]
        _solve(matrix, softer)
        for i in range(e):
            for k in range(6):
                for m in range(6):
                    result[r, k, m] -= pushed[i, k] * softer[i, m]
    return result


SMALL = numerical(1e-12)
"""Distance from a bifurcation, over its place, that counts as none: the root of it is divided by."""
ENDED = numerical(1e-10)
"""Relative step at which the amplitude of a bend is found."""
ROUNDS, NEAR = numerical(20), numerical(1e-6)
"""Of a bend and what it makes relax at once, at most, and the relative change at which they agree."""


class HalfRayPath(NamedTuple):
    """The p spring coordinates of a beam along a half-ray.

    Attributes:
        s: places ``(m,)``.
        reaction: less that of the unloaded pose ``(m, p)``, N, N mm.
        motion: of the springs with the end-effector ``(m, p, 6)``; behind a bifurcation times the root of the
            distance from it.
        bifurcation: its place; infinite where there is none.
        fall: of the wrench's slope at the bifurcation ``(6,)``.
        stiff: slope of the force along the ray before it.
        along: the ray's direction ``(6,)``.
        alpha: the beam's share of the compliance along the ray.
    """

    s: Array
    reaction: Array
    motion: Array
    bifurcation: float
    fall: Array
    stiff: float
    along: Array
    alpha: float


@kernel
def _amplitude(v: float, bow: float) -> float:
    """The largest root of ``a³ − v a = bow``, by Newton's method from above, where the cubic is convex."""
    a = bow ** (1.0 / 3.0) + np.sqrt(max(v, 0.0))
    for _ in range(60):
        slope = 3.0 * a * a - v
        if slope <= 0.0:
            break
        step = (a * (a * a - v) - bow) / slope
        a -= step
        if step <= ENDED * a:
            break
    return a


@kernel
def _between(S: Array, start: int, end: int, critical: float, s: float) -> tuple[int, int, float, float, float]:
    """Where a place lies in a path.

    Returns:
        The node before it; the first one behind the bifurcation, or the last; w, one before a bifurcation; the
        weights of the second node for reactions and for motions.
    """
    i = start + min(max(int(np.searchsorted(S[start:end], s, side="right")) - 1, 0), end - start - 2)
    m = start + min(int(np.searchsorted(S[start:end], critical)), end - start - 1)
    across = S[i] < critical <= S[i + 1]
    if s < critical:
        t = 0.0 if across else (s - S[i]) / (S[i + 1] - S[i])
        return i, m, 1.0, t, t
    origin = critical * (1.0 - SMALL)
    w, b = np.sqrt(s - origin), np.sqrt(S[i + 1] - origin)
    a = 0.0 if across else np.sqrt(S[i] - origin)
    t = (w - a) / (b - a)
    return i, m, w, t, 1.0 if across else t


@kernel
def _weights(step: float, time: float) -> tuple[float, float, float]:
    """Of what is remembered, and of both ends of a ramp over a step, the last one first."""
    ratio = step / time
    decay = np.exp(-ratio)
    end = 0.5 * ratio if ratio < 1e-6 else 1.0 - (1.0 - decay) / ratio
    return decay, end, 1.0 - decay - end


@kernel
def _work(motion: Array, i: int, q: float, stress: Array, out: Array) -> None:
    """Wrench ``out`` (6,) by stresses ``(p,)`` on the motions between two nodes."""
    out[:] = 0.0
    for j in range(len(stress)):
        for c in range(6):
            out[c] += ((1.0 - q) * motion[i, j, c] + q * motion[i + 1, j, c]) * stress[j]


@kernel
def _dot(a: Array, b: Array) -> float:
    """Product of two ``(6,)``: np.dot would need BLAS."""
    result = 0.0
    for c in range(6):
        result += a[c] * b[c]
    return result


@entry
def relaxed_wrenches(
    nodes: tuple[Array, Array, Array], first: np.ndarray, bifurcation: Array, fall: Array, stiff: Array,
    along: Array, both: np.ndarray, place: Array, terms: tuple[Array, Array, Array, Array], step: Array,
    begins: np.ndarray,
) -> Array:  # fmt: skip
    """What relaxation adds to the wrenches ``(n, 6)``.

    Args:
        nodes: s, reaction and motion of all paths, one after the other, see `HalfRayPath`.
        first: index ``(P + 1,)`` of each path's first node, and of the end.
        bifurcation: ``(P,)``.
        fall: ``(P, 6)``.
        stiff: ``(P,)``.
        along: ``(P, 6)``.
        both: paths ``(n, 2)`` of each reading, on its ray and on the opposite one.
        place: of each reading on its ray ``(n,)``, of either sign.
        terms: shares and times ``(n, k)`` of what is straight, s, and shares and times ``(k,)`` of the bend.
        step: since the reading before ``(n,)``, s.
        begins: whether a reading is the first of a history ``(n,)``: nothing has relaxed there.
    """
    S, reaction, motion = nodes
    shares, times, own_shares, own_times = terms
    n, count, p = len(place), shares.shape[1], reaction.shape[1]
    result = np.zeros((n, 6))
    # stresses of the straight beam and of its bend: what is remembered, what acts now and did before
    history, bent = np.zeros((count, p)), np.zeros((count, p))
    now, last, bend, last_bend, mode = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    past, relaxed = np.zeros(p), np.zeros(p)
    plain, more, limit = np.zeros(6), np.zeros(6), np.zeros(6)
    for r in range(n):
        path = both[r, 0] if place[r] >= 0.0 else both[r, 1]
        start, end, critical = first[path], first[path + 1], bifurcation[path]
        s, d = min(abs(place[r]), S[end - 1]), along[path]
        i, m, w, t, q = _between(S, start, end, critical, s)
        beyond, k = s >= critical, _dot(d, fall[path])
        bends = critical < S[m] and m > start and k > 0.0 and stiff[path] > 0.0
        root = np.sqrt(S[m] - critical) if bends else 1.0
        for j in range(p):
            now[j] = (1.0 - t) * reaction[i, j] + t * reaction[i + 1, j]
            mode[j] = 0.0
            if bends and beyond:
                mode[j] = (now[j] - reaction[m - 1, j]) / w
                now[j] = reaction[m - 1, j]
            elif bends:
                mode[j] = (reaction[m, j] - reaction[m - 1, j]) / root
        v, a = s - critical, w if bends and beyond else 0.0
        if begins[r]:
            history[:], bent[:] = 0.0, 0.0
            last[:], last_bend[:] = now, a * mode
            continue
        past[:], gain = 0.0, 0.0
        for term in range(count):
            decay, of_end, of_start = _weights(step[r], times[r, term])
            for j in range(p):
                history[term, j] = decay * history[term, j] + of_end * now[j] + of_start * last[j]
                past[j] += shares[r, term] * history[term, j]
            decay, of_end, of_start = _weights(step[r], own_times[term])
            gain += own_shares[term] * of_end
            for j in range(p):
                bent[term, j] = decay * bent[term, j] + of_start * last_bend[j]
                past[j] += own_shares[term] * bent[term, j]
        # first order, and the bend that its own past and present make
        f = 0.0
        for _ in range(ROUNDS):
            bend[:] = a * mode
            relaxed[:] = past + gain * bend
            _work(motion, i, q, relaxed, more)
            more[:] = more / w
            if not bends:
                break
            _work(motion, start, 0.0, relaxed, plain)
            more[:] = more - plain
            if beyond:
                f = _dot(d, more)
            else:
                _work(motion, m - 1, 1.0, relaxed, limit)
                f = _dot(d, limit) / root - _dot(d, plain)
            x = _dot(d, plain) / stiff[path]
            before = a
            a = _amplitude(v - x, abs((w if beyond else root) * (f / k + x)))
            if abs(a - before) <= NEAR * a:
                break
        for term in range(count):
            _, of_end, _ = _weights(step[r], own_times[term])
            for j in range(p):
                bent[term, j] += of_end * bend[j]
        last[:], last_bend[:] = now, bend
        result[r] = -more
        if bends:
            # along the ray by the amplitude itself, across it by what a bow takes of the first order
            kept = min(w / a, 1.0) if beyond else -v / (a * a - v)
            lost = a * a - (v + f / k if beyond else 0.0)
            result[r] = -plain - kept * more - (lost + (1.0 - kept) * _dot(d, more) / k) * fall[path]
    return result
