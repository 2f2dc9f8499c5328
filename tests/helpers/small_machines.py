"""The small machines that several tests take, as texts of model files in mm, N and rad."""

from typing import Any

from helpers.file_texts import model_text, part_text, stiffness_of

GRIPPER = """<robot name="gripper"><link name="base"/><link name="upper"/><link name="lower"/><link name="hand"/>
<joint name="lift" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="level" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
<axis xyz="0 1 0"/><mimic joint="lift" multiplier="-1" offset="0.1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0.3 0 0"/></joint>
</robot>"""
"""A URDF of two links whose joint `level` follows `lift`, so that the hand keeps its direction."""


def lever(length: float, compliance: float, **of_lever: Any) -> str:
    """A joint `elbow` about z, rad/(N mm), and a rigid `lever` along x, mm; the posture is `home`."""
    return model_text(
        "lever",
        part_text("actuated", "elbow", axis="z", compliance_rad_per_Nmm=compliance),
        part_text("link", "lever", translation_mm=[length, 0.0, 0.0], **of_lever),
        postures={"home": {"elbow": 0.0}},
    )


def clamped_bar(length: float, EI: float) -> str:
    """A `bar` along x, mm, as stiff about y as about z, N mm²; the posture is `bench`."""
    bar = part_text("beam", "bar", length_mm=length, section=stiffness_of(1e7, 1e9, EI, EI))
    return model_text("bar", bar, postures={"bench": []})
