import numpy as np
import pytest
from hidden_effects.signatures import Signatures, signatures

from vjm_validation.virtual_rig import Design, Known, Sequence


def small_design(**changes) -> Design:
    """Two postures, one ramp to each side, three channels: small enough for dense algebra in a test."""
    ux = np.concatenate([np.linspace(0, 1.0, 5), np.linspace(0.5, -1.0, 5)])
    sequences = tuple(
        Sequence(
            label, reach * ux, 300.0 * (k + 1) + 40.0 * k + 2.0 * np.arange(10), 21.0 + 0.1 * np.arange(10) ** 1.5
        )
        for k, (label, reach) in enumerate((("A", 1.2), ("B", 2.5)))
    )
    instruments = {"ux_mm": Known(0.001, 0.002, 0.001)}
    instruments |= dict.fromkeys(("fx_N", "fy_N", "fz_N"), Known(2.0, 3.0, 0.003))
    kept = {"seed": 10**6, "kind": "small", "sequences": sequences, "instruments": instruments, "drive": 5e-5}
    return Design(**(kept | changes))


@pytest.fixture(scope="session")
def design() -> Design:
    return small_design()


@pytest.fixture(scope="session")
def known(design: Design) -> Signatures:
    return signatures(design)
