"""The one experiment that a diagnosis proposes, done: its readings are added to the test."""

import re
from dataclasses import replace
from typing import Any

import numpy as np

from hidden_effects.designs import REMOUNTING
from hidden_effects.virtual_rig import POSTURES, Design, Sequence

STEPS, WAITS = 12, 5
"""Readings on each way, and while held."""
_MOVE = re.compile(r"(pull and push|pull|push) to (-?[0-9.eE+-]+) mm")
_TIMES = re.compile(r", (\d+) times")


class NoExperimentError(ValueError):
    """A proposal cannot be carried out."""


def extended(design: Design, proposal: dict[str, Any]) -> Design:
    """The design with a proposed experiment at its end.

    Args:
        design: that was diagnosed.
        proposal: ``next_experiment``: ``posture`` and a ``path`` such as ``pull and push to 2 mm, out, held and
            back``, or ``…, 4 times``.

    Raises:
        NoExperimentError: posture or path say nothing.
    """
    posture, path = str(proposal.get("posture", "")), str(proposal.get("path", ""))
    found = _MOVE.search(path)
    if posture not in POSTURES or found is None:
        raise NoExperimentError(f"nothing can be done with posture '{posture}', path '{path}'")
    reach = abs(float(found[2]))
    ends = {"pull and push": (reach, -reach), "pull": (reach,), "push": (-reach,)}[found[1]]
    ux, time = [0.0], [0.0]
    times = _TIMES.search(path)
    for end in ends * (int(times[1]) if times else 1):
        ways = [np.linspace(0.0, end, STEPS + 1)[1:], np.full(WAITS, end), np.linspace(end, 0.0, STEPS + 1)[1:]]
        for way, pace in zip(ways, (5.0, 60.0, 5.0), strict=True):
            ux += way.tolist()
            time += (time[-1] + pace * np.arange(1, len(way) + 1)).tolist()
    last = design.sequences[-1]
    clock = last.time[-1] + REMOUNTING + np.array(time)
    warm = np.full(len(ux), last.temperature[-1])
    return replace(design, sequences=(*design.sequences, Sequence(posture, np.array(ux), clock, warm)))
