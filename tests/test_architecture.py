"""The house keeps its shape: which way imports point, what an install holds, what a file may not say."""

import ast
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from helpers.source_trees import parsed

import vjm

ROOT = Path(__file__).parents[1]
SOURCES = {
    "vjm": ROOT / "src/vjm",
    "vjm_output": ROOT / "src/vjm_output",
    "vjm_updating": ROOT / "src/vjm_updating",
    "vjm_fea": ROOT / "fea/vjm_fea",
    "vjm_validation": ROOT / "validation/vjm_validation",
}
TEST_BENCH = ROOT / "tests/hidden_effects"

# What a package may import besides itself and the standard library. Its absence from this table is what
# forbids a name: `vjm_fea` in `vjm`, say, or `tests` anywhere.
MAY_IMPORT = {
    "vjm": {"numpy", "scipy", "numba", "threadpoolctl"},
    # pydantic's error types live in its core
    "vjm.io": {"numpy", "scipy", "pydantic", "pydantic_core", "mujoco", "xacro", "robot_descriptions"},
    # what it shows results with, imported when asked
    "vjm.outcome": {"numpy", "matplotlib", "pandas"},
    "vjm_output": {"vjm", "numpy", "pydantic", "matplotlib", "pyvista", "jinja2", "markupsafe", "rich"},
    "vjm_fea": {"vjm", "numpy", "scipy", "exudyn", "openseespy", "gmsh", "skfem", "pypardiso"},
    "vjm_updating": {
        *("vjm", "vjm_output", "vjm_fea", "numpy", "scipy", "numba", "pydantic"),
        *("matplotlib", "pyvista", "rich", "distributed"),
    },
    "vjm_validation": {
        *("vjm", "vjm_output", "vjm_fea", "vjm_updating", "numpy", "scipy", "pydantic"),
        *("matplotlib", "pyvista", "cyclopts", "rich", "viser", "websockets", "msgspec"),
    },
}
LONGEST_MODULE = 900
MOST_MODULES = 350
LARGEST_SHARE_OF_IMPORTS = 0.09
"""Of the lines of code. Packages of other authors have 2 to 8 %; commands, which share many options, have more."""
# Paths of one machine and hosts of package registries: true where they were written and nowhere else.
LOCAL_NAMES = re.compile(
    r"(?<![\w.~-])/(?:work|root|farm)/|(?<![\w.~-])/home/\w|/tmp/(?:probe|bash_)|/opt/(?:pypi|wheels)"
    r"|\bpypi\.|pythonhosted\.org|\bdeb\.debian\.org|registry\.npmjs"
)
# Files that have to name them: this one.
MAY_NAME_LOCAL = {"tests/test_architecture.py"}


def imported_names(source: str, module: str, *, is_package: bool = False) -> set[str]:
    """Full names of the modules that a source imports, wherever in it the import stands."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import():
                names.update(alias.name for alias in node.names)
            case ast.ImportFrom(level=0):
                names.add(str(node.module))
            case ast.ImportFrom():
                package = module.split(".") if is_package else module.split(".")[:-1]
                base = package[: len(package) - node.level + 1]
                names.add(".".join([*base, *([node.module] if node.module else [])]))
            case ast.Call(
                func=ast.Name(id="__import__" | "import_module") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                names.add(name)
    return names


def forbidden_imports(source: str, module: str, *, is_package: bool = False) -> set[str]:
    """The imported names that the table does not allow in this module."""
    package = module.split(".")[0]
    nearest = max((key for key in MAY_IMPORT if f"{module}.".startswith(f"{key}.")), key=len)
    allowed = {package, *MAY_IMPORT[nearest], *sys.stdlib_module_names}
    names = imported_names(source, module, is_package=is_package)
    return {name for name in names if name.split(".")[0] not in allowed}


def installed(package: str) -> Path:
    """The folder from which the package is imported."""
    spec = importlib.util.find_spec(package)
    assert spec is not None, f"{package} is not installed"
    assert spec.origin is not None, f"{package} has no __init__.py"
    return Path(spec.origin).parent


def files_in(folder: Path) -> set[str]:
    """Every file below a folder, relative to it, without the interpreter's caches."""
    files = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return {file.as_posix() for file in files if "__pycache__" not in file.parts}


@pytest.mark.slow
@pytest.mark.parametrize("package", SOURCES)
def test_imports_point_one_way(package: str):
    folder = installed(package)
    offences = []
    for path in sorted(folder.rglob("*.py")):
        parts = (package, *path.relative_to(folder).with_suffix("").parts)
        is_package = parts[-1] == "__init__"
        module = ".".join(parts[:-1] if is_package else parts)
        forbidden = forbidden_imports(path.read_text(encoding="utf-8"), module, is_package=is_package)
        offences += [f"{module} imports {name}" for name in sorted(forbidden)]
    assert offences == []


@cache
def trees() -> dict[str, ast.Module]:
    """Every module of the packages as it is parsed, by its name."""
    found = {}
    for package, folder in SOURCES.items():
        for path in folder.rglob("*.py"):
            parts = (package, *path.relative_to(folder).with_suffix("").parts)
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = parsed(path)
    return found


def circle_of(imports: dict[str, set[str]]) -> list[str]:
    """Modules that import one another in a circle, the first one again at the end; empty where there is none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_import_one_another_in_a_circle():
    """Imports for types and inside functions count, too: who is read first must be clear."""
    sources, imports = trees(), dict[str, set[str]]()
    for module, tree in sources.items():
        found = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                several = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= {name if name in sources else str(node.module) for name in several}
        # the package's face imports what it shows when it is asked for, and everything may ask its version
        imports[module] = found & sources.keys() - {module} if module != "vjm" else set()
    assert len(imports) > 200
    assert circle_of(imports) == []


def test_a_circle_is_found():
    assert set(circle_of({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})) == {"a", "b", "c"}


def test_offending_imports_are_found():
    source = """
from __future__ import annotations
import math, numpy.linalg
from typing import TYPE_CHECKING
from . import parts
from .io import read
from scipy.linalg import solve
if TYPE_CHECKING:
    from vjm_fea.beams import Beam
def late():
    import exudyn as exu
    from tests.conftest import chain
    from ..outside import name
    importlib.import_module("vjm_validation.cases")
    __import__("pydantic")
"""
    assert forbidden_imports(source, "vjm.made_up") == {
        *("vjm_fea.beams", "exudyn", "tests.conftest", "outside", "vjm_validation.cases", "pydantic")
    }
    assert "pydantic" not in forbidden_imports(source, "vjm.io.made_up")
    assert forbidden_imports("import vjm_validation, vjm", "vjm_fea.made_up") == {"vjm_validation"}
    assert forbidden_imports("import vjm_fea, vjm", "vjm_validation", is_package=True) == set()
    # A name that only begins like an allowed one.
    assert forbidden_imports("import pydantic", "vjm.iota") == {"pydantic"}


@pytest.mark.parametrize(("package", "folder"), SOURCES.items())
def test_install_holds_every_file_of_the_source(package: str, folder: Path):
    files = files_in(installed(package))
    assert files == files_in(folder)
    assert "py.typed" in files


def test_no_file_of_the_test_bench_is_installed():
    """The wheel holds what the packages' folders hold, and none of these is the test bench's."""
    assert importlib.metadata.version("vjm-stiffness")
    bench = {path.name for path in TEST_BENCH.glob("*.py")} - {"__init__.py", "__main__.py"}
    listed = importlib.metadata.files("vjm-stiffness") or []
    assert [file for file in listed if "hidden_effects" in file.parts] == []
    assert len(bench) > 20


def test_model_files_are_installed():
    models = {path.stem for path in (installed("vjm") / "models").glob("*.toml")}
    assert {"orthoglide-chain", "pinned-column"} <= models


def test_validate_is_a_command():
    (command,) = importlib.metadata.entry_points(group="console_scripts", name="validate")
    assert command.value == "vjm_validation.cli.main:main"


def test_one_version_everywhere():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert importlib.metadata.version("vjm-stiffness") == vjm.__version__
    assert f"\nversion: {vjm.__version__}\n" in citation


SHARED_NAMES = {
    "AppliedLoads": "wrenches on bodies as a load case says; finite elements pack them for themselves",
}
"""Classes that two modules have, and why one name is right: it is one concept. The list may only become shorter."""


def test_no_more_classes_share_a_name():
    names: dict[str, int] = {}
    for tree in trees().values():
        for name in (node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)):
            names[name] = names.get(name, 0) + 1
    assert {name for name, count in names.items() if count > 1} == SHARED_NAMES.keys()


@pytest.mark.parametrize("package", SOURCES)
def test_no_product_module_is_named_like_a_test(package: str):
    """`pytest` collects `test_*.py` and `*_test.py` wherever it is pointed."""
    assert [path.name for path in SOURCES[package].rglob("*.py") if re.search(r"^test_|_test$", path.stem)] == []


def test_modules_fit_in_one_reading():
    folders = [*SOURCES.values(), ROOT / "tests"]
    lengths = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for folder in folders
        for path in folder.rglob("*.py")
    }
    long = {name: length for name, length in lengths.items() if length > LONGEST_MODULE}
    assert long == {}


def test_the_house_is_no_larger_than_it_is_said_to_be():
    """Prints what it counts: ``pytest -s -k no_larger``."""
    modules, lines, code, imports = 0, 0, 0, 0
    for package, folder in SOURCES.items():
        files = list(folder.rglob("*.py"))
        texts = [path.read_text(encoding="utf-8") for path in files]
        counts = [_lines_of_code(text, parsed(path)) for text, path in zip(texts, files, strict=True)]
        print(f"{package}: {len(texts)} modules, {sum(text.count(chr(10)) for text in texts)} lines")
        modules += len(texts)
        lines += sum(text.count("\n") for text in texts)
        code += sum(whole for whole, _ in counts)
        imports += sum(part for _, part in counts)
    print(f"together: {modules} modules, {lines} lines; imports are {imports / code:.1%} of {code} lines of code")
    assert modules <= MOST_MODULES
    assert 0.0 < imports / code <= LARGEST_SHARE_OF_IMPORTS


def _lines_of_code(source: str, tree: ast.Module) -> tuple[int, int]:
    """Lines that are neither blank, comment nor docstring, and those of them that import."""
    left_out, imports = set[int](), set[int]()
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        elif isinstance(node, ast.Import | ast.ImportFrom):
            imports.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    rows = enumerate(source.splitlines(), start=1)
    code = {k for k, row in rows if row.strip() and not row.lstrip().startswith("#")} - left_out
    return len(code), len(imports & code)


def test_lines_of_code_are_counted():
    source = '"""Text."""\n\nimport a\nfrom b import (\n    c,\n)\n# why\nx = 1  # so\n'
    assert _lines_of_code(source, ast.parse(source)) == (5, 4)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="git knows which files count; this is no checkout")
def test_no_file_names_one_machine_or_a_registry():
    # A checkout may belong to someone else than who runs the tests, in a container for example.
    command = ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout.decode().split("\0")
    names = (name for name in listed if name and name not in MAY_NAME_LOCAL and (ROOT / name).is_file())
    offences = [
        f"{name}: {found.group()}"
        for name in names
        for found in LOCAL_NAMES.finditer((ROOT / name).read_text(encoding="utf-8", errors="ignore"))
    ]
    assert offences == []


@pytest.mark.parametrize("text", ["see /work/main/a.py", "'/root/x'", "/tmp/probe/v", "https://pypi.org/simple"])
def test_names_of_one_machine_are_found(text: str):
    assert LOCAL_NAMES.search(text)


@pytest.mark.parametrize("text", ["https://example.org/work/1", "frame/work/x", "~/work/x", "PyPI.", "home/a"])
def test_ordinary_names_are_let_through(text: str):
    assert not LOCAL_NAMES.search(text)


PAGES = [
    ROOT / "README.md",
    *sorted(
        page for folder in ("", "tutorials", "theory", "how-well") for page in (ROOT / "docs" / folder).glob("*.md")
    ),
]


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_files_that_a_page_names_are_there(page: Path):
    text = page.read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:src|fea|validation|tests|docs)/[\w/.-]+)`", text))
    linked = {link for link in re.findall(r"\]\(([\w/.-]+)(?:#[\w-]*)?\)", text) if "." in link}
    missing = {name for name in named if not (ROOT / name).exists()}
    missing |= {link for link in linked if not _program(page.parent / link).exists()}
    assert missing == set()


def _program(link: Path) -> Path:
    """What a link leads to; for a page or figure of the gallery, which the builder makes, the program behind it."""
    if "gallery_built" not in link.parts:
        return link
    folder = next(parent for parent in link.parents if parent.name == "gallery_built")
    if link.stem == "index":
        return folder.with_name("gallery") / "README.rst"
    made = re.sub(r"^sphx_glr_(\w+?)_(\d+|thumb)$", r"\1", link.stem)
    return folder.with_name("gallery") / f"{made}.py"


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_modules_that_a_page_names_are_there(page: Path):
    names = set(re.findall(r"\b(vjm(?:_\w+)?(?:\.[a-z_]+)+)", page.read_text(encoding="utf-8")))
    assert {name for name in names if not _is_there(name)} == set()


def _is_there(name: str) -> bool:
    """Whether it is a module of the suite, or something in one."""
    try:
        if importlib.util.find_spec(name) is not None:
            return True
    except ModuleNotFoundError:
        pass
    module, _, attribute = name.rpartition(".")
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        return False
    return spec is not None and hasattr(importlib.import_module(module), attribute)
