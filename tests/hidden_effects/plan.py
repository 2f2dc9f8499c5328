"""Which sets a campaign has: how many of which group, and what each is to hide."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

CAUSES = (
    "link_lumping", "foot_lumping", "actuator_compliance", "actuator_hardening", "actuator_backlash",
    "joint_clearance", "joint_friction", "contact_compliance", "base_compliance", "foot_compliance",
    "link_compliance", "link_bow", "link_length", "load_misalignment", "tension_compression_asymmetry",
    "gravity", "thermal_drift",
    "creep", "plasticity", "instrument_zero", "instrument_scale",
)  # fmt: skip
"""Of docs/measured-data.md."""
STRENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
STRONG = 0.9 * 8.0
"""Strength from which on a cause counts as one of 8 and more: it was sought within 5 %, and nuisances move it."""
MASKING = (
    ("actuator_compliance", "foot_compliance"), ("joint_friction", "creep"), ("joint_clearance", "instrument_zero"),
    ("link_compliance", "instrument_scale"), ("thermal_drift", "creep"), ("plasticity", "joint_friction"),
    ("tension_compression_asymmetry", "link_bow"), ("contact_compliance", "actuator_compliance"),
)  # fmt: skip
"""Pairs of which each hides a part of the other."""
CONFUSABLE = (
    "actuator_compliance", "base_compliance", "foot_compliance", "link_compliance", "actuator_backlash",
    "joint_clearance", "contact_compliance", "load_misalignment", "actuator_hardening", "gravity",
    "tension_compression_asymmetry", "link_bow",
)  # fmt: skip
"""Causes that some designs cannot tell from another one, however strong."""
DESIGNS = 40
"""Different designs among which the sets are spread, so that their signatures are computed once."""


class Group(StrEnum):
    """What a set is for."""

    QUIET = "quiet"
    """Nothing is hidden."""
    SINGLE = "single"
    """One cause."""
    PAIR = "pair"
    """Two."""
    OUTSIDE = "outside"
    """One that no catalogue has."""
    INSEPARABLE = "inseparable"
    """One that the design cannot tell from another one."""


@dataclass(frozen=True)
class Plan:
    """What a set is to be.

    Attributes:
        number: of the set, from 1; its seed.
        group: what it is for.
        design: seed of its design.
        causes: to be hidden, by name; of a cause outside the catalogue its number in turn.
        strengths: wanted of each.
        designs: among which the campaign's sets are spread.
    """

    number: int
    group: Group
    design: int
    causes: tuple[str, ...]
    strengths: tuple[float, ...]
    designs: int = DESIGNS

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.number:05d}"


COUNTS = {Group.QUIET: 400, Group.SINGLE: 400, Group.PAIR: 100, Group.OUTSIDE: 160,
          Group.INSEPARABLE: 50}  # fmt: skip
"""Of a whole campaign."""


def plans(
    share: float = 1.0, seed: int = 0, designs: int = DESIGNS, strengths: Sequence[float] = STRENGTHS
) -> list[Plan]:
    """A campaign, its groups mixed so that a part of it is a small one."""
    rng = np.random.default_rng([seed, 7])
    wanted: list[tuple[Group, tuple[str, ...], tuple[float, ...]]] = []
    for group, count in COUNTS.items():
        order = rng.permutation(len(CAUSES))
        for k in range(max(2, round(share * count))):
            cause = CAUSES[order[k % len(CAUSES)]]
            strength = strengths[(k % len(CAUSES) + k // len(CAUSES)) % len(strengths)]
            if group is Group.QUIET:
                wanted.append((group, (), ()))
            elif group is Group.SINGLE:
                wanted.append((group, (cause,), (strength,)))
            elif group is Group.PAIR:
                wanted.append((group, _pair(rng, k), tuple(float(rng.choice([8.0, 16.0])) for _ in range(2))))
            elif group is Group.OUTSIDE:
                wanted.append((group, (str(k),), (float(rng.choice([16.0, 32.0, 64.0])),)))
            else:
                wanted.append((group, (str(rng.choice(CONFUSABLE)),), (float(rng.choice([8.0, 16.0])),)))
    order = rng.permutation(len(wanted))
    result = []
    for number, k in enumerate(order, start=1):
        group, causes, wished = wanted[k]
        design = int(rng.integers(designs)) + 1000 * seed
        # a sample in a whole campaign's folder has sets of its own
        first = 100_000 * seed + (50_000 if share < 1.0 else 0)
        result.append(Plan(first + number, group, design, causes, wished, designs))
    return result


def _pair(rng: np.random.Generator, k: int) -> tuple[str, ...]:
    if k % 3 == 0:
        return MASKING[k // 3 % len(MASKING)]
    # lumping is the sheet's doing and no cause beside another one; a length shows behind a critical point only
    names = rng.choice([c for c in CAUSES if not c.endswith(("lumping", "length"))], 2, replace=False)
    return tuple(sorted(str(name) for name in names))
