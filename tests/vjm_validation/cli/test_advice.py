"""Every option that a text of ours names is one of the command that shows the text."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from helpers.small_machines import lever

import vjm
import vjm_fea
import vjm_output
import vjm_updating
import vjm_validation
from vjm_validation.cli.main import COMMANDS, app
from vjm_validation.cli.main import run as run_command

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*[a-z0-9]")
COMMAND = re.compile(rf"validate ({'|'.join(COMMANDS)})\b")
EVERYWHERE = {"--help", "--version", "--install-completion", "--licences"}
TESTS = {"calibrate", "diagnose"}
SHOWN_BY = {
    "vjm_fea/solid": {"identify"},
    "vjm/io/urdf": {"import"},
    "vjm/io/robot": {"import"},
    "vjm/io/sdf": {"import"},
    "vjm/io/files.py": {"all", "map"},
    "vjm/io/findings.py": {"check", "stiffness", *TESTS},
    "vjm/io/model_plausibility.py": {"stiffness", "modes", "curve"},
    "vjm/engines.py": {"curve", "buckling", "stiffness"},
    "vjm/analysis.py": {"stiffness"},
    "vjm_updating/analysis.py": TESTS,
    "vjm_updating/calibration": {"calibrate"},
    "vjm_updating/frequencies": {"calibrate"},
    "vjm_updating/diagnosis": {"diagnose"},
    "vjm_updating/poses/held_out.py": {"diagnose"},
    "vjm_updating/identify": {"identify"},
    "vjm_updating/simulate": {"simulate"},
    "vjm/io/ur_calibration.py": {"import"},
    "vjm_updating/maps": {"map"},
    "vjm_updating/maps/run.py": {"map"},
}
"""Commands that show the texts of a module, by the begin of its path; a text of another names its command."""
ANY = {"vjm_updating/analysis.py"}
"""Modules whose texts are shown by one or the other command."""
FOREIGN = {"vjm_validation/report/page.py"}
"""Modules with the options of a browser."""
# what a text says about a machine that another command will compute: any command with a load has the option
OF_LATER_COMMANDS = {"vjm_updating/calibration/calibrated_model.py": {"curve", "buckling"}}


@cache
def options_of(command: str) -> frozenset[str]:
    arguments = app[command].assemble_argument_collection()
    return frozenset(name for one in arguments for name in (*one.names, *(one.negatives or ())) if name[:2] == "--")


def texts(source: str) -> Iterator[tuple[int, str]]:
    """The texts of a module but its docstrings, with their lines; what an f-string fills in is left open."""
    tree = ast.parse(source)
    inner: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner |= {id(one.value) for one in node.body if isinstance(one, ast.Expr)}
        elif isinstance(node, ast.JoinedStr):
            inner |= {id(one) for one in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield node.lineno, "".join(str(p.value) if isinstance(p, ast.Constant) else "…" for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner:
            yield node.lineno, node.value


def wrong(module: str, text: str) -> list[str]:
    """Options that the commands which show a text do not have."""
    found = []
    for match in OPTION.finditer(text):
        option, before = match.group(), text[: match.start()]
        # the command whose line it stands in, if a line is quoted or given
        named = list(COMMAND.finditer(before))
        if named:
            commands, every = {named[-1][1]}, True
        elif module.startswith("vjm_validation/cli/") and Path(module).stem in (*COMMANDS, "import_urdf"):
            commands, every = {Path(module).stem.replace("_urdf", "")}, True
        elif module in OF_LATER_COMMANDS:
            commands, every = OF_LATER_COMMANDS[module], True
        elif text.startswith(option) or module.startswith("vjm_validation/"):
            # an answer to an option that was given, or what several commands share
            commands, every = set(COMMANDS), False
        else:
            begin = max((key for key in SHOWN_BY if module.startswith(key)), key=len, default="")
            commands, every = SHOWN_BY.get(begin, set()), begin not in ANY
        having = [option in options_of(command) for command in commands]
        if option not in EVERYWHERE and not (having and (all(having) if every else any(having))):
            found.append(option)
    return found


def test_options_that_texts_name_exist():
    offences, count = [], 0
    for package in (vjm, vjm_output, vjm_updating, vjm_fea, vjm_validation):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            module = path.relative_to(folder.parent).as_posix()
            if module in FOREIGN:
                continue
            source = path.read_text(encoding="utf-8")
            for line, text in texts(source) if OPTION.search(source) else ():
                count += bool(OPTION.search(text))
                offences += [f"{module}:{line}: {option}: {text}" for option in wrong(module, text)]
    assert offences == []
    assert count > 100


def test_an_option_that_is_none_is_found():
    assert wrong("vjm/model/end_condition.py", "leave it free, such as --free y") == ["--free"]
    assert wrong("vjm/model/end_condition.py", "leave it free: `validate curve --free y`") == []
    assert wrong("vjm_updating/calibration/run.py", "look with --effects") == ["--effects"]
    assert wrong("vjm_updating/calibration/run.py", "`validate diagnose --effects` looks") == []


def test_a_machine_without_a_stiffness_in_every_direction_is_calibrated_by_loads(tmp_path, capsys):
    """Its unloaded 6×6 stiffness does not exist and is not asked for: 1.3e-7 rad/(N mm), 1.3 times the model's."""
    (tmp_path / "arm.toml").write_text(lever(400.0, 1e-7))
    sheet = tmp_path / "sheet.toml"
    sheet.write_text(
        '[test]\nmodel = "arm.toml"\ncontrol = "force"\n'
        "[instrument.fy_N]\nnoise = 0.001\n[instrument.uy_mm]\nnoise = 0.003\n"
    )
    force = [*range(10, 101, 10), *range(90, 0, -10)]
    data = tmp_path / "readings.csv"
    rows = (f"{5 * k},home,1,{f},{1.3e-7 * 400.0**2 * f:.6f}" for k, f in enumerate(force))
    data.write_text("\n".join(["time_s,posture,run,fy_N,uy_mm", *rows]) + "\n")
    out = tmp_path / "out"
    status = run_command(["calibrate", str(data), "--sheet", str(sheet), "--out", str(out)])
    said = capsys.readouterr()
    assert status == 0, said.err
    assert vjm.load(out / "calibrated-model.toml").parts[0].compliance == pytest.approx(1.3e-7, rel=2e-3)
