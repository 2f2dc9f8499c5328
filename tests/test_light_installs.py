"""What each light installation promises: nothing, each extra alone, all; run where nothing else can be imported.

An environment holds what `pip install 'vjm-stiffness[EXTRA]'` would bring: the versions that are installed here, as
links to their files. So it takes no network and some milliseconds. `.ci/run` installs for real, with an empty home.
"""

import importlib.metadata
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
OURS = ("vjm", "vjm_fea", "vjm_output", "vjm_updating", "vjm_validation")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BRACKET = ("--youngs", "70000", "--poisson", "0.33", "--base", "base", "--tip", "tip", "--accuracy", "20")
EXTRAS = {name for name in PROJECT["optional-dependencies"] if name not in ("docs", "test")}


def required(lines: Iterable[str], extras: Iterable[str]) -> Iterator[Requirement]:
    """Those of some requirements that hold here, with some extras asked for."""
    for line in lines:
        requirement = Requirement(line)
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            yield requirement


def closure(extras: Iterable[str]) -> set[str]:
    """Names of the distributions that the project needs with some extras, the project itself left out."""
    groups = PROJECT["optional-dependencies"]
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in groups[extra])]
    waiting, found = list(required(lines, ())), set()
    seen: set[tuple[str, frozenset[str]]] = set()
    while waiting:
        one = waiting.pop()
        name = re.sub(r"[-_.]+", "-", one.name).lower()
        if (name, frozenset(one.extras)) in seen:
            continue
        seen.add((name, frozenset(one.extras)))
        if name == "vjm-stiffness":
            waiting += [each for extra in one.extras for each in required(groups[extra], ())]
            continue
        found.add(name)
        waiting += required(importlib.metadata.requires(name) or (), one.extras)
    return found


def link(target: Path, site: Path) -> None:
    """A file or folder of a distribution in another environment; folders that several share are merged."""
    there = site / target.name
    if not there.exists():
        there.symlink_to(target)
    elif there.is_symlink() and there.resolve() != target.resolve() and target.is_dir():
        before = there.resolve()
        there.unlink()
        there.mkdir()
        for child in (*before.iterdir(), *target.iterdir()):
            link(child, there)
    elif there.is_dir() and not there.is_symlink():
        for child in target.iterdir():
            link(child, there)


def install(folder: Path, extras: Iterable[str]) -> Path:
    """Make an environment with the project and some extras; its interpreter."""
    venv.create(folder, with_pip=False, symlinks=True)
    site = folder / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
    for name in closure(extras):
        distribution = importlib.metadata.distribution(name)
        tops = {file.parts[0] for file in distribution.files or () if file.parts[0] not in ("..", "__pycache__")}
        for top in tops:
            link(Path(str(distribution.locate_file(top))), site)
        for file in distribution.files or ():
            # libraries of a whole environment, which the parts as solids load by name
            if file.parts[:2] == ("..", "..") and len(file.parts) == 3 and ".so" in file.name:
                link(Path(str(distribution.locate_file(file))).resolve(), folder / "lib")
    for name in OURS:
        spec = importlib.util.find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        # the compiled kernels beside the sources come along
        link(Path(spec.origin).parent, site)
    own = importlib.metadata.distribution("vjm-stiffness")
    information = next(Path(str(own.locate_file(file))) for file in own.files or () if file.name == "METADATA")
    link(information.parent, site)
    return folder / "bin/python"


def run(python: Path, *words: str, status: int = 0) -> subprocess.CompletedProcess[str]:
    """A command of the suite in an environment, and the status with which it has to end."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [str(python), "-m", "vjm_validation.cli.main", *words],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status, (words, done.stdout[-2000:], done.stderr[-2000:])
    assert "Traceback" not in done.stderr
    return done


def has(python: Path, module: str) -> bool:
    """Whether an environment can import a module."""
    return subprocess.run([str(python), "-c", f"import {module}"], capture_output=True, check=False).returncode == 0


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Nothing but what is always installed."""
    folder = tmp_path_factory.mktemp("bare")
    yield install(folder, ())
    shutil.rmtree(folder)


@pytest.fixture
def with_extra(tmp_path):
    def make(*extras: str) -> Path:
        return install(tmp_path / "environment", extras)

    return make


def test_a_bare_installation_is_bare(bare):
    for module in (
        "exudyn",
        "matplotlib",
        "pyvista",
        "jinja2",
        "gmsh",
        "skfem",
        "pandas",
        "distributed",
        "openseespy",
    ):
        assert not has(bare, module), module


def test_every_extra_is_asked_below():
    asked = {
        "fea", "report", "opensees", "cluster", "solid", "frame", "mjcf", "xacro", "descriptions", "explore", "all"
    }  # fmt: skip
    assert asked == EXTRAS


def test_without_extras_paths_stiffness_and_buckling(bare):
    shown = run(bare, "curve", "orthoglide-chain", "--posture", "A", "--to", "-4").stdout
    # the critical force of `docs/start.md`
    assert "bifurcation at 2.72324 mm, force 8849.14 N" in shown
    run(bare, "stiffness", "ur10", "--posture", "work", "--wrench", "0,0,-100,0,0,0")
    run(bare, "buckling", "pinned-column")
    run(bare, "check", "planar-2r")


@pytest.mark.slow
def test_without_extras_a_map_is_its_csv_and_says_what_is_left_out(bare, tmp_path):
    shown = run(bare, "map", "planar-2r", "--grid", "shoulder=0:1:3", "--out", str(tmp_path / "arm")).stdout
    assert len((tmp_path / "arm/map.csv").read_text().splitlines()) == 2 + 3
    assert "no map.png: it needs matplotlib: pip install 'vjm-stiffness[report]'" in shown
    shown = run(
        bare, "map", "orthoglide", "--grid", "x=0:50:2,y=0,z=0", "--jobs", "1", "--out", str(tmp_path / "platform")
    ).stdout
    assert len((tmp_path / "platform/map.csv").read_text().splitlines()) == 2 + 2
    assert "no map.vtr: it needs pyvista" in shown


@pytest.mark.slow
def test_without_extras_a_calibration_is_written(bare, tmp_path):
    run(bare, "example", "soft-springs", "--out", str(tmp_path / "example"))
    folder = tmp_path / "example"
    rows = (folder / "readings.csv").read_text().splitlines()
    # every twentieth reading: the installation is asked, not the accuracy
    (folder / "few.csv").write_text("\n".join([rows[0], *rows[1::20]]) + "\n")
    shown = run(
        bare,
        "calibrate",
        str(folder / "few.csv"),
        "--sheet",
        str(folder / "sheet.toml"),
        "--out",
        str(tmp_path / "out"),
    ).stdout
    assert "no page: it needs jinja2 and matplotlib: pip install 'vjm-stiffness[report]'" in shown
    document = json.loads((tmp_path / "out/calibration.json").read_text())
    assert document["versions"]["numpy"] == importlib.metadata.version("numpy")
    assert "exudyn" not in document["versions"]
    run(bare, "check", str(tmp_path / "out/calibrated-model.toml"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (("curve", "pinned-column", "--to", "-0.1", "--engine", "exudyn"), "fea"),
        (("curve", "pinned-column", "--to", "-0.1", "--engine", "opensees"), "opensees"),
        (("curve", "pinned-column", "--to", "-0.1", "--report", "page.html"), "report"),
        (("identify", "--solid", "part.step", *BRACKET), "solid"),
        (("explore", "planar-2r"), "explore"),
    ],
)
def test_what_an_extra_brings_is_refused_without_it(bare, words, extra, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "validation/vjm_validation/examples/parts/l-bracket.step", tmp_path / "part.step")
    said = run(bare, *words, status=2).stderr
    assert len(said.strip().splitlines()) == 1
    assert f"pip install 'vjm-stiffness[{extra}]'" in said
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_finite_elements_alone(with_extra):
    python = with_extra("fea")
    shown = run(python, "curve", "orthoglide-chain", "--posture", "A", "--to", "-4", "--engine", "exudyn").stdout
    # 8849.2 N is what converged beams give; 16 elements come within 3e-5
    found = re.search(r"bifurcation at [\d.]+ mm, force ([\d.]+) N", shown)
    assert found is not None
    assert float(found[1]) == pytest.approx(8849.1, rel=1e-4)


@pytest.mark.slow
def test_a_second_engine_alone(with_extra):
    python = with_extra("opensees")
    assert "opensees" in run(python, "curve", "pinned-column", "--to", "-0.1", "--engine", "opensees").stdout


@pytest.mark.slow
def test_reports_alone(with_extra, tmp_path):
    python = with_extra("report")
    page, figure = tmp_path / "page.html", tmp_path / "figure.png"
    drawn = ("--report", str(page), "--plot", str(figure))
    for words in (
        ("curve", "orthoglide-chain", "--posture", "A", "--to", "1"),
        ("buckling", "pinned-column"),
        ("stiffness", "ur10", "--posture", "work", "--wrench", "0,0,-100,0,0,0"),
        ("map", "planar-2r", "--grid", "shoulder=0:1:3", "--out", str(tmp_path / "map")),
    ):
        page.unlink(missing_ok=True)
        figure.unlink(missing_ok=True)
        run(python, *words, *drawn)
        assert "</html>" in page.read_text(), words
        assert figure.read_bytes().startswith(b"\x89PNG"), words
    run(python, "show", "ur10", "--out", str(page))


MJCF = """<mujoco model="one"><worldbody><body name="link"><joint name="turn" axis="0 1 0"/>
<geom size="0.1" mass="2"/></body></worldbody></mujoco>"""
XACRO = """<robot name="one" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="mass" value="2"/>
<link name="base"/><link name="link"><inertial><mass value="${mass}"/></inertial></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="link"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("extra", "text", "words"), [("mjcf", MJCF, ("robot.xml",)), ("xacro", XACRO, ("robot.xml", "--xacro"))]
)
def test_robots_files_alone(bare, with_extra, extra, text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.xml").write_text(text)
    assert f"pip install 'vjm-stiffness[{extra}]'" in run(bare, "import", *words, status=2).stderr
    run(with_extra(extra), "import", *words)
    model = tomllib.loads((tmp_path / "one.toml").read_text())
    assert sum(part.get("mass_kg", 0.0) for part in model["parts"]) == 2.0


@pytest.mark.slow
def test_described_robots_alone(bare, with_extra):
    words = ("import", "--from-description", "ur10e_description")
    assert "vjm-stiffness[descriptions]" in run(bare, *words, status=2).stderr
    # nothing is loaded from the network: what is not in the cache is refused
    assert "cache" in run(with_extra("descriptions"), *words, status=2).stderr


@pytest.mark.slow
def test_maps_on_a_cluster_alone(bare, with_extra, tmp_path):
    words = (
        "map",
        "orthoglide",
        "--grid",
        "x=0",
        "--scheduler",
        "tcp://127.0.0.1:9",
        "--out",
        str(tmp_path / "map"),
    )
    assert "vjm-stiffness[cluster]" in run(bare, *words, status=2).stderr
    assert "no Dask scheduler answers there" in run(with_extra("cluster"), *words, status=2).stderr


@pytest.mark.slow
def test_data_frames_alone(with_extra):
    python = with_extra("frame")
    program = (
        "import vjm; path = vjm.trace(vjm.load('pinned-column'), vjm.LoadCase('straight', to=-0.1));"
        "print(len(path.to_frame()) == len(path.points))"
    )
    done = subprocess.run([str(python), "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"


@pytest.mark.slow
def test_parts_as_solids_alone(with_extra):
    python = with_extra("solid")
    drawing = str(ROOT / "validation/vjm_validation/examples/parts/l-bracket.step")
    shown = run(python, "identify", "--solid", drawing, *BRACKET).stdout
    # the bracket's two legs are no uniform beam: what its page in the examples says
    assert "no uniform beam is like this part" in shown


@pytest.mark.slow
def test_everything(with_extra):
    python = with_extra("all")
    assert {
        name for name in ("exudyn", "matplotlib", "gmsh", "pandas", "distributed") if not has(python, name)
    } == set()
    run(python, "curve", "orthoglide-chain", "--posture", "A", "--to", "-4", "--engine", "exudyn")


def test_whatever_is_installed_is_a_wheel():
    """A source archive would be built by tools that a fresh machine lacks; with this option pip refuses it."""
    for file in ("Makefile", ".ci/other-interpreters"):
        lines = (ROOT / file).read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
        defined = [line for line in lines if re.search(r"^\s*(PIP_INSTALL\s*=|wheels=\()", line)]
        assert len(defined) == 1
        assert "--only-binary :all:" in defined[0]
        # nothing is installed but by that definition; `make lock` resolves and installs nothing that is used
        others = [line for line in lines if re.search(r"pip install|pip\[@\]", line) and line not in defined]
        assert all("wheels[@]" in line or "-lock" in line for line in others), others
