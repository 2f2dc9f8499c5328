"""What a page may say: its messages, each of its inputs with the values that it takes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec

from vjm_validation.explore.sliders import Slider

LONGEST_TEXT = 100
"""Letters of a text input."""

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

    def text(self, handle: Any, name: str) -> None:  # noqa: ANN401
        """Take short texts of one line."""

        def taken(value: object) -> tuple[Any, str]:
            if not isinstance(value, str) or len(value) > LONGEST_TEXT or not value.isprintable():
                raise ValueError(f"'{name}' takes one line of at most {LONGEST_TEXT} letters, and stays as it is")
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
