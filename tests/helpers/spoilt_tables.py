"""Tables of readings that are spoilt in place, ``list[list[str]]`` with the header first."""

from collections.abc import Callable

Table = list[list[str]]
Spoil = Callable[[Table], None]


def column(name: str, change: Callable[[str], str], posture: str = "") -> Spoil:
    """Change the cells of a column, of one posture or of all."""

    def spoil(table: Table) -> None:
        at = table[0].index(name)
        for row in table[1:]:
            if not posture or row[table[0].index("posture")] == posture:
                row[at] = change(row[at])

    return spoil


def without(name: str) -> Spoil:
    """Leave a column out."""

    def spoil(table: Table) -> None:
        at = table[0].index(name)
        for row in table:
            del row[at]

    return spoil


def cell(row: int, name: str, text: str) -> Spoil:
    """Write into a column of a row, counted as in a message: the header is row 1."""

    def spoil(table: Table) -> None:
        table[row - 1][table[0].index(name)] = text

    return spoil


def keep(count: int) -> Spoil:
    """Keep the first readings only."""

    def spoil(table: Table) -> None:
        del table[count + 1 :]

    return spoil


def swapped(table: Table) -> None:
    """Two readings change places."""
    table[5], table[6] = table[6], table[5]
