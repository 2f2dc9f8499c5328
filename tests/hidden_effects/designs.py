"""Designs of a test: which postures, which displacements in which order, which channels, how good the instruments.

A design is drawn from a seed: from one ramp in one posture with one channel to bipolar cycles with holds in four
postures, six channels and a temperature that wanders. Every posture is mounted afresh, unloaded, and read in one
unbroken sequence.
"""

from dataclasses import replace

import numpy as np

from hidden_effects.virtual_rig import POSTURES, WRENCH, Design, Known, Sequence
from vjm.rotations import Array

REACH = {"A": (1.4, 2.2), "B": (3.0, 3.0), "C": (0.3, 0.42), "D": (2.5, 2.5)}
"""mm of pull and push to which a posture is taken at most, short of where the column buckles."""
BEYOND = {"A": 3.4, "C": 0.62}
"""mm of push behind the critical point, for the few designs that go there."""
REMOUNTING = 300.0
"""s between two postures."""
CHANNELS = (("fx_N",), ("fx_N", "fy_N", "fz_N"), ("fx_N", "fz_N", "my_Nmm"), WRENCH)
HOLD_READINGS = 5


def draw(seed: int, kind: str | None = None, *, lumped_link: bool = False) -> Design:
    """A design."""
    rng = np.random.default_rng([seed, 11])
    kind = kind or str(rng.choice(list(KINDS), p=list(KINDS.values())))
    count = {"ramp": 1, "bipolar": 1, "cycles": 1, "two postures": 2, "three postures": 3, "four postures": 4}[kind]
    # A, the posture that everybody tests, twice as often where there is but one
    several = [str(label) for label in rng.permutation(list(POSTURES))[:count]]
    postures = several if count > 1 else [str(rng.choice(list("AABCD")))]
    beyond = count == 1 and postures[0] in BEYOND and bool(rng.random() < 0.25) and not lumped_link
    one_way = float(rng.choice([-1.0, 1.0])) if kind == "ramp" else 0.0
    reach = rng.uniform(0.75, 1.0)
    holds = kind in ("cycles", "three postures", "four postures") or bool(rng.random() < 0.3)
    cycles = 2 if kind == "cycles" or (count < 3 and rng.random() < 0.25) else 1
    steps = {1: 22, 2: 11, 3: 8, 4: 7}[count] if kind != "cycles" else 13
    pace = float(rng.choice([1.0, 2.0, 5.0]))
    clock, sequences = 0.0, []
    for posture in sorted(postures):
        pull, push = REACH[posture]
        if beyond:
            push = BEYOND[posture]
        ends = (reach * pull, -reach * push)
        ux, time = _path(ends, one_way, cycles, steps, pace, holds)
        time = clock + REMOUNTING + time
        clock = float(time[-1])
        sequences.append(Sequence(posture, ux, time, np.zeros(len(ux))))
    wander = rng.uniform(0.5, 3.0), rng.uniform(0.7, 2.5), rng.uniform(0.0, 2.0 * np.pi)
    sequences = [replace(s, temperature=_temperature(s.time, clock, wander)) for s in sequences]
    channels = CHANNELS[int(rng.choice(4, p=[0.2, 0.3, 0.15, 0.35]))]
    better = float(rng.choice([0.5, 1.0, 2.0]))
    instruments = {"ux_mm": Known(0.0005 * better, 0.002, 0.001)}
    for name in channels:
        instruments[name] = (
            Known(2.0 * better, 3.0, 0.003) if name[0] == "f" else Known(150.0 * better, 300.0, 0.003)
        )
    return Design(
        seed,
        kind,
        tuple(sequences),
        instruments,
        link_segments=1 if lumped_link else 12,
        foot_segments=int(rng.choice([1, 8])),
        drive=float(rng.choice([0.0, 5e-5, 1e-4])),
        length=float(rng.choice([0.1, 0.2])),
        modulus=float(rng.choice([0.01, 0.02])),
        autocorrelation=float(rng.choice([0.0, 0.3, 0.6, 0.8])),
        quantum=float(rng.choice([0.0, 0.0, 0.5, 1.0])),
        outliers=float(rng.choice([0.0, 0.005, 0.015])),
        missing=float(rng.choice([0.0, 0.01, 0.03])),
        side=float(rng.choice([-1.0, 1.0])),
    )


KINDS = {
    "ramp": 0.12,
    "bipolar": 0.18,
    "cycles": 0.2,
    "two postures": 0.2,
    "three postures": 0.15,
    "four postures": 0.15,
}
"""And how often they are drawn."""


def _path(
    ends: tuple[float, float], one_way: float, cycles: int, steps: int, pace: float, holds: bool
) -> tuple[Array, Array]:
    """Displacements and times of a sequence that starts unloaded.

    Args:
        ends: largest pull and push, mm.
        one_way: −1 or 1: one ramp that way; 0: there and back on both sides.
        cycles: how often.
        steps: from the middle to an end.
        pace: s a step.
        holds: whether the ends are held for minutes.
    """
    there = [ends[0] if one_way > 0 else ends[1]]
    turns = there if one_way else [*([ends[0], ends[1]] * cycles), 0.0]
    ux, time, here, now = [0.0], [0.0], 0.0, 0.0
    for end in turns:
        span = ends[0] if end > 0 or (end == 0.0 and here > 0) else -ends[1]
        count = max(2, round(steps * abs(end - here) / span)) if not one_way else 2 * steps
        count = min(count, 2 * steps)
        for k in range(1, count + 1):
            now += pace
            ux.append(here + (end - here) * k / count)
            time.append(now)
        here = end
        if holds and end != 0.0:
            for wait in np.geomspace(10.0, 400.0, HOLD_READINGS):
                ux.append(end)
                time.append(now + float(wait))
            now += 400.0
    return np.array(ux), np.array(time)


def _temperature(time: Array, whole: float, wander: tuple[float, float, float]) -> Array:
    """A room that warms up and oscillates."""
    warming, cycles, phase = wander
    share = time / max(whole, 1.0)
    result: Array = 21.0 + warming * (share + 0.6 * (np.sin(2 * np.pi * cycles * share + phase) - np.sin(phase)))
    return result


def small_design() -> Design:
    """Two postures, one ramp to each side, three channels: small enough for dense algebra in a test."""
    ux = np.concatenate([np.linspace(0, 1.0, 5), np.linspace(0.5, -1.0, 5)])
    steps = np.arange(10, dtype=np.float64)
    sequences = tuple(
        Sequence(label, reach * ux, 300.0 * (k + 1) + 40.0 * k + 2.0 * steps, 21.0 + 0.1 * steps**1.5)
        for k, (label, reach) in enumerate((("A", 1.2), ("B", 2.5)))
    )
    instruments = {"ux_mm": Known(0.001, 0.002, 0.001)}
    instruments |= dict.fromkeys(("fx_N", "fy_N", "fz_N"), Known(2.0, 3.0, 0.003))
    return Design(seed=10**6, kind="small", sequences=sequences, instruments=instruments, drive=5e-5)
