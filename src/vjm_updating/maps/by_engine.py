"""What a map asks, by any engine, posture by posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vjm.analysis import stiffness
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.limits import LIMITS
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.maps.quantity import COLUMNS, OK, MapQuantity, moved, principal


def refuse(engine: Engine, quantity: MapQuantity) -> None:
    """Refuse a map of what only the engine ``vjm`` has: others count no negative eigenvalues and know no parts.

    Raises:
        ValueError: it is asked for.
    """
    if quantity in (MapQuantity.FREQUENCY, MapQuantity.SHARES):
        what = "natural frequencies" if quantity is MapQuantity.FREQUENCY else "shares of parts"
        raise ValueError(f"--quantity {quantity}: {engine.label} has no {what}: take vjm-<n>")
    if quantity is MapQuantity.CRITICAL:
        why = (
            "is linear and knows no loss of stability" if engine.label in LINEAR else "follows one force at a time"
        )
        raise ValueError(
            f"--quantity critical: {engine.label} {why}: take vjm-<n> here, or `validate buckling --force` along "
            "one direction"
        )


LINEAR = tuple(name for name, limits in LIMITS.items() if any("linear" in limit.why for limit in limits))
"""Engines that are linear about the unloaded machine."""


def rows_by(
    engine: Engine,
    machines: Sequence[tuple[Machine, str]],
    quantity: MapQuantity,
    wrench: Sequence[float],
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Array, list[str]]:
    """Values of a quantity by an engine.

    Args:
        engine: any that computes a 6×6 stiffness.
        machines: each with the label of the posture that it is asked in.
        quantity: stiffness or deflection.
        wrench: ``(6,)`` on the free end-effector, N and N mm.
        progress: called with the postures that are done, and of how many.

    Returns:
        ``(g, k)`` in the order of `COLUMNS`, nan where there is no answer; and `OK`, or why there is none.

    Raises:
        ValueError: another quantity is asked for.
    """
    refuse(engine, quantity)
    values, why = np.full((len(machines), len(COLUMNS[quantity])), np.nan), []
    for k, (machine, label) in enumerate(machines):
        try:
            found = stiffness(machine, label, wrench=wrench, engine=engine)
            if quantity is MapQuantity.DEFLECTION:
                values[k] = moved(found.displacement[None])[0]
            else:
                C = found.loaded_compliance
                compliance: Array = np.asarray(np.linalg.inv(found.loaded), dtype=float) if C is None else C
                values[k] = principal(compliance[None])[0]
            why.append(OK)
        except (ValueError, NoConvergenceError, np.linalg.LinAlgError) as error:
            why.append(" ".join(str(error).split()))
        if progress is not None:
            progress(k + 1, len(machines))
    return values, why
