"""What a test says: which families are named, what remains, of which kind, and what to do next.

``none``: the rigid model of the sheet explains the readings, nothing pays. ``named``: what was added explains
them to their noise. ``class``: it does, but other families in its place save as much. ``partly``: it saves at
least seven tenths of the error held out, and what remains is more than noise. ``unknown``: it saves less, or the
data are not what they seem.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm_updating.poses.contrasts import LEAST_SHARED, NOTED, Contrast, abrupt, contrasts, jump, jump_size
from vjm_updating.poses.ladder import ALIKE, Step
from vjm_updating.poses.plausibility import missed, mistaken, weight_reversed
from vjm_updating.poses.study import MEDIAN_TO_SIGMA, State, Study

MORE_THAN_NOISE = 1.3
"""Scatter of what is left over the noise that the sheet says, from which on something remains."""
AS_GOOD = 1.005
"""Error held out of another set over that of the set named up to which it explains the data alike: the paired
differences of a hundred postures have standard errors of half a percent."""
EXPLAINS = 0.7
"""Share of the error held out beyond the noise that named families save at least."""
JUMP = "tracker_jump"
JUMPS = 8.0
"""Significance of a jump of the tracker's frame: the largest of a thousand places stays below 5 without one."""
SMALLEST_JUMP = 2.0
"""Of a jump, over the scatter of what is left."""
ONE_SIDE = 4.0
"""Standard deviations from which on what is left follows the size of a joint's torque: against springs."""
LEAST_SHARE = 0.03
"""Share of what is left that a contrast must explain to be spoken of."""

NEXT = {
    "none": "Nothing calls for another test.",
    "shared": "What is left moves all markers together: friction or play in what carries them, or "
    "the tracker. Approach "
    "the same postures from both sides, log measured joints, keep the order in which they were taken.",
    "time": "What is left follows the clock: fix a marker to the base and measure it again and again.",
    "jump": "Measure a marker on the base before and after; cut the test at the jump and give each "
    "part its own file.",
    "angle": "What is left follows a joint's angle: turn that joint alone through its range in "
    "steps, the others held.",
    "torque": "What is left follows a joint's torque beyond a spring's law: put a known mass on the "
    "hand, in a few "
    "postures, and take it off.",
    "one side": "What is left follows the size of a joint's torque and not its sign: it gives way to one side more "
    "than to the other, as a crack or a loose bolt does. Load that joint alone, to either side, and look at it.",
    "backlash": "What is left follows the side to which a joint is loaded: load that joint alone, to either side, "
    "in small steps about zero.",
    "load": "What is left is a load's that is always there: read the force sensor without load, before and after.",
    "approach": "What is left follows the way of approach: repeat postures from both sides.",
    "region": "What is left differs by the region of joint space: measure more postures there.",
    "scatter": "What is left follows nothing that was asked: repeat some postures ten times, from "
    "both sides, to tell "
    "play and friction from the tracker's noise.",
    "data": "Mend the data as said, and diagnose again.",
}


@dataclass(frozen=True)
class Remainder:
    """What is left at the end.

    Attributes:
        over_noise: its scatter over the noise that the sheet says.
        significant: whether it is more than that.
        kind: a key of `NEXT`.
        words: one sentence.
    """

    over_noise: float
    significant: bool
    kind: str
    words: str


@dataclass(frozen=True)
class PoseVerdict:
    """The verdict.

    Attributes:
        kind: see the module.
        causes: families and couplings named.
        alternatives: for a class, sets that save about as much.
        explained: share of the error held out beyond the noise that they save.
        remainder: what is left.
        findings: what is implausible about the data, a jump of the tracker's frame among it.
        next: what to do.
    """

    kind: str
    causes: tuple[str, ...]
    alternatives: tuple[tuple[str, ...], ...]
    explained: float
    remainder: Remainder
    findings: tuple[Finding, ...]
    next: str


def judge(study: Study, steps: Sequence[Step], findings: Sequence[Finding]) -> PoseVerdict:
    """The verdict of a ladder, the data being what their findings say."""
    first, last = steps[0].state, steps[-1].state
    doubtful = mistaken(findings)
    jumped = None
    # a drift would make up for half of a jump
    still = next(step.state for step in reversed(steps) if "tracker_drift" not in step.state.hypothesis.families)
    where, size, significance = jump(study, still)
    if (
        not doubtful
        and significance > JUMPS
        and np.linalg.norm(size) > SMALLEST_JUMP * scatter(still)
        and abrupt(still, where)
    ):
        row = int(study.data.row[where])
        text = ", ".join(f"{v:.3g}" for v in jump_size(still, where))
        jumped = Finding(
            Grade.DOUBTFUL,
            f"{study.data.file}, row {row}",
            f"{JUMP}: from here on all markers stand ({text}) mm off: the tracker's frame jumped",
        )
    rest = _remainder(study, last, contrasts(study, last), jumped)
    floor = noise_distance(study)
    before, after = (float(np.hypot(*state.errors.means[1:]) / np.sqrt(2.0)) for state in (first, last))
    explained = 1.0 - max(after - floor, 0.0) / max(before - floor, 1e-12) if before > floor else 1.0
    causes = last.hypothesis.names
    alternatives = _alternatives(study, steps, causes)
    if doubtful or jumped is not None or (rest.significant and missed(findings)):
        kind = "unknown"
    elif not causes:
        kind = "unknown" if rest.significant else "none"
    elif rest.significant:
        kind = "partly" if explained >= EXPLAINS and rest.kind != "one side" else "unknown"
    else:
        kind = "class" if alternatives else "named"
    doing = NEXT["data"] if doubtful else NEXT[rest.kind]
    said = [*findings]
    if jumped is not None:
        said.append(jumped)
    elif not doubtful:
        said += weight_reversed(study, last)
    return PoseVerdict(kind, causes, alternatives, explained, rest, tuple(said), doing)


def scatter(state: State) -> float:
    """Robust standard deviation of a coordinate of the markers' residuals, mm."""
    return MEDIAN_TO_SIGMA * float(np.nanmedian(np.abs(state.at.residual[..., :3])))


def noise_distance(study: Study) -> float:
    """Mean distance in mm that the sheet's noise alone makes."""
    seen = np.isfinite(study.data.position)
    square = np.where(seen, study.data.sigma**2, 0.0).sum(axis=2)
    return (
        float(np.mean(np.sqrt(square[seen.any(axis=2)]))) * 0.92
    )  # of a normal vector the mean over the root square


def _remainder(study: Study, state: State, asked: Sequence[Contrast], jumped: Finding | None) -> Remainder:
    seen = np.isfinite(study.data.position)
    noise = float(np.median(study.data.sigma[seen]))
    used = state.blocks.nuisances + sum(state.solution.effective.values())
    freedom = max(1.0 - used / max(state.blocks.count, 1), 0.1)
    ratio = scatter(state) / noise / np.sqrt(freedom)
    rms = float(np.sqrt(np.nanmean((state.at.residual[..., :3] / study.data.sigma) ** 2) / freedom))
    over = max(ratio, min(rms, 1.5 * ratio))
    if jumped is not None:
        return Remainder(over, True, "jump", str(jumped))
    if over < MORE_THAN_NOISE:
        return Remainder(
            over, False, "none", f"what is left scatters by {over:.2f} times the noise that the sheet says"
        )
    noted = [c for c in asked if c.significance > NOTED and c.share > LEAST_SHARE]
    ranked = (
        *(c for c in noted if c.kind == "shared" and c.share > LEAST_SHARED),
        *(c for c in noted if c.kind == "one side" and c.significance > ONE_SIDE),
        *(c for c in noted if c.kind not in ("shared", "one side")),
    )
    best = next(iter(ranked), None)
    what = (
        "it follows nothing that was asked" if best is None else f"it follows {best.name} ({best.share:.0%} of it)"
    )
    return Remainder(
        over, True, "scatter" if best is None else best.kind,
        f"what is left scatters by {over:.1f} times the noise that the sheet says; {what}",
    )  # fmt: skip


def _alternatives(study: Study, steps: Sequence[Step], causes: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Sets in which one of the families named is another, and postures held out are predicted as well.

    Others are tried where they would have saved about as much when the family was added.
    """
    state, result = steps[-1].state, []
    for below, above in itertools.pairwise(steps):
        own = next((one for one in below.trials if one.name == above.added), None)
        if own is None or own.name not in causes:
            continue
        for one in below.trials:
            if one.name in causes or not one.pays or one.gain < ALIKE * own.gain:
                continue
            _, errors = study.tried(state, state.hypothesis.minus(own.name).plus(one.name))
            pairs = zip(errors.means[1:], state.errors.means[1:], strict=True)
            if all(other <= AS_GOOD * named for other, named in pairs):
                result.append(tuple(one.name if name == own.name else name for name in causes))
    return tuple(result)
