"""What to know of a part from a drawing: whether a beam is like it, and whether it may buckle by itself."""

from __future__ import annotations

from collections.abc import Iterator

from vjm.io.drawn import nearest_beam
from vjm.io.errors import printed
from vjm.io.findings import Grade
from vjm.io.schema import BeamTable, ModelFile

LIKE = 0.05
"""Scaled difference of the nearest beam's compliance up to which it stands for the part."""
STUBBY = 20.0
"""Length over the larger radius of gyration below which plane sections do not stay plane: a depth of L/6."""
THIN = 15.0
"""Radius of gyration over the walls' thickness from which on a wall may buckle before the part does."""


def drawings(model: ModelFile) -> Iterator[tuple[Grade, str, str]]:
    """Parts from drawings."""
    for table in model.parts:
        if not isinstance(table, BeamTable) or table.drawing is None or table.compliance is None:
            continue
        where, near = f"part '{table.name}', compliance", nearest_beam(table.part())
        i, j = near.entry
        miss = f"the nearest beam misses ({i},{j}) by {printed(100.0 * near.worst, 2)} % of √(c_ii c_jj)"
        alike = near.worst <= LIKE
        if table.drawing.bodies > 1 and not table.drawing.bonded:
            text = bonded_bodies(table.drawing.bodies)
            yield Grade.DOUBTFUL, where, f"{text}: bonded = true in its table says that this is meant"
        if table.section is None:
            yield Grade.NOTED, where, _one_spring(table.drawing.buckling_N, miss, alike)
        elif not alike:
            yield (
                Grade.DOUBTFUL,
                f"{where}.as_beam",
                f"{miss}: leave as_beam out, or give root_mm and end_offset_mm",
            )
        if table.section is not None and near.length < STUBBY * near.gyration:
            yield (
                Grade.DOUBTFUL, f"{where}.as_beam",
                f"too stubby for a beam: {printed(near.length, 3)} mm long with a radius of gyration of "
                f"{printed(near.gyration, 3)} mm: leave as_beam out",
            )  # fmt: skip
        if alike and near.gyration > THIN * table.drawing.thickness_mm:
            yield (
                Grade.DOUBTFUL, where,
                f"walls of about {printed(table.drawing.thickness_mm, 3)} mm at a radius of gyration of "
                f"{printed(near.gyration, 3)} mm may buckle by themselves, which no spring or beam knows",
            )  # fmt: skip


def bonded_bodies(count: int) -> str:
    """What is said of a drawing with more than one body."""
    return f"{count} bodies, bonded, one material"


def _one_spring(force: float | None, miss: str, alike: bool) -> str:
    beam = "as_beam = true lets it" if alike else f"no uniform beam in this geometry is like the part ({miss})"
    if force is None:
        own = f"whether the part may is undecided, as it bends otherwise than a column of its own sections; {beam}"
        return f"one spring does not buckle by itself; {own}"
    return (
        f"one spring does not buckle by itself. The part as a column of its own sections, free at its tip, does at "
        f"{printed(force, 3)} N of compression; {beam}"
    )
