"""Tilts, wrenches, measured torques, temperatures and two markers: readings made by the energy minimiser."""

import numpy as np
import pytest
from helpers.from_files import calibrate_poses, diagnose_poses, prepared
from hidden_effects.poses.injector import Hidden, frames, rest
from hidden_effects.poses.robots import SEVEN, document, sheet_text

from vjm.io.files import toml_text
from vjm.rotations import rotation_from_vector
from vjm_updating.poses.plausibility import considered
from vjm_updating.poses.state import Hypothesis

NOISE, NOISE_RAD = 0.05, 2e-4
VIEW, SHIFT = rotation_from_vector([0.4, -1.0, 0.8]), np.array([500.0, -900.0, 300.0])
SEED = 11


def written(folder, columns, *, more="", test="", robot=SEVEN):
    """The files of a test from its columns by name, ``(g,)`` each."""
    folder.mkdir(exist_ok=True)
    (folder / "model.toml").write_text(toml_text(document(robot)))
    sheet = sheet_text(robot, NOISE) + f"noise_rad = {NOISE_RAD}\n" + more
    (folder / "sheet.toml").write_text(sheet.replace("[test]\n", f"[test]\n{test}"))
    rows = (
        ",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in zip(*columns.values(), strict=True)
    )
    (folder / "readings.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    return folder / "readings.csv", folder / "sheet.toml"


def coordinates(q):
    return {f"joint-{i}.q_rad": q[:, i - 1] for i in range(1, q.shape[1] + 1)}


def seen(name, T, place, rng):
    points = (T @ np.array([*place, 1.0]))[:, :3] @ VIEW.T + SHIFT + rng.normal(0.0, NOISE, (len(T), 3))
    return {f"{name}.{axis}_mm": points[:, k] for k, axis in enumerate("xyz")}


@pytest.fixture(scope="module")
def postures():
    return np.random.default_rng(SEED).uniform(-1.9, 1.9, (100, 7))


@pytest.fixture(scope="module")
def compliant(postures):
    hidden = Hidden.nothing(7)
    hidden.own = np.array([1.0, 1.2, 1.5, 2.0, 3.0, 3.0, 3.0]) * 1e-8
    return hidden, rest(SEVEN, hidden, postures)


INCLINOMETER = '[markers.level]\non = "link-7"\norientation = "tilt"\n'


@pytest.fixture(scope="module")
def tilted(postures, compliant, tmp_path_factory):
    """A target, and an inclinometer that is screwed on askew."""
    rng = np.random.default_rng(SEED)
    T = compliant[1]
    axes = T[:, :3, :3] @ rotation_from_vector([0.2, -0.5, 1.0])
    tilt = np.arcsin(axes[:, 2, :2]) + rng.normal(0.0, NOISE_RAD, (len(T), 2))
    tilt[:10, 1] = np.nan
    columns = coordinates(postures) | seen("target", T, (40.0, -25.0, 60.0), rng)
    columns |= {"level.tilt_x_rad": tilt[:, 0], "level.tilt_y_rad": tilt[:, 1]}
    return written(tmp_path_factory.mktemp("tilt"), columns, more=INCLINOMETER), columns


def test_derivatives_of_tilts(tilted):
    _, study = prepared(*tilted[0])
    forward, frames = study.forward(), study.frames
    z = np.where([member.kind == "compliance" for member in study.members], 0.5, 0.2)
    at = forward.evaluate(z, frames)
    kinds = {member.family: i for i, member in reversed(list(enumerate(study.members)))}
    for family, i in kinds.items():
        step = np.eye(len(z))[i] * 1e-3
        plus, minus = (forward.evaluate(z + s, frames).residual[:, 1, 3:5] for s in (step, -step))
        # differences of 1e-3 units of 1e-3 rad: rounding over the step, and its square
        assert np.nanmax(np.abs((minus - plus) / 2e-3 - at.member[:, 1, 3:5, i])) < 2e-9, family
    for i in range(9 + 3, forward.nuisances):
        step = np.eye(forward.nuisances)[i] * 1e-4
        plus, minus = (forward.evaluate(z, forward.moved(frames, s)).residual[:, 1, 3:5] for s in (step, -step))
        assert np.nanmax(np.abs((minus - plus) / 2e-4 - at.nuisance[:, 1, 3:5, i])) < 1e-5


@pytest.mark.slow
def test_an_inclinometer_fits_to_its_noise_and_helps(tilted, tmp_path):
    files, columns = tilted
    found = calibrate_poses(*files, tmp_path / "out", families=("actuator_compliance",))
    _, study = prepared(*files)
    state = study.gauss_newton(Hypothesis(("actuator_compliance",)))
    # 190 readings, three of them spent on the instrument's frame: 5 % is the estimate's own standard deviation
    left = state.linearised.residual[:, 1, 3:5]
    assert np.sqrt(np.nanmean(left**2)) == pytest.approx(NOISE_RAD, rel=0.2)
    only = {name: values for name, values in columns.items() if not name.startswith("level")}
    alone = calibrate_poses(
        *written(tmp_path / "alone", only), tmp_path / "alone/out", families=("actuator_compliance",)
    )
    pairs = zip(found.families[0].members[1:6], alone.families[0].members[1:6], strict=True)
    assert all(with_.std < without.std for with_, without in pairs)


def test_tilts_that_cannot_be_read(tilted, tmp_path):
    columns = tilted[1]
    wrong = columns | {"level.tilt_x_rad": np.degrees(columns["level.tilt_x_rad"])}
    with pytest.raises(ValueError, match=r"level\.tilt_x_rad' reaches .* is it in degrees\? Name it tilt_x_deg"):
        prepared(*written(tmp_path / "a", wrong, more=INCLINOMETER))
    bare = {name: values for name, values in columns.items() if "tilt" not in name}
    with pytest.raises(ValueError, match=r"column 'level\.tilt_x_rad' is missing"):
        prepared(*written(tmp_path / "b", bare, more=INCLINOMETER))
    blind = {name: values for name, values in columns.items() if not name.startswith("target")}
    with pytest.raises(ValueError, match=r"'target\.x_mm' is missing"):
        prepared(*written(tmp_path / "c", blind, more=INCLINOMETER))


TWO = '[markers.other]\nposition_mm = [0.0, 0.0, 0.0]\nsigma_mm = 200.0\non = "link-3"\n'


def test_two_markers_that_were_swapped_are_named(postures, compliant, tmp_path):
    rng = np.random.default_rng(SEED)
    early = rest_of_three(postures)
    columns = coordinates(postures)
    columns |= seen("other", compliant[1], (40.0, -25.0, 60.0), rng) | seen("target", early, (0.0, 80.0, 30.0), rng)
    found = diagnose_poses(*written(tmp_path, columns, more=TWO), tmp_path / "out", only=("actuator_compliance",))
    assert found.verdict == "unknown"
    assert [row.found.partition(":")[0] for row in found.doubts] == ["markers_swapped.target.other"]


def rest_of_three(q):
    """Frames behind the third link, rigid: products of the rows' matrices, none of the finder's."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    for i, (d, a, alpha) in enumerate(SEVEN.rows[:3]):
        c, s, ca, sa = np.cos(q[:, i]), np.sin(q[:, i]), np.cos(alpha), np.sin(alpha)
        A = np.zeros((len(q), 4, 4))
        A[:, 0] = np.column_stack([c, -s * ca, s * sa, a * c])
        A[:, 1] = np.column_stack([s, c * ca, -c * sa, a * s])
        A[:, 2], A[:, 3] = [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]
        T = T @ A
    return T


@pytest.mark.slow
def test_joints_measured_at_the_output_hide_what_bends_about_them(postures, compliant, tmp_path):
    rng = np.random.default_rng(SEED)
    hidden, T = compliant
    # at the output the coordinates have the bending in them: its readings are those of a rigid robot
    bent = postures + bending(hidden.own, postures)
    columns = coordinates(bent) | seen("target", T, (40.0, -25.0, 60.0), rng)
    output = 'joints = "measured"\nencoders = "output"\n'
    found = diagnose_poses(*written(tmp_path / "output", columns, test=output), tmp_path / "a")
    assert (found.verdict, found.causes) == ("none", [])
    assert found.not_asked == ["actuator_compliance", "approach"]
    assert found.joints == "measured at the output"
    with pytest.raises(
        ValueError, match=r"'actuator_compliance' is not seen in these data: joints measured at the out"
    ):
        calibrate_poses(
            tmp_path / "output/readings.csv",
            tmp_path / "output/sheet.toml",
            tmp_path / "b",
            families=("actuator_compliance",),
        )
    # the motors' coordinates have it not: it is named
    columns = coordinates(postures) | seen("target", T, (40.0, -25.0, 60.0), np.random.default_rng(SEED))
    found = diagnose_poses(*written(tmp_path / "motor", columns, test='joints = "measured"\n'), tmp_path / "c")
    assert found.causes == ["actuator_compliance"]
    assert "controllers" not in found.families[0].title
    with pytest.raises(ValueError, match=r"encoders is for joints = 'measured'"):
        prepared(*written(tmp_path / "wrong", columns, test='encoders = "motor"\n'))


def bending(own, q, rounds=4, step=1e-5):
    """Turns of the joints ``(g, n)`` under the weight: differences of the minimiser's potential."""
    nothing, theta = Hidden.nothing(q.shape[1]), np.zeros((len(q), 3 + 3 * q.shape[1]))
    for _ in range(rounds):
        new = np.zeros_like(theta)
        for i in range(q.shape[1]):
            k = 5 + 3 * i
            move = np.eye(theta.shape[1])[k] * step
            slope = frames(SEVEN, nothing, q, theta + move)[1] - frames(SEVEN, nothing, q, theta - move)[1]
            new[:, k] = -own[i] * slope / (2.0 * step)
        theta = new
    return theta[:, 5::3]


@pytest.mark.slow
def test_measured_torques_of_the_other_sign_are_doubted(postures, compliant, tmp_path):
    rng = np.random.default_rng(SEED)
    hidden, T = compliant
    torque = -bending(hidden.own, postures) / hidden.own  # what holds the weight
    columns = coordinates(postures) | seen("target", T, (40.0, -25.0, 60.0), rng)
    columns |= {f"joint-{i}.tau_Nmm": torque[:, i - 1] + rng.normal(0.0, 500.0, len(T)) for i in (2, 4)}
    measurement, study = prepared(*written(tmp_path / "right", columns))
    assert not [one for one in considered(measurement, study) if "tau" in one.where]
    columns["joint-2.tau_Nmm"] = -columns["joint-2.tau_Nmm"]
    columns["joint-4.tau_Nmm"] = columns["joint-4.tau_Nmm"] / 1000.0
    found = diagnose_poses(*written(tmp_path / "wrong", columns), tmp_path / "out", only=("actuator_compliance",))
    doubts = {row.where: row.found for row in found.doubts}
    assert "the sign is the other one" in doubts["readings.csv, column joint-2.tau_Nmm"]
    assert "give N mm at the joint" in doubts["readings.csv, column joint-4.tau_Nmm"]
    assert found.causes == ["actuator_compliance"]  # nothing is fitted to them
    names = [row.name for row in found.contrasts_before]
    assert "measured torque of joint-2" in names


@pytest.mark.slow
def test_wrenches_stand_in_the_same_file(postures, tmp_path):
    # a rigid robot but for joint 2, whose load is a wrench on the target in half of the postures
    rng = np.random.default_rng(SEED)
    c, force = 2e-8, np.array([60.0, -80.0, 40.0])
    place = np.array([40.0, -25.0, 60.0])
    loaded = np.arange(len(postures)) % 2 == 0
    nothing = Hidden.nothing(7)
    q = postures.copy()
    for _ in range(4):
        first = rest(SEVEN, nothing, q)
        turned = q.copy()
        turned[:, 1] += 1e-5
        moved = (rest(SEVEN, nothing, turned) - first) @ np.array([*place, 1.0]) / 1e-5
        weight = bending(np.eye(7)[1], q, rounds=1)[:, 1]
        q[:, 1] = postures[:, 1] + c * (weight + np.where(loaded, moved[:, :3] @ force, 0.0))
    columns = coordinates(postures) | seen("target", rest(SEVEN, nothing, q), place, rng)
    columns |= {f"target.f{a}_N": np.where(loaded, force[k], np.nan) for k, a in enumerate("xyz")}
    at = "position_mm = [40.0, -25.0, 60.0]"
    files = written(tmp_path, columns)
    sheet = (tmp_path / "sheet.toml").read_text().replace("position_mm = [0.0, 0.0, 0.0]", at)
    (tmp_path / "sheet.toml").write_text(sheet)
    found = diagnose_poses(*files, tmp_path / "out")
    assert (found.verdict, found.causes) == ("named", ["actuator_compliance"])
    row = next(row for row in found.families[0].members if row.name == "actuator_compliance.joint-2")
    assert row.interval95[0] < c < row.interval95[1]
    # what to measure next is postures under such wrenches, and free ones
    rows = [load["target"] for one in found.next_postures for load in one.loads]
    assert len(rows) == sum(len(one.q) for one in found.next_postures)
    assert {tuple(row) for row in rows} <= {(*map(float, force), 0.0, 0.0, 0.0), (0.0,) * 6}
    assert (*map(float, force), 0.0, 0.0, 0.0) in {tuple(row) for row in rows}
    # without the wrenches what they do is no function of the posture
    bare = {name: values for name, values in columns.items() if "_N" not in name}
    blind = diagnose_poses(*written(tmp_path / "bare", bare), tmp_path / "bare/out")
    assert blind.after.random_mm > 3.0 * found.after.random_mm


@pytest.mark.slow
def test_temperature_that_stretches_the_links_is_named(postures, tmp_path):
    rng = np.random.default_rng(SEED)
    warm = 20.0 + 8.0 * np.sin(np.arange(len(postures)) / 9.0) + rng.normal(0.0, 0.5, len(postures))
    T = rest(SEVEN, Hidden.nothing(7), postures)
    T[:, :3, 3] *= (1.0 + 2.3e-5 * (warm - warm.mean()))[:, None]  # aluminium
    columns = coordinates(postures) | seen("target", T, (0.0, 0.0, 0.0), rng) | {"temperature_C": warm}
    found = diagnose_poses(*written(tmp_path, columns), tmp_path / "out")
    assert found.causes == ["temperature"]
    row = found.families[0].members[0]
    assert row.interval95[0] < 2.3e-5 < row.interval95[1]
    flat = columns | {"temperature_C": np.full(len(postures), 20.0)}
    _, study = prepared(*written(tmp_path / "flat", flat))
    assert "temperature" not in study.families


def test_the_way_of_approach_is_asked_where_the_order_is_known(postures, compliant, tmp_path):
    columns = coordinates(postures) | seen("target", compliant[1], (0.0, 0.0, 0.0), np.random.default_rng(SEED))
    files = written(tmp_path, columns)
    assert "approach" in prepared(*files)[1].families
    text = (tmp_path / "sheet.toml").read_text()
    (tmp_path / "sheet.toml").write_text(text.replace('order = "as taken"', 'order = "unknown"'))
    study = prepared(*files)[1]
    assert not {"approach", "tracker_drift"} & set(study.families)
