"""The causes of docs/measured-data.md as the injector has them: each a change of the rig that grows with one size.

A *family* is what a finder may call one candidate: a cause in one part, on one channel. Its members are the forms
that it takes: one form scaled by its size, or several that add up (both directions of a tilt). The laws are not the
finder's: bristles for dry friction, soft walls for play, two waves of a bow, two terms of creep, gradual yield,
exponential stiffening, a contact between power and logarithm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hidden_effects.machine import DRIVE, FOOT, LINK, TrueMachine
from hidden_effects.rig import Rig, Seen
from hidden_effects.virtual_rig import WRENCH, Design
from vjm.rotations import Array

Put = Callable[[Rig, float], Rig]
"""Builds a cause of a size into a rig."""


@dataclass(frozen=True)
class Laws:
    """What of a law is not its size; drawn for what is hidden, as here for what it is compared with.

    Attributes:
        play_force: N over which play closes.
        contact_power: of the force; 0: logarithm.
        contact_force: N at which a contact's first stiffness ends.
        bristle: rad that a joint turns before it slips.
        torques: of the four joints over their mean.
        waves: second and third wave of a bow over its first.
        direction: of a bow or tilt, rad.
        base: compliance of the base along y and z over that along x; its turning, rad/(N mm) mm² over mm/N.
        creep: times in s, and the first term's share.
        start: first yield over the largest force, and the power of what follows.
        spread: share of the weight that the foot has.
        centre: share of a difference between pull and push that the push takes.
        pull_force: N over which it changes from one to the other.
        lag: s by which a reading's drift lags behind the temperature.
        ratio: tangent stiffness of a drive at the largest force over that at zero, where the sheet has it rigid.
    """

    play_force: float = 5.0
    contact_power: float = 0.6
    contact_force: float = 10.0
    bristle: float = 2e-4
    torques: tuple[float, float, float, float] = (1.2, 0.8, 1.1, 0.9)
    waves: tuple[float, float] = (0.1, 0.0)
    direction: float | None = None
    base: tuple[float, float, float] = (1.0, 1.0, 0.0)
    creep: tuple[float, float, float] = (25.0, 180.0, 0.6)
    start: tuple[float, float] = (0.5, 1.5)
    spread: float = 0.4
    centre: float = 0.0
    pull_force: float = 50.0
    lag: float = 0.0
    ratio: float = 2.0

    @staticmethod
    def draw(rng: np.random.Generator) -> Laws:
        """Laws of a hidden cause."""
        torques = rng.uniform(0.7, 1.3, 4)
        torques *= 4.0 / torques.sum()
        return Laws(
            play_force=float(rng.uniform(2.0, 15.0)),
            contact_power=float(rng.choice([0.5, 0.6, 2.0 / 3.0, 0.75, 0.0])),
            contact_force=float(rng.uniform(5.0, 40.0)),
            bristle=float(rng.uniform(5e-5, 4e-4)),
            torques=tuple(torques.tolist()),
            waves=(float(rng.uniform(-0.25, 0.25)), float(rng.uniform(-0.1, 0.1))),
            direction=float(rng.uniform(0.0, 2.0 * np.pi)),
            base=(float(rng.uniform(0.4, 2.5)), float(rng.uniform(0.4, 2.5)), float(rng.uniform(0.0, 4e-6))),
            creep=(float(rng.uniform(10.0, 40.0)), float(rng.uniform(90.0, 300.0)), float(rng.uniform(0.4, 0.8))),
            start=(float(rng.uniform(0.35, 0.65)), float(rng.uniform(1.1, 1.8))),
            spread=float(rng.uniform(0.2, 0.6)),
            centre=float(rng.choice([0.0, 0.5])),
            lag=float(rng.choice([0.0, 20.0])),
            ratio=float(rng.choice([0.4, 0.6, 2.0, 3.0])),
        )


@dataclass(frozen=True)
class Family:
    """One candidate.

    Attributes:
        cause: name of docs/measured-data.md, or of `outside`.
        label: tells a cause's families apart: the part or channel.
        members: forms.
        first: size that can be seen, roughly.
        signs: that a size may have.
        most: largest size of sense.
        spans: the members add up, each with a size of its own; else there is one.
        parameter: key of the principal parameter where its value follows from the size, else empty.
        value: that value.
    """

    cause: str
    label: str
    members: tuple[Put, ...]
    first: float
    signs: tuple[int, ...] = (1,)
    most: float = 1e9
    spans: bool = False
    parameter: str = ""
    value: Callable[[float], float] = float

    @property
    def name(self) -> str:
        """``plasticity link``."""
        return f"{self.cause} {self.label}".strip()


@dataclass(frozen=True)
class Hidden:
    """One hidden cause."""

    family: Family
    size: float
    strength: float
    laws: Laws = field(default_factory=Laws)

    @property
    def put(self) -> Put:
        """Builds it in."""
        (put,) = self.family.members
        return put


def catalogue(design: Design, largest: float, laws: Laws = Laws()) -> list[Family]:
    """Every family that a design can have."""
    families = [
        *_drive(design, largest, laws), *_joints(laws), *_parts(design, laws), *_geometry(laws),
        *_weight(design, laws),
        *_creep(design, laws), *_plasticity(largest, laws), *_instruments(design, laws),
    ]  # fmt: skip
    if design.foot_segments == 1:
        families.append(
            Family("foot_lumping", "", (lambda rig, _: _machine(rig, lumped_foot=False),), 1.0, most=1.0)
        )
    return families


def _machine(rig: Rig, **changes: object) -> Rig:
    return replace(rig, machine=replace(rig.machine, **changes))  # type: ignore[arg-type]


def _law(part: int, columns: Callable[[float], dict[str, float]]) -> Put:
    return lambda rig, size: replace(rig, machine=rig.machine.with_law(part, **columns(size)))


def _drive(design: Design, largest: float, laws: Laws) -> list[Family]:
    c = design.drive
    found = [
        Family("actuator_compliance", "", (_law(DRIVE, lambda s: {"linear": s}),), 1e-5, most=1e-3,
               parameter="actuator_compliance.compliance_mm_per_N"),
        Family("actuator_backlash", "", (_law(DRIVE, lambda s: {"play": s, "play_force": laws.play_force}),), 0.01,
               most=0.4, parameter="actuator_backlash.gap_mm"),
        Family("contact_compliance", "actuator", (_contact(DRIVE, laws),), 0.01, most=0.3,
               parameter="contact_compliance.displacement_at_1kN_mm"),
    ]  # fmt: skip
    if c == 0.0:
        # the sheet has no spring that could stiffen: it brings its own
        own = _law(DRIVE, lambda s: {"stiffening": s, "stiffening_force": largest / np.log(laws.ratio)})
        found.append(
            Family("actuator_hardening", "", (own,), 1e-5, most=1e-3,
                   parameter="actuator_hardening.stiffness_ratio", value=lambda _: laws.ratio)
        )  # fmt: skip
    else:
        stiffening = _law(
            DRIVE, lambda s: {"linear": -c, "stiffening": c, "stiffening_force": largest / (s or 1e-9)}
        )
        found += [
            Family("actuator_hardening", "", (stiffening,), 0.3, (1, -1), 2.5,
                   parameter="actuator_hardening.stiffness_ratio", value=lambda s: float(np.exp(s))),
            Family("tension_compression_asymmetry", "actuator", (_pull_of_drive(c, laws),), 0.2, (1, -1), 1.2,
                   parameter="tension_compression_asymmetry.ratio", value=lambda s: float(np.exp(s))),
        ]  # fmt: skip
    return found


def _pull_of_drive(c: float, laws: Laws) -> Put:
    def columns(s: float) -> dict[str, float]:
        push = c * np.exp(laws.centre * s)
        return {"linear": push - c, "pull": push * (np.exp(-s) - 1.0), "pull_force": laws.pull_force}

    return _law(DRIVE, columns)


def _contact(part: int, laws: Laws) -> Put:
    p, f = laws.contact_power, laws.contact_force
    return _law(part, lambda s: {"contact": s, "contact_power": p, "contact_force": f})


def _joints(laws: Laws) -> list[Family]:
    def friction(rig: Rig, size: float) -> Rig:
        slip = size * np.array(laws.torques)
        return _machine(rig, joints=np.column_stack([slip / laws.bristle, slip]))

    return [
        Family("joint_friction", "", (friction,), 200.0, most=3e4, parameter="joint_friction.torque_Nmm"),
        Family("joint_clearance", "", (_law(LINK, lambda s: {"play": s, "play_force": laws.play_force}),), 0.01,
               most=0.4, parameter="joint_clearance.gap_mm"),
        Family("contact_compliance", "joints", (_contact(LINK, laws),), 0.01, most=0.3,
               parameter="contact_compliance.displacement_at_1kN_mm"),
    ]  # fmt: skip


def _parts(design: Design, laws: Laws) -> list[Family]:
    def factor(part: str) -> Put:
        return lambda rig, s: _machine(
            rig, **{f"{part}_factor": getattr(rig.machine, f"{part}_factor") * np.exp(s)}
        )

    def pull(part: str) -> Put:
        def put(rig: Rig, s: float) -> Rig:
            here = getattr(rig.machine, f"{part}_factor") * np.exp(laws.centre * s)
            changed = {f"{part}_factor": here, f"{part}_pull": np.exp(-s) - 1.0}
            return _machine(rig, pull_force=laws.pull_force, **changed)

        return put

    def base(shares: tuple[float, float, float], turning: float) -> Put:
        def put(rig: Rig, s: float) -> Rig:
            diagonal = np.array([*(s * np.array(shares)), *(3 * [s * turning])])
            return _machine(rig, base=np.diag(diagonal))

        return put

    y, z, turning = laws.base
    bases: tuple[Put, ...] = (base((1.0, y, z), turning),)
    if laws.direction is None:
        bases = (base((1.0, 0.0, 0.0), 0.0), base((0.0, 1.0, 0.0), 0.0), base((0.0, 0.0, 1.0), 0.0))
    ratio = "tension_compression_asymmetry.ratio"
    found = [
        Family(f"{part}_compliance", "", (factor(part),), 0.05, (1, -1), 1.2, parameter=f"{part}_compliance.factor",
               value=lambda s: float(np.exp(s)))
        for part in ("foot", "link")
    ]  # fmt: skip
    found += [
        Family("tension_compression_asymmetry", part, (pull(part),), 0.1, (1, -1), 1.2, parameter=ratio,
               value=lambda s: float(np.exp(s)))
        for part in ("foot", "link") if part == "link" or design.foot_segments > 1
    ]  # fmt: skip
    found.append(
        Family("base_compliance", "", bases, 1e-5, most=1e-3, spans=laws.direction is None,
               parameter="base_compliance.cxx_mm_per_N")
    )  # fmt: skip
    return found


def _geometry(laws: Laws) -> list[Family]:
    def bow(direction: float) -> Put:
        def put(rig: Rig, s: float) -> Rig:
            wave = s * np.array([1.0, *laws.waves])
            # at mid-span the second wave has a node and the third counts against the first
            wave /= 1.0 - laws.waves[1]
            return _machine(rig, bow=np.outer([np.cos(direction), np.sin(direction)], wave))

        return put

    def tilt(direction: float) -> Put:
        return lambda rig, s: replace(rig, tilt=(s * np.cos(direction), s * np.sin(direction)))

    bows = (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4) if laws.direction is None else (laws.direction,)
    tilts = (0.0, np.pi / 2) if laws.direction is None else (laws.direction,)
    longer: Put = lambda rig, s: _machine(rig, link_longer=rig.machine.link_longer + s)  # noqa: E731
    return [
        *(Family("link_bow", f"{np.degrees(d):.0f}", (bow(d),), 0.5, most=8.0, parameter="link_bow.amplitude_mm")
          for d in bows),
        Family("link_length", "", (longer,), 1.0, (1, -1), 12.0, parameter="link_length.delta_mm"),
        Family("load_misalignment", "", tuple(tilt(d) for d in tilts), 0.01, (1, -1), 0.35, laws.direction is None,
               "load_misalignment.angle_rad"),
    ]  # fmt: skip


def _weight(design: Design, laws: Laws) -> list[Family]:
    def weight(foot: float) -> Put:
        return lambda rig, s: _machine(rig, weight=(foot * s, (1.0 - foot) * s), down=design.down)

    forms = (weight(0.0), weight(1.0)) if laws.direction is None else (weight(laws.spread),)
    return [Family("gravity", "", forms, 1.0, most=200.0, spans=len(forms) > 1, parameter="gravity.mass_kg")]


def _creep(design: Design, laws: Laws) -> list[Family]:
    fast, slow, first = laws.creep

    def creep(part: int) -> Put:
        def put(rig: Rig, s: float) -> Rig:
            late = s / (1.0 - s) * (design.drive if part == DRIVE else 1.0)
            table = np.zeros((4, 2))
            table[part] = first * late, (1.0 - first) * late
            table[3] = fast, slow
            return _machine(rig, creep=table)

        return put

    parts = [("foot", FOOT), ("link", LINK), *([("actuator", DRIVE)] if design.drive > 0.0 else [])]
    return [
        Family("creep", name, (creep(part),), 0.02, most=0.7, parameter="creep.fraction") for name, part in parts
    ]


def _plasticity(largest: float, laws: Laws) -> list[Family]:
    share, power = laws.start
    # the size is the set that the largest force leaves
    whole = (1.0 - share) ** power

    def law(s: float) -> dict[str, float]:
        return {"set": s / whole, "set_start": share * largest, "set_force": largest, "set_power": power}

    return [
        Family("plasticity", name, (_law(part, law),), 0.01, most=0.8)
        for name, part in (("actuator", DRIVE), ("foot", FOOT), ("link", LINK))
    ]


def _instruments(design: Design, laws: Laws) -> list[Family]:
    found = []
    for name, known in design.instruments.items():
        found += [
            Family("instrument_zero", name, (_fault(name, lambda s, seen: np.full(len(seen.ux), s)),),
                   4.0 * known.zero, (1, -1), 60.0 * known.zero, parameter=f"instrument_zero.{name}"),
            Family("instrument_scale", name, (_scaled(name),), 4.0 * known.scale, (1, -1), 60.0 * known.scale,
                   parameter=f"instrument_scale.{name}"),
            Family("thermal_drift", f"{name}.per_K", (_fault(name, _by_temperature(laws.lag)),), 2.0 * known.noise,
                   (1, -1), parameter=f"thermal_drift.{name}.per_K"),
            Family("thermal_drift", f"{name}.per_s", (_fault(name, lambda s, seen: s * seen.sequence.time),),
                   known.noise / 200.0, (1, -1), parameter=f"thermal_drift.{name}.per_s"),
        ]  # fmt: skip
    return found


def _by_temperature(lag: float) -> Callable[[float, Seen], Array]:
    def drift(size: float, seen: Seen) -> Array:
        T, t = seen.sequence.temperature, seen.sequence.time
        felt = T.copy()
        for k in range(1, len(T)):
            share = 1.0 - np.exp(-(t[k] - t[k - 1]) / lag) if lag > 0.0 else 1.0
            felt[k] = felt[k - 1] + share * (T[k] - felt[k - 1])
        return size * (felt - 21.0)

    return drift


def _fault(channel: str, by: Callable[[float, Seen], Array]) -> Put:
    def put(rig: Rig, size: float) -> Rig:
        def fault(seen: Seen) -> Seen:
            return added(seen, channel, by(size, seen))

        return rig.with_fault(fault)

    return put


def _scaled(channel: str) -> Put:
    def put(rig: Rig, size: float) -> Rig:
        return rig.with_fault(lambda seen: added(seen, channel, size * reading(seen, channel)))

    return put


def reading(seen: Seen, channel: str) -> Array:
    """What a channel reads ``(n,)``."""
    result: Array = seen.ux if channel not in WRENCH else seen.forces[:, seen.at(channel)]
    return result


def added(seen: Seen, channel: str, more: Array) -> Seen:
    """The same with ``more`` (n,) added to a channel."""
    if channel not in WRENCH:
        return replace(seen, ux=seen.ux + more)
    forces = seen.forces.copy()
    forces[:, seen.at(channel)] += more
    return replace(seen, forces=forces)


def plain(machine: TrueMachine) -> Rig:
    """A rig without faults."""
    return Rig(machine)
