"""What every cause would do to a design's readings, in units of visibility: the injector's own reference.

Each family is a curve from the origin in the whitened space of `visibility`, known at a few sizes and straight in
between; families whose members add up are planes. Distances there are strengths, nuisances included, and need only
scalar products. From them follow the equivalence classes, a likelihood-ratio finder that knows laws and noise, and
plainer rivals.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from hidden_effects.causes import Family, Laws, Put, catalogue
from hidden_effects.detectability import Visibility, visibility
from hidden_effects.machine import NoTruthError
from hidden_effects.rig import Rig, drawn
from hidden_effects.virtual_rig import Design, RigResponse
from vjm.rotations import Array

STRENGTHS = (2.0, 9.0, 40.0)
"""At about which a curve is known."""
ONE_CLASS = 2.0
"""Strength within which two causes are one class."""
VARIANTS = (
    ("contact_compliance", {"contact_power": 0.5}), ("contact_compliance", {"contact_power": 0.75}),
    ("actuator_backlash", {"play_force": 2.0}), ("actuator_backlash", {"play_force": 15.0}),
    ("joint_clearance", {"play_force": 2.0}), ("joint_clearance", {"play_force": 15.0}),
    ("actuator_hardening", {"ratio": 4.0}), ("actuator_hardening", {"ratio": 1.3}),
    ("actuator_hardening", {"ratio": 0.7}), ("actuator_hardening", {"ratio": 0.4}),
    ("creep", {"creep": (10.0, 90.0, 0.7)}), ("creep", {"creep": (40.0, 300.0, 0.4)}),
    ("plasticity", {"start": (0.35, 1.2)}), ("plasticity", {"start": (0.65, 1.2)}),
    ("plasticity", {"start": (0.8, 1.2)}),
    # a test that only pulls, or only pushes, shows a factor on the part's stiffness and no transition
    ("tension_compression_asymmetry", {"centre": 0.5, "pull_force": 5.0}),
)  # fmt: skip
"""Other laws with which a cause may imitate another one."""
SWEEPS, SETTLED = 400, 1e-5
"""Turns in which several curves share a change, at most, and the relative drop of its square that ends them."""
INVISIBLE = 1e-3
"""Strength per first size below which a family says nothing about a design."""


@dataclass(frozen=True)
class Curve:
    """A family's nodes.

    Attributes:
        cause: name.
        label: part or channel.
        nodes: indices of its nodes: along the curve, or one for each direction of a plane.
        sizes: there.
        spans: whether it is a plane.
        free: whether its sizes may have both signs.
    """

    cause: str
    label: str
    nodes: tuple[int, ...]
    sizes: tuple[float, ...]
    spans: bool
    free: bool


@dataclass(frozen=True)
class Fit:
    """The nearest point of one or several curves."""

    distance: float
    weights: Array


@dataclass(frozen=True)
class Signatures:
    """All curves of a design.

    Attributes:
        visibility: the metric.
        curves: the families.
        nodes: their points ``(m, n c)``, whitened.
        gram: scalar products ``(m, m)``.
    """

    visibility: Visibility
    curves: tuple[Curve, ...]
    nodes: Array
    gram: Array

    @property
    def causes(self) -> tuple[str, ...]:
        """Names, each once."""
        return tuple(dict.fromkeys(curve.cause for curve in self.curves))

    def nearest(self, target: Array, causes: Sequence[str]) -> Fit:
        """Nearest point to a whitened change ``(n c,)`` that one family of each cause gives together."""
        products, square = self.nodes @ target, float(target @ target)
        best = Fit(float(np.sqrt(square)), np.zeros(len(self.nodes)))
        own = [[curve for curve in self.curves if curve.cause == cause] for cause in causes]
        if not all(own):
            return best
        for start in own[0] if own else []:
            chosen = [start, *(group[0] for group in own[1:])]
            for _ in range(2):
                for k, group in enumerate(own):
                    if k == 0 and _ == 0 and len(own) == 1:
                        continue
                    if k > 0:
                        trials = [[*chosen[:k], curve, *chosen[k + 1 :]] for curve in group]
                        chosen = min(trials, key=lambda set_: self.together(products, square, set_).distance)
                if len(own) == 1:
                    break
            fit = self.together(products, square, chosen)
            best = fit if fit.distance < best.distance else best
        return best

    def at_least(self, target: Array, causes: Sequence[str]) -> float:
        """A distance that `nearest` cannot fall below: that of the space which all the causes' nodes span."""
        at = [node for curve in self.curves if curve.cause in causes for node in curve.nodes]
        products = self.nodes[at] @ target
        drop = products @ np.linalg.lstsq(self.gram[np.ix_(at, at)], products, rcond=1e-13)[0]
        return float(np.sqrt(max(float(target @ target) - float(drop), 0.0)))

    def together(self, products: Array, square: float, curves: Sequence[Curve]) -> Fit:
        """Nearest point of a sum of curves, by turns."""
        parts = [np.zeros(len(self.nodes)) for _ in curves]
        seen = [np.zeros(len(self.nodes)) for _ in curves]  # each part's products with the nodes
        last = np.inf
        for _ in range(1 if len(curves) == 1 else SWEEPS):
            for k, curve in enumerate(curves):
                rest = sum((s for j, s in enumerate(seen) if j != k), np.zeros(len(products)))
                parts[k] = self._on(curve, products - rest)
                at = np.flatnonzero(parts[k])
                seen[k] = self.gram[:, at] @ parts[k][at]
            weights, whole = np.sum(parts, axis=0), np.sum(seen, axis=0)
            left = max(square - 2.0 * float(weights @ products) + float(weights @ whole), 0.0)
            if last - left < SETTLED * max(left, 1.0):
                break
            last = left
        return Fit(float(np.sqrt(left)), weights)

    def _on(self, curve: Curve, products: Array) -> Array:
        """Weights ``(m,)`` of the point of a curve with the largest drop of the squared distance."""
        weights = np.zeros(len(self.nodes))
        at = list(curve.nodes)
        if curve.spans:
            G, b = self.gram[np.ix_(at, at)], products[at]
            if curve.free:
                weights[at] = np.linalg.lstsq(G, b, rcond=1e-10)[0]
            else:
                L = np.linalg.cholesky(G + 1e-9 * np.trace(G) * np.eye(len(at)))
                weights[at] = nnls(L.T, np.linalg.solve(L, b))[0]
            return weights
        best = 0.0
        for first, second in zip([-1, *at[:-1]], at, strict=True):
            # from a to b = a + d; the last piece goes on
            ab = self.gram[first, second] if first >= 0 else 0.0
            aa = self.gram[first, first] if first >= 0 else 0.0
            bb = self.gram[second, second]
            pa = products[first] if first >= 0 else 0.0
            pb = products[second]
            dd = aa + bb - 2.0 * ab
            if dd <= 0.0:
                continue
            end = 1.0 if second != at[-1] else 3.0
            t = float(np.clip((pb - pa - ab + aa) / dd, 0.0, end))
            u, v = 1.0 - t, t
            drop = 2.0 * (u * pa + v * pb) - (u * u * aa + 2.0 * u * v * ab + v * v * bb)
            if drop > best:
                best = drop
                weights[:] = 0.0
                if first >= 0:
                    weights[first] = u
                weights[second] = v
        return weights

    def drops(self, targets: Array) -> Array:
        """Largest drop of the squared distance by each curve ``(curves, k)``, for targets ``(n c, k)``."""
        products = self.nodes @ targets
        result = np.zeros((len(self.curves), targets.shape[1]))
        for i, curve in enumerate(self.curves):
            for k in range(targets.shape[1]):
                w = self._on(curve, products[:, k])
                result[i, k] = 2.0 * w @ products[:, k] - w @ self.gram @ w
        return result

    def equivalent(self, target: Array) -> dict[str, float]:
        """The single causes that come within `ONE_CLASS` of a whitened change, and how near."""
        near = {cause: self.nearest(target, [cause]).distance for cause in self.causes}
        return {cause: d for cause, d in sorted(near.items(), key=lambda kv: kv[1]) if d <= ONE_CLASS}


def signatures(design: Design) -> Signatures:
    """Compute the curves of a design."""
    seen = visibility(design)
    rig = Rig(drawn(design).machine)
    base = rig.response(design)
    largest = seen.largest
    families = catalogue(design, largest)
    for cause, change in VARIANTS:
        if cause == "actuator_hardening" and design.drive > 0.0:
            # there the ratio is its size
            continue
        families += [f for f in catalogue(design, largest, replace(Laws(), **change)) if f.cause == cause]
    curves: list[Curve] = []
    nodes: list[Array] = []
    for family in families:
        signs = (1,) if family.spans else family.signs
        for sign in signs:
            sizes, points = (
                _plane(seen, rig, base, family) if family.spans else _curve(seen, rig, base, family, sign)
            )
            if sizes:
                at = tuple(range(len(nodes), len(nodes) + len(sizes)))
                nodes += points
                free = family.spans and len(family.signs) > 1
                curves.append(Curve(family.cause, family.label, at, sizes, family.spans, free))
    if design.link_segments == 1:
        nodes.append(seen.flat(base.less(seen.nominal)))
        curves.append(Curve("link_lumping", "", (len(nodes) - 1,), (1.0,), False, False))
    white = np.array([seen.whitened_flat(point) for point in nodes])
    return Signatures(seen, tuple(curves), white, white @ white.T)


def change_of(seen: Visibility, rig: Rig, base: RigResponse, put: Put, size: float) -> Array:
    """What a cause of a size changes of a rig whose readings are ``base``, as forces ``(n c,)``."""
    return seen.flat(put(rig, size).response(seen.design).less(base))


def _plane(seen: Visibility, rig: Rig, base: RigResponse, family: Family) -> tuple[tuple[float, ...], list[Array]]:
    """One node for each member that can be seen."""
    sizes: tuple[float, ...] = ()
    points: list[Array] = []
    for put in family.members:
        found = _curve(seen, rig, base, replace(family, members=(put,)), 1, (STRENGTHS[1],))
        sizes += found[0]
        points += found[1]
    return sizes, points


def _curve(
    seen: Visibility, rig: Rig, base: RigResponse, family: Family, sign: int, strengths: Sequence[float] = STRENGTHS
) -> tuple[tuple[float, ...], list[Array]]:
    """Nodes at about the given strengths, as far as the family's sizes and the simulator go."""
    (put,) = family.members
    sizes: list[float] = []
    points: list[Array] = []
    size, tried = family.first, (0.0, 0.0)
    power = 1.0
    for strength in strengths:
        for _ in range(5):
            size = min(size, family.most)
            try:
                point = change_of(seen, rig, base, put, sign * size)
            except NoTruthError:
                return tuple(sign * s for s in sizes), points
            here = float(np.linalg.norm(seen.whitened_flat(point)))
            if tried[0] > 0.0 and tried[0] != size and min(here, tried[1]) > INVISIBLE:
                # a bow's effect grows with its square, most others in proportion
                power = float(np.clip(np.log(here / tried[1]) / np.log(size / tried[0]), 0.5, 3.0))
            tried = size, here
            if 0.6 < here / strength < 1.7 or (here < strength and size >= family.most):
                break
            ratio = (strength / here) ** (1.0 / power) if here > INVISIBLE else 30.0
            size *= float(np.clip(ratio, 1e-3, 30.0))
        if tried[1] < INVISIBLE or (sizes and tried[0] <= sizes[-1] * 1.01):
            break
        sizes.append(tried[0])
        points.append(point)
        if tried[0] >= family.most:
            break
        following = strengths[min(len(sizes), len(strengths) - 1)]
        size = tried[0] * (following / tried[1]) ** (1.0 / power)
    return tuple(sign * s for s in sizes), points
