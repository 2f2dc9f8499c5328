"""Moments of inertia in files: read, refused, written to a URDF and read again."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from helpers.urdf_arm import arm, imported, link, written

from vjm.design.modes import modes
from vjm.io.errors import ModelFileError
from vjm.io.machine_file import build_machine
from vjm.io.manipulator_file import legs_folder
from vjm.io.model_file import build_chain, read_document
from vjm.io.robot_text import urdf_leaves_out as left_out
from vjm.io.robot_text import urdf_text
from vjm.io.urdf import import_urdf

INERTIA = [900.0, 700.0, 400.0, 50.0, 20.0, -30.0]


def arm_with(**keys):
    """The library's arm of two joints, its tool with other keys."""
    content = deepcopy(read_document("planar-2r").content)
    tool = next(part for part in content["parts"] if part["name"] == "tool")
    tool.update(keys)
    return content


def test_a_payload_has_moments_of_inertia():
    chain = build_chain(arm_with(inertia_kg_mm2=INERTIA), "arm.toml")
    expected = [[900.0, 50.0, 20.0], [50.0, 700.0, -30.0], [20.0, -30.0, 400.0]]
    np.testing.assert_array_equal(chain.parts[-1].inertia, expected)
    # it turns with the tool
    light, heavy = (modes(c, "bent", number=3).frequencies for c in (build_chain(arm_with(), "arm.toml"), chain))
    assert np.all(heavy <= light * (1.0 + 1e-12))
    assert heavy[1] < light[1] * (1.0 - 1e-6)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1.0, 1.0, 3.0, 0.0, 0.0, 0.0], "moments of no body"),
        ([-1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "moments of no body"),
        ([1.0, 1.0, 1.0], "inertia_kg_mm2"),
    ],
)
def test_moments_that_no_body_has_are_refused(values, said):
    with pytest.raises(ModelFileError, match=said) as refused:
        build_chain(arm_with(inertia_kg_mm2=values), "arm.toml")
    assert "part 'tool'" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_moments_without_a_mass_are_refused():
    content = arm_with()
    content["parts"].append({"kind": "link", "name": "end", "inertia_kg_mm2": INERTIA})
    with pytest.raises(ModelFileError, match="has inertia_kg_mm2 but no mass_kg"):
        build_chain(content, "arm.toml")


def test_a_platform_has_moments_of_inertia():
    """With them a platform on six legs has six frequencies, without them three."""
    document = read_document("hexapod")
    content = deepcopy(document.content)
    content["platform"]["inertia_kg_mm2"] = [1e6, 1e6, 2e6, 0.0, 0.0, 0.0]
    machine = build_machine(document._replace(content=content), legs_folder("hexapod"))
    np.testing.assert_array_equal(machine.parts[-1].inertia, np.diag([1e6, 1e6, 2e6]))
    assert len(modes(machine).frequencies) == 6


def test_a_urdf_takes_and_gives_them_back(tmp_path):
    inertia = '<inertia ixx="0.02" ixy="0.002" ixz="-0.001" iyy="0.03" iyz="0.003" izz="0.025"/>'
    found = imported(tmp_path, arm(l2=link("l2", inertia=inertia)))
    chain = build_chain(found.document, "m.toml")
    again = build_chain(import_urdf(written(tmp_path, urdf_text(chain))).document, "m.toml")

    def moments(machine):
        return [part.inertia for part in machine.parts if getattr(part, "inertia", None) is not None]

    assert len(moments(chain)) == 2
    np.testing.assert_allclose(moments(again), moments(chain), rtol=1e-12)
    assert moments(chain)[1][0, 1] == 2000.0
    assert not any("inertia" in line for line in left_out(chain))
