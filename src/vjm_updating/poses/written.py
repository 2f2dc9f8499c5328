"""The model file as judged: written, read back, evaluated on the readings, and held against what no machine is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vjm.io.findings import Finding, Grade
from vjm.io.mjcf_text import mjcf_text
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import model_findings
from vjm.io.toml_parsing import parse_toml
from vjm.io.toml_text import toml_text
from vjm.io.urdf_text import urdf_text
from vjm.model.chain import Chain
from vjm_updating.poses.calibrated import NO_WORD, calibrated_document
from vjm_updating.poses.families import VALUE
from vjm_updating.poses.fit import solve
from vjm_updating.poses.identifiability import MemberEstimate, estimates
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.study import State, Study
from vjm_updating.poses.transfer import refitted
from vjm_updating.poses.verdict import NO_FAMILY


@dataclass(frozen=True)
class Written:
    """What a model file says of a test.

    Attributes:
        text: of the file, TOML.
        urdf: the same as a URDF.
        mjcf: the same as an MJCF file.
        state: the fit without what the file has no word for, or leaves at the model's values.
        without: families for which it has none.
        left_out: what else it cannot hold, for people.
        error: mean distance in mm of the markers from the predictions of the file as read back.
        refusals: why it is not for use: what no machine is, in the file and not in the model that the sheet names,
            or columns of the data that are not what they say.
    """

    text: str
    urdf: str
    mjcf: str
    state: State
    without: tuple[str, ...]
    left_out: list[str]
    error: float
    refusals: tuple[Finding, ...]


def written(
    measurement: RobotMeasurement, study: Study, state: State, members: Sequence[MemberEstimate]
) -> Written:
    """The model file of a hypothesis.

    Args:
        measurement: the test.
        study: the same, aligned.
        state: the fit, and
        members: its estimates.

    Raises:
        vjm.errors.NoConvergenceError: the file's model has no equilibrium in a posture.
    """
    without = tuple(name for name in state.hypothesis.families if name in NO_WORD)
    if without:
        families = tuple(name for name in state.hypothesis.families if name not in NO_WORD)
        state = study.settle(replace(state.hypothesis, families=families), state)
        members = estimates(study, state)
    state, members = _as_in_file(study, state, members)
    document, left_out = calibrated_document(measurement, study, state, members)
    text = toml_text(document)
    content = parse_toml(text)
    chain = build_chain(content, "the calibrated model")
    known = {_said(one) for one in model_findings(measurement.model.document, "model")}
    new = [one for one in model_findings(content, "the calibrated model") if _said(one) not in known]
    refusals = tuple(one for one in new if one.grade is not Grade.NOTED)
    error = _error(study, chain)
    return Written(text, urdf_text(chain), mjcf_text(chain), state, without, left_out, error, refusals)


def _as_in_file(
    study: Study, state: State, members: Sequence[MemberEstimate]
) -> tuple[State, list[MemberEstimate]]:
    """A fit without the members that the file leaves at the model's values, which took a part of the others up."""
    dropped = {row.name: row for row in members if not row.identifiable}
    n, family = state.blocks.nuisances, state.blocks.family.copy()
    held = [i for i, m in enumerate(study.members) if m.name in dropped and m.acts != VALUE]
    if not held:
        return state, list(members)
    family[[n + i for i in held]] = NO_FAMILY
    blocks = replace(state.blocks, family=family)
    solution = solve(blocks, study.numbers(state.hypothesis), state.solution.sizes)
    errors = study.errors(blocks, solution, state.sigma)
    refit = replace(state, z=solution.z[n:], blocks=blocks, solution=solution, errors=errors)
    names = {study.members[i].name for i in held}
    return refit, [*estimates(study, refit), *(row for name, row in dropped.items() if name in names)]


def _said(finding: Finding) -> tuple[str, str]:
    """Where in a file, and what."""
    return finding.where.partition(": ")[2], finding.found


def _error(study: Study, chain: Chain) -> float:
    """Mean distance in mm of a test's markers by a model as it stands, only the frames fitted."""
    data = study.data
    machine = PoseMachine(chain, study.ends(), at_output=study.sheet.at_output)
    # joints that the file has more are of the base, whose coordinates are zero
    q = np.zeros((len(data), len(machine.joints)))
    for i, name in enumerate(machine.joints):
        if name in data.joints:
            q[:, i] = data.q[:, data.joints.index(name)]
    there = replace(data, joints=machine.joints, q=q, torque=np.full(q.shape, np.nan))
    return float(np.nanmean(refitted(study, study.forward_of(machine, there), np.zeros(0), [])))
