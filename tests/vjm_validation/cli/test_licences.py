"""What is said of the licences of packages holds of those that are installed."""

import re
from importlib import metadata
from pathlib import Path

import pytest

from vjm_validation.cli.list import COPYLEFT, REMARKS, brought, by_extra, permissive, stated
from vjm_validation.cli.main import EXTRAS, run

START = Path(__file__).parents[3] / "docs/start.md"


def test_the_command_lists_every_package_of_every_extra(capsys):
    assert run(["--version", "--licences"]) == 0
    out = capsys.readouterr().out
    assert by_extra().keys() == {"", *EXTRAS.values()}
    for extra, names in by_extra().items():
        for name in names:
            (row,) = re.findall(rf"│ {extra or 'none'} +│ {name} +│ (.*) │", out)
            try:
                assert row.split()[0] == metadata.version(name)
            except metadata.PackageNotFoundError:
                assert row.startswith("not installed")


def test_what_is_not_permissive_has_a_remark():
    names = {name for names in by_extra().values() for name in names}
    assert names >= REMARKS.keys()
    said = {name: found[1] for name in names if (found := stated(name)) is not None}
    assert {name for name, licence in said.items() if not permissive(licence)} <= REMARKS.keys()


def test_gmsh_and_opensees_are_named(capsys):
    assert run(["--licences"]) == 0
    out = capsys.readouterr().out
    assert "gmsh: GPL 2 or later" in out
    assert "openseespy: free for research, education and internal use." in out
    if (found := stated("gmsh")) is not None:
        assert COPYLEFT.search(found[1])


@pytest.mark.parametrize(
    ("licence", "free"),
    [
        ("BSD-3-Clause", True),
        ("MIT License", True),
        ("Apache-2.0", True),
        ("GNU General Public License v2 or later (GPLv2+)", False),
        ("LGPL-2.1", False),
        ("MPL-2.0 AND MIT", False),
        ("Other/Proprietary License", False),
        ("see its own text", False),
    ],
)
def test_kinds_of_licences(licence, free):
    assert permissive(licence) is free


def test_what_packages_bring_is_followed():
    # pydantic's core is a package of its own, and asks for one more
    assert {"pydantic", "pydantic-core", "typing-extensions"} <= brought(["pydantic"])


def test_the_page_has_a_row_for_every_extra():
    rows = re.findall(r"^\| (?:`([\w-]+)`|none) \| .* \| (.*) \|$", START.read_text(encoding="utf-8"), re.M)
    assert {extra for extra, _ in rows} == by_extra().keys()
    assert "GPL" in dict(rows)["solid"]
    for extra, names in by_extra().items():
        said = [found[1] for name in names if (found := stated(name)) is not None]
        if any(COPYLEFT.search(licence) for licence in said):
            assert COPYLEFT.search(dict(rows)[extra]), extra
