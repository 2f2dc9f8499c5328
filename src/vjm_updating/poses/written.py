"""The model file as judged: written, read back, evaluated on the readings, and held against what no machine is.

Also what it errs by where it will be used, with it and without it.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.io.files import parse_toml, toml_text
from vjm.io.findings import Finding, Grade
from vjm.io.joint_tables import CALIBRATED
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import model_findings
from vjm.io.robot_text import mjcf_leaves_out, mjcf_text, urdf_leaves_out, urdf_text
from vjm.machine.equilibria import unloaded_frames
from vjm.model.machine import Machine
from vjm.model.parts import Joint, joint_axes
from vjm.plain_numbers import plain_number
from vjm.postures import tool_postures
from vjm.rotations import Array
from vjm_updating.calibration.calibrated_model import xml_comments
from vjm_updating.constants import numerical, physical_bound, stated_level
from vjm_updating.poses.deflections import law_of_joint
from vjm_updating.poses.document import AskedForRow, AskedPlaceRow, MemberRow
from vjm_updating.poses.families import COMPLIANCE, DRIVES, LAWS, MASS, SECOND, VALUE
from vjm_updating.poses.fit import NO_FAMILY, places, solve
from vjm_updating.poses.held_out import as_good, by_machine
from vjm_updating.poses.identifiability import DRAWN as COUNT
from vjm_updating.poses.identifiability import (
    RangeSupport,
    effects,
    estimates,
    lack_of,
    marginals,
    missed2,
    supported,
    whole_range,
)
from vjm_updating.poses.kinds import PreparedTest
from vjm_updating.poses.machine import LATERAL, OWN, RIGID
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.pooled import between
from vjm_updating.poses.state import Candidates, FittedState
from vjm_updating.poses.study import Study

# --- The calibrated model file: the sheet's model with what was found written into it -----------------------------

SMALLEST = physical_bound(10.0 * RIGID)
"""rad/(N mm): a smaller compliance is written as none."""
URDF, MJCF = "calibrated.urdf", "calibrated.xml"
NO_WORD = (*(family for family in SECOND if family not in LAWS), "link_compliance")
"""Families for which a model file has no word."""


def calibrated_document(
    measurement: RobotMeasurement, study: Study, state: FittedState, members: Sequence[MemberRow],
    kept: Collection[str],
) -> tuple[dict[str, Any], list[str], set[str]]:  # fmt: skip
    """The model document of a fit with its estimates, and what was found that a model file cannot hold.

    Members that are ``kept`` have the model's own value: what the data do not learn. Last are the members of
    joints' laws that are in no law, for with them the deflection would fall where the torque grows.
    """
    document = copy.deepcopy(measurement.model.document)
    # what an earlier calibration said of its own numbers
    document.pop("calibrated", None)
    acts = {member.name: member for member in study.members}
    corrections = {
        row.name: row.value - acts[row.name].nominal
        for row in members
        if acts[row.name].family not in NO_WORD and row.name not in kept
    }
    pushing = measurement.model.chain.pushing
    left_out = sorted(
        {name for name in state.hypothesis.families if name in NO_WORD}
        | {"joint_offset" for joint in pushing if f"joint_offset.{joint}" in corrections}
    )
    # compliances of members that were asked are as judged, also where their family was not added
    judged = {m.name for m in study.members if m.kind not in (VALUE, MASS)}.difference(kept)
    joints = {joint.name: joint for joint in measurement.model.chain.moving if joint.held}
    base = {axis: corrections.get(f"base_compliance.base.{axis}", 0.0) for axis in "xyz"}
    base = {axis: value for axis, value in base.items() if value > SMALLEST}
    parts: list[dict[str, Any]] = [
        {
            "kind": "actuated", "name": f"base-turn-{axis}", "axis": axis, "compliance_rad_per_Nmm": value,
            "source": f"{CALIBRATED}the base deflects; its coordinate is always zero",
        }
        for axis, value in base.items()
    ]  # fmt: skip
    for axis in base:
        for posture in document.get("postures", {}).values():
            if isinstance(posture, dict):
                posture[f"base-turn-{axis}"] = 0.0
            else:
                posture.insert("xyz".index(axis), 0.0)
    previous, in_no_law = parts[-1]["name"] if parts else "", set[str]()
    moved = {"": previous}
    for table in document["parts"]:
        name, behind = table["name"], None
        if "after" in table:
            table["after"] = moved.get(table["after"], table["after"])
        if name in joints:
            # how far a beam is out has no place in a frame
            own = {k: v for k, v in corrections.items() if name not in pushing or k != f"joint_offset.{name}"}
            link = _frame_link(name, joints[name].axis, own, slides=joints[name].slides)
            if link is not None and joints[name].rides_on:
                behind, moved[name] = link, link["name"]
            elif link is not None:
                if "after" in table:
                    link["after"] = table.pop("after")
                parts.append(link)
            _compliances(table, joints[name], corrections, judged, rigid=measurement.sheet.test.rigid)
            families = (DRIVES, *LAWS) if "law" in table else LAWS
            own = {k: v for family in families if (v := corrections.get(k := f"{family}.{name}", 0.0))}
            if own and not _law(table, joints[name], study, own):
                in_no_law.update(own)
            if name in state.hypothesis.as_deflected:
                as_deflected = study.machine.coupled[name]
                table["coupling"] = "as commanded" if as_deflected else "as deflected"
        if f"gravity.{name}" in corrections:
            table["mass_kg"] = table.get("mass_kg", 0.0) * (1.0 + corrections[f"gravity.{name}"])
        parts += [table] if behind is None else [table, behind]
    document["parts"] = parts
    for closure in document.get("closures", ()):
        closure["between"] = [moved.get(part, part) if part else part for part in closure["between"]]
    if "ends" in document:
        document["ends"] = {end: moved.get(part, part) for end, part in document["ends"].items()}
    document["name"] = f"{document['name']}-calibrated"
    document["source"] = f"{document['source']}; calibrated by {measurement.data.file}"
    if in_no_law:
        joint_names = sorted({name.partition(".")[2] for name in in_no_law})
        why = "it has a 6×6 compliance, or would deflect less where its torque grows"
        left_out.append(f"the law of {', '.join(joint_names)}: {why}")
    return document, left_out, in_no_law


def elastic(table: dict[str, Any]) -> bool:
    """Whether a part deflects."""
    lateral, turns, shifts = "lateral_rad_per_Nmm", "compliance_rad_per_Nmm", "compliance_mm_per_N"
    keys = (turns, shifts, "compliance", "stiffness_Nmm_per_rad", "stiffness_N_per_mm", "law")
    return table["kind"] == "beam" or any(table.get(key) for key in keys) or any(table.get(lateral, ()))


def _frame_link(name: str, axis: Array, corrections: dict[str, float], *, slides: bool) -> dict[str, Any] | None:
    """A rigid piece with errors of a joint's frame and its zero, before it or behind a carriage."""
    axes = joint_axes(axis)
    shift, turns = np.zeros(3), []
    for k, label in enumerate(("shift-x", "shift-y", "shift-z")):
        shift += corrections.get(f"frame_error.{name}.{label}", 0.0) * axes[:, k]
    for k, label in enumerate(("turn-x", "turn-y")):
        angle = corrections.get(f"frame_error.{name}.{label}", 0.0)
        if angle:
            turns.append({"turn_about": [float(v) for v in axes[:, k]], "angle_deg": math.degrees(angle)})
    offset = corrections.get(f"joint_offset.{name}", 0.0)
    if slides:
        # along the joint's axis as the turns leave it, which differs in the second order only
        shift += offset * axis
    elif offset:
        turns.append({"turn_about": [float(v) for v in axis], "angle_deg": math.degrees(offset)})
    if not shift.any() and not turns:
        return None
    return {
        "kind": "link", "name": f"{name}-frame", "translation_mm": [float(v) for v in shift], "turns": turns,
        "source": f"{CALIBRATED}errors of the joint's frame and zero",
    }  # fmt: skip


def _law(table: dict[str, Any], joint: Joint, study: Study, values: Mapping[str, float]) -> bool:
    """Write a joint's law in place of its compliance, unless it has a 6×6 one or its deflection would fall."""
    key = "compliance_mm_per_N" if joint.slides else "compliance_rad_per_Nmm"
    if "compliance" in table:
        return False
    straight = table.get(key, 0.0) + values.get(f"{DRIVES}.{joint.name}", 0.0)
    law = law_of_joint(study, joint.name, straight, values, joint.law if "law" in table else None)
    if law is not None:
        table.pop(key, None)
        table["law"] = law.table(slides=joint.slides)
    return law is not None


def _compliances(
    table: dict[str, Any], joint: Joint, corrections: dict[str, float], judged: set[str], *, rigid: bool
) -> None:
    """Write a joint's compliances as judged; those that were not keep the values of the model."""
    own_key = "compliance_mm_per_N" if joint.slides else "compliance_rad_per_Nmm"
    own_name = f"actuator_compliance.{joint.name}"
    names = [f"lateral_compliance.{joint.name}.{label}" for label in ("first", "second")]
    if table["kind"] not in ("actuated", "coupled") or not judged.intersection((own_name, *names)):
        return
    if "compliance" in table:
        if not rigid:
            return
        table.pop("compliance")
    table["source"] = "compliances calibrated where the data know them" + (
        f"; before: {table['source']}" if table.get("source") else ""
    )
    if rigid and own_name in judged:
        table.pop("law", None)
    if own_name in judged and "law" not in table:
        value = (0.0 if rigid else table.get(own_key, 0.0)) + corrections.get(own_name, 0.0)
        if value > SMALLEST:
            table[own_key] = value
        else:
            table.pop(own_key, None)
    own = table.pop("lateral_rad_per_Nmm", [0.0, 0.0])
    both = [
        (0.0 if rigid else own[k]) + corrections.get(name, 0.0) if name in judged else own[k]
        for k, name in enumerate(names)
    ]
    if max(both) > SMALLEST:
        table["lateral_rad_per_Nmm"] = [v if v > SMALLEST else 0.0 for v in both]


@dataclass(frozen=True)
class Written:
    """What a model file says of a test.

    Attributes:
        text: of the file, TOML.
        urdf: the same as a URDF.
        mjcf: the same as an MJCF file.
        chain: the machine of the file, read back.
        members: values that the file has from the fit, by the members' names; others keep the model's value.
        study: the test of the machine with the springs that the file keeps, and
        fitted: the fit there, without what the file has no word for, and
        state: the same with the scatter between series and the prior over the joints' whole range.
        without: families for which it has none.
        left_out: what else it cannot hold, for people.
        error: mean distance in mm of the markers from the predictions of the file as read back.
        refusals: why it is not for use: what no machine is, in the file and not in the model that the sheet names,
            or columns of the data that are not what they say.
        at_bound: members that ended at the bound of what is built, and keep the model's value, and
        support: what the postures support over the joints' whole range; None where that is not known.
    """

    text: str
    urdf: str
    mjcf: str
    chain: Machine
    members: dict[str, float]
    study: Study
    fitted: FittedState
    state: FittedState
    without: tuple[str, ...]
    left_out: list[str]
    error: float
    refusals: tuple[Finding, ...]
    at_bound: tuple[str, ...]
    support: RangeSupport | None

    def texts(self, name: str) -> dict[str, str]:
        """The model files by name, of which the one in TOML is given."""
        return {name: self.text, URDF: self.urdf, MJCF: self.mjcf}


def written(
    measurement: RobotMeasurement,
    study: Study,
    first: FittedState,
    state: FittedState,
    members: Sequence[MemberRow],
) -> Written:
    """The model file of a hypothesis, by its fit and its estimates; ``first`` is the fit of the frames alone.

    Raises:
        vjm.errors.NoConvergenceError: the file's model has no equilibrium in a posture.
    """
    without = tuple(name for name in state.hypothesis.families if name in NO_WORD)
    if without:
        families = tuple(name for name in state.hypothesis.families if name not in NO_WORD)
        state = study.gauss_newton(replace(state.hypothesis, families=families), state)
        members = estimates(study, state)
    kept = _kept(study, state, members)
    file_study, fitted, at_bound = _within_bounds(study, state, kept)
    missed = float(np.sqrt(missed2(first)))
    rigid = not any(elastic(table) for table in measurement.model.document["parts"])
    left_out = list[str]()
    while True:
        state, support = supported(file_study, between(file_study, fitted)[0], missed)
        rows = estimates(file_study, state)
        document, more, keep = calibrated_document(measurement, file_study, state, rows, kept)
        left_out += [one for one in more if one not in left_out]
        if not keep and not rigid and not any(elastic(table) for table in document["parts"]):
            left_out.append(
                "rigid joints: the model's own compliances are kept, for an elastic model must deflect somewhere"
            )
            keep = {name for name, _ in _springs(study)}
        if kept.issuperset(keep):
            break
        kept |= keep
        file_study, fitted = _as_in_file(study, fitted, kept)
    text = toml_text(document)
    content = parse_toml(text)
    chain = build_chain(content, "the calibrated model", may_be_rigid=rigid)
    known = {_said(one) for one in model_findings(measurement.model.document, "model", may_be_rigid=rigid)}
    found = model_findings(content, "the calibrated model", may_be_rigid=rigid)
    new = [one for one in found if _said(one) not in known]
    refusals = tuple(one for one in new if one.grade is not Grade.NOTED)
    error = float(np.nanmean(by_machine(study, chain)[0]))
    values = {row.name: row.value for row in rows if row.name not in kept}
    if support is not None:
        learnt = {row.name for row in members if row.identifiable}
        unsupported = [name for name in support.row.unsupported if name in learnt]
        support = replace(support, row=support.row.model_copy(update={"unsupported": unsupported}))
    return Written(
        text, _says_what_it_lacks(urdf_text(chain), urdf_leaves_out(chain)),
        _says_what_it_lacks(mjcf_text(chain), mjcf_leaves_out(chain)), chain, values, file_study, fitted, state,
        without, left_out, error, refusals, tuple(at_bound), support,
    )  # fmt: skip


def _says_what_it_lacks(text: str, lines: Sequence[str]) -> str:
    """A text in XML with what its format has no word for at its head."""
    return xml_comments([f"Not in this file: {line}." for line in lines], text)


def as_it_stands(study: Study, first: FittedState) -> tuple[Study, FittedState]:
    """The test of the model as its file has it, with no compliance set aside, and the fit of the frames alone."""
    springs = dict(_springs(study))
    if not study.sheet.test.rigid or not any(springs.values()):
        return study, first
    return _as_in_file(study, first, set(springs))


def _within_bounds(study: Study, state: FittedState, kept: set[str]) -> tuple[Study, FittedState, list[str]]:
    """The test and the fit of what the file holds, and the members that ended at the bound of what is built.

    Such a number is the bound and no finding: the member keeps the model's value, and is added to ``kept``.
    """
    at_bound = _ended(study, state)
    while True:
        kept.update(at_bound)
        file_study, state = _as_in_file(study, state, kept)
        more = _ended(file_study, state)
        if not more:
            return file_study, state, at_bound
        at_bound += more


def _ended(study: Study, state: FittedState) -> list[str]:
    """Members of a fit at a bound. A compliance of none is a finding, for a joint can be rigid."""
    ended, z, blocks = set(state.solution.at_bound.tolist()), state.solution.z, state.blocks
    # the nearer bound: one that was met is met to rounding
    at_most = blocks.upper - z < z - blocks.lower
    return [
        m.name
        for u, m in enumerate(study.members, start=state.blocks.nuisances)
        if u in ended and (m.kind != COMPLIANCE or at_most[u])
    ]


def _kept(study: Study, state: FittedState, members: Sequence[MemberRow]) -> set[str]:
    """Members that keep the model's own value in the file: those that were not asked, not needed, or not learnt.

    Where the sheet sets the compliances of the model aside, one that was asked keeps it only where postures held
    out are predicted as well with it. Else the readings know that it is another, and it is written as judged.
    """
    asked = {m.name: i for i, m in enumerate(study.members)}
    own = dict(_springs(study))
    unlearnt = set()
    for row in members:
        member = study.members[asked[row.name]]
        unknown = row.at_bound or not row.identifiable
        # where a law may as well be none, the joint keeps its compliance
        law = member.family in LAWS
        if (law and row.may_be_nothing) or (unknown and (law or member.kind != VALUE)):
            unlearnt.add(row.name)
    return {name for name in own if name not in asked} | {
        name
        for name in unlearnt.union(state.hypothesis.kept)
        if name not in own or _as_good_with(study, state, asked[name], own[name])
    }


def _springs(study: Study) -> Iterator[tuple[str, float]]:
    """Members that are springs of joints, by name, and the compliances that the model gives them."""
    straight = {spring.part: spring.nominal for spring in study.machine.springs if spring.kind == OWN}
    for part in study.machine.chain.parts:
        if isinstance(part, Joint) and not part.passive:
            # beside a 6×6 the law is whole
            own = part.compliance if part.law is None else straight.get(part.name, 0.0)
            if part.law is not None and study.sheet.test.rigid:
                own = part.compliances[0]
            yield f"{DRIVES}.{part.name}", 0.0 if study.sheet.at_output else own
            for label, compliance in zip(LATERAL, part.lateral, strict=True):
                yield f"lateral_compliance.{part.name}.{label}", compliance


def _as_good_with(study: Study, state: FittedState, place: int, value: float) -> bool:
    """Whether postures held out are not surely predicted worse with one of the members held at a value."""
    member, blocks, k = study.members[place], state.blocks, state.blocks.nuisances + place
    z = member.coordinate(value)
    family = blocks.family.copy()
    family[k] = NO_FAMILY
    held = replace(
        blocks,
        b=blocks.b - blocks.N[:, k] * z,
        c=blocks.c - 2.0 * z * float(blocks.b[k]) + z**2 * float(blocks.N[k, k]),
        y=blocks.y - blocks.J[:, k] * z,
        family=family,
        parts=tuple([(N, b - N[:, k] * z) for N, b in way] for way in blocks.parts),
    )
    solution = solve(held, study.numbers(state.hypothesis), state.solution.sizes)
    return as_good(study.errors(held, solution, state.sigma), state.errors, state.sigma)


def _as_in_file(study: Study, state: FittedState, kept: Collection[str]) -> tuple[Study, FittedState]:
    """The test of the machine with the springs that the file keeps, and the fit of all else on it."""
    springs = [name.split(".") for name, _ in _springs(study) if name in kept]
    own = {(joint, (*label, OWN)[0]) for _, joint, *label in springs} if study.sheet.test.rigid else set()
    hypothesis = replace(state.hypothesis, kept=tuple(sorted(kept)))
    if own == study.machine.as_modelled and set(hypothesis.kept) == set(state.hypothesis.kept):
        return study, state
    file_study = study if own == study.machine.as_modelled else study.as_modelled(own)
    z = {m.name: float(value) for m, value in zip(study.members, state.z, strict=True)}
    sizes = {file_study.number(study.families[f]): size for f, size in state.solution.sizes.items()}
    start = replace(
        state,
        z=np.array([z.get(m.name, 0.0) for m in file_study.members]),
        solution=replace(state.solution, sizes=sizes),
    )
    return file_study, file_study.gauss_newton(hypothesis, start)


def _said(finding: Finding) -> tuple[str, str]:
    """Where in a file, and what."""
    return finding.where.partition(": ")[2], finding.description


AXES = ("x", "y", "z")
STEPS = numerical(3)
"""Places along an axis of which a range is given."""
DRAWS = numerical(1000)
SEED = numerical(19)
ROUNDED = numerical(1e-9)
"""rad or mm: a coordinate at an end of a range lies within it."""
MOST = stated_level(0.95)
"""Share of errors that lie below what is said to be the largest."""


def asked_candidates(test: PreparedTest, study: Study, asked: str | Path) -> tuple[Candidates, np.ndarray]:
    """Postures of which a prediction is wanted, and the number ``(c,)`` of the place that each reaches.

    They are asked by a CSV file, in which each is a place; or by places of the end in the base's axes, mm, as
    ``x=400,y=0:200,z=300``, a range as its two ends.

    Raises:
        ValueError: it cannot be used, or no posture reaches a place; one line.
    """
    if isinstance(asked, Path):
        listed = test.candidates(asked)
        return listed, np.arange(len(listed))
    machine = test.measurement.model.chain
    postures: list[list[float]] = []
    number: list[int] = []
    missed: list[str] = []
    for i, place in enumerate(_places(asked)):
        try:
            postures += [[row[name] for name in study.data.joints] for row in tool_postures(machine, place)]
            number += [i] * (len(postures) - len(number))
        except (ValueError, NoConvergenceError) as error:
            missed.append(str(error))
    if not postures:
        raise ValueError(f"--for {asked}: no posture reaches there: {missed[0]}")
    q = np.array(postures)
    keep = study.machine.tree.limits.kept(study.machine.rows(q))
    if not keep.any():
        raise ValueError(f"--for {asked}: all postures that reach there lie beyond the joints' limits")
    drawn = study.drawn(np.random.default_rng(SEED), 1)
    reached = Candidates(q[keep], np.repeat(drawn.load * 0.0, int(keep.sum()), axis=0))
    return reached, np.array(number)[keep]


def _likely(study: Study, asked: Candidates, reached: np.ndarray) -> np.ndarray:
    """Which postures ``(c,)`` are the nearest to a measured one of all that reach their place."""
    turning = np.array([name in study.machine.turning for name in study.data.joints])
    apart = asked.q[:, None] - study.data.q
    apart = np.where(turning, (apart + np.pi) % (2.0 * np.pi) - np.pi, apart)
    distance = np.linalg.norm(places(apart, turning), axis=2).min(axis=1)
    result = np.zeros(len(distance), dtype=bool)
    for number in np.unique(reached):
        own = np.flatnonzero(reached == number)
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
    study: Study, model: Written, asked: Candidates, reached: np.ndarray, within: Mapping[str, tuple[float, float]]
) -> AskedForRow:
    """Errors in postures, see `asked_candidates`, with and without the file.

    ``within`` has measured ranges of joints that reach much further, rad or mm, by name.

    Raises:
        vjm.errors.NoConvergenceError: a posture has no equilibrium.
    """
    file_study, state = model.study, model.state
    active, n = state.solution.active, state.blocks.nuisances
    drawn = file_study.drawn(np.random.default_rng(SEED), COUNT, whole_range(file_study))
    both = Candidates(np.concatenate([drawn.q, asked.q]), np.concatenate([drawn.load, asked.load]))
    J = effects(file_study, state, both)[len(drawn) :, :, :, active[n:] - n]
    # the first marker, which rides where the tool is
    J = J[:, 0]
    change, off = J @ state.solution.z[active[n:]], _off(file_study, model)
    lack, rng = lack_of(file_study, state), np.random.default_rng(SEED)
    error = np.einsum("gap,dp->dga", J, off) + lack / np.sqrt(3.0) * rng.standard_normal((DRAWS, len(asked), 3))
    without = np.linalg.norm(error + change, axis=2)
    with_it = np.linalg.norm(error, axis=2)
    place = unloaded_frames(file_study.machine.tree, file_study.machine.rows(asked.q))[1][:, 0]
    rows, likely = [], _likely(study, asked, reached)
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


def _inside(value: float, ends: tuple[float, float], *, turns: bool) -> bool:
    """Whether a coordinate lies within a range; an angle a turn further is the same."""
    whole = 2.0 * np.pi if turns else np.inf
    return ends[0] - ROUNDED <= value <= ends[1] + ROUNDED or bool(
        turns and (value - ends[0]) % whole <= ends[1] - ends[0] + ROUNDED
    )


def _mean(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))
