"""Raw 6×6 matrices from text: six rows of six numbers, or a table of load cases.

Each is made a target to fit: symmetric within its rounding, definite, in plausible units.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from vjm.io.checks import checked_compliance
from vjm.io.errors import did_you_mean
from vjm.plain_numbers import plain_number
from vjm.rotations import Array
from vjm_updating.constants import definition, physical_bound
from vjm_updating.identify.beam_fit import Target

KINDS = ("compliance", "stiffness")
UNITS = ("N mm rad", "N m rad")
PRINTED = "printed"
FREEDOMS = {
    **{str(k + 1): k for k in range(6)},
    **{name: k for names in ("ux uy uz rx ry rz", "fx fy fz mx my mz") for k, name in enumerate(names.split())},
}
"""Freedoms by number, displacement and load."""
_LIBRARY = resources.files("vjm_updating").joinpath("identify", "matrices")
_NUMBER = re.compile(r"[+-]?(\d+\.?(\d*)|\.(\d+))(?:[eEdD]([+-]?\d+))?")


class MatrixFileError(ValueError):
    """A matrix file cannot be read; its text is one line that names the file, the line and the remedy."""


@dataclass(frozen=True)
class RawMatrix:
    """A matrix as its file states it, in N, mm and rad; nothing is checked yet but that it is there.

    Attributes:
        file: its name, for messages.
        sha256: of the file.
        kind: compliance or stiffness.
        units: in which the file gives it.
        units_stated: whether it says so itself.
        rounding: its statement of how well the entries are known.
        values: ``(6, 6)``.
        half: ``(6, 6)`` half the interval for which each entry stands.
        texts: ``(6, 6)`` entries as written.
        lines: line ``(6, 6)`` of each entry.
    """

    file: str
    sha256: str
    kind: str
    units: str
    units_stated: bool
    rounding: str
    values: Array
    half: Array
    texts: tuple[tuple[str, ...], ...]
    lines: tuple[tuple[int, ...], ...]


def read_matrix(name_or_path: str | Path) -> RawMatrix:
    """The matrix of a file.

    Args:
        name_or_path: one of `matrix_names`, such as ``bar-20-as-printed``, or a path.

    Raises:
        MatrixFileError: no matrix, or not one of 6×6 finite numbers.
        OSError: the file cannot be read.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and name_or_path in matrix_names():
        raw = _LIBRARY.joinpath(f"{name_or_path}.txt").read_bytes()
    elif not path.exists():
        names = matrix_names()
        hint = did_you_mean(str(name_or_path), names)
        raise MatrixFileError(f"{name_or_path}: no such file; give a path or one of {', '.join(names)}{hint}")
    else:
        raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise MatrixFileError(f"{path.name}: not UTF-8 text; save it as UTF-8") from None
    return parse_matrix(text, path.name, hashlib.sha256(raw).hexdigest())


def matrix_names() -> list[str]:
    """The matrices that come with the package, by name."""
    return sorted(file.name.removesuffix(".txt") for file in _LIBRARY.iterdir())


def parse_matrix(text: str, file: str, sha256: str = "") -> RawMatrix:
    """As `read_matrix`, of a text."""
    reader = _MatrixReader(text, file)
    values = np.array([[_value(word) for word in row] for row in reader.texts])
    half = reader.half(values)
    units = reader.header.get("units", UNITS[0])
    kind = reader.header.get("kind", KINDS[0])
    if units == "N m rad":
        factor = np.ones((6, 6))
        factor[:3, :3], factor[3:, 3:] = (1e3, 1e-3) if kind == "compliance" else (1e-3, 1e3)
        values, half = values * factor, half * factor
    rounding = reader.header.get("rounding", PRINTED)
    stated = "units" in reader.header
    return RawMatrix(file, sha256, kind, units, stated, rounding, values, half, reader.texts, reader.lines)


def half_unit(word: str) -> float:
    """Half a unit of a number's last written digit: 0.5e-5 of ``28e-5``, 0.005 of ``1.20``."""
    match = _NUMBER.fullmatch(word)
    assert match is not None
    decimals = len(match[2] or match[3] or "")
    return 0.5 * 10.0 ** (int(match[4] or 0) - decimals)


def _value(word: str) -> float:
    return plain_number(word.lower().replace("d", "e"))


def _is_rounding(value: str) -> bool:
    rel, _, size = value.partition(" ")
    return value == PRINTED or (rel == "rel" and bool(_NUMBER.fullmatch(size)) and 0 < _value(size) < 1)


HEADER: dict[str, tuple[Callable[[str], bool], str, str]] = {
    "units": (lambda value: value in UNITS, " or ".join(UNITS), ": convert the numbers"),
    "kind": (lambda value: value in KINDS, " or ".join(KINDS), ""),
    "rounding": (_is_rounding, "'printed' or 'rel' and a number above 0 and below 1", ""),
}
"""Of each key whether it may have a value, what it must be, and a remedy."""


class _MatrixReader:
    """A file taken apart."""

    def __init__(self, text: str, file: str) -> None:
        self.file = file
        self.header: dict[str, str] = {}
        rows: list[tuple[int, list[str]]] = []
        for number, words in _lines(text):
            if "=" in words:
                self._head(number, words)
            else:
                rows.append((number, words))
        if not rows:
            raise MatrixFileError(f"{file}: holds no matrix: write six rows of six numbers")
        table = any(words[0].lower() == "case" for _, words in rows)
        grid = self._table(rows) if table else self._plain(rows)
        self.texts = tuple(tuple(word for word, _ in row) for row in grid)
        self.lines = tuple(tuple(line for _, line in row) for row in grid)

    def half(self, values: Array) -> Array:
        """Half-intervals ``(6, 6)``, in the file's units.

        A zero stands for nothing at all as often as for something small, and its digits say little: it is taken as
        zero within what its row's and column's diagonal entries resolve.
        """
        rounding = self.header.get("rounding", PRINTED)
        diagonal = np.abs(np.diag(values))
        if rounding != PRINTED:
            return float(rounding.split()[1]) * np.sqrt(np.outer(diagonal, diagonal))
        half = np.array([[half_unit(word) for word in row] for row in self.texts])
        seen = np.sqrt(np.outer(np.diag(half), np.diag(half)))
        return np.where(values == 0.0, seen, half)

    def _fail(self, line: int, message: str) -> MatrixFileError:
        return MatrixFileError(f"{self.file}: line {line}: {message}")

    def _head(self, line: int, words: list[str]) -> None:
        key, value = (part.strip() for part in " ".join(words).split("=", 1))
        if key in self.header:
            raise self._fail(line, f"{key} stands twice: leave one")
        if key not in HEADER:
            hint = did_you_mean(key, list(HEADER)) or f"; known are {', '.join(HEADER)}"
            raise self._fail(line, f"unknown key '{key}'{hint}")
        allowed, must_be, remedy = HEADER[key]
        if not allowed(value):
            raise self._fail(line, f"{key} must be {must_be}, got '{value}'{remedy}")
        self.header[key] = value

    def _number(self, line: int, word: str, where: str) -> str:
        if word.lower().lstrip("+-") in ("nan", "inf", "infinity"):
            raise self._fail(line, f"{where} is {word}: a matrix needs six rows of six finite numbers")
        if not _NUMBER.fullmatch(word) or not math.isfinite(_value(word)):
            raise self._fail(line, f"{where} is '{word}', which is no number: write it like 2.8e-4")
        return word

    def _plain(self, rows: list[tuple[int, list[str]]]) -> list[list[tuple[str, int]]]:
        for row, (line, words) in enumerate(rows, 1):
            if row > 6:
                raise self._fail(line, f"a seventh row, of {len(rows)}: a matrix has six rows of six numbers")
            if len(words) != 6:
                raise self._fail(line, f"row {row} has {len(words)} entries: a matrix has six rows of six numbers")
        if len(rows) < 6:
            raise self._fail(rows[-1][0], f"the matrix ends after {len(rows)} rows: give six rows of six numbers")
        return [
            [(self._number(line, word, f"entry ({i},{j})"), line) for j, word in enumerate(words, 1)]
            for i, (line, words) in enumerate(rows, 1)
        ]

    def _table(self, rows: list[tuple[int, list[str]]]) -> list[list[tuple[str, int]]]:
        cells: dict[tuple[int, int], tuple[str, int]] = {}
        case, size, node = -1, 1.0, ""
        seen: dict[int, int] = {}
        for line, words in rows:
            if len(words) != 3:
                raise self._fail(line, f"{len(words)} words: write 'case dof size' or 'node dof value'")
            freedom = FREEDOMS.get(words[1].lower())
            if freedom is None:
                raise self._fail(line, f"'{words[1]}' is no degree of freedom: write 1 to 6, or ux uy uz rx ry rz")
            if words[0].lower() == "case":
                if freedom in seen:
                    raise self._fail(line, f"case {words[1]} stands already in line {seen[freedom]}: leave one")
                case, size = freedom, _value(self._number(line, words[2], f"the size of case {words[1]}"))
                seen[case] = line
                if size == 0.0:
                    raise self._fail(line, f"case {words[1]} has the size 0: give the load that was applied")
                continue
            if case < 0:
                raise self._fail(line, "a value before the first case: write 'case dof size' above it")
            node = node or words[0]
            if words[0] != node:
                raise self._fail(line, f"node {words[0]} after node {node}: keep the loaded node's lines only")
            if (freedom, case) in cells:
                raise self._fail(
                    line, f"dof {words[1]} stands already in line {cells[freedom, case][1]}: leave one"
                )
            word = self._number(line, words[2], f"dof {words[1]} of the case in line {seen[case]}")
            cells[freedom, case] = (_divided(word, size), line)
        missing = [(i, j) for j in range(6) for i in range(6) if (i, j) not in cells]
        if missing:
            i, j = missing[0]
            raise self._fail(
                seen.get(j, rows[-1][0]),
                f"dof {i + 1} under case {j + 1} is missing (and {len(missing) - 1} more): "
                "six cases with six values each are needed",
            )
        return [[cells[i, j] for j in range(6)] for i in range(6)]


def _divided(word: str, size: float) -> str:
    """A written number over a size, with as many significant digits as it had."""
    mantissa = re.split(r"[eEdD]", word.lstrip("+-"))[0].replace(".", "").lstrip("0")
    return word if size == 1.0 or not mantissa else f"{_value(word) / size:.{len(mantissa) - 1}e}"


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Lines that are not empty without their comments, as words; commas part words too."""
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#", 1)[0].replace(",", " ").replace("=", " = ").split()
        if words:
            yield number, words


def entry_name(i: int, j: int) -> str:
    """``(2,6)`` of the entry with the zero-based indices 1 and 5."""
    return f"({i + 1},{j + 1})"


# --- A raw matrix made a target to fit: symmetric within its rounding, in plausible units, definite ---------------

CANTILEVER = definition(0.75)
"""|C_uφ|² / (|C_uu| |C_φφ|) of a cantilever: (L²/2EI)² over L³/3EI · L/EI. Above 1 no matrix is definite."""
APART = physical_bound(30.0)
"""Factor on it from which blocks have different units: half-way, in powers, to the 1000 of m for mm."""
COMPACT_MM = physical_bound(10.0, "mm")
"""Size below which turns in rad/(N m) are suspected: theirs is 32 times too small."""
SHORTEST_MM, LONGEST_MM = physical_bound(1.0, "mm"), physical_bound(2e4, "mm")
"""Of √(|C_uu|/|C_φφ|), a cantilever's length over √3: less or more is no robot's part in mm."""


def asymmetric_pairs(raw: RawMatrix) -> list[tuple[int, int]]:
    """Pairs ``i < j`` whose mirrored entries stand for intervals that do not meet, the most different first."""
    gap = np.abs(raw.values - raw.values.T) - raw.half - raw.half.T
    scale = np.sqrt(np.outer(np.abs(np.diag(raw.values)), np.abs(np.diag(raw.values))))
    # numbers that round to the interval's very end are still met
    pairs = [(i, j) for i in range(6) for j in range(i + 1, 6) if gap[i, j] > 1e-9 * scale[i, j]]
    return sorted(pairs, key=lambda p: -abs(gap[p]) / scale[p])


def target(raw: RawMatrix) -> Target:
    """The compliance to fit, each pair where its two intervals meet; where they do not, it is left out.

    Raises:
        MatrixFileError: units that do not fit together, or an indefinite matrix.
    """
    low = np.maximum(raw.values - raw.half, (raw.values - raw.half).T)
    high = np.minimum(raw.values + raw.half, (raw.values + raw.half).T)
    M, half = 0.5 * (low + high), 0.5 * (high - low)
    _check_diagonal(raw, M)
    for i, j in asymmetric_pairs(raw):
        half[i, j] = half[j, i] = np.inf
        M[i, j] = M[j, i] = 0.5 * (raw.values[i, j] + raw.values[j, i])
    if raw.kind == "stiffness":
        half = np.where(np.isfinite(half), half, np.abs(M))
        # units and definiteness are the same question for the inverse
        _check_definite(raw, M, half)
        inverse = np.linalg.inv(M)
        M, half = 0.5 * (inverse + inverse.T), np.abs(inverse) @ half @ np.abs(inverse)
    _check_units(raw, M)
    _check_definite(raw, M, half)
    return Target(M, half)


def _check_diagonal(raw: RawMatrix, M: Array) -> None:
    for k in range(6):
        if M[k, k] <= 0.0:
            raise MatrixFileError(
                f"{raw.file}: line {raw.lines[k][k]}: ({k + 1},{k + 1}) = {raw.texts[k][k]}: a {raw.kind} has "
                "positive diagonal entries, as a load moves its point its own way. Check the sign, or give the "
                "load case in which this freedom moves"
            )


def _check_units(raw: RawMatrix, C: Array) -> None:
    shift, both, turn = (float(np.linalg.norm(B, 2)) for B in (C[:3, :3], C[:3, 3:], C[3:, 3:]))
    where = f"{raw.file}: line {raw.lines[0][0]}:"
    coupling = both**2 / (shift * turn)
    if coupling > APART:
        factor = 10.0 ** (3 * max(1, round(np.log10(coupling / CANTILEVER) / 3)))
        raise MatrixFileError(
            f"{where} shifts by forces (rows and columns 1 to 3) are some {factor:.0f} times smaller than the "
            "couplings and turns ask for: are they in m/N and the rest in mm? Give all in one system, such as "
            "mm/N, 1/N and rad/(N mm)"
        )
    size = float(np.sqrt(shift / turn))
    # a compact hinge read near its elastic centre looks alike: it is let through where the file states its units
    alike = 0.1 < CANTILEVER / coupling / 1e3 < 10.0 and size < COMPACT_MM if coupling > 0.0 else False
    if alike and not raw.units_stated:
        raise MatrixFileError(
            f"{where} turns by moments (rows and columns 4 to 6) are some 1000 times larger than the rest asks "
            "for: are they in rad/(N m) and the rest in mm? Give all in mm/N, 1/N and rad/(N mm); if they are, "
            "write 'units = N mm rad' above them"
        )
    if size < SHORTEST_MM:
        raise MatrixFileError(
            f"{where} shifts over turns make a length of {size:.2g} mm, no machine part's: is the matrix in m? "
            "Write 'units = N m rad' above it"
        )
    if size > LONGEST_MM:
        raise MatrixFileError(
            f"{where} shifts over turns make a length of {size:.2g} mm, no machine part's: is the matrix in mm? "
            "Write 'units = N mm rad' above it"
        )


def _check_definite(raw: RawMatrix, M: Array, half: Array) -> None:
    """Refuse what no rounding makes definite: for the worst vector v, vᵀ M v stays negative on the whole box."""
    scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))
    values, vectors = np.linalg.eigh(M / scale)
    v = np.abs(vectors[:, 0])
    open_ = np.where(np.isfinite(half), half, scale) / scale
    if values[0] + v @ open_ @ v > 0.0:
        return
    try:
        checked_compliance(M)
    except ValueError as error:
        raise MatrixFileError(f"{raw.file}: line {raw.lines[0][0]}: the {raw.kind} {error}") from None
