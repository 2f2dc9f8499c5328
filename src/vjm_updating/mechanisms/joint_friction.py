"""Dry friction in the passive joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.rotations import Array
from vjm_updating.mechanisms.effect import Effect, Quantity, Scene


@dataclass(frozen=True)
class JointFriction(Effect):
    """Coulomb's law with a torque for every joint, behind a spring; see `vjm_updating.mechanisms.friction_loop`.

    Attributes:
        joints: how many there are.
    """

    joints: int = 1
    cause = "joint_friction"
    title = "dry friction in the passive joints"

    def quantities(self) -> tuple[Quantity, ...]:
        """Mean torque at which a joint slips, each joint's over it, and the elastic turn before it slips.

        Like joints are alike, not equal. Contacts of metal part by some 2 to 5 micrometres before they slip
        (Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083). At the 10 to 20 mm of a
        bearing's radius that is 0.1 to 0.5 mrad. The spread has room for softer ones, and for rolling bearings.
        """
        shares = (
            Quantity(f"share_of_joint_{k}", 0.05, 20.0, 1.0, usual=1.0, spread=0.3, log=True)
            for k in range(1, self.joints + 1)
        )
        elastic = Quantity("presliding_rad", 1e-6, 1e-2, 2e-4, usual=2e-4, spread=1.0, log=True)
        return (Quantity("torque_Nmm", 0.0, 1e6, 200.0, neutral=0.0), *shares, elastic)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """So small that all joints turn, and larger."""
        return [(torque, *(1.0,) * self.joints, 2e-4) for torque in (100.0, 800.0, 5000.0)]

    def friction(self, values: Sequence[float]) -> Array:
        """The torques."""
        return values[0] * np.array(values[1:-1])

    def presliding(self, values: Sequence[float]) -> float:
        """One elastic turn for all joints."""
        return values[-1]

    def reported(self, values: Sequence[float], force: float) -> dict[str, float]:
        """The mean torque of the joints, each joint's over it, and the elastic turn."""
        torque, *shares, elastic = values
        mean = float(np.mean(shares))
        own = {f"{self.cause}.share_of_joint_{k}": s / mean for k, s in enumerate(shares, start=1)}
        return {f"{self.cause}.torque_Nmm": torque * mean} | own | {f"{self.cause}.presliding_rad": elastic}


def effects(scene: Scene) -> list[Effect]:
    """Where there are joints."""
    return [JointFriction(joints=len(scene.chain.joints))] if scene.chain.joints else []
