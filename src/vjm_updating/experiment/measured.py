"""A measurement: the sheet, its readings, and the nominal machine as the sheet describes it.

Also what may be off about the test within its sheet's tolerances: zeros, scales, lengths, moduli, masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from vjm.engines import VjmEngine
from vjm.io.findings import Finding
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.parts import Joint
from vjm_updating.experiment.data_file import POSE, SheetError
from vjm_updating.experiment.readings import Readings
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
    """One Gaussian nuisance of mean zero, of a channel or a part, constant through a test."""

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

    Independent of one another. Where the sheet gives no tolerance sigma is zero. Links are all beams but the foot.
    """
    tolerance = sheet.tolerance
    possible: list[Nuisance] = []
    for channel in channels:
        known = sheet.errors(channel)
        possible += [Nuisance(Kind.ZERO, channel, known.zero), Nuisance(Kind.SCALE, channel, known.scale)]
    possible += [Nuisance(Kind.MODULUS, beam.name, tolerance.modulus_rel) for beam in chain.beams]
    possible += [Nuisance(Kind.LENGTH, link, tolerance.link_length_mm) for link in links_of(chain)]
    return tuple(possible)


def nuisances(sheet: Sheet, channels: Sequence[str], chain: Machine) -> tuple[Nuisance, ...]:
    """Those of `possible_nuisances` for which the sheet has a tolerance."""
    return tuple(n for n in possible_nuisances(sheet, channels, chain) if n.sigma > 0.0)


@dataclass(frozen=True)
class Measurement:
    """What was measured and on what.

    Attributes:
        readings: in the order in which they were taken.
        document: the model file's content with the sheet's overrides and postures.
        engine: that solves it with as many springs as the sheet says.
        nuisances: that the sheet's tolerances allow, independent of one another.
        notes: what is to be said of how it was read.
    """

    sheet: Sheet
    readings: Readings
    document: dict[str, Any]
    chain: Machine
    engine: VjmEngine
    nuisances: tuple[Nuisance, ...]
    data_sha256: str
    notes: tuple[Finding, ...] = field(default=(), kw_only=True)

    @property
    def drive(self) -> Joint:
        """The joint that a test of one joint is about.

        Raises:
            SheetError: the model has no such joint, or it does not deflect there.
        """
        sheet, joints = self.sheet, {joint.name: joint for joint in self.chain.moving if joint.held}
        driven = joints.get(sheet.test.joint)
        if driven is None:
            raise SheetError(
                f"{sheet.file}: [test] joint: no actuated, coupled or sprung joint '{sheet.test.joint}' in "
                f"{self.chain.name}; there are {', '.join(joints) or 'none'}"
            )
        if not driven.sprung:
            raise SheetError(
                f"{sheet.file}: [test] joint: {driven.name} is rigid in the model: give it a compliance in the "
                "model file, a first guess"
            )
        if driven.law is not None and not driven.law.rises:
            raise SheetError(
                f"{sheet.file}: [test] joint: the law of {driven.name} has a stretch without stiffness. No torque "
                "tells the angle there: give a compliance, or a law of kind 'strain_wave', as a first guess"
            )
        return driven

    @property
    def joint_compliance(self) -> float:
        """Of that joint in the model, rad/(N mm) or mm/N; of one with a law that of its steepest slope."""
        return self.drive.compliances[0]

    @property
    def free(self) -> tuple[str, ...]:
        """Components of the end-effector's pose that no support holds: of a test by force; else none."""
        test = self.sheet.test
        return tuple(name for name in COMPONENTS if name not in test.held) if test.by_force else ()

    @property
    def loaded(self) -> bool:
        """Whether loads say what the machine does: they were imposed, and it bears them by itself.

        A machine with free joints stands by what holds it. Where each component of its pose was read or held,
        displacements say what it does, whichever of the two was imposed.
        """
        stands = not any(isinstance(part, Joint) and part.free for part in self.chain.parts)
        return bool(self.free) and (stands or not self.wholly_read)

    @property
    def wholly_read(self) -> bool:
        """Whether each component of the end-effector's pose was read or held."""
        read = {name for name, column in zip(COMPONENTS, POSE, strict=True) if column in self.readings.values}
        return all(name in read for name in self.free)

    @property
    def imposed(self) -> bool:
        """Whether the pose of the end-effector is known at every reading, whichever end controlled the test."""
        return any(name in self.readings.values for name in POSE)
