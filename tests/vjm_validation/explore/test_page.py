"""The page in Chromium: a slider moves, the number becomes the command's, and no other computer is asked."""

import json

import pytest
from helpers.command import validate
from helpers.explored import browsed, seen

from vjm_validation.explore.page import AXES
from vjm_validation.explore.state import Explorer
from vjm_validation.report.page import chromium

pytest.importorskip("viser", reason="viser, which the page is made with, is missing")
pytest.importorskip("playwright.sync_api", reason="playwright, which works Chromium, is missing")
pytestmark = pytest.mark.skipif(not chromium(), reason="no Chromium on the path")

POSTURE = "0.3,-1.2,1.4,-0.5,1.5,0"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of a UR10 that carries 100 N, and the folder in which it saves."""
    folder = tmp_path_factory.mktemp("explored")
    explorer = Explorer("ur10", POSTURE, wrench=(0.0, 0.0, -100.0, 0.0, 0.0, 0.0))
    with browsed(explorer, folder) as (_, opened):
        opened.folder = folder
        yield opened


def number(page, name):
    return float(page.locator(f"#{name}").inner_text())


def of_the_command(posture, what):
    found = validate(
        "stiffness", "ur10", f"--posture={posture}", "--wrench=0,0,-100,0,0,0", "--segments", "2", "--json"
    )
    return json.loads(found.out)["displacement"][AXES.index(what)]


def test_a_slider_moves_and_the_number_becomes_that_of_the_command(page):
    assert number(page, "uz") == pytest.approx(of_the_command(POSTURE, "uz"), rel=1e-4)
    elbow = page.get_by_role("slider").nth(2)
    assert float(elbow.get_attribute("aria-valuenow")) == pytest.approx(1.4)
    elbow.focus()
    for _ in range(3):
        elbow.press("ArrowRight")
    stands = float(elbow.get_attribute("aria-valuenow"))
    assert stands > 1.4
    expected = of_the_command(POSTURE.replace("1.4", f"{stands:.12g}"), "uz")
    # five digits are shown
    page.wait_for_function(
        f"Math.abs(Number(document.querySelector('#uz').textContent) - {expected}) < 1e-4 * Math.abs({expected})"
    )
    assert abs(expected - of_the_command(POSTURE, "uz")) > 1e-3 * abs(expected)


def test_the_machine_is_drawn(page):
    picture, _ = seen(page)
    left = picture[:, : picture.shape[1] // 2]
    # the machine and its shadow without load, on white
    assert 0.003 < (left.min(axis=-1) < 200).mean() < 0.5


def test_the_command_and_the_model_are_kept(page):
    page.get_by_role("tab", name="Keep").click()
    page.get_by_role("button", name="copy as command").click()
    words = page.locator("#command").inner_text()
    assert words.startswith("validate stiffness ur10 --posture=")
    assert words.strip().endswith("--wrench=0,0,-100,0,0,0 --segments 2 --shares")
    page.get_by_role("button", name="save posture").click()
    page.get_by_text("Saved ur10-explored.toml, posture explored in it.").wait_for()
    assert Explorer(str(page.folder / "ur10-explored.toml"), "explored").coordinates[0].value == pytest.approx(0.3)


def test_a_value_beyond_the_slider_is_said_and_the_next_one_is_taken(page):
    page.get_by_role("tab", name="Show").click()
    power = page.locator("input[inputmode]:visible").first
    power.fill("400")
    page.get_by_text("goes from 0 to 5: 400 is taken as 5").wait_for()
    page.get_by_text("drawn times 1e+05").wait_for()
    power.fill("1")
    page.get_by_text("mm, drawn times 10").wait_for()
    assert page.locator("#notice").count() == 0


def test_a_small_number_can_be_written(page):
    page.get_by_role("tab", name="Sizes").click()
    page.get_by_text("elbow", exact=True).last.click()
    compliance = page.locator("input[inputmode]:visible").first
    # 1.1e-8 rad/(N mm) or so, which the page would write as zero
    before, uz = float(compliance.input_value()), number(page, "uz")
    assert 1.0 <= before < 10.0
    compliance.fill(f"{1.5 * before:.6g}")
    page.wait_for_function(f"Math.abs(Number(document.querySelector('#uz').textContent)) > 1.01 * {abs(uz)}")
    assert page.locator("#notice").count() == 0


def test_nothing_is_asked_of_another_computer(page):
    assert {host.partition(":")[0] for host in page.hosts} == {"", "127.0.0.1"}
    assert page.errors == []
