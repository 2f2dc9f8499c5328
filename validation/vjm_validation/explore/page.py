"""The page: sliders on the right, the machine on the left; everything that is computed is in `state`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Coroutine
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import viser

from vjm.rotations import Array
from vjm_validation.explore.access import HOST, Access
from vjm_validation.explore.drawing import BEAM, BODY, FREE, HELD, RIGID, MachineDrawing, ellipsoid
from vjm_validation.explore.jobs import Job, Jobs
from vjm_validation.explore.messages import Inputs, NumberInput
from vjm_validation.explore.sliders import Slider
from vjm_validation.explore.state import Explorer, ExplorerAnswer, Setting
from vjm_validation.explore.words import command_words, critical_words, numbers, remark

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

    def __init__(self, explorer: Explorer, port: int | None, folder: Path) -> None:
        """Open the page.

        Args:
            explorer: the machine.
            port: on this computer; the first free one from 8080 on if left out.
            folder: in which files are saved.
        """
        self.explorer, self.folder = explorer, folder
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
        self._build()
        self._jobs.ask("answer", self._refreshing)

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
        self._said = gui.add_html("")
        self._numbers = gui.add_html("")
        self._refreshing = Job(self.refresh, self._not_answered)
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

    def _say(self, line: str) -> None:
        self._said.content = remark(line, "notice", wrong=True)

    def _not_answered(self, line: str) -> None:
        self._numbers.content = remark(line, "said", wrong=True)

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

    def _text(self, name: str, value: str) -> Any:  # noqa: ANN401
        made = self.server.gui.add_text(name, value)
        self._inputs.text(made, name)
        return made

    def _button(self, name: str, work: Callable[[], None], said: Callable[[str], None]) -> Any:  # noqa: ANN401
        made = self.server.gui.add_button(name)
        self._inputs.switch(made, name)
        made.on_click(self._asks(name, Job(work, said)))
        return made

    def _size_sliders(self) -> dict[str, NumberInput]:
        found: dict[str, NumberInput] = {}
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

    def _at(self, drawing: MachineDrawing, point: Array) -> Array:
        """A point in mm in the scene, where the machine has the size one and its middle is the origin."""
        if self._middle is None:
            self._middle = 0.5 * (drawing.rest.min(axis=0) + drawing.rest.max(axis=0))
        result: Array = (point - self._middle) / self.explorer.extent
        return result

    def _tip(self, drawing: MachineDrawing) -> Array:
        result: Array = drawing.end + 10.0 ** float(self._factor.value) * drawing.end_moved
        return result

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


def serve(explorer: Explorer, port: int | None, folder: Path, said: Callable[[str], None]) -> None:
    """Open the page and answer until the process is interrupted.

    Args:
        explorer: the machine.
        port: on this computer.
        folder: in which files are saved.
        said: takes the address.
    """
    page = Page(explorer, port, folder)
    said(page.address)
    try:
        page.run()
    finally:
        page.stop()
