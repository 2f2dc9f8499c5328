"""The steps that an engine takes by itself are those that are taken one by one."""

import numpy as np
import pytest

from vjm.continuation.load_stepping import follow
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase

CASES = [("A", -4.0, 4), ("A", 2.0, None), ("B", 4.0, 4), ("C", -1.0, 4), ("D", -4.0, None)]


@pytest.mark.parametrize(("posture", "to", "segments"), CASES)
def test_the_same_path_is_found_step_by_step(chain, monkeypatch, posture, to, segments):
    engine, load_case = VjmEngine(segments), LoadCase(posture, to)
    problem, taken = engine.problem(chain, load_case), []
    own = LumpedProblem.plain_steps

    def counted(self, *arguments):
        found, step = own(self, *arguments)
        taken.extend(found)
        return found, step

    monkeypatch.setattr(LumpedProblem, "plain_steps", counted)
    path = follow(problem, load_case)
    assert 2 * len(taken) > len(path.points)

    monkeypatch.setattr(LumpedProblem, "plain_steps", lambda self, known, limits, origin, step: ([], step))
    one_by_one = follow(engine.problem(chain, load_case), load_case)
    assert len(path.points) == len(one_by_one.points)
    # the same arithmetic but for the order of sums: rounding, enlarged by the steps that follow one another
    assert path.s == pytest.approx(one_by_one.s, rel=1e-12)
    assert path.stopped == one_by_one.stopped
    assert [e.kind for e in path.events] == [e.kind for e in one_by_one.events]
    # events are located to 1e-9 of themselves
    assert [e.s for e in path.events] == pytest.approx([e.s for e in one_by_one.events], rel=1e-9)
    unit = problem.model.wrench_scale
    for mine, other in zip(path.points, one_by_one.points, strict=True):
        assert mine.residual < 1e-11
        assert mine.unstable == other.unstable
        assert mine.iterations == other.iterations
        # residuals are below 1e-11, which a branch's softness enlarges
        assert np.abs((mine.wrench - other.wrench) / unit).max() < 1e-9 * max(
            1.0, np.abs(other.wrench / unit).max()
        )
        # a branch's amplitude is the root of the distance from its bifurcation: just behind it rounding of 1e-14
        # leaves some 3e-7 mm of the shape, and 4e-9 of the stiffness
        assert mine.shape == pytest.approx(other.shape, rel=1e-9, abs=1e-6)
        assert mine.displacement == pytest.approx(other.displacement, rel=1e-12, abs=1e-15)
        assert mine.stiffness == pytest.approx(other.stiffness, rel=1e-7, abs=1e-7 * np.abs(other.stiffness).max())
