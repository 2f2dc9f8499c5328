"""The page: sliders on the right, the machine on the left; everything that is computed is in `state`."""

from __future__ import annotations

import hmac
import logging
import math
import secrets
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from html import escape
from http import HTTPStatus
from io import StringIO
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import viser
import websockets.asyncio.server as server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from vjm.machine.critical_force import Weakest
from vjm.rotations import Array
from vjm_validation.explore.drawing import BEAM, BODY, FREE, HELD, RIGID, MachineDrawing, ellipsoid
from vjm_validation.explore.jobs import Job, Jobs
from vjm_validation.explore.state import ComparedMachine, Explorer, ExplorerAnswer, Setting, Slider, Wish, compared

# --- What the page says of an answer, as HTML ---------------------------------------------------------------------

BARS = 8
"""Parts that have a bar of their own."""
AXES = ("ux", "uy", "uz", "rx", "ry", "rz")


def numbers(answer: ExplorerAnswer, factor: float, seconds: float) -> str:
    """The answer as HTML; every number has an id of its own."""
    moved = "".join(
        f"<td>{name}</td><td id='{name}'>{value:.5g}</td>" + ("</tr><tr>" if k == 2 else "")
        for k, (name, value) in enumerate(zip(AXES, answer.deflection, strict=True))
    )
    shift = float(np.linalg.norm(answer.deflection[:3]))
    stiff = ", ".join("rigid" if not np.isfinite(v) else f"{v:.5g}" for v in answer.principal)
    frequency = "–" if answer.frequency is None else f"{answer.frequency:.5g} Hz"
    lines = [
        f"<div><b>deflection</b>, mm and rad</div><table style='width:100%'><tr>{moved}</tr></table>",
        f"<div>shift of the end <b id='shift'>{shift:.5g}</b> mm, drawn times {factor:.3g}</div>",
        f"<div>principal stiffnesses <b id='principal'>{stiff}</b> N/mm</div>",
        f"<div>first natural frequency <b id='frequency'>{frequency}</b></div>",
    ]
    if answer.shares is not None:
        lines.append(bars(answer))
    lines += [f"<div style='color:#666'>{escape(text)}</div>" for text in answer.said]
    lines.append(f"<div style='color:#888'>answered in <span id='time'>{1e3 * seconds:.0f}</span> ms</div>")
    return f"<div id='numbers' style='font-size:0.85em;padding:0 0.8em'>{''.join(lines)}</div>"


def bars(answer: ExplorerAnswer) -> str:
    """The parts' shares in the strain energy, the largest first, as bars."""
    assert answer.shares is not None
    pairs = sorted(zip(answer.shares.energies.tolist(), answer.shares.rows, strict=True), key=lambda pair: -pair[0])
    rows = [
        f"<tr><td>{escape(row.part)} ({row.kind})</td><td style='width:45%'><div style='background:#3c78be;"
        f"height:0.8em;width:{100.0 * max(share, 0.0):.1f}%'></div></td><td>{share:.1%}</td></tr>"
        for share, row in pairs[:BARS]
        if np.isfinite(share)
    ]
    rest = sum(share for share, _ in pairs[BARS:])
    if len(pairs) > BARS:
        rows.append(f"<tr><td>{len(pairs) - BARS} more</td><td></td><td>{rest:.1%}</td></tr>")
    head = "<tr><td colspan=3><b>shares in the strain energy</b></td></tr>"
    return f"<table id='shares' style='width:100%'>{head}{''.join(rows)}</table>"


def command_words(command: str, remark: str, name: str = "command") -> str:
    """A command as HTML with the id ``name`` that one click marks as a whole, so that it can be copied."""
    code = f"<code id='{name}' style='user-select:all;overflow-wrap:anywhere'>{escape(command)}</code>"
    return f"<div style='padding:0 0.8em;font-size:0.85em'>{code}<div>{escape(remark)}</div></div>"


def critical_words(weakest: Weakest) -> str:
    """What a search for the smallest critical force says."""
    if not np.isfinite(weakest.force):
        return f"There is none: {weakest.why}." if weakest.why else "There is none."
    x, y, z = weakest.direction
    return f"Smallest critical force {weakest.force:.5g} N, along ({x:.3f}, {y:.3f}, {z:.3f})."


def remark(line: str, name: str, *, wrong: bool = False) -> str:
    """A line as HTML; nothing for no line.

    Args:
        line: on what was done, or why it was not.
        name: id of its element.
        wrong: whether something was refused, or failed.
    """
    style = f"color:{'#b00' if wrong else '#333'};padding:0 0.8em;font-size:0.85em;overflow-wrap:anywhere"
    return f'<div id="{name}" style="{style}">{escape(line)}</div>' if line else ""


# ------------------------------------------------------------------------------------------------------------------


# --- What a page may say: its messages, each of its inputs with the values that it takes --------------------------

LONGEST_TEXT, LONGEST_LIST = 100, 400
"""Letters of a text input; of one that takes a list of numbers or limits."""

_Number = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
"""Of cameras and marks, in a scene in which the machine has the size one: no infinity, and no NaN."""
_Pixels = Annotated[int, msgspec.Meta(ge=0, le=100_000)]
_Name = Annotated[str, msgspec.Meta(max_length=LONGEST_TEXT)]


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """In the words of viser's protocol."""


class _Camera(_Message, tag="ViewerCameraMessage"):
    wxyz: tuple[_Number, _Number, _Number, _Number]
    position: tuple[_Number, _Number, _Number]
    fov: _Number
    near: _Number
    far: _Number
    image_height: _Pixels
    image_width: _Pixels
    look_at: tuple[_Number, _Number, _Number]
    up_direction: tuple[_Number, _Number, _Number]


class _Dragged(_Message, tag="TransformControlsUpdateMessage"):
    name: _Name
    wxyz: tuple[_Number, _Number, _Number, _Number]
    position: tuple[_Number, _Number, _Number]
    owner: _Name = ""


class _DragBegun(_Message, tag="TransformControlsDragStartMessage"):
    name: _Name
    owner: _Name = ""


class _DragEnded(_Message, tag="TransformControlsDragEndMessage"):
    name: _Name
    owner: _Name = ""


class _Value(msgspec.Struct, forbid_unknown_fields=True):
    value: bool | float | str


class _Set(_Message, tag="GuiUpdateMessage"):
    uuid: _Name
    updates: _Value


_READ = msgspec.msgpack.Decoder(_Camera | _Dragged | _DragBegun | _DragEnded | _Set)


@dataclass(frozen=True)
class NumberInput:
    """A slider of viser's, which may show its number in another unit.

    Attributes:
        handle: viser's.
        start: the number to begin with, and
        shown: what the slider shows for it.
        scale: of what it shows.
    """

    handle: Any
    start: float
    shown: float
    scale: float

    @property
    def value(self) -> float:
        """The number; to begin with exactly that of the file."""
        stands = float(self.handle.value)
        return self.start if stands == self.shown else stands * self.scale

    def set(self, value: float) -> None:
        """Let it stand at another number."""
        self.handle.value = value / self.scale


class Inputs:
    """The inputs of a page: a message that sets none of them, or not to a value that it takes, goes no further."""

    def __init__(self, said: Callable[[str], None]) -> None:
        """No input yet.

        Args:
            said: takes a line on what was left out or changed; empty when the last value was taken as it is.
        """
        self._said = said
        self._of: dict[str, Callable[[object], tuple[Any, str]]] = {}

    def number(self, handle: Any, slider: Slider) -> NumberInput:  # noqa: ANN401  (viser's handles are generic)
        """Take finite numbers for a slider; those beyond its ends are set to the end."""
        shown, scale = slider.readable()
        low, high = shown.ends

        def taken(value: object) -> tuple[Any, str]:
            # a boolean is an int, but no number of a page's
            if not isinstance(value, float) or not math.isfinite(value):
                raise ValueError(f"'{slider.name}' takes a finite number and stays at {handle.value:.6g}")
            if low <= value <= high:
                return value, ""
            end = min(max(value, low), high)
            return end, f"'{slider.name}' goes from {low:.6g} to {high:.6g}: {value:.6g} is taken as {end:.6g}"

        self._of[_uuid(handle)] = taken
        return NumberInput(handle, slider.value, shown.value, scale)

    def switch(self, handle: Any, name: str) -> None:  # noqa: ANN401
        """Take true and false for a box or a button."""

        def taken(value: object) -> tuple[Any, str]:
            if not isinstance(value, bool):
                raise ValueError(f"'{name}' is on or off, and stays as it is")
            return value, ""

        self._of[_uuid(handle)] = taken

    def text(self, handle: Any, name: str, longest: int = LONGEST_TEXT) -> None:  # noqa: ANN401
        """Take short texts of one line."""

        def taken(value: object) -> tuple[Any, str]:
            if not isinstance(value, str) or len(value) > longest or not value.isprintable():
                raise ValueError(f"'{name}' takes one line of at most {longest} letters, and stays as it is")
            return value, ""

        self._of[_uuid(handle)] = taken

    def taken(self, raw: bytes | str) -> bytes | None:
        """What viser may read of a message; None for nothing. Whatever it is, nothing is raised."""
        try:
            message = _READ.decode(raw if isinstance(raw, bytes) else b"")
            if isinstance(message, _Set):
                if message.uuid not in self._of:
                    raise ValueError("a message for no input of this page was left out")
                message.updates.value, said = self._of[message.uuid](message.updates.value)
                self._said(said)
            return msgspec.msgpack.encode(message)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
            self._said("a message that this page does not send was left out")
        except ValueError as error:
            self._said(str(error))
        return None


def _uuid(handle: Any) -> str:  # noqa: ANN401
    return str(handle._impl.uuid)


# ------------------------------------------------------------------------------------------------------------------


# --- Who may ask for the page: requests and messages are checked before viser, which serves everybody, sees them

HOST = "127.0.0.1"
"""Only programs on this computer reach the page."""
TOKEN_BYTES = 24
"""Of the token: 192 bits cannot be guessed."""
LARGEST_MESSAGE = 4096
"""Bytes of a message from a page. The longest, that of its camera, has some 300."""
MOST_PAGES = 16
"""Open at once: each has every drawing sent to it."""


class Access:
    """The rules by which requests and messages are let through.

    A browser sends the host that it was asked for, and the origin of the page that asks. Checking them keeps out
    the pages of other sites, also those whose name leads to this computer (DNS rebinding). The token in the address
    keeps out other users of this computer. A program that is no browser sends no origin, and needs the token.

    Attributes:
        token: first part of the path of the address.
        in_force: whether a server has been started that keeps to the rules.
    """

    def __init__(self, taken: Callable[[bytes | str], bytes | None]) -> None:
        """Make a token.

        Args:
            taken: what the page takes of a message; None for nothing. It raises nothing.
        """
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self.in_force = False
        self._taken = taken

    def refusal(self, request: Request, port: int, pages: int) -> tuple[HTTPStatus, str] | None:
        """Why a request is refused; None where it is not.

        Args:
            request: of a browser or any program.
            port: of the server.
            pages: how many are open.
        """
        hosts = [f"{name}:{port}" for name in (HOST, "localhost")]
        headers, forbidden = request.headers, HTTPStatus.FORBIDDEN
        asked = headers.get_all("Host")
        if len(asked) != 1 or asked[0] not in hosts:
            return forbidden, f"This page is at {HOST} only.\n"
        origins = headers.get_all("Origin")
        if origins not in ([], [f"http://{asked[0]}"]):
            return forbidden, "Pages of other sites may not use this one.\n"
        if not hmac.compare_digest(_parts(request)[0].encode(), self.token.encode()):
            return forbidden, "Open the whole address that the command printed.\n"
        if headers.get_all("Upgrade"):
            if f"viser-v{viser.__version__}" not in ",".join(headers.get_all("Sec-WebSocket-Protocol")).split(","):
                return HTTPStatus.BAD_REQUEST, f"This page speaks viser-v{viser.__version__}.\n"
            if pages >= MOST_PAGES:
                return HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_PAGES} pages are open already: close one.\n"
        return None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """While viser starts its server: that server keeps to the rules. viser itself has no place for them."""
        access, serve = self, server.serve

        class Connection(server.ServerConnection):
            async def recv(self, decode: bool | None = None) -> Any:  # noqa: ANN401  (text or bytes)
                while True:
                    message = access._taken(await super().recv(decode))
                    if message is not None:
                        return message

        def serve_kept(handler: Any, host: str, port: int, **options: Any) -> server.serve:  # noqa: ANN401
            files = options.pop("process_request")

            def process_request(connection: server.ServerConnection, request: Request) -> Response | None:
                refused = access.refusal(request, port, len(connection.server.connections))
                if refused is not None:
                    return connection.respond(*refused)
                response: Response | None = files(connection, replace(request, path=_parts(request)[1]))
                return None if response is None else _private(response)

            options |= {"max_size": LARGEST_MESSAGE, "create_connection": Connection, "logger": _silent()}
            access.in_force = True
            return serve(handler, host, port, process_request=process_request, **options)

        server.serve = serve_kept  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            server.serve = serve  # type: ignore[misc]


def _parts(request: Request) -> tuple[str, str]:
    """The first part of a request's path, and the path behind it."""
    first, _, rest = request.path.partition("?")[0].removeprefix("/").partition("/")
    return first, f"/{rest}"


def _private(response: Response) -> Response:
    """The same, which a browser keeps for itself: neither its address nor a copy goes elsewhere."""
    headers = Headers(response.headers)
    headers["Referrer-Policy"] = "no-referrer"
    headers["Cache-Control"] = "no-store"
    return replace(response, headers=headers)


def _silent() -> logging.Logger:
    """A log that nobody reads: what foreign programs send wrongly is no news of the machine."""
    logger = logging.getLogger(f"{__name__}.connections")
    logger.propagate = False
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    return logger


# ------------------------------------------------------------------------------------------------------------------


FIRST_PORT = 8080
"""Tried where none is asked for, and those behind it."""
COLOURS = {
    BEAM: (60, 120, 190),
    RIGID: (110, 110, 115),
    BODY: (80, 80, 90),
    HELD: (225, 140, 40),
    FREE: (215, 205, 180),
}
GREY, GREEN, RED = (190, 190, 195), (80, 160, 90), (200, 40, 40)
ELLIPSOID, ARROW, OSCILLATION = 0.15, 0.3, 0.05
"""Over the machine's extent: longest half axis of the ellipsoid, arrow of the largest force, motion of a mode."""
LARGEST_POWER, FIRST_POWER = 5.0, 1.5
"""Of ten, by which a deflection may be drawn larger, and is to begin with."""
FACTOR = "deflection drawn times 10 to the"
ASIDE = np.array([0.95, 0.81, 0.0])
"""Where a second machine stands in the scene, to the right of the first one as it is seen to begin with."""
RATE = 25.0
"""Pictures of a moving mode a second."""
CYCLE = 1.5
"""s that a cycle of a mode takes in the page, whatever its frequency."""


class Page:
    """A page that answers to its sliders until it is stopped.

    Callbacks only ask for jobs. One thread does them, and a second one searches for critical forces. So nothing
    waits in viser's server, and nothing is done for values that have changed since.

    Attributes:
        server: viser's.
        port: on which it is.
        address: to open in a browser; nobody is served who does not know it.
    """

    def __init__(
        self, explorer: Explorer, port: int | None, folder: Path, beside: ComparedMachine | None = None
    ) -> None:
        """Open the page.

        Args:
            explorer: the machine.
            port: on this computer; the first free one from 8080 on if left out.
            folder: in which files are saved.
            beside: a second machine, which bears the same load.
        """
        self.explorer, self.folder, self._beside = explorer, folder, beside
        self._inputs = Inputs(self._say)
        access = Access(self._inputs.taken)
        # what viser prints of itself is said once, by the command
        with redirect_stdout(StringIO()), access.kept():
            title = str(explorer.files.document.content["title"])
            self.server = viser.ViserServer(HOST, port or FIRST_PORT, label=title, verbose=False)
        if not access.in_force:
            self.server.stop()
            raise RuntimeError(
                f"viser {viser.__version__} starts its server otherwise: the page would be open to all"
            )
        self.port = self.server.get_port()
        self.address = f"http://{HOST}:{self.port}/{access.token}/"
        self._jobs, self._searches = Jobs(), Jobs()
        self._answer: ExplorerAnswer | None = None
        self._drawing: MachineDrawing | None = None
        self._sections: tuple[object, Any] = (None, {})
        self._middle: Array | None = None
        self._meshes: dict[str, Any] = {}
        self._searched: Setting | None = None
        self._stopped = threading.Event()
        self._beside_drawing: tuple[ComparedMachine, MachineDrawing] | None = None
        self._build()
        self._look()
        self._jobs.ask("answer", self._refreshing)

    # --- what is on it ------------------------------------------------------------------------------------

    def _build(self) -> None:
        gui, explorer = self.server.gui, self.explorer
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        # light from everywhere, no pictures of surroundings, no shadows: slow computers draw it too
        self.server.scene.configure_environment_map(None)
        self.server.scene.configure_default_lights(cast_shadow=False)
        self.server.scene.add_light_ambient("/light", intensity=1.2)
        self._said = gui.add_html("")
        self._numbers = gui.add_html("")
        self._compared = gui.add_html("")
        self._refreshing = Job(self.refresh, self._not_answered)
        self._comparing = Job(self.compare, self._not_compared)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Move"):
            if explorer.coordinates:
                gui.add_markdown("**Pose from home**" if explorer.posed else "**Joints**")
            self._coordinates = [self._slider(each) for each in explorer.coordinates]
            gui.add_markdown(
                "**Displacement of the end, which is held**" if explorer.held else "**Force on the end**"
            )
            self._load = [self._slider(each) for each in explorer.load]
            self._weighed = self._box("weight of the parts", explorer.start.weighed, visible=not explorer.held)
            self._button("no load", self._unload, self._say)
        with tabs.add_tab("Sizes"):
            self._sizes = self._size_sliders()
        with tabs.add_tab("Show"):
            self._factor = self._slider(Slider(FACTOR, "", 0.0, LARGEST_POWER, FIRST_POWER))
            self._ellipsoid = self._box("stiffness ellipsoid", True)
            self._animated = self._box("first mode moves", False)
            self._undeformed = self._box("without load, grey", True)
        with tabs.add_tab("Critical"):
            self._search = self._button("smallest critical force", self._begin_search, self._not_found)
            self._search.disabled = explorer.held
            first = "The end is held: validate buckling follows a path." if explorer.held else "Not searched yet."
            self._critical = gui.add_html(remark(first, "critical"))
        with tabs.add_tab("Optimise"):
            self._build_optimise()
        with tabs.add_tab("Keep"):
            self._button("copy as command", self._show_command, self._say)
            self._command = gui.add_html("")
            self._name = self._text("file", f"{explorer.files.document.content['name']}-explored.toml")
            self._button("save as model", lambda: self._save(None), self._not_kept)
            self._label = self._text("posture's label", "explored")
            self._button("save posture", lambda: self._save(self._label.value.strip()), self._not_kept)
            self._kept = gui.add_html("")
        if not explorer.held:
            self._arrow = self.server.scene.add_transform_controls(
                "/pull", scale=0.15, disable_rotations=True, disable_sliders=True
            )
            self._arrow.on_update(self._asks("pull", Job(self._pulled, self._say)))

    def _build_optimise(self) -> None:
        sizes, explorer = [each.name for each in self.explorer.sizes], self.explorer
        section = [name for name in sizes if ".section." in name and "_mm" in name]
        self._vary = self._text("numbers", ",".join((section or sizes)[:2]), LONGEST_LIST)
        self._best = self._text("best", "mass")
        self._limits = self._text("such that", "", LONGEST_LIST)
        self._optimise = self._button("optimise", self._begin_optimise, self._not_optimised)
        self._stop_optimise = self._button("stop", self._stopped.set, self._say)
        self._take = self._button("take its numbers", self._take_numbers, self._say)
        self._optimise.disabled = explorer.held or not sizes
        self._stop_optimise.disabled = self._take.disabled = True
        first = (
            "The end is held: validate optimise takes machines that bear a load."
            if explorer.held
            else ("Each number goes from end to end of its slider. The load and the posture are those of the page.")
        )
        self._optimised = self.server.gui.add_html(remark(first, "optimised"))

    def _look(self) -> None:
        """Let cameras see the machine, or both."""
        far, middle = (1.0, np.zeros(3)) if self._beside is None else (1.6, 0.5 * ASIDE)
        place = middle + far * np.array([1.1, -1.3, 0.9])
        self.server.initial_camera.position, self.server.initial_camera.look_at = place, middle
        for client in self.server.get_clients().values():
            client.camera.position, client.camera.look_at = place, middle

    def _say(self, line: str) -> None:
        self._said.content = remark(line, "notice", wrong=True)

    def _not_answered(self, line: str) -> None:
        self._numbers.content = remark(line, "said", wrong=True)

    def _not_compared(self, line: str) -> None:
        assert self._beside is not None
        self._compared.content = remark(f"{self._beside.name}: {line}", "compared", wrong=True)

    def _not_optimised(self, line: str) -> None:
        self._optimised.content = remark(line, "optimised", wrong=True)
        self._optimise.disabled, self._stop_optimise.disabled = self.explorer.held, True

    def _not_kept(self, line: str) -> None:
        self._kept.content = remark(line, "kept", wrong=True)

    def _asks(self, name: str, job: Job) -> Callable[[object], Coroutine[Any, Any, None]]:
        """What viser calls: it asks for a job. As a coroutine it is not called in a thread of its own."""

        async def ask(_: object) -> None:
            self._jobs.ask(name, job)

        return ask

    def _slider(self, each: Slider) -> NumberInput:
        shown, _ = each.readable()
        low, high = shown.ends
        label = f"{shown.name}, {shown.unit}" if shown.unit else shown.name
        made = self.server.gui.add_slider(label, low, high, shown.step, shown.value, disabled=low == high)
        made.on_update(self._asks("answer", self._refreshing))
        return self._inputs.number(made, each)

    def _box(self, name: str, value: bool, *, visible: bool = True) -> Any:  # noqa: ANN401  (viser's are generic)
        made = self.server.gui.add_checkbox(name, value, visible=visible)
        self._inputs.switch(made, name)
        made.on_update(self._asks("answer", self._refreshing))
        return made

    def _text(self, name: str, value: str, longest: int = LONGEST_TEXT) -> Any:  # noqa: ANN401
        made = self.server.gui.add_text(name, value)
        self._inputs.text(made, name, longest)
        return made

    def _button(self, name: str, work: Callable[[], None], said: Callable[[str], None]) -> Any:  # noqa: ANN401
        made = self.server.gui.add_button(name)
        self._inputs.switch(made, name)
        made.on_click(self._asks(name, Job(work, said)))
        return made

    def _size_sliders(self) -> dict[str, NumberInput]:
        inputs: dict[str, NumberInput] = {}
        folders: dict[str, Any] = {}
        for each in self.explorer.sizes:
            part = each.name.rsplit(".section", 1)[0] if ".section" in each.name else each.name.rsplit(".", 1)[0]
            if part not in folders:
                folders[part] = self.server.gui.add_folder(part, expand_by_default=False)
            with folders[part]:
                own = Slider(each.name.removeprefix(f"{part}."), each.unit, each.low, each.high, each.value)
                inputs[each.name] = self._slider(own)
        return inputs

    def setting(self) -> Setting:
        """What the sliders stand at."""
        sizes = {each.name: self._sizes[each.name].value for each in self.explorer.sizes}
        return Setting(
            tuple(each.value for each in self._coordinates),
            tuple(each.value for each in self._load),
            bool(self._weighed.value),
            {each.name: sizes[each.name] for each in self.explorer.sizes if sizes[each.name] != each.value},
        )

    # --- what is done to it -------------------------------------------------------------------------------

    def _unload(self) -> None:
        for each in self._load:
            each.set(0.0)

    def _pulled(self) -> None:
        """The arrow's head was drawn: the force is where it went from the end."""
        if self._drawing is None:
            return
        pulled = np.array(self._arrow.position) - self._at(self._drawing, self._tip(self._drawing))
        for k, each in enumerate(self.explorer.load[:3]):
            low, high = each.ends
            force = float(np.clip(pulled[k] / ARROW * each.high, low, high))
            self._load[k].set(float(np.clip(round(force / each.step) * each.step, low, high)))
        # an arrow that was drawn beyond the largest force is drawn anew
        self._jobs.ask("answer", self._refreshing)

    def _begin_search(self) -> None:
        setting = self.setting()
        self._search.disabled = True
        self._critical.content = remark("Searching over all directions …", "critical")
        self._searches.ask("search", Job(lambda: self._find(setting), self._not_found))

    def _find(self, setting: Setting) -> None:
        self._critical.content = remark(critical_words(self.explorer.critical(setting)), "critical")
        self._searched = setting
        self._search.disabled = False

    def _not_found(self, line: str) -> None:
        self._critical.content = remark(line, "critical", wrong=True)
        self._search.disabled = self.explorer.held

    def _begin_optimise(self) -> None:
        setting = self.setting()
        wish = Wish(self._vary.value, self._best.value.strip(), self._limits.value.strip())
        # what cannot be asked is said at once
        wish.command(self.explorer, setting)
        self._stopped.clear()
        self._optimise.disabled, self._stop_optimise.disabled = True, False
        self._optimised.content = remark("The first machines …", "optimised")
        self._searches.ask("optimise", Job(lambda: self._optimum(wish, setting), self._not_optimised))

    def _optimum(self, wish: Wish, setting: Setting) -> None:
        def said(line: str) -> None:
            self._optimised.content = remark(line, "optimised")

        twin = self.explorer.again()
        optimum = wish.optimum(twin, setting, said, self._stopped.is_set)
        sizes = {**setting.sizes, **dict(zip(optimum.space.keys, map(float, optimum.values), strict=True))}
        ended = "stopped: the best so far" if optimum.interrupted else "from one start"
        kept = "" if optimum.kept else "; no machine that keeps the limits was found"
        said(f"{wish.best} {optimum.objective:.5g}, {optimum.evaluations} machines, {ended}{kept}")
        changed = "It begins with the numbers of the file: sizes were changed on the page." if setting.sizes else ""
        self._optimised.content += command_words(wish.command(twin, setting), changed, "found-by")
        self._optimise.disabled, self._stop_optimise.disabled, self._take.disabled = False, True, False
        self._beside = ComparedMachine(twin, "optimised", sizes)
        self._look()
        self._jobs.ask("answer", self._refreshing)

    def _take_numbers(self) -> None:
        """Let the sliders stand at the numbers that were found."""
        assert self._beside is not None
        for key, value in self._beside.sizes.items():
            self._sizes[key].set(value)
        self._jobs.ask("answer", self._refreshing)

    def _show_command(self) -> None:
        setting = self.setting()
        name = self._name.value.strip() if setting.sizes else ""
        remarks = ["Sizes are changed: save the model first."] if name else []
        if self.explorer.outdated():
            remarks.append("The model's file has changed since this page was opened.")
        self._command.content = command_words(self.explorer.command(setting, name), " ".join(remarks))

    def _save(self, posture: str | None) -> None:
        name = self._name.value.strip()
        if Path(name).name != name:
            raise ValueError(f"'{name}': write a name without a folder")
        written = self.explorer.save(self.setting(), self.folder / name, posture)
        what = f", posture {posture} in it" if posture else ""
        self._kept.content = remark(f"Saved {', '.join(path.name for path in written)}{what}.", "kept")

    # --- what it answers ----------------------------------------------------------------------------------

    def run(self) -> None:
        """Answer until it is stopped."""
        threading.Thread(target=self._searches.run, args=(RATE, lambda: None), daemon=True).start()
        self._jobs.run(RATE, self._next_frame)

    def _next_frame(self) -> Job | None:
        """A picture more of the mode, where it moves."""
        drawing, answer = self._drawing, self._answer
        if not self._animated.value or drawing is None or answer is None or answer.modes is None:
            return None
        return Job(lambda: self._draw(drawing, answer, time.monotonic()), self._say)

    def stop(self) -> None:
        """End `run` and close the page."""
        self._stopped.set()
        self._jobs.end()
        self._searches.end()
        with redirect_stdout(StringIO()):
            self.server.stop()

    def refresh(self) -> None:
        """Answer to what the sliders stand at.

        Raises:
            ValueError: there is no answer; the picture stays as it was.
            NoConvergenceError: there is no stable equilibrium.
        """
        setting, begun = self.setting(), time.perf_counter()
        answer = self.explorer.answer(setting)
        key = tuple(sorted(setting.sizes.items()))
        if self._sections[0] != key:
            self._sections = (key, self.explorer.files.with_numbers(setting.sizes).sections())
        drawing = MachineDrawing(answer.rest, answer.loaded, answer.modes, self._sections[1], self._drawing)
        self._draw(drawing, answer, None)
        self._answer, self._drawing = answer, drawing
        if self._searched is not None and self._searched != setting:
            self._critical.content = remark("Something has changed since: search again.", "critical")
            self._searched = None
        self._numbers.content = numbers(answer, 10.0 ** float(self._factor.value), time.perf_counter() - begun)
        if self._beside is not None:
            self._jobs.ask("compare", self._comparing)

    def compare(self) -> None:
        """Answer for the second machine to what the sliders stand at, and say both.

        Raises:
            ValueError: there is no answer.
            NoConvergenceError: there is no stable equilibrium.
        """
        beside, first, drawn = self._beside, self._answer, self._drawing
        if beside is None or first is None or drawn is None:
            return
        answer = beside.answer(self.explorer, self.setting())
        earlier = self._beside_drawing[1] if self._beside_drawing and self._beside_drawing[0] is beside else None
        drawing = MachineDrawing(answer.rest, answer.loaded, answer.modes, beside.shapes, earlier)
        self._beside_drawing = beside, drawing
        moved = drawing.points(10.0 ** float(self._factor.value), 0.0)
        for kind, surface in drawing.surfaces.items():
            self._put(f"/beside/{kind}", self._at(drawn, surface.at(moved)) + ASIDE, surface.faces, COLOURS[kind])
        names = str(self.explorer.files.document.content["name"]), beside.name
        above = np.array([0.0, 0.0, float(self._at(drawn, moved)[:, 2].max()) + 0.1])
        self.server.scene.add_label("/names/first", names[0], position=above)
        self.server.scene.add_label("/names/second", names[1], position=above + ASIDE)
        self._compared.content = compared(names, first, answer)

    def _at(self, drawing: MachineDrawing, point: Array) -> Array:
        """A point in mm in the scene, where the machine has the size one and its middle is the origin."""
        if self._middle is None:
            self._middle = 0.5 * (drawing.rest.min(axis=0) + drawing.rest.max(axis=0))
        return (point - self._middle) / self.explorer.extent

    def _tip(self, drawing: MachineDrawing) -> Array:
        return drawing.end + 10.0 ** float(self._factor.value) * drawing.end_moved

    def _draw(self, drawing: MachineDrawing, answer: ExplorerAnswer, when: float | None) -> None:
        oscillation = 0.0 if when is None else OSCILLATION * drawing.extent * np.sin(2.0 * np.pi * when / CYCLE)
        moved = drawing.points(10.0 ** float(self._factor.value), float(oscillation))
        for kind, surface in drawing.surfaces.items():
            self._put(f"/machine/{kind}", self._at(drawing, surface.at(moved)), surface.faces, COLOURS[kind])
            if when is None:
                self._put(
                    f"/rest/{kind}", self._at(drawing, surface.at(drawing.rest)), surface.faces, GREY, 0.25,
                    visible=bool(self._undeformed.value),
                )  # fmt: skip
        if when is not None:
            return
        tip = self._tip(drawing)
        whole = np.all(answer.principal > 0.0)
        if whole:
            mesh = ellipsoid(tip, answer.principal, answer.axes, ELLIPSOID * drawing.extent)
            self._put(
                "/ellipsoid", self._at(drawing, mesh.vertices), mesh.faces, GREEN, 0.35,
                visible=bool(self._ellipsoid.value),
            )  # fmt: skip
        elif "/ellipsoid" in self._meshes:
            # that of an earlier setting is not this one's
            self._meshes["/ellipsoid"].visible = False
        if not self.explorer.held:
            full = np.array([each.high for each in self.explorer.load[:3]])
            head = self._at(drawing, tip) + ARROW * np.array([each.value for each in self._load[:3]]) / full
            self.server.scene.add_arrows(
                "/force",
                np.array([[self._at(drawing, tip), head]]),
                RED,
                shaft_radius=0.006,
                head_radius=0.015,
                head_length=0.04,
            )
            self._arrow.position = head

    def _put(
        self,
        name: str,
        vertices: Array,
        faces: np.ndarray,
        colour: tuple[int, int, int],
        opacity: float | None = None,
        *,
        visible: bool = True,
    ) -> None:
        mesh = self._meshes.get(name)
        if mesh is None or len(mesh.vertices) != len(vertices):
            self._meshes[name] = self.server.scene.add_mesh_simple(
                name, vertices, faces, color=colour, opacity=opacity, side="double", visible=visible,
                flat_shading=opacity is None, cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            return
        mesh.vertices = vertices.astype(np.float32)
        mesh.visible = visible


def serve(
    explorer: Explorer,
    port: int | None,
    folder: Path,
    said: Callable[[str], None],
    beside: ComparedMachine | None = None,
) -> None:
    """Open the page and answer until the process is interrupted.

    Args:
        explorer: the machine.
        port: on this computer.
        folder: in which files are saved.
        said: takes the address.
        beside: a second machine.
    """
    page = Page(explorer, port, folder, beside)
    said(page.address)
    try:
        page.run()
    finally:
        page.stop()
