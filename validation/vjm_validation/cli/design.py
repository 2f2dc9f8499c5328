"""The commands on the numbers of a model file.

``validate sensitivity`` says what a quantity depends on, ``validate sweep`` computes quantities over ranges of
numbers, ``validate optimise`` finds the best ones and Pareto fronts. They share the design space: the numbers, the
machine, its postures and its loads.
"""

from __future__ import annotations

import csv
import io
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm import __version__
from vjm.design.best_machine import Choices, ParetoFront, best_machine, front_of, objective_of
from vjm.design.optimum import Optimum, QuantityLimit, limits_of
from vjm.design.sensitivity import DesignQuantity, sensitivities
from vjm.design.space import DesignSpace, LoadCases
from vjm.design.space import design_space as space_of
from vjm.design.sweep import AskedQuantity, asked, grid_of, signs, swept
from vjm.engines import EngineOptions, VjmEngine, engine_by_name
from vjm.io.catalogues import catalogue, catalogue_names
from vjm.io.file_parameters import MachineFiles
from vjm.io.files import write_whole
from vjm.io.findings import Finding
from vjm.io.path_files import cell_number
from vjm.io.provenance import Provenance
from vjm.rotations import Array
from vjm_output import terminal
from vjm_output.documents import doubt_rows
from vjm_updating.maps.run import compute_all
from vjm_validation.cli import INTERRUPTED, NOT_ACCEPTED, OK, UsageError
from vjm_validation.cli.contents import front_content, optimum_content, sensitivity_content, sweep_content
from vjm_validation.cli.options import (
    ENGINE_CHOICE,
    NO_LOADS,
    ActingLoads,
    EndFrame,
    EngineChoice,
    Model,
    Posture,
    Segments,
    Wrench,
    considered,
    processes,
    segments_of,
    six,
    six_or_none,
)
from vjm_validation.cli.pages import OUTPUT, Output
from vjm_validation.design_documents import (
    SOUGHT,
    FrontDocument,
    FrontPoint,
    OptimumDocument,
    OptimumLimit,
    confirmed_rows,
    number_rows,
    part_rows,
    sensitivity_document,
    sweep_document,
)
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
    acting: ActingLoads = NO_LOADS,
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
        acting.acceleration, acting.parsed, end, solver, _weights(weights), hold_tool,
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


def sensitivity_(
    model: Model,
    *,
    of: Annotated[
        DesignQuantity, Parameter(help="deflection, stiffness, critical, frequency or mass.")
    ] = DesignQuantity.DEFLECTION,
    by: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Numbers of parts, such as upper.section.width_mm,elbow.compliance_rad_per_Nmm; of a part that "
            "legs share chain.part.key; all by default.",
        ),
    ] = (),
    along: Annotated[
        str,
        Parameter(help="x, y, z, rx, ry, rz: of a deflection by default its largest shift, of a stiffness x."),
    ] = "",
    posture: Posture = None,
    wrench: Wrench = None,
    acting: ActingLoads = NO_LOADS,
    end: EndFrame = "",
    springs: EngineChoice = ENGINE_CHOICE,
    output: Output = OUTPUT,
) -> int:
    """What a deflection, a stiffness, a critical load, a frequency or the mass depends on, and what to change."""
    refuse_nothing(wrench is not None or acting.load, acting.gravity, [AskedQuantity(of)])
    output.check()
    files = MachineFiles.read(model, sheared=springs.sheared)
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    machine = files.machine()
    label = next(iter(machine.postures))
    solver = springs.lumped(machine)
    if posture is not None:
        _, (label,) = in_postures(machine, (posture,))
    result = sensitivities(
        files, [key.strip() for text in by for key in text.split(",") if key.strip()], of=of, along=along,
        posture=label, wrench=six_or_none("--wrench", wrench), gravity=acting.acceleration, loads=acting.parsed,
        end=end, engine=solver, factors=SOUGHT,
    )  # fmt: skip
    document = sensitivity_document(result).model_copy(
        update={"doubts": doubt_rows(doubts), "loads": acting.words(wrench)}
    )
    output.show(document, lambda: sensitivity_content(document))
    return NOT_ACCEPTED if any(row.verification.doubtful for row in result.rows) else OK


MOST = 100_000
"""Machines in a sweep."""
EVERY_S = 2.0
"""Seconds between two writings of the CSV: as much can be lost."""


def sweep_(
    model: Model,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="Numbers of parts with first, last and count: KEY=a:b:n."),
    ] = (),
    of: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, help="mass, deflection, stiffness.z, critical, frequency, reach, cost."),
    ] = ("mass", "deflection"),
    posture: Postures = (),
    wrench: Wrenches = (),
    acting: ActingLoads = NO_LOADS,
    hold_tool: HoldTool = False,
    cost: CostOption = "",
    end: EndFrame = "",
    segments: Segments = None,
    csv: Annotated[
        Path | None, Parameter(name="--csv", help="Write the rows there; what it has already is not done again.")
    ] = None,
    jobs: Annotated[int, Parameter(help="Processes; 0 is one a core.")] = 1,
    scheduler: Annotated[str, Parameter(help="Address of a Dask scheduler instead, such as tcp://host:8786.")] = "",
    output: Output = OUTPUT,
) -> int:
    """Compute quantities over ranges of numbers of a model file, and say which machines no other one beats."""
    ranges = ranges_of(vary, counted=True)
    quantities = [asked(word) for text in of for word in text.split(",")]
    refuse_nothing(wrench or acting.load, acting.gravity, quantities)
    workers = processes(jobs)
    output.check(csv=csv)
    grid = grid_of(ranges)
    if len(grid) > MOST:
        raise UsageError(f"--vary: these are {len(grid)} machines; take {MOST} at most")
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, acting=acting, end=end,
        segments=segments, hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    machine = space.files.machine()
    made_of = Provenance.of(
        machine.files, machine=machine, engine=space.engine, vary=space.keys, of=[str(each) for each in quantities],
        gravity=space.gravity, load=[str(each) for each in space.loads], end=end,
        hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    store = Store(csv, space, made_of, quantities)
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    store.say(grid)
    try:
        with terminal.progress(quiet=output.json) as progress:
            sweep = swept(
                space, grid, quantities, workers, partial(progress, "machines"), store,
                partial(compute_all, scheduler=scheduler),
            )  # fmt: skip
    except KeyboardInterrupt:
        where = f"; what is finished is in {csv}: the same command goes on" if csv else ""
        terminal.error(f"interrupted{where}")
        return INTERRUPTED
    finally:
        store.write()
    assert space.engine is not None
    document = sweep_document(sweep, machine.name, machine.sha256, space.engine.label, doubt_rows(doubts))
    document = document.model_copy(update={"loads": acting.words(*wrench)})
    output.show(document, lambda: sweep_content(document))
    if csv is not None and not output.json:
        terminal.console().print(str(csv), soft_wrap=True)
    return OK


Key = tuple[str, ...]
Cells = tuple[list[float], str]
"""Quantities, and why there are none."""


class Store:
    """The rows of a sweep in a CSV: a row for each machine and case, with all the digits of their numbers.

    What it was made of, and does not stand in the rows, stands in the first line.
    """

    def __init__(
        self, file: Path | None, space: DesignSpace, made_of: Provenance, quantities: list[AskedQuantity]
    ) -> None:
        """Open a file, or none.

        Raises:
            OtherInputsError: it is of another machine or question.
            UsageError: a row of it is damaged.
        """
        self._file, self._space, self._made_of = file, space, made_of
        self._head = [*space.keys, "posture", "wrench", *map(str, quantities), "why"]
        self._rows: dict[Key, Cells] = {}
        self._due, self._changed = 0.0, False
        if file is not None and file.exists():
            self._read(file)

    def _read(self, file: Path) -> None:
        """Take over the rows of a file; a last line without an end was cut off, and is computed anew."""
        text = file.read_text(encoding="utf-8", errors="replace")
        first, *lines = text.splitlines() or [""]
        try:
            earlier = json.loads(first.removeprefix("# "))
        except ValueError:
            earlier = None
        where = f"--csv {file}: is of another machine, load or question"
        self._made_of.check(earlier, where, "give another name, or remove it")
        if lines and not text.endswith("\n"):
            terminal.error(f"{file}, line {len(lines) + 1}: was cut off: its machine is computed anew")
            del lines[-1]
        for number, row in enumerate(csv.reader(lines), start=2):
            try:
                if number > 2:
                    key, cells = self._parsed(row)
                    self._rows[key] = cells
                elif row != self._head:
                    raise ValueError("is not the header that was written")
            except ValueError as error:
                raise UsageError(
                    f"--csv {file}, line {number}: {error}: delete the line, and it is computed anew"
                ) from None

    def _parsed(self, row: list[str]) -> tuple[Key, Cells]:
        """The key and the cells of a row.

        Raises:
            ValueError: it is none that `write` writes.
        """
        if len(row) != len(self._head):
            raise ValueError(f"{len(row)} cells for {len(self._head)} columns")
        names, numbers = len(self._space.keys), len(self._space.keys) + 2
        *cells, why = row[numbers:]
        for name, cell in zip(self._head, row, strict=True):
            if name in self._head[:names] or (name in self._head[numbers:-1] and not why):
                cell_number(name, cell)
        if why and any(cells):
            raise ValueError(f"has values, and '{why}' in column why")
        return tuple(row[:numbers]), ([float(cell) if cell else np.nan for cell in cells], why)

    def _keys(self, row: Array) -> list[Key]:
        numbers = [f"{v:.17g}" for v in row]
        return [(*numbers, case.posture, case.wrench_text) for case in self._space.cases]

    def find(self, row: Array) -> tuple[Array, list[str]] | None:
        """Quantities ``(c, q)`` of a machine in its cases, and why there are none; None where one is not there."""
        keys = self._keys(row)
        if any(key not in self._rows for key in keys):
            return None
        cells = [self._rows[key] for key in keys]
        return np.array([quantities for quantities, _ in cells]), [text for _, text in cells]

    def keep(self, row: Array, values: Array, why: list[str]) -> None:
        """Remember a machine, in all its cases, and soon write it."""
        for key, quantities, text in zip(self._keys(row), values, why, strict=True):
            self._rows[key] = quantities.tolist(), text
        self._changed = True
        # not so often that writing takes more than a tenth of the time
        if time.monotonic() > self._due:
            began = time.monotonic()
            self.write()
            self._due = began + max(EVERY_S, 10.0 * (time.monotonic() - began))

    def write(self) -> None:
        """Write the file anew, if there is one and something is new: whole or not at all."""
        if self._file is None or not self._changed:
            return
        self._changed = False
        stream = io.StringIO()
        stream.write(f"# {json.dumps(self._made_of.inputs)}\n")
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(self._head)
        for key, (quantities, text) in self._rows.items():
            table.writerow([*key, *("" if text else f"{v:.17g}" for v in quantities), text])
        write_whole(self._file, stream.getvalue())

    def say(self, grid: Array) -> None:
        """Say what the file has already."""
        known = sum(self.find(row) is not None for row in grid)
        wanted = {key for row in grid for key in self._keys(row)}
        other = sum(key not in wanted for key in self._rows)
        if known == len(grid):
            terminal.error(f"{self._file}: has all machines already; nothing is computed")
        elif known:
            terminal.error(f"{self._file}: has {known} of {len(grid)} machines already")
        if other:
            terminal.error(f"{self._file}: {other} rows of other values or cases stay in it")


# --- What ``validate optimise --against`` does: the Pareto front of two quantities --------------------------------


@dataclass(frozen=True)
class FrontSearch:
    """What is asked of a front.

    Attributes:
        space: of the machines.
        bounds: of the numbers, by key.
        chosen: rows of catalogues, by key.
        of: the two quantities.
        limits: that all machines keep.
        points: that are looked for.
        starts: of the optimiser.
        state: file of what was computed.
    """

    space: DesignSpace
    bounds: Mapping[str, tuple[float, float]]
    chosen: Choices
    of: tuple[AskedQuantity, AskedQuantity]
    limits: Sequence[QuantityLimit]
    points: int
    starts: int
    state: Path | None


def front_(
    search: FrontSearch,
    doubts: Sequence[Finding],
    output: Output,
    loads: Sequence[str],
    *,
    confirm: bool,
) -> int:
    """Find the front, print it and draw it."""
    try:
        with terminal.progress(quiet=output.json) as progress:
            front = front_of(
                search.space, search.bounds, search.chosen, search.of, search.limits, search.points, search.starts,
                lambda count, _: progress("machines", count, 0, ""), search.state,
            )  # fmt: skip
    except KeyboardInterrupt:
        terminal.error("interrupted before any machine of the front was found")
        return INTERRUPTED
    document = _document(search, front, doubts, confirm=confirm).model_copy(update={"loads": [*loads]})
    output.show(document, lambda: front_content(document))
    if front.interrupted:
        terminal.error("interrupted: these are the machines so far")
        return INTERRUPTED
    return OK


def _document(
    search: FrontSearch, front: ParetoFront, doubts: Sequence[Finding], *, confirm: bool
) -> FrontDocument:  # fmt: skip
    machine, space = search.space.files.machine(), search.space
    return FrontDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        postures=list(dict.fromkeys(case.posture for case in space.cases)),
        wrenches=list(dict.fromkeys(case.wrench_text for case in space.cases if case.wrench_text)),
        quantities=[str(each) for each in front.of],
        quantity_units=[each.unit for each in front.of],
        limits=[str(limit) for limit in search.limits],
        points=[
            FrontPoint(
                values=values.tolist(), numbers=number_rows(point), parts=part_rows(point),
                confirmed=confirmed_rows(point) if confirm and not front.interrupted else [],
            )
            for values, point in zip(front.values, front.points, strict=True)
        ],
        interrupted=front.interrupted,
        doubts=doubt_rows(doubts),
    )  # fmt: skip


CATALOGUE = "=catalogue:"
"""Between the key of a section and the name of a catalogue."""


def optimise_(
    model: Model,
    *,
    minimise: Annotated[
        str, Parameter(help="mass, cost or deflection, perhaps with a component: deflection.z.")
    ] = "",
    maximise: Annotated[str, Parameter(help="critical, frequency, reach or stiffness.z.")] = "",
    against: Annotated[str, Parameter(help="A second quantity: the Pareto front of both.")] = "",
    points: Annotated[int, Parameter(help="Machines of the front that are looked for.")] = 7,
    such_that: Annotated[str, Parameter(help="Bounds: 'deflection<=0.2; critical>=3*load; frequency>=20'.")] = "",
    vary: Annotated[
        tuple[str, ...],
        Parameter(
            consume_multiple=True,
            help="Numbers of parts with their bounds: KEY=a:b. Sections from a catalogue: KEY=catalogue:tubes.csv, "
            f"a .toml file or one of {', '.join(catalogue_names())}.",
        ),
    ] = (),
    starts: Annotated[int, Parameter(help="Starts of the optimiser.")] = 3,
    posture: Postures = (),
    wrench: Wrenches = (),
    acting: ActingLoads = NO_LOADS,
    weights: Annotated[
        str,
        Parameter(help="a,b,…: of the cases in what is made best, postures first; the worst case counts else."),
    ] = "",
    hold_tool: HoldTool = False,
    cost: CostOption = "",
    end: EndFrame = "",
    segments: Segments = None,
    confirm: Annotated[
        bool, Parameter(help="Compute the result again with twice as many springs and with finite elements.")
    ] = True,
    out: Annotated[Path | None, Parameter(help="Write the best machine's model file, .toml.")] = None,
    state: Annotated[
        Path | None, Parameter(help="Keep what was computed there; the same command goes on after an interrupt.")
    ] = None,
    output: Output = OUTPUT,
) -> int:
    """Find the numbers of a model file within bounds that make a machine best and keep limits."""
    try:
        objective = objective_of(minimise, maximise)
    except ValueError as error:
        raise UsageError(f"--minimise, --maximise: {error}") from None
    limits = limits_of(such_that)
    listed = [text for text in vary if CATALOGUE in text]
    chosen = {key.strip(): catalogue(name) for key, _, name in (text.partition(CATALOGUE) for text in listed)}
    if len(chosen) < len(listed):
        raise UsageError("--vary: a part stands twice: give one catalogue")
    ranges = ranges_of([text for text in vary if text not in listed], counted=False, needed=not chosen)
    bounds = {key: (low, high) for key, (low, high, _) in ranges.items()}
    if starts < 1:
        raise UsageError(f"--starts {starts}: take one at least")
    second = [asked(against)] if against else []
    refuse_nothing(wrench or acting.load, acting.gravity, [objective, *(limit.of for limit in limits), *second])
    if out is not None and out.suffix != ".toml":
        raise UsageError(f"--out {out}: write a name that ends in .toml")
    if against and out is not None:
        raise UsageError("--out: a front has several machines: take a bound from it, then write the best one")
    if not against and (output.plot or output.report):
        raise UsageError("--plot, --report: show a front: say --against which quantity")
    output.check(out=out, state=state)
    space = design_space(
        model, list(ranges), postures=posture, wrenches=wrench, acting=acting, end=end,
        segments=segments, weights=weights, hold_tool=hold_tool, cost=cost,
    )  # fmt: skip
    doubts = considered(model, output.strict, weighed=bool(acting.gravity))
    if second:
        search = FrontSearch(space, bounds, chosen, (objective, second[0]), limits, points, starts, state)
        return front_(search, doubts, output, acting.words(*wrench), confirm=confirm)
    optimum: Optimum | None = None
    try:
        with terminal.progress(quiet=output.json) as progress:

            def tell(count: int, best: float | None) -> None:
                known = "none keeps the limits yet" if best is None else f"best {objective} {best:.6g}"
                progress("machines", count, 0, known)

            optimum = best_machine(space, bounds, chosen, objective, limits, starts, tell, state)
    except KeyboardInterrupt:
        # which the block raises once more at its end, where the best so far is known
        if optimum is None:
            terminal.error(f"interrupted before any machine was computed{_goes_on(state)}")
            return INTERRUPTED
    as_it_is = swept(space, space.present[None], [objective]).values[0, :, 0]
    before = space.in_all_cases(as_it_is, signs([objective])[0])
    best = optimum.best
    assert isinstance(best, MachineFiles)
    machine = space.files.machine()
    document = OptimumDocument(
        model=machine.name,
        model_sha256=machine.sha256,
        version=__version__,
        postures=list(dict.fromkeys(case.posture for case in space.cases)),
        wrenches=list(dict.fromkeys(case.wrench_text for case in space.cases if case.wrench_text)),
        weights=list(space.weights),
        objective=str(objective),
        unit=objective.unit,
        before=before if np.isfinite(before) else None,
        value=optimum.objective,
        kept=optimum.kept,
        numbers=number_rows(optimum),
        parts=part_rows(optimum),
        limits=[
            OptimumLimit(limit=str(limit), value=float(value), active=abs(limit.margin(float(value))) < 1e-4)
            for limit, value in zip(limits, optimum.quantities, strict=True)
        ],
        starts=optimum.starts,
        agreeing=optimum.agreeing,
        machines=optimum.evaluations,
        confirmed=confirmed_rows(optimum) if confirm and not optimum.interrupted else [],
        interrupted=optimum.interrupted,
        doubts=doubt_rows(doubts),
        loads=acting.words(*wrench),
    )
    written: list[Path] = []
    if out is not None:
        bounded = "; ".join(str(limit) for limit in limits)
        what = f"{objective}, such that {bounded}" if bounded else f"{objective}, with no limits"
        head = f"# Optimised from {best.document.file} by `validate optimise`: {what}.\n"
        written = best.write(out, head, f"{best.document.content['title']}, optimised")
    output.show(document, lambda: optimum_content(document))
    for file in () if output.json else written:
        terminal.console().print(f"{file}", soft_wrap=True)
    if optimum.interrupted:
        terminal.error(f"interrupted: this is the best machine so far{_goes_on(state)}")
        return INTERRUPTED
    return OK if optimum.kept else NOT_ACCEPTED


def _goes_on(state: Path | None) -> str:
    return "" if state is None else f"; what was computed is in {state}: the same command goes on"
