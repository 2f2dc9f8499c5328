"""Critical forces before and after, and where the material would yield."""

import copy
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import from_files
from helpers.command import json_of, validate
from helpers.file_texts import instruments_text, table_text

from vjm.continuation.arc_length import trace
from vjm.engines import VjmEngine
from vjm.io.model_file import build_chain, load_chain, read_document
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm.model.parameters import compliance_factor
from vjm_updating.diagnosis.kinds import kind_of
from vjm_updating.diagnosis.preprocess import critical_points, prepare, refresh
from vjm_updating.diagnosis.ramp_kind import knee
from vjm_updating.diagnosis.run import aside_words
from vjm_updating.diagnosis.stress import fibre_of, first_yield
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.fitting import LeastSquaresProblem, best_fit
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.mechanisms.column import column_force

COLUMN = read_document("pinned-column").content


def column(**section):
    document = copy.deepcopy(COLUMN)
    table = document["parts"][1]
    bow = section.pop("bow_mm", None)
    table["section"] |= section
    if bow:
        table["bow_mm"] = bow
    return document


def traced(document, load_case, segments=32):
    problem = VjmEngine(segments).problem(build_chain(document, "m.toml"), load_case)
    return problem, trace(problem, load_case)


def squeezed(to):
    """Squeezed along x by a force, controlled by the deflection of the middle."""
    push = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return LoadCase(
        "straight", to, "load", free=("x",), loads=(push,), control=PointControl("link", 0.5, (0, 1, 0))
    )


def test_a_pulled_bar_yields_all_through():
    # (a squeezed one buckles long before)
    problem, path = traced(COLUMN, LoadCase("straight", 1.5))
    found = first_yield(problem, path, COLUMN["parts"])
    # linear, so that the interpolation is exact
    assert found.force == pytest.approx(241.3 * 25.4 * 3.175, rel=1e-10)
    assert found.words == "on the way, in link"


def test_a_column_buckles_long_before_it_yields():
    document = column()
    problem, path = traced(document, LoadCase("straight", -1.0))
    found = first_yield(problem, path, document["parts"])
    euler = np.pi**2 * 68948.0 * 25.4 * 3.175**3 / 12.0 / 299.085**2
    # it shortens before it buckles: P (1 - P/EA) is Euler's, a second step of which is below 2e-8
    assert path.critical.force == pytest.approx(euler * (1.0 + euler / (68948.0 * 25.4 * 3.175)), rel=1e-6)
    share = 100.0 * euler / (241.3 * 25.4 * 3.175)
    assert found.force is None
    assert found.words == f"not before: {share:.0f} % of the yield stress is reached at the bifurcation"


def test_a_bowed_column_yields_where_beam_theory_says():
    document = column(bow_mm=[2.0, 0.0])
    problem, path = traced(document, squeezed(30.0), 64)
    found = first_yield(problem, path, document["parts"])
    w = np.linspace(1.0, 30.0, 400)
    P = column_force(w, 299.085, 68948.0 * 25.4 * 3.175**3 / 12.0, 2.0)
    stress = P / (25.4 * 3.175) + P * (w + 2.0) / (25.4 * 3.175**2 / 6.0)
    # the force grows by a tenth of a per cent per 0.1 mm here; steps of the path are interpolated linearly
    assert found.force == pytest.approx(np.interp(241.3, stress, P), rel=2e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"yield_stress_MPa": None}, "not known: the model says no yield stress of link"),
        ({"shape": None}, "not known: the model says no shape of the section of link"),
    ],
)
def test_it_says_what_is_not_known(change, words):
    table = column()["parts"][1]
    for key in change:
        table["section"].pop(key)
    assert fibre_of(table) == words


def test_a_knee_is_seen_only_where_there_is_one():
    s = np.linspace(0.0, 3.0, 40)
    # one of the places is where the lines meet
    assert knee(s, np.minimum(1000.0 * s, 2000.0 + 50.0 * (s - 2.0))) == pytest.approx((2.0, 2000.0), rel=1e-10)
    assert knee(s, 1000.0 * s) is None
    # what goes on with more than half of its slope is not level
    behind = [knee(s, np.minimum(1000.0 * s, 2000.0 + slope * (s - 2.0)))[1] for slope in (490.0, 510.0)]
    assert behind[0] == pytest.approx(2000.0, rel=1e-10)
    assert behind[1] != pytest.approx(2000.0, rel=1e-3)


def test_what_bends_on_behind_its_knee_has_no_second_one():
    s = np.linspace(1.0 / 3.0, 4.0, 12)
    # read behind its knee only
    assert knee(s, 7500.0 + 1140.0 * np.sqrt(s)) is None
    assert knee(s, np.minimum(24000.0 * s, 7500.0 + np.minimum(500.0 * s, 1400.0))) is None
    # and with its zero off by a hundredth; the lines meet at one of the places, to rounding
    fine = np.linspace(0.0, 3.0, 40)
    assert knee(fine, 20.0 + np.minimum(1000.0 * fine, 2000.0))[0] == pytest.approx(2.0, rel=1e-10)


SHEET = (
    table_text("test", model="orthoglide-chain")
    + table_text("model", link_segments=12)
    + instruments_text(ux_mm=(0.001, 0.002, 0.001), fx_N=(2.0, 3.0, 0.003))
    + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
)


@pytest.fixture(scope="module")
def pushed_past_buckling(tmp_path_factory):
    """Data and sheet of a bar 15 % softer than its matrix, pulled, and pushed past where it buckles; its force."""
    folder: Path = tmp_path_factory.mktemp("pushed")
    nominal = load_chain("orthoglide-chain")
    truth = compliance_factor(nominal, "link").apply(nominal, 1.15)
    path, pulled = (VjmEngine(12).trace(truth, LoadCase("A", to)) for to in (-3.4, 1.3))
    rng = np.random.default_rng(4)
    u = np.concatenate([np.linspace(0.1, 1.2, 15), np.linspace(1.1, -3.3, 45), np.linspace(-3.25, -0.1, 20)])
    force = np.where(u > 0.0, np.interp(u, pulled.s, pulled.force), -np.interp(-u, path.s, path.force))
    force += 2.0 * rng.standard_normal(len(u))
    rows = [f"{2.0 * k:.1f},A,{x:.4f},{f:.2f}" for k, (x, f) in enumerate(zip(u, force, strict=True))]
    (folder / "data.csv").write_text("\n".join(["time_s,posture,ux_mm,fx_N", *rows]) + "\n")
    (folder / "sheet.toml").write_text(SHEET)
    assert path.critical is not None
    return folder / "data.csv", folder / "sheet.toml", path.critical.force


@pytest.mark.slow
def test_the_critical_force_that_was_read_is_predicted_after(pushed_past_buckling):
    data, sheet, truth = pushed_past_buckling
    prepared = prepare(observe_ramps(read_measurement(data, sheet)))
    cause = next(effect for effect in prepared.effects if effect.cause == "link_compliance")
    zero = np.zeros(len(prepared.fitter.nuisances))
    # of what pushes and pulls short of the critical point a softer foot says the same
    short = best_fit(prepared.fitter, (cause,), zero, [[1.05]])
    prepared = refresh(prepared, short, np.zeros_like(prepared.aside))
    fit = best_fit(prepared.fitter, (cause,), zero, [[1.05]])
    (pushed, pulled) = critical_points(prepared, fit)
    assert (pushed.direction, pulled.direction) == ("compression", "tension")
    # read off where two slopes meet, from readings 0.1 mm apart: 0.4 % off
    assert pushed.measured_N == pytest.approx(truth, rel=0.01)
    # the sheet's own: Euler's load of the bar as drawn, to four digits
    assert (pushed.nominal, pushed.nominal_N) == ("bifurcation", pytest.approx(8849.0, rel=1e-4))
    # 80 readings with a noise of 2 N and a scale of 0.3 %
    assert (pushed.extended, pushed.extended_N) == ("bifurcation", pytest.approx(truth, rel=5e-3))
    forces = pushed.forces
    off = abs(pushed.nominal_N - forces.measured_N)
    assert abs(forces.after_N - forces.measured_N) < 0.2 * off
    assert pushed.yields_N is None
    assert pushed.yields.startswith("not known: the model says no shape")
    # bars do not buckle when pulled
    assert (pulled.measured_N, pulled.nominal_N, pulled.extended_N) == (None, None, None)
    assert pulled.reached_N > 3000.0


@pytest.mark.slow
def test_the_extended_file_buckles_where_the_diagnosis_says(pushed_past_buckling, tmp_path):
    data, sheet, truth = pushed_past_buckling
    # a bar that differs between pull and push would explain them, too
    causes = ["--without", "tension_compression_asymmetry"]
    validate("diagnose", data, f"--sheet={sheet}", f"--out={tmp_path}", "--json", *causes)
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert "link_compliance" in found["causes"]
    row = next(row for row in found["critical"] if row["direction"] == "compression")
    assert found["gain"]["critical"]["measured_N"] == row["measured_N"] == pytest.approx(truth, rel=0.01)
    chain = json_of("buckling", tmp_path / "extended-model.toml", "--posture", "A", "--direction", "-")["chain"]
    (metrics,) = chain["A"]["compression"].values()
    assert metrics["F_cr"] == pytest.approx(row["extended_N"], rel=1e-4)


# Yield of parts from drawings: the same bar once as a shape, once by forms of its stress.

LENGTH, WIDTH, THICKNESS, LIMIT = 299.085, 25.4, 3.175, 241.3


def bar_stress(x, y, z):
    """Axial stress ``(6,)`` per unit wrench at the tip of a rectangular bar, at a point of it."""
    A, Iy, Iz = WIDTH * THICKNESS, THICKNESS * WIDTH**3 / 12.0, WIDTH * THICKNESS**3 / 12.0
    arm = LENGTH - x
    # the moments at x: My = my − fz arm, Mz = mz + fy arm
    return np.array([1.0 / A, -y * arm / Iz, -z * arm / Iy, 0.0, z / Iy, -y / Iz])


def drawn(segments, places):
    """The table of a drawing with the stress at the corners of sections along the bar."""
    points, forms = [], []
    for x in np.linspace(0.0, LENGTH, places):
        for y in (-0.5 * THICKNESS, 0.5 * THICKNESS):
            for z in (-0.5 * WIDTH, 0.5 * WIDTH):
                s = bar_stress(x, y, z)
                points.append([float(x), y, z])
                forms.append(np.outer(s, s)[np.triu_indices(6)].tolist())
    return {
        "file": "bar.step", "thickness_mm": THICKNESS, "yield_stress_MPa": LIMIT,
        "stress_at_mm": points, "stress_forms": forms,
    }  # fmt: skip


def documents(segments, **changes):
    """The column as a shape, and with a drawing."""
    shape = copy.deepcopy(COLUMN)
    shape["parts"][1] |= changes
    solid = copy.deepcopy(shape)
    solid["parts"][1]["drawing"] = drawn(segments, segments + 1)
    del solid["parts"][1]["section"]["yield_stress_MPa"]
    return shape, solid


def firsts(documents, load_case, segments):
    found = []
    for document in documents:
        problem = VjmEngine(segments).problem(build_chain(document, "m.toml"), load_case)
        found.append(first_yield(problem, trace(problem, load_case), document["parts"]))
    return found


def test_a_bowed_column_yields_at_the_same_force():
    """Compression bends its middle most: a point has to bear what its own segment bears, not what the tip does."""
    shape, solid = firsts(documents(16, bow_mm=[2.0, 0.0]), LoadCase("straight", -20.0), 16)
    assert shape.force is not None
    # a corner between two segments is counted to one of them
    assert solid.force == pytest.approx(shape.force, rel=5e-3)
    assert solid.words == "on the way, in link"


def test_a_pulled_bar_of_a_drawing_yields_all_through():
    shape, solid = firsts(documents(4), LoadCase("straight", 1.5), 4)
    assert solid.force == pytest.approx(LIMIT * WIDTH * THICKNESS, rel=1e-3)
    assert solid.force == pytest.approx(shape.force, rel=1e-9)


def test_round_bars_have_no_corners():
    document = copy.deepcopy(COLUMN)
    section = document["parts"][1]["section"]
    for key in ("width_mm", "thickness_mm"):
        del section[key]
    d = 6.0
    section |= {"shape": "round_bar", "diameter_mm": d}
    (found,) = firsts([document], LoadCase("straight", 1.5), 4)
    assert found.force == pytest.approx(LIMIT * np.pi * d**2 / 4.0, rel=1e-3)


def test_a_drawing_without_a_yield_stress_says_so():
    _, solid = documents(4)
    del solid["parts"][1]["drawing"]["yield_stress_MPa"]
    (found,) = firsts([solid], LoadCase("straight", 0.1), 4)
    assert (found.force, found.known) == (None, False)
    assert found.words == "not known: the model says no yield stress of link"


@pytest.fixture(scope="module")
def past_buckling(make, tmp_path_factory):
    """A soft drive pushed past its critical point, and the same test held straight there."""
    folder = tmp_path_factory.mktemp("past")
    with pytest.MonkeyPatch.context() as patch:
        files = make.made_up(folder, {"actuator_compliance": (2e-5,)}, 5, patch, reach=3.2, per=16)
    header, *rows = (line.split(",") for line in files.data.read_text().splitlines())
    u, force = (header.index(name) for name in ("ux_mm", "fx_N"))
    straight = []
    for row in rows:
        own = row.copy()
        if row[header.index("posture")] == "A" and float(row[u]) < -2.75:
            # what friction does that holds the joints
            own[force] = f"{float(row[force]) * 1.15:.4f}"
        straight.append(own)
    held = folder / "held.csv"
    held.write_text("\n".join(",".join(row) for row in (header, *straight)) + "\n")
    return files, held


@pytest.fixture(scope="module")
def begun(past_buckling):
    """The soft drive's test before any cause is tried."""
    files, _ = past_buckling
    return prepare(observe_ramps(read_measurement(files.data, files.sheet)))


def pushed_in_a(rows):
    """What was found of posture A as it is pushed."""
    return next(row for row in rows if (row.posture, row.direction) == ("A", "compression"))


def test_a_search_begins_before_the_critical_points(begun):
    prepared = begun
    u = np.abs(prepared.all.imposed[:, 0])
    on = (prepared.all.readings.posture == "A") & (prepared.all.imposed[:, 0] < 0.0)
    assert prepared.critical.any()
    # the posture buckles at 2.72 mm as drawn
    assert u[prepared.critical & on].min() > 0.85 * 2.72
    assert prepared.critical[on & (u > 2.8)].all()
    assert not prepared.fitter.forward.observed.present[prepared.critical].any()


@pytest.mark.slow
@pytest.mark.parametrize("straight", [False, True])
def test_what_happens_past_a_critical_point_hides_no_cause(past_buckling, tmp_path, straight):
    files, held = past_buckling
    found = from_files.diagnose(held if straight else files.data, files.sheet, tmp_path / "out")
    # of two postures a soft base is as likely as one to twenty
    assert found.verdict in ("named", "class")
    assert found.candidates[0].causes == ["actuator_compliance"]
    value = found.parameters["actuator_compliance.compliance_mm_per_N"]
    assert abs(value.value - 2e-5) < 3.5 * value.std
    assert (found.noise.critical > 0) is straight
    assert ("near a critical point are left out: nothing that explains the others" in found.residual) is straight
    # what was read there counts for the report all the same
    rows = [line.split(",") for line in (held if straight else files.data).read_text().splitlines()]
    force = [float(row[rows[0].index("fx_N")]) for row in rows[1:] if row[rows[0].index("posture")] == "A"]
    pushed = pushed_in_a(found.critical)
    # one of several rays is told of; four times their noise of 2 N
    assert pushed.reached_N == pytest.approx(-min(force), rel=1e-3)
    # what goes on straight has no knee; the extended model's is that of the readings to eight times their noise of
    # 2 N, for a knee may change to the next reading; the nominal machine's is 1.3 % off
    assert (pushed.measured_N is None) is straight
    if not straight:
        assert pushed.after_N == pytest.approx(pushed.measured_N, rel=2e-3)


def test_readings_that_were_left_out_belong_to_the_measured_knee(begun):
    """Before any cause is tried the fitter goes without them; the report does not."""
    prepared = begun
    assert prepared.aside.any()
    everything = -prepared.all.measured[
        (prepared.all.readings.posture == "A") & (prepared.all.imposed[:, 0] < 0), 0
    ]

    present = prepared.fitter.forward.observed.present.copy()
    row = pushed_in_a(critical_points(prepared, prepared.null))
    # one of several rays is told of: four times their noise of 2 N; readings that count reach 7,471 N
    assert row.reached_N == pytest.approx(np.nanmax(everything), rel=1e-3)
    assert row.measured_N is not None
    # the fitted null took its moduli far off in place of the soft drive: its knee is its own critical point,
    # read off where two slopes meet, from readings 0.2 mm apart: 0.3 % off; the drawn machine's is 18 % off
    assert row.before_N == pytest.approx(row.extended_N, rel=0.01)
    # and what it predicts of all readings, by a model that never went without them: the same to Newton's tolerance
    null, ray = prepared.null, next(r for r in prepared.all.rays if r.posture == "A")
    whole = kind_of(prepared.all.measurement).forward(prepared.all)
    whole.branches = dict(prepared.fitter.forward.branches)
    predicted = prepared.all.measured - whole.evaluate(null.parameters, null.evaluation.z, ()).residual
    on = ray.index[prepared.all.imposed[ray.index, 0] < 0.0]
    bent = knee(-prepared.all.imposed[on, 0], -predicted[on, 0])
    assert row.before_N == pytest.approx(bent[1], rel=1e-6)
    assert np.array_equal(prepared.fitter.forward.observed.present, present)


def test_a_model_that_does_not_stand_there_predicts_no_knee(begun, monkeypatch):
    prepared = begun
    monkeypatch.setattr(LeastSquaresProblem, "evaluate", lambda *_, **__: None)
    row = pushed_in_a(critical_points(prepared, prepared.null))
    assert row.measured_N is not None
    assert (row.before_N, row.after_N) == (None, None)


def test_why_readings_near_a_critical_point_are_left_out_is_said(begun):
    prepared = begun
    count = int(prepared.aside.sum())
    assert (
        aside_words(prepared) == f"{count} readings near a critical point are left out: nothing explains the others"
    )
    held = aside_words(replace(prepared, held_against=True))
    assert held.endswith("left out: nothing that explains the others predicts them")
    assert aside_words(replace(prepared, aside=np.zeros_like(prepared.aside))) == ""
