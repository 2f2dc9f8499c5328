"""The energy of machines with closed loops: `Energy` with closures and couplings as conditions of its own.

It shares no code with the package but the description of the parts.
"""

import numpy as np

from helpers.energy import TINY, Energy


class ClosedEnergy(Energy):
    """`Energy` whose coordinates keep to closures and couplings; linear about a posture without forces."""

    def __init__(self, chain, values):
        super().__init__(chain, values, (0.0, 0.0, 0.0))

    def conditions(self, x):
        """Rows of closures and couplings ``(k, c)`` at rows ``x`` (k, n)."""
        _, _, _, end = self.places(x)
        k, rows = len(x), [np.zeros((len(x), 0))]
        for closure in self.chain.closures:
            sides = []
            for part, T in zip(closure.parts, closure.frames, strict=True):
                R, p = end[part] if part else (np.broadcast_to(np.eye(3), (k, 3, 3)), np.zeros((k, 3)))
                sides.append((R @ T[:3, :3], p + R @ T[:3, 3]))
            (A, a), (B, b) = sides
            rows.append(b - a)
            if not closure.turns:
                D = B @ np.swapaxes(A, 1, 2)
                turned = [D[:, i, k] - D[:, k, i] for i, k in ((2, 1), (0, 2), (1, 0))]
                rows.append(0.5 * np.stack(turned, axis=1))
        at = self.passive()
        for coupling in self.chain.couplings:
            total = sum(w * (self.values[name] + x[:, at[name]]) for name, w in coupling.terms)
            rows.append((total - coupling.total)[:, None])
        return np.hstack(rows)

    def passive(self):
        """Coordinate of each passive joint: that which alone moves what lies behind it, and strains nothing."""
        H = self.hessian(np.zeros(self.size))
        loose = np.flatnonzero(~H.any(axis=1))
        return dict(zip((joint.name for joint in self.chain.joints), loose.tolist(), strict=True))

    def end_stiffness(self):
        """Stiffness ``(6, 6)`` of the end-effector whose pose is imposed, world axes, N, mm, rad."""
        x = 1j * TINY * np.eye(self.size)
        _, _, _, ends = self.places(x)
        R, p = ends[self.chain.parts[-1].name]
        spin = (R.imag / TINY) @ R[0].real.T
        J = np.hstack([p.imag / TINY, spin[:, 2, 1, None], spin[:, 0, 2, None], spin[:, 1, 0, None]]).T
        C = (self.conditions(x).imag / TINY).T
        assert np.abs(self.conditions(np.zeros((1, self.size))).real).max(initial=0.0) < 1e-9
        H = self.hessian(np.zeros(self.size))
        # motions that keep to the conditions, whatever their rank, and the energy among them
        _, values, V = np.linalg.svd(C)
        N = V[np.count_nonzero(values > 1e-9 * values.max(initial=0.0)) :].T
        H, J = N.T @ H @ N, J @ N
        M = np.block([[H, -J.T], [J, np.zeros((6, 6))]])
        size = np.sqrt(np.abs(M).max(axis=1))
        return (np.linalg.inv(M / size[:, None] / size) / size[:, None] / size)[len(H) :, len(H) :]
