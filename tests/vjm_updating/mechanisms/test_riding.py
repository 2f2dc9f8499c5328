"""What calibration and diagnosis say of a machine with a carriage."""

import numpy as np
from helpers import template_machines

from vjm.engines import VjmEngine
from vjm_updating.mechanisms.catalogue import catalogue
from vjm_updating.mechanisms.effect import Scene
from vjm_updating.poses.machine import PoseMachine


def test_its_beam_has_no_bow_which_no_file_could_say():
    scene = Scene(template_machines.gantry(), VjmEngine(4), 100.0, 0.1)
    labels = {effect.label for effect in catalogue(scene)}
    assert {"link_compliance.bridge", "link_compliance.ram", "link_bow.ram"} <= labels
    assert "link_bow.bridge" not in labels


def test_a_test_of_poses_has_the_errors_of_its_frame_behind_it():
    machine = template_machines.boom()
    assert PoseMachine(machine, {}).joints == ("raise", "out")
    riding = PoseMachine(template_machines.axis(), {"tool": ("", np.zeros(3))})
    before = riding.tree.chain.predecessors
    assert before["x~shift-x"] == "x"
    assert before["table~root"] == "x~turn-y"
    # it stands on the ground at both ends
    assert not [spring for spring in riding.springs if spring.kind == "base"]
