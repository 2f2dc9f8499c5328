"""The wrenches of `vjm_updating.mechanisms.relaxation` along a history, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import entry, kernel
from vjm.rotations import Array

SMALL = 1e-12
"""Distance from a bifurcation, over its place, that counts as none: the root of it is divided by."""
ENDED = 1e-10
"""Relative step at which the amplitude of a bend is found."""


class Path(NamedTuple):
    """The p spring coordinates of a beam along a half-ray.

    Attributes:
        s: places ``(m,)``.
        reaction: less that of the unloaded pose ``(m, p)``, N, N mm.
        motion: of the springs with the end-effector ``(m, p, 6)``; behind a bifurcation times the root of the
            distance from it.
        bifurcation: its place; infinite where there is none.
        before: motion ``(p, 6)`` at the unloaded pose.
        fall: of the wrench's slope at the bifurcation ``(6,)``.
        along: the ray's direction ``(6,)``.
        alpha: the beam's share of the compliance along the ray.
    """

    s: Array
    reaction: Array
    motion: Array
    bifurcation: float
    before: Array
    fall: Array
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


@entry
def relaxed_wrenches(
    nodes: tuple[Array, Array, Array], first: np.ndarray, bifurcation: Array, before: Array, fall: Array,
    along: Array, both: np.ndarray, place: Array, shares: Array, times: Array, step: Array, begins: np.ndarray,
) -> Array:  # fmt: skip
    """What relaxation adds to the wrenches ``(n, 6)``.

    Args:
        nodes: s, reaction and motion of all paths, one after the other, see `Path`.
        first: index ``(P + 1,)`` of each path's first node, and of the end.
        bifurcation: ``(P,)``.
        before: ``(P, p, 6)``.
        fall: ``(P, 6)``.
        along: ``(P, 6)``.
        both: paths ``(n, 2)`` of each reading, on its ray and on the opposite one.
        place: of each reading on its ray ``(n,)``, of either sign.
        shares: ``(n, k)``, of times ``(n, k)``.
        times: s.
        step: since the reading before ``(n,)``, s.
        begins: whether a reading is the first of a history ``(n,)``: nothing has relaxed there.
    """
    S, reaction, motion = nodes
    n, terms, p = len(place), shares.shape[1], reaction.shape[1]
    result = np.zeros((n, 6))
    memory, now, last, eased = np.zeros((terms, p)), np.zeros(p), np.zeros(p), np.zeros(p)
    plain, more, limit = np.zeros(6), np.zeros(6), np.zeros(6)
    for r in range(n):
        path = both[r, 0] if place[r] >= 0.0 else both[r, 1]
        start, end, critical = first[path], first[path + 1], bifurcation[path]
        s = min(abs(place[r]), S[end - 1])
        i = start + min(max(np.searchsorted(S[start:end], s, side="right") - 1, 0), end - start - 2)
        # weights of both nodes, for reactions and for motions
        beyond, across = s >= critical, S[i] < critical <= S[i + 1]
        if beyond:
            origin = critical * (1.0 - SMALL)
            w, b = np.sqrt(s - origin), np.sqrt(S[i + 1] - origin)
            a = 0.0 if across else np.sqrt(S[i] - origin)
            t = (w - a) / (b - a)
            q = 1.0 if across else t
        else:
            w = 1.0
            t = 0.0 if across else (s - S[i]) / (S[i + 1] - S[i])
            q = t
        for j in range(p):
            now[j] = (1.0 - t) * reaction[i, j] + t * reaction[i + 1, j]
            eased[j] = 0.0
        for k in range(terms):
            if begins[r]:
                memory[k, :] = 0.0
                continue
            ratio = step[r] / times[r, k]
            decay = np.exp(-ratio)
            # of a ramp over the step: weight of its end
            mean = 0.5 * ratio if ratio < 1e-6 else 1.0 - (1.0 - decay) / ratio
            for j in range(p):
                memory[k, j] = decay * memory[k, j] + mean * now[j] + (1.0 - decay - mean) * last[j]
                eased[j] += shares[r, k] * memory[k, j]
        last[:] = now
        if begins[r]:
            continue
        plain[:], more[:] = 0.0, 0.0
        for j in range(p):
            for c in range(6):
                plain[c] += before[path, j, c] * eased[j]
                more[c] += ((1.0 - q) * motion[i, j, c] + q * motion[i + 1, j, c]) * eased[j]
        for c in range(6):
            more[c] = more[c] / w - plain[c]
        kept, lost = 1.0, 0.0
        if np.isfinite(critical):
            # g at this place, or just behind the bifurcation
            g, k = 0.0, 0.0
            if beyond:
                limit[:] = w * more
            else:
                m = start + min(np.searchsorted(S[start:end], critical), end - start - 1)
                limit[:] = -np.sqrt(max(S[m] - critical, 0.0)) * plain
                for j in range(p):
                    for c in range(6):
                        limit[c] += motion[m, j, c] * eased[j]
            for c in range(6):
                g += along[path, c] * limit[c]
                k += along[path, c] * fall[path, c]
            if k > 0.0:
                v = s - critical
                a = _amplitude(v, abs(g) / k)
                if beyond:
                    kept = w / a if a > w else 1.0
                else:
                    kept, lost = -v / (a * a - v), a * a
        for c in range(6):
            result[r, c] = -plain[c] - kept * more[c] - lost * fall[path, c]
    return result
