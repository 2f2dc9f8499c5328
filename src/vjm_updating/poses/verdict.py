"""What a test says: which families are named, what remains, of which kind, and what to do next.

Contrasts that a person can read say what the residuals follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import assert_never

import numpy as np
from numpy.polynomial.legendre import legvander

from vjm.io.findings import Finding, Grade
from vjm.rotations import Array
from vjm_updating.constants import stated_level, tuned
from vjm_updating.diagnosis.document import SURE, PosteriorSample, credible
from vjm_updating.experiment.mistakes import columns_mistaken
from vjm_updating.inference.significance import CUT, f_logsf, level, median_sigma, more_than_noise, normal_isf
from vjm_updating.poses.changes import ChangeKind, ChangePoint
from vjm_updating.poses.document import HalvesRow, MemberRow, PoseContrastRow, RemainderRow
from vjm_updating.poses.families import DISPLACEMENT, DRIVES, WAVES
from vjm_updating.poses.fit import NO_FAMILY, solve
from vjm_updating.poses.held_out import as_good, halves
from vjm_updating.poses.identifiability import estimates
from vjm_updating.poses.plausibility import RobotMisses, weight_reversed
from vjm_updating.poses.selection import Selection
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

NOTED = stated_level(3.0)
"""Standard deviations from which on a contrast counts."""

FOLLOWED = {
    "actuator_compliance": ("torque of {part}", "torque"),
    "approach": ("way of approach of {part}", "approach"),
    "tracker_drift": ("{what}, evenly", "time"),
    "actuator_hardening": ("cube of the torque of {part}", "torque"),
    "tension_compression_asymmetry": ("size of the torque of {part}, not its sign", "one side"),
    "actuator_backlash": ("side to which {part} is loaded", "backlash"),
    "instrument_zero": ("a constant load", "load"),
    DISPLACEMENT: ("a constant displacement of {what}", "displacement"),
}
"""Of families, and of zeros of displacements, the name and the kind of the contrast that their members make."""


def contrasts(study: Study, state: FittedState) -> list[PoseContrastRow]:
    """All contrasts of a state's residuals, the largest share first."""
    blocks, n = state.blocks, state.blocks.nuisances
    left, Q = _left(state)
    asked: dict[tuple[str, str], list[Array]] = {}
    # columns are compared by their shapes: a torque that hardly changes has the shape of what makes it change
    weighed = {m.subject for m in study.members if m.family == DRIVES and m.name not in state.hypothesis.kept}
    for i, member in enumerate(study.members):
        column, part = blocks.J[:, [n + i]], member.subject
        if member.family in FOLLOWED:
            words, kind = FOLLOWED.get(member.kind, FOLLOWED[member.family])
            name = words.format(part=part, what=member.name.split(".")[1])
            asked.setdefault((name, kind), []).append(column)
        elif member.family == "joint_offset" and part in study.data.joints:
            j = study.data.joints.index(part)
            what = "angle" if part in study.machine.turning else "coordinate"
            q = study.data.q[:, j]
            middle, half = 0.5 * (q.max() + q.min()), max(0.5 * float(np.ptp(q)), 1e-12)
            # up to a degree of as many as a gear has waves
            smooth = legvander((q - middle) / half, len(WAVES))
            asked[f"{what} of {part}", "angle"] = [smooth[blocks.posture] * column]
            torque = np.nan_to_num(study.data.torque[:, j])
            if np.ptp(torque) > 0.0:
                asked[f"measured torque of {part}", "torque"] = [torque[blocks.posture][:, None] * column]
            if part in weighed:
                size = np.abs(state.linearised.torque[:, j])[blocks.posture][:, None]
                asked[f"size of the torque of {part}, not its sign", "one side"] = [size * column]
    result = [_share(name, kind, left, Q, np.hstack(columns)) for (name, kind), columns in asked.items()]
    result.append(_by_region(study, state, left, Q))
    if len(study.data.markers) > 1:
        result.append(shared(study, state))
    return sorted(result, key=lambda one: -one.share)


def changed(study: Study, state: FittedState) -> PoseContrastRow:
    """Whether the members that were fitted change evenly in the course of the file."""
    blocks, active = state.blocks, state.solution.active
    left, Q = _left(state)
    course = np.linspace(-1.0, 1.0, len(study.data))
    members = blocks.J[:, active[active >= blocks.nuisances]]
    return _share("course of the file", "drift", left, Q, members * course[blocks.posture][:, None])


def _left(state: FittedState) -> tuple[Array, Array]:
    """Whitened residuals ``(rows,)`` beyond the nuisances, and an orthonormal basis ``(rows, n)`` of those."""
    blocks, active = state.blocks, state.solution.active
    y = blocks.y - blocks.J[:, active] @ state.solution.z[active]
    Q = np.linalg.qr(blocks.J[:, : blocks.nuisances])[0]
    return y - Q @ (Q.T @ y), Q


def _share(name: str, kind: str, left: Array, Q: Array, columns: Array) -> PoseContrastRow:
    rest = columns - Q @ (Q.T @ columns)
    U, s, _ = np.linalg.svd(rest, full_matrices=False)
    U = U[:, s > 1e-8 * max(float(s.max(initial=0.0)), 1e-300)]
    explained, total = float(np.sum((U.T @ left) ** 2)), float(left @ left)
    share, significance = explained / max(total, 1e-300), _sigmas(explained, total, U.shape[1], len(left))
    return PoseContrastRow(name=name, kind=kind, share=share, significance=significance)


def _sigmas(explained: float, total: float, p: int, n: int) -> float:
    freedom = n - p
    if p == 0 or freedom <= 0 or total <= explained:
        return 0.0
    F = explained / p / ((total - explained) / freedom)
    chance = float(np.exp(f_logsf(F, p, freedom)))
    # of chances that have no digits any more, by the ratio of the likelihoods
    return normal_isf(chance) if chance > 0.0 else float(np.sqrt(n * np.log(total / (total - explained))))


def _by_region(study: Study, state: FittedState, left: Array, Q: Array) -> PoseContrastRow:
    """Mean residual of each region of joint space, for each number that a posture gives."""
    region = study.folds.region[state.blocks.posture]
    coordinate = np.broadcast_to(np.arange(6), study.present.shape)[study.present]
    marker = np.broadcast_to(np.arange(study.present.shape[1])[:, None], study.present.shape)[study.present]
    cell = (marker * 6 + coordinate) * (region.max() + 1) + region
    columns = (cell[:, None] == np.unique(cell)[None]).astype(float)
    return _share("region of joint space", "region", left, Q, columns)


def shared(study: Study, state: FittedState) -> PoseContrastRow:
    """Whether the markers' residuals move together, posture by posture."""
    residual, tilt = state.linearised.residual[..., :3], state.linearised.tilt[..., :3, :]
    explained = total = chance = 0.0
    for r, T in zip(residual, tilt, strict=True):
        seen = np.isfinite(r).all(axis=1)
        if seen.sum() < 2:
            continue
        y, A = r[seen].reshape(-1), T[seen].reshape(-1, 3)
        fit = A @ np.linalg.lstsq(A, y, rcond=None)[0]
        explained += float(fit @ fit)
        total += float(y @ y)
        chance += float(y @ y) * 3.0 / len(y)
    if total == 0.0:
        return PoseContrastRow(name="shared between markers", kind="shared", share=0.0, significance=0.0)
    share, expected = explained / total, chance / total
    beyond = (share - expected) / max(1.0 - expected, 1e-9)
    count = int(np.isfinite(residual).all(axis=(1, 2)).sum())
    # share of one posture: that of a beta distribution, whose mean over postures is nearly normal
    free = 3 * residual.shape[1]
    spread = np.sqrt(2.0 * expected * (1.0 - expected) / (free + 2.0) / max(count, 1))
    name = "shared between markers: one turn of what carries them"
    significance = float((share - expected) / spread)
    return PoseContrastRow(name=name, kind="shared", share=beyond, significance=significance)


NO_LAWS = ("drift", "shared")
"""Kinds of the residual that are of no law: what carries the markers, or a change in the course of the file."""
CONTRADICTS = ("one side", "torque")
"""Kinds of the residual that contradict a spring's law, and with it what was named."""
FOLLOWS = tuned(0.15)
"""Share of the residual that one contrast explains from which on a law is missing, and not scatter. A robot whose
causes are known leaves less than a tenth, whatever the series; one with another cause leaves a quarter and more."""
GEARS, SPRING = "gear_error", "point_spring"
NEXT = {
    "none": "The residual is noise: no further test is needed to find causes.",
    "open": "The residual is noise. Whether those families act that may act, only more postures can tell.",
    "surer": "The residual is noise: no further test is needed to find causes. The postures that are proposed "
    "would make the numbers more certain.",
    "class": "These postures cannot distinguish the families that are as good. Measure the postures below, with "
    "another load on the hand: a gear's error stays, what bends does not.",
    "shared": "The residual moves all markers together: friction or backlash in what carries them, or the tracker. "
    "Approach the same postures from both sides, log measured joints, keep the order in which they were taken.",
    "time": "The residual follows the clock: fix a marker to the base and measure it again and again.",
    "drift": "The halves of the file differ. Repeat the first postures at the end, with a marker on the base, to "
    "tell a change of the machine from one of the tracker.",
    "jump": "Measure a marker on the base before and after; cut the test at the change and give each "
    "part its own file.",
    "angle": "The residual follows a joint's angle: turn that joint alone through its range in "
    "steps, the others held. A gear errs so, or a spring between points that the model lacks, such as a gravity "
    "compensator.",
    "torque": "The residual follows a joint's torque beyond a spring's law. Put a known mass on the hand, in a few "
    "postures, and take it off.",
    "one side": "The residual follows the size of a joint's torque and not its sign: it deflects to one side more "
    "than to the other, as a crack or a loose bolt does. Load that joint alone, to either side, and look at it.",
    "backlash": "The residual follows the side to which a joint is loaded: load that joint alone, to either side, "
    "in small steps about zero.",
    "load": "The residual is a load's that is always there: read the force sensor without load, before and after.",
    "displacement": "The residual is always the same: read the displacements without load, before and after.",
    "approach": "The residual follows the way of approach: repeat postures from both sides.",
    "region": "The residual differs by the region of joint space: measure more postures there.",
    "scatter": "The residual follows nothing that was asked: repeat some postures ten times, from both sides, to "
    "tell backlash and friction from the tracker's noise.",
    "data": "Correct the data as said, and diagnose again.",
}


@dataclass(frozen=True)
class PoseVerdict:
    """The verdict.

    Attributes:
        kind: see the module.
        causes: families and couplings named.
        alternatives: for a class, other sets that are needed to hold the right one with 95 %.
        weighed: the hypothesis and those near it, with their probabilities.
        explained: share of the mean distance held out that the causes save, of the fit where nothing could be.
        remainder: the residual.
        halves: whether halves of the test agree.
        members: of the families named.
        findings: what is implausible about the data, a jump of the tracker's frame among it.
        next: what to do.
    """

    kind: str
    causes: tuple[str, ...]
    alternatives: tuple[tuple[str, ...], ...]
    weighed: tuple[PosteriorSample, ...]
    explained: float
    remainder: RemainderRow
    halves: HalvesRow | None
    members: list[MemberRow]
    findings: tuple[Finding, ...]
    next: str


def judge(
    selection: Selection, findings: Sequence[Finding], changes: Sequence[ChangePoint], *, fitted: bool
) -> PoseVerdict:
    """The verdict on a selection, given what the data are, and changes in the course of the series.

    ``fitted`` says whether the series were cut at these.
    """
    study, steps = selection.study, selection.steps
    first, last = steps[0].state, steps[-1].state
    doubtful = bool(columns_mistaken(findings))
    stepped = [said_of(one, fitted=fitted) for one in changes]
    jumped = next((one for one in stepped if one.grade is Grade.DOUBTFUL and not fitted), None)
    members = estimates(study, study.judged(last, gears=True))
    compared = None if doubtful else halves(study, last, members)
    differ = jumped is None and compared is not None and compared.differ
    drift = [changed(study, last)] if differ else []
    asked = sorted([*contrasts(study, last), *drift], key=lambda one: -one.share)
    rest = remainder_of(study, last, asked, jumped)
    before, after = (float(np.linalg.norm(state.errors.judged)) for state in (first, last))
    explained = 1.0 - after / before if before > 0.0 else 0.0
    causes = last.hypothesis.names
    weighed = _with_compensators(study, last, selection.weighed())
    alternatives = _alternatives(weighed, causes)
    misses = any(isinstance(one, RobotMisses) for one in findings)
    if doubtful or jumped is not None or (rest.significant and misses):
        kind = "unknown"
    elif not causes:
        kind = "unknown" if rest.significant else "none"
    elif rest.significant:
        # what markers share is friction, backlash or the tracker beside the causes, no other law of theirs;
        # nor is a change in the course of the file
        unexplained = rest.kind in CONTRADICTS or (rest.kind not in NO_LAWS and rest.share > FOLLOWS)
        # a part is explained where that is more of the squared error than the rest
        kind = "unknown" if unexplained or missing_more(first, last) else "partly"
    else:
        kind = "class" if alternatives else "named"
    # a drift that was found calls for a test, also where what it leaves is within the noise
    follows = "drift" if differ and rest.kind == "none" else rest.kind
    said = [*findings]
    said += stepped
    if jumped is None and not doubtful:
        said += doubts_of_fit(study, last, compared, members)
    if follows == "none" and any(set(one.places) - set(causes) for one in weighed if one.probability > 1.0 - SURE):
        follows = "open"
    doing = NEXT["data"] if doubtful else NEXT["class" if kind == "class" else follows]
    return PoseVerdict(
        kind, causes, alternatives, tuple(weighed), explained, rest, compared, members, tuple(said), doing
    )


def doubts_of_fit(
    study: Study, state: FittedState, compared: HalvesRow | None, members: Sequence[MemberRow]
) -> list[Finding]:
    """What a fit says against the data or the model.

    Joints deflect against the weight, or else members are at their bounds; and halves of the file, ``compared``,
    differ.
    """
    turned = list(weight_reversed(study, state))
    return [*turned, *_drifted(study, compared), *(() if turned else at_bounds(study, members))]


def _drifted(study: Study, compared: HalvesRow | None) -> Iterator[Finding]:
    """Halves of the file that differ by more than random ones."""
    if compared is None or not compared.differ:
        return
    names = ", ".join(f"{name} by {by:+.1f} standard deviations" for name, by in compared.members.items())
    yield Finding(
        Grade.DOUBTFUL,
        study.data.file,
        f"drift: the first half of the file and the second differ by more than halves drawn at random ({names}). "
        "The machine or the tracker changed, or the halves have other postures",
    )


def at_bounds(study: Study, members: Sequence[MemberRow]) -> Iterator[Finding]:
    """Members that the data want so far beyond their bounds as is no accident among so many."""
    for row in members:
        if row.beyond_bound <= level(len(members)) or not row.identifiable:
            continue
        low, high = row.interval95
        what = "stiffer than rigid" if row.value - low <= high - row.value else "softer than anything of its kind"
        if "compliance" not in row.name:
            what = "beyond what is possible"
        yield Finding(
            Grade.DOUBTFUL,
            f"{study.data.file}, {row.name}",
            f"wants to be {what} (by {row.beyond_bound:.1f} standard deviations): something else acts",
        )


def said_of(change: ChangePoint, *, fitted: bool) -> Finding:
    """A change in words, and whether the series was cut there: doubtful where it is a law's part, see `FOLLOWS`."""
    study = change.study

    def listed(values: Array) -> str:
        return ", ".join(f"{v:.3g}" for v in values)

    by = listed(change.size)
    match change.kind:
        case ChangeKind.SHIFT:
            name, words = study.jump
            words = words.format(by=by)
        case ChangeKind.FRAME:
            name, words = study.jump
            words = f"{words.format(by=listed(change.size[:3]))}, and turned by ({listed(change.size[3:])}) rad"
        case ChangeKind.MARKER:
            name = "marker_moved"
            words = f"from here on marker {change.name} stands ({by}) mm off on its body: it was moved"
        case ChangeKind.JOINT_ZERO:
            unit = "rad" if change.name in study.machine.turning else "mm"
            name, words = (
                "zero_moved",
                f"from here on {change.name} stands {by} {unit} off: its zero is another one",
            )
        case ChangeKind.LOAD_ZERO:
            name = "load_zero_moved"
            words = f"from here on the load on {change.name} is ({by}) N, N mm off: its zero moved"
        case _:
            assert_never(change.kind)
    if fitted:
        words += ". The series is cut here: in the fit each part has a number of its own for what changed"
    grade = Grade.DOUBTFUL if change.share > FOLLOWS else Grade.NOTED
    return Finding(grade, f"{study.data.file}, row {int(study.data.row[change.where])}", f"{name}: {words}")


def missing_more(first: FittedState, last: FittedState) -> bool:
    """Whether more of the squared error that is held out is left than explained."""
    before, after = (float(np.linalg.norm(state.errors.judged)) for state in (first, last))
    return 2.0 * after**2 > before**2


def remainder_of(
    study: Study, state: FittedState, asked: Sequence[PoseContrastRow], jumped: Finding | None
) -> RemainderRow:
    """The residual of a fit: whether it is more than noise, and which of the contrasts asked it follows.

    ``jumped`` is a change in the course of the file, where one is found.
    """
    scaled = np.abs(state.linearised.residual[..., :3] / study.data.sigma)[np.isfinite(study.data.position)]
    used = state.blocks.nuisances + sum(state.solution.effective.values())
    freedom = len(scaled) * max(1.0 - used / max(state.blocks.count, 1), 0.1)
    # a few that scatter far are not what all have in common
    cut = CUT * median_sigma(scaled)
    over = float(np.sqrt(np.sum(np.minimum(scaled, cut) ** 2) / freedom))
    if jumped is not None:
        return RemainderRow(over_noise=over, significant=True, kind="jump", words=str(jumped), share=0.0)
    if not more_than_noise(over, freedom):
        words = f"the residual scatters by {over:.2f} times the noise that the sheet says"
        return RemainderRow(over_noise=over, significant=False, kind="none", words=words, share=0.0)
    noted = [c for c in asked if c.significance > NOTED]
    laws = [c for c in noted if c.kind not in NO_LAWS]
    largest = max((c.share for c in laws), default=0.0)
    # what a law does moves the markers together, too, and so does a change of the members
    wholes = sorted((c for c in noted if c.kind in NO_LAWS and c.share >= largest), key=lambda c: c.kind)
    best = next(iter([*wholes, *sorted(laws, key=lambda c: -c.significance)]), None)
    what = (
        "it follows nothing that was asked" if best is None else f"it follows {best.name} ({best.share:.0%} of it)"
    )
    words = f"the residual scatters by {over:.1f} times the noise that the sheet says; {what}"
    kind, share = ("scatter", 0.0) if best is None else (best.kind, best.share)
    return RemainderRow(over_noise=over, significant=True, kind=kind, words=words, share=share)


def _alternatives(weighed: Sequence[PosteriorSample], causes: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Other sets of families that are needed to hold the right one with 95 %, the likeliest first.

    None that says the same with more families.
    """
    best, p = frozenset(causes), dict[frozenset[str], float]()
    for one in weighed:
        names = frozenset(one.places)
        p[names] = p.get(names, 0.0) + one.probability
    sets = credible(best, p, lambda one, rival: len(rival) > len(one))
    return tuple(tuple(sorted(names)) for names in sets if names != best)


def _with_compensators(
    study: Study, state: FittedState, weighed: Sequence[PosteriorSample]
) -> list[PosteriorSample]:
    """The same, with a spring between points in place of errors of the gears where these are waves of one joint.

    A gravity compensator that the model lacks turns the drive of a joint that bears weight by a function of the
    joint's angle. It does what these waves do, so that both share the probability.
    """
    springs = _compensated(study, state) if GEARS in state.hypothesis.families else []
    result = []
    for one in weighed:
        if not springs or set(one.places) != set(state.hypothesis.names):
            result.append(one)
            continue
        share = one.probability / (1 + len(springs))
        others = [
            {(joint if name == GEARS else name): place for name, place in one.places.items()} for joint in springs
        ]
        result += [PosteriorSample(places, share) for places in (one.places, *others)]
    return result


def _compensated(study: Study, state: FittedState) -> list[str]:
    """Springs between points that do as well as all the gears' errors."""
    loaded = {member.subject for member in study.members if member.family == "actuator_compliance"}
    own = {member.subject for member in study.members if member.family == GEARS}
    blocks, n, result = state.blocks, state.blocks.nuisances, []
    for joint in sorted(own & loaded):
        others = [n + i for i, m in enumerate(study.members) if m.family == GEARS and m.subject != joint]
        family = blocks.family.copy()
        family[others] = NO_FAMILY
        alone = replace(blocks, family=family)
        solution = solve(alone, study.numbers(state.hypothesis), state.solution.sizes)
        if as_good(study.errors(alone, solution, state.sigma), state.errors, state.sigma):
            result.append(f"{SPRING}.{joint}")
    return result
