"""The files of a machine as numbers that sliders change, and as files that are saved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vjm.io.file_parameters import file_number, parameter_keys, with_numbers
from vjm.io.files import check_writable, write_together
from vjm.io.machine_file import load_machine, load_model
from vjm.io.manipulator_file import KIND, leg_documents
from vjm.io.model_file import ModelDocument, build_chain, read_document
from vjm.io.shapes import SHAPES, Shape
from vjm.io.toml_text import toml_text
from vjm.model.chain import Chain


@dataclass(frozen=True)
class MachineFiles:
    """A machine's own file and, of legs on bodies, those of its legs' chains.

    Attributes:
        name: as the command was given it.
        document: the machine's own.
        legs: the chains' by the name that the legs have for them; none for a single chain.
    """

    name: str
    document: ModelDocument
    legs: Mapping[str, ModelDocument] = field(default_factory=dict)

    @classmethod
    def read(cls, name_or_path: str) -> MachineFiles:
        """Read them.

        Raises:
            ModelFileError: one is not there, or is no machine's.
        """
        load_model(name_or_path)  # says best what is wrong
        document = read_document(name_or_path)
        legs = leg_documents(name_or_path) if document.content.get("kind") == KIND else {}
        return cls(name_or_path, document, legs)

    def keys(self) -> list[str]:
        """Keys of the numbers: ``part.key``; of legs on bodies ``chain.part.key``, shared by the chain's legs."""
        if not self.legs:
            return parameter_keys(self.document.content)
        return [f"{leg}.{key}" for leg, own in self.legs.items() for key in parameter_keys(own.content)]

    def number(self, key: str) -> float:
        """The number of a key in the files.

        Raises:
            ModelFileError: there is none.
        """
        document, own = self._at(key)
        return file_number(document, own)

    def _at(self, key: str) -> tuple[ModelDocument, str]:
        leg = next((leg for leg in self.legs if key.startswith(f"{leg}.")), None)
        return (self.document, key) if leg is None else (self.legs[leg], key.removeprefix(f"{leg}."))

    def machine(self, changes: Mapping[str, float]) -> Chain:
        """The machine with other numbers, as its saved files have it; its loops are closed.

        Raises:
            ModelFileError: the numbers make no machine, or its loops do not close.
        """
        if not changes:
            return load_machine(self.name)
        if not self.legs:
            changed = with_numbers(self.document, changes)
            return build_chain(changed.content, changed.file, changed.sha256)
        with TemporaryDirectory() as folder:
            return load_machine(self.write(changes, Path(folder) / "changed.toml", {})[0])

    def sections(self, changes: Mapping[str, float]) -> dict[str, Shape]:
        """The cross-sections that are given as shapes, by the name of the beam in the machine."""
        found = {}
        for name, table in self._tables(changes):
            section = table.get("section", {})
            if section.get("shape") in SHAPES:
                found[name] = SHAPES[section["shape"]].model_validate(section)
        return found

    def _tables(self, changes: Mapping[str, float]) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Name in the machine and table of each part."""
        if not self.legs:
            for table in with_numbers(self.document, changes).content.get("parts", []):
                yield table["name"], table
            return
        changed = {leg: self._leg(leg, changes).content["parts"] for leg in self.legs}
        for leg in self.document.content["legs"]:
            for table in changed[leg["chain"]]:
                yield f"{leg['name']}/{table['name']}", table

    def _leg(self, leg: str, changes: Mapping[str, float]) -> ModelDocument:
        own = {key.removeprefix(f"{leg}."): value for key, value in changes.items() if key.startswith(f"{leg}.")}
        return with_numbers(self.legs[leg], own)

    def write(
        self, changes: Mapping[str, float], file: Path, postures: Mapping[str, Mapping[str, float] | list[float]]
    ) -> list[Path]:
        """Save the machine with other numbers: its file and, beside it, those of its legs' chains.

        Args:
            changes: numbers by key.
            file: of the machine, ``.toml``.
            postures: further ones by label: coordinates by the joints' names; of legs on bodies the platform's
                displacement from home, mm and rad.

        Returns:
            The files that were written, the machine's first.

        Raises:
            OSError: they cannot be written.
            ValueError: the name does not end in ``.toml``.
        """
        if file.suffix != ".toml":
            raise ValueError(f"{file}: write a name that ends in .toml")
        check_writable(file.parent)
        head = f"# {self.document.file} with other numbers, saved by `validate explore`.\n"
        texts: dict[Path, str] = {}
        if not self.legs:
            content = with_numbers(self.document, changes).content
            texts[file] = toml_text({**content, "postures": {**content.get("postures", {}), **postures}})
        else:
            content = self.document.content
            names = {leg: f"{file.stem}-{Path(leg).stem}" for leg in self.legs}
            legs = [leg | {"chain": names[leg["chain"]]} for leg in content["legs"]]
            texts[file] = toml_text({**content, "legs": legs, "poses": {**content["poses"], **postures}})
            for leg, name in names.items():
                texts[file.parent / f"{name}.toml"] = toml_text(self._leg(leg, changes).content)
        write_together({path: head + text for path, text in texts.items()})
        return list(texts)
