"""What ``validate sweep`` and ``validate optimise`` share: the numbers that vary, the machine and its loads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.design.sensitivity import DesignQuantity
from vjm.design.space import DesignSpace, LoadCases
from vjm.design.space import design_space as space_of
from vjm.design.sweep import AskedQuantity
from vjm.engines import EngineOptions, engine_by_name
from vjm.io.file_parameters import MachineFiles
from vjm.vjm_engine import VjmEngine
from vjm_validation.cli.load_case_options import acceleration, parsed_load
from vjm_validation.cli.options import segments_of, six
from vjm_validation.cli.status import UsageError
from vjm_validation.load_any_model import in_postures

Postures = Annotated[
    tuple[str, ...],
    Parameter(
        allow_leading_hyphen=True,
        help="A label, or coordinates in mm and rad; the first by default; may be repeated: a machine is judged "
        "by the worst.",
    ),
]
Wrenches = Annotated[
    tuple[str, ...],
    Parameter(
        allow_leading_hyphen=True,
        help="fx,fy,fz,mx,my,mz in N and N mm on the free end; may be repeated: a machine is judged by the worst.",
    ),
]

HoldTool = Annotated[
    bool,
    Parameter(
        negative="", help="The tool stays in its place in each posture while lengths change: the joints turn."
    ),
]
CostOption = Annotated[
    str,
    Parameter(
        help="What a machine costs: 'parts + 4.2*mass', of the mass in kg, the column cost of catalogues, and keys "
        "of numbers."
    ),
]


def design_space(
    model: str,
    keys: Sequence[str],
    *,
    postures: Sequence[str] = (),
    wrenches: Sequence[str] = (),
    gravity: str = "",
    loads: Sequence[str] = (),
    end: str = "",
    segments: str | None = None,
    weights: str = "",
    hold_tool: bool = False,
    cost: str = "",
) -> DesignSpace:
    """The machine of a file whose numbers vary.

    Raises:
        ModelFileError: no such file or number.
        ValueError: no such posture, or what acts is not told.
    """
    files = MachineFiles.read(model)
    for key in keys:
        files.number(key)
    machine = files.machine()
    number, parts = segments_of(segments)
    solver = engine_by_name("vjm", EngineOptions(number, parts=parts), machine)
    assert isinstance(solver, VjmEngine)
    cases = LoadCases(
        in_postures(machine, postures)[1] if postures else (), [six("--wrench", text) for text in wrenches],
        acceleration(gravity), [parsed_load(text) for text in loads], end, solver, _weights(weights), hold_tool,
    )  # fmt: skip
    return space_of(files, keys, cases, cost=cost)


def _weights(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")] if text else []
    except ValueError:
        raise UsageError(f"--weights {text}: write numbers such as 1,2") from None


def refuse_nothing(acts: object, loads: object, quantities: Iterable[AskedQuantity]) -> None:
    """Refuse to ask for what only loads bring about where nothing acts.

    Args:
        acts: what is said of a wrench or loads, which can grow.
        loads: what is said of weight.
        quantities: that are asked for.

    Raises:
        UsageError: a deflection, or a critical load, is asked for.
    """
    wanted = {each.quantity for each in quantities}
    if DesignQuantity.DEFLECTION in wanted and not acts and not loads:
        raise UsageError("--of deflection: say under which load: give --wrench, --gravity or --load")
    if DesignQuantity.CRITICAL in wanted and not acts:
        raise UsageError("--of critical: say which load grows: give --wrench or --load; weight stays as it is")


def ranges_of(texts: Sequence[str], *, counted: bool, needed: bool = True) -> dict[str, tuple[float, float, int]]:
    """Ranges of numbers by key, as ``--vary`` has them: first, last, and how many.

    Args:
        texts: ``KEY=a:b:n``, or ``KEY=a:b`` where nothing is counted.
        counted: whether n is asked for.
        needed: whether there has to be one.

    Raises:
        UsageError: it is no range.
    """
    form = "KEY=a:b:n, such as upper.length_mm=400:600:5" if counted else "KEY=a:b, such as upper.length_mm=400:600"
    result: dict[str, tuple[float, float, int]] = {}
    for text in texts:
        key, _, numbers = text.partition("=")
        words = numbers.split(":")
        try:
            first, last = float(words[0]), float(words[1])
            count = int(words[2]) if counted else 2
        except (IndexError, ValueError):
            raise UsageError(f"--vary {text}: write {form}") from None
        if len(words) != 2 + counted or not np.isfinite([first, last]).all() or count < 1 or first == last:
            raise UsageError(f"--vary {text}: write {form}")
        if key.strip() in result:
            raise UsageError(f"--vary {key.strip()} stands twice: give one range")
        result[key.strip()] = first, last, count
    if needed and not result:
        raise UsageError(f"say which number varies: --vary {form}")
    return result
