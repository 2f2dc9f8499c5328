"""What an effect is: a cause that a model can lack, its parameters with units and bounds, and how it acts.

Also where elements sit in a machine: by the kinds of its parts, whatever these are called.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from vjm.engines import VjmEngine
from vjm.model.machine import FOOT, Machine
from vjm.model.parts import Beam, Joint
from vjm.rotations import Array, rotate_matrix6
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.equilibrium_tables import first_wrench
from vjm_updating.mechanisms.joint_motions import braced, joint_motions
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of, link_of, links_of, place_of
from vjm_updating.mechanisms.relaxation import Relaxation
from vjm_updating.mechanisms.series_elements import (
    AlongAxis,
    AlongLine,
    AtJoint,
    Behind,
    ElementSite,
    SeriesElement,
)

SAME = numerical(1e-9)
"""Difference of unit vectors that is rounding."""


def drive(machine: ModifiedMachine) -> AlongAxis:
    """The drive.

    Raises:
        ValueError: there is none.
    """
    axis = machine.drive_axis
    if axis is None:
        raise ValueError(f"{machine.nominal.name}: there is no actuator")
    return AlongAxis((float(axis[0]), float(axis[1]), float(axis[2])))


def foot(machine: ModifiedMachine) -> Behind:
    """The foot's tip, which deflects by the foot's own compliance under the force along the link on it."""
    chain = machine.chain()
    beam = beam_of(chain, FOOT)
    C = rotate_matrix6(beam.tip_compliance(), chain.base[:3, :3] @ beam.own_frame)[:3, :3]
    return Behind(
        tuple(tuple(float(v) for v in row) for row in C), place_of(machine.nominal, links_of(machine.nominal)[0])
    )


def along_link(machine: ModifiedMachine, link: str) -> ElementSite:
    """A link, or its joints, along the line from its root to its tip; the only one where there is no name."""
    return AtJoint(link or link_of(machine.nominal)) if machine.nominal.closes else AlongLine(link)


def along_links(machine: ModifiedMachine, postures: Iterable[str], jointed: bool) -> list[tuple[str, str]]:
    """Places along links where something may slip or deflect, from base to tool.

    What slips shifts all that is behind it along the link's line, so that it makes no difference where along the
    link it sits, at its root, in it or at its tip. Nor does it with links whose lines are one direction in every
    posture of a test: no reading distinguishes them, and they are one place. Where they are to be
    ``jointed``, a joint has to stand between a link and the beam, or the end of the chain, before or behind. Joints
    have backlash and contacts along the links that they join.

    Returns:
        Of each place what a verdict calls it, and the link whose line it is; both empty for the only link.
    """
    chain, labels = machine.nominal, sorted(postures)
    names = [name for name in links_of(chain) if not jointed or has_joint(chain, name)]
    if chain.closes:
        away = braced(machine, labels)
        names = [name for name in names if name not in away]
    if len(links_of(chain)) == 1:
        return [("", "")] if names else []
    places: list[tuple[list[str], np.ndarray]] = []
    moved = [(label, joint_motions(machine, label)) for label in labels] if chain.closes else []
    unit = np.repeat([1.0, chain.characteristic_length], 3)
    for name in names:
        if chain.closes:
            # what differs by a factor alone is no other place
            lines = np.array([motions[name] * unit for _, motions in moved])
            lines /= np.linalg.norm(lines) or 1.0
        else:
            lines = np.array([machine.line(label, name) for label in labels])
        same = next((own for own, other in places if len(labels) and np.abs(other - lines).max() < SAME), None)
        if same is None:
            places.append(([name], lines))
        else:
            same.append(name)
    return [(" or ".join(own), own[0]) for own, _ in places]


def has_joint(chain: Machine, link: str) -> bool:
    """Whether a joint stands next to a link, other beams aside."""
    index = next(i for i, part in enumerate(chain.parts) if part.name == link)
    for side in (reversed(chain.parts[:index]), chain.parts[index + 1 :]):
        for part in side:
            if isinstance(part, Beam):
                break
            if isinstance(part, Joint) and not part.fixed:
                return True
    return False


@dataclass(frozen=True)
class Quantity:
    """One parameter of an effect.

    Attributes:
        name: with its unit, as in ``compliance_mm_per_N``.
        low: physical bound.
        high: physical bound.
        scale: change that matters, in its own unit.
        neutral: value at which the effect is absent, where there is one.
        usual: value that shape parameters have without data.
        spread: standard deviation about ``usual``; infinite where nothing is known.
        log: it is positive and counts by its logarithm; ``spread`` is then of the logarithm.
    """

    name: str
    low: float
    high: float
    scale: float
    neutral: float | None = None
    usual: float = 0.0
    spread: float = float("inf")
    log: bool = False

    def coordinate(self, value: float) -> float:
        """The value as a fit sees it, about one for a change that matters."""
        return float(np.log(value / self.scale)) if self.log else value / self.scale

    def value(self, coordinate: float) -> float:
        """The converse of `coordinate`."""
        return self.scale * float(np.exp(coordinate)) if self.log else coordinate * self.scale


@dataclass(frozen=True)
class ExperimentContext:
    """What an effect must know of a test to make sense of it.

    Attributes:
        chain: the nominal machine.
        engine: of its lumped model.
        force: largest force at the end-effector, N.
        reach: largest displacement, mm.
        duration: of the test, s; zero where there is no clock.
        interval: median time between readings, s.
        gravity: direction of the weight where it is known.
        rays: posture and direction ``(6,)`` of each ramp of the test; empty where they are not known.
        loaded: whether these are directions of loads that were imposed, and not of displacements.
        gauged: whether gauges are on other bodies than the end-effector.
    """

    chain: Machine
    engine: VjmEngine
    force: float
    reach: float
    duration: float = 0.0
    interval: float = 0.0
    gravity: tuple[float, float, float] | None = None
    rays: tuple[tuple[str, tuple[float, ...]], ...] = ()
    loaded: bool = False
    gauged: bool = False

    @property
    def slips(self) -> bool:
        """Whether the test shows what extends in a joint or along a link: not by gauges on bodies within loops."""
        return not (self.chain.closes and self.gauged)

    @property
    def machine(self) -> ModifiedMachine:
        """The nominal one."""
        return ModifiedMachine(self.chain, self.engine)

    @property
    def driven(self) -> int:
        """Axis of the world along which the displacement or load is imposed, 0 to 2: the first one of several."""
        return min((int(np.argmax(np.abs(direction[:3]))) for _, direction in self.rays), default=0)

    @property
    def labels(self) -> set[str]:
        """Postures of the test; all that the chain has where none are known."""
        return {label for label, _ in self.rays} or set(self.chain.postures)

    def begun(self, machine: ModifiedMachine, posture: str, direction: Sequence[float]) -> Array:
        """Wrench ``(6,)`` per unit of a ramp with which a nominal machine begins it.

        Raises:
            vjm.errors.NoConvergenceError: it does not stand.
        """
        return np.array(direction) if self.loaded else first_wrench(machine, posture, np.array(direction))

    def places(self, *, jointed: bool) -> list[tuple[str, str]]:
        """Links along which something may slip, or their joints may; see `along_links`."""
        return along_links(self.machine, self.labels, jointed) if self.slips else []


class Effect:
    """A cause. Subclasses are frozen dataclasses; what distinguishes variants (the part) is their attributes.

    Attributes:
        cause: name of the cause: that of docs/measured-data.md where it has one.
        title: what it is, in a few words.
        part: where it sits, for causes that can sit in several places; else empty.
        extent: how many of the first quantities are its size together: the components of a vector.
        exact: whether its law is geometry or a scale, which has no error of its own.
    """

    cause: ClassVar[str] = ""
    title: ClassVar[str] = ""
    extent: ClassVar[int] = 1
    exact: ClassVar[bool] = False
    part: str = ""

    @property
    def label(self) -> str:
        """Cause and place."""
        return f"{self.cause}.{self.part}" if self.part else self.cause

    @property
    def place(self) -> str:
        """Cause and place as people read them."""
        return f"{self.cause}({self.part})" if self.part else self.cause

    @property
    def contains(self) -> tuple[str, ...]:
        """Causes, or their labels where the place matters, that are this one with a parameter at its neutral."""
        return ()

    @property
    def in_place_of(self) -> str:
        """What of the nominal machine it takes the place of: of effects that do the same only one acts."""
        return ""

    def quantities(self) -> tuple[Quantity, ...]:
        """The parameters, the principal one first; none for a cause that either is or is not."""
        return ()

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Values of the parameters to begin a search from: small, of different shapes."""
        return [()]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """The machine with the effect."""
        return machine

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """Elements in series with the machine. Their laws see force, clock, posture and temperature."""
        return ()

    def relaxation(self, machine: ModifiedMachine, values: Sequence[float]) -> Relaxation | None:
        """Which beam's stress relaxes, how much of it and how fast."""
        return None

    def friction(self, values: Sequence[float]) -> Array | float:
        """Friction torque of the passive joints ``(n_q,)``, N mm; one number where all have the same."""
        return 0.0

    def presliding(self, values: Sequence[float]) -> float:
        """Elastic turn of a joint, rad, at which its friction reaches its torque and it slips."""
        return 0.0

    def imposed(self, pose: Array, values: Sequence[float]) -> Array:
        """Displacements ``(n, 6)`` really imposed where ``pose`` (n, 6) was meant."""
        return pose

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """Parameters under the names of docs/measured-data.md."""
        return {f"{self.cause}.{q.name}": float(v) for q, v in zip(self.quantities(), values, strict=True)}

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """Write into a model document what a file can say of the effect beyond the values of its beams."""


def part_table(document: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The table of a part of a model document."""
    return next(part for part in document["parts"] if part["name"] == name)
