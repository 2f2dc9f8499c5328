"""The commands ``validate list`` and ``validate --version --licences``.

The first shows the models, engines, comparisons and cases that there are, the second the packages that each extra
brings with their licences. What is printed of a package is what it says of itself.
"""

from __future__ import annotations

import re
from importlib import metadata

from vjm import __version__
from vjm.engines import DESCRIPTIONS
from vjm.io.manipulator_file import machines, manipulators
from vjm.io.model_file import library
from vjm_output import terminal
from vjm_output.terminal import TerminalTable
from vjm_validation.cli import OK
from vjm_validation.runs import COMPARISONS
from vjm_validation.verification.library import library as cases

OURS = "vjm-stiffness"
EVERYTHING, DEVELOPERS = "all", ("docs", "test")
"""The extra that brings others, and those that only who works on the project takes."""
REMARKS = {
    "gmsh": "GPL 2 or later; an exception allows to combine it with Netgen, METIS, Open CASCADE and ParaView. It "
    "is in `solid`, and so in `all`. Who passes on a program together with it has to do so under the GPL.",
    "openseespy": "free for research, education and internal use. To pass it on for money, or to sell a service "
    "that imports it, needs a licence of the University of California. It is not in `all`.",
    "pypardiso": "BSD; the solver that it brings is Intel's MKL, free of charge, without source, and to be passed "
    "on under Intel's terms. Where it is not installed, SciPy's SuperLU solves.",
    "exudyn": "a BSD licence of three clauses under its own name, with those of the codes in it.",
    "xacro": "a BSD licence of three clauses, in its own words.",
    "robot-descriptions": "of the package alone: each robot that it fetches has a licence of its own.",
}
PERMISSIVE = re.compile(
    r"\b(0?BSD|MIT|Apache|ISC|Zlib|PSF|Python Software Foundation|HPND|Unlicense|CC0|MIT-CMU|Public Domain)\b", re.I
)
COPYLEFT = re.compile(r"GPL|General Public|Mozilla|MPL|Proprietary|Intel", re.I)
LONGEST = 60
"""Characters of the name of a licence; what is longer is its text."""


def show_licences() -> None:
    """Print the packages of every extra with their licences, and what else they bring that is not permissive."""
    table = TerminalTable(title=f"{OURS} {__version__}: BSD-3-Clause. It brings", title_justify="left")
    for head in ("extra", "package", "version", "licence"):
        table.add_column(head)
    direct = by_extra()
    for extra, names in direct.items():
        for name in names:
            table.add_row(extra or "none", name, *(stated(name) or ("not installed", "")))
    console = terminal.console()
    console.print(table, highlight=False)
    every = sorted({name for names in direct.values() for name in names})
    for name in every:
        if name in REMARKS:
            console.print(f"{name}: {REMARKS[name]}", soft_wrap=True, highlight=False)
    licences = {name: stated(name) for name in brought(every) - set(every)}
    others = {name: said for name, said in licences.items() if said is not None}
    unlike = {name: said for name, said in sorted(others.items()) if not permissive(said[1])}
    console.print(
        f"They bring {len(others)} more that are installed; {len(others) - len(unlike)} of them say that their "
        "licence is permissive (BSD, MIT, Apache and their like). The others:",
        soft_wrap=True, highlight=False,
    )  # fmt: skip
    for name, (version, licence) in unlike.items():
        console.print(f"{name} {version}: {licence}", soft_wrap=True, highlight=False)


def by_extra() -> dict[str, list[str]]:
    """Names of the packages that each extra asks for itself; the empty string is what all installs have."""
    packages: dict[str, list[str]] = {"": []}
    for one in metadata.requires(OURS) or []:
        name, extra = _parsed(one)
        if name != OURS and extra not in (EVERYTHING, *DEVELOPERS):
            packages.setdefault(extra, []).append(name)
    return packages


def stated(name: str) -> tuple[str, str] | None:
    """Version and licence of a package by its own metadata; None where it is not installed."""
    try:
        about = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return None
    kinds = [
        one.rpartition("::")[2].strip()
        for one in about.get_all("Classifier") or []
        if one.startswith("License") and not one.endswith("OSI Approved")
    ]
    expression, written = (
        " ".join(about[key].split()) if key in about else "" for key in ("License-Expression", "License")
    )
    short = written if len(written) <= LONGEST else ""
    licence = expression or ", ".join(kinds) or short or "see its own text"
    return about["Version"], licence


def permissive(licence: str) -> bool:
    """Whether a licence's name is one that asks for no more than to be named."""
    return bool(PERMISSIVE.search(licence)) and not COPYLEFT.search(licence)


def brought(names: list[str]) -> set[str]:
    """The packages that some bring without any extra, themselves included."""
    packages: set[str] = set()
    ahead = list(names)
    while ahead:
        name = ahead.pop()
        if name in packages:
            continue
        packages.add(name)
        try:
            asked = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue
        ahead += [other for other, extra in map(_parsed, asked) if not extra]
    return packages


def _parsed(requirement: str) -> tuple[str, str]:
    """Name of a package, as indexes spell it, and the extra that asks for it; empty without one."""
    name = re.match(r"[\w.-]+", requirement)
    extra = re.search(r"extra\s*==\s*[\"']([\w.-]+)[\"']", requirement)
    assert name is not None
    return re.sub(r"[-_.]+", "-", name.group()).lower(), extra.group(1) if extra else ""


def list_() -> int:
    """Show the models, engines, comparisons and verification cases that there are."""
    console = terminal.console()
    console.print(terminal.two_columns("Models", {entry.name: entry.title for entry in library()}))
    console.print(terminal.two_columns("Manipulators", {entry.name: entry.title for entry in manipulators()}))
    console.print(terminal.two_columns("Closed loops", {entry.name: entry.title for entry in machines()}))
    console.print(terminal.two_columns("Engines", DESCRIPTIONS))
    console.print(terminal.two_columns("Comparisons of `validate all`", COMPARISONS))
    console.print(terminal.two_columns("Verification cases", {case.name: case.file.title for case in cases()}))
    return OK
