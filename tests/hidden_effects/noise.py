"""From readings without noise to readings: nuisances, autocorrelated noise, rounding, outliers, missed samples."""

from dataclasses import replace

import numpy as np

from hidden_effects.causes import added, reading
from hidden_effects.rig import Fault, Rig, Seen
from hidden_effects.virtual_rig import Design


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
