"""Calibration by natural frequencies: springs are recovered from frequencies that come from energies alone."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest
from helpers import tapped_arm
from helpers.command import refused, validate
from helpers.from_files import CALIBRATED, calibrate
from helpers.tapped_arm import COMPLIANCE, MASSES, NAMES, POSTURES, frequencies, write
from scipy.optimize import brentq
from scipy.stats import chi2

import vjm
from vjm.io.machine_file import load_model
from vjm_updating import diagnose, load_data
from vjm_updating.frequencies.forward import pairings, probability, unlikeliness
from vjm_validation.cli.main import run

FACTORS = np.array([1.3, 0.8, 1.15, 0.7])
"""On the model's compliances, of the machine that is tapped."""
NOISE = 0.02
"""Hz."""


def truth(factors=FACTORS, **more):
    return np.array([frequencies(q, np.array(COMPLIANCE) * factors, **more) for q in POSTURES])


def by_name(document):
    return {row.name: row for row in document.parameters}


def modes_of(document):
    return [[one.mode for one in row.modes] for row in document.pairing]


def without(table, gone):
    """Each row without one of its frequencies, the others moved up."""
    return np.array([np.delete(row, k) for row, k in zip(table, gone, strict=True)])


def test_springs_are_recovered(tmp_path):
    document = calibrate(*write(tmp_path, truth()), tmp_path / "out")
    rows = by_name(document)
    for name, nominal, factor in zip(NAMES, COMPLIANCE, FACTORS, strict=True):
        # the prior of a factor of e pulls by some (0.02 Hz / 20 Hz)²
        assert rows[f"{name}.compliance"].value == pytest.approx(nominal * factor, rel=1e-5)
    assert document.fit.fits
    assert document.fit.converged
    assert modes_of(document) == [[1, 2, 3, 4]] * 4
    # and the model that is written has the frequencies that were read
    machine = vjm.load(tmp_path / "out" / CALIBRATED)
    for q, row in zip(POSTURES, truth(), strict=True):
        found = vjm.modes(machine, dict(zip(NAMES, q, strict=True)))
        np.testing.assert_allclose(found.frequencies, row, rtol=1e-5)


@pytest.mark.slow
def test_intervals_hold_the_truth(tmp_path):
    """Of 80 intervals of 95 % nearly all hold it, and deviations are neither too large nor too small."""
    inside, squares = 0, 0.0
    for seed in range(20):
        noise = NOISE * np.random.default_rng(seed).standard_normal((4, 4))
        rows = by_name(calibrate(*write(tmp_path, truth() + noise), tmp_path / "out"))
        for name, nominal, factor in zip(NAMES, COMPLIANCE, FACTORS, strict=True):
            row = rows[f"{name}.compliance"]
            inside += row.interval95[0] <= nominal * factor <= row.interval95[1]
            squares += ((row.value - nominal * factor) / row.std) ** 2
    # of a binomial of 80 and 0.95 one in a thousand is below 69
    assert inside >= 69
    assert chi2.ppf(1e-3, 80) < squares < chi2.ppf(1.0 - 1e-3, 80)


@pytest.mark.slow
def test_intervals_are_as_wide_as_the_readings_scatter(tmp_path):
    """With five times the sheet's noise deviations are five times those of exact readings."""
    noise = 5.0 * NOISE * np.random.default_rng(1).standard_normal((4, 4))
    wide = by_name(calibrate(*write(tmp_path, truth() + noise), tmp_path / "out"))
    exact = by_name(calibrate(*write(tmp_path, truth()), tmp_path / "out"))
    # 16 readings less 4 unknowns tell a deviation to 20 %; three times that is exceeded in three of a thousand
    for name in wide:
        assert 5.0 * 0.4 < wide[name].std / exact[name].std < 5.0 * 1.6


@pytest.mark.parametrize("payload", [0.0, 0.5])
def test_a_mass_beyond_its_tolerance_widens_what_rests_on_it(tmp_path, payload):
    """Half a kilogram that nobody told of, where masses are known to 1 %: frequencies see their ratios."""
    noise = NOISE * np.random.default_rng(2).standard_normal((4, 4))
    files = write(tmp_path, truth(payload=payload) + noise, more="[tolerance]\nmass_rel = 0.01")
    document = calibrate(*files, tmp_path / "out")
    rows = by_name(document)
    for name, nominal, factor in zip(NAMES, COMPLIANCE, FACTORS, strict=True):
        row = rows[f"{name}.compliance"]
        assert row.interval95[0] < nominal * factor < row.interval95[1], name
        # a hundredth as all masses: where all are as the sheet says, compliances are known as well
        assert (row.std < 0.012 * row.value) == (payload == 0.0)
    text = (tmp_path / "out" / CALIBRATED).read_text()
    assert ("doubt that tolerance" in text) == (payload > 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("gone", [(1, 1, 1, 1), (1, 0, 2, 1)])
def test_a_mode_that_was_not_seen(tmp_path, gone):
    """Paired by order the frequencies fit no machine; with a mode missing each finds its own."""
    noise = NOISE * np.random.default_rng(4).standard_normal((4, 4))
    data, sheet = write(tmp_path, without(truth() + noise, gone), more="missing = 1")
    document = calibrate(data, sheet, tmp_path / "out")
    assert modes_of(document) == [[k for k in (1, 2, 3, 4) if k != one + 1] for one in gone]
    assert min(row.probability for row in document.pairing) > 0.95
    rows = by_name(document)
    for name, nominal, factor in zip(NAMES, COMPLIANCE, FACTORS, strict=True):
        row = rows[f"{name}.compliance"]
        assert abs(row.value - nominal * factor) < 4.0 * row.std
    assert document.fit.fits
    by_order = calibrate(*write(tmp_path, without(truth() + noise, gone)), tmp_path / "out")
    assert not by_order.fit.fits
    assert not (tmp_path / "out" / CALIBRATED).exists()


def test_a_blank_is_a_mode_that_was_not_seen(tmp_path):
    """Where no mode is missing unknown to the operator, a column is its own mode."""
    table = truth()
    table[:, 1] = np.nan
    document = calibrate(*write(tmp_path, table), tmp_path / "out")
    assert modes_of(document) == [[1, 3, 4]] * 4
    for row, factor in zip(document.parameters, FACTORS, strict=True):
        assert row.over_nominal == pytest.approx(factor, rel=1e-5)


def test_one_posture_does_not_tell_which_modes_they_are(tmp_path):
    """Two frequencies of one posture and one spring: it is said that another pairing may be right."""
    data, sheet = write(tmp_path, truth(np.ones(4))[:, [0, 2]], more="missing = 2")
    lines = data.read_text().splitlines()
    data.write_text("\n".join(lines[:2]) + "\n")
    sheet.write_text(sheet.read_text().replace(f"noise_Hz = {NOISE}", "noise_Hz = 6.0"))
    document = calibrate(data, sheet, tmp_path / "out", fit=["shoulder.compliance"])
    said = " ".join(document.identifiability.statement)
    assert "may be right" in said or "another pairing" in said
    assert document.pairing[0].probability < 0.95
    assert document.pairing[0].otherwise


@pytest.mark.slow
def test_stiffness_and_mass_alike_are_not_seen(tmp_path):
    """All compliances times a factor and all masses over it leave each frequency as it is."""
    names = [f"{name}.compliance" for name in NAMES] + [f"after-{name}.mass" for name in NAMES]
    document = calibrate(*write(tmp_path, truth()), tmp_path / "out", fit=names)
    unseen = [row for row in document.combinations if not row.seen]
    assert len(unseen) >= 1
    alike = np.array([1.0] * 4 + [-1.0] * 4) / np.sqrt(8.0)
    span = np.array([[row.coefficients.get(name, 0.0) for name in names] for row in unseen])
    basis = np.linalg.qr(span.T)[0]
    assert np.linalg.norm(basis.T @ alike) == pytest.approx(1.0, abs=1e-2)
    assert "They do not see" in " ".join(document.identifiability.statement)


def one_joint(folder, rows, more="", gravity="", nominal=2e-8):
    """A pendulum: one elastic joint about y, rad/(N mm), and a point mass of 4 kg at 500 mm along x."""
    (folder / "arm.toml").write_text(
        'format = 1\nname = "pendulum"\ntitle = "one joint"\nsource = "made up"\n'
        '[units]\nlength = "mm"\nforce = "N"\nangle = "rad"\n'
        '[[parts]]\nname = "pivot"\nkind = "actuated"\naxis = "y"\n'
        f"compliance_rad_per_Nmm = {nominal}\n"
        '[[parts]]\nname = "bar"\nkind = "link"\ntranslation_mm = [500.0, 0.0, 0.0]\nmass_kg = 4.0\n'
        "centre_of_mass_mm = [500.0, 0.0, 0.0]\n[postures]\nhome = { pivot = 0.0 }\n"
    )
    data, sheet = folder / "readings.csv", folder / "sheet.toml"
    sheet.write_text(
        f'kind = "frequencies"\n[test]\nmodel = "arm.toml"\n{gravity}\n[frequencies]\nnoise_Hz = 0.05\n{more}\n'
    )
    data.write_text("\n".join(rows) + "\n")
    return data, sheet


def test_masses_within_their_tolerance_count(tmp_path):
    """f² is 1/(c m l²): a tolerance of m is one of c."""
    c = 2.6e-8
    f = np.sqrt(1000.0 / (c * 4.0 * 500.0**2)) / (2.0 * np.pi)
    files = one_joint(tmp_path, ["pivot.q_rad,f1_Hz", f"0.0,{f}", f"1.0,{f}"], "[tolerance]\nmass_rel = 0.03")
    (row,) = calibrate(*files, tmp_path / "out").parameters
    assert row.value == pytest.approx(c, rel=1e-3)
    by_noise = 2.0 * 0.05 / f / np.sqrt(2.0)
    # the prior of one in ln c takes half of its square
    assert row.std / row.value == pytest.approx(np.hypot(by_noise, 0.03), rel=1e-3)


def test_payloads(tmp_path):
    """With and without a payload: stiffness and mass are told apart."""
    c, m = 1.7e-8, 4.6
    rows = ["pivot.q_rad,f1_Hz,payload_kg,f1_std_Hz"]
    for load in (0.0, 2.0, 5.0):
        f = np.sqrt(1000.0 / (c * (m + load) * 500.0**2)) / (2.0 * np.pi)
        rows.append(f"0.3,{f},{load},0.001")
    found = by_name(calibrate(*one_joint(tmp_path, rows), tmp_path / "out", fit=["pivot.compliance", "bar.mass"]))
    assert found["pivot.compliance"].value == pytest.approx(c, rel=1e-5)
    assert found["bar.mass"].value == pytest.approx(m, rel=1e-5)
    text = (tmp_path / "out" / CALIBRATED).read_text()
    assert vjm.load(tmp_path / "out" / CALIBRATED).parts[1].mass == pytest.approx(m, rel=1e-5), text


def test_weight_counts(tmp_path):
    """Hanging a pendulum is stiffer by m g l, upright softer: (k ± m g l)/(m l²), the joint at its own balance."""
    k, m, g, length = 6e4, 4.0, 9.81, 500.0
    rows = ["pivot.q_rad,f1_Hz,f1_std_Hz"]
    for angle, sign in ((np.pi / 2.0, 1.0), (-np.pi / 2.0, -1.0)):
        f = np.sqrt(1000.0 * (k + sign * m * g * length) / (m * length**2)) / (2.0 * np.pi)
        rows.append(f"{float(angle)!r},{float(f)!r},0.001")
    files = one_joint(tmp_path, rows, gravity="gravity = [0.0, 0.0, -9.81]", nominal=2e-5)
    (row,) = calibrate(*files, tmp_path / "out").parameters
    assert row.value == pytest.approx(1.0 / k, rel=1e-4)
    weightless = one_joint(tmp_path, rows, nominal=2e-5)
    assert not calibrate(*weightless, tmp_path / "out").fit.fits


def test_a_cantilever_with_tip_masses(tmp_path):
    """1 + cos b cosh b = (M/m) b (sin b cosh b − cos b sinh b); each frequency twice, of a round tube."""
    E, rho, length, outer, wall = 168_000.0, 7.85e-6, 800.0, 30.0, 2.0
    inner = outer - 2.0 * wall
    area, second = np.pi * (outer**2 - inner**2) / 4.0, np.pi * (outer**4 - inner**4) / 64.0
    (tmp_path / "tube.toml").write_text(
        'format = 1\nname = "tube"\ntitle = "cantilever"\nsource = "made up"\n'
        '[units]\nlength = "mm"\nforce = "N"\nangle = "rad"\n'
        f'[[parts]]\nname = "tube"\nkind = "beam"\nlength_mm = {length}\n[parts.section]\nshape = "round_tube"\n'
        f"diameter_mm = {outer}\nwall_mm = {wall}\nyoungs_modulus_MPa = 210000.0\npoissons_ratio = 0.3\n"
        "density_kg_per_m3 = 7850.0\n[postures]\nstraight = []\n"
    )
    rows = ["posture,f1_Hz,f2_Hz,payload_kg"]
    for share in (0.0, 0.5, 2.0):

        def off(b, share=share):
            return 1.0 + np.cos(b) * np.cosh(b) - share * b * (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b))

        b = brentq(off, 0.5, 1.9)
        f = b**2 / (2.0 * np.pi) * np.sqrt(1000.0 * E * second / (rho * area * length**4))
        rows.append(f"straight,{f},{f},{share * rho * area * length}")
    data, sheet = tmp_path / "readings.csv", tmp_path / "sheet.toml"
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text('kind = "frequencies"\n[test]\nmodel = "tube.toml"\n[frequencies]\nnoise_Hz = 0.05\n')
    (row,) = calibrate(data, sheet, tmp_path / "out").parameters
    # Bernoulli's beam has no rotary inertia: of ω² that is some π² (r/L)² = 1e-3 of the first mode
    assert 1.0 / row.value == pytest.approx(E / 210_000.0, rel=2e-3)
    assert vjm.load(tmp_path / "out" / CALIBRATED).parts[0].mass == pytest.approx(rho * area * length)
    # a section that is no shape any more keeps its mass
    calibrate(data, sheet, tmp_path / "out", fit=["tube.EIy", "tube.EIz"])
    tube = vjm.load(tmp_path / "out" / CALIBRATED).parts[0]
    assert tube.mass == pytest.approx(rho * area * length)
    assert [tube.section.EIy, tube.section.EIz] == pytest.approx([E * second] * 2, rel=2e-3)


def test_what_pairings_there_are():
    assert pairings(np.array([True, False, True]), 0).tolist() == [[0, -1, 2]]
    ways = pairings(np.array([True, False, True]), 1)
    assert ways.tolist() == [[0, -1, 1], [0, -1, 2], [1, -1, 2]]
    cost = unlikeliness(np.array([10.0, np.nan, 30.0]), np.ones(3), np.array([10.0, 21.0, 30.0]), ways)
    assert int(np.argmin(cost)) == 1
    # 9 Hz and 11 Hz off: squares of 81 and of 121
    np.testing.assert_allclose(cost - cost[1], [81.0, 0.0, 121.0])
    assert probability(cost, 1) == pytest.approx(1.0)
    assert probability(np.array([0.0, 2.0 * np.log(3.0)]), 0) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("f1_Hz", "f1_rad_per_s"), "a frequency is in Hz: divide by 2π"),
        (("posture", "place"), "column 'place' is not known"),
        (("A,", "Z,"), "row 2, column posture: unknown posture 'Z'"),
        (("f2_Hz", "f2.std"), "column 'f2.std' is not known"),
        (("f2_Hz", "waist.q_rad"), "column 'posture' stands beside coordinates of joints"),
    ],
)
def test_bad_readings_are_refused(tmp_path, change, said):
    data, sheet = write(tmp_path, truth())
    data.write_text(data.read_text().replace(*change, 1))
    with pytest.raises(ValueError, match=r"readings\.csv") as error:
        load_data(data, sheet)
    assert "\n" not in str(error.value)
    assert said in str(error.value)


UNITS = [("rad/s", 2.0 * np.pi), ("rpm", 60.0), ("kHz", 1e-3)]


@pytest.mark.parametrize("missing", [0, 1])
@pytest.mark.parametrize(("unit", "factor"), UNITS)
def test_another_unit_is_named(tmp_path, unit, factor, missing):
    data, sheet = write(tmp_path, factor * truth(), more=f"missing = {missing}")
    (said,) = load_data(data, sheet).considered()
    assert f"are they in {unit} instead of Hz?" in str(said)
    out = tmp_path / "out"
    error = refused("calibrate", data, "--sheet", sheet, "--out", out)
    assert f"are they in {unit} instead of Hz?" in error
    assert "diagnose" not in error
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0, 1])
@pytest.mark.parametrize(("unit", "factor"), UNITS)
def test_by_force_another_unit_is_fitted_and_no_diagnosis_recommended(tmp_path, capsys, unit, factor, missing):
    """It is fitted as it stands, and no command is named that takes no frequencies."""
    data, sheet = write(tmp_path, factor * truth(), more=f"missing = {missing}")
    run(["calibrate", str(data), "--sheet", str(sheet), "--out", str(tmp_path / "out"), "--force"])
    said = "".join(capsys.readouterr())
    assert f"are they in {unit} instead of Hz?" in said
    assert "validate diagnose" not in said


def test_a_machine_that_is_softer_than_its_model_is_in_hz(tmp_path):
    assert load_data(*write(tmp_path, truth(np.full(4, 2.0)))).considered() == []


@pytest.mark.slow
def test_a_misfit_of_frequencies_recommends_no_diagnosis(tmp_path):
    table = truth()
    table[0, 0] *= 1.2
    data, sheet = write(tmp_path, table)
    finished = validate("calibrate", data, "--sheet", sheet, "--out", tmp_path / "out", status=1)
    said = finished.out + finished.err
    assert "No calibrated model was written" in said
    assert "validate diagnose" not in said
    assert "validate diagnose" not in (tmp_path / "out" / "calibration.json").read_text()


def test_descending_frequencies_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"row 2: frequencies .* are to be above zero and ascending: sort them"):
        load_data(*write(tmp_path, truth()[:, ::-1]))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("misssing = 1", "did you mean 'missing'"),
        ("missing = 9", "missing"),
        ("[instrument.fx_N]\nnoise = 1.0", "[instrument] is for tests by loads"),
        ('[payload]\non = "hand"\nmass_kg = 1.0', "[payload] on: no part 'hand'"),
    ],
)
def test_bad_sheets_are_refused(tmp_path, more, said):
    with pytest.raises(ValueError, match=r"sheet\.toml") as error:
        load_data(*write(tmp_path, truth(), more=more))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_too_few_frequencies(tmp_path):
    data, sheet = write(tmp_path, truth()[:, :1])
    with pytest.raises(ValueError, match="4 frequencies for 4 parameters: look for fewer of them"):
        calibrate(data, sheet, tmp_path / "out")


def test_a_machine_without_masses(tmp_path):
    data, sheet = write(tmp_path, truth())
    model = tmp_path / "arm.toml"
    model.write_text("\n".join(line for line in model.read_text().splitlines() if "mass" not in line))
    with pytest.raises(ValueError, match="no part has a mass: give its links mass_kg"):
        calibrate(data, sheet, tmp_path / "out")


def test_a_diagnosis_says_that_it_takes_none(tmp_path):
    data = load_data(*write(tmp_path, truth()))
    assert data.kind == "frequencies"
    assert len(data.rows()) == 4
    with pytest.raises(ValueError, match=r'kind = "frequencies" is for `validate calibrate`'):
        diagnose(data)


def test_the_truth_of_these_tests_is_an_arm():
    """The double pendulum of textbooks, of which the energies of the helper are a case: its plane is its own."""
    q, c = np.array([0.0, 0.4, 0.9, 0.0]), np.array([1e-13, 2e-8, 3e-8, 1e-7])
    a, b = tapped_arm.LENGTHS[1][0], tapped_arm.LENGTHS[2][0]
    m1, m2 = MASSES[1:3]
    both = m2 * (b**2 + a * b * np.cos(0.9))
    M = np.array([[m1 * a**2 + m2 * (a**2 + b**2 + 2.0 * a * b * np.cos(0.9)), both], [both, m2 * b**2]])
    squares = np.linalg.eigvals(np.linalg.solve(M, np.diag(1.0 / c[1:3])))
    expected = np.sort(np.sqrt(1000.0 * squares)) / (2.0 * np.pi)
    found = frequencies(q, c, masses=(1e-3, m1, m2, 1e-6))[:2]
    # what the last joint carries is a light mass
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def tapped_hexapod(factor):
    """Three frequencies of the hexapod at home, whose struts bear axial forces alone, from its point mass, Hz."""
    machine = load_model("hexapod")
    file = files("vjm") / "models" / "machines" / "hexapod.toml"
    document = tomllib.loads(file.read_text(encoding="utf-8"))
    platform = document["platform"]
    home, centre = np.array(platform["position_mm"]), np.array(platform["centre_of_mass_mm"])
    parts = {part.name: part for part in machine.parts}
    K = np.zeros((6, 6))
    for leg in document["legs"]:
        foot, head = np.array(leg["base"]["position_mm"]), np.array(leg["attachment"]["position_mm"])
        along = home + head - foot
        along /= np.linalg.norm(along)
        strut, drive = parts[f"{leg['name']}/strut"], parts[f"{leg['name']}/slide"]
        scale = factor if leg["name"] == "a" else 1.0
        J = np.concatenate([along, np.cross(head - centre, along)])
        K += np.outer(J, J) / (drive.compliance + scale * strut.beam_compliance()[0, 0])
    # the platform turns about its point mass without resistance
    soft = np.linalg.inv(K)[:3, :3]
    return np.sort(np.sqrt(1000.0 * np.linalg.eigvalsh(np.linalg.inv(soft)) / platform["mass_kg"])) / (2.0 * np.pi)


def test_a_platform_is_tapped_as_a_whole(tmp_path):
    data, sheet = tmp_path / "readings.csv", tmp_path / "sheet.toml"
    validate("new", "sheet", sheet, "--for", "hexapod", "--test", "frequencies")
    cells = ",".join(map(repr, tapped_hexapod(1.3).tolist()))
    data.write_text(f"posture,f1_Hz,f2_Hz,f3_Hz\nhome,{cells}\n", encoding="utf-8")
    document = calibrate(data, sheet, tmp_path / "out", fit=["a/strut.factor"])
    (row,) = document.parameters
    # one standard error is 0.02; the prior of a factor of e pulls by its square
    assert row.value == pytest.approx(1.3, rel=1e-3)
    assert document.fit.fits
