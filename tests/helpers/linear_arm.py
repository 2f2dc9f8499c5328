"""An arm of beams on sprung joints by virtual work and textbook beams, linear, with one thing wrong in one link.

Nothing of the package is in it: cantilevers' flexibilities, moved to the end-effector, add up, and what slips along
a link shifts it. Laws are solved reading by reading, and none is a finder's own: play has hard ends, yield a sharp
knee, a contact is Hertz's, and a beam that creeps has one more spring and dashpot in each of its six directions.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from helpers.file_texts import model_text, part_text, stiffness_of

FREE = 1e3
"""rad/(N mm) of a joint that turns as it likes: 1e12 times as much as a beam."""
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def cross(v):
    """Matrix ``(3, 3)`` of ``v ×``."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turned(axis, angle):
    """Rotation ``(3, 3)`` about an axis, Rodrigues' formula."""
    S = cross(AXES[axis])
    return np.eye(3) + np.sin(angle) * S + (1.0 - np.cos(angle)) * S @ S


@dataclass(frozen=True)
class Link:
    """A joint and the beam behind it.

    Attributes:
        name: of the beam; the joint's is ``j-`` and that.
        axis: of the joint.
        gives: of the joint, rad/(N mm); `FREE` for a passive one.
        length: mm.
        EA: N.
        EI: N mm².
        GJ: N mm².
    """

    name: str
    axis: str
    gives: float
    length: float
    EA: float
    EI: float
    GJ: float

    def section(self):
        """As a model file has it."""
        return stiffness_of(self.EA, self.GJ, self.EI, self.EI)

    def flexibility(self):
        """Of the cantilever at its tip ``(6, 6)``, its own axes, x along it."""
        L, EI = self.length, self.EI
        C = np.diag([L / self.EA, L**3 / 3.0 / EI, L**3 / 3.0 / EI, L / self.GJ, L / EI, L / EI])
        C[1, 5] = C[5, 1] = L**2 / 2.0 / EI
        C[2, 4] = C[4, 2] = -(L**2) / 2.0 / EI
        return C


def arm(*names, width=1.0):
    """Links of so many beams, each thinner than the one before: alternating joints about z and y."""
    sizes = ((300.0, 3.0e7), (400.0, 2.4e7), (350.0, 2.0e7), (200.0, 1.8e7))
    return tuple(
        Link(name, "zy"[k % 2], 1e-9, length, EA * width, 300.0 * EA * width, 200.0 * EA * width)
        for k, (name, (length, EA)) in enumerate(zip(names, sizes, strict=False))
    )


def model(links, postures):
    """The text of the arm's model file."""
    tables = (
        part_text(
            "joint" if link.gives == FREE else "actuated", f"j-{link.name}", axis=link.axis,
            **({} if link.gives == FREE else {"compliance_rad_per_Nmm": link.gives}),
        )
        + part_text("beam", link.name, length_mm=link.length, section=link.section())
        for link in links
    )  # fmt: skip
    joints = [f"j-{link.name}" for link in links]
    rows = {label: dict(zip(joints, map(float, angles), strict=True)) for label, angles in postures.items()}
    return model_text("arm", *tables, postures=rows)


class Arm:
    """An arm in a posture.

    Attributes:
        line: unit vectors ``(3,)`` along the links by name.
        moves: what 1 mm along a link or 1 rad in a joint does to the end-effector ``(6,)`` by name.
        joints: compliance of the joints at the end-effector ``(6, 6)``.
        beams: likewise of each beam by its name.
        gears: likewise of each joint.
    """

    def __init__(self, links, angles):
        R, p = np.eye(3), np.zeros(3)
        places = []
        for link, angle in zip(links, angles, strict=True):
            about, at = R @ np.array(AXES[link.axis]), p
            R = R @ turned(link.axis, angle)
            p = p + R @ np.array([link.length, 0.0, 0.0])
            places.append((link, about, at, R, p))
        self.line = {link.name: R[:, 0] for link, _, _, R, _ in places}
        self.moves = {name: np.concatenate([line, np.zeros(3)]) for name, line in self.line.items()}
        self.joints, self.beams, self.gears = np.zeros((6, 6)), {}, {}
        for link, about, at, turn, tip in places:
            by_turn = self.moves[f"j-{link.name}"] = np.concatenate([np.cross(about, p - at), about])
            self.gears[f"j-{link.name}"] = link.gives * np.outer(by_turn, by_turn)
            self.joints += self.gears[f"j-{link.name}"]
            world = np.kron(np.eye(2), turn)
            moved = np.eye(6)
            moved[:3, 3:] = -cross(p - tip)
            self.beams[link.name] = moved @ world @ link.flexibility() @ world.T @ moved.T

    def compliance(self, factors=None):
        """At the end-effector ``(6, 6)``, each beam's times its factor."""
        return self.joints + sum((factors or {}).get(name, 1.0) * C for name, C in self.beams.items())

    def shifted(self, u, link, law, factors=None):
        """Wrenches ``(n, 6)`` at displacements ``(n, 6)`` where ``law(N)`` mm slip along a link under N newtons.

        In a joint, ``j-`` and the link's name, these are rad and N mm.
        """
        K = np.linalg.inv(self.compliance(factors))
        b = self.moves[link]
        result = np.empty((len(u), 6))
        for k, one in enumerate(u):
            all_of_it, stiff = b @ K @ one, b @ K @ b
            most = abs(all_of_it) + stiff * abs(law(0.0)) + 1.0
            N = brentq(lambda N: N + stiff * law(N) - all_of_it, -most, most, xtol=1e-12)  # noqa: B023
            result[k] = K @ (one - b * law(N))
        return result

    def loose(self, u, link, gap, factors=None):
        """The same with a play of a whole travel ``gap``, the unloaded arm in its middle, with hard ends."""
        K = np.linalg.inv(self.compliance(factors))
        b = self.moves[link]
        x = np.clip(u @ K @ b / (b @ K @ b), -0.5 * gap, 0.5 * gap)
        return (u - np.outer(x, b)) @ K

    def yielding(self, u, link, limit, soft, factors=None):
        """The same where it yields along the link from ``limit`` N on, ``soft`` mm/N, hardening kinematic."""
        K = np.linalg.inv(self.compliance(factors))
        b = self.moves[link]
        stiff, slip = b @ K @ b, 0.0
        result = np.empty((len(u), 6))
        for k, one in enumerate(u):
            # the force if nothing slips now, over what has moved the elastic range
            over = b @ K @ (one - b * slip) - slip / soft
            if abs(over) > limit:
                slip += np.sign(over) * (abs(over) - limit) / (stiff + 1.0 / soft)
            result[k] = K @ (one - b * slip)
        return result

    def pull_and_push(self, u, link, ratio, factors=None):
        """The same where a link is so many times as stiff in pull as in push, in the mean as drawn."""
        own = dict(factors or {})
        kept = own.get(link, 1.0)
        result = np.empty((len(u), 6))
        for k, one in enumerate(u):
            for power in (-0.5, 0.5):
                own[link] = kept * ratio**power
                W = np.linalg.solve(self.compliance(own), one)
                if (W[:3] @ self.line[link] >= 0.0) == (power < 0.0):
                    result[k] = W
        return result

    def creeping(self, time, u, link, share, tau, factors=None, steps=50):
        """The same where a share of the beam's stiffness relaxes with a time tau: backward Euler in small steps.

        Its compliance gains ``share/(1 − share)`` of itself with a delay of ``tau/(1 − share)``.
        """
        own = factors or {}
        part = own.get(link, 1.0) * (self.beams | self.gears)[link]
        C, gain = self.compliance(own), part * share / (1.0 - share)
        v, result = np.zeros(6), np.zeros((len(u), 6))
        for k in range(1, len(time)):
            h = (time[k] - time[k - 1]) / steps * (1.0 - share) / tau
            for i in range(1, steps + 1):
                one = u[k - 1] + (u[k] - u[k - 1]) * i / steps
                # v = (v + h gain F)/(1 + h), F = C⁻¹ (u − v)
                F = np.linalg.solve(C + h / (1.0 + h) * gain, one - v / (1.0 + h))
                v = (v + h * gain @ F) / (1.0 + h)
            result[k] = F
        return result
