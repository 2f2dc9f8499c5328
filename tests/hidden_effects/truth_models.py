"""Rigs whose forces come from elsewhere: the sheet's own lumped link, and finite elements.

A lumped link is no rod. Where the sheet has one, what it reads is taken from the lumped model that the sheet means.
Truth that no integration of rods has made comes from Exudyn's beams. Both trace each half of the displacements once
and are interpolated between the path's points; so they know no history.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from hidden_effects.machine import NoTruthError, TrueMachine
from hidden_effects.rig import Rig, drawn
from hidden_effects.virtual_rig import Design, Sequence
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Section
from vjm.rotations import Array
from vjm_fea.exudyn.engine import ExudynEngine

STEPS, ELEMENT_STEPS, ELEMENTS = 40, 16, 16
"""Of each half of the displacements by the lumped model and by finite elements, and elements of each beam."""
Curve = Callable[[Array], Array]


def as_drawn(design: Design) -> Rig:
    """The machine of a sheet; its link is one spring where the sheet says so."""
    rig = drawn(design)
    return LumpedRig(rig.machine) if design.link_segments == 1 else rig


def by_finite_elements(rig: Rig) -> Rig | None:
    """The same rig with Exudyn's beams for its rods; None where it has what they lack."""
    plain = replace(
        rig.machine, foot_factor=1.0, link_factor=1.0, link_longer=0.0, laws=_without_drive(rig.machine)
    )
    as_built = TrueMachine(rig.machine.chain, side=rig.machine.side)
    same = all(np.array_equal(getattr(plain, n), getattr(as_built, n)) for n in vars(as_built) if n != "chain")
    if not same or any(rig.tilt) or rig.screw is not None or type(rig) is not Rig:
        return None
    return ElementRig(rig.machine, faults=rig.faults, softer_per_kelvin=rig.softer_per_kelvin)


def _without_drive(machine: TrueMachine) -> Array:
    laws = machine.laws.copy()
    laws[0, 0] = 0.0
    return laws


class _TracedRig(Rig, ABC):
    """Forces off load paths."""

    def _wrench(self, sequence: Sequence, poses: Array) -> Array:
        wrench, ux = np.zeros((len(sequence), 6)), poses[:, 0]
        for sign in (1.0, -1.0):
            at = ux * sign > 0.0
            if at.any():
                to = sign * float(np.abs(ux[at]).max())
                wrench[at] = self._curve(sequence.posture, to)(np.abs(ux[at]))
        return wrench

    @abstractmethod
    def _curve(self, posture: str, to: float) -> Curve:
        """Forces over the size of the displacement, along a ramp that ends at ``to``, mm."""


_CURVES: dict[tuple[float | int | str, ...], Curve] = {}


class LumpedRig(_TracedRig):
    """A rig whose machine is the paper's model."""

    def _curve(self, posture: str, to: float) -> Curve:
        m = self.machine
        key = (m.lumped_foot, m.drive, posture, round(to, 9), m.foot_factor, m.link_factor, m.link_longer)
        if key not in _CURVES:
            foot = None if m.lumped_foot else ELEMENTS
            path = VjmEngine(None, foot).trace(_chain(m), LoadCase(posture, to, steps=STEPS))
            if not path.complete:
                raise NoTruthError(f"posture {posture}: the lumped model stops before {to:g} mm: {path.stopped}")
            _CURVES[key] = PchipInterpolator(path.s, path.wrench)
        return _CURVES[key]


class ElementRig(_TracedRig):
    """A rig whose machine is made of finite elements."""

    def _curve(self, posture: str, to: float) -> Curve:
        chain = _chain(self.machine)
        engine = ExudynEngine(foot_spring=False, elements=ELEMENTS)
        path = engine.trace(chain, LoadCase(posture, to, steps=ELEMENT_STEPS))
        if not path.complete or path.events:
            raise NoTruthError(f"posture {posture}: no smooth path of finite elements to {to:g} mm")
        curve: Curve = CubicSpline(path.s, path.wrench)
        return curve


def _chain(machine: TrueMachine) -> Machine:
    """The chain with a machine's factors and length, and its drive's added compliance."""
    parts = []
    for part in machine.chain.parts:
        if isinstance(part, Beam):
            longer = machine.link_longer if part.name == "link" else 0.0
            factor = machine.link_factor if part.name == "link" else machine.foot_factor
            matrix = None if part.compliance is None else part.compliance * factor
            section = None if part.section is None else _softer(part.section, factor)
            part = replace(part, length=part.length + longer, compliance=matrix, section=section)
        parts.append(part)
    chain = replace(machine.chain, parts=tuple(parts))
    return chain.with_actuator_compliance(machine.drive)


def _softer(section: Section, factor: float) -> Section:
    s = section
    return replace(s, EA=s.EA / factor, GJ=s.GJ / factor, EIy=s.EIy / factor, EIz=s.EIz / factor)
