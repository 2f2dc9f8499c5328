"""The virtual joint method as an engine: springs, equilibrium, stability and branches of a lumped chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vjm.chain import FOOT, Chain
from vjm.equilibrium import (
    TOLERANCE,
    Configuration,
    NoConvergenceError,
    solve_newton,
)
from vjm.following import follow
from vjm.lumped import LumpedModel
from vjm.parts import Placement
from vjm.paths import Equilibrium, Path, StationLabel
from vjm.programme import Programme
from vjm.rotations import Array, displaced
from vjm.stability import critical_modes, stability
from vjm.stiffness import loaded_stiffness

ROUNDING = 1e-10
"""Stiffness, in the model's own units, below which an entry of K^F is zero but for rounding."""
NEUTRAL = 1e-6
"""Eigenvalue over the smallest unloaded one up to which a motion costs nothing. A bowed bar that bends alike in all
planes turns freely about its chord; that the springs' order of turns prefers one plane is not instability."""
DIRECTIONS = 8
"""In which a branch is looked for where two modes lose their stability at once, over half a turn between them."""
FIRST_AMPLITUDE = 1e-3
"""Scaled amplitude of the critical mode at which a crossing branch is first looked for."""


class LumpedProblem:
    """A lumped model in a posture under a ramp: the `vjm.following.Problem` of the virtual joint method."""

    def __init__(self, model: LumpedModel, programme: Programme, label: str) -> None:
        self.model = model
        self.label = label
        self.programme = programme
        self.stations = tuple(StationLabel(s.part, s.fraction) for s in model.stations)
        self._x0 = model.configuration(model.chain.posture(programme.posture))
        self._pose0 = model.kinematics(self._x0).end
        self._softest = stability(Configuration(model, self._x0, np.zeros(6), 0.0, 0)).eigenvalue

    def target(self, s: float) -> Array:
        """End-effector frame ``(4, 4)`` that is imposed at the path parameter ``s``."""
        return displaced(self._pose0, self.programme.displacement(s))

    def unloaded(self) -> Equilibrium:
        """The posture as drawn."""
        return self.equilibrium(0.0, Configuration(self.model, self._x0, np.zeros(6), 0.0, 0))

    def solve(self, s: float, start: Equilibrium, slope: Array | None = None) -> Equilibrium:
        """Equilibrium at ``s`` by Newton-Raphson from a neighbour, prolonged along its slope."""
        state = start.state if slope is None else start.state + slope * (s - start.s)
        m = self.model.size
        return self.equilibrium(s, solve_newton(self.model, self.target(s), state[:m], state[m:]))

    def switch(self, critical: Equilibrium, s: float, sign: int) -> Equilibrium:
        """A state at ``s`` on the branch that crosses at a bifurcation, without an imperfection.

        The branch is entered by its own amplitude: the component of the motion along the critical mode is
        imposed and the end-effector's displacement is what results. It grows with the amplitude squared,
        which gives the amplitude that belongs to ``s``.
        """
        at = self.configuration(critical)
        modes = critical_modes(at)
        if len(modes) == 1:
            return self._branch(at, sign * modes[0], critical.s, s)
        # where two modes meet, any mixture of them leads to a branch: take the one that is firmest
        angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        failure = NoConvergenceError("no branch was found where two modes lose their stability at once")
        found = []
        for angle in angles:
            mode = np.cos(angle) * modes[0] + np.sin(angle) * modes[1]
            try:
                found.append(self._branch(at, sign * mode, critical.s, s))
            except NoConvergenceError as error:
                failure = error
        if not found:
            raise failure
        return min(found, key=lambda point: (point.unstable, -point.eigenvalue))

    def _branch(self, at: Configuration, mode: Array, critical: float, s: float) -> Equilibrium:
        """A state at ``s`` on the branch that leaves ``at``, the state at ``critical``, along ``mode``."""
        amplitude = FIRST_AMPLITUDE
        beyond, _ = self._on_branch(at, mode, amplitude, critical)
        if beyond <= critical:
            raise NoConvergenceError("the crossing branch turns back: the bifurcation is subcritical")
        amplitude *= np.sqrt((s - critical) / (beyond - critical))
        beyond, near = self._on_branch(at, mode, amplitude, critical)
        there = self.solve(s, self.equilibrium(beyond, near))
        along = mode @ ((there.state[: self.model.size] - at.x) / self.model.coordinate_scale**2)
        if along < 0.5 * amplitude:
            raise NoConvergenceError("Newton fell back from the crossing branch")
        return there

    def point(self, s: float, x: Array, wrench: Array) -> Equilibrium:
        """What the path keeps of an equilibrium at ``s``, coordinates ``(n,)`` and wrench ``(6,)``."""
        return self.equilibrium(s, Configuration(self.model, x, wrench, 0.0, 0))

    def configuration(self, point: Equilibrium) -> Configuration:
        """The joint coordinates and the wrench of a point of this problem's path."""
        m = self.model.size
        return Configuration(self.model, point.state[:m], point.state[m:], point.residual, point.iterations)

    def equilibrium(self, s: float, at: Configuration) -> Equilibrium:
        """What the path keeps of a configuration: stiffness (18), stability, shape."""
        K = self._stiffness(at)
        verdict = stability(at)
        unstable = verdict.unstable
        if unstable and abs(verdict.eigenvalue) < NEUTRAL * self._softest:
            unstable -= 1
        direction = self.programme.direction
        return Equilibrium(
            s=s,
            displacement=self.programme.displacement(s),
            wrench=at.wrench,
            tangent=float(direction @ K @ direction),
            eigenvalue=verdict.eigenvalue,
            unstable=unstable,
            iterations=at.iterations,
            residual=at.residual,
            shape=self.model.compiled.shape(at.x),
            state=np.concatenate([at.x, at.wrench]),
            stiffness=K,
        )

    def _stiffness(self, at: Configuration) -> Array:
        """K^F (18) ``(6, 6)``: what is zero but for rounding is zero, and nan at a critical point."""
        try:
            K = loaded_stiffness(at)
        except np.linalg.LinAlgError:
            return np.full((6, 6), np.nan)
        unit = self.model.wrench_scale
        K[np.abs(K) < ROUNDING * unit[:, None] * unit / unit[3]] = 0.0
        return K

    def _on_branch(
        self, at: Configuration, mode: Array, amplitude: float, s: float, max_iterations: int = 30
    ) -> tuple[float, Configuration]:
        """Displacement and configuration at which the motion from ``at`` along ``mode`` has an amplitude."""
        model = self.model
        x, wrench = at.x + amplitude * mode, at.wrench
        row = mode / model.coordinate_scale**2
        error = np.inf
        for iteration in range(max_iterations):
            statics, gap, error = model.compiled.residual(x, wrench, self.target(s))
            missing = amplitude - row @ (x - at.x)
            if error < TOLERANCE and abs(missing) < TOLERANCE:
                return s, Configuration(model, x, wrench, error, iteration)
            # bordered by the amplitude's condition, for which the displacement s is free
            try:
                dx, dF = model.compiled.response(x, wrench, statics, gap)
                dx_ds, dF_ds = model.compiled.response(x, wrench, np.zeros(model.size), self.programme.direction)
            except np.linalg.LinAlgError:
                break
            ds = float((missing - row @ dx) / (row @ dx_ds))
            x = x + dx + ds * dx_ds
            wrench = wrench + dF + ds * dF_ds
            s = s + ds
        raise NoConvergenceError(f"no state found on the crossing branch (scaled residual {error:.1e})")


@dataclass(frozen=True)
class VjmEngine:
    """The virtual joint method with any number of springs.

    Attributes:
        segments: springs in every beam but the foot; None: one spring with the printed 6×6 compliance at the
            far end of each link, the paper's model.
        foot_segments: springs in the foot; None or 1: its 6×6 compliance at its tip, by (22).
        placement: where a spring sits in its segment.
    """

    segments: int | None = None
    foot_segments: int | None = None
    placement: Placement = Placement.BEST

    @property
    def label(self) -> str:
        """``vjm-paper``, ``vjm-16`` or ``vjm-16f16``, with the placement where it is not the best."""
        if self.segments is None:
            return "vjm-paper"
        foot = f"f{self.foot_segments}" if self.foot_segments and self.foot_segments > 1 else ""
        place = "" if self.placement is Placement.BEST else f"-{self.placement}"
        return f"vjm-{self.segments}{foot}{place}"

    def model(self, chain: Chain) -> LumpedModel:
        """The chain with this engine's springs.

        Raises:
            ValueError: a beam that is to be split has no section.
        """
        if self.segments is not None:
            chain = chain.refined(self.segments, self.placement)
        if self.foot_segments is not None and self.foot_segments > 1:
            chain = chain.refined({FOOT: self.foot_segments}, self.placement)
        return LumpedModel(chain)

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the programme, staying on the stable path; see `vjm.following.follow`."""
        problem = LumpedProblem(self.model(chain), programme, self.label)
        path = follow(problem, programme, progress=progress)
        return replace(path, model=chain.name, model_sha256=chain.sha256)
