"""Mutated URDFs: one line or a robot, with Pinocchio's joints and masses where it reads them."""

import pytest

from fuzz.urdf_mutations import subjects, wrong

SAMPLE, MANY = 100, 3400


def answers(name, text, seeds, folder):
    found = [wrong(name, text, seed, folder) for seed in seeds]
    assert [said for said, _ in found if said] == []
    # the comparison is of something: more than a fifth of the mutated files are read by both
    assert sum(both for _, both in found) > 0.2 * len(found)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), subjects().items(), ids=subjects())
def test_a_mutated_urdf_loses_nothing_in_silence(tmp_path, name, text):
    answers(name, text, range(SAMPLE), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), subjects().items(), ids=subjects())
def test_ten_thousand_mutated_urdfs(tmp_path, name, text):
    answers(name, text, range(SAMPLE, SAMPLE + MANY), tmp_path)
