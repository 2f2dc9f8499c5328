"""What is done to a machine.

Here are loads, displacements, what controls its path; tension and compression, and how far comparisons go.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vjm.plain_numbers import finite_numbers
from vjm.rotations import Array

if TYPE_CHECKING:
    from vjm.model.machine import Machine

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of the end-effector's displacement from its unloaded pose, world axes; mm and rad."""
LOAD = "load"
"""The axis of a load case whose ramp is the factor on its loads."""
RAMP, ARC, TO_LIMIT = "ramp", "arc", "limit"
"""A path's parameter may be the ramp itself or the length of the path's arc: to the ramp's end, or to where the
ramp first turns back if that comes before."""


class Driven(NamedTuple):
    """What a ramp drives, as results are labelled.

    Attributes:
        name: ``force``, ``moment``, or ``load factor`` where loads have another size than one.
        unit: of it: N or N mm; empty for a load factor.
        along: unit of the displacement on which it works: mm or rad; empty where loads are of both kinds.
        size: N or N mm that a load factor of one stands for; 1 where it is the force itself, 0 where it is none.
    """

    name: str
    unit: str
    along: str
    size: float

    @property
    def stiffness(self) -> str:
        """Unit of the stiffness along it; empty where there is none."""
        return f"{self.unit}/{self.along}" if self.unit and self.along else ""

    def said(self, value: float) -> str:
        """A value of it in words.

        Example:
            >>> Driven("load factor", "", "mm", 10.0).said(2.5), Driven("force", "N", "mm", 1.0).said(2.5)
            ('load factor 2.5 (25 N)', 'force 2.5 N')
        """
        if self.unit:
            return f"{self.name} {value:.6g} {self.unit}"
        unit = {"mm": "N", "rad": "N mm"}.get(self.along, "")
        return f"{self.name} {value:.6g}" + (f" ({self.size * value:.6g} {unit})" if self.size and unit else "")


@dataclass(frozen=True)
class Load:
    """A wrench on a body of the chain.

    Attributes:
        wrench: force in N and moment in N mm, ``(6,)``, world axes at the unloaded posture.
        part: name of the part that carries it; empty for the end-effector.
        at: fraction of the part's elastic length.
        follower: it turns with the body; else it keeps its direction. A moment that keeps its direction is not
            conservative in space.
        ramped: multiplied by the load factor; else it acts in full all along.

    Example:
        >>> import vjm
        >>> vjm.Load((0.0, 0.0, -100.0, 0.0, 0.0, 0.0), part="fore", at=0.5).wrench[2]
        -100.0
    """

    wrench: tuple[float, ...]
    part: str = ""
    at: float = 1.0
    follower: bool = False
    ramped: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "wrench", finite_numbers("a load", self.wrench, 6, nonzero=True))


@dataclass(frozen=True)
class PointControl:
    """A path is controlled by the displacement of a point of the chain; its ramp becomes what that takes.

    Attributes:
        part: name of the part; empty for the end-effector.
        at: fraction of the part's elastic length.
        direction: ``(3,)`` along which the point's displacement from the unloaded posture is taken, world axes.

    Example:
        >>> import vjm
        >>> vjm.PointControl("link", 0.5, (0, 0, 2)).direction
        (0.0, 0.0, 1.0)
    """

    part: str
    at: float
    direction: tuple[float, float, float]

    def __post_init__(self) -> None:
        d = np.array(finite_numbers("a direction", self.direction, 3, nonzero=True))
        object.__setattr__(self, "direction", tuple((d / np.linalg.norm(d)).tolist()))


UNIT_SIZE = 1e-12
"""Rounding of a direction's length: a load of that size is a force of 1 N, and its factor the force."""
SHORTEST = 1e-100
"""End of a ramp, mm, rad or a factor: squares of less are no numbers in double precision."""


@dataclass(frozen=True)
class LoadCase:
    """A ramp: of the end-effector's displacement or of loads, the rest of the pose held or free.

    Attributes:
        posture: label of the posture to start from, unloaded.
        to: end of the ramp, signed, in mm or rad, or a load factor; under a `PointControl` the end of the point's
            displacement in mm.
        axis: the driven component, one of `COMPONENTS`, a displacement ``(6,)`` per unit of ``to``, or `LOAD`.
        steps: number of equal steps; None where the engine chooses, finer around critical points. Behind a
            bifurcation there is a point besides, where the new branch begins, and more where a step fails.
        branch: +1 or −1: which of two mirrored branches to take at a bifurcation. On +1 the largest component
            of the buckling mode's deflection is positive. 0 stays on the path that loses its stability, which
            needs an arc as its parameter.
        free: components of the pose in which the end-effector is free: hinges at its reference point and
            slides in the world's axes lie between it and the support of the end-effector. A support that turns
            takes its slides with it.
        loads: wrenches on bodies of the chain.
        gravity: acceleration ``(3,)`` in m/s², world axes, which gives the parts their weight. It acts in full all
            along, but where loads are driven and none of them is ramped it is what the load factor multiplies.
        control: what the path's parameter is: the ramp, the length of the arc, whole or as far as the first point
            where the ramp turns back (`TO_LIMIT`), or a point's displacement.
        imperfection: mm; the chain is built with a deflection of that size, free of stress, in the shape of the
            mode in which the perfect one buckles under this load case, towards ``branch``.

    Example:
        >>> import vjm
        >>> vjm.LoadCase("A", to=-4.0).driven.unit
        'N'
    """

    posture: str
    to: float
    axis: str | tuple[float, ...] = "x"
    steps: int | None = None
    branch: int = 1
    free: tuple[str, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: tuple[float, float, float] | None = None
    control: str | PointControl = RAMP
    imperfection: float = 0.0

    def __post_init__(self) -> None:
        for name in ("free", "loads"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not isinstance(self.axis, str):
            object.__setattr__(self, "axis", finite_numbers("a ramp's direction", self.axis, 6, nonzero=True))
        if self.gravity is not None:
            object.__setattr__(self, "gravity", finite_numbers("gravity", self.gravity, 3))
        self._check_ramp()
        self._check_end()

    def _check_ramp(self) -> None:
        if isinstance(self.axis, str) and self.axis not in (*COMPONENTS, LOAD):
            raise ValueError(f"axis '{self.axis}' is none of {', '.join(COMPONENTS)}, {LOAD}")
        if not np.isfinite(self.to) or self.to == 0.0:
            raise ValueError(f"the ramp must end at a finite displacement other than zero, not {self.to}")
        if abs(self.to) < SHORTEST:
            raise ValueError(f"the ramp must go further than {SHORTEST:g}, not to {self.to:g}")
        if self.steps is not None and self.steps < 1:
            raise ValueError(f"a ramp needs at least one step, not {self.steps}")
        if self.branch not in (1, -1, 0):
            raise ValueError(f"branch is +1, -1 or 0, not {self.branch}")
        if self.branch == 0 and not self.by_arc:
            raise ValueError("branch 0, the path that loses its stability, needs the arc as the path's parameter")
        if isinstance(self.control, str) and self.control not in (RAMP, ARC, TO_LIMIT):
            raise ValueError(f"control '{self.control}' is none of {RAMP}, {ARC}, {TO_LIMIT}")
        if self.by_arc and self.steps is not None:
            raise ValueError("steps divide a ramp, not an arc: leave them out")
        if self.imperfection < 0.0 or not np.isfinite(self.imperfection):
            raise ValueError(f"an imperfection has a size of zero or more, not {self.imperfection}")

    def _check_end(self) -> None:
        unknown = [name for name in self.free if name not in COMPONENTS]
        if unknown:
            raise ValueError(f"free component '{unknown[0]}' is none of {', '.join(COMPONENTS)}")
        if len(set(self.free)) < len(self.free):
            raise ValueError("a component can be set free only once")
        driven = [name for name in self.free if self.direction[COMPONENTS.index(name)] != 0.0]
        if driven:
            raise ValueError(f"component '{driven[0]}' cannot be free and driven at once")
        if self.load_driven and self.gravity is None and not any(load.ramped for load in self.loads):
            raise ValueError("a ramp of the load factor needs a load that it multiplies")
        if not self.load_driven and any(load.ramped for load in self.loads):
            raise ValueError("a ramped load needs the axis 'load'; beside a driven pose loads act in full")

    @property
    def conservative(self) -> bool:
        """Whether its loads have a potential: no follower, and no moment."""
        return not any(load.follower or any(load.wrench[3:]) for load in self.loads)

    @property
    def by_arc(self) -> bool:
        """Whether the path's parameter is the length of its arc."""
        return self.control in (ARC, TO_LIMIT)

    @property
    def load_driven(self) -> bool:
        """Whether the ramp is a load factor."""
        return self.axis == LOAD

    @cached_property
    def driven(self) -> Driven:
        """What the ramp drives: a wrench along a displacement, one load of size one, or a factor on loads."""
        if not self.load_driven:
            return (
                Driven("force", "N", "mm", 1.0)
                if self.direction[:3].any()
                else Driven("moment", "N mm", "rad", 1.0)
            )
        ramped = np.array([load.wrench for load in self.loads if load.ramped]).reshape(-1, 6)
        forces, moments = bool(ramped[:, :3].any()), bool(ramped[:, 3:].any())
        if forces == moments:
            return Driven("load factor", "", "", 0.0)
        along = "mm" if forces else "rad"
        size = float(np.linalg.norm(ramped[0])) if len(ramped) == 1 else 0.0
        if abs(size - 1.0) > UNIT_SIZE:
            return Driven("load factor", "", along, size)
        return Driven("force" if forces else "moment", "N" if forces else "N mm", along, 1.0)

    @property
    def weight_ramped(self) -> bool:
        """Whether the load factor multiplies the weight."""
        return self.load_driven and not any(load.ramped for load in self.loads)

    @property
    def pose_only(self) -> bool:
        """Whether it is a ramp of the whole imposed pose and nothing else, which every engine can trace."""
        return not (self.load_driven or self.free or self.loads or self.gravity or self.imperfection) and (
            self.control == RAMP
        )

    @property
    def held_by_device(self) -> bool:
        """Whether a device imposes the controlled displacement of the path.

        It does where the only ramped load is a force on that point along that displacement. Else the operator
        watches a gauge, and stability is that under the ramp.
        """
        control = self.control
        if not isinstance(control, PointControl) or not self.load_driven:
            return False
        ramped = [load for load in self.loads if load.ramped]
        if len(ramped) != 1:
            return False
        wrench = np.array(ramped[0].wrench)
        same = (ramped[0].part, ramped[0].at, ramped[0].follower) == (control.part, control.at, False)
        parallel = np.linalg.norm(np.cross(wrench[:3], control.direction)) <= 1e-12 * np.linalg.norm(wrench[:3])
        return bool(same and parallel and not wrench[3:].any())

    @property
    def sign(self) -> float:
        """Of ``to``."""
        return float(np.sign(self.to))

    @cached_property
    def direction(self) -> Array:
        """Displacement ``(6,)`` per unit of the ramp, which runs from 0 to ``abs(to)``; zero for loads.

        Its product with the wrench is the driven force, positive where the chain resists the ramp.
        """
        if self.load_driven:
            return np.zeros(6)
        d = np.eye(6)[COMPONENTS.index(self.axis)] if isinstance(self.axis, str) else np.array(self.axis)
        return self.sign * d

    def displacement(self, ramp: float) -> Array:
        """Displacement ``(6,)`` that is imposed at a ramp, mm, rad, world axes; zero in what is free."""
        return ramp * self.direction + 0.0  # no negative zeros

    @property
    def length(self) -> float:
        """End of the ramp, positive."""
        return abs(self.to)


DEFAULT_REACH_MM = 4.0
"""How far paths go: the paper's own range of displacements."""
LATE_STIFFNESS_KNEE = ("orthoglide-chain", ("B", "D"), 14.0)
"""The paper's slanted postures have their knee only at 7 to 9 mm of compression: their paths go to 14 mm."""


class Direction(StrEnum):
    """Sign of the driven displacement: for posture A, pull or push."""

    TENSION = "tension"
    COMPRESSION = "compression"

    @property
    def sign(self) -> int:
        """+1 for tension, −1 for compression."""
        return 1 if self is Direction.TENSION else -1


def ramp_end(machine: Machine, posture: str, direction: Direction) -> float:
    """Signed end of a comparison's ramp along x, mm."""
    model, postures, late = LATE_STIFFNESS_KNEE
    far = machine.name == model and posture in postures and direction is Direction.COMPRESSION
    return direction.sign * (late if far else DEFAULT_REACH_MM)
