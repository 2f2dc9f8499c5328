"""Load paths as files: CSV for people and scripts, and a whole record that a run resumes from.

Load cases as plain data stand in both.
"""

from __future__ import annotations

import csv
import io
import json
import struct
import zlib
from dataclasses import asdict, fields
from pathlib import Path as FilePath
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from vjm import __version__
from vjm.continuation.path import Equilibrium, Event, EventKind, Path, StationLabel
from vjm.io.files import write_whole
from vjm.model.load_case import Load, LoadCase, PointControl


def _plain(load_case: LoadCase) -> dict[str, Any]:
    """What a load case says, as JSON's types, without what it leaves at its default."""
    everything = asdict(load_case)
    return {
        field.name: everything[field.name]
        for field in fields(LoadCase)
        if getattr(load_case, field.name) != field.default
    }


def from_plain(data: dict[str, Any]) -> LoadCase:
    """The load case that `_plain` wrote.

    Raises:
        KeyError: a key is missing.
        TypeError: a key is unknown.
        ValueError: the load case makes no sense.
    """
    data = dict(data)
    data["loads"] = tuple(Load(**load) for load in data.get("loads", ()))
    if isinstance(data.get("control"), dict):
        control = data["control"]
        data["control"] = PointControl(control["part"], control["at"], tuple(control["direction"]))
    return LoadCase(**data)


def words(load_case: LoadCase) -> dict[str, str]:
    """`_plain` as words without blanks, for one line of ``key=value``."""
    return {
        key: value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
        for key, value in _plain(load_case).items()
    }


def _value(text: str) -> Any:  # noqa: ANN401
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


DISPLACEMENT_COLUMNS = ("ux_mm", "uy_mm", "uz_mm", "rx_rad", "ry_rad", "rz_rad")
"""Columns of the end-effector's displacement, world axes."""
WRENCH_COLUMNS = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
"""Columns of the wrench at the end-effector, world axes."""
COLUMNS = (
    "step", *DISPLACEMENT_COLUMNS, *WRENCH_COLUMNS, "k_N_per_mm", "unstable_modes", "lambda_min_rel", "iterations",
)  # fmt: skip
"""Columns of a curve file. The stiffness is in N mm/rad where a rotation is driven, and per unit of the load factor
where loads are."""
LOAD_FACTOR = "load_factor"
"""One column more, where loads are driven."""


def curve_csv(path: Path) -> str:
    """The path as CSV text: a comment line with model, engine, version and hash, then a row a point."""
    head = {
        "model": path.model,
        "engine": path.engine,
        "version": __version__,
        "model_sha256": path.model_sha256,
        **words(path.load_case),
    }
    columns = (*COLUMNS, LOAD_FACTOR) if path.load_case.load_driven else COLUMNS
    out = io.StringIO()
    out.write("# " + " ".join(f"{key}={value}" for key, value in head.items()) + "\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    relative = path.eigenvalue_relative
    for step, p in enumerate(path.points):
        row: list[str | int] = [step]
        row += [f"{v:.12g}" for v in (*p.displacement, *p.wrench, p.tangent)]
        row += ["" if p.unstable < 0 else p.unstable]
        row += ["" if np.isnan(relative[step]) else f"{relative[step]:.9g}", p.iterations]
        row += [f"{p.ramp:.12g}"] if path.load_case.load_driven else []
        writer.writerow(row)
    return out.getvalue()


def write_curve(path: Path, file: FilePath | str) -> None:
    """Write `curve_csv` to a file, whole or not at all.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> with TemporaryDirectory() as folder:
        ...     vjm.write_curve(path, Path(folder) / "curve.csv")
        ...     text = (Path(folder) / "curve.csv").read_text()
        >>> text.splitlines()[1].split(",")[:2]
        ['step', 'ux_mm']
    """
    write_whole(FilePath(file), curve_csv(path))


def read_curve(file: FilePath | str) -> Path:
    """Read a curve file back: the path without its shapes, events and engine states.

    Raises:
        ValueError: the file is no curve file; the message names it, what is missing, and the line of a damaged row.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import vjm
        >>> path = vjm.trace(vjm.load("orthoglide-chain"), vjm.LoadCase("A", to=1.0), engine="vjm-paper")
        >>> with TemporaryDirectory() as folder:
        ...     vjm.write_curve(path, Path(folder) / "curve.csv")
        ...     again = vjm.read_curve(Path(folder) / "curve.csv")
        >>> len(again.points) == len(path.points)
        True
    """
    text = FilePath(file).read_text(encoding="utf-8")
    lines = text.splitlines()
    if len(lines) < 2 or not lines[0].startswith("# "):
        raise ValueError(f"{file}: no curve file: the first line must start with '# model='")
    head = dict(item.split("=", 1) for item in lines[0][2:].split(" ") if "=" in item)
    rows = list(csv.DictReader(lines[1:]))
    missing = [c for c in COLUMNS if not rows or c not in rows[0]]
    if missing:
        raise ValueError(f"{file}: no curve file: missing column {missing[0]}")
    try:
        names = {field.name for field in fields(LoadCase)} - {"posture"}
        data = {key: _value(text) for key, text in head.items() if key in names}
        load_case = from_plain({"posture": head["posture"], **data})
        labels = head["engine"], head["model"], load_case
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{file}: no curve file: {error}") from error
    if not text.endswith("\n"):
        raise ValueError(f"{file}, line {len(lines)}: has no end: it was cut off: write the file anew")
    points = []
    for number, row in enumerate(rows, start=3):
        try:
            if None in row:
                raise ValueError("has more cells than columns")
            points.append(_point(row, load_case))
        except ValueError as error:
            raise ValueError(f"{file}, line {number}: {error}") from None
    return Path(*labels, tuple(points), model_sha256=head.get("model_sha256", ""))


def cell_number(column: str, cell: str | None) -> float:
    """The number in a cell of a table that the suite wrote.

    Raises:
        ValueError: there is none; the message names the column.
    """
    try:
        return float(cell or "")
    except ValueError:
        said = f"'{cell}' is no number" if cell else "has no value"
        raise ValueError(f"column {column}: {said}") from None


def _point(row: dict[str, str], load_case: LoadCase) -> Equilibrium:
    def number(column: str) -> float:
        return cell_number(column, row.get(column))

    def blank(column: str) -> bool:
        # without stability the cell is there and empty; of a line that was cut off it is not there
        return row[column] == ""

    displacement = np.array([number(c) for c in DISPLACEMENT_COLUMNS])
    along = load_case.direction
    ramp = number(LOAD_FACTOR) if load_case.load_driven else float(displacement @ along / (along @ along))
    return Equilibrium(
        s=ramp,
        displacement=displacement,
        wrench=np.array([number(c) for c in WRENCH_COLUMNS]),
        tangent=number("k_N_per_mm"),
        eigenvalue=float("nan") if blank("lambda_min_rel") else number("lambda_min_rel"),
        unstable=-1 if blank("unstable_modes") else int(number("unstable_modes")),
        iterations=int(number("iterations")),
        residual=float("nan"),
        shape=np.empty((0, 3)),
        state=np.empty(0),
    )


LARGEST_RECORD = 2**30
"""Bytes to which a record of a path may unpack: thousands of points of hundreds of springs have a tenth of it."""
_POINT_ARRAYS = [f.name for f in fields(Equilibrium) if f.name != "stiffness"]


def save_path(path: Path, file: FilePath, key: str = "") -> None:
    """Write all that is known of a path as a numpy archive, with a key of what it was made of."""
    event_points = [e.point for e in path.events if e.point is not None]
    everything = (*path.points, *event_points)
    arrays = {name: np.array([getattr(p, name) for p in everything]) for name in _POINT_ARRAYS}
    if all(p.stiffness is not None for p in everything):
        arrays["stiffness"] = np.array([p.stiffness for p in everything])
    meta = {
        "version": __version__,
        "key": key,
        "engine": path.engine,
        "model": path.model,
        "model_sha256": path.model_sha256,
        "load_case": _plain(path.load_case),
        "points": len(path.points),
        "events": [
            {f.name: getattr(e, f.name) for f in fields(e) if f.name != "point"}
            | {"has_point": e.point is not None}
            for e in path.events
        ],
        "stations": [asdict(s) for s in path.stations],
        "stopped": path.stopped,
        "seconds": path.seconds,
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, meta=np.array(json.dumps(meta)), **arrays)  # type: ignore[arg-type]
    write_whole(file, buffer.getvalue())


def load_path(file: FilePath, key: str = "") -> Path:
    """Read what `save_path` wrote; a key that is given is that of what it must have been made of.

    Raises:
        ValueError: the file is damaged, of another kind, or made of other inputs.
    """
    try:
        with ZipFile(file) as members:
            if sum(member.file_size for member in members.infolist()) > LARGEST_RECORD:
                raise ValueError(f"it unpacks to more than {LARGEST_RECORD} bytes")
        with file.open("rb") as stream, np.load(stream) as archive:
            arrays = {name: archive[name] for name in archive.files}
        meta = json.loads(str(arrays.pop("meta")))
        if meta["version"] != __version__:
            raise ValueError(f"written by version {meta['version']}, this is {__version__}")
        if key and meta["key"] != key:
            raise ValueError("made of another model, load case or program")
        stiffness = arrays.pop("stiffness", None)
        everything = [
            Equilibrium(
                **{
                    name: values[i] if values.ndim > 1 or name == "state" else values[i].item()
                    for name, values in arrays.items()
                },
                stiffness=None if stiffness is None else stiffness[i],
            )
            for i in range(len(arrays["s"]))
        ]
        n = meta["points"]
        left = iter(everything[n:])
        events = [
            Event(**{**e, "kind": EventKind(e["kind"])}, point=next(left) if has_point else None)
            for e in meta["events"]
            for has_point in [e.pop("has_point")]
        ]
        return Path(
            meta["engine"], meta["model"], from_plain(meta["load_case"]), tuple(everything[:n]), tuple(events),
            tuple(StationLabel(**s) for s in meta["stations"]), meta["stopped"], meta["seconds"],
            meta["model_sha256"],
        )  # fmt: skip
    # a damaged archive fails in many manners, unknown compression and encryption among them
    except (
        OSError, EOFError, LookupError, TypeError, ValueError, AttributeError, NotImplementedError, RuntimeError,
        BadZipFile, zlib.error, struct.error, MemoryError, OverflowError,
    ) as error:  # fmt: skip
        raise ValueError(f"{file}: no record of a path: {error}") from error
