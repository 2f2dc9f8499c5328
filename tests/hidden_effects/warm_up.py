"""Compile the injector's kernels into the cache beside them: ``python -m hidden_effects.warm_up``.

It takes a minute. `make test` does it once, while the types are checked; else each of its processes would.
"""

import numpy as np

from hidden_effects.machine import TrueMachine
from vjm.io.model_file import load_chain

if __name__ == "__main__":
    pull = np.zeros((1, 6))
    pull[:, 0] = 0.01
    TrueMachine(load_chain("orthoglide-chain")).readings("A", pull)
