"""Tables of springs' laws: ``law = { kind = "strain_wave", K1_Nmm_per_rad = 5e7, … }``, see `vjm.model.laws`.

There is a table for each law, made of the numbers that its class says. A number's key ends in its unit; that of a
joint that turns, or of one that slides and of a spring between points.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union, get_type_hints

import pydantic
from pydantic import Discriminator, Field, Tag, create_model

from vjm.io.catalogues import COLUMN_OF_NAME, catalogue
from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.sections import Table
from vjm.model.laws import LAWS, Law, StrainWave

CATALOGUE_UNITS = {
    **{f"{name}_1e4Nm_per_rad": (name, 1e7) for name in ("K1", "K2", "K3")},
    **{f"{name}_Nm": (name, 1e3) for name in ("T1", "T2")},
}
"""Keys of strain wave gears in the units of their catalogues: which number, and the factor to N mm and rad."""


class LawTable(Table):
    """A law by its numbers, those of what turns or of what slides."""

    law_class: ClassVar[type[Law]]
    source: str = ""

    def law(self, *, slides: bool) -> Law:
        """The law of a joint that turns, or of what slides or stretches.

        Raises:
            ValueError: a number is missing, stands twice or has another unit, or the numbers make no law.
        """
        made, keys, others = (
            self.law_class,
            self.law_class.keys(slides=slides),
            self.law_class.keys(slides=not slides),
        )
        given: dict[str, Any] = {}
        for key, value in self.model_dump(exclude_none=True, exclude={"kind", "source"}).items():
            name, factor = CATALOGUE_UNITS.get(key, ("", 1.0))
            if key in made.words():
                name = key
            elif not name:
                name = next(name for name in keys if key in (keys[name], others[name]))
            if key not in (keys.get(name), name) and (slides or key not in CATALOGUE_UNITS):
                raise ValueError(f"law.{key} has the unit of what {_other(slides)}: give {keys[name]}")
            if name in given:
                raise ValueError(f"law.{key}: {name} stands twice: give it once")
            given[name] = tuple(value) if isinstance(value, list) else value * factor if factor != 1.0 else value
        missing = next((key for name, key in keys.items() if name not in given and _required(made, name)), None)
        if missing is not None:
            raise ValueError(f"law.{missing} is missing: a law of kind '{made.kind}' needs it")
        try:
            return made(**given)
        except ValueError as error:
            raise ValueError(f"law: {error}") from None


def _other(slides: bool) -> str:
    return "turns" if slides else "slides or stretches"


def _required(law: type[Law], name: str) -> bool:
    return not hasattr(law, name)


def _table_of(law: type[Law]) -> type[LawTable]:
    """The table of a law: each number in the units of what turns and of what slides."""
    fields: dict[str, Any] = {"kind": (Literal[law.kind], ...)}
    hints = get_type_hints(law)
    numbers = [law.keys(slides=False), law.keys(slides=True)]
    for name in numbers[0]:
        many = "tuple" in str(hints[name])
        for keys in numbers:
            fields[keys[name]] = (list[float] | None if many else float | None, None)
    if law is StrainWave:
        fields |= {
            key: (float | None, Field(None, description="as catalogues write it")) for key in CATALOGUE_UNITS
        }
    fields |= dict.fromkeys(law.words(), (str | None, None))
    made: type[LawTable] = create_model(f"{law.__name__}Table", __base__=LawTable, __doc__=law.__doc__, **fields)
    made.law_class = law
    return made


LAW_TABLES: Mapping[str, type[LawTable]] = {kind: _table_of(law) for kind, law in LAWS.items()}
"""By the laws' kinds."""


class CatalogueLaw(Table):
    """A law that is a row of a catalogue."""

    catalogue: str = Field(description="a catalogue of the library, or a file .toml or .csv")
    row: str = Field(description="the row's name")

    def law(self, *, slides: bool) -> Law:
        """The law of the row.

        Raises:
            ValueError: there is no such row, or it makes no law.
        """
        rows = {str(row.get(COLUMN_OF_NAME)): dict(row) for row in catalogue(self.catalogue)}
        if self.row not in rows:
            hint = did_you_mean(self.row, rows)
            raise ValueError(f"law.row: '{self.catalogue}' has no row '{self.row}'{hint}")
        found = {key: value for key, value in rows[self.row].items() if key != COLUMN_OF_NAME}
        where = f"law: row '{self.row}' of '{self.catalogue}'"
        table = LAW_TABLES.get(str(found.get("kind")))
        if table is None:
            raise ValueError(f"{where} is no law: its kind must be one of {', '.join(LAW_TABLES)}")
        try:
            return table.model_validate(found).law(slides=slides)
        except pydantic.ValidationError as error:
            raise ValueError(f"{where}: {one_line(error, found, lambda _: list(table.model_fields))}") from None
        except ModelFileError:
            raise
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None


def _kind_of(raw: object) -> str | None:
    if isinstance(raw, CatalogueLaw) or (isinstance(raw, dict) and "catalogue" in raw):
        return "catalogue"
    return raw.get("kind") if isinstance(raw, dict) else getattr(raw, "kind", None)


if TYPE_CHECKING:
    AnyLaw = LawTable | CatalogueLaw
else:
    AnyLaw = Annotated[
        Union[  # noqa: UP007  (of as many tables as there are laws)
            tuple(Annotated[table, Tag(kind)] for kind, table in {**LAW_TABLES, "catalogue": CatalogueLaw}.items())
        ],
        Discriminator(_kind_of),
    ]
"""What a file may say of a law."""
