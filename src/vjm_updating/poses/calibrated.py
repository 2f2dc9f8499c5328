"""The calibrated model file: the sheet's model with what was found written into it."""

from __future__ import annotations

import copy
import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from vjm.io.joint_tables import CALIBRATED
from vjm.model.joints import Joint, joint_axes
from vjm.rotations import Array
from vjm_updating.constants import physical_bound
from vjm_updating.poses.document import MemberRow
from vjm_updating.poses.families import MASS, SECOND, VALUE
from vjm_updating.poses.machine import RIGID
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.state import FittedState
from vjm_updating.poses.study import Study

SMALLEST = physical_bound(10.0 * RIGID)
"""rad/(N mm): a smaller compliance is written as none."""
NO_WORD = (*SECOND, "link_compliance")
"""Families for which a model file has no word."""


def calibrated_document(
    measurement: RobotMeasurement, study: Study, state: FittedState, members: Sequence[MemberRow],
    kept: Collection[str],
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """The model document, and what was found that a model file cannot hold.

    Args:
        measurement: the test.
        study: the same, aligned.
        state: the fit.
        members: its estimates.
        kept: members that keep the model's own value: what the data do not learn.
    """
    document = copy.deepcopy(measurement.model.document)
    acts = {member.name: member for member in study.members}
    found = {
        row.name: row.value - acts[row.name].nominal
        for row in members
        if acts[row.name].family not in NO_WORD and row.name not in kept
    }
    pushing = measurement.model.chain.pushing
    left_out = sorted(
        {name for name in state.hypothesis.families if name in NO_WORD}
        | {"joint_offset" for joint in pushing if f"joint_offset.{joint}" in found}
    )
    # compliances of members that were asked are as judged, also where their family was not added
    judged = {m.name for m in study.members if m.kind not in (VALUE, MASS)}.difference(kept)
    joints = {joint.name: joint for joint in measurement.model.chain.moving if joint.held}
    parts: list[dict[str, Any]] = [_base(axis, value) for axis, value in _of_base(found)]
    for axis, _ in _of_base(found):
        for posture in document.get("postures", {}).values():
            if isinstance(posture, dict):
                posture[f"base-turn-{axis}"] = 0.0
            else:
                posture.insert("xyz".index(axis), 0.0)
    previous = parts[-1]["name"] if parts else ""
    moved = {"": previous}
    for table in document["parts"]:
        name = table["name"]
        if "after" in table:
            table["after"] = moved.get(table["after"], table["after"])
        if name in joints:
            # how far a beam is out has no place in a frame
            own = {k: v for k, v in found.items() if name not in pushing or k != f"joint_offset.{name}"}
            link = _frame_link(name, joints[name].axis, own, slides=joints[name].slides)
            if link is not None:
                if "after" in table:
                    link["after"] = table.pop("after")
                parts.append(link)
            _compliances(table, joints[name], found, judged, rigid=measurement.sheet.test.rigid)
            if name in state.hypothesis.as_deflected:
                as_deflected = study.machine.coupled[name]
                table["coupling"] = "as commanded" if as_deflected else "as deflected"
        if f"mass.{name}" in found:
            table["mass_kg"] = table.get("mass_kg", 0.0) * (1.0 + found[f"mass.{name}"])
        parts.append(table)
    document["parts"] = parts
    document["name"] = f"{document['name']}-calibrated"
    document["source"] = f"{document['source']}; calibrated by {measurement.data.file}"
    return document, left_out


def elastic(table: dict[str, Any]) -> bool:
    """Whether a part deflects."""
    keys = (
        "compliance_rad_per_Nmm",
        "compliance_mm_per_N",
        "compliance",
        "stiffness_Nmm_per_rad",
        "stiffness_N_per_mm",
    )
    return (
        table["kind"] == "beam" or any(table.get(key) for key in keys) or any(table.get("lateral_rad_per_Nmm", ()))
    )


def _of_base(found: dict[str, float]) -> list[tuple[str, float]]:
    pairs = [(axis, found.get(f"base_compliance.base.{axis}", 0.0)) for axis in "xyz"]
    return [(axis, value) for axis, value in pairs if value > SMALLEST]


def _base(axis: str, compliance: float) -> dict[str, Any]:
    return {
        "kind": "actuated", "name": f"base-turn-{axis}", "axis": axis, "compliance_rad_per_Nmm": compliance,
        "source": f"{CALIBRATED}the base deflects; its coordinate is always zero",
    }  # fmt: skip


def _frame_link(name: str, axis: Array, found: dict[str, float], *, slides: bool) -> dict[str, Any] | None:
    """A rigid piece before a joint with the errors of its frame and the offset of its zero."""
    axes = joint_axes(axis)
    shift, turns = np.zeros(3), []
    for k, label in enumerate(("shift-x", "shift-y", "shift-z")):
        shift += found.get(f"frame_error.{name}.{label}", 0.0) * axes[:, k]
    for k, label in enumerate(("turn-x", "turn-y")):
        angle = found.get(f"frame_error.{name}.{label}", 0.0)
        if angle:
            turns.append({"turn_about": [float(v) for v in axes[:, k]], "angle_deg": math.degrees(angle)})
    offset = found.get(f"joint_offset.{name}", 0.0)
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


def _compliances(
    table: dict[str, Any], joint: Joint, found: dict[str, float], judged: set[str], *, rigid: bool
) -> None:
    """Write a joint's compliances as judged; those that were not keep the values of the model."""
    own_key = "compliance_mm_per_N" if joint.slides else "compliance_rad_per_Nmm"
    own_name = f"joint_compliance.{joint.name}"
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
    if own_name in judged:
        value = (0.0 if rigid else table.get(own_key, 0.0)) + found.get(own_name, 0.0)
        if value > SMALLEST:
            table[own_key] = value
        else:
            table.pop(own_key, None)
    own = table.pop("lateral_rad_per_Nmm", [0.0, 0.0])
    both = [
        (0.0 if rigid else own[k]) + found.get(name, 0.0) if name in judged else own[k]
        for k, name in enumerate(names)
    ]
    if max(both) > SMALLEST:
        table["lateral_rad_per_Nmm"] = [v if v > SMALLEST else 0.0 for v in both]
