"""MJCF texts read as machines, and as MuJoCo reads them."""

from pathlib import Path

import numpy as np

from vjm.engines import refuse_unbuildable
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_file import Description, import_robot
from vjm.model.machine import Machine

MM = 1e3


def imported(tmp_path: Path, text: str, tip: str | None = None, **how):
    file = tmp_path / "robot.xml"
    file.write_text(text)
    return import_robot(Description(file), tip, Reading(**how))


def built(tmp_path: Path, text: str, tip: str | None = None, **how) -> Machine:
    machine = build_chain(imported(tmp_path, text, tip, **how).document, "m.toml")
    refuse_unbuildable(machine)
    return machine


def mujoco_masses(text: str, qpos=None):
    """MuJoCo's model, its state at coordinates, and its mass matrix, kg and m."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return model, data, M
