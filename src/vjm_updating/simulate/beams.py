"""The readings of a machine made of geometrically exact beams, with a hidden effect built into it.

Nothing of the model that a diagnosis fits is used. An effect is a change of the chain that the finite elements are
made of, of the displacement that is imposed, or of what the gauges show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.constants
from scipy.interpolate import CubicHermiteSpline

from vjm.continuation.path import EventKind, Path
from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Part, Section
from vjm.rotations import Array, rotation_from_vector
from vjm.vjm_engine import VjmEngine
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.actuator_compliance import ActuatorCompliance
from vjm_updating.mechanisms.base_compliance import BaseCompliance
from vjm_updating.mechanisms.gravity import Gravity
from vjm_updating.mechanisms.link_bow import LinkBow
from vjm_updating.mechanisms.load_misalignment import LoadMisalignment
from vjm_updating.mechanisms.modified_chain import standing_free
from vjm_updating.observation.instrument_errors import InstrumentErrors
from vjm_updating.simulate.hidden import Hidden

OF_INSTRUMENTS = ("instrument_zero", "instrument_scale")
OF_PARTS = ("foot_compliance", "link_compliance", "link_length")
"""Come as what is off within a test, see `BeamMachine.wrench`."""
BY_NATURE = ("foot_lumping", "link_lumping")
"""Beams have no springs: they are what the sheet's model lacks."""
CARRIED = (
    *("actuator_compliance", "base_compliance", *OF_PARTS, *BY_NATURE, "gravity", *OF_INSTRUMENTS),
    *("link_bow", "load_misalignment"),
)  # fmt: skip
"""Causes that the beams can carry."""
ELEMENTS = numerical(16)
"""Of every beam; a bowed one is as many chords, whose error is of the second order in their length."""
STEPS = numerical(40)
"""Points of a path between which readings are interpolated, by cubics through values and slopes."""


def refuse_what_beams_cannot_carry(hidden: Sequence[Hidden], engine: str) -> None:
    """Refuse effects that finite elements of beams do not have.

    Raises:
        ValueError: there is one; one line with those that they have.
    """
    for effect, _ in hidden:
        if effect.cause not in CARRIED:
            raise ValueError(
                f"--hide {effect.label}: the beams of --engine {engine} cannot carry it; they carry "
                f"{', '.join(sorted(CARRIED))}. Leave --engine out for the lumped model, which carries all"
            )


@dataclass(frozen=True)
class BeamMachine:
    """A machine of beams in a test.

    Attributes:
        chain: as the sheet draws it.
        posture: label of each reading ``(n,)``.
        run: number of each reading's ramp, out and back on one side of the unloaded pose ``(n,)``.
        pose: displacement that the gauges are to show at each reading ``(n, 6)``, mm and rad.
        hidden: effects and their values.
        engine: name of the finite elements.
    """

    chain: Machine
    posture: np.ndarray
    run: np.ndarray
    pose: Array
    hidden: tuple[Hidden, ...]
    engine: str = "exudyn"

    def wrench(self, off: Mapping[tuple[str, str], float]) -> Array:
        """Readings ``(n, 6)`` without noise, N and N mm.

        Args:
            off: zero and scale errors of channels, relative moduli and lengths in mm of parts, by kind and subject.

        Raises:
            NoConvergenceError: the machine does not stand at the readings.
            ValueError: the finite elements cannot be made of this chain.
        """
        errors = InstrumentErrors.of(off)
        place = errors.true_displacement(self.pose)
        chain, gravity = _with_off(self.chain, off), None
        bows: dict[str, Sequence[float]] = {}
        for effect, values in self.hidden:
            if isinstance(effect, LoadMisalignment):
                place = _turned(effect, place, values)
            elif isinstance(effect, LinkBow):
                bows[effect.beam] = values
            elif isinstance(effect, Gravity):
                chain = _weighing(chain, effect, values)
                x, y, z = (scipy.constants.g * v for v in effect.direction)
                gravity = (x, y, z)
            elif isinstance(effect, ActuatorCompliance | BaseCompliance):
                chain = effect.built(chain, values)
        if bows:
            chain = _in_pieces(chain, bows)
        engine = engine_by_name(self.engine, EngineOptions(segments=1 if bows else ELEMENTS), chain)
        wrench = np.zeros_like(place)
        lengthened = chain.closes and any(kind == "length" and value for (kind, _), value in off.items())
        for run in dict.fromkeys(self.run.tolist()):
            own = np.flatnonzero(self.run == run)
            posture = str(self.posture[own[0]])
            stands = _settled(chain, posture) if lengthened else chain
            wrench[own] = _along(engine, stands, posture, place[own], gravity)
        return errors.reading(wrench)


# --- changes of the chain ---------------------------------------------------------------------------------


def _replaced(chain: Machine, name: str, parts: Sequence[Part]) -> Machine:
    """The chain with others in a part's place."""
    kept = [part for part in chain.parts for part in (parts if part.name == name else [part])]
    return replace(chain, parts=tuple(kept))


def _stiffer(section: Section, factor: float) -> Section:
    names = ("EA", "GJ", "EIy", "EIz", "GAy", "GAz")
    return replace(section, **{name: factor * getattr(section, name) for name in names})


def _with_off(chain: Machine, off: Mapping[tuple[str, str], float]) -> Machine:
    """With other moduli and lengths."""
    for (kind, name), value in off.items():
        beam = next((beam for beam in chain.beams if beam.name == name), None)
        if beam is None or not value:
            continue
        if kind == "length":
            chain = _replaced(chain, name, [replace(beam, length=beam.length + value)])
        elif kind == "modulus":
            section = None if beam.section is None else _stiffer(beam.section, 1.0 + value)
            compliance = None if beam.compliance is None else beam.compliance / (1.0 + value)
            chain = _replaced(chain, name, [replace(beam, section=section, compliance=compliance)])
    return chain


def _settled(chain: Machine, posture: str) -> Machine:
    """The chain in one posture, its loops with other lengths than drawn: gauges are zeroed where it stands free.

    Where it stands is by springs, as fine as the elements: both tend to the same beams.

    Raises:
        NoConvergenceError: it does not stand.
    """
    alone = replace(chain, postures={posture: chain.posture(posture)}, held={posture: chain.held[posture]})
    return standing_free(alone, VjmEngine(ELEMENTS))


def _weighing(chain: Machine, effect: Gravity, values: Sequence[float]) -> Machine:
    share = values[1] if effect.foot is not None else 0.0
    links = ((name, values[0] * (1.0 - share) * own) for name, own in effect.links)
    for name, mass in (("foot", values[0] * share), *links):
        beam = next((beam for beam in chain.beams if beam.name == name), None)
        if beam is not None and beam.section is not None and mass:
            section = replace(beam.section, mass=mass / beam.length / beam.count)
            chain = _replaced(chain, name, [replace(beam, section=section)])
    return chain


def _in_pieces(chain: Machine, bows: Mapping[str, Sequence[float]]) -> Machine:
    """With every beam as chords of a half sine wave, its ends where they were, for one element in each.

    Args:
        chain: of whole beams.
        bows: amplitudes at mid-span along the section's y and z axes, mm, by beam; the others are straight.
    """
    t = np.linspace(0.0, 1.0, ELEMENTS + 1)
    # the chords and the wave bound the same area
    area = 2.0 / np.pi * ELEMENTS * np.tan(0.5 * np.pi / ELEMENTS)
    for beam in chain.beams:
        wave = area * np.outer(np.sin(np.pi * t), bows.get(beam.name, (0.0, 0.0)))
        line = np.column_stack([beam.length * t, wave])
        pieces = []
        for k, chord in enumerate(np.diff(line, axis=0)):
            length = float(np.linalg.norm(chord))
            # turned from x by the smallest rotation
            axis = np.cross([1.0, 0.0, 0.0], chord / length)
            sine = float(np.linalg.norm(axis))
            turn = axis * (np.arcsin(sine) / sine if sine > 0.0 else 1.0)
            pieces.append(
                replace(
                    beam,
                    name=f"{beam.name} {k + 1}",
                    length=length,
                    section_frame=beam.section_frame @ rotation_from_vector(turn),
                    end_offset=beam.end_offset if k == ELEMENTS - 1 else np.zeros(3),
                    compliance=None,
                )
            )
        chain = _replaced(chain, beam.name, pieces)
    return chain


# --- the readings along paths -----------------------------------------------------------------------------


def _turned(effect: LoadMisalignment, place: Array, values: Sequence[float]) -> Array:
    """Displacements ``(n, 6)`` by a device that points a little elsewhere."""
    across = values[0] * np.array(effect.first) + values[1] * np.array(effect.second)
    R = rotation_from_vector(np.cross(np.array(effect.axis), across))
    return np.concatenate([place[:, :3] @ R.T, place[:, 3:]], axis=1)


def _along(
    engine: Engine, chain: Machine, posture: str, place: Array, gravity: tuple[float, float, float] | None
) -> Array:
    """The wrench ``(k, 6)`` at displacements ``(k, 6)`` along one half-line.

    What lies beside the line, by the gauges' zero errors, goes by the stiffness there.
    """
    furthest = place[int(np.argmax(np.linalg.norm(place, axis=1)))]
    reach = float(np.linalg.norm(furthest))
    direction = furthest / reach
    path = engine.trace(chain, LoadCase(posture, reach, tuple(direction.tolist()), STEPS, gravity=gravity))
    if not path.complete:
        raise NoConvergenceError(f"posture {posture}: {path.stopped}")
    s = np.clip(place @ direction, 0.0, reach)
    wrench, K = _interpolated(path, s, direction)
    result: Array = wrench + np.einsum("kij,kj->ki", K, place - np.outer(s, direction))
    return result


def _interpolated(path: Path, at: Array, direction: Array) -> tuple[Array, Array]:
    """Wrench ``(k, 6)`` and stiffness ``(k, 6, 6)`` of a path; cubics do not lead across a bifurcation."""
    s = path.s
    wrench = np.array([point.wrench for point in path.points])
    K = np.array([np.zeros((6, 6)) if point.stiffness is None else point.stiffness for point in path.points])
    breaks = [event.s for event in path.events if event.kind is EventKind.BIFURCATION]
    side, mine = (np.searchsorted(breaks, v, side="right") for v in (s, at))
    result, stiffness = np.zeros((len(at), 6)), np.zeros((len(at), 6, 6))
    for k in range(len(breaks) + 1):
        own, rows = side == k, mine == k
        if not rows.any():
            continue
        if own.sum() < 2:
            own = np.ones_like(own)
        result[rows] = CubicHermiteSpline(s[own], wrench[own], K[own] @ direction)(at[rows])
        for i, row in zip(np.flatnonzero(rows), at[rows], strict=True):
            stiffness[i] = K[own][int(np.argmin(np.abs(s[own] - row)))]
    return result, stiffness
