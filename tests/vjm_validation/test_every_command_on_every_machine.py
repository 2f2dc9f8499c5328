"""Every command on five kinds of machines: it works, or refuses in one line with a physical reason.

The tables of ``docs/limits.md`` are made here, of the refusals of engines and of commands.
"""

from dataclasses import dataclass
from pathlib import Path

import pytest
from helpers.command import Finished, validate
from helpers.file_texts import model_text, part_text, section_of

from vjm.limits import LIMITS
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm_validation.load_any_model import loaded

KINDS = ("chain", "arm", "tree", "platform", "machine with closed loops")
CHAIN, ARM, TREE, PLATFORM, LOOPS = KINDS

TUBE = section_of("square_tube", 40.0, 3.0, density=2700.0)
FORK = model_text(
    "fork",
    part_text("actuated", "pan", axis="z", compliance_rad_per_Nmm=1e-8),
    part_text("beam", "stem", length_mm=300.0, section=TUBE),
    part_text("actuated", "right", axis="x", compliance_rad_per_Nmm=2e-8),
    part_text(
        "link", "counter", translation_mm=[0.0, 200.0, 100.0], mass_kg=2.0, centre_of_mass_mm=[0.0, 200.0, 100.0]
    ),
    part_text("actuated", "left", after="stem", axis="y", compliance_rad_per_Nmm=5e-8),
    part_text("beam", "hand", length_mm=250.0, section=TUBE),
    postures={"home": {"pan": 0.2, "left": 0.4, "right": -0.3}},
)
SHEET = """[test]
model = "x"
control = "{control}"
[instrument.{gauge}]
noise = 0.001
[instrument.{load}]
noise = {noise}
"""


@dataclass(frozen=True)
class Asked:
    """A machine and what is asked of it."""

    model: str
    posture: str
    place: str
    grid: str


MACHINES = {
    CHAIN: Asked("pinned-column", "straight", "299.085,0,0", "x=0:1:2"),
    ARM: Asked("planar-2r", "bent", "600,300,0", "elbow=0.5:1:2"),
    TREE: Asked("fork.toml", "home", "519.69524745,105.34744206,-97.35458558", "left=0.3:0.5:2"),
    PLATFORM: Asked("orthoglide", "isotropic", "2,1,0", "x=-5:5:2,y=0,z=0"),
    LOOPS: Asked("palletiser", "home", "987,0,890", "shoulder=-1.3:-1.25:2"),
}
FREE = ("--free", "x,y,z,rx,ry,rz", "--force")
QUICK = {
    "check": ("check", "{model}"),
    "show": ("show", "{model}", "--out", "view.html"),
    "curve": ("curve", "{model}", "--posture", "{posture}", "--to", "0.2", "--steps", "2", "--engine", "vjm-2"),
    "curve of a force": ("curve", "{model}", "--posture", "{posture}", "--to", "1", *FREE, "--steps", "2",
                         "--engine", "vjm-2"),
    "buckling": ("buckling", "{model}", "--posture", "{posture}", "--to", "0.2", "--direction=-",
                 "--engine", "vjm-2"),
    "stiffness": ("stiffness", "{model}", "--posture", "{posture}", "--engine", "vjm-2"),
    "stiffness under weight": ("stiffness", "{model}", "--posture", "{posture}", "--gravity", "0,0,-9.81",
                               "--engine", "vjm-2"),
    "map of stiffness": ("map", "{model}", "--grid", "{grid}", "--engine", "vjm-2", "--out", "stiff"),
    "map of deflection": ("map", "{model}", "--grid", "{grid}", "--engine", "vjm-2", "--quantity", "deflection",
                          "--wrench", "5,5,5", "--out", "moved"),
    "map of frequencies": ("map", "{model}", "--grid", "{grid}", "--engine", "vjm-2", "--quantity", "frequency",
                           "--out", "frequencies"),
    "map of shares": ("map", "{model}", "--grid", "{grid}", "--engine", "vjm-2", "--quantity", "shares",
                      "--wrench", "5,5,5", "--out", "shares"),
    "postures": ("postures", "{model}", "--tool", "{tool}"),
}  # fmt: skip
SLOW = {
    "map of critical forces": ("map", "{model}", "--grid", "{grid}", "--engine", "vjm-2", "--quantity", "critical",
                               "--out", "critical"),
    "compensate": ("compensate", "{model}", "path.csv", "--gravity", "0,0,-9.81", "--engine", "vjm-2"),
    "all": ("all", "{model}", "--posture", "{posture}", "--direction", "x", "--out", "run"),
}  # fmt: skip


@dataclass(frozen=True)
class Refusal:
    """What a command does not take."""

    commands: tuple[str, ...]
    kind: str
    said: str
    why: str


REFUSALS = (
    Refusal(
        (
            "map of stiffness", "map of deflection", "map of critical forces", "map of frequencies",
            "map of shares",
        ), CHAIN,
        "its passive joints leave the end a mechanism",
        "its passive joints let the end move without straining a spring: only an imposed pose holds it",
    ),
    Refusal(
        ("compensate",), CHAIN, "its passive joints leave the end a mechanism",
        "no drive holds its end: under a force it is a mechanism",
    ),
    Refusal(
        ("curve of a force",), CHAIN, "is a mechanism: it moves without straining a spring",
        "with all components free it is a mechanism",
    ),
    Refusal(
        ("stiffness under weight",), CHAIN, "no equilibrium under these loads",
        "it has no weight that would hold it; `curve --gravity` has it with the pose held",
    ),
)  # fmt: skip


def refusal_of(command: str, kind: str) -> Refusal | None:
    return next((each for each in REFUSALS if kind == each.kind and command in each.commands), None)


def judged(command: str, kind: str, finished: Finished) -> None:
    """A command works and says something, or refuses in one line as it is listed."""
    refusal = refusal_of(command, kind)
    # what is doubtful about a file is said beside
    lines = [line for line in finished.err.splitlines() if line.strip() and "warning:" not in line]
    if refusal is None:
        assert finished.status == 0, finished.err
        assert finished.out.strip()
        return
    assert finished.status == 2
    assert [refusal.said in line for line in lines if "━" not in line] == [True]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fork.toml").write_text(FORK)
    return tmp_path


def words(command: tuple[str, ...], asked: Asked, tool: str) -> list[str]:
    named = {"model": asked.model, "posture": asked.posture, "grid": asked.grid, "tool": tool}
    return [word.format(**named) for word in command]


def tool_of(kind: str, asked: Asked) -> str:
    """Where the tool is to be, in the world."""
    if kind != PLATFORM:
        return asked.place
    machine = loaded(asked.model)
    home = LoopClosure(machine, home_label(machine)).end[:3, 3]
    return ",".join(f"{a + float(b):.6f}" for a, b in zip(home, asked.place.split(","), strict=True))


@pytest.mark.quick_cases(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", QUICK)
def test_a_quick_command(command: str, kind: str, folder: Path):
    asked = MACHINES[kind]
    judged(command, kind, validate(*words(QUICK[command], asked, tool_of(kind, asked)), status=None))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", SLOW)
def test_a_slow_command(command: str, kind: str, folder: Path):
    asked = MACHINES[kind]
    (folder / "path.csv").write_text(f"x_mm,y_mm,z_mm\n{asked.place}\n")
    judged(command, kind, validate(*words(SLOW[command], asked, tool_of(kind, asked)), status=None))


@pytest.mark.slow
@pytest.mark.parametrize("control", ["displacement", "force"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_simulated_test_is_calibrated_and_diagnosed(kind: str, control: str, folder: Path):
    asked = MACHINES[kind]
    of_force = control == "force"
    if kind == CHAIN and of_force:
        # all but the driven component is held: else it is a mechanism
        control += '"\nheld = ["y", "z", "rx", "ry", "rz"]\n#"'
    (folder / "sheet.toml").write_text(SHEET.format(control=control, gauge="ux_mm", load="fx_N", noise=0.1))
    # a straight column is pressed by six tenths of its critical load: less moves its end by the gauge's noise
    load = 300 if kind == CHAIN else 20
    ramp = f"{asked.posture}:x:{load if of_force else 0.2}"
    judged(
        "simulate",
        kind,
        validate("simulate", asked.model, "--test", "sheet.toml", "--ramp", ramp, "--out", "made", status=None),
    )
    data, sheet = "made/readings.csv", "made/sheet.toml"
    for command in ("calibrate", "diagnose"):
        judged(command, kind, validate(command, data, "--sheet", sheet, "--out", command, status=None))


# --- the docs ---------------------------------------------------------------------------------------------


def limits_of_engines() -> str:
    """Table of what engines do not take."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for engine, limits in LIMITS.items():
        for limit in limits:
            rows.setdefault((limit.what, limit.why, limit.remedy), []).append(f"`{engine}`")
    head = "| not taken | by | because | instead |\n| --- | --- | --- | --- |\n"
    return head + "".join(
        f"| {what} | {', '.join(engines)} | {why} | {remedy} |\n" for (what, why, remedy), engines in rows.items()
    )


def limits_of_commands() -> str:
    """Table of what commands do not take."""
    head = "| command | machine | because |\n| --- | --- | --- |\n"
    return head + "".join(f"| {', '.join(each.commands)} | {each.kind} | {each.why} |\n" for each in REFUSALS)


def test_the_docs_list_every_refusal():
    page = (Path(__file__).parents[2] / "docs" / "limits.md").read_text(encoding="utf-8")
    for table in (limits_of_engines(), limits_of_commands()):
        assert table in page, f"docs/limits.md must have:\n{table}"
