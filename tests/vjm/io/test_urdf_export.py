"""A machine written as a URDF and read again is the machine: axes, frames, masses, limits, couplings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from helpers.as_pinocchio import ROBOTS
from helpers.same_machine import masses, same
from helpers.urdf_arm import LIMIT, arm, joint, link, written

from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain, library
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import mjcf_text, urdf_text
from vjm.io.robot_text import urdf_leaves_out as left_out
from vjm.io.urdf import import_urdf
from vjm.model.machine import Machine

FILES = sorted(file.relative_to(ROBOTS).as_posix() for file in ROBOTS.rglob("*.urdf"))
NO_MACHINES = ("alex_psyonic_hands", "iris_simple", "quadrotor_base", "ur3")
CHAINS = [entry.name for entry in library()]
ROUNDTRIPS = {".urdf": urdf_text, ".xml": mjcf_text}


def again(tmp_path: Path, chain: Machine, suffix: str) -> Machine:
    file = tmp_path / f"written{suffix}"
    file.write_text(ROUNDTRIPS[suffix](chain), encoding="utf-8")
    return build_chain(import_robot(Description(file)).document, file.name)


@pytest.mark.parametrize("name", CHAINS)
def test_a_library_machine_comes_back(tmp_path, name):
    chain = load_model(name)
    assert isinstance(chain, Machine)
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


@pytest.mark.quick_cases(13)
@pytest.mark.parametrize("file", [file for file in FILES if Path(file).stem not in NO_MACHINES])
def test_an_imported_robot_comes_back(tmp_path, file):
    chain = build_chain(import_urdf(ROBOTS / file).document, "m.toml")
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


@pytest.mark.parametrize(
    "text",
    [
        arm(j2=joint("j2", "l1", "l2", more='<mimic joint="j1" multiplier="0.1" offset="0.3"/>')),
        arm(
            j2=joint(
                "j2", "l1", "l2", "prismatic", more=LIMIT + '<mimic joint="j1" multiplier="0.07" offset="0.1"/>'
            )
        ),
        arm(j1=joint("j1", "base", "l1", more='<mimic joint="j2" multiplier="-0.5"/>' + LIMIT)),
        arm(j2=joint("j2", "l1", "l2", "prismatic", more="")),
        arm(j2=joint("j2", "l1", "l2", "prismatic", more='<limit lower="-0.07" upper="0.14"/>')),
        arm(j2=joint("j2", "l1", "l2", axis="-1 0.3 0.7")),
        arm(more=link("base-body") + joint("tool-fixed", "l2", "base-body", "fixed", axis="", more="")),
    ],
)
def test_an_odd_machine_comes_back(tmp_path, text):
    chain = build_chain(import_urdf(written(tmp_path, text)).document, "m.toml")
    back = again(tmp_path, chain, ".urdf")
    same(chain, back)
    assert masses(back) == masses(chain)


def test_pinocchio_reads_what_is_written(tmp_path):
    """Of the machine with two arms, which has the most joints with limits, mimics and continuous ones."""
    file = next(ROBOTS.rglob("tiago_dual.urdf"))
    chain = build_chain(import_urdf(file).document, "m.toml")
    (tmp_path / "written.urdf").write_text(urdf_text(chain))
    read, back = (pinocchio.buildModelFromUrdf(str(path)) for path in (file, tmp_path / "written.urdf"))
    assert set(back.names) == set(read.names)
    datas = read.createData(), back.createData()
    rng = np.random.default_rng(1)
    q, q2 = pinocchio.neutral(read), pinocchio.neutral(back)
    for name in read.names[1:]:
        angle = rng.uniform(-0.5, 0.5)
        for model, values in ((read, q), (back, q2)):
            one = model.joints[model.getJointId(name)]
            values[one.idx_q : one.idx_q + one.nq] = [angle] if one.nq == 1 else [np.cos(angle), np.sin(angle)]
    torques = [
        pinocchio.computeGeneralizedGravity(model, data, values)
        for model, data, values in zip((read, back), datas, (q, q2), strict=True)
    ]
    for name in read.names[1:]:
        i, j = read.getJointId(name), back.getJointId(name)
        pinocchio.forwardKinematics(read, datas[0], q)
        pinocchio.forwardKinematics(back, datas[1], q2)
        assert datas[0].oMi[i].translation == pytest.approx(datas[1].oMi[j].translation, abs=1e-14)
        ours, theirs = torques[1][back.joints[j].idx_v], torques[0][read.joints[i].idx_v]
        assert ours == pytest.approx(theirs, abs=1e-12 * np.abs(torques[0]).max())


def test_what_is_left_out_is_said():
    said = " ".join(left_out(load_model("planar-2r")))
    for part in ("shoulder", "upper", "elbow", "fore"):
        assert part in said
    assert "inertia" in said
    assert "stretched" in said
    assert "q1, q2, q3, q4 move freely" in " ".join(left_out(load_model("orthoglide-chain")))
