"""The loaded stiffness of the earlier literature: Jacobians and Hessians of the unloaded posture.

The paper's references [7] and [8] account for the load in the stiffness but not in the configuration. Taken
along a path this is ``dF = K^F(J₀, H₀(F)) dt`` with the geometry frozen, and buckling where ``K − H₀(F)``
loses its definiteness on the null space of J₀. Nothing holds beyond that point.

The integration must be exact for the verdict to be the model's own. Where the mode that softens is coupled
to the driven direction (postures B and D), K^F tends to minus infinity as the eigenvalue tends to zero, so
that the force yields first and the eigenvalue never gets there; an explicit Euler integration steps across
and reports a bifurcation that its step made.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from vjm.baselines.linear import linear_model
from vjm.continuation.path import Equilibrium, Event, EventKind, Path
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import LoadCase, refuse_unless_pose_only
from vjm.model.lumped import LumpedModel
from vjm.rotations import Array
from vjm.statics.equilibrium import Configuration
from vjm.statics.stability import stability
from vjm.statics.stiffness import loaded_stiffness
from vjm.threads import single_threaded

RELATIVE_TOLERANCE = 1e-8
"""Of the integration, four orders below the 1e-4 to which events are promised."""


@dataclass(frozen=True)
class UnloadedJacobianEngine:
    """Loaded stiffness on frozen geometry, integrated from zero to its first event: bifurcation or bend-over."""

    label: str = "vjm-unloaded-jacobian"
    points: int = 60

    @single_threaded
    def trace(self, chain: Chain, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Integrate the wrench along the ramp; the path stops at the first event.

        Raises:
            NoConvergenceError: the integration failed.
        """
        refuse_unless_pose_only(self.label, load_case)
        started = time.perf_counter()
        model = linear_model(self.label, chain, load_case.posture)
        x0 = model.configuration(chain.posture(load_case.posture))
        direction = load_case.direction

        def at(wrench: Array) -> Configuration[LumpedModel]:
            return Configuration(model, x0, wrench, 0.0, 0)

        def eigenvalue(_: float, wrench: Array) -> float:
            return stability(at(wrench)).eigenvalue

        half = 0.5 * float(direction @ loaded_stiffness(at(np.zeros(6))) @ direction)

        def excess_stiffness(_: float, wrench: Array) -> float:
            return float(direction @ loaded_stiffness(at(wrench)) @ direction) - half

        for event in (eigenvalue, excess_stiffness):
            event.terminal = True  # type: ignore[attr-defined]
            event.direction = -1  # type: ignore[attr-defined]
        solution = solve_ivp(
            lambda _, wrench: loaded_stiffness(at(wrench)) @ direction,
            (0.0, load_case.length),
            np.zeros(6),
            rtol=RELATIVE_TOLERANCE,
            atol=RELATIVE_TOLERANCE * model.wrench_scale,
            events=(eigenvalue, excess_stiffness),
            dense_output=True,
            max_step=load_case.length / 50.0,
        )
        wrench_at = solution.sol
        if not solution.success or wrench_at is None or solution.y_events is None:
            raise NoConvergenceError(f"{self.label}: the integration failed: {solution.message}")

        def point(s: float, wrench: Array) -> Equilibrium:
            frozen = at(wrench)
            K = loaded_stiffness(frozen)
            verdict = stability(frozen)
            return Equilibrium(
                s=s,
                displacement=load_case.displacement(s),
                wrench=wrench,
                tangent=float(direction @ K @ direction),
                eigenvalue=verdict.eigenvalue,
                unstable=verdict.unstable,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=K,
            )

        events: tuple[Event, ...] = ()
        stopped = ""
        end = float(solution.t[-1])
        for kind, states in zip((EventKind.BIFURCATION, EventKind.BEND_OVER), solution.y_events, strict=True):
            if len(states):
                force = float(direction @ states[0])
                before = None
                if kind is EventKind.BIFURCATION:
                    before = point(0.99 * end, wrench_at(0.99 * end)).tangent
                events = (Event(kind, end, force, stiffness_before=before),)
                stopped = f"frozen geometry says nothing beyond its first event, the {kind}"
                break
        # stop short of the event itself, where the frozen stiffness may be infinite
        last = end * (1.0 - 1e-6) if events else end
        points = tuple(point(float(s), wrench_at(s)) for s in np.linspace(0.0, last, self.points))
        return Path(
            self.label, chain.name, load_case, points, events, stopped=stopped,
            seconds=time.perf_counter() - started, model_sha256=chain.sha256,
        )  # fmt: skip
