"""Compliance shares: how much of the end-effector's deflection each joint, beam, spring and bearing causes.

The deflection of an end frame along component i is, by virtual work, ``u_i = Σ_p t_p^(i)ᵀ θ_p``. Here ``θ_p`` is
what part p deflects by under the loads, and ``t_p^(i)`` are the forces in it under a unit load along i. Without
closed loops it is the sum over the parts of ``J_p C_p J_pᵀ F``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, assert_never

import numpy as np

from vjm.design.linear_state import LinearState, Question, loaded_posture, loading, state_of
from vjm.engines import VjmEngine
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.mechanism import Gravity
from vjm.model.parts import Beam, Joint, JointKind, Part, RigidOffset
from vjm.model.springs import LawSpring, LinearSpring, Spring
from vjm.outcome import Outcome
from vjm.postures import Posture
from vjm.rank import NEGLIGIBLE
from vjm.rotations import Array
from vjm.threads import single_threaded

if TYPE_CHECKING:
    from vjm.outcome import Axes

JOINT, BEARING, BEAM, SPRING, DRIVE, MOUNT, PASSIVE = (
    "joint", "bearing", "beam", "spring", "drive", "mount", "passive joints",
)  # fmt: skip
"""Kinds of what deflects. A joint's bearings are what deflects across its axis."""
KINDS = {
    JointKind.FREE: PASSIVE, JointKind.SPRUNG: SPRING, JointKind.ACTUATED: JOINT, JointKind.COUPLED: JOINT,
    JointKind.ACTUATOR: DRIVE, JointKind.MOUNT: MOUNT,
}  # fmt: skip
GAUSS = np.polynomial.legendre.leggauss(8)
"""Points and weights by which the energy of a nonlinear spring is integrated: its law is smooth, and the error is
rounding."""


@dataclass(frozen=True)
class Share:
    """What one part adds to the deflection of the end.

    Attributes:
        part: its name.
        kind: ``joint``, ``bearing``, ``beam``, ``spring``, ``drive`` or ``mount``; ``motion`` for what the passive
            joints move by where the end is held.
        deflection: ``(6,)`` of the end by it alone, linear, mm and rad, world axes.
        energy: linear strain energy in it, N mm.
        energy_loaded: the same at the loaded equilibrium, N mm: strain energy, less that without loads and the work
            of the stress without loads.
    """

    part: str
    kind: str
    deflection: Array
    energy: float
    energy_loaded: float


@dataclass(frozen=True, repr=False)
class Shares(Outcome):
    """The shares of all parts in the deflection of an end, in one posture.

    Attributes:
        model: name.
        model_sha256: hash of its file.
        engine: label.
        posture: label.
        end: name of the end frame; empty where the machine names none.
        control: ``displacement`` where the end is held, else ``wrench``.
        wrench: ``(6,)`` on the end, N and N mm: given, or what a held end needs in the linear case.
        gravity: ``(3,)`` m/s², where the parts have their weight.
        deflection: ``(6,)`` of the end, linear: the sum of the shares, mm and rad.
        deflection_loaded: ``(6,)`` of the end at the loaded equilibrium, large deflections included.
        length: characteristic length of the machine, mm: turns times it are compared with shifts.
        nonlinearity: largest change of a component by large deflections and laws of springs, over the largest
            component; nan where the load strains nothing to first order.
        rows: a share for each part and kind, in the order of the parts.

    Example:
        >>> import vjm
        >>> shares = vjm.shares(vjm.load("planar-2r"), wrench=(0, -50, 0, 0, 0, 0))
        >>> max(shares.table(), key=lambda row: row["energy"])["part"]
        'shoulder'
    """

    model: str
    model_sha256: str
    engine: str
    posture: str
    end: str
    control: str
    wrench: Array
    gravity: Gravity | None
    deflection: Array
    deflection_loaded: Array
    length: float
    nonlinearity: float
    rows: tuple[Share, ...]

    def fractions(self, component: int) -> Array:
        """Shares ``(k,)`` in one component of the deflection, over the whole of it; nan where that is zero."""
        whole = self.deflection[component]
        values = np.array([row.deflection[component] for row in self.rows])
        return values / whole if whole else np.full(len(values), np.nan)

    @property
    def energies(self) -> Array:
        """Shares ``(k,)`` in the linear strain energy, over the whole of it.

        Under a wrench on the end alone that is the share in the deflection along the wrench.
        """
        values = np.array([row.energy for row in self.rows])
        return values / values.sum() if values.sum() else np.full(len(values), np.nan)

    @property
    def energies_loaded(self) -> Array:
        """The same ``(k,)`` at the loaded equilibrium."""
        values = np.array([row.energy_loaded for row in self.rows])
        # where the linear deflection is zero, the residual is rounding
        return np.full(len(values), np.nan) if np.isnan(self.nonlinearity) else values / values.sum()

    def table(self) -> list[dict[str, Any]]:
        """One row a part: names, six components in mm and rad, and shares in the strain energy."""
        return [
            {
                "part": row.part,
                "kind": row.kind,
                **dict(zip(("ux", "uy", "uz", "rx", "ry", "rz"), row.deflection.tolist(), strict=True)),
                "energy": linear,
                "energy_loaded": loaded,
            }
            for row, linear, loaded in zip(
                self.rows, self.energies.tolist(), self.energies_loaded.tolist(), strict=True
            )
        ]

    def plot(self, ax: Axes | None = None) -> Axes:
        """A bar for each part, as long as its share in the linear strain energy.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import bars

        return bars(
            [f"{row.part} ({row.kind})" for row in self.rows], self.energies, "share of the strain energy", ax
        )

    def __repr__(self) -> str:
        largest = sorted(zip(self.energies, self.rows, strict=True), key=lambda pair: -pair[0])[:3]
        words = ", ".join(f"{row.part} ({row.kind}) {share:.1%}" for share, row in largest)
        return f"<Shares {self.model}, posture {self.posture}, {self.engine}\n of the strain energy: {words}>"


@single_threaded
def shares(
    machine: Machine,
    posture: Posture = "",
    *,
    wrench: Sequence[float] | None = None,
    displacement: Sequence[float] | None = None,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
    engine: VjmEngine | None = None,
) -> Shares:
    """The part of every joint, beam, spring and bearing in the deflection of an end.

    Args:
        machine: see `vjm.load`.
        posture: label or coordinates, see `vjm.in_posture`; the first one if left out.
        wrench: ``(6,)`` on the free end, dead, N and N mm, world axes.
        displacement: ``(6,)`` at which the end is held instead, mm and rad, for a chain with passive joints.
        gravity: ``(3,)`` m/s², world axes: the parts have their weight.
        loads: on parts, in full.
        end: name of the end frame; the first if left out.
        engine: how beams become springs; as the engine ``vjm`` if left out.

    Returns:
        Linear shares, which add up to the linear deflection, and the strain energies of the loaded equilibrium
        beside them, which tell how far the shares change where deflections are large.

    Raises:
        ValueError: nothing loads the machine, the end is held and loaded at once, or it moves without straining a
            spring, so that nothing carries the load; so it is without load where laws have no slope.
        NoConvergenceError: there is no equilibrium under the loads.

    Example:
        >>> import vjm
        >>> vjm.shares(vjm.load("planar-2r"), wrench=(0, -1, 0, 0, 0, 0))
        <Shares planar-2r, posture stretched, vjm-16
         of the strain energy: shoulder (joint) 70.2%, elbow (joint) 27.8%, upper (beam) 1.5%>
    """
    asked = loaded_posture(
        machine, posture, displacement=displacement, wrench=wrench, gravity=gravity, loads=loads, end=end,
        engine=engine,
    )  # fmt: skip
    return shares_of(state_of(asked.unloaded), asked)


def shares_of(
    rest: LinearState, asked: Question, loaded: LinearState | None = None, *, both: bool = True
) -> Shares:
    """The shares of a machine whose equilibrium without loads is known; see `shares`.

    Args:
        rest: without loads.
        asked: what is done to it.
        loaded: the equilibrium then, where it is known too.
        both: whether the strain energies of the loaded equilibrium are wanted; they are nan else.

    Raises:
        ValueError: as `shares`.
        NoConvergenceError: as `shares`.
    """
    if free := rest.free:
        raise ValueError(
            f"{asked.machine.name}, posture {asked.posture}: without load {free}: there is no linear deflection to "
            "share"
        )
    if asked.displacement is None:
        acting_loads = loading(asked, rest.model, rest.x)
        if not len(acting_loads):
            raise ValueError(
                f"{asked.machine.name}: nothing loads it: give a wrench, a load, a displacement, or weight and mass"
            )
        motion, acting = _under(rest, rest.load_forces(acting_loads)), np.array(asked.wrench)
    else:
        if not any(asked.displacement):
            raise ValueError(f"{asked.machine.name}: a displacement of zero has no shares: give another one")
        motion, acting = _at(rest, np.array(asked.displacement))
    loaded, length = loaded or state_of(asked, rest), rest.model.characteristic_length
    linear, large = rest.jacobian @ motion, loaded.moved - rest.moved
    unit = np.repeat([1.0, length], 3)
    whole = np.abs(linear * unit).max()
    nonlinear = float(np.abs((large - linear) * unit).max() / whole) if whole else float("nan")
    return Shares(
        asked.machine.name, asked.machine.sha256, asked.engine.label, asked.posture, asked.end,
        "wrench" if asked.displacement is None else "displacement", acting, asked.gravity,
        linear, large, length, nonlinear, tuple(_rows(rest, loaded if both else None, motion)),
    )  # fmt: skip


def _under(rest: LinearState, forces: Array) -> Array:
    """Linear motion ``(n,)`` under generalised forces ``(n,)``; none where the closures alone carry them.

    Raises:
        ValueError: it is not determined.
    """
    ends = np.column_stack([forces, rest.jacobian.T])
    if np.linalg.norm(rest.motions.T @ forces) < NEGLIGIBLE * np.linalg.norm(rest.unit * forces):
        # the residual is how exactly the loops are closed
        ends[:, 0] = 0.0
    motions, _, left = rest.respond(rest.solver, ends)
    if np.any(np.linalg.norm(left, axis=0) > NEGLIGIBLE * np.linalg.norm(rest.unit[:, None] * ends, axis=0)):
        raise ValueError(
            f"{rest.model.name}, posture {rest.question.posture}: its end moves without straining a spring: "
            f"not every load is carried there; hold its pose by a displacement"
        )
    return motions[:, 0]


def _at(rest: LinearState, displacement: Array) -> tuple[Array, Array]:
    """Linear motion ``(n,)`` at a displacement ``(6,)`` of the end, and the wrench ``(6,)`` that holds it there.

    Raises:
        ValueError: the end cannot take the displacement.
    """
    gaps = np.concatenate([np.zeros(len(rest.constraints) - 6), displacement])[:, None]
    if np.abs(rest.incompatible(gaps)).max() > NEGLIGIBLE * np.abs(gaps / rest.constraint_unit[:, None]).max():
        raise ValueError(
            f"{rest.model.name}, posture {rest.question.posture}: its end cannot take this displacement: "
            f"the machine is rigid in a direction of it"
        )
    motion, held_by, _ = rest.respond(rest.solver, np.zeros((rest.n, 1)), gaps)
    return motion[:, 0], -held_by[-6:, 0]


def _rows(rest: LinearState, loaded: LinearState | None, motion: Array) -> Iterator[Share]:
    """The shares, from the motion ``(n,)`` of the linear case; energies of the loaded one where it is given."""
    held = rest.question.displacement is not None
    unit_motions, left = _unit_loads(rest)
    stiffness = rest.spring_stiffness
    forces = stiffness @ unit_motions
    for part, kind, where in _coordinates(rest):
        index = list(where)
        bearing = stiffness[np.ix_(index, index)]
        yield Share(
            part, kind, forces[index].T @ motion[index],
            0.5 * float(motion[index] @ bearing @ motion[index]),
            float("nan") if loaded is None else _gained(rest, loaded, index),
        )  # fmt: skip
    springs = rest.model.chain.point_springs
    extension = rest.stretching @ motion
    pulls = rest.point_stiffness[:, None] * (rest.stretching @ unit_motions)
    for k, spring in enumerate(springs):
        linear, gained = 0.5 * float(rest.point_stiffness[k] * extension[k] ** 2), float("nan")
        if loaded is not None:
            first, last = rest.lengths[k], loaded.lengths[k]
            # beyond the work of the first stress
            gained = float(spring.energy(last) - spring.energy(first) - spring.pull(first) * (last - first))
        yield Share(spring.name, SPRING, pulls[k] * extension[k], linear, gained)
    if held and rest.model.passive.size:
        yield Share(PASSIVE, "motion", left.T @ motion, 0.0, 0.0)


def _unit_loads(rest: LinearState) -> tuple[Array, Array]:
    """Motions ``(n, 6)`` whose spring forces carry unit loads on the end, and the forces ``(n, 6)`` left over.

    The rest acts along the closures alone, or, where passive joints let the end move, on these joints.
    """
    free = rest.freed
    motions, _, _ = free.respond(free.system(free.elastic_stiffness, free.strainless), rest.jacobian.T)
    return motions, rest.jacobian.T - rest.elastic_stiffness @ motions


def _coordinates(state: LinearState) -> Iterator[tuple[str, str, range]]:
    """Name, kind and coordinates of whatever deflects."""
    for part in state.model.chain.parts:
        span = state.model.built.spans[part.name]
        across = len(part.bearings) if isinstance(part, Joint) else 0
        kind = _kind(part)
        if across:
            yield part.name, BEARING, span[:across]
        if kind != PASSIVE and len(span) > across:
            yield part.name, kind, span[across:]


def _kind(part: Part) -> str:
    match part:
        case Joint():
            return KINDS[part.kind]
        case Beam():
            return BEAM
        case RigidOffset():
            return PASSIVE
        case _:
            assert_never(part)


def _gained(rest: LinearState, loaded: LinearState, index: list[int]) -> float:
    """Strain energy that loads bring to the springs of some coordinates, beyond the work of their first stress."""
    inside, total = set(index), 0.0
    for spring, where in rest.model.blocks:
        if where.start in inside:
            first, last = rest.reactions[where], loaded.reactions[where]
            total += strain_energy(spring, last) - strain_energy(spring, first)
            total -= float(first @ (spring.strain(last) - spring.strain(first)))
    return total


def strain_energy(spring: Spring, reaction: Array) -> float:
    """Strain energy of a spring under reactions ``(k,)``, N mm: ``τᵀ θ(τ) − Ψ(τ)`` with ``Ψ = ∫ θ(s τ)ᵀ τ ds``.

    Example:
        >>> strain_energy(LinearSpring(np.array([[0.5]])), np.array([2.0]))
        1.0
    """
    if isinstance(spring, LinearSpring):
        return 0.5 * float(reaction @ spring.strain(reaction))
    if isinstance(spring, LawSpring):
        return float(spring.law.energy(spring.strain(reaction)[0]))
    points, weights = GAUSS
    complementary = sum(
        0.5 * weight * float(spring.strain(0.5 * (1.0 + point) * reaction) @ reaction)
        for point, weight in zip(points, weights, strict=True)
    )
    return float(reaction @ spring.strain(reaction)) - float(complementary)
