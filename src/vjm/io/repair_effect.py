"""What repaired moments of inertia do to a robot's lowest natural frequency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.modes import mass_matrix, modes_of
from vjm.errors import NoConvergenceError
from vjm.io.errors import printed
from vjm.io.model_file import build_chain
from vjm.io.robot_document import HOME, Imported
from vjm.model.machine import Machine
from vjm.model.parts import RigidOffset
from vjm.rank import SUM_ROUNDING
from vjm.rotations import Array

NAMED = 5
"""Joints that are named; of more it is said how many."""


def say_effect(imported: Imported) -> None:
    """Add to the notes of an import what the repair of its moments of inertia does to the lowest frequency.

    Frequencies are those in the posture of the document, where the stiffness of all drives is known.
    """
    if imported.to_fill_in:
        more = f" and {len(imported.to_fill_in) - NAMED} more" if len(imported.to_fill_in) > NAMED else ""
        imported.notes.changed.append(
            f"no stiffness is known of {', '.join(imported.to_fill_in[:NAMED])}{more}, and so no frequency. With "
            "NAME.stiffness.toml beside the file, this list has the effect of the repair on the lowest one"
        )
        return
    machine = build_chain(imported.document, imported.file)
    given = _lowest(machine, {name: pair[0] for name, pair in imported.impossible.items()})
    nearest = _lowest(machine, {name: pair[1] for name, pair in imported.impossible.items()})
    without = _lowest(machine, dict.fromkeys(imported.impossible))
    imported.notes.changed.append(
        f"the lowest natural frequency in the posture {HOME} is {given} with the moments of inertia of the file. "
        f"With the nearest ones it is {nearest}, without those of these bodies {without}"
    )


def _lowest(machine: Machine, moments: dict[str, Array | None]) -> str:
    """The lowest frequency of a machine whose parts have other moments of inertia, kg mm²."""
    parts = tuple(
        replace(part, inertia=moments[part.name])
        if isinstance(part, RigidOffset) and part.name in moments
        else part
        for part in machine.parts
    )
    try:
        state = state_of(loaded_posture(replace(machine, parts=parts), HOME))
        masses = np.linalg.eigvalsh(state.motions.T @ mass_matrix(state) @ state.motions)
        if masses[0] < -SUM_ROUNDING * len(masses) * masses[-1]:
            return "none (a motion has a negative mass)"
        return f"{printed(float(modes_of(state, 1).frequencies[0]), 4)} Hz"
    except (ValueError, NoConvergenceError):
        return "none"
