"""Statics of a whole manipulator: those of its system, and couplings between hinges as one constraint more each."""

from __future__ import annotations

import numpy as np

from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_fea.common.linearized_statics import Tangent
from vjm_fea.common.states import States
from vjm_fea.exudyn.backend import exu
from vjm_fea.exudyn.manipulator_system import Hinge, ManipulatorSystem
from vjm_fea.exudyn.statics import Statics


class ManipulatorStatics(Statics):
    """A manipulator's system at any state; the couplings' torques come behind the joints' multipliers."""

    def __init__(self, system: ManipulatorSystem, length: float, load_case: LoadCase) -> None:
        """Evaluate a system under a load case's loads, see `Statics`."""
        super().__init__(system, length, load_case)
        self._couplings = system.couplings
        count = len(self._couplings)
        if not count:
            return
        plain = self.states
        self._plain = plain
        self.states = States(plain.bodies, plain.others + count)
        self.initial = np.insert(self.initial, len(self.initial) - 1, np.zeros(count))
        self.free = np.concatenate([self.free, len(self.unit) + np.arange(count)])
        # a torque that strains the arms as the typical one does
        self.unit = np.concatenate([self.unit, np.full(count, self.energy)])

    def _without(self, state: Array) -> Array:
        """The state as the plain system has it."""
        end = 7 * self._plain.bodies + self._plain.others
        return np.concatenate([state[:end], state[-1:]])

    def _body_of(self, hinge: Hinge) -> int:
        return int(self._body[hinge.node])

    def _turn(self, hinge: Hinge, places: Array) -> float:
        """Turn of a hinge's node about its axis from home, rad."""
        body = self._body_of(hinge)
        own = places[body, 3:]
        reference = self.system.reference[self._leading[body], 3:]
        # product with the reference's inverse: scalar, and vector along the axis
        scalar = float(own @ reference)
        vector = reference[0] * own[1:] - own[0] * reference[1:] - np.cross(own[1:], reference[1:])
        return hinge.rest + 2.0 * float(np.arctan2(vector @ hinge.axis, scalar))

    def _inner(self, state: Array) -> Array:
        if not self._couplings:
            return super()._inner(state)
        r = super()._inner(self._without(state))
        torques = self.states.numbers(state)[self._plain.others :]
        places = self.states.places(state)
        errors = []
        for torque, hinges in zip(torques, self._couplings, strict=True):
            for hinge in hinges:
                at = 6 * self._body_of(hinge) + 3
                r[at : at + 3] += torque * hinge.weight * hinge.axis
            errors.append(sum(hinge.weight * self._turn(hinge, places) for hinge in hinges))
        return np.concatenate([r, errors])

    def _stiffness(self, state: Array, like: Tangent | None) -> tuple[Array, Array | None]:
        if not self._couplings:
            return super()._stiffness(state, like)
        J, added = super()._stiffness(self._without(state), like)
        n, count = len(J), len(self._couplings)
        whole = np.zeros((n + count, n + count))
        whole[:n, :n] = J
        for k, hinges in enumerate(self._couplings):
            for hinge in hinges:
                at = 6 * self._body_of(hinge) + 3
                whole[at : at + 3, n + k] += hinge.weight * hinge.axis
                whole[n + k, at : at + 3] += hinge.weight * hinge.axis
        return whole, added

    def shape(self, state: Array) -> Array:
        """Positions ``(k, 3)`` of the stations, mm, world."""
        return super().shape(self._without(state) if self._has_extra(state) else state)

    def node_forces(self, state: Array) -> Array:
        """See `Statics.node_forces`."""
        return super().node_forces(self._without(state) if self._has_extra(state) else state)

    def section_force(self, state: Array, root: int, tip: int) -> Array:
        """Force ``(3,)`` in the middle of the element between two nodes, its own axes, N.

        Raises:
            ValueError: there is no such element.
        """
        self._whole.set(self._full(self._without(state) if self._has_extra(state) else state))
        mbs = self.system.assembly.whole
        for number in range(mbs.systemData.NumberOfObjects()):
            if [int(n) for n in mbs.GetObject(number).get("nodeNumbers", [])] == [root, tip]:
                output = exu.OutputVariableType.ForceLocal
                return np.array(mbs.GetObjectOutputBody(number, output, [0.0, 0.0, 0.0]), dtype=float)
        raise ValueError(f"no element between nodes {root} and {tip}")

    def _has_extra(self, state: Array) -> bool:
        return bool(self._couplings) and len(state) == len(self.initial)
