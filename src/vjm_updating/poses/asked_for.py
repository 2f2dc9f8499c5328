"""What a model file errs by where it will be used: with it, without it, and whether the postures support that.

The members of the file are drawn from their posterior distribution, with the scatter of a new series. What they
move the markers by, beyond the file's own values, is one part of the error. What the model lacks is the other: as
much as regions that were held out missed beyond the noise. Without the file, the file's numbers are an error too.

Frames of tracker and markers are those of the calibration. So what they can take up over the joints' whole range
does not count.

An arm reaches a place in several configurations. The likely one is that whose posture is nearest to a measured one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.plain_numbers import plain_number
from vjm.postures import tool_postures
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm_updating.constants import numerical, stated_level
from vjm_updating.poses.between import between
from vjm_updating.poses.document import AskedForRow, AskedPlaceRow
from vjm_updating.poses.identifiability import marginals
from vjm_updating.poses.kinds import PreparedTest
from vjm_updating.poses.posture_noise import places
from vjm_updating.poses.state import Candidates
from vjm_updating.poses.study import Study
from vjm_updating.poses.support import COUNT, effects, whole_range
from vjm_updating.poses.written import Written

AXES = ("x", "y", "z")
STEPS = numerical(3)
"""Places along an axis of which a range is given."""
DRAWS = numerical(1000)
SEED = numerical(19)
ROUNDED = numerical(1e-9)
"""rad or mm: a coordinate at an end of a range lies within it."""
MOST = stated_level(0.95)
"""Share of errors that lie below what is said to be the largest."""


@dataclass(frozen=True)
class AskedPostures:
    """Postures of which a prediction is wanted.

    Attributes:
        candidates: they.
        place: ``(c,)`` number of the place that each reaches; of a file each is one.
    """

    candidates: Candidates
    place: np.ndarray


def asked_candidates(test: PreparedTest, study: Study, asked: str | Path) -> AskedPostures:
    """Postures of which a prediction is wanted.

    Args:
        test: that was read.
        study: as it was fitted.
        asked: a CSV file of postures; or places of the end in the base's axes, mm, as ``x=400,y=0:200,z=300``, a
            range as its two ends.

    Raises:
        ValueError: it cannot be used, or no posture reaches a place; one line.
    """
    if isinstance(asked, Path):
        listed = test.candidates(asked)
        return AskedPostures(listed, np.arange(len(listed)))
    machine = test.measurement.model.chain
    found: list[list[float]] = []
    number: list[int] = []
    missed: list[str] = []
    for i, place in enumerate(_places(asked)):
        try:
            found += [[row[name] for name in study.data.joints] for row in tool_postures(machine, place)]
            number += [i] * (len(found) - len(number))
        except (ValueError, NoConvergenceError) as error:
            missed.append(str(error))
    if not found:
        raise ValueError(f"--for {asked}: no posture reaches there: {missed[0]}")
    q = np.array(found)
    keep = study.machine.tree.limits.kept(study.machine.rows(q))
    if not keep.any():
        raise ValueError(f"--for {asked}: all postures that reach there lie beyond the joints' limits")
    drawn = study.drawn(np.random.default_rng(SEED), 1)
    reached = Candidates(q[keep], np.repeat(drawn.load * 0.0, int(keep.sum()), axis=0))
    return AskedPostures(reached, np.array(number)[keep])


def _likely(study: Study, asked: AskedPostures) -> np.ndarray:
    """Which postures ``(c,)`` are the nearest to a measured one of all that reach their place."""
    turning = np.array([name in study.machine.turning for name in study.data.joints])
    apart = asked.candidates.q[:, None] - study.data.q
    apart = np.where(turning, (apart + np.pi) % (2.0 * np.pi) - np.pi, apart)
    distance = np.linalg.norm(places(apart, turning), axis=2).min(axis=1)
    result = np.zeros(len(distance), dtype=bool)
    for number in np.unique(asked.place):
        own = np.flatnonzero(asked.place == number)
        result[own[np.argmin(distance[own])]] = True
    return result


def _places(asked: str) -> list[tuple[float, ...]]:
    """Places ``(x, y, z)`` mm of a text."""
    given: dict[str, list[float]] = {}
    for word in asked.split(","):
        axis, equals, text = word.partition("=")
        try:
            ends = [plain_number(end) for end in text.split(":")]
        except ValueError:
            ends = []
        if not equals or axis.strip() not in AXES or len(ends) not in (1, 2) or not np.all(np.isfinite(ends)):
            raise ValueError(
                f"--for: '{word}' is no place: write x=400,y=0:200,z=300 in mm. An axis is a number or LOW:HIGH. "
                "Or name a CSV file of postures"
            )
        given[axis.strip()] = np.linspace(ends[0], ends[-1], STEPS).tolist() if len(ends) == 2 else ends
    if missing := [axis for axis in AXES if axis not in given]:
        raise ValueError(f"--for: {', '.join(missing)} is missing: write all of x=…,y=…,z=…")
    return [(x, y, z) for x in given["x"] for y in given["y"] for z in given["z"]]


def predicted(
    study: Study, model: Written, wanted: AskedPostures, within: Mapping[str, tuple[float, float]]
) -> AskedForRow:
    """Errors in postures with and without the file.

    Args:
        study: as it was fitted.
        model: the file.
        wanted: the postures.
        within: measured ranges of joints that reach much further, rad or mm, by name.

    Raises:
        vjm.errors.NoConvergenceError: a posture has no equilibrium.
    """
    there, state, asked = model.study, model.state, wanted.candidates
    active, n = state.solution.active, state.blocks.nuisances
    drawn = there.drawn(np.random.default_rng(SEED), COUNT, whole_range(there))
    both = Candidates(np.concatenate([drawn.q, asked.q]), np.concatenate([drawn.load, asked.load]))
    J = effects(there, state, both)[len(drawn) :, :, :, active[n:] - n]
    # the first marker, which rides where the tool is
    J = J[:, 0]
    change, off = J @ state.solution.z[active[n:]], _off(there, model)
    lack = _lack(there, model)
    rng = np.random.default_rng(SEED)
    error = np.einsum("gap,dp->dga", J, off) + lack / np.sqrt(3.0) * rng.standard_normal((DRAWS, len(asked), 3))
    without = np.linalg.norm(error + change, axis=2)
    with_it = np.linalg.norm(error, axis=2)
    place = unloaded_frames(there.machine.tree, there.machine.rows(asked.q))[1][:, 0]
    rows, likely = [], _likely(study, wanted)
    for i, q in enumerate(asked.q):
        beyond = [
            name
            for name, value in zip(study.data.joints, q, strict=True)
            if name in within and not _inside(float(value), within[name], turns=name in study.machine.turning)
        ]
        before, after = _mean(without[:, i]), _mean(with_it[:, i])
        reason = f"beyond what was measured of {', '.join(beyond)}" if beyond else ""
        if not reason and after >= before:
            reason = "the numbers are not known well enough here: the file is no better than the model"
        rows.append(
            AskedPlaceRow(
                q=q.tolist(), place_mm=place[i].tolist(), without_mm=before, with_mm=after,
                most_mm=float(np.quantile(with_it[:, i], MOST)), supported=not reason, reason=reason,
                likely=bool(likely[i]),
            )
        )  # fmt: skip
    own = likely & np.array([row.supported for row in rows])
    own = own if own.any() else likely
    return AskedForRow(
        joints=list(study.data.joints), without_mm=_mean(without[:, own]), with_mm=_mean(with_it[:, own]),
        most_mm=float(np.quantile(with_it[:, own], MOST)), lack_mm=lack,
        asked=int(likely.sum()), supported=sum(row.supported and row.likely for row in rows),
        places=rows,
    )  # fmt: skip


def _off(study: Study, model: Written) -> Array:
    """Draws ``(d, p)`` of what the members of the file are off, those of a new series, in their units."""
    state, n = model.state, model.state.blocks.nuisances
    scatter = between(study, model.fitted)[1]
    noted = marginals(state.blocks, state.solution, state.noise)
    step = max(len(noted.draws) // DRAWS, 1)
    draws = noted.draws[::step][:DRAWS]
    off = draws[:, n:] - state.solution.z[state.solution.active[n:]]
    for k, u in enumerate(state.solution.active[n:]):
        rng = np.random.default_rng([SEED, k])
        place = int(u) - n
        off[:, k] += rng.permutation(scatter.draws(study.members[place].family, place, len(off)))
    return off


def _lack(study: Study, model: Written) -> float:
    """Root mean square that the model lacks, mm: what regions that were held out missed, less the noise."""
    errors, weight = model.state.errors.region, model.state.weight
    seen = np.isfinite(errors)
    if not seen.any():
        return 0.0
    missed2 = float(np.average(errors[seen] ** 2, weights=weight[seen]))
    noise2 = 3.0 * float(np.nanmedian(study.data.sigma**2))
    return float(np.sqrt(max(missed2 - noise2, 0.0)))


def _inside(value: float, ends: tuple[float, float], *, turns: bool) -> bool:
    """Whether a coordinate lies within a range; an angle a turn further is the same."""
    whole = 2.0 * np.pi if turns else np.inf
    return ends[0] - ROUNDED <= value <= ends[1] + ROUNDED or bool(
        turns and (value - ends[0]) % whole <= ends[1] - ends[0] + ROUNDED
    )


def _mean(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))
