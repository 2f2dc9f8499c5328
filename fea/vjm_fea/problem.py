"""Equilibria of an Exudyn system at an imposed end-effector pose, as a problem that can be followed."""

from __future__ import annotations

import numpy as np

from vjm.chain import Chain
from vjm.equilibrium import NoConvergenceError
from vjm.paths import Equilibrium, StationLabel
from vjm.programme import Programme
from vjm.rotations import Array, rotation_from_vector
from vjm_fea.mesh import Mesh
from vjm_fea.quaternions import quaternion
from vjm_fea.statics import Statics, Tangent
from vjm_fea.system import ExudynSystem

TOLERANCE = 1e-11
"""Scaled residual at which an equilibrium counts as found: a thousand times what rounding leaves of it."""
MAX_ITERATIONS = 20
DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""
FIRST_AMPLITUDE = 1e-3
"""First guess of the buckling mode's scaled amplitude on a new branch."""
AMPLITUDE_TRIALS = 12
NEAR = 0.1
"""How near to the wanted distance behind the bifurcation the amplitude's search ends, relative."""


class ExudynProblem:
    """A chain in a posture, meshed, under a ramp of its end-effector's displacement.

    Newton's method on Exudyn's residual with the exact tangent; it follows unstable equilibria as readily as
    stable ones, and each says by its eigenvalue which it is.

    Attributes:
        label: of the engine.
        stations: labels of the rows of the shapes.
        statics: the system's residual and tangent.
    """

    def __init__(self, chain: Chain, programme: Programme, mesh: Mesh, label: str) -> None:
        self.label = label
        self.programme = programme
        system = ExudynSystem(chain, chain.posture(programme.posture), mesh)
        self.statics = Statics(system, chain.characteristic_length)
        self.stations: tuple[StationLabel, ...] = tuple(s.label for s in system.stations)
        self._end = system.end
        self._drive = programme.direction / self.statics.unit[self.statics.held]
        """Scaled motion ``(6,)`` of the end-effector per unit of s."""

    def unloaded(self) -> Equilibrium:
        """The reference configuration."""
        return self._solve(np.zeros(6), self.statics.initial)

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` from the state of ``start``, along ``slope`` or else along the tangent.

        Raises:
            NoConvergenceError: Newton's method did not converge.
        """
        if slope is None:
            state = self._advanced(start.state, self.statics.tangent(start.state), s - start.s)
        else:
            state = self.statics.normalised(start.state + slope * (s - start.s))
        return self._solve(self.programme.displacement(s), state)

    def solve_pose(self, displacement: Array, start: Equilibrium) -> Equilibrium:
        """Equilibrium near ``start`` at any displacement ``(6,)`` of the end-effector from its unloaded pose.

        Raises:
            NoConvergenceError: Newton's method did not converge.
        """
        return self._solve(np.asarray(displacement, dtype=float), start.state)

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A stable state on the branch that leaves ``critical`` along its softest motion, at ``s`` behind it.

        No imperfection is used: the motion's amplitude is prescribed and the displacement solved for, and the
        amplitude sought at which the displacement is ``s``.

        Raises:
            NoConvergenceError: no branch was found, it does not lead onwards, or it is unstable.
        """
        tangent = self.statics.tangent(critical.state)
        mode = self._oriented(critical.state, tangent, sign)
        amplitude = FIRST_AMPLITUDE
        wanted = s - critical.s
        for _ in range(AMPLITUDE_TRIALS):
            state, reached = self._on_branch(critical, mode, amplitude)
            if reached <= critical.s:
                raise NoConvergenceError("the crossing branch leads backwards")
            ratio = (reached - critical.s) / wanted
            if abs(ratio - 1.0) < NEAR:
                break
            # a symmetric bifurcation: the displacement grows with the amplitude's square
            amplitude *= float(np.clip(ratio**-0.5, 0.1, 10.0))
        else:
            raise NoConvergenceError(f"no amplitude of the buckling mode found for s = {s:.6g}")
        found = self._solve(self.programme.displacement(s), state)
        branch = self.statics.shape(state)
        if _distance(found.shape, branch) > 0.5 * _distance(critical.shape, branch):
            raise NoConvergenceError("fell back to the branch that loses its stability")
        if found.unstable != 0:
            raise NoConvergenceError(f"the branch found has {found.unstable} unstable modes")
        return found

    def loaded_stiffness(self, equilibrium: Equilibrium) -> Array:
        """Loaded stiffness ``(6, 6)``, see `Statics.end_stiffness`; N/mm, N, N mm."""
        state = equilibrium.state
        return self.statics.end_stiffness(state, self.statics.tangent(state))

    # --- Newton -------------------------------------------------------------------------------------------

    def _solve(self, d: Array, state: Array) -> Equilibrium:
        state = self.statics.with_tool(
            state,
            self._end[:3, 3] + d[:3],
            # the end-effector's node is in the world's axes in the reference configuration
            quaternion(rotation_from_vector(d[3:])),
        )
        tangent: Tangent | None = None
        for iteration in range(MAX_ITERATIONS + 1):
            r = self.statics.residual(state)[self.statics.free]
            error = float(np.max(np.abs(r), initial=0.0))
            if error < TOLERANCE:
                return self._equilibrium(d, state, iteration, error)
            if not np.isfinite(error) or error > DIVERGED:
                break
            tangent = self.statics.tangent(state, like=tangent)
            try:
                state = self._moved(state, tangent.solve(-r))
            except np.linalg.LinAlgError:
                break
        raise NoConvergenceError(f"Newton stopped after {iteration} iterations at a scaled residual of {error:.1e}")

    def _advanced(self, state: Array, tangent: Tangent, ds: float) -> Array:
        return self._moved(state, tangent.response() @ self._drive * ds, self._drive * ds)

    def _moved(self, state: Array, free: Array, held: Array | float = 0.0) -> Array:
        motion = np.zeros(len(self.statics.unit))
        motion[self.statics.free], motion[self.statics.held] = free, held
        return self.statics.moved(state, motion)

    def _on_branch(self, critical: Equilibrium, mode: Array, amplitude: float) -> tuple[Array, float]:
        """The state with a prescribed amplitude of the mode, and the displacement s that goes with it."""
        state = self._moved(critical.state, amplitude * mode)
        s = critical.s
        here: Tangent | None = None
        for _ in range(MAX_ITERATIONS):
            r = self.statics.residual(state)[self.statics.free]
            if np.max(np.abs(r)) < TOLERANCE:
                return state, s
            here = self.statics.tangent(state, like=here)
            n = len(r)
            bordered = np.zeros((n + 1, n + 1))
            bordered[:n, :n] = here.J[np.ix_(here.free, here.free)]
            bordered[:n, n] = here.J[np.ix_(here.free, here.held)] @ self._drive
            bordered[n, :n] = mode
            step = np.linalg.solve(bordered, np.append(-r, 0.0))
            state = self._moved(state, step[:n], step[n] * self._drive)
            s += step[n]
        raise NoConvergenceError("no equilibrium with the prescribed amplitude of the buckling mode")

    def _oriented(self, state: Array, tangent: Tangent, sign: int) -> Array:
        """The softest motion, its largest deflection component of the given sign."""
        mode = tangent.softest()
        tiny = 1e-6
        moved = self.statics.shape(self._moved(state, tiny * mode))
        change = (moved - self.statics.shape(state)).ravel()
        return sign * float(np.sign(change[np.argmax(np.abs(change))])) * mode

    def _equilibrium(self, d: Array, state: Array, iterations: int, error: float) -> Equilibrium:
        tangent = self.statics.tangent(state)
        eigenvalue, unstable = tangent.stability()
        along = self.programme.direction
        return Equilibrium(
            s=float(d @ along / (along @ along)),
            displacement=d,
            wrench=self.statics.wrench(state),
            tangent=float(along @ self.statics.end_stiffness(state, tangent) @ along),
            eigenvalue=eigenvalue,
            unstable=unstable,
            iterations=iterations,
            residual=error,
            shape=self.statics.shape(state),
            state=state,
        )


def _distance(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))
