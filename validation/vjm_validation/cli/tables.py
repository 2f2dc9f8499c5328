"""What the commands print: a path, metrics, acceptance and a loaded equilibrium as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.text import Text

from vjm.continuation.path import Path, travel
from vjm.model.load_case import Driven
from vjm.rotations import Array
from vjm_output.terminal import TerminalTable
from vjm_validation.documents import BucklingDocument, StiffnessDocument
from vjm_validation.page_content import ReportTable

if TYPE_CHECKING:
    # of every comparison, which takes seconds to import
    from vjm_validation.acceptance import AcceptanceRow

POSE_AXES = ("ux", "uy", "uz", "rx", "ry", "rz")
WRENCH_AXES = ("fx", "fy", "fz", "mx", "my", "mz")
ROWS = 24
"""Points of a path that a terminal shows."""
ASYMMETRY = 1e-6
"""Of a matrix over its largest entry, from which on it is explained."""
NO_POTENTIAL = (
    "It is not symmetric: rows are force and moment about world axes, columns shift and rotation vector. A "
    "moment about fixed axes has no potential of such rotations."
)


def path_table(path: Path) -> TerminalTable:
    """A path's points, thinned to what a terminal shows."""
    driven, what = path.load_case.load_driven, path.load_case.driven
    way = "; magnitudes: the ramp goes against its axis" if path.load_case.sign < 0 and not driven else ""
    title = f"{path.model}, posture {path.load_case.posture}, {path.engine}{way}"
    table = TerminalTable(title=title, title_justify="left")
    columns = [
        f"{what.name} {what.unit}".strip(),
        f"stiffness {what.stiffness}" if what.stiffness else "its stiffness",
    ]
    columns = ["ux mm", "uy mm", "uz mm", *columns] if driven else [f"displacement {what.along}", *columns]
    for column in (*columns, "smallest eigenvalue, over that unloaded", "unstable modes"):
        table.add_column(column, justify="right")
    n = len(path.points)
    relative = path.eigenvalue_relative
    for i in sorted({round(k * (n - 1) / max(ROWS - 1, 1)) for k in range(ROWS)}):
        p = path.points[i]
        table.add_row(
            *([f"{u:.5g}" for u in p.displacement[:3] + 0.0] if driven else [f"{p.ramp:.5g}"]),
            f"{path.force[i]:.6g}",
            f"{p.tangent:.6g}",
            _number(relative[i]),
            "-" if p.unstable < 0 else str(p.unstable),
        )
    return table


def event_lines(path: Path) -> list[str]:
    """The critical points in words."""
    lines, driven = [], path.load_case.driven
    for event in path.events:
        displacement = travel(path, event.point) if event.point else event.s
        # of loads on other parts alone the end-effector has no way
        where = "" if np.isnan(displacement) else f" at {displacement:.6g} {driven.along}".rstrip()
        lines.append(f"{event.kind}{where}, {driven.said(event.force)}")
    if path.stopped:
        lines.append(f"the path ends at {path.points[-1].ramp:.6g}: {path.stopped}")
    if not lines:
        lines.append("no critical point on this path")
    return lines + blanks(path)


def blanks(path: Path) -> list[str]:
    """Why a path's table has infinite numbers or none."""
    lines, points = [], path.points
    if any(np.isinf(p.tangent) for p in points):
        lines.append("stiffness inf: the load does not move where it acts")
    if any(p.unstable < 0 for p in points):
        lines.append(f"unstable modes -: {path.engine} does not examine stability")
    elif any(np.isnan(p.eigenvalue) for p in points):
        lines.append("smallest eigenvalue -: as the end is held, no motion is left that could become unstable")
    return lines


def metrics_table(document: BucklingDocument, driven: Driven) -> TerminalTable:
    """Metrics of every path."""
    units = ", ".join(dict.fromkeys(word for word in (driven.unit or driven.name, driven.along) if word))
    title = f"{document.model}: {units}, magnitudes on the driven axis"
    table = TerminalTable(title=title, title_justify="left", box=SIMPLE)
    table.add_column("")
    table.add_column("critical")
    numbers = ("K0", "K1", "F_cr", "d_cr", "K2", "F_end", "d_end", "K3")
    for column in numbers:
        table.add_column(column, justify="right")
    for posture, directions in document.chain.items():
        for direction, engines in directions.items():
            table.add_row(f"{posture} {direction}", style="bold")
            for engine, metrics in engines.items():
                values = (_number(getattr(metrics, name), 5) for name in numbers)
                table.add_row(f"  {engine}", str(metrics.critical) if metrics.critical else "none", *values)
    return table


MARKS = {True: Text("met", "green"), False: Text("NOT MET", "bold red"), None: Text("not run", "yellow")}
"""How a row that passed, failed or was not run is marked."""


def acceptance_table(rows: Sequence[AcceptanceRow]) -> TerminalTable:
    """What the solvers had to do, and whether they did."""
    table = TerminalTable(title="Acceptance", title_justify="left")
    for column in ("", "requirement", "value"):
        table.add_column(column)
    for row in rows:
        value = row.value if isinstance(row.value, str) else _number(row.value)
        mark = MARKS[row.passed]
        table.add_row(mark, f"{row.name}: {row.requirement}", value)
    return table


def stiffness(console: Console, document: StiffnessDocument) -> None:
    """One loaded equilibrium."""
    where = f", end frame {document.end}" if document.end else ""
    title = f"{document.model}, posture {document.posture}, {document.engine}, imposed {document.control}{where}"
    console.print(title)
    console.print(_row("displacement, mm rad", document.displacement))
    console.print(_row("wrench, N N mm", document.wrench))
    if document.torques:
        words = "  ".join(f"{name} {value:.6g}" for name, value in document.torques.items())
        console.print(f"held by, N mm or N: {words}", soft_wrap=True)
    if document.pulls:
        words = "  ".join(f"{name} {value:.6g}" for name, value in document.pulls.items())
        console.print(f"springs between points pull with, N: {words}", soft_wrap=True)
    for law in document.laws:
        console.print(law, soft_wrap=True, highlight=False)
    rigid = document.stiffness_loaded is None
    for table, matrix in zip(stiffness_tables(document), _matrices(document).values(), strict=True):
        console.print(table.for_terminal())
        K = np.array(matrix)
        if table.caption.startswith("K") and np.abs(K - K.T).max() > ASYMMETRY * np.abs(K).max():
            console.print(NO_POTENTIAL, soft_wrap=True)
    if rigid:
        given = ", so the compliance is given" if document.compliance_loaded is not None else ""
        console.print(f"no 6×6 stiffness where a wrench moves nothing: it is infinite there{given}", soft_wrap=True)
    for wrench in document.rigid:
        console.print(_row("  not moved by, N N mm", wrench))
    for event in document.events:
        console.print(event)
    count = document.iterations
    after = "" if count is None else f" after {count} iteration{'' if count == 1 else 's'}"
    relative = document.eigenvalue_relative
    eigenvalue = "" if relative is None else f", smallest eigenvalue {_number(relative, 4)} of that unloaded"
    state = "its stability is not examined by this engine" if document.stable is None else "stable"
    console.print(f"{state}{eigenvalue}, residual {document.residual:.1e}{after}", soft_wrap=True)


def stiffness_tables(document: StiffnessDocument) -> list[ReportTable]:
    """The stiffnesses; where one is infinite the compliances too."""
    return [
        matrix_table(title, np.array(matrix), *(axes if title.startswith("K") else axes[::-1]))
        for axes in ((WRENCH_AXES, POSE_AXES),)
        for title, matrix in _matrices(document).items()
    ]


def _matrices(document: StiffnessDocument) -> dict[str, list[list[float]]]:
    rigid = document.stiffness_loaded is None or document.stiffness_unloaded is None
    matrices = {
        "K^F loaded (18), N/mm, N/rad, N mm/rad": document.stiffness_loaded,
        "K unloaded (5), N/mm, N/rad, N mm/rad": document.stiffness_unloaded,
        "compliance, loaded, mm/N, 1/N, rad/(N mm)": document.compliance_loaded if rigid else None,
        "compliance, unloaded, mm/N, 1/N, rad/(N mm)": document.compliance_unloaded if rigid else None,
    }
    return {title: matrix for title, matrix in matrices.items() if matrix is not None}


def matrix_table(title: str, matrix: Array, rows: Sequence[str], columns: Sequence[str]) -> ReportTable:
    """A matrix ``(6, 6)`` without what is zero but for rounding, whatever its unit."""
    size = np.sqrt(np.repeat([np.abs(matrix[:3, :3]).max(), np.abs(matrix[3:, 3:]).max()], 3))
    cleaned = np.where(np.abs(matrix) < 1e-10 * size[:, None] * size, 0.0, matrix)
    cells = tuple((name, *(f"{value:.6g}" for value in line)) for name, line in zip(rows, cleaned, strict=True))
    return ReportTable(title, ("", *columns), cells)


def _row(title: str, values: Sequence[float]) -> str:
    return f"{title}: " + "  ".join(f"{value:.6g}" for value in values)


def _number(value: float | None, digits: int = 6) -> str:
    return "-" if value is None or value != value else f"{value:.{digits}g}"
