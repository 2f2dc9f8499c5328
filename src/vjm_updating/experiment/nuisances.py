"""What may be off about a test within its sheet's tolerances: zeros, scales, lengths, moduli."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

from vjm.model.chain import Chain
from vjm_updating.experiment.sheet import Sheet


class Kind(StrEnum):
    """What a nuisance does."""

    ZERO = "zero"
    """Adds a constant to a channel, in its unit."""
    SCALE = "scale"
    """Multiplies a channel by one plus itself."""
    LENGTH = "length"
    """Lengthens a part, mm."""
    MODULUS = "modulus"
    """Multiplies a part's stiffnesses by one plus itself."""


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
        return self.kind in (Kind.LENGTH, Kind.MODULUS)


@dataclass(frozen=True)
class Nuisances:
    """The nuisances of a test, independent of one another."""

    all: tuple[Nuisance, ...]

    def __iter__(self) -> Iterator[Nuisance]:
        return iter(self.all)

    def __len__(self) -> int:
        return len(self.all)


def nuisances(sheet: Sheet, channels: Sequence[str], chain: Chain) -> Nuisances:
    """Those of a sheet that has a tolerance for them.

    Args:
        sheet: the sheet.
        channels: that the data have.
        chain: the machine; ``link_length_mm`` is of the beam called link, else of the only one.
    """
    found: list[Nuisance] = []
    for channel in channels:
        known = sheet.instrument.get(channel)
        if known is None:
            continue
        found += [Nuisance(Kind.ZERO, channel, known.zero)] if known.zero > 0.0 else []
        found += [Nuisance(Kind.SCALE, channel, known.scale)] if known.scale > 0.0 else []
    names = [beam.name for beam in chain.beams]
    link = "link" if "link" in names else names[0] if len(names) == 1 else ""
    if sheet.tolerance.link_length_mm > 0.0 and link:
        found.append(Nuisance(Kind.LENGTH, link, sheet.tolerance.link_length_mm))
    if sheet.tolerance.modulus_rel > 0.0:
        found += [Nuisance(Kind.MODULUS, name, sheet.tolerance.modulus_rel) for name in names]
    return Nuisances(tuple(found))
