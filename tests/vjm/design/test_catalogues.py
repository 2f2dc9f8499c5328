"""Standard parts are chosen as by trying all of them; an interrupted search goes on to the same end."""

import itertools

import numpy as np
import pytest

import vjm
from vjm.design import best_machine
from vjm.design.optimum import limits_of
from vjm.io.provenance import OtherInputsError

FEW = vjm.VjmEngine(1)
SMALL = [{"name": f"{b}x{w}", "shape": "square_tube", "width_mm": float(b), "wall_mm": float(w)}
         for b, w in ((30, 2), (40, 2), (40, 4), (50, 2), (60, 3), (70, 3))]  # fmt: skip
ROUND = [{"shape": "round_tube", "diameter_mm": float(d), "wall_mm": 2.0} for d in (35, 45, 55, 65)]
LIMIT = "deflection<=6.0"
CASE = {"cases": vjm.LoadCases(["stretched"], [(0.0, -10.0, 0.0, 0.0, 0.0, 0.0)], engine=FEW)}


def by_trying(choices, numbers=None, limit=LIMIT, objective="mass"):
    """The lightest machine that keeps the limit, each combination by itself."""
    (bound,) = limits_of(limit)
    files, found = vjm.design.space.numbered("planar-2r"), []
    for rows in itertools.product(*choices.values()):
        chosen = dict(zip(choices, rows, strict=True))
        own = files.with_rows({key: {k: v for k, v in row.items() if k != "name"} for key, row in chosen.items()})
        if numbers is None:
            (row,) = vjm.sweep(own, {"tool.mass_kg": [2.0]}, [objective, str(bound.of)], **CASE).table()
            value, kept = row[objective], bound.margin(row[str(bound.of)]) >= 0.0
        else:
            best = vjm.optimise(own, numbers, minimise=objective, such_that=limit, starts=2, **CASE)
            value, kept = best.objective, best.kept
        if kept:
            found.append((value, [str(row.get("name")) for row in rows]))
    return min(found)


@pytest.mark.parametrize("tried", [200, 1])
@pytest.mark.parametrize(
    ("choices", "limit"),
    [
        ({"upper.section": SMALL, "fore.section": SMALL}, LIMIT),
        pytest.param({"upper.section": SMALL, "fore.section": SMALL}, "deflection<=5.75", marks=pytest.mark.slow),
        ({"upper.section": [*SMALL[:3], *ROUND], "fore.section": ROUND}, "deflection<=7.0"),
    ],
    ids=["squares", "a tighter limit", "mixed shapes"],
)
def test_the_best_rows_are_those_of_trying_all(monkeypatch, choices, limit, tried):
    """Once by trying, once by branch and bound."""
    monkeypatch.setattr(best_machine, "TRIED", tried)
    best = vjm.optimise("planar-2r", choices, minimise="mass", such_that=limit, starts=2, **CASE)
    value, names = by_trying(choices, limit=limit)
    assert best.kept
    # the same machine, computed in the same way
    assert best.objective == pytest.approx(value, rel=1e-12)
    assert [str(row.get("name")) for row in best.chosen.values()] == names
    if tried == 1:
        assert best.evaluations > 0


@pytest.mark.slow
def test_rows_and_numbers_vary_together():
    choices, numbers = {"upper.section": SMALL}, {"fore.section.width_mm": (20.0, 70.0)}
    best = vjm.optimise("planar-2r", {**choices, **numbers}, minimise="mass", such_that=LIMIT, starts=2, **CASE)
    value, names = by_trying(choices, numbers)
    # both are optimised to 1e-6 of the limit
    assert best.objective == pytest.approx(value, rel=1e-5)
    (width,) = best.values
    # one number, at its place between 20 and 70 mm
    assert best.plot().patches[0].get_width() == pytest.approx((width - 20.0) / 50.0)
    assert [str(row.get("name")) for row in best.chosen.values()] == names


def test_a_function_takes_a_row():
    def arm(bar=SMALL[0]):
        sizes = {key: value for key, value in bar.items() if key not in ("shape", "name")}
        section = vjm.shape(bar["shape"], **sizes).stiffness()
        return vjm.build("arm", [vjm.Beam("bar", 500.0, section=section)])

    push = vjm.LoadCases(wrenches=[(0.0, -100.0, 0.0, 0.0, 0.0, 0.0)])
    best = vjm.optimise(arm, {"bar": SMALL}, minimise="mass", such_that="deflection<=0.2", cases=push)
    # PL³/3EI of each row, the lightest that keeps the limit; large deflections change 0.2 mm of 500 by 1e-7
    bent = {
        row["name"]: 100.0 * 500.0**3 / (3.0 * s.EIz)
        for row in SMALL
        if (s := vjm.shape("square_tube", width_mm=row["width_mm"], wall_mm=row["wall_mm"]).stiffness())
    }
    light = {row["name"]: row["wall_mm"] * (row["width_mm"] - row["wall_mm"]) for row in SMALL}
    expected = min((name for name in bent if bent[name] <= 0.2), key=light.__getitem__)
    assert best.chosen["bar"]["name"] == expected
    assert best.machine.beams[0].length == 500.0
    assert best.table()[0]["value"] == expected


class Stop:
    """Interrupts after some calls."""

    def __init__(self, after):
        self.left = after

    def __call__(self, machines, best):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("vary", [{"upper.section": SMALL, "fore.section": SMALL},
                                  {"upper.section.width_mm": (30.0, 80.0)}], ids=["rows", "numbers"])  # fmt: skip
def test_an_interrupted_search_goes_on_to_the_same_end(tmp_path, vary):
    state = tmp_path / "state.json"
    words = {"minimise": "mass", "such_that": LIMIT, "starts": 2, **CASE}
    whole = vjm.optimise("planar-2r", vary, **words)
    first = vjm.optimise("planar-2r", vary, **words, progress=Stop(4), state=state)
    assert first.interrupted
    assert first.evaluations < whole.evaluations
    again = vjm.optimise("planar-2r", vary, **words, state=state)
    assert not again.interrupted
    assert again.to_dict() == whole.to_dict()
    with pytest.raises(OtherInputsError, match="is of another machine or question"):
        vjm.optimise("planar-2r", vary, **(words | {"such_that": "deflection<=5.0"}), state=state)
    state.write_text(state.read_text().replace("content", "contents"))
    with pytest.raises(OtherInputsError, match="is not as it was written"):
        vjm.optimise("planar-2r", vary, **words, state=state)


# cross-sections in cm² that the tables of the UK's range of EN 10219 print for these sizes, to three digits
PRINTED = {
    "square-tubes": {
        "40x40x2": 2.94, "40x40x2.5": 3.59, "40x40x3": 4.21, "40x40x4": 5.35, "50x50x2.5": 4.59, "50x50x3": 5.41,
        "50x50x4": 6.95, "60x60x3": 6.61, "60x60x4": 8.55, "70x70x3": 7.81, "80x80x3": 9.01, "80x80x4": 11.7,
        "80x80x5": 14.4, "100x100x4": 14.9, "100x100x5": 18.4,
    },
    "round-tubes": {
        "33.7x3": 2.89, "42.4x3": 3.71, "48.3x3": 4.27, "48.3x4": 5.57, "60.3x3": 5.4, "60.3x4": 7.07,
        "76.1x3": 6.89, "76.1x4": 9.06, "88.9x3": 8.1, "88.9x4": 10.7, "88.9x5": 13.2, "114.3x3": 10.5,
        "114.3x4": 13.9, "114.3x5": 17.2, "114.3x6": 20.4,
    },
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTED)
def test_each_row_of_the_library_has_the_area_that_is_printed_for_its_size(name):
    rows = vjm.catalogue(name)
    assert [row["name"] for row in rows] == list(PRINTED[name])
    for row in rows:
        sizes = {key: cell for key, cell in row.items() if key not in ("shape", "name")}
        area = vjm.shape(row["shape"], **sizes).area
        if name == "square-tubes":
            # less what corners of twice the wall outside and once inside take away
            area -= (4.0 - np.pi) * 3.0 * row["wall_mm"] ** 2
        # half a unit of the third digit
        assert area == pytest.approx(100.0 * PRINTED[name][row["name"]], rel=5e-3)


@pytest.mark.parametrize(
    ("text", "name", "said"),
    [
        ("", "a.csv", "has no rows"),
        ("width_mm,wall_mm\n40\n", "a.csv", "row 1: needs a value for each of width_mm, wall_mm"),
        ("rows = 3\n", "a.toml", r"write \[\[rows\]\]"),
        ("rows = \n", "a.toml", "not valid TOML"),
    ],
)
def test_a_bad_catalogue_is_one_line(tmp_path, text, name, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(vjm.ModelFileError, match=said):
        vjm.catalogue(tmp_path / name)


def test_a_catalogue_of_a_file_is_read(tmp_path):
    (tmp_path / "a.csv").write_text("# of a shop\nname,width_mm,wall_mm\n40x2,40,2\n")
    assert vjm.catalogue(tmp_path / "a.csv") == [{"name": "40x2", "width_mm": 40.0, "wall_mm": 2.0}]


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        ({"uper.section": SMALL}, "did you mean 'upper.section'"),
        ({"upper.section": SMALL, "upper.section.width_mm": (30.0, 60.0)}, "let one of both vary"),
        ({"upper.section": [{"diameter_mm": 30.0}]}, "diameter_mm"),
    ],
)
def test_a_choice_that_fits_no_part_is_refused(vary, said):
    with pytest.raises(ValueError, match=said):
        vjm.optimise("planar-2r", vary, minimise="mass", such_that=LIMIT, **CASE)
