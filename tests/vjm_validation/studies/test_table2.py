import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from vjm.errors import NoConvergenceError
from vjm.io.model_file import load_chain
from vjm.model.parts import RigidOffset
from vjm_updating.identify.rounding import perturbed, printed_entries
from vjm_validation.schemas import schemas
from vjm_validation.studies import table2
from vjm_validation.studies.table2 import (
    OFFSET_MM,
    QUANTITIES,
    TABLE_II,
    TableFit,
    offset_finding,
    offset_fit,
    own_rounding,
    published_figures,
    reach,
    table2_document,
    table_figures,
    with_offset,
)

OURS = {
    "A": {"K0": 3300, "F_cr": 2696, "d_cr": 0.813, "K2": 8.675},
    "B": {"K0": 1063, "F1": 2461},
    "C": {"K0": 15087, "F_cr": 2334, "d_cr": 0.1544, "K2": 8.675},
    "D": {"K0": 1086, "F1": 2146},
}
"""Computed independently of this code, with a prototype, from (19) and (20) as repaired."""


@pytest.mark.parametrize("posture", OURS)
def test_the_papers_model_gives_these_figures(chain, posture):
    figures = table_figures(chain, posture)
    assert figures.sharp == (posture in "AC")
    for quantity, expected in OURS[posture].items():
        # the prototype's figures are given to three or four digits: off by 3e-4 at most
        assert figures.values[quantity] == pytest.approx(expected, rel=2e-3), quantity


def test_every_published_figure_stands_beside_ours(chain):
    rows = published_figures(chain)
    assert {(r.posture, r.quantity) for r in rows} == {(p, q) for p in TABLE_II for q in QUANTITIES}
    for row in rows:
        assert row.published == getattr(TABLE_II[row.posture], row.quantity)
        assert row.ratio == pytest.approx(row.ours / row.published)
        assert row.definition_differs == (row.posture in "BD" and row.quantity in ("K1", "F_cr", "d_cr", "K2"))
        assert bool(row.note) == row.definition_differs


def test_half_units_are_those_of_the_printed_digits(chain):
    half = {(e.part, e.row + 1, e.column + 1): e.half_unit for e in printed_entries(chain)}
    assert len(half) == 19
    assert half["foot", 1, 1] == pytest.approx(0.5e-5)  # 28e-5
    assert half["foot", 6, 6] == pytest.approx(0.5e-9)  # 84e-9
    assert half["link", 2, 2] == pytest.approx(0.5e-2)  # 23e-2
    assert half["link", 2, 6] == pytest.approx(0.5e-4)  # 11e-4


@pytest.mark.slow
@pytest.mark.parametrize("posture", ["A", "D"])
def test_no_rounding_leaves_the_reach(chain, posture):
    intervals = reach(chain, posture)
    entries = printed_entries(chain)
    rng = np.random.default_rng(7)
    seen = 0
    while seen < 25:
        amounts = rng.choice([-1.0, 1.0], len(entries)) * rng.uniform(0.0, 1.0, len(entries)) ** 0.25
        candidate = perturbed(chain, entries, amounts)
        if min(np.linalg.eigvalsh(b.compliance)[0] for b in candidate.beams) <= 0.0:
            continue
        try:
            values = table_figures(candidate, posture).values
        except NoConvergenceError:
            continue
        seen += 1
        for quantity, (low, high) in intervals.items():
            # the corner of the linear model is the best point to second order in the rounding, a per cent
            slack = 0.01 * (high - low)
            assert low - slack <= values[quantity] <= high + slack, quantity


def test_reach_of_the_unloaded_stiffness_in_a_is_the_closed_form(chain):
    # along x in posture A the foot's (1,1) and half the bar's (1,1) are in series
    low, high = reach(chain, "A")["K0"]
    assert low == pytest.approx(1.0 / (28.5e-5 + 46.5e-6 / 2), rel=1e-12)
    assert high == pytest.approx(1.0 / (27.5e-5 + 45.5e-6 / 2), rel=1e-12)
    assert not low <= TABLE_II["A"].K0 <= high


@pytest.fixture(scope="module")
def table(chain) -> TableFit:
    return TableFit(chain)


def rows(table, postures):
    return [figure for figure in table.figures if figure[0] in postures]


def within(table, rng, postures):
    """Random matrices within the rounding that have all figures of some rows."""
    while True:
        amounts = rng.uniform(-1.0, 1.0, len(table.entries))
        beams = perturbed(table.chain, table.entries, amounts).beams
        if all(np.linalg.eigvalsh(beam.compliance)[0] > 0.0 for beam in beams):
            point = table.point(amounts, rows(table, postures))
            if point is not None:
                return point


def test_published_figures_are_known_to_half_a_unit():
    assert own_rounding(("A", "K0")) == pytest.approx(0.5 / 3228)
    assert own_rounding(("C", "d_cr")) == pytest.approx(0.005 / 0.18)
    assert own_rounding(("B", "K3")) == pytest.approx(0.05 / 27.7)


@pytest.mark.slow
def test_a_table_made_by_known_matrices_is_met_by_the_fit(chain, monkeypatch):
    rng = np.random.default_rng(3)
    hidden = within(TableFit(chain), rng, "A").amounts
    made = {}
    for posture in ("A",):
        truth = table2.table_figures(perturbed(chain, TableFit(chain).entries, hidden), posture).values
        made[posture] = table2.PublishedRow(**truth, d1=table2.TABLE_II[posture].d1)
    monkeypatch.setattr(table2, "TABLE_II", made)
    table = TableFit(chain)
    assert {posture for posture, _ in table.figures} == {"A"}
    assert table.printed.rms > 0.005
    # nineteen entries, seven figures: many matrices make the same row, the hidden ones among them; tracing a
    # path locates its critical point to some 1e-5
    assert table.fit(table.figures).rms < 1e-4
    assert table.level(table.figures).worst < 1e-4
    found = table.most(1e-3)
    assert set(found.misses) == set(table.figures)
    assert np.max(np.abs(found.amounts)) <= 1.0 + 1e-9


@pytest.mark.slow
def test_no_matrices_within_the_rounding_do_better(table):
    level, fit = table.level(rows(table, "A")), table.fit(rows(table, "A"))
    assert np.max(np.abs(level.amounts)) <= 1.0 + 1e-9
    # A publishes K1 = K0 = 3228; the model's stiffness rises by 0.9 % on the way to the critical point
    assert level.worst == pytest.approx(0.0136, abs=5e-4)
    assert fit.rms < table.point(np.zeros(len(table.entries)), rows(table, "A")).rms
    rng = np.random.default_rng(8)
    for _ in range(40):
        other = within(table, rng, "A")
        assert other.worst >= level.worst
        assert other.rms >= fit.rms


@pytest.mark.slow
def test_the_fit_is_the_same_from_anywhere(table):
    rng = np.random.default_rng(4)
    first = table.fit(rows(table, "AC"))
    other = table.fit(rows(table, "AC"), within(table, rng, "AC").amounts)
    assert other.rms == pytest.approx(first.rms, rel=1e-3)


@pytest.mark.slow
def test_row_c_can_be_met_and_row_b_cannot(table):
    # beyond what its own digits explain, 0.06 %
    assert table.level(rows(table, "C")).worst < 2e-3
    # B's stiffness at the end of its path is a quarter off, whatever the rounding
    lone = table.level(rows(table, "B"))
    assert lone.worst > 0.2
    assert max(lone.misses, key=lambda figure: lone.beyond(figure)) == ("B", "K3")


@pytest.mark.slow
def test_a_wider_box_meets_the_table_better(chain, table):
    wide = TableFit(chain, 2.0).fit(rows(table, "B"))
    narrow = table.fit(rows(table, "B"))
    assert wide.rms < narrow.rms
    assert np.max(np.abs(narrow.amounts)) <= 1.0 + 1e-9
    assert 1.0 < np.max(np.abs(wide.amounts)) <= 2.0 + 1e-9


def test_other_chains_are_refused(chain):
    with pytest.raises(ValueError, match="printed compliance matrices"):
        TableFit(load_chain("pinned-column"))
    with pytest.raises(ValueError, match="no posture is named as a row of Table II"):
        TableFit(replace(chain, postures={"home": chain.posture("A")}))


@pytest.mark.slow
def test_the_document_says_what_can_be_met_at_once(chain):
    document = table2_document(TableFit(chain))
    jsonschema.validate(json.loads(document.model_dump_json()), schemas()["table2.schema.json"])
    assert document.rms_fitted == pytest.approx(0.0860, abs=5e-4)
    assert document.rms_printed == pytest.approx(0.1238, abs=5e-4)
    counts = [len(one.met) for one in document.agreements]
    assert counts == sorted(counts)
    assert all("B K3" in one.not_met and "D K0" in one.not_met for one in document.agreements)
    for figure in document.figures:
        # a fit within the rounding is within the reach, which is found by other means
        slack = 1e-3 * abs(figure.published)
        assert figure.reach_low - slack <= figure.fitted <= figure.reach_high + slack
    assert all(abs(entry.moved) <= 1.0 + 1e-9 for entry in document.entries)


# Table II with an offset behind the foot: the figures that are reported, and that they are said to be a fit.


def test_the_offset_lies_behind_the_foot_and_moves_the_tool_by_itself(chain):
    moved = with_offset(chain, OFFSET_MM)
    foot = [part.name for part in chain.parts].index("foot")
    assert isinstance(moved.parts[foot + 1], RigidOffset)
    assert tuple(moved.parts[foot + 1].transform[:3, 3]) == OFFSET_MM


def test_the_other_way_round_the_table_is_missed_by_more(chain):
    printed, fitted, opposite = (offset_fit(chain, (x, 0.0, 0.0)) for x in (0.0, -8.0, 8.0))
    assert fitted.within > printed.within > opposite.within
    assert fitted.largest_miss < 0.3 * printed.largest_miss < 0.3 * opposite.largest_miss
    assert fitted.sharp == printed.sharp == ("A", "C")


def test_it_is_said_to_be_no_evidence(chain):
    said = offset_finding(chain)
    assert "from 15.6 to 4.4 %" in said
    assert "21 instead of 16 of 28" in said
    assert "no evidence" in said
