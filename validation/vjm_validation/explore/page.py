"""The page: sliders on the right, the machine on the left; everything that is computed is in `state`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import viser

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_validation.explore.drawing import BEAM, BODY, FREE, HELD, RIGID, MachineDrawing, ellipsoid
from vjm_validation.explore.sliders import Slider
from vjm_validation.explore.state import Explorer, ExplorerAnswer, Setting
from vjm_validation.explore.words import command_words, critical_words, numbers

HOST = "127.0.0.1"
"""Nobody outside this computer sees the page."""
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
RATE = 25.0
"""Pictures of a moving mode a second."""
CYCLE = 1.5
"""s that a cycle of a mode takes in the page, whatever its frequency."""


class Page:
    """A page that answers to its sliders until it is stopped.

    Attributes:
        server: viser's.
        port: on which it is.
    """

    def __init__(self, explorer: Explorer, port: int | None, folder: Path) -> None:
        """Open the page.

        Args:
            explorer: the machine.
            port: on this computer; the first free one from 8080 on if left out.
            folder: in which files are saved.
        """
        self.explorer, self.folder = explorer, folder
        # what viser prints of itself is said once, by the command
        with redirect_stdout(StringIO()):
            title = str(explorer.files.document.content["title"])
            self.server = viser.ViserServer(HOST, port or FIRST_PORT, label=title, verbose=False)
        self.server.request_share_url = _nothing_leaves  # type: ignore[method-assign]
        self.port = self.server.get_port()
        self._changed, self._stopped = threading.Event(), threading.Event()
        self._quiet = False
        self._saved: set[Path] = set()
        self._answer: ExplorerAnswer | None = None
        self._drawing: MachineDrawing | None = None
        self._sections: tuple[object, Any] = (None, {})
        self._meshes: dict[str, Any] = {}
        self._searched: Setting | None = None
        self._build()
        self._changed.set()

    # --- what is on it ------------------------------------------------------------------------------------

    def _build(self) -> None:
        gui, explorer = self.server.gui, self.explorer
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        # light from everywhere, no pictures of surroundings, no shadows: slow computers draw it too
        self.server.scene.configure_environment_map(None)
        self.server.scene.configure_default_lights(cast_shadow=False)
        self.server.scene.add_light_ambient("/light", intensity=1.2)
        self.server.initial_camera.position = (1.1, -1.3, 0.9)
        self.server.initial_camera.look_at = (0.0, 0.0, 0.0)
        self._numbers = gui.add_html("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Move"):
            if explorer.coordinates:
                gui.add_markdown("**Pose from home**" if explorer.posed else "**Joints**")
            self._coordinates = [self._slider(each) for each in explorer.coordinates]
            gui.add_markdown(
                "**Displacement of the end, which is held**" if explorer.held else "**Force on the end**"
            )
            self._load = [self._slider(each) for each in explorer.load]
            self._weighed = gui.add_checkbox(
                "weight of the parts", explorer.start.weighed, visible=not explorer.held
            )
            self._weighed.on_update(self._touched)
            gui.add_button("no load").on_click(self._unload)
        with tabs.add_tab("Sizes"):
            self._sizes = self._size_sliders()
        with tabs.add_tab("Show"):
            self._factor = gui.add_slider("deflection drawn times 10 to the", 0.0, LARGEST_POWER, 0.05, FIRST_POWER)
            self._factor.on_update(self._touched)
            self._ellipsoid = gui.add_checkbox("stiffness ellipsoid", True)
            self._animated = gui.add_checkbox("first mode moves", False)
            self._undeformed = gui.add_checkbox("without load, grey", True)
            for box in (self._ellipsoid, self._animated, self._undeformed):
                box.on_update(self._touched)
        with tabs.add_tab("Critical"):
            self._search = gui.add_button("smallest critical force", disabled=explorer.held)
            self._search.on_click(self._begin_search)
            first = "The end is held: `validate buckling` follows a path." if explorer.held else "Not searched yet."
            self._critical = gui.add_markdown(first)
        with tabs.add_tab("Keep"):
            gui.add_button("copy as command").on_click(self._show_command)
            self._command = gui.add_html("")
            self._name = gui.add_text("file", f"{explorer.files.document.content['name']}-explored.toml")
            gui.add_button("save as model").on_click(lambda _: self._save(""))
            self._label = gui.add_text("posture's label", "explored")
            gui.add_button("save posture").on_click(lambda _: self._save(self._label.value))
            self._kept = gui.add_markdown("")
        if not explorer.held:
            self._arrow = self.server.scene.add_transform_controls(
                "/pull", scale=0.15, disable_rotations=True, disable_sliders=True
            )
            self._arrow.on_update(self._pulled)

    def _slider(self, each: Slider) -> Any:  # noqa: ANN401  (viser's handles are generic)
        low, high = each.ends
        made = self.server.gui.add_slider(
            f"{each.name}, {each.unit}" if each.unit else each.name, low, high, each.step, each.value
        )
        made.on_update(self._touched)
        return made

    def _size_sliders(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        folders: dict[str, Any] = {}
        for each in self.explorer.sizes:
            part = each.name.rsplit(".section", 1)[0] if ".section" in each.name else each.name.rsplit(".", 1)[0]
            if part not in folders:
                folders[part] = self.server.gui.add_folder(part, expand_by_default=False)
            with folders[part]:
                own = Slider(each.name.removeprefix(f"{part}."), each.unit, each.low, each.high, each.value)
                found[each.name] = self._slider(own)
        return found

    def setting(self) -> Setting:
        """What the sliders stand at."""
        sizes = {each.name: float(self._sizes[each.name].value) for each in self.explorer.sizes}
        return Setting(
            tuple(float(each.value) for each in self._coordinates),
            tuple(float(each.value) for each in self._load),
            bool(self._weighed.value),
            {each.name: sizes[each.name] for each in self.explorer.sizes if sizes[each.name] != each.value},
        )

    # --- what is done to it -------------------------------------------------------------------------------

    def _touched(self, _: object) -> None:
        if not self._quiet:
            self._changed.set()

    def _unload(self, _: object) -> None:
        for each in self._load:
            each.value = 0.0
        self._changed.set()

    def _pulled(self, event: Any) -> None:  # noqa: ANN401
        """The arrow's head was drawn: the force is where it went from the end."""
        if self._drawing is None:
            return
        pulled = np.array(event.target.position) - self._at(self._tip())
        self._quiet = True
        for k, each in enumerate(self.explorer.load[:3]):
            low, high = each.ends
            force = round(pulled[k] / ARROW * each.high / each.step) * each.step
            self._load[k].value = float(np.clip(force, low, high))
        self._quiet = False
        self._changed.set()

    def _begin_search(self, _: object) -> None:
        self._search.disabled = True
        self._critical.content = "Searching over all directions …"
        threading.Thread(target=self._find, args=(self.setting(),), daemon=True).start()

    def _find(self, setting: Setting) -> None:
        try:
            self._critical.content = critical_words(self.explorer.critical(setting))
            self._searched = setting
        except (ValueError, NoConvergenceError) as error:
            self._critical.content = escape(str(error))
        finally:
            self._search.disabled = False

    def _show_command(self, _: object) -> None:
        setting = self.setting()
        name = self._name.value.strip() if setting.sizes else ""
        self._command.content = command_words(
            self.explorer.command(setting, name), "Sizes are changed: save the model first." if name else ""
        )

    def _save(self, posture: str) -> None:
        name = self._name.value.strip()
        try:
            file = self.folder / name
            if not name or Path(name).name != name:
                raise ValueError(f"'{name}': write a name without a folder")
            if file.exists() and file not in self._saved:
                raise ValueError(f"{name} exists already: write another name")
            written = self.explorer.save(self.setting(), file, posture)
        except (ValueError, OSError) as error:
            self._kept.content = escape(str(error))
            return
        self._saved.update(written)
        what = f", posture {posture} in it" if posture else ""
        self._kept.content = escape(f"Saved {', '.join(path.name for path in written)}{what}.")

    # --- what it answers ----------------------------------------------------------------------------------

    def run(self) -> None:
        """Answer until it is stopped."""
        while not self._stopped.is_set():
            moving = bool(self._animated.value) and self._answer is not None and self._answer.modes is not None
            if self._changed.wait(1.0 / RATE if moving else None) and not self._stopped.is_set():
                self._changed.clear()
                self.refresh()
            if moving:
                self._draw(time.monotonic())

    def stop(self) -> None:
        """End `run` and close the page."""
        self._stopped.set()
        self._changed.set()
        with redirect_stdout(StringIO()):
            self.server.stop()

    def refresh(self) -> None:
        """Answer to what the sliders stand at."""
        setting, begun = self.setting(), time.perf_counter()
        try:
            answer = self.explorer.answer(setting)
        except (ValueError, NoConvergenceError) as error:
            self._numbers.content = f'<div id="said" style="color:#b00">{escape(str(error))}</div>'
            return
        self._answer = answer
        key = tuple(sorted(setting.sizes.items()))
        if self._sections[0] != key:
            self._sections = (key, self.explorer.files.with_numbers(setting.sizes).sections())
        self._drawing = MachineDrawing(answer.rest, answer.loaded, answer.modes, self._sections[1], self._drawing)
        self._draw(None)
        if self._searched is not None and self._searched != setting:
            self._critical.content = "Something has changed since: search again."
            self._searched = None
        self._numbers.content = numbers(answer, 10.0 ** float(self._factor.value), time.perf_counter() - begun)

    def _at(self, point: Array) -> Array:
        """A point in mm in the scene, where the machine has the size one and its middle is the origin."""
        assert self._drawing is not None
        result: Array = (point - self._middle) / self.explorer.extent
        return result

    def _tip(self) -> Array:
        assert self._drawing is not None
        result: Array = self._drawing.end + 10.0 ** float(self._factor.value) * self._drawing.end_moved
        return result

    def _draw(self, when: float | None) -> None:
        drawing, answer = self._drawing, self._answer
        assert drawing is not None
        assert answer is not None
        if not hasattr(self, "_middle"):
            self._middle = 0.5 * (drawing.rest.min(axis=0) + drawing.rest.max(axis=0))
        oscillation = 0.0 if when is None else OSCILLATION * drawing.extent * np.sin(2.0 * np.pi * when / CYCLE)
        moved = drawing.points(10.0 ** float(self._factor.value), float(oscillation))
        for kind, surface in drawing.surfaces.items():
            self._put(f"/machine/{kind}", self._at(surface.at(moved)), surface.faces, COLOURS[kind])
            if when is None:
                self._put(
                    f"/rest/{kind}", self._at(surface.at(drawing.rest)), surface.faces, GREY, 0.25,
                    visible=bool(self._undeformed.value),
                )  # fmt: skip
        if when is not None:
            return
        tip = self._tip()
        whole = np.all(answer.principal > 0.0)
        if whole:
            mesh = ellipsoid(tip, answer.principal, answer.axes, ELLIPSOID * drawing.extent)
            self._put(
                "/ellipsoid", self._at(mesh.vertices), mesh.faces, GREEN, 0.35, visible=bool(self._ellipsoid.value)
            )
        if not self.explorer.held:
            full = np.array([each.high for each in self.explorer.load[:3]])
            head = self._at(tip) + ARROW * np.array([each.value for each in self._load[:3]]) / full
            self.server.scene.add_arrows(
                "/force",
                np.array([[self._at(tip), head]]),
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


def _nothing_leaves(*_: object, **__: object) -> None:
    """The page is for this computer: no tunnel is opened."""


def serve(explorer: Explorer, port: int | None, folder: Path, said: Callable[[str], None]) -> None:
    """Open the page and answer until the process is interrupted.

    Args:
        explorer: the machine.
        port: on this computer.
        folder: in which files are saved.
        said: takes the address.
    """
    page = Page(explorer, port, folder)
    said(f"http://{HOST}:{page.port}")
    try:
        page.run()
    finally:
        page.stop()
