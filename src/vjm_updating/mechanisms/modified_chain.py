"""A machine to be walked through a test: the chain, its lumped model, and what is built into it.

Chain and engine say which springs there are. A bow, a part that differs between pull and push, and the parts' own
weight are built in here, since the equilibrium has to be solved with them.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from vjm.model.chain import Chain
from vjm.model.lumped import LumpedModel
from vjm.model.parameters import beam_length, compliance_factor
from vjm.model.parts import Actuator, Beam, Mount, PassiveJoint
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

LINK = "link"
STANDARD_GRAVITY = 9.80665
"""m/s²."""
KEPT = 64
"""Lumped models that are kept."""
_MODELS: OrderedDict[tuple[object, ...], tuple[Chain, LumpedModel]] = OrderedDict()
"""With the chain that each was made from, which keeps its identity."""


@dataclass(frozen=True)
class ModifiedChain:
    """A chain and what a test meets of it.

    Attributes:
        nominal: the chain as drawn.
        engine: of its lumped model; how many springs.
        factors: of a part's compliance over its nominal value, by part.
        lengthened: mm by beam.
        bow: of the link at mid-span along its section's y and z axes, mm.
        asymmetry: stiffness in pull over that in push, by part.
        weight: mass in kg that is spread over each beam, by part.
        gravity: direction of the weight.
    """

    nominal: Chain
    engine: VjmEngine
    factors: tuple[tuple[str, float], ...] = ()
    lengthened: tuple[tuple[str, float], ...] = ()
    bow: tuple[float, float] = (0.0, 0.0)
    asymmetry: tuple[tuple[str, float], ...] = ()
    weight: tuple[tuple[str, float], ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)

    @property
    def key(self) -> tuple[object, ...]:
        """What tells two machines with one nominal chain apart."""
        return (
            self.engine, self.factors, self.lengthened, self.bow, self.asymmetry, self.weight, self.gravity,
        )  # fmt: skip

    def times(self, part: str, factor: float) -> ModifiedChain:
        """The machine with a part's compliance times a factor."""
        own = dict(self.factors)
        own[part] = own.get(part, 1.0) * factor
        return replace(self, factors=tuple(sorted(own.items())))

    def longer(self, part: str, by: float) -> ModifiedChain:
        """The machine with a beam longer by so many mm."""
        own = dict(self.lengthened)
        own[part] = own.get(part, 0.0) + by
        return replace(self, lengthened=tuple(sorted(own.items())))

    def chain(self, pulls: bool = True) -> Chain:
        """The chain as it is, in pull or in push, where these differ."""
        chain = self.nominal
        for part, by in self.lengthened:
            parameter = beam_length(chain, part)
            chain = parameter.apply(chain, parameter.value + by) if by else chain
        for part, factor in self.factors:
            chain = compliance_factor(chain, part).apply(chain, factor) if factor != 1.0 else chain
        for part, ratio in self.asymmetry:
            root = float(np.sqrt(ratio))
            chain = compliance_factor(chain, part).apply(chain, 1.0 / root if pulls else root)
        for part, mass in self.weight:
            beam = beam_of(chain, part)
            if mass and beam.section is not None:
                section = replace(beam.section, mass=mass / beam.length / beam.count)
                parts = tuple(replace(p, section=section) if isinstance(p, Beam) and p.name == part else p
                              for p in chain.parts)  # fmt: skip
                chain = replace(chain, parts=parts)
        return chain

    def model(self, pulls: bool = True) -> LumpedModel:
        """The lumped model, its springs free of stress where they are drawn: a bow is not in it.

        Machines that differ in nothing but the bow share one.
        """
        key = (
            id(self.nominal), self.engine, self.factors, self.lengthened, self.asymmetry, self.weight,
            pulls or not self.asymmetry,
        )  # fmt: skip
        known = _MODELS.get(key)
        if known is None:
            known = _MODELS[key] = self.nominal, self.engine.model(self.chain(pulls))
            if len(_MODELS) > KEPT:
                _MODELS.popitem(last=False)
        return known[1]

    @property
    def drive(self) -> Actuator | None:
        """The drive before the joints, where there is one."""
        for part in self.nominal.parts:
            if isinstance(part, Actuator):
                return part
            if isinstance(part, PassiveJoint):
                return None
        return None

    @property
    def drive_axis(self) -> Array | None:
        """Unit vector ``(3,)`` of the drive's axis, world axes; None where there is no drive before the joints."""
        if self.drive is None:
            return None
        result: Array = self.nominal.base[:3, :3] @ np.asarray(self.drive.axis)
        return result

    def line(self, posture: str) -> Array:
        """Unit vector ``(3,)`` along the link in an unloaded posture, from its root to its tip, world axes."""
        model = ModifiedChain(self.nominal, self.engine).model()
        k = model.kinematics(model.configuration(self.nominal.posture(posture)))
        points = model.shape(k)
        own = [i for i, station in enumerate(model.stations) if station.part == link_of(self.nominal)]
        along = points[own[-1]] - points[own[0]]
        result: Array = along / np.linalg.norm(along)
        return result


def beam_of(chain: Chain, name: str) -> Beam:
    """A beam by its name."""
    return next(beam for beam in chain.beams if beam.name == name)


def link_of(chain: Chain) -> str:
    """The beam called link, else the last one."""
    names = [beam.name for beam in chain.beams]
    return LINK if LINK in names else names[-1]


def springs_of(model: LumpedModel, part: str) -> list[slice]:
    """Ranges of the coordinates of a beam's springs, from its root."""
    at = 0
    for own in model.chain.parts:
        count = 0
        if isinstance(own, Actuator | Mount):
            count = int(own.compliance > 0.0)
        elif isinstance(own, Beam):
            count = own.segments or 1
        if own.name == part:
            return [where for _, where in model.blocks[at : at + count]]
        at += count
    raise ValueError(f"{model.chain.name}: no elastic part '{part}'")


@lru_cache(maxsize=KEPT)
def bowed(model: LumpedModel, posture: str, bow: tuple[float, float]) -> Array:
    """Coordinates ``(n,)`` of a link that is a half sine wave when unloaded, its ends where they were.

    ``v = a sin(πs/L)`` has the curvature ``−a (π/L)² sin(πs/L)``, which the springs have as turns; the passive
    joints turn with the ends' slopes and keep the end-effector in place as well as they can.

    Args:
        model: with the link in several springs.
        posture: label.
        bow: mid-span amplitudes along the section's y and z, mm.

    Raises:
        ValueError: the link is one spring, which has no shape.
    """
    part = link_of(model.chain)
    springs = springs_of(model, part)
    beam = beam_of(model.chain, part)
    if beam.segments is None or beam.segments < 2:
        raise ValueError(f"part '{part}' is one spring: split it before it can be bowed")
    x = np.zeros(model.size)
    n, length = beam.segments, beam.length
    for i, where in enumerate(springs):
        # what the slope changes by over the segment
        bend = np.pi / length * (np.cos(np.pi * i / n) - np.cos(np.pi * (i + 1) / n))
        # deflection along y turns about z, deflection along z about −y
        x[where][5] -= bow[0] * bend
        x[where][4] += bow[1] * bend
    start = model.configuration(model.chain.posture(posture))
    aim = model.kinematics(start).end
    for _ in range(2):
        k = model.kinematics(start + x)
        gap = np.concatenate([aim[:3, 3] - k.end[:3, 3], 0.5 * _turn(aim[:3, :3], k.end[:3, :3])])
        scale = np.repeat([1.0, 0.01 * length], 3)
        J = k.jacobian[:, model.passive] * scale[:, None]
        x[model.passive] += np.linalg.lstsq(J, gap * scale, rcond=1e-9)[0]
    return x


def _turn(to: Array, here: Array) -> Array:
    result: Array = sum((np.cross(here[:, k], to[:, k]) for k in range(3)), np.zeros(3))
    return result
