"""The numbers of a machine's files as parameters: what its behaviour is differentiated by, and what is varied."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from vjm.io.body_file import KIND as BODIES
from vjm.io.catalogues import Row
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.files import toml_text, write_together
from vjm.io.machine_file import build_machine
from vjm.io.manipulator_file import KIND as MANIPULATOR
from vjm.io.manipulator_file import leg_documents
from vjm.io.model_file import Model, ModelDocument, as_parts, build_chain, checked, written_document
from vjm.io.shapes import SHAPES, Material, Shape
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.postures import in_posture

UNITS = {
    "1e4Nm_per_rad": "1e4 N m/rad", "Nmm_per_rad2": "N mm/rad²", "Nmm_per_rad3": "N mm/rad³",
    "N_per_mm2": "N/mm²", "N_per_mm3": "N/mm³", "Nm": "N m", "rad_per_Nmm": "rad/(N mm)",
    "Nmm_per_rad": "N mm/rad", "mm_per_N": "mm/N", "N_per_mm": "N/mm",
    "kg_per_m3": "kg/m³", "kg_mm2": "kg mm²", "kg_m2": "kg m²", "Nmm2": "N mm²", "Nmm": "N mm", "MPa": "MPa",
    "rad": "rad", "deg": "deg", "mm": "mm", "kg": "kg", "N": "N",
}  # fmt: skip
"""By the end of a key; the longer ones first."""
LISTS = ("parts", "bodies", "joints", "beams", "point_springs", "legs")
"""Lists of named tables in which numbers stand."""
TABLES = ("platform", "end")
"""Tables of which there is one."""
COUNTS = ("count", "segments")
"""Keys of whole numbers, by which nothing is differentiated."""
NO_PROPERTY = (
    "limits_rad", "limits_mm", "range_rad", "range_mm", "transition_rad", "transition_mm", "drive_limits",
    "drive_home", "drawn", "posture", "axis", "axes", "y_axis",
    "drive_turns_about", "turns", "own_axes", "section_axes", "base", "attachment", "position_mm",
    "outline_mm", "holes_mm",
)  # fmt: skip
"""Keys of what does not make a machine softer or heavier, or of where a loop closes: asked for by name only."""

MATERIAL = tuple(Material.model_fields)
"""Keys of a section that a standard part of another shape leaves as they are."""
MATRIX = ("compliance",)
"""Key of a symmetric matrix, of which an entry below the diagonal is that above it."""


class Numbered(Protocol):
    """A machine with numbers by key: of files, see `MachineFiles`, or made in Python, see `vjm.design.space`."""

    @property
    def name(self) -> str:
        """Of the machine."""

    def keys(self) -> list[str]:
        """Of the numbers that make a machine softer or heavier."""

    def unit(self, key: str) -> str:
        """Of a number; empty for none."""

    def number(self, key: str) -> float:
        """A number."""

    def with_numbers(self, values: Mapping[str, float]) -> Numbered:
        """The same with other numbers."""

    def with_rows(self, rows: Mapping[str, Row]) -> Numbered:
        """The same with other parts of a catalogue."""

    def machine(self, posture: str = "") -> Machine:
        """The machine with its loops closed, in a posture."""

    def parameter(self, key: str, posture: str = "") -> Parameter:
        """A number as what is differentiated by."""


def parameter_of(numbers: Numbered, key: str, posture: str, where: str) -> Parameter:
    """A number of a machine as what its behaviour is differentiated by.

    Raises:
        ModelFileError: there is no such number, or it is zero, which has no size.
    """
    value = numbers.number(key)
    if not value:
        raise ModelFileError(f"{where}: '{key}' is zero, which has no size: give it a value first")

    def apply(_: Machine, now: float) -> Machine:
        return numbers.with_numbers({key: now}).machine(posture)

    return Parameter(key, numbers.unit(key), value, abs(value), apply)


class _Place(NamedTuple):
    """Where a number stands: in the file of a leg's chain or, for an empty name, the machine's own."""

    leg: str
    path: tuple[str | int, ...]


@dataclass(frozen=True)
class MachineFiles:
    """The files of a machine, with numbers that can be changed.

    A number has the key ``part.key``, ``part.section.key`` or ``part.key.1`` for the first entry of a list. A file
    of bodies and joints has those of its bodies, joints and beams, and ``end.at_mm.1``. The file of a machine with
    legs has ``leg.key``, ``platform.mass_kg``, and for a part of a chain file that legs share ``chain.part.key``:
    it changes in all these legs.

    Attributes:
        document: as it is written.
        legs: documents of the legs' chains by the name that legs have for them; none for a single chain.
        sheared: whether the shear that the files state counts.

    Example:
        >>> files = MachineFiles.read("delta")
        >>> files.number("delta-rod.rod.length_mm")
        1244.0
        >>> longer = files.with_numbers({"delta-rod.rod.length_mm": 1250.0}).machine("home")
        >>> [round(beam.length) for beam in longer.beams][:3]
        [524, 1250, 1250]
    """

    document: ModelDocument
    legs: Mapping[str, ModelDocument] = field(default_factory=dict)
    sheared: bool = True

    @classmethod
    def read(cls, name_or_path: Model, *, sheared: bool = True) -> MachineFiles:
        """The files of a machine.

        Raises:
            ModelFileError: one of them is not there, or has a key that is missing, unknown or of another type.
        """
        document = written_document(name_or_path)
        if document.content.get("kind") == MANIPULATOR:
            return cls(document, leg_documents(name_or_path), sheared)
        checked(as_parts(document).content, document.file)
        return cls(document, {}, sheared)

    @property
    def name(self) -> str:
        """Of the machine."""
        return str(self.document.content["name"])

    def keys(self) -> list[str]:
        """Keys of the numbers that make a machine softer or heavier, but zeros.

        Example:
            >>> MachineFiles(ModelDocument("a.toml", {"parts": [
            ...     {"name": "a", "length_mm": 5.0, "section": {"EA_N": 2.0}, "count": 2}]}, {})).keys()
            ['a.length_mm', 'a.section.EA_N']
        """
        return [
            key
            for key, place in self._places().items()
            if not any(word in NO_PROPERTY for word in place.path)
            and not _below_diagonal(place.path)
            and self._at(place)
        ]

    def number(self, key: str) -> float:
        """A number.

        Raises:
            ModelFileError: there is none of the key.
        """
        return self._at(self._place(key))

    def with_numbers(self, values: Mapping[str, float]) -> MachineFiles:
        """The same files with other numbers, by key.

        Raises:
            ModelFileError: there is no number of a key.
        """
        contents = self._contents()
        for key, value in values.items():
            leg, path = self._place(key)
            table, (inner, last) = _inside(contents[leg], path[:-2]), path[-2:]
            table[inner][last] = value
            if path[-3:-2] == MATRIX:
                table[last][inner] = value
        return self._with(contents)

    def _contents(self) -> dict[str, dict[str, Any]]:
        """Copies of what the files say, by the names of the legs' chains; empty for the machine's own."""
        return {name: deepcopy(document.content) for name, document in {**self.legs, "": self.document}.items()}

    def _with(self, contents: Mapping[str, dict[str, Any]]) -> MachineFiles:
        legs = {name: document._replace(content=contents[name]) for name, document in self.legs.items()}
        return replace(self, document=self.document._replace(content=contents[""]), legs=legs)

    def unit(self, key: str) -> str:
        """Of a number; empty for none."""
        return unit_of_key(key)

    def with_rows(self, rows: Mapping[str, Row]) -> MachineFiles:
        """The same files with other standard parts: what a row of a catalogue says stands in the table of its key.

        Args:
            rows: by the key of a table, such as ``upper.section``. Of a shape only the material is kept.

        Raises:
            ModelFileError: there is no such table.
        """
        contents = self._contents()
        tables: dict[str, dict[str, Any]] = {}
        for leg, content in contents.items():
            before = f"{leg.removesuffix('.toml')}." if leg else ""
            for name, path in _named_tables(content):
                table = tables[f"{before}{name}"] = _inside(content, path)
                tables |= {f"{before}{name}.{key}": each for key, each in table.items() if isinstance(each, dict)}
        for key, row in rows.items():
            if key not in tables:
                known = ", ".join(name for name in tables if name.endswith(".section")) or "none"
                raise ModelFileError(
                    f"{self.document.file}: '{key}' is no table of a part{did_you_mean(key, tables)}; sections are "
                    f"{known}"
                )
            if "shape" in row:
                kept = {k: v for k, v in tables[key].items() if k in MATERIAL or k == "shear_factor"}
                tables[key].clear()
                tables[key].update(kept)
            tables[key].update(row)
        return self._with(contents)

    def with_posture(self, label: str, coordinates: Mapping[str, float] | Sequence[float]) -> MachineFiles:
        """The same files with a posture more.

        Args:
            label: of the posture.
            coordinates: by the joints' names, mm and rad; of a machine with legs the platform's displacement
                ``(6,)`` from home.
        """
        key = "poses" if self.legs else "postures"
        given: Any = dict(coordinates) if isinstance(coordinates, Mapping) else list(coordinates)
        content = {**self.document.content, key: {**self.document.content.get(key, {}), label: given}}
        return replace(self, document=self.document._replace(content=content))

    def sections(self) -> dict[str, Shape]:
        """The cross-sections that the files give as shapes, by the name of the beam in the machine.

        Example:
            >>> MachineFiles.read("planar-2r").sections()["upper"].shape
            'square_tube'
        """
        return {
            name: SHAPES[section["shape"]].model_validate(section)
            for name, table in self._parts()
            if (section := table.get("section", {})).get("shape") in SHAPES
        }

    def _parts(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Name in the machine and table of each part."""
        if not self.legs:
            yield from ((table["name"], table) for table in as_parts(self.document).content["parts"])
        for leg in self.document.content.get("legs", []):
            for table in self.legs[leg["chain"]].content["parts"]:
                yield f"{leg['name']}/{table['name']}", table

    def machine(self, posture: str = "") -> Machine:
        """The machine of the files, with its loops closed.

        Args:
            posture: label or coordinates, see `vjm.in_posture`; all that the files name if left out.

        Raises:
            ModelFileError: the numbers make no machine, or its loops do not close.
            ValueError: there is no such posture.
        """
        content = self.document.content
        if content.get("kind") == MANIPULATOR:
            poses = content["poses"]
            # loops take time to close: in the pose that is wanted, and at home, from which poses count
            kept = {label: pose for label, pose in poses.items() if posture in ("", label) or not any(pose)}
            document = self.document._replace(content={**content, "poses": kept or poses})
            chain = build_machine(document, self.legs)
        else:
            document = as_parts(self.document)
            chain = build_chain(document.content, document.file, document.files)
        if not self.sheared:
            chain = chain.rigid_in_shear()
        return in_posture(chain, posture or next(iter(chain.postures)))[0]

    def parameter(self, key: str, posture: str = "") -> Parameter:
        """A number as what a machine's behaviour is differentiated by.

        Raises:
            ModelFileError: there is no such number, or it is zero, which has no size.
        """
        return parameter_of(self, key, posture, self.document.file)

    def write(self, file: Path, head: str, title: str) -> list[Path]:
        """Write the machine as a file, with those of its legs' chains beside it, all of them or none.

        Args:
            file: to write; the chains' have its name before their own.
            head: a comment.
            title: of the machine.

        Returns:
            What was written, the machine's file last.

        Raises:
            OSError: it cannot be written.
        """
        texts = self.texts(file, head, title)
        write_together(texts)
        return list(texts)

    def texts(self, file: Path, head: str, title: str) -> dict[Path, str]:
        """What `write` writes, by the files."""
        content = {**self.document.content, "title": title}
        texts = {}
        if self.legs:
            names = {
                name: f"{file.stem}-{Path(name).stem if name.endswith('.toml') else name}" for name in self.legs
            }
            for name, document in self.legs.items():
                texts[file.with_name(f"{names[name]}.toml")] = head + toml_text(document.content)
            content["legs"] = [leg | {"chain": names[leg["chain"]]} for leg in content["legs"]]
        return {**texts, file: head + toml_text(content)}

    def _at(self, place: _Place) -> float:
        return float(_inside((self.legs[place.leg] if place.leg else self.document).content, place.path))

    def _place(self, key: str) -> _Place:
        places = self._places()
        if key not in places:
            start = key.split(".")[0]
            known = [name for name in places if name.split(".")[0] == start] or self.keys() or list(places)
            form = "chain.part.key" if self.legs else "name.key" if self.of_bodies else "part.key"
            raise ModelFileError(
                f"{self.document.file}: '{key}' is no number of a part{did_you_mean(key, known)}; write {form}, "
                f"such as {known[0] if known else 'link.length_mm'}"
            )
        return places[key]

    @property
    def of_bodies(self) -> bool:
        """Whether it is a file of bodies and joints."""
        return self.document.content.get("kind") == BODIES

    def _places(self) -> dict[str, _Place]:
        """Where each number stands, by its key."""
        places: dict[str, _Place] = {}
        for leg, document in {**self.legs, "": self.document}.items():
            before = (leg.removesuffix(".toml"),) if leg else ()
            for name, path in _named_tables(document.content):
                for words in _numbers(_inside(document.content, path), ()):
                    text = [str(word + 1) if isinstance(word, int) else word for word in words]
                    places.setdefault(".".join((*before, name, *text)), _Place(leg, (*path, *words)))
        return places


def _inside(content: Any, path: Sequence[str | int]) -> Any:  # noqa: ANN401
    """What stands at a place in a document."""
    return reduce(getitem, path, content)


def _below_diagonal(path: tuple[str | int, ...]) -> bool:
    """Whether a place is an entry of a symmetric matrix that another place is, too."""
    if path[-3:-2] != MATRIX:
        return False
    row, column = path[-2:]
    return isinstance(row, int) and isinstance(column, int) and row > column


def _named_tables(content: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str | int, ...]]]:
    for kind in LISTS:
        for i, one in enumerate(content.get(kind, [])):
            if isinstance(one, Mapping) and "name" in one:
                yield str(one["name"]), (kind, i)
    for kind in TABLES:
        if isinstance(content.get(kind), Mapping):
            yield kind, (kind,)


def _numbers(
    table: Mapping[str, Any] | Sequence[Any], before: tuple[str | int, ...]
) -> Iterator[tuple[str | int, ...]]:
    for key, value in table.items() if isinstance(table, Mapping) else enumerate(table):
        if isinstance(value, Mapping | list):
            yield from _numbers(value, (*before, key))
        elif isinstance(value, int | float) and not isinstance(value, bool) and key not in COUNTS:
            yield (*before, key)


def unit_of_key(key: str) -> str:
    """Unit that the end of a key names; empty for none."""
    words = key.split(".")
    name = next((word for word in reversed(words) if not word.isdigit()), "")
    return next((text for end, text in UNITS.items() if name.endswith(f"_{end}")), "")
