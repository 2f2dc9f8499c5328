"""A page serves only who has its address, takes only what its inputs take, and goes on whatever it is sent."""

import http.client
import math
import socket
import threading
from contextlib import closing
from dataclasses import replace
from urllib.parse import urlsplit

import pytest

pytest.importorskip("viser", reason="viser, which the page is made with, is missing")

from helpers.foreign_client import CAMERA, PATIENCE, ForeignClient, served
from websockets.exceptions import ConnectionClosed, InvalidStatus

from vjm_validation.explore.page import LARGEST_MESSAGE, MOST_PAGES
from vjm_validation.explore.state import FINEST, Explorer

JOINT, FORCE, DRAWN = "elbow, rad", "fz, N", "deflection drawn times 10 to the"
FULL, LESS = (0.0, 0.0, -10.0, 0.0, 0.0, 0.0), (0.0, 0.0, -4.0, 0.0, 0.0, 0.0)
"""Loads to begin with, and after a slider has moved."""


@pytest.fixture
def page(tmp_path):
    with served(Explorer("planar-2r", wrench=FULL), tmp_path) as opened:
        yield opened


@pytest.fixture(scope="module")
def shared_page(tmp_path_factory):
    """One page to which much is sent that it does not take."""
    folder = tmp_path_factory.mktemp("explored")
    with served(Explorer("planar-2r", wrench=FULL), folder) as opened:
        yield opened


def deflection(page, **changed):
    """What the explorer itself says of a setting, mm along z."""
    return float(page.explorer.answer(replace(page.explorer.start, **changed)).deflection[2])


def asked(page, path, **headers):
    """Status, headers and content of a request."""
    with closing(http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)) as connection:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()


# --- who is served -------------------------------------------------------------------------------------------


def test_it_listens_on_this_computer_only(page):
    assert urlsplit(page.address).hostname == "127.0.0.1"
    # all of 127.0.0.0/8 is this computer; a server of all addresses would answer at each of them
    with socket.socket() as other, pytest.raises(ConnectionRefusedError):
        other.connect(("127.0.0.2", page.port))


def test_without_the_token_nothing_is_served(page):
    path = urlsplit(page.address).path
    status, _, content = asked(page, path)
    assert status == 200
    assert b"<html" in content
    for other in ("/", "/index.html", path[:-2] + "/", path.upper(), "/%2e%2e" + path, "//" + path, "/?" + path):
        status, _, content = asked(page, other)
        assert status == 403, other
        assert b"<html" not in content
    for other in ("", "/x", path[:-2]):
        with pytest.raises(InvalidStatus, match="403"):
            ForeignClient(page, address=f"ws://127.0.0.1:{page.port}{other}")


def test_two_pages_have_two_tokens_of_192_bits(tmp_path):
    explorer, tokens = Explorer("planar-2r"), set()
    for _ in range(2):
        with served(explorer, tmp_path) as opened:
            tokens.add(urlsplit(opened.address).path)
    assert len(tokens) == 2
    # base 64: six bits a letter, between two strokes
    assert min(map(len, tokens)) >= 192 // 6 + 2


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1"]
)
def test_a_page_of_another_origin_does_not_get_in(page, origin):
    origin = origin.format(port=page.port)
    with pytest.raises(InvalidStatus, match="403"):
        ForeignClient(page, origin=origin)
    assert asked(page, urlsplit(page.address).path, Origin=origin)[0] == 403
    with ForeignClient(page, origin=f"http://127.0.0.1:{page.port}") as client:
        client.comes_to("uz", deflection(page))


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:{port}.evil.example"]
)
def test_another_name_that_leads_here_is_not_served(page, host):
    assert asked(page, urlsplit(page.address).path, Host=host.format(port=page.port))[0] == 403


def test_its_address_is_sent_nowhere(page):
    _, headers, _ = asked(page, urlsplit(page.address).path)
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"


# --- what is taken -------------------------------------------------------------------------------------------


def test_a_value_beyond_its_slider_is_taken_as_the_end(page):
    elbow = page.explorer.coordinates[1]
    with ForeignClient(page) as client:
        client.comes_to("uz", deflection(page))
        for value, end in ((400, elbow.ends[1]), (-1e300, elbow.ends[0]), (2**63, elbow.ends[1])):
            client.set(JOINT, value)
            client.comes_to("uz", deflection(page, coordinates=(page.explorer.coordinates[0].value, end)))
            client.says(f"is taken as {end:.6g}")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "400", "", None, True, [1.0], {"a": 1.0}, b"1"])
@pytest.mark.parametrize("label", [JOINT, FORCE, DRAWN])
def test_what_is_no_finite_number_is_left_out_and_the_next_value_is_taken(shared_page, label, value):
    with ForeignClient(shared_page) as client:
        client.set(FORCE, -10)
        client.comes_to("uz", deflection(shared_page))
        client.set(label, value)
        number = isinstance(value, float | str | bool)
        client.says("takes a finite number" if number else "a message that this page does not send was left out")
        client.set(FORCE, -4)
        client.comes_to("uz", deflection(shared_page, load=LESS))
        assert shared_page.setting() == replace(shared_page.explorer.start, load=LESS)
        assert "left out" not in client.text()
        assert "finite" not in client.text()


@pytest.mark.parametrize("power", [400, 1e300, -400])
def test_a_power_of_ten_beyond_all_numbers_does_not_end_the_page(page, power):
    with ForeignClient(page) as client:
        client.set(DRAWN, power)
        client.set(FORCE, -4)
        client.comes_to("uz", deflection(page, load=LESS))
        client.says(f"drawn times {1e5 if power > 0 else 1:.3g}")


GARBAGE = {
    "no message": b"",
    "noise": bytes(range(256)),
    "a number": b"\x01",
    "cut short": b"\x84\xa4type\xb0GuiUpdate",
    "not UTF-8": b"\x81\xa4type\xa2\xff\xfe",
    "deep": b"\x91" * 3000,
    "a long list is said to follow": b"\xdd\xff\xff\xff\xff",
    "text": "GuiUpdateMessage",
    "no type": {"uuid": "x"},
    "no such type": {"type": "Quit"},
    "a type of a server": {"type": "RunJavascriptMessage", "source": "0"},
    "a tunnel": {"type": "ShareUrlRequest"},
    "an upload": {
        "type": "FileTransferStartUpload", "source_component_uuid": "", "transfer_uuid": "", "filename": "x",
        "mime_type": "", "part_count": 1, "size_bytes": 10**12,
    },
    "an unknown input": {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1.0}},
    "an input that is a list": {"type": "GuiUpdateMessage", "uuid": [1], "updates": {"value": 1.0}},
    "an unknown mark": {
        "type": "TransformControlsUpdateMessage", "name": "/x", "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [0.0, 0.0, 0.0],
    },
    "a mark at no place": {
        "type": "TransformControlsUpdateMessage", "name": "/pull", "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [math.nan, 0.0, math.inf],
    },
    "a mark in a plane": {
        "type": "TransformControlsUpdateMessage", "name": "/pull", "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [0.0, 0.0],
    },
    "a camera nowhere": CAMERA | {"position": [math.nan, 0.0, 0.0]},
    "a camera of words": CAMERA | {"fov": "wide"},
}  # fmt: skip


@pytest.mark.parametrize("message", GARBAGE.values(), ids=GARBAGE.keys())
def test_what_is_no_message_of_the_page_changes_nothing(shared_page, message, caplog, capfd):
    start = shared_page.explorer.start
    with ForeignClient(shared_page) as client:
        client.set(FORCE, -10)
        client.send(message)
        for force in (-4.0, -10.0):
            client.set(FORCE, force)
            load = (0.0, 0.0, force, 0.0, 0.0, 0.0)
            client.comes_to("uz", deflection(shared_page, load=load))
        assert shared_page.setting() == start
    assert not list(shared_page.folder.iterdir())
    # viser's own server would print a traceback
    assert caplog.text == ""
    assert capfd.readouterr().err == ""


def test_no_other_property_of_an_input_is_set(page):
    with ForeignClient(page) as client:
        client.until(lambda: JOINT in client.inputs)
        for name in ("update_cb", "disabled", "removed", "props", "max"):
            client.send({"type": "GuiUpdateMessage", "uuid": client.inputs[JOINT], "updates": {name: 0.0}})
            client.says("a message that this page does not send was left out")
        client.set(JOINT, 1.0)
        shoulder = page.explorer.coordinates[0].value
        client.comes_to("uz", deflection(page, coordinates=(shoulder, 1.0)))


def test_an_arrow_that_is_drawn_far_away_is_the_largest_force(page):
    high = page.explorer.load[0].ends[1]
    with ForeignClient(page) as client:
        client.comes_to("uz", deflection(page))
        client.send({
            "type": "TransformControlsUpdateMessage", "name": "/pull", "wxyz": [1.0, 0.0, 0.0, 0.0],
            "position": [1e9, 0.0, 0.0],
        })  # fmt: skip
        client.until(lambda: client.value("fx, N") == pytest.approx(high))


def test_a_message_that_is_too_long_ends_its_own_connection_only(page):
    with ForeignClient(page) as kept:
        with ForeignClient(page) as client:
            client.send(bytes(LARGEST_MESSAGE + 1))
            with pytest.raises(ConnectionClosed):
                client.until(lambda: False)
        kept.set(FORCE, -4)
        kept.comes_to("uz", deflection(page, load=LESS))


def test_no_more_pages_are_opened_than_are_served(page):
    clients = [ForeignClient(page) for _ in range(MOST_PAGES)]
    for _ in range(50):
        with pytest.raises(InvalidStatus, match="503"):
            ForeignClient(page)
    clients[0].set(FORCE, -4)
    clients[-1].comes_to("uz", deflection(page, load=LESS))
    for client in clients:
        client.socket.close()
    with ForeignClient(page) as client:
        client.comes_to("uz", deflection(page, load=LESS))


def test_bytes_that_are_no_request_do_not_end_the_page(page):
    for raw in (b"\x00" * 100, b"GET / HTTP/9\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n", b"A" * 100_000):
        with socket.create_connection(("127.0.0.1", page.port), timeout=10) as other:
            other.sendall(raw)
    with ForeignClient(page) as client:
        client.comes_to("uz", deflection(page))


# --- what fails ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [ValueError("out of\n reach"), ZeroDivisionError(), KeyError("x"), MemoryError()])
def test_what_fails_is_said_in_one_line_and_the_next_value_is_answered(page, error, monkeypatch):
    answer, failing = page.explorer.answer, True

    def fails(setting):
        if failing:
            raise error
        return answer(setting)

    monkeypatch.setattr(page.explorer, "answer", fails)
    with ForeignClient(page) as client:
        client.set(JOINT, 1.0)
        client.says("out of reach" if isinstance(error, ValueError) else type(error).__name__)
        failing = False
        client.set(FORCE, -4)
        shoulder, load = page.explorer.coordinates[0].value, LESS
        client.comes_to("uz", deflection(page, coordinates=(shoulder, 1.0), load=load))
        assert type(error).__name__ not in client.text()


def test_of_values_that_come_while_it_computes_the_latest_is_answered(page, monkeypatch):
    answer, settings = page.explorer.answer, []

    def slow(setting):
        settings.append(setting)
        return answer(setting)

    with ForeignClient(page) as client:
        client.comes_to("uz", deflection(page))
        monkeypatch.setattr(page.explorer, "answer", slow)
        for k in range(2000):
            client.set(FORCE, -10.0 + 0.003 * k)
        monkeypatch.undo()
        client.set(FORCE, -4)
        client.comes_to("uz", deflection(page, load=LESS))
    assert len(settings) < 1000


def test_searches_do_not_pile_up_and_the_sliders_are_answered_meanwhile(page, monkeypatch):
    begun, may_end = [], threading.Event()

    def search(setting):
        begun.append(setting)
        assert may_end.wait(PATIENCE)
        raise ValueError("none was found")

    monkeypatch.setattr(page.explorer, "critical", search)
    with ForeignClient(page) as client:
        for _ in range(20):
            client.press("smallest critical force")
        client.set(FORCE, -4)
        # a client's messages come in order: when this one is answered, all that were sent before it have come
        client.comes_to("uz", deflection(page, load=LESS))
        may_end.set()
        client.says("none was found")
    # the one that ran, and the latest of those that were asked for meanwhile
    assert 1 <= len(begun) <= 2


# --- what is written -----------------------------------------------------------------------------------------


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../a.toml", "without a folder"), ("/a.toml", "without a folder"), ("a/b.toml", "without a folder"),
        (".a.toml", "write a name"), (".toml", "write a name"), ("", "write a name"), ("a.txt", "write a name"),
        ("-a.toml", "write a name"), ("a b.toml", "write a name"), ("$(id).toml", "write a name"),
        ("a\\b.toml", "write a name"), ("there.toml", "exists already"), ("link.toml", "exists already"),
    ],
)  # fmt: skip
def test_a_file_is_written_under_a_plain_name_and_over_nothing(page, name, words):
    (page.folder / "there.toml").write_text("mine")
    (page.folder / "link.toml").symlink_to(page.folder / "nowhere.toml")
    before = sorted(page.folder.parent.rglob("*"))
    with ForeignClient(page) as client:
        client.set("file", name)
        client.press("save as model")
        client.says(words)
        assert sorted(page.folder.parent.rglob("*")) == before
        assert (page.folder / "there.toml").read_text() == "mine"
        client.set("file", "mine.toml")
        client.press("save as model")
        client.says("Saved mine.toml.")
        client.press("save as model")
        client.says("mine.toml exists already")


@pytest.mark.parametrize("label", ["", "0.1,0.2", "a=1", "a b", "a]\n[b", "bent", "x" * 99, "x" * 200, "a\x00"])
def test_a_posture_is_kept_under_a_word_and_over_no_other(page, label):
    with ForeignClient(page) as client:
        client.until(lambda: "posture's label" in client.inputs)
        client.set("posture's label", label)
        if len(label) > 100 or not label.isprintable():
            client.says("'posture's label' takes one line of at most 100 letters, and stays as it is")
            client.press("save posture")
            client.says("posture explored in it")
        else:
            client.press("save posture")
            client.says("write another label" if label == "bent" else "write a label")
            assert not list(page.folder.iterdir())


def test_a_chain_that_is_there_is_not_written_over(tmp_path):
    explorer = Explorer("delta")
    written = explorer.save(explorer.start, tmp_path / "a.toml")
    other = tmp_path / written[0].name.replace("a-", "b-", 1)
    other.write_text("mine")
    with pytest.raises(ValueError, match=f"{other.name} exists already"):
        explorer.save(explorer.start, tmp_path / "b.toml")
    assert other.read_text() == "mine"
    assert not (tmp_path / "b.toml").exists()


def test_small_numbers_are_shown_in_a_unit_in_which_the_page_can_write_them():
    for each in Explorer("ur10").sizes:
        shown, scale = each.readable()
        assert shown.step >= FINEST
        # twelve digits
        assert shown.value * scale == pytest.approx(each.value, rel=1e-11)
        assert shown.ends[0] <= shown.value <= shown.ends[1]
