"""Compile every kernel into the cache beside it: ``python -m vjm.warm_up``, which the installation runs once.

Compiling takes a minute. Whoever installs without this step waits for it in the first command.
"""

from __future__ import annotations

import numpy as np

from vjm.grid import walk_grid
from vjm.io.manipulator_file import load_manipulator
from vjm.io.model_file import load_chain
from vjm.manipulator.many import packed_machine, platforms, weakest
from vjm.parameters import compliance_factor
from vjm.programme import ARC, Load, Programme
from vjm.sensitivity import wrench_sensitivity
from vjm.vjm_engine import VjmEngine


def main() -> None:
    """Walk a short path of each kind."""
    chain, engine = load_chain("orthoglide-chain"), VjmEngine(4)
    programme = Programme("A", -3.0)
    path = engine.walk(chain, programme)
    wrench_sensitivity(engine, chain, path, [compliance_factor(chain, "link")])
    walk_grid(engine.problem(chain, programme), np.linspace(0.0, 0.1, 5))
    follower = Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), "link", 0.5, follower=True)
    engine.walk(chain, Programme("A", 1.0, "load", loads=(follower,), control=ARC))
    machine = packed_machine(load_manipulator("orthoglide"), VjmEngine())
    platforms(machine, np.zeros((1, 6)), np.zeros(6))
    weakest(machine, np.zeros(6), 1.0)


if __name__ == "__main__":
    main()
