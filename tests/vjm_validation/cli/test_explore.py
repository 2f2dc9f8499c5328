"""`validate explore` refuses what it cannot open in one line, before any page is opened."""

import socket
import sys

import pytest
from helpers.command import refused

from vjm_validation.cli.main import missing_extra


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["no-such-model"], "no model 'no-such-model'"),
        (["ur10", "--posture", "nowhere"], "nowhere"),
        (["ur10", "--wrench", "1,2"], "--wrench: needs six numbers"),
        (["ur10", "--gravity", "1,2"], "--gravity"),
        (["ur10", "--segments", "0"], "--segments: must be at least 1"),
        (["ur10", "--end", "hand"], "no end frame 'hand'"),
        (["ur10", "--port", "70000"], "--port 70000: give a number from 1 to 65535"),
        (["ur10", "no-such-model"], "no model 'no-such-model'"),
        (
            ["ur10", "orthoglide-chain"],
            "orthoglide-chain has passive joints and its end is held; ur10 bears a load",
        ),
        (["orthoglide-chain", "--wrench", "1,0,0,0,0,0"], "carries no load on a free end"),
    ],
)
def test_bad_input_is_one_line_and_status_2(options, words):
    assert words in refused("explore", *options)


def test_a_port_that_is_in_use_is_refused():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert f"--port {port}: cannot be used" in refused("explore", "ur10", "--port", port)


def test_without_the_extra_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    said = refused("explore", "ur10")
    assert "this needs viser, which is not installed: pip install 'vjm-stiffness[explore]'" in said


def test_a_missing_module_of_the_page_names_the_extra():
    error = ModuleNotFoundError("No module named 'viser'", name="viser")
    assert missing_extra(error).endswith("pip install 'vjm-stiffness[explore]'")
