"""The machine that a calibration's unknowns mean, for any forward model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from vjm.rotations import Array
from vjm_updating.calibration.parameters import Unknowns
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.observation.coordinate import Coordinate


@dataclass
class OfUnknowns:
    """The machine of a forward model whose parameters are looked for.

    Attributes:
        unknowns: parameters of the machine and nuisances of the test.
    """

    unknowns: Unknowns = field(kw_only=True)

    def machine(self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis) -> ModifiedChain:
        """The chain that the unknowns ``(n_z,)`` mean."""
        changed = tuple(z[self.unknowns.on_chain].tolist())
        return ModifiedChain(self.unknowns.build(z), self.unknowns.engine, changed=changed)
