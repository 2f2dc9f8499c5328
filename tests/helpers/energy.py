"""An independent solver: the energy of a machine minimised with its own kinematics, gradients by complex steps.

It shares no code with the package but the description of the parts. Rotations are Rodrigues' formula on complex
angles, so that a gradient is exact to rounding; second derivatives are differences of gradients.
"""

import numpy as np
from scipy.optimize import brentq

from helpers.laws import law_energy, law_slope
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset

TINY = 1e-30
"""Complex step: its square is lost in rounding."""
STEP = 1e-4
"""Step of the differences of gradients: an error of its fourth power, 1e-16, and of rounding over it, 1e-12."""


def rotated(axis, angle):
    """Rotations ``(k, 3, 3)`` about an axis by complex angles ``(k,)``."""
    x, y, z = axis
    S = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=float)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * S + (1 - c) * (S @ S)


def beam_compliance(beam: Beam) -> np.ndarray:
    """Compliance ``(6, 6)`` of a beam at its tip, own axes: as given, else by textbook formulas of a cantilever."""
    if beam.compliance is not None:
        return beam.compliance / beam.count
    s, L = beam.section, beam.length
    across = (L**3 / 3 / s.EIz + L / s.GAy, L**3 / 3 / s.EIy + L / s.GAz)
    C = np.diag([L / s.EA, *across, L / s.GJ, L / s.EIy, L / s.EIz])
    C[1, 5] = C[5, 1] = L**2 / 2 / s.EIz
    C[2, 4] = C[4, 2] = -(L**2) / 2 / s.EIy
    R = np.kron(np.eye(2), beam.section_frame)
    x, y, z = beam.end_offset
    arm = np.eye(6)
    arm[:3, 3:] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return arm @ R @ C @ R.T @ arm.T / beam.count


class Energy:
    """Potential energy of a chain or tree of linear springs under weight, dead forces and end forces."""

    def __init__(self, chain: Machine, values: dict[str, float], gravity, loads=(), ends=None):
        self.chain, self.values, self.gravity, self.loads = chain, values, np.array(gravity, dtype=float), loads
        self.ends = dict(chain.ends) or {"": chain.parts[-1].name}
        self.force = np.zeros((len(self.ends), 3))
        self.size = 0
        self.places(np.zeros((1, 200)))
        self.size = self.used

    def places(self, x):
        """Strain energy, weights' energy, and where parts begin and end, at rows ``x`` (k, n)."""
        k = len(x)
        self.used, strain = 0, np.zeros(k, dtype=complex)
        weight = np.zeros(k, dtype=complex)
        begin, end, own, held = {}, {}, {}, dict(self.values)
        R, p = np.broadcast_to(self.chain.base[:3, :3], (k, 3, 3)), np.broadcast_to(self.chain.base[:3, 3], (k, 3))
        end[""] = (R, p)
        begin[""] = (np.broadcast_to(np.eye(3), (k, 3, 3)), np.zeros((k, 3)))
        last = ""

        def take(count):
            first = self.used
            self.used += count
            return x[:, first : first + count]

        def spring6(R, p, compliance):
            nonlocal strain
            gives = np.flatnonzero(compliance.any(axis=0))
            theta = take(len(gives))
            K = np.linalg.inv(compliance[np.ix_(gives, gives)])
            strain = strain + 0.5 * np.einsum("ki,ij,kj->k", theta, K, theta)
            for column, i in zip(theta.T, gives, strict=True):
                axis = np.eye(3)[i % 3]
                if i < 3:
                    p = p + (R @ axis) * column[:, None]
                else:
                    R = R @ rotated(axis, column)
            return R, p

        def move(R, p, axis, slides, amount):
            amount = np.broadcast_to(amount, (k,))
            if slides:
                return R, p + (R @ axis) * amount[:, None]
            return R @ rotated(axis, amount), p

        def one(R, p, axis, slides, compliance, rest=0.0, law=None):
            nonlocal strain
            theta = take(1)[:, 0]
            own = 0.5 * (theta - rest) ** 2 / compliance if law is None else law_energy(law, theta - rest)
            strain = strain + own
            R, p = move(R, p, axis, slides, theta)
            return R, p, theta

        for part in self.chain.parts:
            where = self.chain.after.get(part.name, last)
            R, p = end[where]
            begin[part.name] = (R, p)
            if isinstance(part, RigidOffset):
                if part.mass:
                    centre = p + R @ part.centre_of_mass
                    weight = weight - part.mass * centre @ self.gravity
                p = p + R @ part.transform[:3, 3]
                R = R @ part.transform[:3, :3]
            elif isinstance(part, Beam):
                # the spring of the whole part at its tip, in its own axes
                p = p + R @ part.tip
                R, p = spring6(R @ part.own_frame, p, beam_compliance(part))
                R = R @ part.own_frame.T
            elif part.free:
                R, p = move(R, p, part.axis, part.slides, held[part.name] + take(1)[:, 0])
            else:
                if part.coupling is not None:
                    held[part.name] = part.coupling.offset + sum(r * held[name] for name, r in part.coupling.ratios)
                if not part.fixed:
                    R, p = move(R, p, part.axis, part.slides, held[part.name])
                if part.coupling is not None and part.coupling.as_deflected:
                    for name, ratio in part.coupling.ratios:
                        if name in own:
                            R, p = move(R, p, part.axis, part.slides, ratio * own[name])
                if part.matrix is not None:
                    R, p = spring6(R, p, part.matrix)
                i = int(np.argmax(np.abs(part.axis)))
                across = [np.eye(3)[(i + 1) % 3], np.eye(3)[(i + 2) % 3]]
                for axis, compliance in zip(across, part.lateral, strict=True):
                    if compliance:
                        R, p, _ = one(R, p, axis, False, compliance)
                if part.compliance or part.law is not None:
                    rest = part.preload * part.compliance if part.rest is None else part.rest - held[part.name]
                    if part.law is not None and part.preload:
                        # its slope at the rest that balances the preload; bisection asks for nothing else
                        rest = brentq(lambda r, p=part: law_slope(p.law, -r) + p.preload, -1e3, 1e3, xtol=1e-16)
                    R, p, own[part.name] = one(R, p, part.axis, part.slides, part.compliance, rest, part.law)
            if isinstance(part, Joint) and not part.fixed:
                begin[part.name] = (R, p)
            end[part.name] = (R, p)
            last = part.name
        return strain, weight, begin, end

    def __call__(self, x):
        strain, energy, begin, end = self.places(x)
        energy = energy + strain
        for spring in self.chain.point_springs:
            places = []
            for name, point in zip(spring.parts, spring.points, strict=True):
                # a beam is one spring at its tip here: what is fixed to it goes with the tip
                beam = next((part for part in self.chain.beams if part.name == name), None)
                R, p = begin[name] if beam is None else end[name]
                places.append(p + R @ (point if beam is None else point - beam.tip))
            a, b = places
            length = np.sqrt(np.sum((b - a) ** 2, axis=1))
            stretch = length - spring.free_length
            own = 0.5 * spring.stiffness * stretch**2 if spring.law is None else law_energy(spring.law, stretch)
            energy = energy + own + spring.preload * length
        for load in self.loads:
            energy = energy - end[load.part][1] @ np.array(load.wrench[:3])
        for force, part in zip(self.force, self.ends.values(), strict=True):
            energy = energy - end[part][1] @ force
        return energy

    def gradient(self, x):
        """Gradient ``(n,)`` at ``x`` (n,)."""
        steps = x + 1j * TINY * np.eye(self.size)
        return self(steps).imag / TINY

    def hessian(self, x):
        """Second derivatives ``(n, n)``."""
        unit = np.eye(self.size) * STEP
        slopes = [[(self.gradient(x + s * d) - self.gradient(x - s * d)) / s for d in unit] for s in (1, 2)]
        H = (4 * np.array(slopes[0]) - np.array(slopes[1])) / (6 * STEP)
        return 0.5 * (H + H.T)

    def minimum(self, x, hessian=None):
        """Where the energy is least, near ``x``."""
        before = np.inf
        for turn in range(60):
            if hessian is None or turn % 8 == 7:
                hessian = self.hessian(x)
            step = np.linalg.solve(hessian, self.gradient(x))
            size = np.abs(step).max()
            x = x - step * min(1.0, 0.3 / max(size, 1e-300))
            # until rounding stops it
            if size == 0.0 or (size < 1e-7 and size > 0.3 * before):
                return x
            before = size
        raise AssertionError("the energy has no minimum near the unloaded posture")

    def position(self, x, end):
        """Position ``(3,)`` of an end frame."""
        _, _, _, ends = self.places(x[None])
        return ends[self.ends[end]][1][0].real

    def force_compliance(self, x, end):
        """Compliance ``(3, 3)`` of an end frame under forces, from the second derivatives of the energy."""
        _, _, _, ends = self.places(x + 1j * TINY * np.eye(self.size))
        rates = ends[self.ends[end]][1].imag / TINY
        return rates.T @ np.linalg.solve(self.hessian(x), rates)

    def stiffness(self, x, end=""):
        """Stiffness ``(6, 6)`` of an end frame whose pose is imposed, world axes, N, mm, rad.

        ``H dx = Jᵀ dF``, ``J dx = dt``: passive joints have no energy, so that H may be singular.
        """
        _, _, _, ends = self.places(x + 1j * TINY * np.eye(self.size))
        R, p = ends[self.ends[end]]
        spin = (R.imag / TINY) @ R[0].real.T
        J = np.hstack([p.imag / TINY, spin[:, 2, 1, None], spin[:, 0, 2, None], spin[:, 1, 0, None]]).T
        M = np.block([[self.hessian(x), -J.T], [J, np.zeros((6, 6))]])
        # entries from 1e-6 to 1e12: scaled by rows and columns alike
        size = np.sqrt(np.abs(M).max(axis=1))
        return (np.linalg.inv(M / size[:, None] / size) / size[:, None] / size)[self.size :, self.size :]


def load_on(part, force):
    """A dead force at the end of a part."""
    return Load((*force, 0.0, 0.0, 0.0), part)
