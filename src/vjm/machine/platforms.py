"""Platforms on legs.

Here are errors of assembly, what the legs bear and do in an equilibrium, and equilibria, stiffness and critical
forces in many poses at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.engines import VjmEngine
from vjm.machine.critical_force import CriticalForce, Weakest, no_force
from vjm.machine.equilibria import Equilibria, equilibria
from vjm.machine.rigid_mechanism import Closing, RigidMechanism, difference, displaced_frames, home_label
from vjm.model.machine import Machine, legs_of
from vjm.model.mechanism import Kinematics, Mechanism
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm.statics import Configuration, critical_modes


def assembled(machine: Machine, too_long: Mapping[str, float] = {}, off: Mapping[str, float] = {}) -> Machine:
    """A machine as built; its loops have gaps in its postures, which its springs close.

    Args:
        machine: as designed.
        too_long: by how many mm beams are longer, by their names.
        off: what the coordinates of held joints are off, mm or rad, by their names.

    Returns:
        The machine, its displacements counted from where the end-effector is as designed.

    Raises:
        ValueError: no such beam or held joint.

    Example:
        >>> import vjm
        >>> built = assembled(vjm.load("orthoglide"), {"x/link": 0.2})
        >>> vjm.stiffness(built, "isotropic").wrench[0] < -100.0
        True
    """
    beams, held = [beam.name for beam in machine.beams], [joint.name for joint in machine.held_joints]
    for name in too_long:
        if name not in beams:
            raise ValueError(f"{machine.name}: no beam '{name}' to be too long (it has {', '.join(beams)})")
    for name in off:
        if name not in held:
            raise ValueError(f"{machine.name}: no held joint '{name}' that could be off (it has {', '.join(held)})")
    if not too_long and not off:
        return machine
    tree = RigidMechanism(machine)
    return replace(
        machine,
        parts=tuple(
            replace(part, length=part.length + too_long.get(part.name, 0.0)) if isinstance(part, Beam) else part
            for part in machine.parts
        ),
        held={
            label: {name: value + off.get(name, 0.0) for name, value in values.items()}
            for label, values in machine.held.items()
        },
        nominal_ends={label: tree.end_frames(tree.posture(label)[None])[0] for label in machine.postures},
    )


def leg_wrenches(problem: LumpedProblem, point: Equilibrium) -> Array:
    """Wrenches ``(l, 6)`` that the bodies behind the legs' last joints put on them, about the legs' ends.

    Args:
        problem: of a machine of legs, see `vjm.model.machine.legs_of`.
        point: an equilibrium of the problem.

    Returns:
        N, N mm, world axes: all that acts on what a leg's last joint or spring carries, loads and closures alike.
    """
    model, state = problem.model, problem.configuration(point)
    kinematics = model.kinematics(state.x)
    joints, places, wrenches = _on_bodies(model, kinematics, state)
    legs = legs_of(model.chain)
    result = np.zeros((len(legs), 6))
    for row, leg in zip(result, legs, strict=True):
        end = model.end_of(leg.parts[-1])
        own = (joints >= 0) & model.carried_by(end.joint)[joints]
        levers = places[own] - (kinematics.behind[end.joint + 1] @ end.frame)[:3, 3]
        row[:3] = wrenches[own, :3].sum(axis=0)
        row[3:] = (wrenches[own, 3:] + np.cross(levers, wrenches[own, :3])).sum(axis=0)
    return result


def _on_bodies(model: Mechanism, kinematics: Kinematics, state: Configuration) -> tuple[np.ndarray, Array, Array]:
    """Last joints ``(k,)`` before what loads, closures and the support act on, where ``(k, 3)``, and wrenches."""
    joints, places, wrenches = [model.last], [kinematics.end[:3, 3]], [state.wrench]
    if len(model.applied_loads):
        joints += model.applied_loads.joint.tolist()
        places += list(model.compiled.points(state.x, state.wrench, state.load))
        wrenches += list(model.compiled.acting(state.x, state.wrench, state.load))
    first = model.coordinates
    for closure, own, frames in zip(model.chain.closures, model.closure_joints, model.closure_frames, strict=True):
        wrench = np.zeros(6)
        wrench[: closure.rows] = state.x[first : first + closure.rows]
        first += closure.rows
        joints += own.tolist()
        place = (kinematics.behind[own[1] + 1] @ frames[1])[:3, 3]
        places += [place, place]
        wrenches += [-wrench, wrench]
    return np.array(joints, dtype=np.int64), np.array(places), np.array(wrenches)


def yielding_legs(problem: LumpedProblem, critical: Equilibrium) -> dict[str, float]:
    """Which legs deflect at a critical point: each one's share of the mode, their squares adding up to one.

    What counts is how far a leg's springs deflect; a leg that only turns in its joints follows the others.

    Args:
        problem: of a machine of legs, see `vjm.model.machine.legs_of`.
        critical: a critical point of the problem.
    """
    model = problem.model
    mode = critical_modes(problem.configuration(critical))[0] / model.coordinate_scale
    sprung = np.zeros(model.size, dtype=bool)
    sprung[model.elastic] = True
    sizes, legs = [], legs_of(model.chain)
    for leg in legs:
        own = [c for part in leg.parts for c in model.span(part) if sprung[c]]
        sizes.append(float(np.linalg.norm(mode[own])))
    shares = np.array(sizes) / np.linalg.norm(sizes)
    return dict(zip((leg.name for leg in legs), shares.tolist(), strict=True))


@dataclass(frozen=True)
class Platforms:
    """Free platforms in n poses under dead wrenches; rows of what was not solved are nan but for `drives`.

    Attributes:
        drives: coordinates ``(n, d)`` of the held joints in the rigid poses, mm, rad, in the machine's order.
        displacement: ``(n, 6)`` of the platforms from their poses, mm, rad.
        compliance: ``(n, 6, 6)`` there, mm/N, 1/N, rad/(N mm), world axes.
        stiffness: K^F ``(n, 6, 6)``; nan where the compliance has no inverse, as a leg is rigid.
        forces: ``(n, l, 3)`` on the ends of the machine's legs, N, world axes, by what is behind them.
        solved: ``(n,)`` whether a stable equilibrium was found.
        why: ``(n,)`` the reason where not.
    """

    drives: Array
    displacement: Array
    compliance: Array
    stiffness: Array
    forces: Array
    solved: np.ndarray
    why: np.ndarray


class PlatformBatch:
    """A machine with closed loops, ready for many poses of its end-effector.

    Attributes:
        machine: as designed.
        closing: it, rigid.
        model: the elastic machine as built.
    """

    def __init__(
        self,
        machine: Machine,
        engine: VjmEngine,
        too_long: Mapping[str, float] = {},
        off: Mapping[str, float] = {},
    ) -> None:
        """Close the machine at home.

        Args:
            machine: as designed.
            engine: how beams become springs.
            too_long: by how many mm beams were built longer, by their names.
            off: what the coordinates of held joints are off, mm or rad, by their names.

        Raises:
            PoseError: its loops do not close at home.
            ValueError: there is no such beam or held joint, or a beam lacks what its springs are made from.
        """
        self.machine = machine
        self.closing = Closing(machine, home_label(machine))
        self.model = engine.model(assembled(machine, too_long, off))
        self._held = np.flatnonzero(~self.closing.tree.passive)
        self._off = np.array([off.get(name, 0.0) for name in self.model.joints])
        self._shares = self._carried()

    def _carried(self) -> tuple[Array, Array]:
        """Of forces of closures ``(l, f)`` and on the end-effector ``(l,)``: which act behind each leg's end."""
        chain, behind = self.model.chain, {"": {""}}
        for name, before in chain.predecessors.items():
            behind[name] = behind[before] | {name}
        ends = [leg.parts[-1] for leg in legs_of(chain)]
        by_closure = np.array(
            [
                [float(e in behind[c.parts[1]]) - float(e in behind[c.parts[0]]) for c in chain.closures]
                for e in ends
            ]
        ).reshape(len(ends), len(chain.closures))
        return by_closure, np.array([float(end in behind[chain.parts[-1].name]) for end in ends])

    def closed(self, poses: Array) -> tuple[Array, np.ndarray]:
        """Coordinates of the rigid machine in poses ``(n, 6)`` from home, and which are in reach ``(n,)``."""
        q, why = self.closing.all_displaced(np.ascontiguousarray(poses, dtype=float))
        return q, np.array([not each for each in why], dtype=bool)

    def equilibria(self, poses: Array, wrenches: Array) -> Platforms:
        """Free platforms in poses, each under its dead wrench.

        Args:
            poses: displacements ``(n, 6)`` from home, mm, rad.
            wrenches: ``(n, 6)`` or one ``(6,)`` for all, N, N mm, world axes.
        """
        q, reached = self.closed(poses)
        n, legs, drives = len(q), len(self._shares[1]), q[:, self._held]
        displacement, C, K, forces = (np.full((n, *shape), np.nan) for shape in ((6,), (6, 6), (6, 6), (legs, 3)))
        why = np.where(reached, "", "out of reach").astype(object)
        rows = np.flatnonzero(reached)
        drives[~reached] = np.nan
        if len(rows):
            acting = np.broadcast_to(np.asarray(wrenches, dtype=float), (n, 6))[rows]
            states = self._under(q[rows], acting)
            why[rows[~states.found]] = "no equilibrium found near the unloaded pose"
            why[rows[states.found & ~states.stable]] = "unstable"
            good = states.found & states.stable
            stable_rows = rows[good]
            assert states.compliance is not None
            assert states.stiffness is not None
            C[stable_rows], K[stable_rows] = states.compliance[good, 0], states.stiffness[good, 0]
            displacement[stable_rows] = self._from(states, np.asarray(poses)[rows])[good]
            forces[stable_rows] = self._forces(states, acting[:, :3])[good]
        return Platforms(drives, displacement, C, K, forces, np.asarray(why == ""), why)

    def _under(self, q: Array, wrenches: Array, *, compliance: bool = True) -> Equilibria:
        """Equilibria at coordinates ``(n, k)`` of the rigid machine, of the machine as built."""
        acting = np.ascontiguousarray(wrenches)[:, None, :]
        return equilibria(self.model, q + self._off, wrench=acting, compliance=compliance)

    def displacements(self, q: Array, poses: Array, wrenches: Array) -> Array:
        """Displacements ``(n, 6)`` from poses of the platform, nan where it is in no stable equilibrium.

        Args:
            q: coordinates ``(n, k)`` of the rigid machine, its drives moved from where the poses have them.
            poses: ``(n, 6)`` from home.
            wrenches: ``(n, 6)`` dead on the platforms.
        """
        states = self._under(q, wrenches, compliance=False)
        return np.where((states.found & states.stable)[:, None], self._from(states, poses), np.nan)

    def _from(self, states: Equilibria, poses: Array) -> Array:
        """Displacements ``(n, 6)`` of platforms from their poses."""
        stands = np.tile(np.eye(4), (len(poses), 1, 1))
        stands[:, :3, :3], stands[:, :3, 3] = states.rotation[:, 0], states.position[:, 0]
        return difference(displaced_frames(np.tile(self.closing.end, (len(poses), 1, 1)), poses), stands)

    def _forces(self, states: Equilibria, platform: Array) -> Array:
        """Forces ``(n, l, 3)`` on the legs' ends, with ``(n, 3)`` on the platforms."""
        by_closure, by_platform = self._shares
        firsts = np.cumsum([0, *(closure.rows for closure in self.model.chain.closures)])[:-1]
        held = states.closures[:, firsts[:, None] + np.arange(3)]
        result: Array = np.einsum("lc,nca->nla", by_closure, held) + by_platform[:, None] * platform[:, None, :]
        return result

    def weakest(self, poses: Array, most: float) -> list[Weakest]:
        """The smallest critical forces of free platforms over the directions of a dead force.

        Args:
            poses: displacements ``(n, 6)`` from home, mm, rad.
            most: largest force tried, N.
        """
        search = CriticalForce(self.model, 0, most)
        q, reached = self.closed(poses)
        smallest = [no_force("out of reach")] * len(q)
        rows = np.flatnonzero(reached)
        for k, weak in zip(rows, search.each(q[rows] + self._off), strict=True):
            smallest[k] = weak
        return smallest
