"""The `validate` command.

It knows which commands there are and in which module each is, what stands behind the help of each, and what becomes
of an error.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import App, CycloptsError, Parameter, RepeatArgumentError, UnusedCliTokensError

from vjm import __version__
from vjm.errors import NoConvergenceError
from vjm.io.solid_provider import provide
from vjm.kernels.compiling import watchers
from vjm_output import terminal
from vjm_validation.cli import BAD_INPUT, GAVE_UP, INTERRUPTED, OK

if TYPE_CHECKING:
    from vjm.io.solid_compliance import SolidResult, SolidTable


EXAMPLES = {
    "all": (
        "validate all --quick --out run",
        "open run/index.html; validate compare run OTHER",
        "README.md, docs/verification.md",
    ),
    "compare": (
        "validate compare before after --tolerance 1e-4 --report moved.html",
        "Exit status: 0 where no figure moved or was lost, 1 where one did, 2 for what is no run",
        "README.md",
    ),
    "curve": (
        "validate curve orthoglide-chain --posture A --to -4 --report path.html",
        "validate buckling orthoglide-chain",
        "docs/load-cases.md",
    ),
    "buckling": (
        "validate buckling orthoglide-chain --posture A --engine vjm exudyn --plot paths.png",
        "validate curve",
        "docs/load-cases.md",
    ),
    "stiffness": (
        "validate stiffness orthoglide-chain --posture A --displacement=-1,0,0,0,0,0",
        "validate curve",
        "docs/load-cases.md, docs/design.md",
    ),
    "modes": (
        "validate modes ur10 --gravity 0,0,-9.81 --plot modes.png",
        "validate stiffness ur10 --wrench 0,0,-100,0,0,0 --shares",
        "docs/design.md",
    ),
    "section": (
        "validate section rectangular_tube width_mm=100 thickness_mm=60 wall_mm=4 --plot tube.png",
        "write the same keys into a part's section: docs/model-file.md",
        "docs/model-file.md",
    ),
    "explore": (
        "validate explore ur10 --posture 0.3,-1.2,1.4,-0.5,1.5,0 --wrench 0,0,-100,0,0,0",
        "validate stiffness ur10 --wrench 0,0,-100,0,0,0 --shares",
        "docs/explore.md",
    ),
    "sensitivity": (
        "validate sensitivity planar-2r --posture bent --wrench 0,-50,0,0,0,0 --plot tornado.png",
        "validate stiffness planar-2r --wrench 0,-50,0,0,0,0 --shares",
        "docs/design.md",
    ),
    "sweep": (
        "validate sweep planar-2r --vary upper.section.width_mm=40:80:5 --wrench 0,-50,0,0,0,0 --plot sweep.png",
        "validate optimise",
        "docs/design.md",
    ),
    "optimise": (
        "validate optimise planar-2r --minimise deflection --vary upper.length_mm=400:600 --wrench 0,-50,0,0,0,0",
        "validate check BEST.toml",
        "docs/design.md",
    ),
    "calibrate": (
        "validate calibrate DATA.csv --sheet SHEET.toml --out DIR",
        "validate diagnose",
        "docs/calibration.md",
    ),
    "diagnose": (
        "validate diagnose DATA.csv --sheet SHEET.toml --out DIR",
        "validate curve DIR/extended-model.toml --to -1",
        "docs/diagnosis.md",
    ),
    "simulate": (
        "validate simulate orthoglide-chain --test SHEET.toml --hide link_bow=1.0 --engine exudyn",
        "validate diagnose",
        "docs/diagnosis.md, docs/effects.md",
    ),
    "identify": ("validate identify orthoglide-chain --part link", "", "docs/identification.md"),
    "import": ("validate import robot.urdf --tip tool0", "validate check robot.toml", "docs/model-file.md"),
    "export": ("validate export ur10 --urdf ur10.urdf --mjcf ur10.xml", "", "docs/model-file.md"),
    "example": ("validate example ur10-poses", "the command that it prints", "docs/examples.md"),
    "check": ("validate check MODEL.toml", "", "docs/model-file.md"),
    "map": ("validate map orthoglide --grid 11 --report map.html", "", "docs/manipulators.md"),
}
"""By command: a call, what to do next, and where to read on."""


def epilogue(command: str) -> str:
    """The text behind a command's help; empty for one that needs none."""
    if command not in EXAMPLES:
        return ""
    example, following, page = EXAMPLES[command]
    then = f" Next: {following}." if following else ""
    return f"Example: {example}.{then} Docs: {page}."


def _default(value: object) -> str | None:
    """A default as help shows it; none where nothing is asked unless it is said."""
    if value is None or value is False or value == "" or value == ():
        return None
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


app = App(
    name="validate",
    help="Stiffness of robot manipulators under load: the virtual joint method against finite elements.",
    version=__version__,
    result_action="return_value",
    # said and answered in `run`
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative_iterable=(), show_default=_default),
    # what stands in brackets, such as vjm-<n>f<m>, is meant as it is written
    help_format="plaintext",
    help_epilogue="`validate COMMAND --help` shows a command's options with examples; docs/ has a page on each. "
    "`validate --install-completion` lets the shell complete commands and options; "
    "`validate --version --licences` lists the licences of what is installed.",
)
NUMBER = re.compile(r"[-+\d.eE]+")
"""With the digits of any script, which Python takes."""
NEGATIVE = re.compile(r"-\.?\d")
"""What begins like it is a value, such as -1,-60,0, and no option's name."""
app.register_install_completion_command()
COMMANDS = {
    "all": ("all", "Run every comparison and write the report."),
    "compare": ("compare", "Compare two runs: which figures moved, and by how much."),
    "list": ("list", "Show the models, engines, comparisons and verification cases that there are."),
    "curve": ("paths", "Trace one equilibrium path and show it."),
    "buckling": ("paths", "Stiffness, critical points and post-buckling stiffness."),
    "stiffness": (
        "equilibrium",
        "The loaded equilibrium: deflection, wrench, 6×6 stiffness (18) and the unloaded one, stability.",
    ),
    "modes": ("equilibrium", "Natural frequencies and shapes of the loaded machine; divergence and flutter."),
    "sensitivity": (
        "design",
        "What a deflection, a stiffness, a frequency or the mass depends on, and what to change.",
    ),
    "sweep": (
        "design",
        "Quantities over ranges of numbers of a model file, and which machines no other one beats.",
    ),
    "optimise": ("design", "The numbers of a model file that make a machine best and keep limits."),
    "calibrate": (
        "measured_data",
        "Fit spring compliances to measured force-displacement readings, with their uncertainty.",
    ),
    "diagnose": (
        "measured_data",
        "Show what the model gets wrong, name the cause, extend the model and measure the gain.",
    ),
    "simulate": (
        "measured_data",
        "Make the readings of a machine with a hidden effect, and say how strong it is in that test.",
    ),
    "identify": (
        "identify",
        "A part's 6×6 compliance from virtual experiments, and the uniform beam behind a compliance.",
    ),
    "new": (
        "new",
        "Write a commented model file that runs as it is: an arm, a gantry and others; or a test sheet.",
    ),
    "example": ("example", "Copy an example into a folder: a model or a test's data, with a page about it."),
    "check": ("machine", "List every error of a model file, or say what machine it describes."),
    "explore": (
        "machine",
        "Turn a machine in one's hands: a page with sliders for posture, load and sizes, in a browser.",
    ),
    "section": (
        "section",
        "Areas, second moments, torsion, warping and shear of cross-sections, and their stiffness.",
    ),
    "show": ("machine", "Write a 3-D view of a machine as HTML or PNG, or draw a part's faces numbered."),
    "compensate": (
        "equilibrium",
        "Find the joint coordinates that put the loaded tool where it should be, along a path.",
    ),
    "postures": ("machine", "Find the joint coordinates that put the tool where it is wanted."),
    "import": ("robot_files", "Write a model file of a robot: URDF, MJCF, SDF, table of joints or calibration."),
    "export": ("robot_files", "Write a machine's geometry, joints and masses as URDF, MJCF or table of joints."),
    "map": ("map", "Map a quantity over a manipulator's workspace: CSV, VTK, a figure and a render."),
}
"""By command: its module, which is read when it is called since what it needs takes up to seconds, and its help."""
for name, (module, text) in COMMANDS.items():
    app.command(f"vjm_validation.cli.{module}:{name}_", name=name, help=text, help_epilogue=epilogue(name))


def _compute(path: Path, table: SolidTable) -> SolidResult:
    # finite elements of solids are loaded by who needs them
    from vjm_fea.solid.identify import computed

    return computed(path, table)


provide(_compute)


EXTRAS = {
    "exudyn": "fea",
    "matplotlib": "report",
    "pyvista": "report",
    "vtk": "report",
    "jinja2": "report",
    "openseespy": "opensees",
    "distributed": "cluster",
    "gmsh": "solid",
    "skfem": "solid",
    "pypardiso": "solid",
    "pandas": "frame",
    "mujoco": "mjcf",
    "xacro": "xacro",
    "robot_descriptions": "descriptions",
    "viser": "explore",
}
"""The optional extra that brings a module."""


def missing_extra(error: BaseException) -> str:
    """What to install for a command that lacks an extra; empty where that is not the error."""
    cause: BaseException | None = error
    while cause is not None:
        module = ((cause.name if isinstance(cause, ImportError) else None) or "").split(".")[0]
        if module in EXTRAS and isinstance(cause, ModuleNotFoundError):
            return f"this needs {module}, which is not installed: pip install 'vjm-stiffness[{EXTRAS[module]}]'"
        cause = cause.__cause__ or cause.__context__
    return ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and exit with its status."""
    # This process is the command's own, and so are those that it starts: one thread of linear algebra, for the
    # reason in `vjm.threads`. NumPy, which is not imported yet, reads it once. A number that is set already stays.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if sys.stdout is None or sys.stderr is None:
        # closed by whoever started the command: what is printed goes nowhere, files are written all the same
        nowhere = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  (for the rest of the process)
        sys.stdout, sys.stderr = sys.stdout or nowhere, sys.stderr or nowhere
    words = sys.argv[1:] if arguments is None else arguments
    watchers.append(terminal.compiling())
    status = run(words)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # whoever read the output has gone; what the interpreter flushes at its end goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(status)


def joined(arguments: Sequence[str]) -> list[str]:
    """Words in which values that begin with a minus are joined to their options: ``--base -1,0,0`` by ``=``."""
    words: list[str] = []
    option = ""
    for word in arguments:
        if not NEGATIVE.match(word) or not option:
            words.append(word)
            option = word.partition("=")[0] if word.startswith("--") else option
        elif words[-1] == option:
            words[-1] = f"{option}={word}"
        else:
            # one more of the option's values
            words.append(f"{option}={word}")
    return words


def run(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status; errors become one line."""
    foreign = next((word for word in arguments if NUMBER.fullmatch(word) and not word.isascii()), None)
    if foreign is not None:
        terminal.error(f"{foreign}: write numbers with the digits 0 to 9")
        return BAD_INPUT
    if "--licences" in arguments and not set(arguments) - {"--version", "--licences"}:
        # the packages' metadata are read for it alone
        from vjm_validation.cli.list import show_licences

        show_licences()
        return OK
    try:
        # whoever stops a run politely gets what Ctrl-C gives: finished work stays, and one line says so
        with terminal.interruptible():
            result = app(joined(arguments), exit_on_error=False, print_error=False)
    except UnusedCliTokensError as error:
        command = " ".join(["validate", *(error.command_chain or ())])
        words = " ".join(error.unused_tokens or ())
        terminal.error(f"{words}: nothing more is taken here; `{command} --help` shows the options")
        return BAD_INPUT
    except RepeatArgumentError as error:
        words = " ".join(str(error).split())
        terminal.error(f"{words} Several numbers are one word, such as --wrench 0,0,-100,0,0,0")
        return BAD_INPUT
    except CycloptsError as error:
        # its own error stands before that of a command's module which it could not import
        terminal.error(missing_extra(error) or " ".join(str(error).split()))
        return BAD_INPUT
    except BrokenPipeError:
        return OK
    except (ValueError, OSError, ImportError) as error:
        terminal.error(missing_extra(error) or terminal.one_line(error))
        return BAD_INPUT
    except NoConvergenceError as error:
        terminal.error(str(error))
        return GAVE_UP
    except MemoryError as error:
        terminal.error(str(error) or "not enough working memory")
        return BAD_INPUT
    except KeyboardInterrupt:
        terminal.error("interrupted")
        return INTERRUPTED
    return result if isinstance(result, int) else OK


if __name__ == "__main__":
    main()
