"""A measurement: the sheet, its readings, and the nominal machine as the sheet describes it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from vjm.io.findings import Finding
from vjm.model.joints import Joint
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.vjm_engine import VjmEngine
from vjm_updating.experiment.channels import POSE
from vjm_updating.experiment.nuisances import Nuisance
from vjm_updating.experiment.readings import Readings
from vjm_updating.experiment.sheet import Sheet
from vjm_updating.experiment.source import SheetError


@dataclass(frozen=True)
class Measurement:
    """What was measured and on what.

    Attributes:
        sheet: the test sheet.
        readings: in the order in which they were taken.
        document: the model file's content with the sheet's overrides and postures.
        chain: the nominal machine.
        engine: that solves it with as many springs as the sheet says.
        nuisances: that the sheet's tolerances allow, independent of one another.
        data_sha256: of the data file.
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
        found = joints.get(sheet.test.joint)
        if found is None:
            raise SheetError(
                f"{sheet.file}: [test] joint: no actuated, coupled or sprung joint '{sheet.test.joint}' in "
                f"{self.chain.name}; there are {', '.join(joints) or 'none'}"
            )
        if not found.sprung:
            raise SheetError(
                f"{sheet.file}: [test] joint: {found.name} is rigid in the model: give it a compliance in the "
                "model file, a first guess"
            )
        if found.law is not None and not (found.law.tangent(found.law.curve.knots) > 0.0).all():
            raise SheetError(
                f"{sheet.file}: [test] joint: the law of {found.name} has a stretch without stiffness. No torque "
                "tells the angle there: give a compliance, or a law of kind 'strain_wave', as a first guess"
            )
        return found

    @property
    def joint_compliance(self) -> float:
        """Of that joint in the model, rad/(N mm) or mm/N; of one with a law that of its steepest slope."""
        joint = self.drive
        return joint.compliance if joint.law is None else 1.0 / joint.law.largest_stiffness

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
