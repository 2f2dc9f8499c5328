"""Signatures of a campaign's designs, kept on disk so that an interrupted campaign does not compute them twice."""

import pickle
from dataclasses import dataclass, field
from pathlib import Path

from hidden_effects.designs import draw
from hidden_effects.finder import identity
from hidden_effects.signatures import Signatures, signatures
from vjm.io.files import write_whole

MAKER = "hidden_effects.signatures"
"""Module that makes them."""
KEPT = 6
"""Designs held in memory."""


@dataclass
class Store:
    """Signatures by the seed of their design."""

    folder: Path
    designs: int
    _held: dict[int, Signatures] = field(default_factory=dict)

    def another(self, seed: int, trial: int) -> int:
        """Another design of the campaign."""
        first = seed - seed % 1000
        return first + (seed % 1000 + 7 * trial) % self.designs

    def signatures(self, seed: int) -> Signatures:
        """Those of a design; computed where they are not there."""
        if seed not in self._held:
            file = self.folder / f"{seed:06d}.pickle"
            known = _read(file)
            if known is None:
                known = signatures(draw(seed))
                write_whole(file, pickle.dumps((identity(MAKER), known), protocol=pickle.HIGHEST_PROTOCOL))
            if len(self._held) >= KEPT:
                self._held.pop(next(iter(self._held)))
            self._held[seed] = known
        return self._held[seed]


def _read(file: Path) -> Signatures | None:
    """None where there is no such file, or one that other sources wrote."""
    try:
        with open(file, "rb") as source:
            made_of, known = pickle.load(source)
    except (OSError, pickle.UnpicklingError, AttributeError, EOFError, ImportError, TypeError, ValueError):
        return None
    return known if made_of == identity(MAKER) else None
