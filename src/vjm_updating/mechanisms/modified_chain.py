"""A machine to be taken through a test: the chain, its lumped model, and what is built into it.

Also what a small extension somewhere in a machine with closed loops does to its end-effector, which is free.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.machine.equilibria import equilibria
from vjm.machine.rigid_mechanism import CLOSED, LoopClosure, PoseError
from vjm.model.machine import FOOT, Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parameters import beam_length, compliance_factor
from vjm.model.parts import Beam, Joint, JointKind
from vjm.rotations import Array, frame
from vjm_updating.constants import definition, numerical

LOOSE = numerical(1e-9)
"""Stiffness over the largest, in the machine's units, below which the end-effector is loose."""
BRACED = numerical(1e-6)
"""Force that holds a place back, over that which would hold the end-effector back from its motion, below which it
comes of a model file's rounded coordinates."""


@dataclass(frozen=True)
class Moved:
    """By an extension of one at each of k places.

    Attributes:
        end: what the free end-effector does ``(k, 6)``, mm and rad per mm or rad.
        held: with what force each place is held back ``(k,)`` by the rest of the machine, N/mm or N mm/rad: zero
            where the extension is a motion that the machine has.
        free: ``(k,)`` whether nothing holds it back and the end-effector moves.
    """

    end: Array
    held: Array
    free: np.ndarray


def moved(model: Mechanism, x: Array, wrench: Array, end: Array, closing: Array) -> Moved:
    """What extensions do to a machine in a state.

    ``wrench`` (6,) holds the end-effector at the coordinates ``x`` (n,). With the loops cut and all else still an
    extension does ``end`` (6, k) to it, and ``closing`` (f, k) to what closures and couplings hold.

    Raises:
        numpy.linalg.LinAlgError: the state is singular.
    """
    n, still = model.coordinates, np.zeros(model.size)
    K = model.compiled.end_stiffness(x, wrench)
    by_pose = [model.compiled.response(x, wrench, still, own)[0][n:] for own in np.eye(6)]
    scale = np.repeat([1.0, 1.0 / model.characteristic_length], 3)
    # of a loose end-effector the smallest motion
    free = scale[:, None] * np.linalg.pinv(scale[:, None] * K * scale, rcond=LOOSE, hermitian=True) * scale
    motions, held = np.empty((end.shape[1], 6)), np.empty(end.shape[1])
    for i, (own, gap) in enumerate(zip(end.T, closing.T, strict=True)):
        behind = still.copy()
        behind[n:] = -gap
        dx, force = model.compiled.response(x, wrench, behind, -own)
        motions[i] = -free @ force
        held[i] = gap @ (dx[n:] + np.transpose(by_pose) @ motions[i]) + own @ (force + K @ motions[i])
    whole = np.einsum("ki,ij,kj->k", motions, K, motions)
    return Moved(motions, held, (whole > 0.0) & (np.abs(held) < BRACED * whole))


STANDARD_GRAVITY = definition(9.80665, "m/s²")
"""m/s²."""
LINK = "link"
"""Word for a link that is the only one."""
NEITHER = numerical(1e-6)
"""Axial force over the whole one, below which a load neither pulls on a part nor pushes: it bends it."""
AxialSigns = tuple[int, ...]
"""What a load does to each part that differs between pull and push: 1 it pulls, -1 it pushes, 0 neither."""
KEPT = numerical(128)
"""Lumped models that are kept."""
_MODELS: OrderedDict[tuple[object, ...], tuple[Machine, Mechanism]] = OrderedDict()
"""With the chain that each was made from, which keeps its identity."""


@dataclass(frozen=True)
class ModifiedMachine:
    """A chain and what a test meets of it.

    Attributes:
        engine: of its lumped model; how many springs.
        factors: of a part's compliance over its nominal value, by part.
        lengthened: mm by beam.
        bow: of beams at mid-span along their section's y and z axes, mm, by part.
        asymmetry: stiffness in pull over that in push, by part.
        weight: mass in kg that is spread over each beam, by part.
        changed: what tells the nominal chain from others that were built from one: a calibration's unknowns.
    """

    nominal: Machine
    engine: VjmEngine
    factors: tuple[tuple[str, float], ...] = ()
    lengthened: tuple[tuple[str, float], ...] = ()
    bow: tuple[tuple[str, float, float], ...] = ()
    asymmetry: tuple[tuple[str, float], ...] = ()
    weight: tuple[tuple[str, float], ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)
    changed: tuple[float, ...] = ()

    @property
    def weighing(self) -> tuple[float, float, float] | None:
        """Acceleration by which its parts weigh, m/s²; None where they have no weight."""
        if not any(mass for _, mass in self.weight):
            return None
        x, y, z = (STANDARD_GRAVITY * g for g in self.gravity)
        return x, y, z

    @property
    def key(self) -> tuple[object, ...]:
        """What tells two machines with one nominal chain apart."""
        return (
            self.engine, self.factors, self.lengthened, self.bow, self.asymmetry, self.weight, self.gravity,
            self.changed,
        )  # fmt: skip

    def times(self, part: str, factor: float) -> ModifiedMachine:
        """The machine with a part's compliance times a factor."""
        own = dict(self.factors)
        own[part] = own.get(part, 1.0) * factor
        return replace(self, factors=tuple(sorted(own.items())))

    def longer(self, part: str, by: float) -> ModifiedMachine:
        """The machine with a beam longer by so many mm."""
        own = dict(self.lengthened)
        own[part] = own.get(part, 0.0) + by
        return replace(self, lengthened=tuple(sorted(own.items())))

    def with_bow(self, part: str, along_y: float, along_z: float) -> ModifiedMachine:
        """The machine with a beam bowed by so many mm more."""
        own = {name: (y, z) for name, y, z in self.bow}
        y, z = self.bow_of(part)
        own[part] = y + along_y, z + along_z
        return replace(self, bow=tuple((name, *bow) for name, bow in sorted(own.items()) if any(bow)))

    def bow_of(self, part: str) -> tuple[float, float]:
        """Amplitudes of a beam's bow along its section's y and z axes, mm."""
        return next(((y, z) for name, y, z in self.bow if name == part), (0.0, 0.0))

    def chain(self, pulls: bool | AxialSigns = True) -> Machine:
        """The chain as it is, in pull or in push, where these differ; of parts that do neither the mean."""
        chain = self.nominal
        for part, by in self.lengthened:
            parameter = beam_length(chain, part)
            chain = parameter.apply(chain, parameter.value + by) if by else chain
        for part, factor in self.factors:
            chain = compliance_factor(chain, part).apply(chain, factor) if factor != 1.0 else chain
        for (part, ratio), way in zip(self.asymmetry, self._axial_signs(pulls), strict=True):
            root = float(np.sqrt(ratio))
            chain = compliance_factor(chain, part).apply(chain, 1.0 / root if way > 0 else root) if way else chain
        for part, mass in self.weight:
            beam = beam_of(chain, part)
            if mass and beam.section is not None:
                section = replace(beam.section, mass=mass / beam.length / beam.count)
                parts = tuple(replace(p, section=section) if isinstance(p, Beam) and p.name == part else p
                              for p in chain.parts)  # fmt: skip
                chain = replace(chain, parts=parts)
        return chain

    def _axial_signs(self, pulls: bool | AxialSigns) -> AxialSigns:
        return pulls if isinstance(pulls, tuple) else (1 if pulls else -1,) * len(self.asymmetry)

    def model(self, posture: str, pulls: bool | AxialSigns = True) -> Mechanism:
        """The lumped model in a posture, its springs free of stress where they are drawn: a bow is not in it.

        Machines that differ in nothing but the bow share one, and postures where only passive joints differ.
        """
        standing = posture if self.nominal.held_joints or self.nominal.closes else ""
        key = (
            id(self.nominal), self.engine, self.factors, self.lengthened, self.asymmetry, self.weight,
            self._axial_signs(pulls), standing,
        )  # fmt: skip
        known = _MODELS.get(key)
        if known is None:
            chain = self.chain(pulls).at(posture)
            if chain.closes:
                # what its loops hold too often is counted in its one posture
                chain = replace(chain, postures={posture: chain.posture(posture)}, poses={})
                chain = standing_free(chain, self.engine) if self.lengthened else chain
            known = _MODELS[key] = self.nominal, self.engine.model(chain)
            if len(_MODELS) > KEPT:
                _MODELS.popitem(last=False)
        return known[1]

    @property
    def drive(self) -> Joint | None:
        """The drive before the joints, where there is one; none that moves one of several legs."""
        if self.nominal.closes:
            return None
        for part in self.nominal.parts:
            if isinstance(part, Joint) and part.kind is JointKind.ACTUATOR:
                return part
            if isinstance(part, Joint) and part.free:
                return None
        return None

    @property
    def drive_axis(self) -> Array | None:
        """Unit vector ``(3,)`` of the drive's axis, world axes; None where there is no drive before the joints."""
        if self.drive is None:
            return None
        return self.nominal.base[:3, :3] @ np.asarray(self.drive.axis)

    def line(self, posture: str, part: str = "") -> Array:
        """Unit vector ``(3,)`` along a beam, the last one by default, from its root to its tip, world axes.

        That of the unloaded posture.
        """
        model = ModifiedMachine(self.nominal, self.engine).model(posture)
        return _line(model, posture, part or link_of(self.nominal))

    def shift(self, posture: str, part: str) -> tuple[Array, Array]:
        """What 1 mm more of a beam, along its line, does where the loops are cut and all else is still.

        Returns:
            To the end-effector ``(6,)``, and to what closures and couplings hold ``(f,)``; mm and rad.
        """
        model = ModifiedMachine(self.nominal, self.engine).model(posture)
        line, before = self.line(posture, part), self.nominal.predecessors

        def carries(other: str) -> bool:
            while other and other != part:
                other = before[other]
            return bool(other)

        def moves(other: str, rows: int = 6) -> Array:
            return np.concatenate([line, np.zeros(3)])[:rows] * carries(other)

        held = [moves(c.parts[1], c.rows) - moves(c.parts[0], c.rows) for c in self.nominal.closures]
        couplings = np.zeros(len(self.nominal.couplings))
        closing = np.concatenate([*held, couplings])
        assert len(closing) == model.size - model.coordinates
        return moves(self.nominal.parts[-1].name), closing

    def axial_signs(self, posture: str, force: Array) -> AxialSigns:
        """What a force ``(3,)`` at the end-effector does to each part that differs between pull and push."""
        size = NEITHER * float(np.linalg.norm(force))
        links = links_of(self.nominal)
        # the load of a foot is taken along the first link
        lines = (part if part in links else links[0] for part, _ in self.asymmetry)
        axial = [self._axial(posture, line, force) for line in lines]
        return tuple(int(np.sign(N)) if abs(N) >= size else 0 for N in axial)

    def _axial(self, posture: str, part: str, force: Array) -> float:
        """Axial force in a beam by a force ``(3,)`` at the end-effector, N, positive in pull."""
        if not self.nominal.closes:
            return float(force @ self.line(posture, part))
        model = ModifiedMachine(self.nominal, self.engine).model(posture)
        end, closing = self.shift(posture, part)
        x = model.configuration(model.chain.posture(posture))
        return float(moved(model, x, np.zeros(6), end[:, None], closing[:, None]).end[0, :3] @ force)

    def lever(self, posture: str) -> Array:
        """From the base's origin to the end-effector ``(3,)`` in the unloaded posture, mm, world axes."""
        model = ModifiedMachine(self.nominal, self.engine).model(posture)
        end = model.kinematics(model.configuration(model.chain.posture(posture))).end
        return end[:3, 3] - self.nominal.base[:3, 3]


@lru_cache(maxsize=KEPT)
def _line(model: Mechanism, posture: str, part: str) -> Array:
    points = model.shape(model.kinematics(model.configuration(model.chain.posture(posture))))
    own = [i for i, station in enumerate(model.stations) if station.part == part]
    along = points[own[-1]] - points[own[0]]
    result: Array = along / np.linalg.norm(along)
    result.flags.writeable = False
    return result


def standing_free(chain: Machine, engine: VjmEngine) -> Machine:
    """A machine of which parts have other lengths than its closed loops were made for, in its one posture.

    Its displacements count from where it stands with its end-effector free and its drives where they are. Where its
    passive joints take the lengths up, they do; else the machine is prestressed there.

    Raises:
        NoConvergenceError: it does not stand.
    """
    (posture,) = chain.postures
    held = chain.held.get(posture, {})
    try:
        closing = LoopClosure(chain, posture)
        passive, drives = closing.posture(closing.home)
        if all(abs(value - held[name]) < CLOSED for name, value in drives.items()):
            return replace(chain, postures={posture: passive})
    except PoseError:
        pass
    model = engine.model(chain)
    states = equilibria(model, model.posture(posture), compliance=False)
    if not (states.converged[0] and states.stable[0]):
        raise NoConvergenceError(f"posture {posture}: with parts of these lengths the machine does not stand")
    return replace(chain, nominal_ends={posture: frame(states.rotation[0, 0], states.position[0, 0])})


def beam_of(chain: Machine, name: str) -> Beam:
    """A beam by its name."""
    return next(beam for beam in chain.beams if beam.name == name)


def foot_of(chain: Machine) -> str | None:
    """The beam that carries the first link: the one that a model calls foot, where it has others."""
    names = [beam.name for beam in chain.beams]
    return FOOT if FOOT in names and len(names) > 1 and not chain.closes else None


def links_of(chain: Machine) -> list[str]:
    """All beams but the foot, from the base to the end-effector."""
    return [beam.name for beam in chain.beams if beam.name != foot_of(chain)]


def link_of(chain: Machine) -> str:
    """The last link, along which the end-effector is carried."""
    return links_of(chain)[-1]


def place_of(chain: Machine, link: str) -> str:
    """Word for a link where there are several; empty where it is the only one."""
    return link if len(links_of(chain)) > 1 else ""


def springs_of(model: Mechanism, part: str) -> list[slice]:
    """Ranges of the coordinates of a beam's springs, from its root."""
    ranges = [where for _, where in model.blocks if where.start in model.span(part)]
    if not ranges:
        raise ValueError(f"{model.chain.name}: part '{part}' does not deflect")
    return ranges


@lru_cache(maxsize=KEPT)
def bowed(model: Mechanism, posture: str, bow: tuple[tuple[str, float, float], ...]) -> Array:
    """Coordinates ``(n,)`` of a machine whose beams are half sine waves when unloaded, its ends where they were.

    ``v = a sin(πs/L)`` has the curvature ``−a (π/L)² sin(πs/L)``, which the springs have as turns; the passive
    joints turn with the ends' slopes and keep the end-effector in place as well as they can. ``bow`` has mid-span
    amplitudes along the section's y and z, mm, by part.

    Raises:
        ValueError: a beam is one spring, which has no shape.
    """
    x = np.zeros(model.size)
    length = 1.0
    for part, along_y, along_z in bow:
        springs = springs_of(model, part)
        beam = beam_of(model.chain, part)
        if beam.segments is None or beam.segments < 2:
            raise ValueError(f"part '{part}' is one spring: split it before it can be bowed")
        length = beam.length
        ends = np.cumsum([0.0, *model.built.lengths[part]]) / length
        for where, (near, far) in zip(springs, pairwise(ends.tolist()), strict=True):
            # what the slope changes by over the segment
            bend = np.pi / length * (np.cos(np.pi * near) - np.cos(np.pi * far))
            # deflection along y turns about z, deflection along z about −y
            x[where][5] -= along_y * bend
            x[where][4] += along_z * bend
    start = model.configuration(model.chain.posture(posture))
    aim = model.kinematics(start).end
    for _ in range(2):
        k = model.kinematics(start + x)
        gap = np.concatenate([aim[:3, 3] - k.end[:3, 3], 0.5 * _turn(aim[:3, :3], k.end[:3, :3])])
        scale = np.repeat([1.0, 0.01 * length], 3)
        J = k.jacobian[:, model.passive] * scale[:, None]
        x[model.passive] += np.linalg.lstsq(J, gap * scale, rcond=1e-9)[0]
    return x


def _turn(to: Array, current: Array) -> Array:
    return sum((np.cross(current[:, k], to[:, k]) for k in range(3)), np.zeros(3))
