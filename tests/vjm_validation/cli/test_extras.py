"""A command says which optional extra it lacks, and what needs none runs without them."""

import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata, resources
from pathlib import Path

import pytest
from helpers.command import validate
from helpers.solids import gmsh_or_skip

from vjm_validation.cli.list import COPYLEFT, REMARKS, brought, by_extra, permissive, stated
from vjm_validation.cli.main import EXTRAS, missing_extra

BLOCKED = (
    "exudyn",
    "matplotlib",
    "pyvista",
    "vtk",
    "jinja2",
    "openseespy",
    "distributed",
    "pandas",
    "mujoco",
    "xacro",
    "robot_descriptions",
)
SOLID = ("gmsh", "skfem", "pypardiso")
SOLID_WORDS = ["--youngs", "70000", "--poisson", "0.33", "--base", "base", "--tip", "tip"]
PARTS = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"
WITHOUT = """
import sys
for name in %r:
    sys.modules[name] = None
from vjm_validation.cli.main import run
sys.exit(run(sys.argv[1:]))
"""


def bare(*arguments, without=(*BLOCKED, *SOLID)):
    return subprocess.run([sys.executable, "-c", WITHOUT % (without,), *arguments], capture_output=True, text=True)


@pytest.mark.slow
def test_a_path_needs_no_extra():
    done = bare("curve", "orthoglide-chain", "--posture", "A", "--to", "1", "--engine", "vjm-paper")
    assert done.returncode == 0, done.stderr
    assert "bifurcation" in done.stdout


@pytest.mark.slow
def test_a_part_from_its_drawing_needs_the_extra_solid_alone():
    gmsh_or_skip()
    words = [*SOLID_WORDS, "--accuracy", "20", "--json"]
    done = bare("identify", "--solid", str(PARTS / "l-bracket.step"), *words, without=BLOCKED)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["volume_mm3"] > 0.0
    # the list stands before the picture, for which the extra `report` is needed
    assert "tip" in bare("show", str(PARTS / "l-bracket.step"), without=BLOCKED).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("solid", ["identify", "--solid", str(PARTS / "l-bracket.step"), *SOLID_WORDS]),
        ("solid", ["show", str(PARTS / "l-bracket.step")]),
        ("solid", ["check", str(PARTS / "bracket-arm.toml")]),
        ("fea", ["curve", "orthoglide-chain", "--posture", "A", "--to", "1", "--engine", "exudyn"]),
        ("report", ["curve", "orthoglide-chain", "--posture", "A", "--to", "1", "--plot", "path.png"]),
    ],
)
def test_a_command_names_the_extra_that_it_lacks(extra, arguments):
    done = bare(*arguments)
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("validate:")]
    assert f"vjm-stiffness[{extra}]" in line


@pytest.mark.slow
def test_a_calibration_without_what_draws_writes_all_but_its_page(tmp_path):
    (tmp_path / "calibration.html").write_text("of an earlier run")
    folder = resources.files("vjm_validation") / "examples/soft-springs"
    done = bare(
        "calibrate", str(folder / "readings.csv"), "--sheet", str(folder / "sheet.toml"), "--out", str(tmp_path)
    )
    assert done.returncode == 0, done.stderr
    assert "no page: it needs jinja2 and matplotlib: pip install 'vjm-stiffness[report]'" in done.stdout
    assert {file.name for file in tmp_path.iterdir()} == {"calibration.json", "calibrated-model.toml"}


@pytest.mark.slow
@pytest.mark.parametrize("command", ["diagnose", "compensate", "compare", "list"])
def test_a_command_is_loaded_without_an_extra(command):
    done = bare(command, "--help")
    assert done.returncode == 0, done.stderr
    assert f"validate {command}" in done.stdout


def test_an_unknown_module_is_no_extra():
    assert not missing_extra(ModuleNotFoundError("No module named 'abc1'", name="abc1"))


def test_every_extra_is_one_of_the_project():
    root = Path(__file__).parents[3]
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(EXTRAS.values()) <= set(project)
    # modules that a project of another name brings
    brought_by = {"vtk": "pyvista", "skfem": "scikit_fem"}
    for module, extra in EXTRAS.items():
        names = [re.split(r"[^\w-]", line)[0].replace("-", "_") for line in project[extra]]
        assert brought_by.get(module, module) in names, f"{module} is not in [{extra}]"


# What is said of the licences of packages holds of those that are installed.


START = Path(__file__).parents[3] / "docs/start.md"


def test_the_command_lists_every_package_of_every_extra():
    out = validate("--version", "--licences").out
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


def test_gmsh_and_opensees_are_named():
    out = validate("--licences").out
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
