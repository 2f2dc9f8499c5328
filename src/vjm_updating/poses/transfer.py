"""What findings are worth on other series of the same machine: nothing is refitted but frames and zeros."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.experiment.source import SheetError
from vjm_updating.poses.families import DRIFT, ZEROS, Member
from vjm_updating.poses.forward import ReadingsForward
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import SeriesStudy, Study

ROUNDS = numerical(8)
SETTLED = numerical(1e-4)
"""Relative change of the mean distance that ends the rounds."""
ZERO = prior_scale(10.0)
"""Of their units, 10 mrad, 1 mm or a tenth of the largest load: how well zeros of another series are known
beforehand."""


class Series:
    """Another series of the machine, ready to be predicted.

    Attributes:
        name: file of its readings.
        sigma: ``(g, k, 3)`` mm, standard deviations of its positions.
        study: its test.
    """

    def __init__(self, study: SeriesStudy, of: Study) -> None:
        """Prepare a series.

        Args:
            study: the other series.
            of: the test whose findings are judged.

        Raises:
            SheetError: it is of another machine.
        """
        self.name, self.sigma, self.study = study.data.file, study.data.sigma, study
        if study.data.joints != of.data.joints:
            raise SheetError(
                f"{study.sheet.file}: --beside takes series of the same machine: its joints are "
                f"{', '.join(study.data.joints)}, those of {of.sheet.file} are {', '.join(of.data.joints)}"
            )
        if study.machine.springs != of.machine.springs:
            raise SheetError(
                f"{study.sheet.file}: --beside takes series of the same machine: its model, or 'rigid', is another "
                f"than that of {of.sheet.file}"
            )

    def distances(self, study: Study, state: FittedState) -> Array:
        """Distances ``(g, k)`` mm of this series' markers by the members of a state of the test."""
        values = values_of(study, state)
        known = self.study.all_members
        forward = self.study.forward_of(self.study.machine, self.study.data)
        # a drift is of the series in which it was seen
        forward.members = [m for m in known if m.kind != DRIFT and (m.name in values or m.family in ZEROS)]
        z = np.array([values.get(m.name, 0.0) / m.scale for m in forward.members])
        zeros = [i for i, m in enumerate(forward.members) if m.family in ZEROS]
        if state.hypothesis.as_deflected:
            forward = forward.with_machine(self.study.machine_of(state.hypothesis.as_deflected))
        return refitted(self.study, forward, z, zeros)[0]


def values_of(study: Study, state: FittedState) -> Mapping[str, float]:
    """Members of a state by name, in rad, mm and so on."""
    pairs: list[tuple[Member, float]] = list(zip(study.members, state.z, strict=True))
    return {m.name: float(z) * m.scale for m, z in pairs if m.family in state.hypothesis.families}


def refitted(study: SeriesStudy, forward: ReadingsForward, z: Array, free: list[int]) -> tuple[Array, Array]:
    """Distances ``(g, k)`` mm of a test by given members, its frames and some of the members fitted, and weights.

    The weights ``(g, k)`` are those of outliers.

    Args:
        study: the test.
        forward: its model, with the members.
        z: ``(P,)`` their sizes, in their units.
        free: members that are fitted from there, known to `ZERO` units.
    """
    frames, last = study.frames, np.inf
    start = z[free].copy()
    z = z.copy()
    n = forward.nuisances
    root = np.concatenate([1.0 / study.prior, np.full(len(free), 1.0 / ZERO)])
    for _ in range(ROUNDS):
        at = forward.evaluate(z, frames)
        mean = float(np.nanmean(study.distance(at.residual)))
        if abs(last - mean) <= SETTLED * mean:
            break
        last = mean
        sigma, _ = study.noise(at)
        seen = np.isfinite(at.residual)
        J = np.concatenate([at.nuisance, at.member[..., free]], axis=3)[seen] / sigma[seen][:, None]
        y = at.residual[seen] / sigma[seen]
        held = np.concatenate([-at.off / study.prior, (start - z[free]) / ZERO])
        step = np.linalg.lstsq(np.vstack([J, np.diag(root)]), np.concatenate([y, held]), rcond=None)[0]
        frames = forward.moved(frames, step[:n])
        z[free] += step[n:]
    at = forward.evaluate(z, frames)
    return study.distance(at.residual), study.noise(at)[1]


def machine_of(study: SeriesStudy, chain: Machine) -> PoseMachine:
    """A machine, such as that of a model file, as it stands and as a test sees it."""
    return PoseMachine(chain, study.ends(), at_output=study.sheet.at_output)


def by_machine(study: Study, chain: Machine | None = None, *, zeros: bool = False) -> tuple[Array, Array]:
    """Distances ``(g, k)`` mm of a test by a machine, and the weights of outliers.

    Args:
        study: the test.
        chain: of the test's joints, such as that of a model file; None: the test's own, extended.
        zeros: whether zeros are fitted beside the frames.
    """
    if isinstance(study, SeriesStudy):
        return _by_machine(study, study.machine if chain is None else machine_of(study, chain), zeros=zeros)
    found = []
    for one in study.groups:
        if chain is not None and one.machine.chain.sha256 != study.machine.chain.sha256:
            # the file is of the first one's model: another load, or another base, is not in it
            found.append((np.full(one.aligned.shape, np.nan), np.ones(one.aligned.shape)))
        else:
            found.append(by_machine(one, chain, zeros=True))
    return study.joined_up([one[0] for one in found]), study.joined_up([one[1] for one in found])


def _by_machine(study: SeriesStudy, machine: PoseMachine, *, zeros: bool) -> tuple[Array, Array]:
    data = study.data
    # joints that the file has more are of the base, whose coordinates are zero
    q = np.zeros((len(data), len(machine.joints)))
    for i, name in enumerate(machine.joints):
        if name in data.joints:
            q[:, i] = data.q[:, data.joints.index(name)]
    there = replace(data, joints=machine.joints, q=q, torque=np.full(q.shape, np.nan))
    forward = study.forward_of(machine, there)
    if zeros:
        forward.members = [m for m in study.all_members if m.family in ZEROS]
    free = list(range(len(forward.members)))
    return refitted(study, forward, np.zeros(len(free)), free)
