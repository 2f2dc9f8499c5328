"""The calibrated model file: the sheet's model with what was found written into it."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

from vjm.io.toml_text import toml_text
from vjm.model.joints import HeldJoint, joint_axes
from vjm.rotations import Array
from vjm_updating.poses.families import COMPLIANCE, MASS, VALUE
from vjm_updating.poses.machine import RIGID
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.study import State, Study

SMALLEST = 10.0 * RIGID
"""rad/(N mm): a smaller compliance is written as none."""


def calibrated_document(
    measurement: RobotMeasurement, study: Study, state: State
) -> tuple[dict[str, Any], list[str]]:
    """The model document, and what was found that a model file cannot hold."""
    document = copy.deepcopy(measurement.document)
    found = {
        member.name: float(z) * member.unit
        for member, z in zip(study.members, state.z, strict=True)
        if member.family in state.hypothesis.families
    }
    acts = {member.name: member for member in study.members}
    pushing = measurement.chain.pushing
    tables = {table["name"]: table for table in document["parts"]}
    left_out = sorted(
        {
            acts[name].family
            for name in found
            if acts[name].acts not in (VALUE, COMPLIANCE, MASS) or acts[name].basis is not None
        }
        | {"joint_offset" for joint in pushing if f"joint_offset.{joint}" in found}
        | ({"link_compliance"} if any(n.startswith("link_compliance") for n in found) else set())
    )
    joints = {part.name: part for part in measurement.chain.parts if isinstance(part, HeldJoint)}
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
            _compliances(table, joints[name], found, rigid=measurement.sheet.test.rigid)
            if name in state.hypothesis.bent:
                as_bent = study.machine.coupled[name]
                table["coupling"] = "as commanded" if as_bent else "as bent"
        if f"mass.{name}" in found:
            table["mass_kg"] = table.get("mass_kg", 0.0) * (1.0 + found[f"mass.{name}"])
        parts.append(table)
    document["parts"] = parts
    document["name"] = f"{document['name']}-calibrated"
    document["source"] = f"{document['source']}; calibrated by {measurement.data.file}"
    if not any(_elastic(table) for table in parts):
        left_out.append(
            "rigid joints: the model's own compliances are kept, for a model file must deflect somewhere"
        )
        for table, original in zip(
            (t for t in parts if t["name"] in tables), measurement.document["parts"], strict=True
        ):
            table.update({k: v for k, v in original.items() if "compliance" in k or "lateral" in k})
    return document, left_out


def calibrated_text(document: dict[str, Any]) -> str:
    """As a model file."""
    return toml_text(document)


def _elastic(table: dict[str, Any]) -> bool:
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
        "source": "calibrated: the base deflects; its coordinate is always zero",
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
        "source": "calibrated: errors of the joint's frame and zero",
    }  # fmt: skip


def _compliances(table: dict[str, Any], joint: HeldJoint, found: dict[str, float], *, rigid: bool) -> None:
    own = "compliance_mm_per_N" if joint.slides else "compliance_rad_per_Nmm"
    if table["kind"] not in ("actuated", "coupled") or ("compliance" in table and not rigid):
        return
    if rigid:
        for key in (own, "lateral_rad_per_Nmm", "compliance"):
            table.pop(key, None)
    value = table.get(own, 0.0) + found.get(f"joint_compliance.{joint.name}", 0.0)
    if value > SMALLEST:
        table[own] = value
    else:
        table.pop(own, None)
    lateral = table.get("lateral_rad_per_Nmm", [0.0, 0.0])
    both = [
        lateral[k] + found.get(f"lateral_compliance.{joint.name}.{label}", 0.0)
        for k, label in enumerate(("first", "second"))
    ]
    if max(both) > SMALLEST:
        table["lateral_rad_per_Nmm"] = [v if v > SMALLEST else 0.0 for v in both]
