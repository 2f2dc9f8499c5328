"""Every tutorial does what it says: its commands run in their order, and print the lines that it shows.

So does the page about robots' files.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from helpers.as_pinocchio import ROBOTS
from helpers.command import validate

from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.robot_file import Description, import_robot
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism

DOCS = Path(__file__).parents[1] / "docs"
PAGES = [*sorted((DOCS / "tutorials").glob("*.md")), DOCS / "your-robot.md"]
EXAMPLES = DOCS.parent / "validation/vjm_validation/examples"
FENCE = re.compile(r"^```")
FIGURE = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
LAST_BUT_ONE = 5.5
"""Units of a figure's last digit: half of the digit before it, and the rounding of what is shown."""
LONG = {
    "bench", "hidden-cause", "own-effect", "ur10", "ur10-series", "part-to-spring", "calibrate", "table2", "fanuc",
}  # fmt: skip
"""Tutorials that fit, or ask finite elements, which takes minutes."""


@dataclass
class Step:
    """A command of a tutorial, with the files that the page gives before it and the lines that it shows behind."""

    words: list[str]
    shown: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)


def steps_of(text: str) -> list[Step]:
    """The commands of a page in their order."""
    steps: list[Step] = []
    files: dict[str, str] = {}
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("    validate "):
            steps.append(Step(line.split()[1:], files=files))
            files = {}
        elif FENCE.match(line):
            head = [line]
            body: list[str] = []
            for inner in lines:
                if FENCE.match(inner):
                    break
                (head if inner.startswith(":") and not body else body).append(inner)
            caption = next((h.split()[1] for h in head if h.startswith(":caption:")), "")
            if caption:
                files[caption] = "\n".join(body) + "\n"
            elif head[0] == "```text" and steps:
                steps[-1].shown += [each for each in body if each.strip()]
    return steps


def words_of(line: str) -> str:
    """A line without its figures, its spaces and the frame of a table."""
    return re.sub(r"[\s│┃─━]+", " ", FIGURE.sub("#", line)).strip()


def figures_of(line: str) -> list[tuple[float, float]]:
    """The figures of a line, each with the unit of its last digit."""
    found = []
    for word in FIGURE.findall(line):
        number, _, power = word.replace("−", "-").partition("e")
        decimals = len(number.partition(".")[2])
        found.append((float(f"{number}e{power or 0}"), 10.0 ** (int(power or 0) - decimals)))
    return found


def alike(shown: str, printed: str) -> bool:
    """Whether a printed line begins like the shown one, to the last digit but one of its figures.

    A page may leave out the end of a line, such as the last columns of a wide table.
    """
    begun, whole = words_of(shown), words_of(printed)
    if not whole.startswith(begun) or whole[len(begun) : len(begun) + 1].isalnum():
        return False
    pairs = zip(figures_of(shown), figures_of(printed), strict=False)
    return all(abs(a - b) <= LAST_BUT_ONE * unit for (a, unit), (b, _) in pairs)


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=page.stem, marks=pytest.mark.slow if page.stem in LONG else ()) for page in PAGES],
)
def test_a_tutorials_figures_are_those_that_its_commands_print(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    steps = steps_of(page.read_text(encoding="utf-8"))
    assert steps
    turned = []
    for step in steps:
        for file, text in step.files.items():
            (tmp_path / file).write_text(text, encoding="utf-8")
        done = validate(*step.words, status=None)
        refused = any(line.startswith("no model file was written") for line in step.shown)
        assert done.status == int(refused), f"validate {' '.join(step.words)}: {done.err}"
        printed = (done.out + done.err).splitlines()
        turned += [line for line in step.shown if not any(alike(line, other) for other in printed)]
    assert turned == []


def test_a_figure_that_turned_is_seen():
    assert alike("F = 8849 N (bifurcation)", "F = 8852 N  (bifurcation)")
    assert not alike("F = 8849 N (bifurcation)", "F = 8861 N (bifurcation)")
    assert not alike("F = 8849 N (bifurcation)", "F = 8849 N (limit)")
    assert figures_of("0.87 ± 0.39 at −2e-3") == [(0.87, 0.01), (0.39, 0.01), (-2e-3, 1e-3)]


# --- the robots of docs/your-robot.md are the published ones --------------------------------------------------

ROUNDED = 1e-9
"""mm: what some ten products of doubles leave of an arm of 3 m."""


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    """A folder with the files that the page gives."""
    for step in steps_of((DOCS / "your-robot.md").read_text(encoding="utf-8")):
        for file, text in step.files.items():
            (tmp_path / file).write_text(text, encoding="utf-8")
    return tmp_path


def flange(machine: Machine, q: Sequence[float]) -> np.ndarray:
    """Frame ``(4, 4)`` of the last part, mm, in the world."""
    names = [joint.name for joint in machine.held_joints]
    model = Mechanism(machine.locked(dict(zip(names, map(float, q), strict=True))))
    return model.kinematics(model.configuration(np.zeros(0))).end


def test_the_panda_of_the_page_is_that_of_its_urdf(robots):
    found = import_robot(Description(robots / "panda.csv"))
    machine = build_chain(found.document, "panda.csv")
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / "panda_description/urdf/panda.urdf"))
    data, rng = model.createData(), np.random.default_rng(0)
    low, high = model.lowerPositionLimit[:7], model.upperPositionLimit[:7]
    assert np.array([joint.limits for joint in machine.held_joints]) == pytest.approx(np.array([low, high]).T)
    for _ in range(5):
        q = pinocchio.neutral(model)
        q[:7] = rng.uniform(low, high)
        pinocchio.framesForwardKinematics(model, data, q)
        place = data.oMf[model.getFrameId("panda_link8")]
        end = flange(machine, q[:7])
        assert end[:3, 3] == pytest.approx(1e3 * place.translation, abs=ROUNDED)
        assert end[:3, :3] == pytest.approx(place.rotation, abs=ROUNDED)


def test_the_fanuc_of_the_page_is_that_of_the_readings(robots):
    """Frames and compliances of the example's model file, whose numbers have four digits."""
    found = import_robot(Description(robots / "fanuc.csv"))
    machine = build_chain(found.document, "fanuc.csv")
    example = load_model(str(EXAMPLES / "fanuc-deflections/fanuc-r2000ic.toml"))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, 6)
    assert flange(machine, q) == pytest.approx(flange(example, q), abs=ROUNDED)
    given = [joint.compliance for joint in example.held_joints]
    assert [joint.compliance for joint in machine.held_joints] == pytest.approx(given, rel=1e-4)
