"""Laws of springs as sums of ramps, not as pieces between knots; and random machines that have them.

It shares no formula with the package: a law with kinks is one straight line and, at each kink, what begins there.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from vjm.model.laws import DeadZone, Law, OneSided, Polynomial, StrainWave, Tabulated
from vjm.model.machine import Machine
from vjm.model.parts import Joint


def begun(x, width):
    """Energy ``(k,)`` of a spring of stiffness one from zero on, its tangent rising over a width; complex."""
    t = np.clip(x.real / width + 0.5, 0.0, 1.0) + 1j * np.where(np.abs(x.real) < 0.5 * width, x.imag / width, 0.0)
    inside = width**2 * (t**4 / 4.0 - t**5 / 10.0)
    # from its end on: half of the square, and what the rise has left
    behind = 0.5 * x**2 + width**2 * (1.0 / 4.0 - 1.0 / 10.0 - 1.0 / 8.0)
    return np.where(x.real >= 0.5 * width, behind, inside)


def law_energy(law: Law, u):
    """Energy ``(k,)`` of a law at complex deflections ``(k,)``."""
    match law:
        case StrainWave():
            first = law.T1 / law.K1
            second = first + (law.T2 - law.T1) / law.K2
            width = law.transition or 0.1 * min(first, second - first)
            found = 0.5 * law.K1 * u**2
            for side in (u, -u):
                found = found + (law.K2 - law.K1) * begun(side - first, width)
                found = found + (law.K3 - law.K2) * begun(side - second, width)
            return found
        case DeadZone():
            half, width = 0.5 * law.clearance, law.transition or 0.1 * law.clearance
            both = begun(u - half, width) + begun(-u - half, width)
            return 0.5 * law.inside * u**2 + (law.stiffness - law.inside) * both
        case OneSided():
            side = u - law.begins if law.acts == "above" else law.begins - u
            return law.stiffness * begun(side, law.transition)
        case Polynomial():
            low, high = law.range
            v = np.where(u.real < low, low + 0j, np.where(u.real > high, high + 0j, u))
            inside = law.K1 * v**2 / 2.0 + law.K2 * v**3 / 3.0 + law.K3 * v**4 / 4.0
            force = law.K1 * v + law.K2 * v**2 + law.K3 * v**3
            slope = law.K1 + 2.0 * law.K2 * v + 3.0 * law.K3 * v**2
            return inside + force * (u - v) + 0.5 * slope * (u - v) ** 2
        case Tabulated():
            h, chord = np.diff(law.deflections), np.diff(law.forces) / np.diff(law.deflections)
            before, behind = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
            mean = (before + behind) / (before / chord[:-1] + behind / chord[1:])
            slopes = [chord[0], *mean, chord[-1]]
            force = CubicHermiteSpline(law.deflections, law.forces, slopes)
            low, high = law.deflections[0], law.deflections[-1]
            v = np.clip(u.real, low, high)
            energy = force.antiderivative()
            beyond = u.real - v
            value = energy(v) - energy(0.0) + force(v) * beyond + 0.5 * force(v, 1) * beyond**2
            return value + 1j * u.imag * (force(v) + force(v, 1) * beyond)
        case _:
            raise AssertionError(law)


def law_slope(law: Law, u: float) -> float:
    """Force of a law, as the slope of its energy by a complex step."""
    return float(law_energy(law, np.array([u + 1e-30j])).imag[0] / 1e-30)


def random_law(rng, stiffness, size):
    """A law that reaches over deflections of some size, of a stiffness of some size."""
    K = stiffness * 10.0 ** rng.uniform(-0.3, 0.3, 3)
    match int(rng.integers(5)):
        case 0:
            first, second = size * rng.uniform(0.1, 1.0, 2)
            T1 = K[0] * first
            return StrainWave(*map(float, K), T1=float(T1), T2=float(T1 + K[1] * second))
        case 1:
            wide = float(size * rng.uniform(0.5, 2.0))
            K3 = rng.uniform(-0.25, 2.0) * K[0] / wide**2
            return Polynomial(float(K[0]), (-wide, wide), K2=float(0.1 * K[0] / wide), K3=float(K3))
        case 2:
            return DeadZone(float(K[0]), float(size * rng.uniform(0.2, 1.0)), float(K[1] * rng.uniform(0.01, 0.3)))
        case 3:
            u = np.cumsum(rng.uniform(0.2, 1.0, 6)) * size
            f = np.cumsum(rng.uniform(0.2, 1.0, 6)) * stiffness * size
            at = int(rng.integers(1, 5))
            return Tabulated(tuple(map(float, u - u[at])), tuple(map(float, f - f[at])))
        case _:
            return DeadZone(float(K[0]), float(size * rng.uniform(0.2, 1.0)))


def with_laws(machine: Machine, seed: int) -> Machine:
    """A machine with laws in place of half of its springs."""
    rng = np.random.default_rng(seed)
    parts = []
    for part in machine.parts:
        if isinstance(part, Joint) and part.compliance and rng.random() < 0.5:
            law = random_law(rng, 1.0 / part.compliance, 0.5 if part.slides else 2e-3)
            part = replace(part, compliance=0.0, law=law)
        parts.append(part)
    springs = tuple(
        replace(
            s,
            stiffness=0.0,
            law=OneSided(s.stiffness, 0.1) if rng.random() < 0.7 else random_law(rng, s.stiffness, 20.0),
        )
        for s in machine.point_springs
    )
    return replace(machine, parts=tuple(parts), point_springs=springs)
