"""From readings without noise to readings: nuisances, noise with a memory, rounding, wild and missed samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.rotations import Array
from vjm_validation.blind.causes import added, reading
from vjm_validation.blind.designs import Design
from vjm_validation.blind.rig import Fault, Response, Rig, Seen


def with_nuisances(rig: Rig, design: Design, rng: np.random.Generator) -> tuple[Rig, dict[str, float]]:
    """The rig with what the sheet's tolerances may do to it, and what they did.

    A channel's scale comes before its zero, both after whatever else its instrument does.
    """
    drawn: dict[str, float] = {
        "length link": design.length * float(rng.standard_normal()),
        "modulus foot": design.modulus * float(rng.standard_normal()),
        "modulus link": design.modulus * float(rng.standard_normal()),
    }
    machine = rig.machine
    rig = replace(
        rig,
        machine=replace(
            machine,
            link_longer=machine.link_longer + drawn["length link"],
            foot_factor=machine.foot_factor / (1.0 + drawn["modulus foot"]),
            link_factor=machine.link_factor / (1.0 + drawn["modulus link"]),
        ),
    )
    for name, known in design.instruments.items():
        drawn[f"scale {name}"] = known.scale * float(rng.standard_normal())
        drawn[f"zero {name}"] = known.zero * float(rng.standard_normal())
        rig = rig.with_fault(_error(name, drawn[f"scale {name}"], drawn[f"zero {name}"]))
    return rig, drawn


def _error(name: str, scale: float, zero: float) -> Fault:
    def fault(seen: Seen) -> Seen:
        return added(seen, name, scale * reading(seen, name) + zero)

    return fault


def read(design: Design, still: Response, rng: np.random.Generator) -> tuple[Response, Response]:
    """Readings as a file has them, nan where a sample was missed; and the same without wild and missed ones."""
    n, c = still.forces.shape
    sigma = np.array([design.instruments[name].noise for name in design.channels])
    ux = still.ux + design.instruments["ux_mm"].noise * _memory(design, 1, rng)[:, 0]
    regular = still.forces + sigma * _memory(design, c, rng)
    wild = rng.random((n, c)) < design.wild
    forces = regular + wild * rng.choice([-1.0, 1.0], (n, c)) * rng.uniform(12.0, 60.0, (n, c)) * sigma
    if design.quantum > 0.0:
        step = design.quantum * sigma
        forces, regular = step * np.round(forces / step), step * np.round(regular / step)
    missing = rng.random((n, c)) < design.missing
    return Response(ux, np.where(missing, np.nan, forces)), Response(ux, regular)


def _memory(design: Design, channels: int, rng: np.random.Generator) -> Array:
    """Noise ``(n, c)`` of unit size; neighbours within a sequence are correlated, across sequences they are not."""
    rho, blocks = design.memory, []
    for sequence in design.sequences:
        fresh = rng.standard_normal((len(sequence), channels))
        for k in range(1, len(sequence)):
            fresh[k] = rho * fresh[k - 1] + np.sqrt(1.0 - rho**2) * fresh[k]
        blocks.append(fresh)
    return np.concatenate(blocks)
