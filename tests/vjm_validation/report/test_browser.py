"""The page in a browser: nothing is asked of a network, nothing is wrong, and everything answers to a hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from vjm.model.load_case import Direction
from vjm_output.optional_drawing import why_not_rendered
from vjm_validation.report.page import chromium, print_page, write_report
from vjm_validation.studies.chain import Key

CHROMIUM = chromium()
WIDTHS = (360, 800, 1280, 1920)

playwright_api = pytest.importorskip("playwright.sync_api", reason="playwright, which drives Chromium, is missing")
# waits until it holds: a link's target is opened by an event that comes after the click
expect = playwright_api.expect

pytestmark = pytest.mark.skipif(not CHROMIUM, reason="no Chromium on the path")


@pytest.fixture(scope="module")
def browser():
    with playwright_api.sync_playwright() as playwright_session:
        # without a graphics card Chromium computes WebGL itself
        browser = playwright_session.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser):
    """Opens a file at a width; what was asked for and what went wrong is kept beside the page."""
    pages = []

    def opened(file, width=1280, **context):
        page = browser.new_page(viewport={"width": width, "height": 900}, **context)
        page.requests, page.errors = [], []
        page.on("request", lambda r: page.requests.append(r.url) if not r.url.startswith("data:") else None)
        page.on("console", lambda m: page.errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: page.errors.append(str(error)))
        page.goto(file.as_uri())
        pages.append(page)
        return page

    yield opened
    for page in pages:
        page.close()


def open_all(page):
    """Everything unfolded; on a narrow page the button is in the contents, which are folded."""
    if not page.get_by_role("button", name="Open all").is_visible():
        page.locator(".contents > summary").click()
    page.get_by_role("button", name="Open all").click()


def test_the_page_asks_for_nothing_and_says_no_error(open_page, folder):
    page = open_page(folder / "index.html")
    open_all(page)
    page.wait_for_timeout(300)
    assert page.errors == []
    assert page.requests == [(folder / "index.html").as_uri()]


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_overflows(open_page, folder, width):
    page = open_page(folder / "index.html", width)
    open_all(page)
    page.wait_for_timeout(200)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    inside = page.evaluate(
        "[...document.querySelectorAll('table')].filter((t) => t.closest('.scroll') === null).length"
    )
    assert inside == 0


def test_the_first_screen_has_the_verdict_a_figure_and_a_scene(open_page, folder):
    page = open_page(folder / "index.html")
    assert page.locator(".verdict > p").bounding_box()["y"] < 200
    assert page.locator("svg.plot").first.bounding_box()["y"] < 900
    if not why_not_rendered():
        assert page.locator("figure[data-scene]").first.bounding_box()["y"] < 900


def test_a_finding_opens_and_leads_to_its_proof(open_page, folder):
    page = open_page(folder / "index.html")
    finding = page.locator("details.finding.cause").first
    expect(finding.locator("ul")).to_be_hidden()
    finding.locator("summary").press("Enter")
    expect(finding.locator("ul")).to_be_visible()
    expect(page.locator("#lumping figure").first).to_be_hidden()
    finding.get_by_role("link", name="The proof").click()
    expect(page.locator("#lumping figure").first).to_be_visible()


def test_an_engine_is_switched_off_and_on(open_page, folder):
    page = open_page(folder / "index.html")
    figure = page.locator("#figure-force_A")
    lines = figure.locator('svg [data-series="vjm-paper"]')
    expect(lines.first).to_be_visible()
    switch = figure.get_by_role("button", name="vjm-paper")
    switch.click()
    for k in range(lines.count()):
        expect(lines.nth(k)).to_be_hidden()
    expect(figure.locator('svg [data-series="exudyn"]').first).to_be_visible()
    switch.click()
    expect(lines.first).to_be_visible()


def test_a_plot_says_its_values_and_zooms(open_page, folder, computed):
    page = open_page(folder / "index.html")
    figure = page.locator("#figure-force_A")
    figure.scroll_into_view_if_needed()
    path = computed.paths[Key("A", Direction.COMPRESSION, "vjm-paper")]
    point = path.points[len(path.points) // 2]
    _, panel = json.loads(figure.get_attribute("data-axes"))
    (left, top, right, bottom), (x0, x1), (y0, y1) = panel["box"], panel["x"], panel["y"]
    x = left + (right - left) * (point.s - x0) / (x1 - x0)
    y = bottom - (bottom - top) * (abs(point.wrench[0]) / 1e3 - y0) / (y1 - y0)
    plot = figure.locator("svg").bounding_box()
    scale = plot["width"] / float(figure.locator("svg").get_attribute("viewBox").split()[2])
    page.mouse.move(plot["x"] + scale * x, plot["y"] + scale * y)
    tip = figure.locator(".tip")
    expect(tip).to_be_visible()
    engine, _, values = tip.inner_text().partition(": ")
    shift, force = (float(v) for v in values.split(", "))
    # several lines lie on each other there; each says a point of its own
    shown = computed.paths[Key("A", Direction.COMPRESSION, engine)]
    k = int(np.argmin(np.abs(shown.s - shift)))
    assert (shift, force) == pytest.approx((shown.s[k], shown.force[k] / 1e3), rel=1e-4)
    assert shift == pytest.approx(point.s, abs=0.1)


def test_a_zoomed_panel_has_axes_of_its_own_and_its_values(open_page, folder, computed):
    page = open_page(folder / "index.html")
    figure = page.locator("#figure-force_A")
    figure.scroll_into_view_if_needed()
    (left, top, right, bottom), x, y = (
        json.loads(figure.get_attribute("data-axes"))[1][key] for key in ("box", "x", "y")
    )
    plot = figure.locator("svg").bounding_box()
    scale = plot["width"] / float(figure.locator("svg").get_attribute("viewBox").split()[2])

    def screen(share_x, share_y):
        return plot["x"] + scale * (left + share_x * (right - left)), plot["y"] + scale * (
            bottom - share_y * (bottom - top)
        )

    # the part of the panel around the critical point
    path = computed.paths[Key("A", Direction.COMPRESSION, "vjm-16f16")]
    at = (path.critical.s - x[0]) / (x[1] - x[0]), (path.critical.force / 1e3 - y[0]) / (y[1] - y[0])
    page.mouse.move(*screen(at[0] - 0.1, at[1] + 0.1))
    page.mouse.down()
    page.mouse.move(*screen(at[0] + 0.1, at[1] - 0.1))
    page.mouse.up()
    words = [text.replace("\u2212", "-") for text in figure.locator(".own-axes text").all_text_contents()]
    half_x, half_y = 0.1 * (x[1] - x[0]), 0.1 * (y[1] - y[0])
    found = [float(word) for word in words]
    on_x = [v for v in found if abs(v - path.critical.s) <= 1.01 * half_x]
    on_y = [v for v in found if abs(v - path.critical.force / 1e3) <= 1.01 * half_y]
    assert len(on_x) >= 3
    assert len(on_y) >= 3
    assert len(on_x) + len(on_y) == len(found)
    # the critical point now lies in the middle
    page.mouse.move(*screen(0.5, 0.5))
    values = figure.locator(".tip").inner_text().partition(": ")[2].split(", ")
    assert float(values[0]) == pytest.approx(path.critical.s, abs=0.2 * half_x)
    figure.get_by_role("button", name="whole figure").click()
    assert figure.locator(".own-axes text").count() == 0
    assert figure.get_by_role("button", name="whole figure").is_disabled()
    figure.get_by_role("button", name="zoom in").click()
    assert figure.locator(".own-axes text").count() > 6


def test_a_table_is_sorted_and_filtered(open_page, run, bare, tmp_path):
    known = run.summary["verification"][0]
    values = [3.0, 1e-7, 20.0, 0.5, 7.0, 1e9, 2.0, 4.0, 6.0, 8.0, 9.0, 10.0, 11.0]
    run.summary["verification"] = [{**known, "name": f"case {k}", "value": v} for k, v in enumerate(values)]
    page = open_page(write_report(run, tmp_path))
    open_all(page)
    table = page.locator("#checks details table")
    head = table.get_by_role("button", name="Value")

    def names():
        return table.locator("tbody tr:visible td:first-child").all_inner_texts()

    head.click()
    assert names() == [f"case {k}" for k in sorted(range(len(values)), key=lambda k: values[k])]
    head.click()
    assert names()[0] == "case 5"
    page.locator("#checks details input").fill("case 12")
    assert names() == ["case 12"]


@pytest.mark.usefixtures("rendering")
def test_the_scene_turns_and_follows_the_path(open_page, folder):
    page = open_page(folder / "index.html")
    canvas = page.locator("figure[data-scene] canvas").first
    canvas.scroll_into_view_if_needed()
    before = canvas.screenshot()
    assert canvas.screenshot() == before
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 130)
    page.mouse.up()
    turned = canvas.screenshot()
    assert turned != before
    canvas.press("ArrowLeft")
    assert canvas.screenshot() != turned
    words = page.locator("figure[data-scene] [role=status]").first
    said = words.inner_text()
    page.get_by_role("slider", name="along the path").first.press("End")
    assert words.inner_text() != said
    assert words.inner_text().strip().startswith("4 mm: ")
    turned = canvas.screenshot()
    page.get_by_role("button", name="colour by difference").first.click()
    assert canvas.screenshot() != turned


def test_the_values_of_a_figure_download(open_page, folder):
    page = open_page(folder / "index.html", accept_downloads=True)
    with page.expect_download() as waiting:
        page.locator("#figure-force_A a.csv").click()
    assert waiting.value.suggested_filename == "force_A.csv"
    assert waiting.value.path().read_text().startswith('panel,title,series,"x: displacement')


def test_it_is_whole_without_a_script(open_page, folder):
    page = open_page(folder / "index.html", java_script_enabled=False)
    finding = page.locator("details.finding.cause").first
    finding.locator("summary").click()
    expect(finding.locator("ul")).to_be_visible()
    expect(page.locator("svg.plot").first).to_be_visible()
    assert page.locator("header figure img").first.is_visible() or why_not_rendered()


@pytest.mark.slow
def test_what_comes_from_a_file_does_not_run(open_page, run, bare, tmp_path):
    attack = "<img src=x onerror=document.title='taken'><script>document.title='taken'</script>"
    run.chain = replace(run.chain, title=attack, name=attack, source=attack)
    run.summary["acceptance"][0]["name"] = attack
    run.summary["notes"] = [attack]
    page = open_page(write_report(run, tmp_path))
    page.wait_for_timeout(100)
    assert page.title() != "taken"
    assert page.locator("img[src=x]").count() == 0
    assert page.errors == []


@pytest.mark.slow
def test_it_prints_on_few_pages(folder, tmp_path):
    print_page(folder / "index.html", tmp_path / "report.pdf")
    assert [file.name for file in tmp_path.iterdir()] == ["report.pdf"]
    pdf = (tmp_path / "report.pdf").read_bytes()
    pages = pdf.count(b"/Type /Page\n")
    assert 1 <= pages <= 12
