"""Equilibria of a chain of OpenSees' beams at an imposed end-effector pose, as a problem that can be followed."""

from __future__ import annotations

import numpy as np

from vjm.chain import Chain
from vjm.equilibrium import NoConvergenceError
from vjm.paths import Equilibrium, StationLabel
from vjm.programme import Programme
from vjm.rotations import Array
from vjm_fea.opensees.beams import Beams, Element
from vjm_fea.opensees.statics import Statics
from vjm_fea.opensees.system import ChainSystem

TOLERANCE = 1e-13
"""Scaled residual at which an equilibrium counts as found: some hundred times what rounding leaves of it."""
MAX_ITERATIONS = 25
DIVERGED = 1e6
"""Scaled residual from which Newton's method does not come back."""
FIRST_DEFLECTION = 1e-3
"""First guess of the largest deflection on a new branch, over the chain's characteristic length."""
AMPLITUDE_TRIALS = 12
NEAR = 0.1
"""How near to the wanted distance behind the bifurcation the amplitude's search ends, relative."""


def find_equilibrium(statics: Statics, state: Array) -> tuple[Array, int, float]:
    """Equilibrium by Newton's method, what is held staying where ``state`` has it.

    Returns:
        The state, the number of iterations and the scaled residual.

    Raises:
        NoConvergenceError: it did not converge.
    """
    for iteration in range(MAX_ITERATIONS + 1):
        r = statics.residual(state)[statics.free]
        error = float(np.max(np.abs(r), initial=0.0))
        if error < TOLERANCE:
            return state, iteration, error
        if not error < DIVERGED:
            break
        try:
            state = _moved(statics, state, statics.tangent(state).solve(-r))
        except np.linalg.LinAlgError:
            break
    raise NoConvergenceError(f"Newton stopped after {iteration} iterations at a scaled residual of {error:.1e}")


def _moved(statics: Statics, state: Array, free: Array, held: Array | float = 0.0) -> Array:
    motion = np.zeros(len(statics.unit))
    motion[statics.free], motion[statics.held] = free, held
    return statics.moved(state, motion)


class OpenSeesProblem:
    """A chain in a posture, meshed, under a ramp of its end-effector's displacement.

    Attributes:
        label: of the engine.
        stations: labels of the rows of the shapes.
        statics: residual and tangent.
    """

    def __init__(self, chain: Chain, programme: Programme, elements: int, element: Element, label: str) -> None:
        self.label = label
        self.programme = programme
        system = ChainSystem(chain, chain.posture(programme.posture), elements)
        self._length = chain.characteristic_length
        self.statics = Statics(system, Beams(system.lines, element), self._length)
        self.stations: tuple[StationLabel, ...] = tuple(s.label for s in system.stations)
        self._drive = programme.direction / self.statics.unit[self.statics.tool]
        """Scaled motion ``(6,)`` of the end-effector per unit of s."""

    def unloaded(self) -> Equilibrium:
        """The reference configuration."""
        return self._solve(np.zeros(6), self.statics.initial)

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` from the state of ``start``, along ``slope`` or else along the tangent.

        Raises:
            NoConvergenceError: Newton's method did not converge.
        """
        if slope is not None:
            state = self.statics.normalised(start.state + slope * (s - start.s))
        else:
            held = self._drive * (s - start.s)
            try:
                free = self.statics.tangent(start.state).response(held)
            except np.linalg.LinAlgError as failure:
                raise NoConvergenceError("the tangent is singular") from failure
            state = _moved(self.statics, start.state, free, held)
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
        mode, deflection = self._oriented(critical.state, sign)
        amplitude = FIRST_DEFLECTION * self._length / deflection
        for _ in range(AMPLITUDE_TRIALS):
            state, reached = self._on_branch(critical, mode, amplitude)
            ratio = (reached - critical.s) / (s - critical.s)
            if ratio <= 0.0:
                raise NoConvergenceError("the crossing branch leads backwards")
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
        return self.statics.end_stiffness(self.statics.tangent(equilibrium.state))

    def _solve(self, d: Array, state: Array) -> Equilibrium:
        state, iterations, error = find_equilibrium(self.statics, self.statics.with_tool(state, d))
        tangent = self.statics.tangent(state)
        eigenvalue, unstable = tangent.stability()
        try:
            K = self.statics.end_stiffness(tangent)
        except np.linalg.LinAlgError:
            K = np.full((6, 6), np.nan)
        along = self.programme.direction
        return Equilibrium(
            s=float(d @ along / (along @ along)),
            displacement=d,
            wrench=self.statics.wrench(state),
            tangent=float(along @ K @ along),
            eigenvalue=eigenvalue,
            unstable=unstable,
            iterations=iterations,
            residual=error,
            shape=self.statics.shape(state),
            state=state,
        )

    def _on_branch(self, critical: Equilibrium, mode: Array, amplitude: float) -> tuple[Array, float]:
        """The state with a prescribed amplitude of the mode, and the displacement s that goes with it."""
        statics = self.statics
        state, s = _moved(statics, critical.state, amplitude * mode), critical.s
        for _ in range(MAX_ITERATIONS):
            r = statics.residual(state)[statics.free]
            if np.max(np.abs(r)) < TOLERANCE:
                return state, s
            tangent = statics.tangent(state)
            n = len(r)
            bordered = np.zeros((n + 1, n + 1))
            bordered[:n, :n] = tangent.K[np.ix_(tangent.free, tangent.free)]
            bordered[:n, n] = tangent.K[np.ix_(tangent.free, tangent.held)] @ self._drive
            bordered[n, :n] = mode
            try:
                step = np.linalg.solve(bordered, np.append(-r, 0.0))
            except np.linalg.LinAlgError:
                break
            state = _moved(statics, state, step[:n], step[n] * self._drive)
            s += float(step[n])
        raise NoConvergenceError("no equilibrium with the prescribed amplitude of the buckling mode")

    def _oriented(self, state: Array, sign: int) -> tuple[Array, float]:
        """The softest motion, its largest deflection component of the given sign, and that component in mm."""
        mode = self.statics.tangent(state).softest()
        tiny = 1e-4
        ahead, behind = (self.statics.shape(_moved(self.statics, state, step * mode)) for step in (tiny, -tiny))
        change = ((ahead - behind) / (2.0 * tiny)).ravel()
        largest = float(change[np.argmax(np.abs(change))])
        return sign * float(np.sign(largest)) * mode, abs(largest)


def _distance(a: Array, b: Array) -> float:
    return float(np.max(np.linalg.norm(a - b, axis=1)))
