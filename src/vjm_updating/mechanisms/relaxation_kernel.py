"""The wrenches of `vjm_updating.mechanisms.relaxation` along a history, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.rotations import Array
from vjm_updating.constants import numerical

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
            _work(motion, start, 0.0, relaxed, plain)
            _work(motion, i, q, relaxed, more)
            more[:] = more / w - plain
            if not bends:
                break
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
        result[r] = -plain - more
        if bends:
            # along the ray by the amplitude itself, across it by what a bow takes of the first order
            kept = min(w / a, 1.0) if beyond else -v / (a * a - v)
            lost = a * a - (v + f / k if beyond else 0.0)
            result[r] = -plain - kept * more - (lost + (1.0 - kept) * _dot(d, more) / k) * fall[path]
    return result
