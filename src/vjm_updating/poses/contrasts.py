"""Contrasts that a person can read: what the residuals of a test follow.

Each is the share of the whitened squared residual that a few columns explain beyond the nuisances. Columns are
turns of one joint as a smooth function of its angle, its turn in proportion to its torque, by the direction of
approach, a drift of the tracker, or a mean by region. Its significance is the F statistic turned into standard
deviations of the normal distribution. *Shared between markers* asks whether one free turn of the body that carries
all of them, posture by posture, explains more than as many free numbers of any kind would: residuals that move
together belong to what the markers share.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander

from vjm.rotations import Array
from vjm_updating.constants import stated_level
from vjm_updating.observation.significance import f_logsf, normal_isf
from vjm_updating.poses.document import PoseContrastRow
from vjm_updating.poses.families import DRIVES, WAVES
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
}
"""Of families, the name and the kind of the contrast that their members' columns make."""


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
            words, kind = FOLLOWED[member.family]
            name = words.format(part=part, what=member.name.split(".")[1])
            asked.setdefault((name, kind), []).append(column)
        elif member.family == "joint_offset" and part in study.data.joints:
            j = study.data.joints.index(part)
            what = "angle" if part in study.machine.turning else "coordinate"
            asked[f"{what} of {part}", "angle"] = [_smooth(study.data.q[:, j])[blocks.posture] * column]
            torque = np.nan_to_num(study.data.torque[:, j])
            if np.ptp(torque) > 0.0:
                asked[f"measured torque of {part}", "torque"] = [torque[blocks.posture][:, None] * column]
            if part in weighed:
                size = np.abs(state.at.torque[:, j])[blocks.posture][:, None]
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


def _smooth(q: Array) -> Array:
    """Legendre's polynomials ``(g, 5)`` of a coordinate, up to a degree of as many as a gear has waves."""
    middle, half = 0.5 * (q.max() + q.min()), max(0.5 * float(np.ptp(q)), 1e-12)
    result: Array = legvander((q - middle) / half, len(WAVES))
    return result


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
    residual, tilt = state.at.residual[..., :3], state.at.tilt[..., :3, :]
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


def correlations(study: Study, state: FittedState) -> list[float]:
    """Correlation of the first two markers' residuals along each axis of the tracker, ``(3,)``."""
    if len(study.data.markers) < 2:
        return []
    a, b = state.at.residual[:, 0, :3], state.at.residual[:, 1, :3]
    both = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    if both.sum() < 3:
        return []
    return [float(np.corrcoef(a[both, i], b[both, i])[0, 1]) for i in range(3)]
