"""Compile every kernel into the cache beside it: ``python -m vjm.warm_up``, which the installation runs once.

Compiling takes some five minutes of a processor, shared by two processes. Whoever installs without this step waits
for it in the first command.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Sequence

import numpy as np

from vjm.batch import map_all
from vjm.continuation.load_grid import trace_grid
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.kernels.derivatives import frame_derivatives
from vjm.machine.critical_force import CriticalForce
from vjm.machine.equilibria import equilibria, largest_residual, unloaded_frames
from vjm.model.load_case import ARC, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES
from vjm.statics import TOLERANCE


def main(work: Sequence[Callable[[], None]] = ()) -> None:
    """Compute one of each kind: a path, derivatives, a grid, an arm, a platform.

    Kernels that call one another are the work of one process, or both would compile them. That leaves work for two.

    Args:
        work: what else to compute, functions of a module's top level.
    """
    every = (paths, platforms, postures, *work)
    map_all(operator.call, every, min(2, len(os.sched_getaffinity(0))))


def paths() -> None:
    """A path, a grid, and a load that turns with its body."""
    chain, engine = load_chain("orthoglide-chain"), VjmEngine(4)
    load_case = LoadCase("A", -3.0)
    engine.trace(chain, load_case)
    problem = engine.problem(chain, load_case)
    problem.model.stiffness_under(np.zeros(problem.model.size))
    grid = trace_grid(problem, np.linspace(0.0, 0.1, 5))
    problem.model.compiled.correct(
        problem.target(0.0), load_case.direction, grid.s, grid.x, grid.wrench, TOLERANCE, 2
    )
    follower = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), "link", 0.5, follower=True)
    engine.trace(chain, LoadCase("A", 1.0, "load", loads=(follower,), control=ARC))


def postures() -> None:
    """An arm in its posture, and what that depends on."""
    hinge = Machine("hinge", (Joint("q", AXES["z"], compliance=1e-8), RigidOffset("link", mass=1.0)))
    states = equilibria(Mechanism(hinge.split()), np.zeros(1), wrench=np.ones(6))
    largest_residual(states, wrench=np.ones(6))
    unloaded_frames(states.model, states.q)
    model = states.model
    arrays = model.arrays((0.0, 0.0, 0.0), moments=True)
    commands, naturals = model.values(states.q), model.naturals(states.q)
    frame_derivatives(arrays, commands, naturals, np.ones((1, 1, 6)), states.x)


def platforms() -> None:
    """A platform on legs, and its smallest critical force."""
    model = VjmEngine().model(load_model("orthoglide"))
    CriticalForce(model, 0, 1.0).weakest(model.posture(next(iter(model.chain.postures))))


if __name__ == "__main__":
    main()
