"""Two machines side by side: each answers as it does alone, and an optimum stands beside the original."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.command import validate
from helpers.explored import browsed, seen

from vjm_validation.explore.state import ComparedMachine, Explorer, Wish, beside_file, compared
from vjm_validation.report.page import chromium

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
