"""At which load a machine's material yields first, beside the critical load of the same path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vjm.continuation.path import Path
from vjm.engine import Engine
from vjm.model.machine import Machine
from vjm.vjm_engine import VjmEngine
from vjm_output.documents import Row
from vjm_updating.diagnosis.stress import first_yield


class YieldRow(Row):
    """Of one path, as far as its critical point or its end."""

    posture: str
    direction: str
    engine: str
    yields_N: float | None  # noqa: N815
    """Driven force at which the material yields first; null where it does not."""
    critical_N: float | None  # noqa: N815
    """Of the path; null where it has no critical point."""
    where: str
    """``on the way, in PART``; or how much of the yield stress is reached."""

    @property
    def words(self) -> str:
        """One line for people."""
        head = f"{self.posture} {self.direction}, {self.engine}: "
        if self.yields_N is None:
            return f"{head}the material does not yield: {self.where}"
        line = f"{head}the material yields first at {self.yields_N:.4g} N, {self.where}"
        if self.critical_N is None:
            return f"{line}; the path has no critical point"
        return f"{line}: {self.yields_N / self.critical_N:.2g} of the critical {self.critical_N:.4g} N"


def yield_rows(
    chain: Machine,
    parts: Sequence[Mapping[str, Any]],
    cases: Sequence[tuple[str, str, Engine]],
    paths: Sequence[Path],
) -> list[YieldRow]:
    """A row for every path of the virtual joint method; none where the file says no yield stress.

    Args:
        chain: that was walked.
        parts: tables of its model file, see `vjm.io.machine_file.part_tables`.
        cases: posture, direction and engine of every path.
        paths: the paths.
    """
    rows = []
    for (posture, direction, engine), path in zip(cases, paths, strict=True):
        if not isinstance(chain, Machine) or not isinstance(engine, VjmEngine):
            continue
        first = first_yield(engine.problem(chain, path.load_case), path, parts)
        if first.known:
            critical = None if path.critical is None else float(path.critical.force)
            rows.append(
                YieldRow(
                    posture=posture, direction=direction, engine=engine.label, yields_N=first.force,
                    critical_N=critical, where=first.words,
                )
            )  # fmt: skip
    return rows
