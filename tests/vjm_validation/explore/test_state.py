"""The explorer says what the commands say, for every kind of machine."""

import json
import shlex
import threading
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from helpers.command import json_of, validate
from helpers.explored import browsed, seen
from helpers.file_texts import model_text, part_text, section_of

from vjm.errors import NoConvergenceError
from vjm.io.files import toml_text
from vjm_validation.explore.state import (
    ComparedMachine,
    Explorer,
    Setting,
    Slider,
    Wish,
    beside_file,
    compared,
    round_number,
)
from vjm_validation.report.page import chromium

ARMS = ("ur10", "planar-2r", "double-pantograph", "palletiser")
PLATFORMS = ("delta", "hexapod")
HELD = ("orthoglide-chain", "parallelogram")
CANTILEVER = model_text(
    "cantilever",
    part_text(
        "beam",
        "bar",
        length_mm=1000.0,
        section=section_of("rectangle", 20.0, 20.0, youngs=210000.0, poisson=0.3, density=7850.0),
    ),
    postures={"straight": []},
)
SAME = 1e-6
"""Relative: two ways to an equilibrium end within the tolerances of their solvers, 1e-9 of forces and lengths."""


def moved(explorer, *, load=0.3, coordinates=0.02, sizes=1.0, weighed=False):
    """A setting away from where the sliders begin."""
    stands = tuple(
        round(each.value + coordinates * (each.high - each.low) * (1 if each.value < 0.5 * each.high else -1), 6)
        for each in explorer.coordinates
    )
    acting = tuple(round(load * each.high, 6) if k in (1, 2) else 0.0 for k, each in enumerate(explorer.load))
    first = explorer.sizes[0]
    changed = {first.name: first.value * sizes} if sizes != 1.0 else {}
    return Setting(stands, acting, weighed, changed)


def said(explorer, setting, model=""):
    """What the command says that the page shows."""
    found = validate(*shlex.split(explorer.command(setting, model))[1:], "--json")
    return json.loads(found.out)


def assert_same(answer, document, explorer):
    """Deflection, stiffness and shares; components that are rounding beside the largest are of no account."""
    unit = np.repeat([1.0, explorer.extent], 3)
    ours, theirs = np.array(answer.deflection) * unit, np.array(document["displacement"]) * unit
    np.testing.assert_allclose(ours, theirs, rtol=SAME, atol=SAME * np.abs(theirs).max())
    if document["stiffness_loaded"] is not None:
        scale = 1.0 / np.outer(unit, unit)
        ours, theirs = answer.stiffness * scale, np.array(document["stiffness_loaded"]) * scale
        np.testing.assert_allclose(ours, theirs, atol=1e2 * SAME * np.abs(theirs).max())
    (shares,) = document["shares"]
    energies = [part["energy"] for part in shares["parts"]]
    assert [part["part"] for part in shares["parts"]] == [row.part for row in answer.shares.rows]
    np.testing.assert_allclose(answer.shares.energies, energies, atol=1e-9)


@pytest.mark.parametrize("model", [*ARMS, *PLATFORMS, *HELD])
def test_it_says_what_the_command_says(model):
    explorer = Explorer(model)
    setting = moved(explorer)
    assert_same(explorer.answer(setting), said(explorer, setting), explorer)


def test_the_weight_is_that_of_the_command():
    explorer = Explorer("palletiser")
    setting = moved(explorer, weighed=True)
    assert "--gravity=0,0,-9.81" in explorer.command(setting)
    assert_same(explorer.answer(setting), said(explorer, setting), explorer)


def test_an_end_frame_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match=r"no end frame 'hand' \(it has none\)"):
        Explorer("palletiser", end="hand")


@pytest.mark.parametrize("model", ["ur10", "planar-2r", "hexapod"])
def test_the_frequency_is_that_of_the_command(model):
    explorer = Explorer(model)
    setting = moved(explorer)
    words = shlex.split(explorer.command(setting))[2:]
    words.remove("--shares")
    document = json_of("modes", *words, "--number", "1")
    answer = explorer.answer(setting)
    assert answer.frequency == pytest.approx(document["modes"][0]["frequency_Hz"], rel=SAME)
    assert answer.mass == pytest.approx(document["mass_kg"])


@pytest.mark.parametrize("model", ["planar-2r", "delta", "palletiser"])
def test_a_saved_machine_with_other_sizes_is_the_one_that_was_shown(model, tmp_path):
    explorer = Explorer(model)
    key = next(each.name for each in explorer.sizes if each.name.endswith((".wall_mm", ".EIy_Nmm2")))
    setting = replace(moved(explorer), sizes={key: 1.1 * explorer.files.number(key)})
    answer = explorer.answer(setting)
    files = explorer.save(setting, tmp_path / "other.toml", "here")
    assert files[-1] == tmp_path / "other.toml"
    assert_same(answer, said(explorer, setting, str(files[-1])), explorer)
    before = explorer.answer(replace(setting, sizes={}))
    assert np.abs(answer.deflection - before.deflection).max() > 1e-3 * np.abs(before.deflection).max()
    # the posture is in the file, too
    kept = Explorer(str(files[-1]), "here")
    again = kept.answer(replace(kept.start, load=setting.load))
    np.testing.assert_allclose(again.deflection, answer.deflection, atol=SAME * np.abs(answer.deflection).max())


def test_without_a_load_nothing_is_shared_and_it_says_so():
    explorer = Explorer("planar-2r")
    answer = explorer.answer(explorer.start)
    assert answer.shares is None
    assert answer.said == ("No shares: set a load.",)
    assert not answer.deflection.any()


def test_without_masses_there_is_no_frequency_and_it_says_so():
    explorer = Explorer("delta")
    answer = explorer.answer(moved(explorer))
    assert answer.frequency is None
    assert "No frequency: no part that moves has a mass" in answer.said[0]
    weighed = explorer.answer(moved(explorer, weighed=True))
    assert "No part has a mass: the weight is nothing." in weighed.said


def test_what_is_out_of_reach_leaves_the_machine_as_it_was():
    explorer = Explorer("delta")
    setting = moved(explorer)
    before = explorer.answer(setting)
    with pytest.raises(ValueError, match="out of reach"):
        explorer.answer(replace(setting, coordinates=(0.0, 0.0, -2000.0)))
    np.testing.assert_array_equal(explorer.answer(setting).deflection, before.deflection)


def test_sizes_that_make_no_machine_are_refused_and_leave_it_as_it_was():
    explorer = Explorer("planar-2r")
    setting = moved(explorer)
    before = explorer.answer(setting)
    with pytest.raises(ValueError, match="leaves no hole"):
        explorer.answer(replace(setting, sizes={"upper.section.wall_mm": 40.0}))
    np.testing.assert_array_equal(explorer.answer(setting).deflection, before.deflection)


def test_an_unstable_equilibrium_is_not_shown():
    # far beyond the critical force of the stretched arm, some 2000 N
    explorer = Explorer("planar-2r", "stretched")
    with pytest.raises(NoConvergenceError, match=r"unstable|no equilibrium"):
        explorer.answer(replace(explorer.start, load=(-1e5, 0.0, 0.0, 0.0, 0.0, 0.0)))


def test_a_held_end_takes_no_wrench():
    with pytest.raises(ValueError, match="carries no load on a free end"):
        Explorer("orthoglide-chain", wrench=(1.0, 0, 0, 0, 0, 0))


def test_the_critical_force_of_a_stretched_arm_is_that_of_a_column_on_its_own_springs():
    explorer = Explorer("planar-2r", "stretched")
    found = explorer.critical(explorer.start)
    # two springs of 2e6 and 1e6 N mm/rad, arms of 500 and 400 mm; the beams' own compliance makes it softer
    a, b, k1, k2 = 500.0, 400.0, 2e6, 1e6
    K = np.array([[k1 + k2, -k2], [-k2, k2]])
    rigid = float(np.min(np.linalg.eigvals(np.linalg.solve(np.diag([a, b]), K)).real))
    assert 0.9 * rigid < found.force < rigid
    assert abs(found.direction[0]) == pytest.approx(1.0, abs=1e-2)


def test_sliders_end_on_multiples_of_their_step():
    slider = Slider("elbow", "rad", -2.6, 2.6, 0.0)
    assert slider.step == pytest.approx(0.01)
    assert slider.ends == pytest.approx((-2.6, 2.6))
    assert Slider("x", "mm", -3.14159, 3.14159, 0.0).ends == pytest.approx((-3.14, 3.14))
    assert round_number(0.02) == pytest.approx(0.02)
    assert round_number(0.021) == pytest.approx(0.05)


def test_a_slider_whose_limits_are_equal_stands_still():
    slider = Slider("z", "mm", 5.0, 5.0, 5.0)
    assert slider.ends == (5.0, 5.0)
    assert slider.step > 0.0
    assert slider.readable() == (slider, 1.0)


def test_a_workspace_that_is_flat_has_a_slider_that_stands_still(tmp_path):
    written = Explorer("delta").save(Explorer("delta").start, tmp_path / "flat.toml")[-1]
    content = tomllib.loads(written.read_text())
    low, high = content["workspace"]["min_mm"], content["workspace"]["max_mm"]
    content["workspace"] |= {"min_mm": [*low[:2], 0.0], "max_mm": [*high[:2], 0.0]}
    written.write_text(toml_text(content))
    explorer = Explorer(str(written))
    assert explorer.coordinates[2].ends == (0.0, 0.0)
    assert explorer.coordinates[1].ends == pytest.approx((low[1], high[1]))


def test_the_command_is_one_word_for_the_shell_where_a_name_is_one(tmp_path):
    file = tmp_path / "a $(b) c.toml"
    file.write_text(CANTILEVER)
    explorer = Explorer(str(file))
    assert shlex.split(explorer.command(explorer.start))[:3] == ["validate", "stiffness", str(file)]


def test_a_file_that_has_changed_since_is_noticed(tmp_path):
    file = tmp_path / "cantilever.toml"
    file.write_text(CANTILEVER)
    explorer = Explorer(str(file))
    assert not explorer.outdated()
    file.write_text(CANTILEVER.replace("1000.0", "1001.0"))
    assert explorer.outdated()
    file.write_text("no model")
    assert explorer.outdated()
    file.unlink()
    assert explorer.outdated()
    assert explorer.answer(explorer.start).mass == pytest.approx(7850e-9 * 20.0 * 20.0 * 1000.0)


def test_two_threads_do_not_mix_their_settings():
    explorer, wrong = Explorer("planar-2r"), []
    settings = [moved(explorer, coordinates=0.01 * k) for k in range(1, 5)]
    expected = [explorer.answer(each).deflection for each in settings]

    def answers(k):
        for _ in range(10):
            if not np.array_equal(explorer.answer(settings[k]).deflection, expected[k]):
                wrong.append(k)

    threads = [threading.Thread(target=answers, args=(k,)) for k in range(len(settings))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_two_springs_in_a_beam_are_enough_for_its_frequency_and_its_deflection(tmp_path):
    file = tmp_path / "cantilever.toml"
    file.write_text(CANTILEVER)
    explorer = Explorer(str(file))
    E, length, side, rho = 210000.0, 1000.0, 20.0, 7850e-9
    inertia, area = side**4 / 12.0, side**2
    # Bernoulli's cantilever: β L = 1.8751; 1 N/mm over 1 kg is 1000 /s²
    expected = 1.875104**2 / (2.0 * np.pi) * np.sqrt(1000.0 * E * inertia / (rho * area * length**4))
    answer = explorer.answer(replace(explorer.start, load=(0.0, 0.0, 1e-3, 0.0, 0.0, 0.0)))
    assert answer.frequency == pytest.approx(expected, rel=1e-3)
    assert answer.deflection[2] == pytest.approx(1e-3 * length**3 / (3.0 * E * inertia), rel=1e-6)


# Two machines side by side: each answers as it does alone, and an optimum stands beside the original.


LOAD = (0.0, -50.0, 0.0, 0.0, 0.0, 0.0)
WIDE = Wish("upper.section.width_mm", "mass", "deflection<=7")


@pytest.fixture(scope="module")
def arm():
    return Explorer("planar-2r", "bent", wrench=LOAD)


def test_each_answers_as_it_does_alone(arm):
    sizes = {"upper.section.width_mm": 70.0}
    beside = ComparedMachine(arm.again(), "wider", sizes)
    for setting in (arm.start, replace(arm.start, coordinates=(0.3, 0.4), weighed=True)):
        alone = arm.answer(replace(setting, sizes=sizes))
        there = beside.answer(arm, setting)
        assert there.deflection == pytest.approx(alone.deflection, rel=1e-12)
        assert (there.mass, there.frequency) == pytest.approx((alone.mass, alone.frequency), rel=1e-12)
        assert there.shares is None
    text = compared(("a", "b"), arm.answer(arm.start), beside.answer(arm, arm.start))
    first, second = (
        np.linalg.norm(one.deflection[:3]) for one in (arm.answer(arm.start), beside.answer(arm, arm.start))
    )
    assert f"<td id='beside-shift'>{second:.5g}</td><td>{second / first - 1.0:+.1%}</td>" in text


def test_another_machine_bears_the_same_load_and_follows_joints_of_like_names(arm):
    scara = beside_file(arm, "scara", Explorer("scara"))
    there = {"shoulder": 0.3, "elbow": 0.4}
    assert [each.name for each in arm.coordinates] == list(there)
    own = tuple(there.get(each.name, each.value) for each in scara.explorer.coordinates)
    alone = scara.explorer.answer(replace(scara.explorer.start, coordinates=own, load=LOAD))
    moved = scara.answer(arm, replace(arm.start, coordinates=(0.3, 0.4))).deflection
    assert moved == pytest.approx(alone.deflection, rel=1e-12)
    with pytest.raises(
        ValueError, match="orthoglide-chain has passive joints and its end is held; planar-2r bears"
    ):
        beside_file(arm, "orthoglide-chain", Explorer("orthoglide-chain"))


def test_an_optimum_is_that_of_the_command_that_it_says(arm):
    found = WIDE.optimum(arm.again(), arm.start, lambda _: None, lambda: False)
    assert found.kept
    words = WIDE.command(arm, arm.start)
    assert words == (
        "validate optimise planar-2r --minimise mass --such-that 'deflection<=7' --vary "
        "upper.section.width_mm=30:120 --posture=bent --wrench=0,-50,0,0,0,0 --segments 2 --starts 1"
    )
    options = [word.replace("'", "") for word in words.split()[2:]]
    printed = validate("optimise", *options, "--no-confirm").out
    assert f"mass: {found.objective:.6g} kg" in printed
    # the width by which the tool moves by 7 mm, solved anew
    moved = arm.answer(replace(arm.start, sizes=dict(zip(found.space.keys, found.values, strict=True)))).deflection
    assert np.linalg.norm(moved[:3]) == pytest.approx(7.0, rel=1e-5)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (replace(WIDE, numbers="upper.width"), "'upper.width' is no number of the tab Sizes"),
        (replace(WIDE, numbers=" , "), "write which numbers vary"),
        (replace(WIDE, best="weight"), "weight"),
        (replace(WIDE, limits="deflection<"), "deflection<"),
    ],
)
def test_a_wish_that_cannot_be_asked_is_refused(arm, wish, words):
    with pytest.raises(ValueError, match=words):
        wish.optimum(arm.again(), arm.start, lambda _: None, lambda: False)


def test_a_stop_gives_the_best_so_far(arm):
    asked = []

    def stopped():
        asked.append(None)
        return len(asked) > 3

    found = Wish("upper.section.width_mm", "mass", "").optimum(arm.again(), arm.start, lambda _: None, stopped)
    assert found.interrupted


@pytest.mark.slow
@pytest.mark.skipif(not chromium(), reason="no Chromium on the path")
def test_an_optimum_is_put_beside_the_original_in_the_page(arm, tmp_path):
    pytest.importorskip("viser", reason="viser, which the page is made with, is missing")
    pytest.importorskip("playwright.sync_api", reason="playwright, which works Chromium, is missing")
    with browsed(arm, tmp_path) as (_, page):
        page.get_by_role("tab", name="Optimise").click()
        numbers, _, limits = page.locator("input:visible").all()
        numbers.fill(WIDE.numbers)
        limits.fill(WIDE.limits)
        page.get_by_role("button", name="optimise").click()
        page.wait_for_selector("#beside-mass")
        found = WIDE.optimum(arm.again(), arm.start, lambda _: None, lambda: False)
        assert float(page.locator("#beside-mass").inner_text()) == pytest.approx(found.objective, rel=1e-4)
        seen(page)
        page.get_by_role("button", name="take its numbers").click()
        # both are one machine then; five digits are shown
        page.wait_for_function("Math.abs(Number(document.querySelector('#shift').textContent) - 7) < 1e-3")
        assert page.locator("#notice").count() == 0
        assert page.errors == []
