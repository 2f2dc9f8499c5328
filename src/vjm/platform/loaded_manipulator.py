"""The loaded manipulator in the form of one chain, so that whatever follows a chain's path follows its too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.continuation.path import StationLabel
from vjm.model.applied_loads import NO_LOADS
from vjm.model.chain import FOOT, Chain
from vjm.model.lumped import LumpedModel
from vjm.platform.body_network_solver import NetworkSolver
from vjm.platform.closure import RigidPose
from vjm.platform.leg_topology import Edge, Layout
from vjm.platform.manipulator import BASE, Leg
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine

ALL_HELD = np.ones(6, dtype=bool)


def lumped(engine: VjmEngine, chain: Chain) -> LumpedModel:
    """A leg with an engine's springs; what it says of feet is for legs that have one."""
    if all(beam.name != FOOT for beam in chain.beams):
        engine = replace(engine, foot_segments=None)
    return engine.model(chain)


class LoadedManipulator:
    """All legs of a manipulator in a pose, with its bodies between them.

    A `vjm.model.loaded_model.LoadedModel`: its coordinates are those of the legs, their end wrenches, the bodies'
    displacements and the couplings' torques; what is imposed is the platform's pose. The loads on the platform are
    the network's: `applied_loads` are none.

    Attributes:
        pose: the rigid pose from which displacements count.
        models: lumped legs, as built.
        network: them at work together.
        layout: of the coordinates.
    """

    def __init__(
        self,
        pose: RigidPose,
        engine: VjmEngine,
        held: Array = ALL_HELD,
        constant: Array | None = None,
        ramped: Array | None = None,
        models: Sequence[LumpedModel] | None = None,
    ) -> None:
        """Set the manipulator up in a pose.

        Args:
            pose: rigid, closed.
            engine: how beams become springs.
            held: ``(6,)`` imposed components of the platform's pose.
            constant: dead wrench ``(6,)`` on the platform, N, N mm, world axes.
            ramped: the same per unit of the load factor.
            models: of the legs, where they are known from another pose.

        Raises:
            ValueError: a leg lacks what its springs are made from.
        """
        robot = pose.manipulator
        self.pose = pose
        self.models = list(models) if models else [lumped(engine, robot.built(leg)) for leg in robot.legs]
        self.layout = Layout(self.models, len(robot.bodies), len(robot.couplings))
        self.size = self.layout.size
        # legs deflect in all directions: there is always motion left
        self.free = 1
        self.applied_loads = NO_LOADS
        self.name = robot.name
        self.characteristic_length = length = robot.characteristic_length
        energy = float(np.exp(np.mean([np.log(model.wrench_scale[3]) for model in self.models])))
        # forces do not count as distance, nor among motions
        unit = np.full(self.size, np.inf)
        for model, where in zip(self.models, self.layout.legs, strict=True):
            unit[where] = model.coordinate_scale
        unit[self.layout.bodies] = np.tile([length] * 3 + [1.0] * 3, len(robot.bodies))
        self.coordinate_scale = unit
        self.wrench_scale = np.repeat([energy / length, energy], 3)
        self.network = NetworkSolver(
            self.models,
            [self._edge(leg, i) for i, leg in enumerate(robot.legs)],
            self.layout,
            pose.frames,
            held,
            np.zeros(6) if constant is None else constant,
            np.zeros(6) if ramped is None else ramped,
            self._torques(),
            (unit, self.wrench_scale),
        )
        self.compiled = self.network

    def _edge(self, leg: Leg, index: int) -> Edge:
        robot = self.pose.manipulator
        start = -1 if leg.start == BASE else robot.bodies.index(leg.start)
        coordinate = float(self.pose.drives[index]) + robot.offsets.get(leg.name, 0.0)
        return Edge(start, robot.bodies.index(leg.end), leg.driven_root(coordinate), leg.attachment)

    def _torques(self) -> list[list[tuple[int, int, float, float]]]:
        robot = self.pose.manipulator
        names = [leg.name for leg in robot.legs]
        result = []
        for coupling in robot.couplings:
            terms = []
            for name, joint, weight in coupling.terms:
                i = names.index(name)
                j = [part.name for part in robot.legs[i].chain.joints].index(joint)
                rest = float(robot.legs[i].posture[j])
                terms.append((i, int(self.models[i].passive[j]), weight, rest))
            result.append(terms)
        return result

    @property
    def at_rest(self) -> Array:
        """Coordinates ``(n,)`` of the rigid pose, no leg strained."""
        x = np.zeros(self.size)
        for model, where, q in zip(self.models, self.layout.legs, self.pose.q, strict=True):
            x[where] = model.configuration(q)
        return x

    def labels(self) -> tuple[StationLabel, ...]:
        """Labels of the rows of `NetworkSolver.shape`."""
        return tuple(
            StationLabel(f"{leg.name}/{station.part}", station.fraction)
            for leg, model in zip(self.pose.manipulator.legs, self.models, strict=True)
            for station in model.stations
        )

    def velocities(self, x: Array, motion: Array) -> Array:
        """Velocities ``(k, 3)`` of all stations, those of bodies on which legs begin included."""
        frames = self.network.frames(x)
        bodies = motion[self.layout.bodies].reshape(-1, 6)
        rates = []
        for model, where, edge in zip(self.models, self.layout.legs, self.network.edges, strict=True):
            leg = model.kinematics(x[where])
            world = (np.eye(4) if edge.start < 0 else frames[edge.start]) @ edge.root
            rate = model.shape_rate(leg, motion[where]) @ world[:3, :3].T
            if edge.start >= 0:
                points = model.shape(leg) @ world[:3, :3].T + world[:3, 3] - frames[edge.start][:3, 3]
                rate = rate + bodies[edge.start, :3] + np.cross(bodies[edge.start, 3:], points)
            rates.append(rate)
        return np.vstack(rates)
