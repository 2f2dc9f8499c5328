"""Mistakes that are well-formed: what is done to readings, in which rows, and what has to be said of it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from vjm_updating.experiment.data_file import POSE, WRENCH

Row = dict[str, str]
"""Cells by column."""
FORCES, SHIFTS, TURNS = WRENCH[:3], POSE[:3], POSE[3:]


@dataclass(frozen=True)
class Way:
    """What a user who mistakes a column does to readings."""

    name: str
    says: tuple[str, ...]
    factors: dict[str, float]
    exchanged: tuple[str, str] | tuple[()] = ()

    def spoil(self, row: Row) -> None:
        """Change one row."""
        for name in (name for name in self.factors if row.get(name)):
            row[name] = repr(float(row[name]) * self.factors[name])
        if self.exchanged:
            a, b = self.exchanged
            row[a], row[b] = row[b], row[a]


def ways(columns: list[str], moved: str, loaded: str) -> Iterator[Way]:
    """All ways that concern columns that are there."""

    def these(names: tuple[str, ...], factor: float) -> dict[str, float]:
        return {name: factor for name in names if name in columns}

    forces = WRENCH if loaded in FORCES else WRENCH[3:]
    for unit, factor in (("kN", 1e-3), ("kgf", 1 / 9.80665), ("lbf", 1 / 4.4482216152605)):
        yield Way(f"wrenches in {unit}", (unit,), these(WRENCH, factor))
        if loaded in FORCES and set(columns) & set(WRENCH[3:]):
            yield Way(f"forces alone in {unit}", (unit,), these(FORCES, factor))
    if moved in SHIFTS:
        for unit, factor in (("cm", 0.1), ("inches", 1 / 25.4), ("in m", 1e-3), ("µm", 1e3)):
            yield Way(f"displacements {unit}", (unit,), these(SHIFTS, factor))
    else:
        yield Way("rotations in degrees", ("degrees",), these(TURNS, 57.29577951308232))
    yield Way("the sign of the wrenches", ("the sign of the forces",), these(WRENCH, -1.0))
    yield Way(f"the sign of {loaded}", (f"sign of {loaded}", "sign of the forces", "other sign"), {loaded: -1.0})
    yield Way("the sign of the displacements", ("the sign of", "that of the displacement"), these(POSE, -1.0))
    for other in [name for name in columns if name in forces and name != loaded][:2]:
        words = (f"{loaded} and {other} exchanged", f"{other} and {loaded} exchanged")
        yield Way(f"{loaded} and {other} exchanged", words, {}, (loaded, other))


Place = Callable[[int, Row], bool]
"""Whether a row, by its number and its cells, is spoilt."""


def places(rows: list[Row]) -> Iterator[tuple[str, Place]]:
    """Everywhere, each posture, either half of the file, and from and up to rows of the first and last posture."""
    labels = list(dict.fromkeys(row.get("posture", "") for row in rows))
    yield "everywhere", lambda k, row: True
    if len(labels) > 1:
        for label in labels:
            yield f"posture {label}", lambda k, row, label=label: row["posture"] == label  # type: ignore[misc]
    half = len(rows) // 2
    yield f"the first {half} rows", lambda k, row: k < half
    yield f"from row {half + 2} on", lambda k, row: k >= half
    for label in dict.fromkeys((labels[0], labels[-1])):
        own = [k for k, row in enumerate(rows) if row.get("posture", "") == label]
        for part in (0.1, 0.3, 0.6, 0.9):
            at = own[int(part * len(own))]
            yield f"{label} from row {at + 2} on", lambda k, row, at=at, own=own: at <= k <= own[-1]  # type: ignore[misc]
        at = own[int(0.4 * len(own))]
        yield f"{label} up to row {at + 1}", lambda k, row, at=at, own=own: own[0] <= k < at  # type: ignore[misc]
