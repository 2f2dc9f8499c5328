"""Files that the page writes: only where it was asked to, and over nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from vjm.io.file_parameters import MachineFiles
from vjm.io.files import check_writable, write_together

FILE_NAME = re.compile(r"[^\W_][\w.-]{0,98}\.toml")
"""Names of files: none is hidden, none is an option, and no shell reads more than a name in them."""
LABEL = re.compile(r"[^\W\d_][\w-]{0,59}")
"""Labels of postures: none is read as coordinates."""


def keep(
    files: MachineFiles, file: Path, posture: tuple[str, Mapping[str, float] | list[float]] | None = None
) -> list[Path]:
    """Write the files of a machine, all of them or none.

    Args:
        files: of the machine.
        file: its name, ``.toml``.
        posture: label and coordinates of a posture more.

    Returns:
        The files that were written, the machine's last.

    Raises:
        ValueError: the name has other characters than letters, digits, ``-``, ``_`` and ``.``, does not end in
            ``.toml``, begins with a point, or is that of a file; the label is no word, or that of a posture.
        OSError: it cannot be written.
    """
    if not FILE_NAME.fullmatch(file.name):
        raise ValueError(
            f"'{file.name}': write a name of letters, digits, -, _ and . that begins with a letter or a digit and "
            f"ends in .toml"
        )
    if posture is not None:
        label, coordinates = posture
        if not LABEL.fullmatch(label):
            raise ValueError(f"'{label}': write a label of letters, digits, - and _ that begins with a letter")
        if any(label in files.document.content.get(key, {}) for key in ("postures", "poses")):
            raise ValueError(f"{files.name} has a posture '{label}' already: write another label")
        files = files.with_posture(label, coordinates)
    head = f"# {files.document.file} with other numbers, saved by `validate explore`.\n"
    texts = files.texts(file, head, str(files.document.content["title"]))
    for each in texts:
        # a link that leads nowhere does not exist, and would be written through
        if each.exists() or each.is_symlink():
            raise ValueError(f"{each.name} exists already: write another name")
    check_writable(file.parent)
    write_together(texts)
    return list(texts)
