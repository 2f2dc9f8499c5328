"""Beams behind matrices, from matrices that are known to be beams'."""

import numpy as np
import pytest

from vjm_updating.identify.beam_fit import Form, Target, as_people_write_it, ranges, search
from vjm_updating.identify.command import examine
from vjm_updating.identify.matrix_file import parse_matrix, target
from vjm_updating.identify.report import scaling

from .textbook import as_text, cantilever, rotation, turned, with_rigid_arm


def random_section(rng) -> dict:
    """A slender beam: EI differ by up to a factor of 10, EA L²/EI is a few hundred to some ten thousand."""
    EIz = 10.0 ** rng.uniform(7, 9)
    EIy = EIz * 10.0 ** rng.uniform(-1, 1)
    return {
        "EA": EIz * 10.0 ** rng.uniform(-2, 0),
        "GJ": EIz * 10.0 ** rng.uniform(-1, 0.3),
        "EIy": EIy,
        "EIz": EIz,
    }


def tight(C) -> Target:
    return Target(C, 1e-7 * scaling(C))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_straight_beam_is_found_again(seed):
    rng = np.random.default_rng(seed)
    L, R, s = rng.uniform(50.0, 800.0), rotation(rng), random_section(rng)
    found = search(tight(turned(cantilever(L, **s), R)), Form.STRAIGHT)
    assert found.met
    beam = found.beam.beam
    # the fit meets the matrix to rounding: 1e-15, and 1e-11 of EA, which is the smallest compliance
    assert beam.length == pytest.approx(L, rel=1e-10)
    assert beam.section_frame[:, 0] == pytest.approx(R[:, 0], abs=1e-10)
    assert beam.section.EA == pytest.approx(s["EA"], rel=1e-9)
    assert beam.section.GJ == pytest.approx(s["GJ"], rel=1e-10)
    assert sorted([beam.section.EIy, beam.section.EIz]) == pytest.approx(sorted([s["EIy"], s["EIz"]]), rel=1e-10)


@pytest.mark.slow
def test_shear_is_found_where_it_shows():
    s = {"EA": 7e6, "GJ": 1e7, "EIy": 2e8, "EIz": 5e7, "GAy": 4e4, "GAz": 9e4}
    C = turned(cantilever(200.0, **s), rotation(np.random.default_rng(11)))
    assert not search(tight(C), Form.STRAIGHT).met
    found = search(tight(C), Form.SHEARED)
    assert found.met
    section = as_people_write_it(found.beam.beam).section
    # bending about z and shear along y make one deflection
    planes = sorted([(section.EIz, section.GAy), (section.EIy, section.GAz)])
    # to rounding again
    assert planes[0] == pytest.approx((5e7, 4e4), rel=1e-10)
    assert planes[1] == pytest.approx((2e8, 9e4), rel=1e-10)
    assert found.beam.beam.beam_compliance() == pytest.approx(C, abs=1e-12 * float(np.max(np.abs(C))))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_beam_with_a_rigid_offset_is_found_again(seed):
    rng = np.random.default_rng(100 + seed)
    L, R, s = rng.uniform(80.0, 300.0), rotation(rng), random_section(rng)
    arm = 0.15 * L * rng.standard_normal(3)
    C = with_rigid_arm(turned(cantilever(L, **s), R), arm)
    assert not search(tight(C), Form.STRAIGHT).met
    found = search(tight(C), Form.OFFSET)
    assert found.met
    beam = as_people_write_it(found.beam.beam)
    # to rounding
    assert beam.length == pytest.approx(L, rel=1e-10)
    # from the middle to the tip there is one way only; which end is the root no compliance tells
    middle = 0.5 * L * R[:, 0] + arm
    assert 0.5 * beam.length * beam.section_frame[:, 0] + beam.end_offset == pytest.approx(middle, abs=1e-10 * L)
    assert abs(beam.section_frame[:, 0] @ R[:, 0]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 12))])
def test_rounding_to_two_digits_leaves_the_truth_within_the_ranges(seed):
    rng = np.random.default_rng(200 + seed)
    L, s = rng.uniform(100.0, 500.0), random_section(rng)
    angle = rng.uniform(-1.2, 1.2)
    R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    aim = target(parse_matrix(as_text(turned(cantilever(L, **s), R), 2), "rounded.txt"))
    found = search(aim, Form.STRAIGHT)
    assert found.met
    spans = ranges([fit for fit in (found.nearest, *found.levelled) if fit.met])
    truth = {
        "length_mm": L,
        "azimuth_deg": np.rad2deg(angle),
        "elevation_deg": 0.0,
        "EA_N": s["EA"],
        "GJ_Nmm2": s["GJ"],
        "EIy_Nmm2": s["EIy"],
        "EIz_Nmm2": s["EIz"],
    }
    for name, value in truth.items():
        span = spans[name]
        # ends are reached to 1e-4 of the intervals
        margin = 1e-3 * (min(span.high, 1e3 * abs(span.low)) - span.low)
        assert span.low - margin <= value <= span.high + margin, name


def test_what_no_entry_shows_is_not_called_known():
    # bending at 45° hides an axial stiffness a million times larger
    R = np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    C = turned(cantilever(100.0, EA=1e13, GJ=1e8, EIy=1e8, EIz=1e8), R)
    document = examine(parse_matrix(as_text(C, 2), "hidden.txt"))
    straight = document.beams[0]
    assert straight.met
    assert straight.ranges["EA_N"].high is None
    assert {"EA_N", "GAy_N", "GAz_N", "section's turn about the beam"} <= set(straight.not_identifiable)


def test_the_nearest_beam_to_what_is_none_is_near():
    # an L-shaped frame of equal legs is no beam; what is found must beat the plain guesses
    first = cantilever(100.0, EA=1e7, GJ=1e8, EIy=1e8, EIz=1e8)
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    C = with_rigid_arm(first, [0.0, 100.0, 0.0]) + turned(first, R)
    aim = Target(C, 0.01 * scaling(C))
    found = search(aim, Form.STRAIGHT)
    assert not found.met
    assert found.worst <= found.nearest.worst
    rng = np.random.default_rng(5)
    for _ in range(300):
        guess = turned(cantilever(rng.uniform(50, 300), **random_section(rng)), rotation(rng))
        misses = np.abs((guess - C) / aim.half)[np.triu_indices(6)]
        assert np.max(misses) >= found.worst
        assert misses @ misses >= found.nearest.squares
