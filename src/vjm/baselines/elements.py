"""Elements of matrix structural analysis: a beam between two nodes, and an arm of a rigid body."""

from __future__ import annotations

import numpy as np

from vjm.model.parts import Section
from vjm.rotations import Array, skew


def beam_element(section: Section, length: float) -> Array:
    """Stiffness ``(12, 12)`` of a straight beam between two nodes, section axes, x from node 1 to node 2.

    Timoshenko's with ``Φ = 12 EI/(GA L²)``, Bernoulli's where GA is infinite; Przemieniecki, *Theory of Matrix
    Structural Analysis* (1968), eq. (5.116).
    """
    K = np.zeros((12, 12))
    L = length

    def add(dofs: list[int], block: list[list[float]]) -> None:
        K[np.ix_(dofs, dofs)] += np.array(block)

    a, t = section.EA / L, section.GJ / L
    add([0, 6], [[a, -a], [-a, a]])
    add([3, 9], [[t, -t], [-t, t]])
    for EI, GA, v, r, sign in (
        (section.EIz, section.GAy, 1, 5, 1.0),
        (section.EIy, section.GAz, 2, 4, -1.0),
    ):
        phi = 12.0 * EI / (GA * L**2)
        b = EI / ((1.0 + phi) * L**3)
        m = sign * 6.0 * L * b
        near, far = (4.0 + phi) * L**2 * b, (2.0 - phi) * L**2 * b
        add(
            [v, r, v + 6, r + 6],
            [
                [12.0 * b, m, -12.0 * b, m],
                [m, near, -m, far],
                [-12.0 * b, -m, 12.0 * b, -m],
                [m, far, -m, near],
            ],
        )
    return K


def rigid_arm(offset: Array) -> Array:
    """Displacement transport ``(6, 6)``: of a point ``offset`` (3,) away on a rigid body, from the body's."""
    A = np.eye(6)
    A[:3, 3:] = -skew(offset)
    return A
