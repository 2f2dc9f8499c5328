"""Tests of one joint, its torque against its angle: a kind of test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.model.joints import SprungJoint
from vjm_updating.diagnose.critical import Critical
from vjm_updating.diagnose.document import ExperimentRow
from vjm_updating.diagnose.ramp_test import RampTest, instrument_effects
from vjm_updating.diagnose.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.channels import unit_of
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.joint_forward import JointForward
from vjm_updating.mechanisms.actuator_hardening import ActuatorHardening
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.joint_test import DriveFriction, JointCompliance, drive_of
from vjm_updating.mechanisms.play import ActuatorBacklash
from vjm_updating.observation.joint_readings import levers_of, observe_joint
from vjm_updating.observation.observed import Observed


class JointTest(RampTest):
    """The kind of a test of one joint; see `vjm_updating.mechanisms.joint_test`."""

    def applies(self, measurement: Measurement) -> bool:
        """Where the sheet says so."""
        return measurement.sheet.kind == "joint"

    def observe(self, measurement: Measurement) -> Observed:
        """All readings with a motion and a load."""
        return observe_joint(measurement)

    def forward(self, observed: Observed) -> JointForward:
        """The joint's law."""
        return JointForward(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The joint's own, and the instruments'; effects of a file are made for chains and are not taken."""
        motion = next(iter(observed.slots))
        largest = {unit_of(motion): float(np.abs(observed.pose[:, 0]).max())}
        largest[unit_of(observed.columns[0])] = float(np.nanmax(np.abs(observed.wrench)))
        duration = 0.0 if observed.clock is None else float(np.ptp(observed.clock))
        return [*joint_effects(observed), *instrument_effects(observed, duration, largest)]

    def critical_points(self, fitter: Fitter, null: Fit, fit: Fit) -> list[Critical]:
        """A joint has none."""
        return []

    def next_experiment(self, fitter: Fitter, verdict: Verdict) -> ExperimentRow:
        """Of the load's scale the cell itself tells; of the rest both directions and larger loads."""
        observed = fitter.forward.observed
        causes = {cause for member in verdict.members for cause in member.causes}
        effort = observed.columns[0]
        if "instrument_scale" in causes:
            why, path = "a scale error and a stiffness change the slope alike", f"{effort} under known weights alone"
        else:
            why = "backlash, friction and hardening differ where the load turns round and where it is largest"
            path = "both directions through zero in fine steps, twice, to a larger load"
        return ExperimentRow(why=why, posture=observed.measurement.drive.name, path=path)


def joint_effects(observed: Observed) -> list[Effect]:
    """What a joint under test may have: another stiffness, hardening, backlash, friction."""
    joint = observed.measurement.drive
    lever, of_motion, of_load = levers_of(observed.measurement)
    compliance = 1.0 / joint.stiffness if isinstance(joint, SprungJoint) else joint.compliance
    force = float(np.nanmax(np.abs(observed.wrench))) / of_load
    reach = float(np.abs(observed.pose[:, 0]).max()) * of_motion / lever
    own = drive_of(joint.name, slides=joint.slides, compliance=compliance, lever=lever, force=force)
    return [
        JointCompliance(joint.name, own),
        ActuatorHardening(force, own.compliance, joint.name, own),
        ActuatorBacklash(force, joint.name, own),
        DriveFriction(force * lever, reach, joint.slides, joint.name),
    ]
