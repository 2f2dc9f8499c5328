"""What the sheet's own model reads: the machine as drawn, the paper's one spring per link included.

A lumped link is no rod. Where the sheet has one, what it reads is taken from the lumped model that the sheet means,
walked along each half of the displacements and interpolated between its points.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from vjm.programme import Programme
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_validation.blind.designs import Design, Sequence
from vjm_validation.blind.machine import NoTruthError
from vjm_validation.blind.rig import Rig, drawn

STEPS = 40
"""Of each half of the displacements."""


def as_drawn(design: Design) -> Rig:
    """The machine of a sheet; its link is one spring where the sheet says so."""
    rig = drawn(design)
    return LumpedRig(rig.machine) if design.link_segments == 1 else rig


class LumpedRig(Rig):
    """A rig whose machine is the paper's model."""

    def _forces(self, design: Design, sequence: Sequence) -> Array:
        wrench = np.zeros((len(sequence), 6))
        for sign in (1.0, -1.0):
            at = sequence.ux * sign > 0.0
            if at.any():
                curve = _curve(design, sequence.posture, sign * float(np.abs(sequence.ux[at]).max()))
                wrench[at] = curve(np.abs(sequence.ux[at]))
        forces: Array = wrench[:, design.columns]
        return forces


_CURVES: dict[tuple[float | int | str, ...], PchipInterpolator] = {}


def _curve(design: Design, posture: str, to: float) -> PchipInterpolator:
    key = (design.foot_segments, design.drive, posture, round(to, 9))
    if key not in _CURVES:
        foot = design.foot_segments if design.foot_segments > 1 else None
        path = VjmEngine(None, foot).walk(design.chain(), Programme(posture, to, steps=STEPS))
        if not path.complete:
            raise NoTruthError(f"posture {posture}: the lumped model stops before {to:g} mm: {path.stopped}")
        _CURVES[key] = PchipInterpolator(path.s, path.wrench)
    return _CURVES[key]
