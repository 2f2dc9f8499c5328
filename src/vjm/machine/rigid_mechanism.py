"""The rigid machine: frames and motions of a tree of parts, over many postures at once.

Springs stand at zero here: beams are rigid, and a held joint stands at its coordinate.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vjm.model.assembly import Assembly, Site
from vjm.model.machine import Machine
from vjm.model.pieces import closure_sites
from vjm.rotations import Array, rotation_vectors, translation

if TYPE_CHECKING:
    from vjm.machine.rigid_kernel import RigidArrays


class RigidMechanism:
    """Joints, closures and couplings of a machine whose springs are rigid.

    Coordinates are those of its passive joints and of its held ones but coupled ones, in the order of the parts.

    Attributes:
        names: of the n coordinates.
        coordinates: see `Assembly.coordinates`.
        posture: see `Assembly.posture`.
        passive: ``(n,)`` which of them are passive.
        slides: ``(n,)`` which of them slide.
        unit: ``(n,)`` one radian, or the machine's length in mm for a slide: by it steps are measured.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.length = machine.characteristic_length
        given = [joint for joint in machine.moving if joint.coupling is None]
        self.passive = np.array([part.free for part in given], dtype=bool)
        self.slides = np.array([part.slides for part in given], dtype=bool)
        self.unit = np.where(self.slides, self.length, 1.0)
        self._built = built = Assembly(machine, rigid=True)
        self.names, self.coordinates, self.posture = built.joints, built.coordinates, built.posture
        self._share, self._offset = built.commands
        self._coupled = np.zeros((len(machine.couplings), len(given)))
        for row_, coupling in zip(self._coupled, machine.couplings, strict=True):
            for name, weight in coupling.terms:
                row_[self.names.index(name)] += weight
        self._totals = np.array([coupling.total for coupling in machine.couplings])
        self.row_names = [c.name for c in machine.closures for _ in range(c.rows)]
        self.row_names += [coupling.name for coupling in machine.couplings]

    @cached_property
    def arrays(self) -> RigidArrays:
        """The machine as kernels take it."""
        joints, frames = closure_sites(self._built)
        pairs = zip(joints.ravel().tolist(), frames.reshape(-1, 4, 4), strict=True)
        return self._arrays([Site(*each) for each in pairs], [closure.rows for closure in self.machine.closures])

    def _arrays(self, sites: list[Site], rows: list[int]) -> RigidArrays:
        """The machine, with pairs of frames of each of which so many components are compared."""
        # imported when it is asked for: compiled code takes longer to load than a model file
        from vjm.machine.rigid_kernel import RigidArrays

        built = self._built
        sites = [*sites, Site(built.last, built.rigid)]
        m = len(built.parent)
        return RigidArrays(
            parent=np.array(built.parent, dtype=np.int64),
            rotary=np.array(built.rotary, dtype=np.int64),
            axis=np.array(built.axis).reshape(m, 3),
            before=np.array(built.before).reshape(m, 4, 4),
            share=self._share,
            offset=self._offset,
            joint=np.array([site.joint for site in sites], dtype=np.int64),
            frame=np.array([site.frame for site in sites]),
            rows=np.array(rows, dtype=np.int64),
            coupled=self._coupled,
            total=self._totals.astype(float),
            unit=self.unit.astype(float),
            length=np.array([self.length]),
        )

    def linearised(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """What closures and couplings miss at coordinates ``(g, n)``, and the end-effector.

        Returns:
            Gaps ``(g, r)``, lengths over the machine's, and rad; their derivatives ``(g, r, n)`` by the coordinates
            over their units, exact where closed; frames ``(g, 4, 4)`` of the end-effector, mm; and its motion
            ``(g, 6, n)``, likewise.
        """
        return self._linearised(self.arrays, q, len(self.row_names))

    def _linearised(self, arrays: RigidArrays, q: Array, r: int) -> tuple[Array, Array, Array, Array]:
        from vjm.machine.rigid_kernel import linearised

        g, n = len(q), len(self.names)
        gap, J, J_end = np.empty((g, r)), np.empty((g, r, n)), np.empty((g, 6, n))
        place, end = np.empty((g, 3, 4)), np.tile(np.eye(4), (g, 1, 1))
        linearised(arrays, np.ascontiguousarray(q, dtype=float), gap, J, place, J_end)
        end[:, :3] = place
        return gap, J, end, J_end

    def stretching(self, q: Array) -> Array:
        """Derivatives ``(s, n)`` of the lengths of springs between points at coordinates ``(n,)``, dimensionless.

        The two points of a spring are compared as those of a ball joint are. A row is zero where they meet.
        """
        springs = self.machine.point_springs
        if not springs:
            return np.zeros((0, len(self.names)))
        sites = [
            Site(site.joint, site.frame @ translation(np.asarray(point, dtype=float)))
            for spring in springs
            for part, point in zip(spring.parts, spring.points, strict=True)
            for site in [self._built.begins[part]]
        ]
        count = 3 * len(springs)
        gap, J, _, _ = self._linearised(self._arrays(sites, [3] * len(springs)), q[None], count + len(self._totals))
        apart = gap[0, :count].reshape(-1, 3)
        length = np.linalg.norm(apart, axis=1, keepdims=True)
        along = apart / np.where(length > 0.0, length, 1.0)
        result: Array = np.einsum("sa,san->sn", along, J[0, :count].reshape(len(springs), 3, -1))
        return result

    def end_frames(self, q: Array) -> Array:
        """Frames ``(g, 4, 4)`` of the end-effector at coordinates ``(g, n)``, mm."""
        return self.linearised(q)[2]


def difference(start: Array, stop: Array) -> Array:
    """Displacements ``(g, 6)`` between frames ``(g, 4, 4)``, as `vjm.rotations.displacement_between`, mm and rad.

    Of half a turn, which has no one vector, the turn is NaN.
    """
    turned = rotation_vectors(stop[:, :3, :3] @ start[:, :3, :3].transpose(0, 2, 1))
    return np.concatenate([stop[:, :3, 3] - start[:, :3, 3], turned], axis=1)


def displaced_frames(T: Array, displacement: Array) -> Array:
    """Frames ``(g, 4, 4)`` after displacements ``(g, 6)``, as `vjm.rotations.displaced`, mm and rad."""
    w = displacement[:, 3:]
    angle = np.linalg.norm(w, axis=1)[:, None, None]
    result = T.copy()
    result[:, :3, 3] += displacement[:, :3]
    W = np.cross(w[:, None, :], np.eye(3)).transpose(0, 2, 1)
    # sine and versine over the angle and its square; of sin(x) / x nothing is lost at zero
    sine, half = np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)
    result[:, :3, :3] = (np.eye(3) + sine * W + 0.5 * half**2 * (W @ W)) @ T[:, :3, :3]
    return result
