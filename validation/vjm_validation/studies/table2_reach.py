"""What the figures of Table II can be within the rounding of the printed matrices (19) and (20).

A figure is linearised over the box of roundings, see `vjm_updating.identify.rounding`, and computed at the point
of the box where the linear model is furthest, so that what is reported can be reached for certain. (Linearising
again at that point does not move it for any figure of Table II.)
"""

from __future__ import annotations

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.identify.rounding import DIFFERENCE_STEP, AdmissibleRoundings, perturbed, printed_entries
from vjm_validation.studies.table2 import QUANTITIES, table_figures


def reach(chain: Machine, posture: str) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each figure of a row of Table II within the rounding.

    Args:
        chain: the paper's chain.
        posture: its row.

    Returns:
        By quantity, the interval in N and mm.
    """
    entries = printed_entries(chain)
    names = list(QUANTITIES)

    def figures(amounts: Array) -> Array:
        try:
            values = table_figures(perturbed(chain, entries, amounts), posture).values
        except (ValueError, NoConvergenceError, np.linalg.LinAlgError):
            return np.full(len(names), np.nan)
        return np.array([values[name] for name in names])

    cone = AdmissibleRoundings(chain, entries)
    nominal = figures(np.zeros(len(entries)))
    steps = DIFFERENCE_STEP * np.eye(len(entries))
    slopes = np.array([(figures(step) - figures(-step)) / (2.0 * DIFFERENCE_STEP) for step in steps]).T
    result = {}
    for k, name in enumerate(names):
        ends = [figures(cone.furthest(sign * slopes[k]))[k] for sign in (-1.0, 1.0)]
        result[name] = (float(np.nanmin([*ends, nominal[k]])), float(np.nanmax([*ends, nominal[k]])))
    return result
