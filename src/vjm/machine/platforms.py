"""Platforms on legs in many poses at once: equilibria, loaded stiffness and critical forces.

batch = PlatformBatch(manipulator, VjmEngine(4))
found = batch.equilibria(poses, wrench)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.machine.closing import Closing, home_label
from vjm.machine.legs import machine_of
from vjm.machine.rigid_tree import difference, displaced_frames
from vjm.platform.manipulator import PLATFORM, Manipulator
from vjm.rotations import Array
from vjm.tree.equilibria import Equilibria, equilibria
from vjm.vjm_engine import VjmEngine

SMALL = 1e-3
"""N: forces under which a machine answers linearly."""
FIRST_SHARE, GROWTH = 1.0 / 64.0, 1.5
"""Of the largest force that is tried: the first one; and by how much the next is larger."""
JUMPED = 2.0
"""Of the displacement that the stiffness foresees: who goes further has left the branch at a critical point."""
SAME = 0.04
"""rad between directions of a force that are tried. The critical force is flat there: 0.04 rad cost it 0.1 %."""
FIRST_TURN = 0.06
"""rad by which the weakest direction is turned at first to look for a weaker one."""


@dataclass(frozen=True)
class Platforms:
    """Free platforms in n poses under dead wrenches; rows of what was not solved are nan but for `drives`.

    Attributes:
        drives: coordinates ``(n, l)`` of the legs' drives in the rigid poses, mm, rad; zero where a leg has none.
        displacement: ``(n, 6)`` of the platforms from their poses, mm, rad.
        compliance: ``(n, 6, 6)`` there, mm/N, 1/N, rad/(N mm), world axes.
        stiffness: K^F ``(n, 6, 6)``; nan where the compliance has no inverse, as a leg is rigid.
        forces: ``(n, l, 3)`` on the legs' ends, N, world axes, by what is behind them.
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


@dataclass(frozen=True)
class Weakest:
    """The smallest critical forces of n poses over all directions of a force.

    Attributes:
        force: ``(n,)`` N; infinite where none was found below the largest force that was tried, nan where the
            platform is not in stable equilibrium without a force.
        direction: ``(n, 3)`` unit vectors, world axes.
    """

    force: Array
    direction: Array


class PlatformBatch:
    """A manipulator as the one machine that it is, ready for many poses.

    Attributes:
        manipulator: legs on a platform.
        closing: the rigid machine as designed.
        model: the elastic machine as built.
    """

    def __init__(self, manipulator: Manipulator, engine: VjmEngine) -> None:
        """Close the machine at home.

        Args:
            manipulator: with its errors of assembly and its drives' offsets, if it has any.
            engine: how beams become springs.

        Raises:
            PoseError: the legs do not close at home.
            ValueError: a beam lacks what its springs are made from.
        """
        self.manipulator = manipulator
        alone = replace(manipulator, poses={})
        built = machine_of(alone)
        designed = machine_of(replace(alone, errors={}, offsets={})) if built.nominal_ends else built
        self.closing = Closing(designed, home_label(designed), manipulator.home)
        self.model = engine.tree_model(built)
        joints = self.model.joints
        self._drive = [joints.index(leg.name) if leg.drive is not None else -1 for leg in manipulator.legs]
        self._off = np.array([manipulator.offsets.get(name, 0.0) for name in joints])
        self._shares = self._carried()

    def _carried(self) -> tuple[Array, Array]:
        """Of forces of closures ``(l, f)`` and on the platform ``(l,)``: which act behind each leg's end."""
        chain, behind, last = self.model.chain, {"": {""}}, ""
        for part in chain.parts:
            behind[part.name] = behind[chain.after.get(part.name, last)] | {part.name}
            last = part.name
        legs = self.manipulator.legs
        ends = [f"{leg.name}/{leg.chain.parts[-1].name}" for leg in legs]
        by_closure = np.array(
            [
                [float(e in behind[c.parts[1]]) - float(e in behind[c.parts[0]]) for c in chain.closures]
                for e in ends
            ]
        ).reshape(len(ends), len(chain.closures))
        return by_closure, np.array([float(end in behind[PLATFORM]) for end in ends])

    def closed(self, poses: Array) -> tuple[Array, np.ndarray]:
        """Coordinates of the rigid machine in poses ``(n, 6)`` from home, and which are in reach ``(n,)``."""
        return self.closing.all_displaced(np.ascontiguousarray(poses, dtype=float))

    def equilibria(self, poses: Array, wrenches: Array) -> Platforms:
        """Free platforms in poses, each under its dead wrench.

        Args:
            poses: displacements ``(n, 6)`` from home, mm, rad.
            wrenches: ``(n, 6)`` or one ``(6,)`` for all, N, N mm, world axes.
        """
        q, reached = self.closed(poses)
        n, legs = len(q), len(self._drive)
        drives = np.where(np.array(self._drive) >= 0, q[:, self._drive], 0.0)
        displacement, C, K, forces = (np.full((n, *shape), np.nan) for shape in ((6,), (6, 6), (6, 6), (legs, 3)))
        why = np.where(reached, "", "out of reach").astype(object)
        rows = np.flatnonzero(reached)
        drives[~reached] = np.nan
        if len(rows):
            acting = np.broadcast_to(np.asarray(wrenches, dtype=float), (n, 6))[rows]
            found = self._under(q[rows], acting)
            why[rows[~found.found]] = "no equilibrium found near the unloaded pose"
            why[rows[found.found & ~found.stable]] = "unstable"
            good = found.found & found.stable
            at = rows[good]
            assert found.compliance is not None
            assert found.stiffness is not None
            C[at], K[at] = found.compliance[good, 0], found.stiffness[good, 0]
            displacement[at] = self._from(found, np.asarray(poses)[rows])[good]
            forces[at] = self._forces(found, acting[:, :3])[good]
        return Platforms(drives, displacement, C, K, forces, np.asarray(why == ""), why)

    def _under(
        self, q: Array, wrenches: Array, start: Array | None = None, start_closures: Array | None = None,
        *, compliance: bool = True, gradual: bool = True,
    ) -> Equilibria:  # fmt: skip
        """Equilibria at coordinates ``(n, k)`` of the rigid machine, of the machine as built."""
        acting = np.ascontiguousarray(wrenches)[:, None, :]
        return equilibria(
            self.model, q + self._off, wrench=acting, start=start, start_closures=start_closures,
            compliance=compliance, gradual=gradual,
        )  # fmt: skip

    def displacements(self, q: Array, poses: Array, wrenches: Array) -> Array:
        """Displacements ``(n, 6)`` from poses of the platform, nan where it is in no stable equilibrium.

        Args:
            q: coordinates ``(n, k)`` of the rigid machine, its drives moved from where the poses have them.
            poses: ``(n, 6)`` from home.
            wrenches: ``(n, 6)`` dead on the platforms.
        """
        found = self._under(q, wrenches, compliance=False)
        return np.where((found.found & found.stable)[:, None], self._from(found, poses), np.nan)

    def _from(self, found: Equilibria, poses: Array) -> Array:
        """Displacements ``(n, 6)`` of platforms from their poses."""
        stands = np.tile(np.eye(4), (len(poses), 1, 1))
        stands[:, :3, :3], stands[:, :3, 3] = found.rotation[:, 0], found.position[:, 0]
        return difference(displaced_frames(np.tile(self.closing.end, (len(poses), 1, 1)), poses), stands)

    def _forces(self, found: Equilibria, platform: Array) -> Array:
        """Forces ``(n, l, 3)`` on the legs' ends, with ``(n, 3)`` on the platforms."""
        by_closure, by_platform = self._shares
        firsts = np.cumsum([0, *(closure.rows for closure in self.model.chain.closures)])[:-1]
        held = found.closures[:, firsts[:, None] + np.arange(3)]
        result: Array = np.einsum("lc,nca->nla", by_closure, held) + by_platform[:, None] * platform[:, None, :]
        return result

    # --- critical forces ----------------------------------------------------------------------------------

    def critical(
        self, pose: Array, directions: Array, most: float, tolerance: float = 1e-4
    ) -> tuple[Array, np.ndarray]:
        """Critical forces of a free platform along directions.

        Args:
            pose: displacement ``(6,)`` from home.
            directions: unit vectors ``(k, 3)``.
            most: largest force tried, N.
            tolerance: relative, of the force.

        Returns:
            Forces ``(k,)`` in N and whether there is one ``(k,)``.

        Raises:
            ValueError: the pose is out of reach.
        """
        q, reached = self.closed(np.asarray(pose, dtype=float)[None])
        if not reached[0]:
            raise ValueError("the pose is out of reach")
        k = len(directions)
        return self._critical(np.repeat(q, k, axis=0), np.asarray(directions), np.arange(k), most, tolerance)

    def _critical(
        self, q: Array, directions: Array, group: np.ndarray, most: float, tolerance: float
    ) -> tuple[Array, np.ndarray]:
        """Forces ``(k,)`` at which stability is lost along directions ``(k, 3)``, and whether it is ``(k,)``.

        A force is raised until an equilibrium is unstable, not found, or a jump away; then the interval is halved.
        Of each group only the smallest is looked for: no others are found that are larger.
        """
        k = len(q)
        unit = np.hstack([directions, np.zeros((k, 3))])
        rest = self._under(q, np.zeros((k, 6)))
        assert rest.compliance is not None
        x, closures, moved, C = (
            rest.x.copy(),
            rest.closures.copy(),
            rest.deflection[:, 0].copy(),
            rest.compliance[:, 0],
        )
        scale = np.repeat([1.0, self.closing.tree.length], 3)
        good, bad, first = np.zeros(k), np.full(k, np.inf), FIRST_SHARE * most
        going = np.flatnonzero(rest.found & rest.stable)
        force = np.full(k, first)
        while len(going):
            found = self._under(
                q[going], force[going, None] * unit[going], x[going], closures[going], gradual=False
            )
            added = (force - good)[going]
            foreseen = np.linalg.norm(scale * (C[going] @ unit[going, :, None])[:, :, 0], axis=1) * added
            gone = np.linalg.norm(scale * (found.deflection[:, 0] - moved[going]), axis=1)
            kept = found.found & found.stable & ~(gone > JUMPED * foreseen)
            rows = going[kept]
            good[rows] = force[rows]
            assert found.compliance is not None
            x[rows], closures[rows] = found.x[kept], found.closures[kept]
            moved[rows], C[rows] = found.deflection[kept, 0], found.compliance[kept, 0]
            bad[going[~kept]] = force[going[~kept]]
            force = np.where(
                np.isfinite(bad), 0.5 * (good + bad), np.minimum(GROWTH * np.maximum(good, first), most)
            )
            least = np.full(int(group.max()) + 1, np.inf)
            np.minimum.at(least, group, bad)
            wanted = (good < most) & (bad - good > tolerance * np.maximum(good, first)) & (good < least[group])
            going = going[wanted[going]]
        return good, np.isfinite(bad) & (good > 0.0)

    def weakest(self, poses: Array, most: float, tolerance: float = 1e-3) -> Weakest:
        """The smallest critical forces of free platforms over the directions of a dead force.

        In the linear model a leg's end force is a linear function of the platform's, so the force that strains one
        leg most for its size is known: along the leg's own force and against it. Those are tried, and the weakest
        of them is improved by turning it.

        Args:
            poses: displacements ``(n, 6)`` from home, mm, rad.
            most: largest force tried, N.
            tolerance: relative, of the force.
        """
        poses = np.asarray(poses, dtype=float)
        n = len(poses)
        force, direction = np.full(n, np.nan), np.full((n, 3), np.nan)
        q, reached = self.closed(poses)
        rows = np.flatnonzero(reached)
        if not len(rows):
            return Weakest(force, direction)
        pushes = SMALL * np.vstack([np.eye(6)[:3], np.zeros(6)])
        four = self._under(np.repeat(q[rows], 4, axis=0), np.tile(pushes, (len(rows), 1)))
        steady = (four.found & four.stable).reshape(-1, 4).all(axis=1)
        forces = self._forces(four, np.tile(pushes[:, :3], (len(rows), 1))).reshape(len(rows), 4, -1, 3)
        rows, slopes = rows[steady], ((forces[:, :3] - forces[:, 3:]) / SMALL)[steady]
        # the direction of a force that strains a leg most
        lines = [distinct(np.linalg.svd(each.transpose(1, 2, 0))[2][:, 0]) for each in slopes]
        trial = np.vstack([np.vstack([line, -line]) for line in lines]) if lines else np.zeros((0, 3))
        group = np.repeat(np.arange(len(rows)), [2 * len(line) for line in lines])
        force[rows] = np.inf
        self._improve(q, rows, trial, group, (force, direction), most, tolerance)
        turn = np.full(n, FIRST_TURN)
        while len(rows := np.flatnonzero(np.isfinite(force) & (turn > SAME))):
            sides = np.linalg.svd(direction[rows, None])[2][:, 1:]
            around = direction[rows, None] + turn[rows, None, None] * np.concatenate([sides, -sides], axis=1)
            around /= np.linalg.norm(around, axis=2)[:, :, None]
            group = np.repeat(np.arange(len(rows)), 4)
            better = self._improve(q, rows, around.reshape(-1, 3), group, (force, direction), most, tolerance)
            turn[rows[~better]] *= 0.5
        return Weakest(force, direction)

    def _improve(
        self, q: Array, rows: np.ndarray, trial: Array, group: np.ndarray, best: tuple[Array, Array], most: float,
        tolerance: float,
    ) -> np.ndarray:  # fmt: skip
        """Try directions ``(k, 3)`` of poses, each one of the rows; which became clearly weaker."""
        force, direction = best
        tried, found = self._critical(q[rows[group]], trial, group, most, tolerance)
        tried[~found] = np.inf
        better = np.zeros(len(rows), dtype=bool)
        for k, row in enumerate(rows):
            own = np.flatnonzero(group == k)
            least = own[np.argmin(tried[own])]
            if tried[least] < force[row] * (1.0 - 2.0 * tolerance):
                force[row], direction[row], better[k] = tried[least], trial[least], True
        return better


def distinct(lines: Array) -> Array:
    """Directions ``(k, 3)`` of which no two lie along almost the same line: legs in a row feel a force alike."""
    kept: list[Array] = []
    for line in lines:
        if all(np.linalg.norm(np.cross(line, other)) > SAME for other in kept):
            kept.append(line)
    return np.array(kept).reshape(-1, 3)
