"""What must not change a path: where the base stands, in which units and own axes the parts are given."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.parts import Beam, RigidOffset, Section
from vjm.rotations import frame, rotate_matrix6, rotation_from_vector


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("B", 4.0, None), ("D", -10.0, 4)])
@pytest.mark.parametrize("seed", [1, 2])
def test_turned_base_turns_the_path_with_it(chain, trace, posture, to, segments, seed):
    R = rotation_from_vector(np.random.default_rng(seed).standard_normal(3))
    turned = replace(chain, base=frame(R) @ chain.base)
    axis = (*(float(v) for v in R[:, 0]), 0.0, 0.0, 0.0)
    path = VjmEngine(segments).trace(turned, LoadCase(posture, to, axis, steps=20))
    original = trace(posture, to, segments, steps=20)
    assert path.critical.kind is original.critical.kind
    # the grid's points: beside them, the entry to the branch depends on the event to 1e-9 of the path
    grid = np.linspace(0.0, abs(to), 21)
    here, there = (p.force[[np.abs(p.s - s).argmin() for s in grid]] for p in (path, original))
    # the solver's tolerance of 1e-11 of 1e4 N, over forces of 1e3 N
    assert here == pytest.approx(there, rel=1e-9, abs=1e-6)
    assert path.critical.force == pytest.approx(original.critical.force, rel=1e-10)


def in_metres(part):
    """A part with its lengths in m: mm/N, rad/N and rad/(N mm) become m/N, rad/N and rad/(N m)."""
    match part:
        case RigidOffset():
            return replace(part, transform=frame(part.transform[:3, :3], part.transform[:3, 3] / 1000.0))
        case Beam():
            unit = np.sqrt(np.repeat([1e-3, 1e3], 3))
            s = part.section
            return replace(
                part, length=part.length / 1000.0, end_offset=part.end_offset / 1000.0,
                compliance=None if part.compliance is None else part.compliance * np.outer(unit, unit),
                section=Section(s.EA, s.GJ / 1e6, s.EIy / 1e6, s.EIz / 1e6, s.GAy, s.GAz),
            )  # fmt: skip
    return part


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("D", 3.0, None), ("C", -1.0, 4)])
def test_metres_give_the_forces_that_millimetres_give(chain, trace, posture, to, segments):
    base = frame(chain.base[:3, :3], chain.base[:3, 3] / 1000.0)
    metric = replace(chain, parts=tuple(in_metres(part) for part in chain.parts), base=base)
    path = VjmEngine(segments).trace(metric, LoadCase(posture, to / 1000.0, steps=20))
    original = trace(posture, to, segments, steps=20)
    grid = np.linspace(0.0, abs(to), 21)
    here, there = (
        p.force[[np.abs(p.s * unit - s).argmin() for s in grid]] for p, unit in ((path, 1000.0), (original, 1.0))
    )
    assert here == pytest.approx(there, rel=1e-9, abs=1e-6)
    # the error measured is rounding alone
    assert path.critical.force == pytest.approx(original.critical.force, rel=1e-10)
    # the error measured is rounding alone
    assert path.tangent[-1] / 1000.0 == pytest.approx(original.tangent[-1], rel=1e-10)


def test_rotating_a_matrix_part_and_its_frame_changes_nothing(chain, trace):
    """The same compliance given in other own axes is the same part in the posture that does not twist it."""
    R = rotation_from_vector([np.pi / 2.0, 0.0, 0.0])
    parts = tuple(
        replace(part, own_frame=part.own_frame @ R.T, section_frame=R @ part.section_frame,
                compliance=rotate_matrix6(part.compliance, R))
        if part in chain.beams[1:] else part
        for part in chain.parts
    )  # fmt: skip
    path = VjmEngine().trace(replace(chain, parts=parts), LoadCase("A", 2.0))
    assert path.critical.force == pytest.approx(trace("A", 2.0).critical.force, rel=1e-10)
