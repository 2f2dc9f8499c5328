"""The robot with a place for every error that is thought possible: the machine of the model file, extended.

Behind the base lie springs of the base. Before each joint lie held joints for the error of the frame between it and
the one before: three shifts and two turns, in the joint's own axes. A joint that rides on a beam follows the beam
and not a frame, and they lie behind it. Each joint has springs about its own axis and
about the two others. Each link deflects at its middle. All are there from the start, at zero or all but rigid, so
that every hypothesis is a vector of numbers on the same machine, and its derivatives are those of
`vjm.kernels.derivatives`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import assert_never

import numpy as np

from vjm.model.laws import Law, Tabulated
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Closure, Joint, Part, PointSpring, RigidOffset, joint_axes
from vjm.rotations import AXES, Array, frame
from vjm_updating.constants import numerical, physical_bound

RIGID = physical_bound(1e-14)
"""rad/(N mm): the compliance of what is thought rigid. A torque of 1e6 N mm turns it by 1e-8 rad: 1e-5 mm at a
metre. Smaller ones would lose digits in the tangent, whose largest stiffness it gives."""
FRAME = ("shift-x", "shift-y", "shift-z", "turn-x", "turn-y")
"""Errors of the frame before a joint: along and about axes of which z is the joint's."""
BASE = ("x", "y", "z")
OWN, ACROSS = "own", "across"
LATERAL = ("first", "second")
SPRINGS = (*LATERAL, OWN)
"""Labels of a joint's springs: about the two axes across its own, and about or along that."""
PAIRS = numerical(512)
"""Of deflection and force that stand for the rest of a law, see `straight_and_rest`: it errs by 1e-4 at most."""
LEFT = numerical(1e-3)
"""Share of a law's least compliance that its rest has there: a law has a slope everywhere."""
SHORTEST_LINK = physical_bound(20.0, "mm")
"""mm: a shorter one has no bending that could be seen."""


@dataclass(frozen=True)
class MachineSpring:
    """A coordinate whose compliance is to be found.

    Attributes:
        part: of the model file that it belongs to; ``base``.
        kind: ``own``, ``across``, ``link``, ``base`` or ``beam``.
        label: what tells it from others of the part.
        span: its coordinates: one; of a beam all.
        nominal: compliance that the model gives it, rad/(N mm) or mm/N; of a beam 1, a factor.
        slides: whether its coordinate is a length.
    """

    part: str
    kind: str
    label: str
    span: range
    nominal: float
    slides: bool = False


@dataclass(frozen=True)
class FrameError:
    """A held joint that stands for one error of the frame before a joint."""

    joint: str
    label: str
    index: int


class PoseMachine:
    """The extended machine.

    Attributes:
        chain: the machine of the model file.
        tree: its assembled arrays, extended.
        joints: names of the joints that the data give, and
        slides: whether each slides.
        followers: coupled joints, whose coordinates those make.
        driven: one-degree joint of every joint with a coordinate, coupled ones too, by name.
        springs: coordinates whose compliance is to be found.
        frames: errors of frames.
        masses: part of each load of the tree's arrays that is a weight, in their order.
        moves: of a joint that pushes a beam out or rides on one all one-degree joints that it moves and their
            shares, by the first.
        coupled: the coupled joints' names and whether what bends is passed on.
        as_modelled: springs of joints that are not set aside.
    """

    def __init__(
        self, chain: Machine, ends: dict[str, tuple[str, Array]], *, rigid: bool = False, at_output: bool = False,
        as_modelled: Collection[tuple[str, str]] = (),
    ) -> None:  # fmt: skip
        """Extend a machine.

        Args:
            chain: of the model file.
            ends: part behind which each marker rides, and where there, ``(3,)`` mm, by the marker's name.
            rigid: set aside the compliances of joints.
            at_output: set aside those about the joints' own axes: what they bend by is in the coordinates.
            as_modelled: joint and label of springs that `rigid` does not set aside.

        Raises:
            ValueError: a part or a spring that has no place here.
        """
        if not chain.held_joints:
            raise ValueError(
                f"{chain.name}: no joint is driven: a test of poses needs parts of kind = 'actuated' whose "
                "coordinates the data give"
            )
        for part in chain.parts:
            if isinstance(part, Joint) and not part.held:
                raise ValueError(
                    f"{chain.name}: part '{part.name}' has no coordinate in a test of poses: make it "
                    "kind = 'actuated'"
                )
        self.chain, self._at_output, self.as_modelled = chain, at_output, frozenset(as_modelled)
        self._parts: list[Part] = []
        self._after: dict[str, str] = {}
        self._frames: list[tuple[str, str, str]] = []
        self._springs: list[tuple[str, str, str, str, int | None, float, bool]] = []
        self._ends_at: dict[str, str] = {}
        self._add_base(chain)
        before = chain.predecessors
        for part in chain.parts:
            behind = before[part.name]
            self._add(part, self._ends_at.get(behind, behind), rigid=rigid)
        named = {}
        for marker, (part_name, place) in ends.items():
            on = part_name or chain.parts[-1].name
            if on not in {p.name for p in chain.parts}:
                known = ", ".join(p.name for p in chain.parts)
                raise ValueError(f"[markers.{marker}] on = '{on}' is no part of the model, which has {known}")
            self._append(RigidOffset(f"{marker}~marker", frame(p=place)), self._ends_at.get(on, on))
            named[marker] = f"{marker}~marker"
        extended = replace(
            chain, parts=tuple(self._parts), after=self._after, ends=named, postures={}, held={},
            point_springs=self._springs_between(chain), closures=self._closures(chain),
        )  # fmt: skip
        # a beam is one spring here, whose compliance is what is fitted
        self.tree = Mechanism(extended)
        own = {joint.name: joint for joint in chain.moving if joint.held}
        self.joints = tuple(name for name, joint in own.items() if joint.coupling is None)
        self.slides = tuple(own[name].slides for name in self.joints)
        self.limits = tuple(own[name].limits for name in self.joints)
        self.followers = tuple(joint for joint in own.values() if joint.coupling is not None)
        self.coupled = {joint.name: bool(joint.passes_on) for joint in self.followers}
        self.driven = {name: self.tree.driven_by(name) for name in own}
        along_beams = (*chain.pushing, *(joint.name for joint in chain.riders.values()))
        shares = {self.driven[name]: self.tree.shares(name) for name in along_beams}
        self.moves = {first: list(own_share.items()) for first, own_share in shares.items()}
        self.turning = {name for name, part in own.items() if not part.slides}
        self.frames = tuple(FrameError(j, label, self.tree.driven_by(part)) for j, label, part in self._frames)
        springs = []
        for name, kind, label, where, index, c, slides in self._springs:
            span = self.tree.span(where)
            own_span = span if index is None else range(span[index], span[index] + 1)
            springs.append(MachineSpring(name, kind, label, own_span, c, slides))
        self.springs = tuple(springs)
        self.masses = self.tree.weighed()

    def _springs_between(self, chain: Machine) -> tuple[PointSpring, ...]:
        """The model's springs between points; a link that deflects at its middle begins with its root."""
        names = {part.name for part in self._parts}

        def begins(part: str) -> str:
            return f"{part}~root" if f"{part}~root" in names else part

        return tuple(
            replace(spring, parts=(begins(spring.parts[0]), begins(spring.parts[1])))
            for spring in chain.point_springs
        )

    def _closures(self, chain: Machine) -> tuple[Closure, ...]:
        """The model's closures; what holds a joint that rides on a beam holds it behind the errors of its frame."""
        return tuple(
            replace(each, parts=(self._ends_at.get(each.parts[0], each.parts[0]),
                                 self._ends_at.get(each.parts[1], each.parts[1])))
            for each in chain.closures
        )  # fmt: skip

    def _append(self, part: Part, behind: str) -> None:
        self._parts.append(part)
        self._after[part.name] = behind

    def _add_base(self, chain: Machine) -> None:
        if any("" in closure.parts for closure in chain.closures):
            return  # it stands on the ground at several places: no one base turns
        behind = ""
        for axis in BASE:
            name = f"base~turn-{axis}"
            self._append(Joint(name, AXES[axis], compliance=RIGID), behind)
            self._springs.append(("base", "base", f"about {axis}", name, 0, 0.0, False))
            behind = name
        self._ends_at[""] = behind

    def _add(self, part: Part, behind: str, *, rigid: bool) -> None:
        match part:
            case Joint(passive=False, fixed=False) if part.rides_on:
                self._append_springs(part, behind, rigid=rigid)
                self._ends_at[part.name] = self._append_frame(part, part.name)
            case Joint(passive=False, fixed=False):
                self._append_springs(part, self._append_frame(part, behind), rigid=rigid)
            case RigidOffset():
                self._append_link(part, behind)
            case Beam():
                self._append(part, behind)
                if part.free_length or part.segments is None or part.segments == 1:
                    self._springs.append((part.name, "beam", "factor", part.name, None, 1.0, False))
            case Joint():
                self._append(part, behind)
            case _:
                assert_never(part)

    def _append_frame(self, joint: Joint, behind: str) -> str:
        """Joints for the errors of a joint's frame; the last one's name."""
        axes = joint_axes(joint.axis)
        for k, label in enumerate(FRAME):
            name = f"{joint.name}~{label}"
            self._append(Joint(name, axes[:, k % 3], slides=k < 3), behind)
            self._frames.append((joint.name, label, name))
            behind = name
        return behind

    def _append_springs(self, joint: Joint, behind: str, *, rigid: bool) -> None:
        aside = {label for label in SPRINGS if rigid and (joint.name, label) not in self.as_modelled}
        keep = joint.matrix is not None
        if keep and self._at_output and not aside:
            raise ValueError(
                f"joint '{joint.name}': its 6×6 compliance mixes what a measured output has in it with what it has "
                "not: write compliances about and across its axis"
            )
        if keep and not aside:
            self._append(joint, behind)
            return
        own = 0.0 if OWN in aside or self._at_output else joint.compliance
        lateral = [0.0 if label in aside else c for label, c in zip(LATERAL, joint.lateral, strict=True)]
        at_least = (max(lateral[0], RIGID), max(lateral[1], RIGID))
        where, index, law = joint.name, 2, None if OWN in aside or self._at_output else joint.law
        if law is not None:
            # the joint's spring is a straight one, and behind that the rest of its law
            self._refuse_law(joint)
            where, index, (own, law) = f"{joint.name}~straight", 0, straight_and_rest(law)
            self._append(Joint(where, joint.axis, joint.slides, compliance=max(own, RIGID)), behind)
            behind = where
        compliance = max(own, RIGID) if law is None else 0.0
        self._append(replace(joint, compliance=compliance, law=law, lateral=at_least, matrix=None), behind)
        for k, label in enumerate(LATERAL):
            self._springs.append((joint.name, ACROSS, label, joint.name, k, lateral[k], False))
        self._springs.append((joint.name, OWN, OWN, where, index, own, joint.slides))

    def _refuse_law(self, joint: Joint) -> None:
        """Refuse a law in a joint whose coordinate moves more than its own body.

        Raises:
            ValueError: it has one.
        """
        coupled = [p.coupling.ratios for p in self.chain.moving if p.coupling is not None]
        followed = {name for ratios in coupled for name, _ in ratios}
        if joint.coupling is not None or joint.rides_on or joint.name in followed.union(self.chain.pushing):
            raise ValueError(
                f"joint '{joint.name}' has a law, and it is coupled with another joint or with a beam: give it a "
                "constant compliance"
            )

    def _append_link(self, link: RigidOffset, behind: str) -> None:
        along = link.transform[:3, 3]
        length = float(np.linalg.norm(along))
        if length < SHORTEST_LINK:
            self._append(link, behind)
            return
        axes = joint_axes(along / length)
        half = 0.5 * along
        far = link.mass > 0.0 and float(link.centre_of_mass @ along) > 0.5 * length**2
        near = link.mass > 0.0 and not far
        root = RigidOffset(
            f"{link.name}~root", frame(p=half), link.mass if near else 0.0, link.centre_of_mass if near else None
        )
        self._append(root, behind)
        behind = root.name
        for k, label in enumerate(("first", "second", "twist")):
            name = f"{link.name}~{label}"
            self._append(Joint(name, axes[:, k], compliance=RIGID), behind)
            self._springs.append((link.name, "link", label, name, 0, 0.0, False))
            behind = name
        rest = frame(link.transform[:3, :3], half)
        centre = link.centre_of_mass - half if far else None
        self._append(RigidOffset(link.name, rest, link.mass if far else 0.0, centre), behind)

    def rows(self, q: Array) -> Array:
        """Rows of the tree's coordinates ``(g, n_tree)`` from those of the data's joints ``(g, n)``."""
        result = np.zeros((len(q), len(self.tree.joints)))
        result[:, [self.tree.joints.index(name) for name in self.joints]] = q
        return result


class RestOfLaw(Tabulated):
    """What a law deflects by beyond a straight spring: its force may stay the same over a stretch."""

    def check(self) -> None:
        """Nothing is refused: it follows from a law."""


def straight_and_rest(law: Law) -> tuple[float, Law]:
    """A straight spring and a law that are a law in series, so that the first may be found stiffer or softer.

    It has the compliance that the law has where it is stiffest, rad/(N mm) or mm/N, less what `LEFT` says.
    """
    ends = law.curve.knots
    # straight beyond its knots, from just behind them
    near = 1e-3 * float(np.ptp(ends))
    beyond = np.array([ends[0] - 1.0, ends[0] - near, 0.0, ends[-1] + near, ends[-1] + 1.0])
    count = 1 + -(-PAIRS // max(len(ends) - 1, 1))
    places = np.unique(np.concatenate([beyond, *(np.linspace(a, b, count) for a, b in pairwise(ends))]))
    forces = np.where(places == 0.0, 0.0, law.force(places))
    compliance = (1.0 - LEFT) / float(np.max(np.diff(forces) / np.diff(places)))
    return compliance, RestOfLaw(tuple(map(float, places - compliance * forces)), tuple(map(float, forces)))


def with_coupling(chain: Machine, joint: str, *, as_deflected: bool) -> Machine:
    """The machine with a coupled joint that passes on what bends, or does not."""
    parts = tuple(
        replace(part, coupling=replace(part.coupling, as_deflected=as_deflected))
        if isinstance(part, Joint) and part.coupling is not None and part.name == joint
        else part
        for part in chain.parts
    )
    return replace(chain, parts=parts)
