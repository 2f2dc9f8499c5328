"""Lowest natural frequencies and largest compliance shares of a machine, posture by posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vjm.design.linear_state import LinearState, Question, question, state_in, state_of, with_doubts
from vjm.design.modes import ModesVerdict, modes_of
from vjm.design.shares import shares_of
from vjm.errors import NoConvergenceError
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity, Mechanism
from vjm.rotations import Array
from vjm.threads import single_threaded
from vjm.vjm_engine import VjmEngine
from vjm_updating.maps.quantity import OK, UNSTABLE, MapQuantity, lost_by


class DesignMapRow(NamedTuple):
    """What a posture has.

    Attributes:
        why: ``ok``, or why there is no value.
        value: the lowest frequency, Hz, or the largest share as a fraction; nan where there is none.
        part: name of the part with the largest share; empty for a frequency.
        kind: of what deflects in it, see `Share`.
    """

    why: str
    value: float = float("nan")
    part: str = ""
    kind: str = ""


@single_threaded
def design_rows(
    engine: VjmEngine,
    model: Mechanism,
    q: Array,
    machines: Sequence[tuple[Machine, str]],
    quantity: MapQuantity,
    *,
    wrench: Sequence[float] = (0.0,) * 6,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> list[DesignMapRow]:
    """The lowest natural frequency, or the largest share in the strain energy, in many postures.

    All loaded equilibria are found in one batch.

    Args:
        engine: that splits the beams.
        model: the machine with that engine's springs.
        q: coordinates ``(g, n_joints)``.
        machines: g machines that stand so, and the label of the posture.
        quantity: `MapQuantity.FREQUENCY` or `MapQuantity.SHARES`.
        wrench: ``(6,)`` on the end, N, N mm.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.
        progress: called with the postures that are done, and of how many.

    Raises:
        ValueError: the wrench is not six finite numbers, or a load is on no point of the machine.
    """
    on_ends = np.zeros((len(model.ends), 6))
    on_ends[model.ends.index(end) if end else 0] = wrench
    found, doubtful = with_doubts(model, q, gravity=gravity, wrench=on_ends, loads=loads, compliance=False)
    rows: list[DesignMapRow] = []
    for row, (machine, label) in enumerate(machines):
        asked = question(machine, label, wrench=wrench, gravity=gravity, loads=loads, end=end, engine=engine)
        try:
            state = state_of(asked) if doubtful[row] else state_in(asked, found, row)
            rows.append((_lowest if quantity is MapQuantity.FREQUENCY else _largest)(asked, state))
        except NoConvergenceError as error:
            rows.append(DesignMapRow(lost_by(error)))
        except ValueError as error:
            said = str(error).removeprefix(machine.name).removeprefix(f", posture {label}").removeprefix(": ")
            rows.append(DesignMapRow(said))
        if progress is not None:
            progress(row + 1, len(machines))
    return rows


def _lowest(asked: Question, state: LinearState) -> DesignMapRow:
    """Lowest natural frequency, Hz.

    Raises:
        ValueError: as `modes_of`.
    """
    if state.conservative and not state.stable:
        return DesignMapRow(UNSTABLE)
    # loads without a potential: any motion may be the one that grows, and the motions alone tell whether one does
    modes = modes_of(state, 1 if state.conservative else state.n)
    if modes.verdict in (ModesVerdict.DIVERGENCE, ModesVerdict.FLUTTER):
        return DesignMapRow(f"{UNSTABLE}: {modes.verdict}")
    return DesignMapRow(OK, float(modes.frequencies.min()))


def _largest(asked: Question, state: LinearState) -> DesignMapRow:
    """Largest share in the linear strain energy, and the part and the kind that has it.

    Raises:
        ValueError: as `shares_of`.
        NoConvergenceError: there is no equilibrium without loads.
    """
    if not state.stable:
        return DesignMapRow(UNSTABLE)
    shares = shares_of(state_of(asked.unloaded, state), asked, state, both=False)
    energies = shares.energies
    if np.isnan(energies).all():
        return DesignMapRow("nothing deflects under these loads")
    worst = int(np.argmax(energies))
    return DesignMapRow(OK, float(energies[worst]), shares.rows[worst].part, shares.rows[worst].kind)
