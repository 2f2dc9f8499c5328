"""Files: written whole or not at all, and no more of them read than can be right; TOML read and written as text."""

from __future__ import annotations

import csv
import errno
import fcntl
import glob
import io
import itertools
import os
import re
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vjm.io.errors import ModelFileError, naming

LOCK, UNFINISHED = ".lock", ".unfinished"
"""Name of the file by which a folder is locked; ending of files that are not whole yet."""


def bounded_bytes(path: Path, largest: int) -> bytes:
    """The bytes of a file, one more than the largest at most.

    Raises:
        ModelFileError: it cannot be read.
    """
    try:
        if path.is_dir():
            raise ModelFileError(f"{path}: is a directory; give the file in it")
        with path.open("rb") as stream:
            return stream.read(largest + 1)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read: {error.strerror}") from error


def small_text(path: Path, largest: int, why: str) -> str:
    """The text of a file with some bytes at most; ``why`` is what is said of a larger one.

    Raises:
        ModelFileError: it cannot be read, is no UTF-8, or is larger.
    """
    raw = bounded_bytes(path, largest)
    if len(raw) > largest:
        raise ModelFileError(f"{path.name}: is larger than {largest // 2**20} MB: {why}")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeError as error:
        raise ModelFileError(f"{path.name}: is no text: save it as UTF-8") from error


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a text or bytes under a temporary name beside its place, then put it there in one step.

    Raises:
        OSError: the folder cannot be made or written to; an older file of that name is still as it was.
    """
    write_together({path: content})


def write_together(contents: Mapping[Path, str | bytes]) -> None:
    """Write files that belong together: all of them under temporary names first, so that a full disk leaves none.

    What a process that was killed has left of them under temporary names is removed.

    Raises:
        OSError: one of them cannot be written; older files of their names are still as they were.
    """
    written: list[tuple[str, Path]] = []
    held: list[int] = []
    try:
        for name, content in contents.items():
            if name.exists() and not name.is_file() and not name.is_dir():
                _pour(name, content)
                continue
            # a link stays, and what it leads to is written
            path = Path(os.path.realpath(name))
            path.parent.mkdir(parents=True, exist_ok=True)
            _remove_left(path)
            handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=UNFINISHED)
            written.append((temporary, path))
            with os.fdopen(handle, "wb") as file:
                # held as long as this process lives
                held.append(os.dup(handle))
                fcntl.flock(handle, fcntl.LOCK_EX)
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                # a disk may say only now that it is full
                os.fsync(file.fileno())
            # mkstemp gives 0600; a report is for everybody whom the umask admits
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(temporary, 0o666 & ~umask)
        for temporary, path in written:
            os.replace(temporary, path)
    except BaseException as failure:
        for temporary, _ in written:
            with suppress(FileNotFoundError):
                os.unlink(temporary)
        if isinstance(failure, OSError) and failure.filename is None and written:
            failure.filename = str(written[-1][1])
        raise
    finally:
        for handle in held:
            os.close(handle)


def _remove_left(path: Path) -> None:
    """Remove what processes that live no more have left of a file under temporary names."""
    for left in path.parent.glob(f".{glob.escape(path.name)}.*{UNFINISHED}"):
        # one that another process holds stays
        with suppress(OSError), left.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            left.unlink()


def _pour(device: Path, content: str | bytes) -> None:
    """Write to a device or a pipe, which cannot be put in place whole."""
    try:
        with device.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
    except OSError as failure:
        failure.filename = failure.filename or str(device)
        raise


def _remove_unfinished(folder: Path) -> None:
    """Remove what a process that was killed while it wrote has left in a folder that is locked, and below it."""
    for file in folder.rglob(f".*{UNFINISHED}"):
        with suppress(OSError):
            file.unlink()


def check_writable(folder: Path) -> None:
    """Try whether a folder can be made or written to, before long work that would end in it; nothing is left there.

    Raises:
        OSError: it cannot.
    """
    existing = next(each for each in (folder, *folder.absolute().parents) if os.path.lexists(each))
    if not existing.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file, and a folder is needed there", str(existing))
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as failure:
        failure.filename = str(folder)
        raise


def check_outputs(files: Mapping[str, Path | None]) -> None:
    """Try whether files can be written, before long work that ends in them.

    Args:
        files: by the option that names each; None where none was asked for.

    Raises:
        ValueError: two are one file.
        OSError: one is a folder, or its folder cannot be made or written to.
    """
    seen: dict[str, str] = {}
    for option, file in files.items():
        if file is None:
            continue
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, f"is a folder: give the name of a file, {option}", str(file))
        check_writable(file.parent)
        place = os.path.realpath(file)
        if place in seen:
            raise ValueError(f"{option} {file}: is the file of {seen[place]}, too: give another name")
        # a device or a pipe takes several
        if file.is_file() or not file.exists():
            seen[place] = option


class FolderInUseError(OSError):
    """Another process is writing into a folder."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder for a while; the lock goes with the process, however that ends.

    Work that fails before it has written anything leaves no folder behind that was not there.

    Raises:
        FolderInUseError: another process holds it.
        OSError: the folder cannot be made or written to.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / LOCK, "a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            raise FolderInUseError(
                f"{folder}: another run is writing here (process {file.read().strip() or 'unknown'}): "
                "wait for it, or give another --out"
            ) from None
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        _remove_unfinished(folder)
        try:
            yield
        except BaseException:
            if made and [each.name for each in folder.iterdir()] == [LOCK]:
                (folder / LOCK).unlink()
                for each in itertools.takewhile(lambda made: not any(made.iterdir()), made):
                    each.rmdir()
            raise


_BARE = re.compile(r"[A-Za-z0-9_-]+")
WIDTH = 110
"""Longer lists get a line for each entry."""


def toml_text(document: Mapping[str, Any]) -> str:
    """A document of tables, lists, numbers, texts and booleans as TOML; reading it gives the same document.

    Lists of tables at the top become ``[[tables]]``, deeper ones stand inline.
    """
    return "\n".join(_table(document, "")).strip() + "\n"


def toml_line(key: str, value: object) -> str:
    """One key of a document, a table inline.

    Example:
        >>> toml_line("units", {"length": "mm"})
        'units = { length = "mm" }'
    """
    return f"{_key(key)} = {_value(value)}"


def _table(table: Mapping[str, Any], path: str) -> list[str]:
    lines, later = [], []
    for key, value in table.items():
        name = f"{path}.{_key(key)}" if path else _key(key)
        if isinstance(value, Mapping):
            later += ["", f"[{name}]", *_table(value, name)]
        elif not path and isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            for one in value:
                later += ["", f"[[{name}]]", *_table(one, name)]
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    return [*lines, *later]


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return '"' + "".join(_escaped(letter) for letter in value) + '"'
        case list() | tuple():
            entries = [_value(one) for one in value]
            flat = "[" + ", ".join(entries) + "]"
            return flat if len(flat) <= WIDTH else "[\n" + "".join(f"  {one},\n" for one in entries) + "]"
        case Mapping():
            return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
        case _:
            raise TypeError(f"TOML has no {type(value).__name__}")


def _escaped(letter: str) -> str:
    if letter in '"\\':
        return "\\" + letter
    return letter if letter.isprintable() else f"\\U{ord(letter):08X}"


# --- TOML of a user's file, bounded: no text of a few kilobytes takes gigabytes or the interpreter's stack --------

DEEPEST = 100
"""Parts of a dotted key; the formats here have five. What `tomllib` allocates grows with the square of their
number."""
LARGEST = 50_000_000
"""Characters of a file."""
# a bare part begins where a word begins, or a long word would be looked at from each of its letters
_DOTTED = re.compile(r"(?:(?:(?<![\w-])[\w-]++|\"[^\"\n]*\"|'[^'\n]*')[ \t]*+\.[ \t]*+)" + f"{{{DEEPEST}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The content of a text.

    Raises:
        ValueError: not TOML, nested too deeply, or too large.
    """
    if len(text) > LARGEST:
        raise ValueError(f"{len(text)} characters: a file may have {LARGEST}")
    deep = _DOTTED.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise ValueError(f"a key of more than {DEEPEST} parts (line {line})")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        match = re.search(r"at line (\d+)", str(error))
        lines = text.splitlines()
        raise ValueError(f"{error}{_remedy(lines[int(match[1]) - 1] if match and lines else '')}") from None


def toml_content(text: str, where: str) -> dict[str, Any]:
    """The content of a text; ``where`` is its file, for messages.

    Raises:
        ModelFileError: as `parse_toml`; one line.
    """
    with naming(f"{where}: not valid TOML"):
        return parse_toml(text)


def csv_rows(
    text: str, file: str, columns: Callable[[list[str], str], list[str]], empty: str, *, loose: bool = False
) -> Iterator[tuple[str, dict[str, str]]]:
    """The lines of a table with commas between cells: the place of each, and its cells by column.

    Lines that are empty or begin with ``#`` are none.

    Args:
        text: of the file.
        file: its name, for messages.
        columns: from the cells of the first line and its place, the names of the columns.
        empty: what is said of a table without columns.
        loose: whether semicolons or tabs may stand between cells, too, and a line may lack some at its end.

    Raises:
        ModelFileError: it is no such table, or a line has more cells or less; the message names the line.
    """
    # comments are blanked, not taken out: the lines keep their numbers
    plain = "\n".join("" if line.lstrip().startswith("#") else line for line in text.splitlines())
    head = plain.lstrip().split("\n", 1)[0] if loose else ""
    reader = csv.reader(io.StringIO(plain), delimiter=next((mark for mark in (";", "\t") if mark in head), ","))
    names: list[str] = []
    try:
        for row in reader:
            cells, where = [cell.strip() for cell in row], f"{file}: line {reader.line_num}"
            if not any(cells):
                continue
            if not names:
                names = columns(cells, where)
            elif len(cells) > len(names) or (len(cells) < len(names) and not loose):
                raise ModelFileError(f"{where}: has {len(cells)} cells, and the table has {len(names)} columns")
            else:
                yield where, dict(zip(names, cells, strict=False))
    except csv.Error as error:
        raise ModelFileError(f"{file}: line {reader.line_num}: {error}") from error
    if not names:
        raise ModelFileError(f"{file}: {empty}")


def _remedy(line: str) -> str:
    """What to write instead of a line that is no TOML; nothing where that is not plain."""
    if match := re.match(r"\s*([\w-]+)\s*=\s*([-+]?\d+),(\d+)\s*(#|$)", line):
        return f": write a decimal point, {match[1]} = {match[2]}.{match[3]}"
    if match := re.match(r"\s*([\w-]+)\s*=\s*([-+]?\d[\d.]*(?:e[-+]?\d+)?)\s*[A-Za-zµ°%/]", line):
        return f": write the number without its unit, {match[1]} = {match[2]}"
    if line.split("#")[0].count('"') % 2:
        return ": a text begins and ends with a quotation mark, on one line"
    if "=" not in line and line.count(",") > 0 and not line.lstrip().startswith(("[", "#")):
        return ": this is a table of readings; a TOML file has lines such as name = value"
    return ""
