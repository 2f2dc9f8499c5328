"""Compile every kernel into the cache beside it: ``python -m vjm.warm_up``, which the installation runs once.

Compiling takes half a minute. Whoever installs without this step waits for it in the first command.
"""

from __future__ import annotations

import numpy as np

from vjm.grid import walk_grid
from vjm.io.model_file import load_chain
from vjm.programme import Programme
from vjm.vjm_engine import LumpedProblem, VjmEngine


def main() -> None:
    """Walk a short path of each kind."""
    chain = load_chain("orthoglide-chain")
    programme = Programme("A", -3.0)
    VjmEngine(4).walk(chain, programme)
    walk_grid(LumpedProblem(VjmEngine(4).model(chain), programme, "vjm-4"), np.linspace(0.0, 0.1, 5))


if __name__ == "__main__":
    main()
