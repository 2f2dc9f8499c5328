"""A model file of one elastic joint about z and a rigid lever along x."""

from __future__ import annotations


def lever_text(length: float, compliance: float, of_lever: str = "") -> str:
    """The file, whose parts are `elbow` and `lever` and whose posture is `home`.

    Args:
        length: of the lever, mm.
        compliance: of the joint in the model, rad/(N mm).
        of_lever: more keys of the lever, a line each.
    """
    return f"""format = 1
name = "lever"
title = "a joint and a lever"
source = "made up"
units = {{ length = "mm", force = "N", angle = "rad" }}
[[parts]]
kind = "actuated"
name = "elbow"
axis = "z"
compliance_rad_per_Nmm = {compliance}
[[parts]]
kind = "link"
name = "lever"
translation_mm = [{length}, 0.0, 0.0]
{of_lever}[postures]
home = {{ elbow = 0.0 }}
"""
