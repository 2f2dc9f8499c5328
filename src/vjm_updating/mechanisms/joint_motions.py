"""What the held joints of a machine do to its end-effector, unloaded and under loads that deflect the rest.

In a machine with closed loops, where passive joints and springs follow, also what a beam does that becomes longer.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.machine import Machine
from vjm.model.mechanism import Kinematics, Mechanism
from vjm.model.parts import Joint, Part
from vjm.rotations import Array
from vjm.statics import TOLERANCE
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.equilibrium_tables import CORRECTIONS, HalfRay, PathTable, tabulate
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, Moved, links_of, moved, springs_of
from vjm_updating.mechanisms.series_elements import LoadedJoint

BEHIND = " gives way"
"""Behind a joint's name, that of a part which moves as the joint does."""
STIFF = numerical(1e-12)
"""Compliance of a joint that is as good as rigid, rad/(N mm) or mm/N."""
TURN = numerical(2e-3)
"""Deflection of a joint, rad or mm, by which wrenches are differentiated."""
KEPT = numerical(64)
"""Half-rays, and postures, that are kept."""
_ALONG: OrderedDict[tuple[object, ...], tuple[Machine, Array, dict[str, Array], dict[str, LoadedJoint]]] = (
    OrderedDict()
)
"""With the chain that each was made from, which keeps its identity."""
_YIELDING: OrderedDict[tuple[object, ...], tuple[Machine, Mechanism]] = OrderedDict()
"""Models whose held joints yield, likewise."""


def joint_motions(machine: ModifiedMachine, posture: str) -> dict[str, Array]:
    """What a unit of deflection in each held joint does to the end-effector ``(6,)``, by the joints' names.

    In the unloaded posture, world axes: ``(a × (r − p), a)`` per rad about an axis a through p, ``(a, 0)`` per mm
    along it, with what a coupling passes on as it bends. Where loops are closed, of each link too that becomes 1 mm
    longer, by its name.
    """
    motions = _motions(ModifiedMachine(machine.nominal, machine.engine), posture, None, None)
    return {name: motion[0] for name, motion in motions.items()}


def braced(machine: ModifiedMachine, postures: Iterable[str]) -> set[str]:
    """Held joints and links of a machine with closed loops whose deflection strains the rest in some posture.

    Backlash there is taken up by what is prestressed, and the end-effector's wrench alone does not say how far.
    """
    plain = ModifiedMachine(machine.nominal, machine.engine)
    if not plain.nominal.closes:
        return set()
    result: set[str] = set()
    for posture in postures:
        names, (motion,) = _in_loops(plain, posture, None, None)
        result |= {name for name, free in zip(names, motion.free, strict=True) if not free}
    return result


def motions_of_readings(
    machine: ModifiedMachine, labels: Sequence[str], rays: Sequence[tuple[str, Array, Array, np.ndarray, Array]]
) -> tuple[dict[str, Array], dict[str, LoadedJoint]]:
    """The same at every reading ``(n, 6)``, the nominal machine being displaced as it was there.

    The arm of a moment changes by what lies between joint and end-effector under load, and small moments are
    differences of large ones. Behind a bifurcation it is that of the bifurcation.

    Of machines that stand by themselves, what is known to second order besides. ``rays`` are posture, direction and
    measure (6,), indices of the readings, and their places on the ray.
    """
    plain = ModifiedMachine(machine.nominal, machine.engine)
    if not (plain.nominal.closes or any(joint.held for joint in plain.nominal.moving)):
        return {}, {}
    still = {label: joint_motions(plain, label) for label in dict.fromkeys(labels)}
    result = {name: np.array([still[label][name] for label in labels]) for name in still[labels[0]]}
    none = np.zeros((len(labels), 6))
    loaded = {name: LoadedJoint(motion.copy(), none.copy(), none.copy()) for name, motion in result.items()}
    if not _stands(plain.nominal):
        loaded = {}
    for posture, direction, measure, index, place in rays:
        for sign in (1.0, -1.0):
            own = sign * place > 0.0
            if not own.any():
                continue
            half = HalfRay.of(posture, sign * direction, float(np.abs(place[own]).max()))
            s, motions, by_turns = _along(plain, half, sign * measure)
            distances = np.abs(place[own])
            pairs = [(result[name], motion) for name, motion in motions.items()]
            pairs += [pair for name, known in by_turns.items() for pair in zip(loaded[name], known, strict=True)]
            for into, values in pairs:
                for k in range(6):
                    into[index[own], k] = np.interp(distances, s, values[:, k])
    return result, loaded


def _along(
    machine: ModifiedMachine, half: HalfRay, measure: Array
) -> tuple[Array, dict[str, Array], dict[str, LoadedJoint]]:
    """Places ``(m,)`` on half a ray, and there by the joints' names what `motions_of_readings` has."""
    key = (id(machine.nominal), machine.engine, half, tuple(measure.tolist()))
    if key not in _ALONG:
        try:
            table = tabulate(machine, half, ())
            before = table.s <= table.bifurcation
            s, x, wrench = table.s[before], table.x[before], table.wrench[before]
        except NoConvergenceError:
            table, s, x, wrench = None, np.zeros(1), None, None
        motions = _motions(machine, half.posture, x, wrench)
        loaded = dict[str, LoadedJoint]()
        if _stands(machine.nominal):
            # where nothing more is known, first order in the motion there
            loaded = {
                name: LoadedJoint(own, np.zeros_like(own), np.zeros_like(own)) for name, own in motions.items()
            }
            if table is not None and np.isinf(table.bifurcation):
                loaded |= _by_turns(machine, half, table, measure)
        _ALONG[key] = machine.nominal, s, motions, loaded
        if len(_ALONG) > KEPT:
            _ALONG.popitem(last=False)
    return _ALONG[key][1:]


def _stands(chain: Machine) -> bool:
    """Whether a machine without loops and couplings bears a wrench on its end-effector wherever it points."""
    return not chain.closes and not any(joint.free or joint.passes_on for joint in chain.moving)


def _by_turns(machine: ModifiedMachine, half: HalfRay, table: PathTable, measure: Array) -> dict[str, LoadedJoint]:
    """What held joints do to second order along a path, by their names.

    Its equilibria are solved anew with a joint displaced to both sides. Then the displacements are found at which
    the table itself, straight on beside its path, has the same wrenches.
    """
    problem, loaded = table.problem, dict[str, LoadedJoint]()
    along, u = problem.load_case.direction, np.outer(table.s, problem.load_case.direction)

    def same(wrench: Array) -> Array:
        v = u.copy()
        for _ in range(CORRECTIONS):
            s = v @ measure
            W, K = table.at(s)
            off = wrench - W - np.einsum("nij,nj->ni", K, v - np.outer(s, along))
            v += np.linalg.solve(K, off[:, :, None])[:, :, 0]
        return v

    own, model, _ = _yielding_at(machine, half.posture, table.x, STIFF)
    kept = np.setdiff1d(np.arange(model.size), list(own.values()))
    for name, k in own.items():
        sides = []
        for step in (TURN, -TURN):
            natural = model.natural.copy()
            natural[k] += step
            x = np.zeros((len(table.s), model.size))
            x[:, kept], x[:, k] = table.x, step
            x, F, _, _ = model.with_rest_shape(natural).compiled.correct(
                problem.target(0.0), along, table.s, x, table.wrench, TOLERANCE, CORRECTIONS
            )
            if len(F) < len(table.s):
                break
            sides.append((same(F), np.array([model.kinematics(one).jacobian[:, k] for one in x])))
        if len(sides) == 2:
            (ahead, pull), (back, other) = sides
            loaded[name] = LoadedJoint(
                (back - ahead) / (2.0 * TURN), (ahead + back - 2.0 * u) / TURN**2, (pull - other) / (2.0 * TURN)
            )
    return loaded


def _motions(machine: ModifiedMachine, posture: str, x: Array | None, wrench: Array | None) -> dict[str, Array]:
    """Motions ``(m, 6)`` at coordinates ``(m, n)`` of a machine's model in a posture, unloaded by default."""
    chain = machine.nominal
    joints = [joint for joint in chain.moving if joint.held]
    if chain.closes:
        names, states = _in_loops(machine, posture, x, wrench)
        ends = np.array([state.end for state in states])
        result = {name: ends[:, k] for k, name in enumerate(names)}
    else:
        own, _, kinematics = _yielding_at(machine, posture, x)
        J = np.array([k.jacobian for k in kinematics])
        result = {name: J[:, :, k] for name, k in own.items()}
    alone = dict(result)
    for joint in joints:
        for name, ratio in joint.passes_on:
            result[name] = result[name] + ratio * alone[joint.name]
    return result


def _in_loops(
    machine: ModifiedMachine, posture: str, x: Array | None, wrench: Array | None
) -> tuple[list[str], list[Moved]]:
    """Held joints and links by name, and what each does in every state of a machine with closed loops."""
    chain, model = machine.nominal, machine.model(posture)
    own, yielding, kinematics = _yielding_at(machine, posture, x)
    states = model.configuration(model.chain.posture(posture))[None] if x is None else x
    wrenches = np.zeros((len(states), 6)) if wrench is None else wrench
    links = links_of(chain)
    shifts = [machine.shift(posture, link) for link in links]
    motions = []
    for state, load, k in zip(states, wrenches, kinematics, strict=True):
        joints = list(own.values())
        end = np.column_stack([k.jacobian[:, joints], *(one for one, _ in shifts)])
        closing = np.column_stack([yielding.closing(k)[:, joints], *(one for _, one in shifts)])
        motions.append(moved(model, state, load, end, closing))
    return [*own, *links], motions


def _yielding_at(
    machine: ModifiedMachine, posture: str, x: Array | None, compliance: float = 1.0
) -> tuple[dict[str, int], Mechanism, list[Kinematics]]:
    """The coordinate of each held joint in the model where it yields, that model, and its states."""
    chain = machine.nominal
    key = (id(chain), machine.engine, posture, compliance)
    if key not in _YIELDING:
        _YIELDING[key] = chain, machine.engine.model(_yielding(chain.at(posture), compliance))
        if len(_YIELDING) > KEPT:
            _YIELDING.popitem(last=False)
    model = _YIELDING[key][1]
    held = [joint.name for joint in chain.moving if joint.held]
    own = {name: springs_of(model, name + BEHIND)[0].start for name in held}
    kept = np.setdiff1d(np.arange(model.size), list(own.values()))
    coordinates = np.tile(model.configuration(model.chain.posture(posture)), (1 if x is None else len(x), 1))
    if x is not None:
        coordinates[:, kept] = x
    return own, model, [model.kinematics(one) for one in coordinates]


def _yielding(chain: Machine, compliance: float) -> Machine:
    """The chain with a second joint of each held one's axis behind it, which deflects and moves with no other."""
    held, parts = {joint.name for joint in chain.moving if joint.held}, list[Part]()
    for part in chain.parts:
        parts.append(part)
        if isinstance(part, Joint) and part.name in held:
            parts.append(Joint(part.name + BEHIND, part.axis, part.slides, compliance=compliance, value=0.0))
    after = {name: where + BEHIND if where in held else where for name, where in chain.after.items()}
    return replace(chain, parts=tuple(parts), after=after)
