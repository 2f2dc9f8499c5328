"""Where the markers are by the model, and exact derivatives of that by every member and nuisance.

The prediction of a marker is ``y = R (p_m + R_m m) + t``: p_m, R_m the frame on its body at the loaded
equilibrium, m what the marker's place in it is off, R and t the tracker's frame. R, t, m, and the marker's own
turn where it is tracked, are nuisances: never reported as causes, refitted under every hypothesis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.kernels.arrays import MachineArrays
from vjm.kernels.derivatives import FrameDerivatives, frame_derivatives
from vjm.kernels.newton import LOST
from vjm.machine.equilibria import free_equilibria
from vjm.rotations import Array, rotation_from_vector, rotation_vectors
from vjm_updating.constants import numerical
from vjm_updating.poses.families import COMPLIANCE, DRIFT, FACTOR, MASS, STRETCH, VALUE, FamilyParameter
from vjm_updating.poses.machine import RIGID, PoseMachine
from vjm_updating.poses.measurement import PoseData

LARGEST_TURN = numerical(0.5, "rad")
"""rad: what one update may turn a nuisance frame by."""
BASE_TURN, BASE_PLACE = "turn of the base frame", "place of the base frame"
MARKER_PLACE, MARKER_FRAME = "place of marker", "frame of marker"
"""Names of nuisances; those of a marker are followed by its name."""


@dataclass(frozen=True)
class Frames:
    """The nuisances.

    Attributes:
        R: ``(3, 3)`` and
        t: ``(3,)`` mm, the base in the tracker's frame.
        m: ``(k, 3)`` mm, where the markers are off their guesses.
        M: ``(k, 3, 3)`` the tracked frames in those of their bodies.
    """

    R: Array
    t: Array
    m: Array
    M: Array


@dataclass(frozen=True)
class Linearised:
    """A model at a state, against the readings.

    Attributes:
        residual: ``(g, k, 6)`` readings less prediction, mm and rad, nan where there is no reading.
        nuisance: ``(g, k, 6, n_f)`` derivatives of the prediction by the nuisances.
        member: ``(g, k, 6, P)`` by the members, per unit of each.
        torque: ``(g, n_joints)`` what bears on each of the data's joints, N mm or N.
        off: ``(n_f,)`` what the nuisances are off the guesses of their priors; zero where these are wide.
        tilt: ``(g, k, 6, 3)`` by a turn of the body that all markers share, about the base's axes.
    """

    residual: Array
    nuisance: Array
    member: Array
    torque: Array
    off: Array
    tilt: Array


class ReadingsForward(ABC):
    """The model of a test of any kind: what its readings are by a hypothesis.

    Attributes:
        members: numbers that a hypothesis may change.
    """

    members: list[FamilyParameter]

    @property
    def nuisances(self) -> int:
        """How many unknowns of the instruments there are."""
        return len(self.nuisance_names())

    @abstractmethod
    def nuisance_names(self) -> list[str]:
        """What each is, for people."""

    @abstractmethod
    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """Residuals and derivatives at members ``z`` (P,), in units, and nuisances.

        Raises:
            NoConvergenceError: a posture has no equilibrium.
        """

    @abstractmethod
    def moved(self, frames: Frames, step: Array) -> Frames:
        """Nuisances after a step ``(n_f,)`` in the coordinates of `Linearised.nuisance`."""


class SeriesForward(ReadingsForward):
    """The same of one series.

    Attributes:
        centre: ``(3,)`` mm, in the base's axes, about which turns of the tracker's frame are counted.
    """

    centre: Array

    @abstractmethod
    def bearing(self) -> Array:
        """What makes each coordinate deflect as it is read ``(g, n_tree)``, N mm or N."""

    @abstractmethod
    def torques(self) -> Array:
        """Size ``(n_tree,)`` over the readings of what makes each coordinate deflect as it is read."""

    @abstractmethod
    def with_machine(self, machine: PoseMachine) -> SeriesForward:
        """The same test of another machine with the same members."""


class PoseForward(SeriesForward):
    """The model of a test of poses: a machine, its postures and the members that may be added to it."""

    def __init__(
        self, machine: PoseMachine, data: PoseData, gravity: Sequence[float], centre: Array | None = None
    ) -> None:
        self.machine, self.data = machine, data
        self.gravity = (float(gravity[0]), float(gravity[1]), float(gravity[2]))
        self.members: list[FamilyParameter] = []
        tree = machine.tree
        q = machine.rows(data.q)
        self._values, self._natural = tree.values(q), tree.naturals(q)
        self._arrays = tree.arrays(self.gravity, moments=bool(np.any(data.wrench[..., 3:])))
        self.wrench = np.ascontiguousarray(data.wrench) if data.wrench.any() else np.zeros((1, len(tree.ends), 6))
        self._start = np.zeros((len(data), tree.coordinates))
        self._closures = np.zeros((len(data), int(self._arrays.size[2])))
        self._block = {int(f): b for b, f in enumerate(self._arrays.first[:-1])}
        self.given = [tree.joints.index(name) for name in machine.joints]
        self._centre = centre

    @property
    def centre(self) -> Array:
        """Mean of the nominal end frames' places, unless another one was given."""
        if self._centre is None:
            # of most forwards nobody asks it, and it costs an equilibrium of every posture
            self._centre = self.unloaded()[1].mean(axis=(0, 1))
        return self._centre

    @centre.setter
    def centre(self, place: Array) -> None:
        self._centre = place

    @property
    def tracked(self) -> list[int]:
        """Markers whose orientation was tracked, or whose tilt was read."""
        turned = np.isfinite(self.data.orientation).all(axis=(2, 3))
        seen = (turned | np.isfinite(self.data.tilt).any(axis=2)).any(axis=0)
        return [int(k) for k in np.flatnonzero(seen)]

    def nuisance_names(self) -> list[str]:
        """What each is: six of the tracker, three a marker, three more where it is tracked as a frame."""
        names = [BASE_TURN] * 3 + [BASE_PLACE] * 3
        for marker in self.data.markers:
            names += [f"{MARKER_PLACE} {marker}"] * 3
        for k in self.tracked:
            names += [f"{MARKER_FRAME} {self.data.markers[k]}"] * 3
        return names

    def bearing(self) -> Array:
        """What each coordinate bears ``(g, n_tree)`` in the machine as the model file has it, N mm or N."""
        x, _, _, _ = self._solve(self._arrays, self._values)
        K = np.array([self._arrays.K[self._block[c], 0, 0] if c in self._block else 0.0 for c in range(x.shape[1])])
        return (x - self._natural) * K

    def torques(self) -> Array:
        """Standard deviation ``(n_tree,)`` over the postures of what each coordinate bears.

        A torque that is the same in all postures turns a joint by a constant, which is an offset.
        """
        return np.std(self.bearing(), axis=0)

    def holding(self) -> Array:
        """What holds each of the data's joints ``(g, n)`` in the machine as the model file has it, N mm or N."""
        _, forces, _, _ = self._solve(self._arrays, self._values)
        return self.machine.tree.torques(forces)[:, self.given]

    def evaluate(self, z: Array, frames: Frames) -> Linearised:
        """See `ReadingsForward`."""
        R, p, columns, forces = self.end_frames(z)
        return self._seen(z, frames, R, p, columns, forces)

    def placed(self, z: Array) -> tuple[Array, Array]:
        """End frames in the base, ``(g, e, 3, 3)`` and ``(g, e, 3)`` mm, at members ``z`` (P,).

        Raises:
            NoConvergenceError: a posture has no equilibrium.
        """
        _, _, R, p = self._solve(*self._changed(z))
        return R, p

    def end_frames(self, z: Array) -> tuple[Array, Array, Array, Array]:
        """End frames in the base and how they move, at members ``z`` (P,).

        Returns:
            rotations ``(g, e, 3, 3)``, positions ``(g, e, 3)`` mm, velocities ``(g, e, 6, P)`` per unit of each
            member, and the forces ``(g, m)`` on the one-degree joints.

        Raises:
            NoConvergenceError: a posture has no equilibrium.
        """
        arrays, values = self._changed(z)
        x, forces, R, p = self._solve(arrays, values)
        try:
            d = frame_derivatives(arrays, values, self._natural, self.wrench, x, self._closures)
        except NoConvergenceError as error:
            raise NoConvergenceError(
                f"{self.data.file}: {error}. Within a clearance nothing holds a joint: give gravity, or "
                "the law a stiffness there"
            ) from error
        return R, p, self._columns(z, arrays, x, forces, d), forces

    def unloaded(self) -> tuple[Array, Array]:
        """End frames by the nominal machine: ``(g, k, 3, 3)`` and ``(g, k, 3)`` mm."""
        _, _, R, p = self._solve(self._arrays, self._values)
        return R, p

    def _changed(self, z: Array) -> tuple[MachineArrays, Array]:
        """Arrays and joints' values at the members' sizes."""
        K, load, values = self._arrays.K.copy(), self._arrays.load.copy(), self._values.copy()
        beam, border_K = self._arrays.beam.copy(), self._arrays.border_K.copy()
        for size, member in zip(z, self.members, strict=True):
            if size == 0.0:
                continue
            change = size * member.scale
            if member.kind == VALUE:
                for joint, share in self._moves(member):
                    values[:, joint] += share * change * (1.0 if member.basis is None else member.basis)
            elif member.kind == COMPLIANCE:
                stiffness = 1.0 / max(member.nominal + change, RIGID)
                K[self._block[member.index]][0, 0] = stiffness
                # a spring that moves several joints stays in the border
                positions = np.flatnonzero(self._arrays.border == member.index)
                border_K[positions, positions] = stiffness
            elif member.kind == FACTOR:
                for block in [self._block[c] for c in self.machine.tree.span(member.subject) if c in self._block]:
                    K[block] /= max(1.0 + change, 1e-3)
                    beam[block, :4] /= max(1.0 + change, 1e-3)
                    beam[block, 5:] *= max(1.0 + change, 1e-3)
            elif member.kind == MASS:
                load[self._loads(member)] *= max(1.0 + change, 0.0)
        return self._arrays._replace(K=K, load=load, beam=beam, border_K=border_K), values

    def _moves(self, member: FamilyParameter) -> list[tuple[int, float]]:
        """One-degree joints that a member of joints' values moves, and by which share."""
        return self.machine.moves.get(member.index, [(member.index, 1.0)])

    def _loads(self, member: FamilyParameter) -> list[int]:
        """Weights of the part that a member of masses belongs to."""
        own = self.machine.masses[member.index]
        return [k for k, name in enumerate(self.machine.masses) if name == own]

    def _solve(self, arrays: MachineArrays, values: Array) -> tuple[Array, Array, Array, Array]:
        g = len(self._start)
        k, x = len(self.machine.tree.ends), self._start.copy()
        verdict, forces = np.zeros(g, dtype=np.int64), np.zeros((g, len(arrays.parent)))
        R, p = np.zeros((g, k, 3, 3)), np.zeros((g, k, 3))
        free_equilibria(arrays, values, self._natural, self.wrench, x, self._closures, verdict, forces, R, p)
        if np.any(verdict == LOST):
            row = int(self.data.row[int(np.argmax(verdict == LOST))])
            raise NoConvergenceError(f"{self.data.file}: row {row}: the model has no equilibrium in that posture")
        self._start = x
        return x, forces, R, p

    def _columns(self, z: Array, arrays: MachineArrays, x: Array, forces: Array, d: FrameDerivatives) -> Array:
        """Velocities ``(g, k, 6, P)`` of the end frames in the base's axes, per unit of each member."""
        g, k = len(self.data), len(self.machine.tree.ends)
        result = np.zeros((g, k, 6, len(self.members)))
        for i, (size, member) in enumerate(zip(z, self.members, strict=True)):
            if member.kind == VALUE:
                column = sum(
                    (share * d.value[..., joint] for joint, share in self._moves(member)), np.zeros((g, k, 6))
                )
                if member.basis is not None:
                    column = column * member.basis[:, None, None]
            elif member.kind == COMPLIANCE:
                c = member.index
                stiffness = arrays.K[self._block[c], 0, 0]
                column = d.force[..., c] * ((x[:, c] - self._natural[:, c]) * stiffness**2)[:, None, None]
            elif member.kind == FACTOR:
                # all stiffnesses over f: under the reactions t the strain θ(f t) of the law as it was, so that a
                # unit of f does what the force t/f would
                span = self.machine.tree.span(member.subject)
                reaction = np.stack(
                    [forces @ np.where(arrays.coordinate == c, arrays.factor, 0.0) for c in span], 1
                )
                column = np.einsum("gkan,gn->gka", d.force[..., span.start : span.stop], reaction)
                column = column / max(1.0 + size * member.scale, 1e-3)
            elif member.kind == MASS:
                column = d.load[..., self._loads(member)].sum(axis=3) / max(1.0 + size * member.scale, 1e-6)
            else:
                continue
            result[..., i] = member.scale * column
        return result

    def _seen(self, z: Array, frames: Frames, R: Array, p: Array, columns: Array, forces: Array) -> Linearised:
        """What the tracker sees of the end frames, and how it changes."""
        data = self.data
        g, k = len(data), len(data.markers)
        arm = np.einsum("gkab,kb->gka", R, frames.m)
        place, moved = p + arm, velocities(columns, arm)
        J = np.concatenate([frames.R @ moved, frames.R @ columns[..., 3:, :]], axis=2)
        seen = place @ frames.R.T + frames.t
        for i, (size, member) in enumerate(zip(z, self.members, strict=True)):
            basis = np.zeros(g) if member.basis is None else member.basis
            if member.kind == DRIFT:
                J[:, :, member.index, i] = member.scale * basis[:, None]
            elif member.kind == STRETCH:
                J[..., :3, i] = member.scale * basis[:, None, None] * (place @ frames.R.T)
            else:
                continue
            seen = seen + size * J[..., :3, i]
        F = np.zeros((g, k, 6, self.nuisances))
        centre = frames.t + frames.R @ self.centre
        for a in range(3):
            F[:, :, :3, a] = np.cross(np.eye(3)[a], seen - centre)
            F[:, :, 3 + a, a] = 1.0
            F[:, :, a, 3 + a] = 1.0
        for j in range(k):
            F[:, j, :3, 6 + 3 * j : 9 + 3 * j] = frames.R @ R[:, j]
        turned = frames.R @ R @ frames.M
        for place_of, j in enumerate(self.tracked):
            first = 6 + 3 * k + 3 * place_of
            F[:, j, 3:, first : first + 3] = turned[:, j]
        residual = np.full((g, k, 6), np.nan)
        residual[..., :3] = data.position - seen
        residual[..., 3:] = turn_between(turned, data.orientation)
        self._tilts(frames, R, columns, residual, J, F)
        tilt = np.zeros((g, k, 6, 3))
        for a in range(3):
            tilt[:, :, :3, a] = np.cross(np.eye(3)[a], place) @ frames.R.T
            tilt[:, :, 3:, a] = frames.R[:, a]
        off = np.zeros(self.nuisances)
        off[6 : 6 + 3 * k] = frames.m.reshape(-1)
        return Linearised(residual, F, J, self.machine.tree.torques(forces)[:, self.given], off, tilt)

    def _tilts(self, frames: Frames, R: Array, columns: Array, residual: Array, J: Array, F: Array) -> None:
        """Readings of inclinometers in place of turns: ``asin(u · a)`` of their axes a, u against the weight."""
        tilted = [(k, j) for k, j in enumerate(self.tracked) if np.isfinite(self.data.tilt[:, j]).any()]
        u = -np.array(self.gravity) / (np.linalg.norm(self.gravity) if tilted else 1.0)
        for place_of, j in tilted:
            axes = R[:, j] @ frames.M[j]
            own = 6 + 3 * len(self.data.markers) + 3 * place_of
            J[:, j, 3:], F[:, j, 3:], residual[:, j, 5] = 0.0, 0.0, np.nan
            for k in range(2):
                sine = np.clip(axes[:, :, k] @ u, -1.0, 1.0)
                over = 1.0 / np.sqrt(np.maximum(1.0 - sine**2, 1e-12))
                residual[:, j, 3 + k] = self.data.tilt[:, j, k] - np.arcsin(sine)
                # a turn w of the body moves a by w × a, and u · (w × a) = (a × u) · w
                by_turn = np.cross(axes[:, :, k], u) * over[:, None]
                J[:, j, 3 + k] = np.einsum("ga,gap->gp", by_turn, columns[:, j, 3:])
                F[:, j, 3 + k, own : own + 3] = np.einsum("ga,gab->gb", by_turn, axes)

    def moved(self, frames: Frames, step: Array) -> Frames:
        """See `ReadingsForward`."""
        k = len(self.data.markers)
        turn = step[:3]
        size = float(np.linalg.norm(turn))
        if size > LARGEST_TURN:
            turn = turn * (LARGEST_TURN / size)
        centre = frames.t + frames.R @ self.centre
        Q = rotation_from_vector(turn)
        M = frames.M.copy()
        for place_of, j in enumerate(self.tracked):
            first = 6 + 3 * k + 3 * place_of
            M[j] = M[j] @ rotation_from_vector(step[first : first + 3])
        return Frames(
            Q @ frames.R,
            Q @ (frames.t - centre) + centre + step[3:6],
            frames.m + step[6 : 6 + 3 * k].reshape(k, 3),
            M,
        )

    def with_machine(self, machine: PoseMachine) -> PoseForward:
        """The same test of another machine with the same members."""
        other = PoseForward(machine, self.data, self.gravity, self.centre)
        if len(other._arrays.K) != len(self._arrays.K):
            raise ValueError("a machine of other springs has other members")
        shift = {self.machine.driven[name]: machine.driven[name] for name in machine.driven}
        shift |= {a.index: b.index for a, b in zip(self.machine.frames, machine.frames, strict=True)}
        other.members = [
            replace(member, index=shift[member.index]) if member.kind == VALUE else member
            for member in self.members
        ]
        return other


def velocities(columns: Array, arm: Array) -> Array:
    """Velocities ``(g, k, 3, P)`` of points at ``arm`` (g, k, 3) behind frames that move by ``columns``."""
    cross = np.zeros((*arm.shape, 3))
    cross[..., 0, 1], cross[..., 0, 2] = arm[..., 2], -arm[..., 1]
    cross[..., 1, 0], cross[..., 1, 2] = -arm[..., 2], arm[..., 0]
    cross[..., 2, 0], cross[..., 2, 1] = arm[..., 1], -arm[..., 0]
    return columns[..., :3, :] + cross @ columns[..., 3:, :]


def turn_between(R: Array, other: Array) -> Array:
    """Rotation vectors ``(g, k, 3)`` from predicted to read orientations, for small turns; nan where none."""
    return rotation_vectors(other @ np.swapaxes(R, -1, -2))
