"""What is wrong with the drive in a joint of an arm is named with the joint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from helpers import traced
from helpers.from_files import diagnose

from vjm.io.model_file import load_chain
from vjm.model.machine import Machine
from vjm_updating.diagnosis.document import Diagnosis

SOFT = 1e-6
"""rad/(N mm) beyond those of the model, 5e-7 and 1e-6."""


def softer(chain: Machine, joint: str, by: float = SOFT) -> Machine:
    """The arm with a joint that is softer than its model says."""
    parts = (replace(p, compliance=p.compliance + by) if p.name == joint else p for p in chain.parts)
    return replace(chain, parts=tuple(parts))


def names(found: Diagnosis, cause: str, joint: str) -> bool:
    """Whether a diagnosis says that it is this, in this joint; a spring that hardens a little may be as good."""
    places = [candidate.places for candidate in found.candidates]
    return (
        places in ([[f"{cause}({joint})"]], [[f"{cause}({joint})"], [f"actuator_hardening({joint})"]])
        and found.verdict == ("named" if len(places) == 1 else "class")
        and found.parameters[f"{cause}.part"] == joint
    )


@pytest.mark.slow
@pytest.mark.parametrize("joint", ["elbow", "shoulder"])
@pytest.mark.parametrize("seed", range(3))
def test_a_soft_gear_is_named_with_its_joint(tmp_path: Path, joint: str, seed: int) -> None:
    data, sheet = traced.measured(
        tmp_path, "planar-2r", lambda chain: softer(chain, joint), ("bent", "folded"), "uy_mm", 0.5, seed
    )
    found = diagnose(data, sheet, tmp_path / "out")
    assert names(found, "actuator_compliance", joint)
    value = found.parameters["actuator_compliance.compliance_rad_per_Nmm"]
    assert abs(value.value - SOFT) < 3.0 * value.std + 0.01 * SOFT
    # and a command predicts with it
    drawn, extended = (
        {part.name: part.compliance for part in chain.parts if part.name in ("shoulder", "elbow")}
        for chain in (load_chain("planar-2r"), load_chain(tmp_path / "out" / "extended-model.toml"))
    )
    assert extended == pytest.approx({n: c + value.value * (n == joint) for n, c in drawn.items()}, rel=1e-9)
