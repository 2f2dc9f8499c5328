"""A force that relaxes while the displacement is held: a standard linear solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vjm.chain import FOOT
from vjm.effects.effect import Effect, Quantity, Scene
from vjm.effects.machine import Machine, beam_of, link_of
from vjm.effects.places import foot
from vjm.effects.series import AlongLine, Element, retarded


@dataclass(frozen=True)
class Creep(Effect):
    """A share φ of the part's stiffness relaxes; at first it is nominal, in the end ``(1 − φ)`` of that.

    Its compliance then gains ``φ/(1 − φ)``, delayed by ``τ/(1 − φ)`` for a relaxation time τ.

    Attributes:
        part: ``foot`` or ``link``.
        duration: of the test, s.
        interval: between readings, s.
    """

    part: str = "foot"
    duration: float = 100.0
    interval: float = 1.0
    cause = "creep"
    title = "the force relaxes while the displacement is held"

    def quantities(self) -> tuple[Quantity, ...]:
        """φ and τ."""
        middle = (self.duration * self.interval) ** 0.5
        return (
            Quantity("fraction", 0.0, 0.9, 0.01, neutral=0.0),
            Quantity(
                "time_s", 0.1 * self.interval, 10.0 * self.duration, middle, usual=middle, spread=2.0, log=True
            ),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Fast to slow."""
        times = (3.0 * self.interval, (self.duration * self.interval) ** 0.5, self.duration / 8.0, self.duration)
        return [(0.03, time) for time in times]

    def elements(self, machine: Machine, values: Sequence[float]) -> tuple[Element, ...]:
        """One retarded element."""
        fraction, time = values
        gain = fraction / (1.0 - fraction)
        delay = time / (1.0 - fraction)
        if self.part == "foot":
            return (Element(foot(machine), retarded(gain, delay)),)
        chain = machine.chain()
        beam = beam_of(chain, link_of(chain))
        return (Element(AlongLine(), retarded(gain * beam.length / beam.effective_section().EA, delay)),)


def effects(scene: Scene) -> list[Effect]:
    """In foot and link, where there is a clock."""
    if scene.duration <= 0.0 or scene.interval <= 0.0:
        return []
    link = link_of(scene.chain)
    clock = {"duration": scene.duration, "interval": scene.interval}
    found: list[Effect] = [Creep("foot", **clock) for b in scene.chain.beams if b.name == FOOT != link]
    return [*found, Creep("link", **clock)] if beam_of(scene.chain, link).section is not None else found
