"""Causes that no catalogue has: what a finder must call unknown, unless a cause that it knows fits as well."""

from dataclasses import replace

import numpy as np

from hidden_effects.causes import Family, Put, added
from hidden_effects.rig import Rig, Seen
from hidden_effects.virtual_rig import Design
from vjm.rotations import Array


def outside(design: Design, rng: np.random.Generator) -> list[Family]:
    """Families whose size is in units that the sheet's noise makes visible."""
    main = design.instruments["fx_N"]
    found = [
        Family("periodic_lead_screw", "", (_screw(rng.uniform(0.12, 0.35), rng.uniform(0, 6)),), 0.002, most=0.3),
        Family("cable_drag", "", (_drag,), 5.0, most=5e3),
        Family("dead_zone", "", (_dead_zone,), 5.0, most=2e3),
        Family("gauge_stick", "", (_sticking_gauge,), 0.002, most=0.4),
        Family("softening_with_temperature", "", (_warming,), 0.002, (1, -1), 0.1),
        Family("saturating_amplifier", "", (_saturating,), 0.02, most=1.5),
        Family("slipping_bolt", "", (_slip(float(rng.uniform(0.3, 0.7))),), 0.005, (1, -1), 0.4),
        Family("beat", "", (_beat(float(rng.uniform(7.0, 13.0))),), 2.0 * main.noise, most=1e3 * main.noise),
    ]  # fmt: skip
    if len(design.sequences) > 1:
        shifts = rng.standard_normal(len(design.sequences))
        found.append(Family("clamping", "", (_clamping(shifts - shifts.mean()),), 0.005, most=0.4))
    others = [name for name in design.channels if name != "fx_N"]
    if others:
        to = str(rng.choice(others))
        found.append(Family("cross_talk", to, (_cross_talk(to),), 0.01 if to[0] == "f" else 1.0, (1, -1)))
    return found


def _fx(seen: Seen) -> Array:
    result: Array = seen.forces[:, seen.at("fx_N")]
    return result


def _warming(rig: Rig, size: float) -> Rig:
    """All parts grow softer with the temperature."""
    return replace(rig, softer_per_kelvin=size)


def _screw(pitch: float, phase: float) -> Put:
    def put(rig: Rig, size: float) -> Rig:
        return replace(rig, screw=lambda u: size * (np.sin(2 * np.pi * u / pitch + phase) - np.sin(phase)))

    return put


def _speed(seen: Seen) -> Array:
    speed = np.diff(seen.sequence.ux, prepend=seen.sequence.ux[0]) / np.diff(
        seen.sequence.time, prepend=seen.sequence.time[0] - 1.0
    )
    largest = np.abs(speed).max()
    result: Array = speed / largest if largest > 0.0 else speed
    return result


def _drag(rig: Rig, size: float) -> Rig:
    """A hose in oil: a force that goes with the speed, and grows as the hose stretches."""

    def fault(seen: Seen) -> Seen:
        travel = seen.sequence.ux / np.abs(seen.sequence.ux).max()
        v = _speed(seen)
        force: Array = size * np.sign(v) * np.abs(v) ** 0.7 * (1.0 + travel**2)
        return added(seen, "fx_N", force)

    return rig.with_fault(fault)


def _dead_zone(rig: Rig, size: float) -> Rig:
    """The amplifier shows nothing below a threshold, and everything above it."""

    def fault(seen: Seen) -> Seen:
        f = _fx(seen)
        return added(seen, "fx_N", -f * np.exp(-((f / size) ** 4)))

    return rig.with_fault(fault)


def _sticking_gauge(rig: Rig, size: float) -> Rig:
    """The gauge's plunger follows in jumps."""

    def fault(seen: Seen) -> Seen:
        shown = seen.ux.copy()
        for k in range(1, len(shown)):
            shown[k] = seen.ux[k] if abs(seen.ux[k] - shown[k - 1]) > size else shown[k - 1]
        return replace(seen, ux=shown)

    return rig.with_fault(fault)


def _saturating(rig: Rig, size: float) -> Rig:
    """The amplifier bends over towards its end; the size is the share that it loses there."""

    def fault(seen: Seen) -> Seen:
        f = _fx(seen)
        top = np.abs(f).max()
        return added(seen, "fx_N", -size * top * (np.abs(f) / top) ** 6 * np.sign(f))

    return rig.with_fault(fault)


def _slip(share: float) -> Put:
    """A bolted joint slips once, in the middle of each sequence; mm of travel that is lost."""

    def put(rig: Rig, size: float) -> Rig:
        def fault(seen: Seen) -> Seen:
            n = len(seen.ux)
            after = np.arange(n) >= int(share * n)
            K = np.gradient(_fx(seen)) / np.where(np.gradient(seen.ux) == 0.0, np.inf, np.gradient(seen.ux))
            stiff = float(np.median(np.abs(K[K != 0.0]))) if np.any(K != 0.0) else 0.0
            return added(seen, "fx_N", np.where(after, -size * stiff, 0.0))

        return rig.with_fault(fault)

    return put


def _beat(period: float) -> Put:
    """A pump next door: an oscillation in the readings, slow by aliasing."""

    def put(rig: Rig, size: float) -> Rig:
        def fault(seen: Seen) -> Seen:
            return added(seen, "fx_N", size * np.sin(2 * np.pi * np.arange(len(seen.ux)) / period + seen.number))

        return rig.with_fault(fault)

    return put


def _clamping(shifts: Array) -> Put:
    """Every posture is clamped with another offset, mm."""

    def put(rig: Rig, size: float) -> Rig:
        return rig.with_fault(lambda seen: replace(seen, ux=seen.ux + size * shifts[seen.number]))

    return put


def _cross_talk(to: str) -> Put:
    def put(rig: Rig, size: float) -> Rig:
        return rig.with_fault(lambda seen: added(seen, to, size * _fx(seen)))

    return put
