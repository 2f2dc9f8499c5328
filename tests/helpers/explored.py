"""The page of `validate explore` in Chromium, and the picture of it in the docs.

PYTHONPATH=tests .venv/bin/python -m helpers.explored     # writes docs/static/explore.png
"""

import io
import threading
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from PIL import Image

from vjm_validation.explore.state import Explorer
from vjm_validation.report.page import chromium

PICTURE = Path(__file__).parents[2] / "docs/static/explore.png"
ANSWERED = 120_000
"""ms: without a graphics card Chromium draws slowly, beside other tests the more so."""
LAUNCH = ("--no-sandbox", "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1")
"""No name is resolved, so that nothing beyond this computer is reached."""


@contextmanager
def browsed(explorer, folder, width=900, height=620):
    """The server's page and Chromium's, which keeps the hosts that it asked, and its errors."""
    from playwright.sync_api import sync_playwright

    from vjm_validation.explore.page import Page

    served = Page(explorer, None, folder)
    answering = threading.Thread(target=served.run, daemon=True)
    answering.start()
    try:
        with sync_playwright() as playwright_session:
            browser = playwright_session.chromium.launch(executable_path=chromium(), args=list(LAUNCH))
            page = browser.new_page(viewport={"width": width, "height": height})
            page.hosts, page.errors = set(), []
            page.on("request", lambda request: page.hosts.add(host_of(request.url)))
            page.on("websocket", lambda socket: page.hosts.add(host_of(socket.url)))
            page.on(
                "console", lambda message: page.errors.append(message.text) if message.type == "error" else None
            )
            page.on("pageerror", lambda error: page.errors.append(str(error)))
            page.set_default_timeout(ANSWERED)
            page.goto(served.address)
            page.wait_for_selector("#numbers")
            yield served, page
            browser.close()
    finally:
        served.stop()
        answering.join()


def host_of(url):
    """The host that is asked; empty for what the page holds itself."""
    return "" if url.startswith(("data:", "blob:")) else urlsplit(url).netloc


def seen(page, patience=40):
    """What the page shows, ``(h, w, 3)``, when the machine is drawn, and as PNG.

    The machine is drawn when there are colours that the panel has not: the orange of the joints.
    """
    for _ in range(patience):
        raw = page.screenshot(timeout=ANSWERED)
        picture = np.asarray(Image.open(io.BytesIO(raw)).convert("RGB")).astype(int)
        if orange(picture[:, : 2 * picture.shape[1] // 3]):
            return picture, raw
        page.wait_for_timeout(500)
    raise AssertionError("the machine is not drawn")


def orange(picture):
    """Number of pixels in the colour of joints, lit or not."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return int(np.count_nonzero((red > 1.3 * green) & (green > 1.5 * blue) & (red > 90)))


def main():
    """Write the picture."""
    explorer = Explorer("ur10", "0.3,-1.2,1.4,-0.5,1.5,0", wrench=(0.0, 0.0, -100.0, 0.0, 0.0, 0.0))
    with browsed(explorer, Path.cwd(), 1200, 800) as (_, page):
        notice = page.locator(".mantine-Notification-closeButton")
        if notice.count():
            notice.first.click()
        page.wait_for_timeout(3000)
        PICTURE.write_bytes(seen(page)[1])
    print(PICTURE)


if __name__ == "__main__":
    main()
