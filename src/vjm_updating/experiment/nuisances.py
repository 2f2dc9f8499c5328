"""What may be off about a test within its sheet's tolerances: zeros, scales, lengths, moduli, masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from vjm.model.machine import Machine
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.mechanisms.modified_chain import links_of


class Kind(StrEnum):
    """What a nuisance does."""

    ZERO = "zero"
    """Adds a constant to a channel, in its unit."""
    SCALE = "scale"
    """Multiplies a channel by one plus itself."""
    LENGTH = "length"
    """Lengthens a part, mm."""
    MODULUS = "modulus"
    """Multiplies a part's stiffnesses by one plus itself; sigma is of that factor's logarithm."""
    MASS = "mass"
    """Multiplies a part's mass and moments of inertia by one plus itself; likewise."""


@dataclass(frozen=True)
class Nuisance:
    """One Gaussian nuisance of mean zero, constant through a test.

    Attributes:
        kind: what it does.
        subject: channel or part.
        sigma: its standard deviation.
    """

    kind: Kind
    subject: str
    sigma: float

    @property
    def name(self) -> str:
        """``zero fx_N``, ``length link``."""
        return f"{self.kind} {self.subject}"

    @property
    def of_machine(self) -> bool:
        """Whether it belongs to the machine, and so to its calibrated model; else to an instrument."""
        return self.kind in (Kind.LENGTH, Kind.MODULUS, Kind.MASS)


def possible_nuisances(sheet: Sheet, channels: Sequence[str], chain: Machine) -> tuple[Nuisance, ...]:
    """Zero and scale of each channel, then the modulus of each beam, then the length of each link.

    Independent of one another. Where the sheet gives no tolerance sigma is zero.

    Args:
        sheet: the sheet.
        channels: that the data have.
        chain: the machine; links are all its beams but the foot.
    """
    tolerance = sheet.tolerance
    found: list[Nuisance] = []
    for channel in channels:
        known = sheet.errors(channel)
        found += [Nuisance(Kind.ZERO, channel, known.zero), Nuisance(Kind.SCALE, channel, known.scale)]
    found += [Nuisance(Kind.MODULUS, beam.name, tolerance.modulus_rel) for beam in chain.beams]
    found += [Nuisance(Kind.LENGTH, link, tolerance.link_length_mm) for link in links_of(chain)]
    return tuple(found)


def nuisances(sheet: Sheet, channels: Sequence[str], chain: Machine) -> tuple[Nuisance, ...]:
    """Those of `possible_nuisances` for which the sheet has a tolerance."""
    return tuple(n for n in possible_nuisances(sheet, channels, chain) if n.sigma > 0.0)
