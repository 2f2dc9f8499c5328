"""What the written model file is worth: read back and compared with the readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vjm.model.chain import Chain
from vjm.rotations import Array
from vjm_updating.poses.forward import Frames
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.study import ROUNDS, Study


def written_distances(study: Study, chain: Chain, frames: Frames) -> Array:
    """Distances ``(g, k)`` mm of the readings from what a model file says, the frames fitted from a guess.

    Joints that the file has beside those of the readings, such as a base that deflects, stand at zero.
    """
    machine = PoseMachine(chain, study.ends(), at_output=study.sheet.at_output)
    place = {name: i for i, name in enumerate(study.data.joints)}
    q, torque = (np.zeros((len(study.data), len(machine.joints))) for _ in range(2))
    for i, name in enumerate(machine.joints):
        if name in place:
            q[:, i], torque[:, i] = study.data.q[:, place[name]], study.data.torque[:, place[name]]
    forward = study.forward_of(machine, replace(study.data, joints=machine.joints, q=q, torque=torque))
    none, root = np.zeros(0), np.diag(1.0 / study.prior)
    for _ in range(ROUNDS):
        at = forward.evaluate(none, frames)
        sigma, _ = study.noise(at)
        seen = np.isfinite(at.residual)
        J, y = at.nuisance[seen] / sigma[seen][:, None], at.residual[seen] / sigma[seen]
        step = np.linalg.lstsq(np.vstack([J, root]), np.concatenate([y, -root @ at.off]), rcond=None)[0]
        frames = forward.moved(frames, step)
    return study.distance(forward.evaluate(none, frames).residual)
