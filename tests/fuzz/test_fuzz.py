"""Every loader is total: any bytes give a result or one line."""

import pytest

from fuzz.harness import answer, prepare, subjects

SEEDS = 25
"""Mutations of each file here; `make fuzz` goes on for an hour."""


@pytest.mark.parametrize("subject", subjects(), ids=lambda subject: subject.name)
def test_a_mutated_file_is_read_or_refused_in_one_line(subject, tmp_path):
    prepare(tmp_path)
    found = [said for seed in range(SEEDS) if (said := answer(subject, seed, tmp_path))]
    assert found == []


@pytest.mark.parametrize("subject", subjects(), ids=lambda subject: subject.name)
def test_the_sound_file_is_read(subject, tmp_path):
    prepare(tmp_path)
    file = tmp_path / subject.name
    file.write_bytes(subject.content)
    read = subject.load(file)
    # of a model of the library, what is implausible about it
    assert read is not None if not isinstance(read, list) else read == []
