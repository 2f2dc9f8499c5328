"""A program that is no browser and speaks to the page of `validate explore` in the words of viser's protocol."""

import re
import threading
import time
from contextlib import contextmanager
from html import unescape

import msgspec
import zstandard
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, -1.0, 1.0], "fov": 1.0,
    "near": 0.01, "far": 100.0, "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
"""Without it viser takes a client for one that has not yet opened the page."""
PATIENCE = 60.0
"""s that an answer may take beside other tests."""


@contextmanager
def served(explorer, folder):
    """The page, which answers."""
    from vjm_validation.explore.page import Page

    page = Page(explorer, None, folder)
    answering = threading.Thread(target=page.run, daemon=True)
    answering.start()
    try:
        yield page
    finally:
        page.stop()
        answering.join()


class ForeignClient:
    """A connection, and what the page shows as it was told."""

    def __init__(self, page, **options):
        import viser

        options.setdefault("subprotocols", [f"viser-v{viser.__version__}"])
        address = options.pop("address", page.address.replace("http://", "ws://"))
        self.socket = connect(address, max_size=None, proxy=None, **options)
        self.inputs, self.values, self.shown = {}, {}, {}
        self.nodes = {}
        self.send(CAMERA)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, message):
        self.socket.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))

    def set(self, label, value):
        """Set an input by its label."""
        self.until(lambda: label in self.inputs)
        self.send({"type": "GuiUpdateMessage", "uuid": self.inputs[label], "updates": {"value": value}})

    def press(self, label):
        self.set(label, True)

    def value(self, label):
        return self.values[self.inputs[label]]

    def take(self, timeout):
        raw = self.socket.recv(timeout=timeout)
        size = int.from_bytes(raw[8:16], "little")
        for message in msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(raw[16 : 16 + size]))[
            "messages"
        ]:
            uuid = message.get("uuid")
            if message["type"] == "GuiUpdateMessage":
                if "value" in message["updates"]:
                    self.values[uuid] = message["updates"]["value"]
                if "content" in message["updates"]:
                    self.shown[uuid] = message["updates"]["content"]
            elif "props" in message and uuid is not None:
                if "label" in message["props"]:
                    self.inputs[message["props"]["label"]] = uuid
                self.values[uuid] = message.get("value")
                self.shown[uuid] = message["props"].get("content", "")

    def until(self, condition):
        """Listen until a condition holds."""
        ends = time.monotonic() + PATIENCE
        while not condition():
            try:
                self.take(max(0.01, ends - time.monotonic()))
            except TimeoutError:
                raise AssertionError(f"not within {PATIENCE} s; the page says {self.text()}") from None

    def text(self):
        """All that the page says."""
        return " ".join(unescape(re.sub(r"<[^>]*>", " ", html)) for html in self.shown.values() if html)

    def says(self, words):
        """Wait until the page says some words."""
        self.until(lambda: words in self.text())

    def number(self, name):
        """The number of the page that has a name, nan while there is none."""
        found = re.search(rf"id='{name}'>([^<]*)<", " ".join(html for html in self.shown.values() if html))
        return float(found[1]) if found else float("nan")

    def comes_to(self, name, value):
        """Wait until a number of the page is a value; five digits are shown."""
        self.until(lambda: abs(self.number(name) - value) <= 1e-4 * abs(value))
