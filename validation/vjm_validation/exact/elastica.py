"""Large bending of an inextensible, shear-rigid cantilever by a load at its tip, in elliptic integrals.

The rod is clamped at the origin along x. A tip force F at the angle β from it gives θ'' = (F/EI) sin(θ − β).
With ψ = θ − β + π that is the pendulum's ψ'' = −ω² sin ψ, ω² = F L²/EI, at rest at the tip, where M = 0:

    sin(ψ/2) = k sn(u),   u = u_root + ω S/L,   u_tip = K(k),   k = sin(ψ_tip/2).

The tip stands, along and across the direction θ = β − π, at

    (1/ω) [2 E(k) − 2 E(φ_root, k) − ω]   and   (2k/ω) cos φ_root,   φ = am(u).

Frisch-Fay, *Flexible Bars* (1962). Lengths are over L, forces times L²/EI, moments times L/EI.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipj, ellipk, ellipkinc, ellipkm1, expit

LOGITS = (-80.0, 640.0)
"""Range of ln((k² − k₀²)/(1 − k²)), k₀ the modulus of no load: from 1e-35 of it to K(k) = 320."""


@dataclass(frozen=True)
class Tip:
    """Where the tip of a cantilever of unit length is.

    Attributes:
        x: along the undeformed rod, over L.
        y: across it, over L.
        theta: turn of the end section, rad.
    """

    x: float
    y: float
    theta: float


def dead_force(load: float, angle: float = 0.5 * np.pi) -> Tip:
    """Tip under a force that keeps its direction.

    Of several equilibria under a large oblique compression it is the one that the growing load leads to. The root
    has ψ = π − β, hence sin φ_root = cos(β/2)/k, and K(k) − F(φ_root, k) = ω gives k. Bisshopp and Drucker,
    *Quarterly of Applied Mathematics* 3 (1945); Mattiasson, *IJNME* 17 (1981), Table 1.

    Args:
        load: F L²/EI, from 0 to 1e4.
        angle: β in rad from the undeformed axis, between 0 and π: π/2 is the transverse force.

    Raises:
        ValueError: the load or the angle is out of range.
    """
    _check(load, angle)
    omega = np.sqrt(load)
    root_modulus = np.cos(0.5 * angle)
    # k lies between that of no load and one, and comes exponentially close to the latter under a slanting pull: the
    # logit of where it is between them keeps the digits of both differences
    whole = np.sin(0.5 * angle) ** 2

    def at(logit: float) -> tuple[float, float]:
        """1 − k² and φ_root."""
        return float(whole * expit(-logit)), float(np.arctan2(root_modulus, np.sqrt(whole * expit(logit))))

    def excess(logit: float) -> float:
        complement, root_phase = at(logit)
        return float(ellipkm1(complement) - ellipkinc(root_phase, 1.0 - complement) - omega)

    return _tip(*at(brentq(excess, *LOGITS, xtol=1e-15, rtol=1e-15)), omega)


def follower_force(load: float, angle: float = 0.5 * np.pi) -> Tip:
    """Tip under a force that turns with the end section.

    The tip's ψ is π minus the force's angle from the tip's tangent, so that k is known and the root's amplitude is
    φ_root = am(K − ω): no equation is left to solve.

    Args:
        load: F L²/EI, from 0 to 1e4.
        angle: of the force from the tip's tangent in rad, between 0 and π: π/2 is the normal follower. A tangential
            follower (0 or π) leaves the rod straight; under compression it flutters (Beck 1952), which is no static
            matter.

    Raises:
        ValueError: the load or the angle is out of range.
    """
    _check(load, angle)
    omega = np.sqrt(load)
    complement = float(np.sin(0.5 * angle) ** 2)
    amplitude = float(ellipj(ellipk(1.0 - complement) - omega, 1.0 - complement)[3])
    return _tip(complement, amplitude, omega)


def end_moment(moment: float) -> Tip:
    """Tip under an end moment: an arc of the curvature M/EI.

    No axial and no shear force act, so that an extensible and shearable rod takes the same arc.

    Args:
        moment: M L/EI, any.
    """
    half = 0.5 * moment
    chord = np.sinc(half / np.pi)
    return Tip(float(chord * np.cos(half)), float(chord * np.sin(half)), float(moment))


def _check(load: float, angle: float) -> None:
    if not 0.0 < load <= 1e4:
        raise ValueError(f"load F L²/EI is {load}: it must be above 0 and at most 1e4")
    if not 0.0 < angle < np.pi:
        raise ValueError(f"angle is {angle} rad: it must be between 0 and π")


def _tip(complement: float, root_phase: float, omega: float) -> Tip:
    m = 1.0 - complement
    k = np.sqrt(m)
    root = 2.0 * np.arcsin(k * np.sin(root_phase))
    along = (2.0 * (ellipe(m) - ellipeinc(root_phase, m)) - omega) / omega
    across = 2.0 * k * np.cos(root_phase) / omega
    # the root's section is not turned, so that ψ_root is the angle between the pendulum's axes and the clamp's
    cos, sin = np.cos(root), np.sin(root)
    turn = 2.0 * np.arctan2(k, np.sqrt(complement)) - root
    return Tip(float(along * cos + across * sin), float(across * cos - along * sin), float(turn))
