"""The questions that several commands answer."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from helpers.random_machines import REGULAR
from helpers.virtual_work import NoEquilibriumError, Statics, posture_values

import vjm
from contradictions.answers import GIVEN, SPRINGS, Asked, Between, Found, Question, RefusedError, Value, Way
from contradictions.machines import FREE_END, HELD_END, KINDS, Drawn
from vjm.io.file_parameters import MachineFiles
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.tree.equilibria import unloaded_frames
from vjm.tree.inverse_kinematics import ranges_of
from vjm.tree.model import TreeModel
from vjm_updating.maps.grid import grid_origin
from vjm_updating.maps.quantity import principal

EXACT = 1e-6
"""Relative. Equilibria are solved to 1e-11 of their forces, and closed loops have conditions up to 1e5."""
DIFFERENCED = 1e-3
"""Relative, of a quotient of differences over a thousandth: the third derivative, and rounding over the step."""
LOCATED = 1e-5
"""Relative. Critical points are located to 1e-9 of a path; four springs a beam are the same everywhere."""
STEP = 1e-3
"""Of a number or a load, to either side."""
SEGMENTS = ("--segments", str(SPRINGS))
ENGINE = ("--engine", f"vjm-{SPRINGS}")
ALL_FREE = ("--free", ",".join(COMPONENTS))


def comma(values: Any) -> str:
    return ",".join(repr(float(v)) for v in values)


def free(machine: Drawn) -> bool:
    return machine.end == FREE_END


# --- what documents say ------------------------------------------------------------------------------------


def unit_of(asked: Asked) -> Array:
    return np.repeat([1.0, asked.length], 3)


def scaled(asked: Asked, C: Any) -> Array:
    """A compliance in mm/N: turns times the length, moments over it."""
    unit = unit_of(asked)
    return np.asarray(C, dtype=float) * unit[:, None] * unit


def floor_of(asked: Asked) -> float:
    """mm/N: compliance that is none. The load by which stability is lost then moves nothing that can be seen."""
    return 1e-9 * asked.length / asked.machine.scale


def of_compliance(asked: Asked, C: Any) -> Found:
    """What a compliance states."""
    C, least = np.asarray(C, dtype=float), floor_of(asked)
    load = asked.load
    kt_min, _, kr_min, _ = principal(C[None])[0]
    # over infinity where nothing moves
    softest = [1.0 / kt_min, asked.length**2 / kr_min]
    return {
        "compliance": Value(scaled(asked, C).ravel(), EXACT, least),
        "softest directions": Value(np.array(softest), EXACT, least),
        "compliance along the load": Value([load @ C @ load], EXACT, least),
        **{
            f"compliance along {name}": Value([C[i, i] * unit_of(asked)[i] ** 2], EXACT, least)
            for i, name in enumerate(COMPONENTS[:3])
        },
    }


def of_shift(asked: Asked, displacement: Any) -> Found:
    """What a displacement ``(6,)`` states."""
    u = np.asarray(displacement, dtype=float)
    least = 1e-9 * asked.length
    return {
        "displacement": Value(u * unit_of(asked), EXACT, least),
        "shift": Value([np.linalg.norm(u[:3])], EXACT, least),
    }


def loaded_words(force: Array | None) -> tuple[str, ...]:
    return () if force is None else (f"--wrench={comma(force)}",)


def stiffness_document(asked: Asked, force: Array | None, model: str = "") -> dict[str, Any]:
    return asked.json("stiffness", model or asked.model, *loaded_words(force), *SEGMENTS)


def compliance_of(document: dict[str, Any], which: str = "loaded") -> Array:
    C, K = document[f"compliance_{which}"], document[f"stiffness_{which}"]
    return np.array(C) if C is not None else np.linalg.inv(np.array(K))


def by_command(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        force = share * asked.machine.scale * asked.load if share else None
        document = stiffness_document(asked, force)
        return of_compliance(asked, compliance_of(document)) | of_shift(asked, document["displacement"])

    return ask


def by_twin(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        if not asked.machine.twin:
            return {}
        force = share * asked.machine.scale * asked.load if share else None
        document = stiffness_document(asked, force, str(asked.folder / asked.machine.twin))
        return of_compliance(asked, compliance_of(document)) | of_shift(asked, document["displacement"])

    return ask


def by_python(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        wrench = share * asked.machine.scale * asked.load if share else None
        found = vjm.stiffness(asked.loaded(), wrench=wrench, options=asked.options)
        C = found.loaded_compliance if found.loaded_compliance is not None else np.linalg.inv(found.loaded)
        return of_compliance(asked, C) | of_shift(asked, found.displacement)

    return ask


def read_back(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        file = asked.new_file()
        MachineFiles.read(asked.model).write(file, "", "written and read back")
        force = share * asked.machine.scale * asked.load if share else None
        document = stiffness_document(asked, force, str(file))
        return of_compliance(asked, compliance_of(document)) | of_shift(asked, document["displacement"])

    return ask


def by_virtual_work(share: float) -> Callable[[Asked], Found]:
    """By a solver that shares nothing with the package but the description of the parts."""

    def ask(asked: Asked) -> Found:
        engine = vjm.engine_by_name("vjm", asked.options, asked.loaded())
        assert isinstance(engine, vjm.VjmEngine)
        machine = engine.split(asked.loaded())
        wrench = share * asked.machine.scale * asked.load
        statics = Statics(machine, posture_values(machine, next(iter(machine.postures))), wrenches={"": wrench})
        if asked.loaded().closures and statics.first_step()[1] < REGULAR:
            # its equations take closures to be independent: of redundant ones it knows nothing
            return {}
        try:
            found = statics.solve()
        except NoEquilibriumError:
            # Newton's method from the drawing: what it does not find, it does not deny
            return {}
        if found.negative:
            return {GIVEN: "unstable"}
        return of_compliance(asked, found.compliance[""]) | of_shift(asked, found.displacements[""])

    return ask


def by_exudyn(share: float) -> Callable[[Asked], Found]:
    """By finite elements; machines with beams differ by the error of four elements, which is no contradiction."""

    def ask(asked: Asked) -> Found:
        if asked.loaded().beams or not share:
            return {}
        force = share * asked.machine.scale * asked.load
        document = asked.json("stiffness", asked.model, *loaded_words(force), "--engine", "exudyn")
        return of_shift(asked, document["displacement"])

    return ask


def grid_here(asked: Asked) -> str:
    """The one point of a map at which the machine is drawn: of a drive, or else of the tool."""
    machine = asked.loaded()
    model = TreeModel(machine)
    q = model.posture(next(iter(machine.postures)))
    for name, value, driven in zip(model.joints, q, ranges_of(model).driven, strict=True):
        if driven:
            return f"{name}={float(value)!r}"
    x, y, z = (unloaded_frames(model, q)[1] - grid_origin(model))[0, 0]
    return f"x={float(x)!r},y={float(y)!r},z={float(z)!r}"


def map_row(asked: Asked, quantity: str, *more: str) -> list[float]:
    """Values at the one point.

    Raises:
        RefusedError: there is none.
    """
    found = asked.json(
        "map",
        asked.model,
        "--grid",
        grid_here(asked),
        "--quantity",
        quantity,
        *ENGINE,
        "--jobs",
        "1",
        "--out",
        asked.new_folder(),
        *more,
    )
    (status,) = found["status"]
    if status != "ok":
        raise RefusedError(0, status)
    return [np.inf if v is None else v for v in found["values"][0]]


def by_map(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        force = share * asked.machine.scale * asked.load
        kt, _, kr, _ = map_row(asked, "stiffness", *(loaded_words(force) if share else ()))
        numbers = np.array([1.0 / kt, asked.length**2 / kr])
        found: Found = {"softest directions": Value(numbers, EXACT, floor_of(asked))}
        if share:
            row = map_row(asked, "deflection", *loaded_words(force))
            found |= of_shift(asked, row[:6])
        return found

    return ask


RIGID = "does not deflect along"
"""What `sensitivity` and `sweep` say of a stiffness that is infinite."""


def along_x(asked: Asked, k: float) -> Found:
    return {"compliance along x": Value([1.0 / k], EXACT, floor_of(asked))}


def by_sensitivity(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        words = loaded_words(share * asked.machine.scale * asked.load) if share else ()
        try:
            document = asked.json(
                "sensitivity",
                asked.model,
                "--of",
                "stiffness",
                "--along",
                "x",
                "--by",
                asked.machine.keys[0],
                *words,
                *SEGMENTS,
            )
        except RefusedError as refused:
            if RIGID in refused.said:
                return along_x(asked, np.inf)
            raise
        return along_x(asked, document["value"])

    return ask


def by_sweep(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        key = asked.machine.keys[0]
        value = MachineFiles.read(asked.model).number(key)
        words = loaded_words(share * asked.machine.scale * asked.load) if share else ()
        found: Found = {}
        for of in ("stiffness.x", "deflection") if share else ("stiffness.x",):
            document = asked.json(
                "sweep", asked.model, "--vary", f"{key}={value!r}:{1.1 * value!r}:2", "--of", of, *words, *SEGMENTS
            )
            case = document["rows"][0]["cases"][0]
            if case["why"] and RIGID not in case["why"]:
                raise RefusedError(0, case["why"])
            if of == "deflection":
                found["shift"] = Value(np.array(case["values"]), EXACT, 1e-9 * asked.length)
            else:
                found |= along_x(asked, np.inf if case["why"] else case["values"][0])
        return found

    return ask


def curve_document(asked: Asked, load: Array, to: float, *more: str) -> dict[str, Any]:
    return asked.json(
        "curve",
        asked.model,
        "--axis",
        "load",
        "--load",
        comma(load),
        "--to",
        repr(float(to)),
        *ALL_FREE,
        *ENGINE,
        *more,
    )


def by_curve(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        to = share * asked.machine.scale or 1e-6 * asked.machine.scale
        document = curve_document(asked, asked.load, to)
        point = document["points"][-1 if share else 0]
        if share and not document["complete"]:
            return {}
        k = point["stiffness"]
        flexible = 0.0 if k is None or np.isinf(k) else 1.0 / k
        found: Found = {"compliance along the load": Value([flexible], EXACT, floor_of(asked))}
        return found | (of_shift(asked, point["displacement"]) if share else {})

    return ask


def by_difference(share: float) -> Callable[[Asked], Found]:
    """By displacements under a little less and a little more load, with two steps."""

    def ask(asked: Asked) -> Found:
        whole = share * asked.machine.scale
        step = STEP * (whole or 0.1 * asked.machine.scale)
        slopes = []
        for size in (step, 0.5 * step):
            ends = [stiffness_document(asked, (whole + s * size) * asked.load) for s in (-1.0, 1.0)]
            a, b = (np.array(each["displacement"]) for each in ends)
            slopes.append(float(asked.load @ (b - a)) / (2.0 * size))
        coarse, fine = slopes
        # of the finer quotient's error by the third derivative the two differ by three times
        allowed = DIFFERENCED * abs(fine) + abs(fine - coarse)
        return {"compliance along the load": Value([fine], 0.0, floor_of(asked) + allowed)}

    return ask


def by_modes(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        force = share * asked.machine.scale * asked.load
        document = asked.json("modes", asked.model, *loaded_words(force), *SEGMENTS)
        return of_shift(asked, document["displacement"])

    return ask


def it_deflects(asked: Asked) -> Found:
    """Every machine is drawn with springs that hold it: each deflects under some load."""
    return {GIVEN: GIVEN}


UNLOADED, LOADED = 0.0, 0.05
"""Shares of the load's scale."""


def stiffness_ways(share: float) -> list[Way]:
    return [
        *([] if share else [Way("drawing", it_deflects)]),
        Way("stiffness", by_command(share)),
        Way("Python", by_python(share)),
        Way("curve", by_curve(share)),
        Way("read back", read_back(share)),
        Way("other form", by_twin(share)),
        Way("sensitivity", by_sensitivity(share)),
        Way("sweep", by_sweep(share)),
        Way("difference", by_difference(share)),
        Way("virtual work", by_virtual_work(share), slow=True),
        Way("map", by_map(share), slow=True),
        *(
            [Way("modes", by_modes(share), slow=True), Way("Exudyn", by_exudyn(share), elements=True)]
            if share
            else []
        ),
    ]


# --- critical loads ----------------------------------------------------------------------------------------

LOST = ("bifurcation", "limit")
"""Events that are a loss of stability."""


def of_path(document: dict[str, Any]) -> Found:
    """What a path says of the first loss of stability."""
    lost = [event for event in document["events"] if event["kind"] in LOST]
    if lost:
        return {"critical": Between(lost[0]["force"], lost[0]["force"], LOCATED)}
    return {"critical": Between(document["points"][-1]["force"], np.inf)}


def to_of(asked: Asked) -> float:
    return asked.machine.scale


def critical_by_curve(*more: str, times: float = 1.0) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        return of_path(curve_document(asked, asked.load, times * to_of(asked), *more))

    return ask


def critical_by_exudyn(asked: Asked) -> Found:
    """By finite elements, of machines without beams: their events are located to 1e-6 of the path."""
    if asked.loaded().beams:
        return {}
    return of_path(
        asked.json(
            "curve",
            asked.model,
            "--axis",
            "load",
            "--load",
            comma(asked.load),
            "--to",
            repr(to_of(asked)),
            *ALL_FREE,
            "--engine",
            "exudyn",
        )
    )


def critical_by_buckling(asked: Asked) -> Found:
    document = asked.json(
        "buckling",
        asked.model,
        "--axis",
        "load",
        "--load",
        comma(asked.load),
        "--to",
        repr(to_of(asked)),
        "--direction",
        "+",
        *ALL_FREE,
        *ENGINE,
    )
    ((_, ways),) = document["chain"].items()
    ((_, engines),) = ways.items()
    ((_, found),) = engines.items()
    if found["critical"] in LOST:
        return {"critical": Between(found["F_cr"], found["F_cr"], LOCATED)}
    return {"critical": Between(found["F_end"], np.inf)}


NONE_UP_TO = re.compile(r"no critical load up to ([-+.\de]+) times|after 5000 points: it is at ([-+.\de]+)")


def critical_by_sensitivity(asked: Asked) -> Found:
    try:
        document = asked.json(
            "sensitivity",
            asked.model,
            "--of",
            "critical",
            "--by",
            asked.machine.keys[0],
            *loaded_words(asked.load),
            *SEGMENTS,
        )
    except RefusedError as refused:
        if (told := NONE_UP_TO.search(refused.said)) is not None:
            return {"critical": Between(float(told[1] or told[2]), np.inf)}
        if "has no critical load in this direction" in refused.said:
            return {"critical": Between(np.inf, np.inf)}
        raise
    return {"critical": Between(document["value"], document["value"], LOCATED)}


def critical_by_sensitivity_of_few(asked: Asked) -> Found:
    """Of machines that have a closed form: others take it seconds."""
    return {} if asked.machine.critical is None else critical_by_sensitivity(asked)


def critical_in_closed_form(asked: Asked) -> Found:
    exact = asked.machine.critical
    return {} if exact is None else {"critical": Between(exact, exact, LOCATED)}


def candidate(asked: Asked) -> tuple[float, str]:
    """The critical load of the closed form or of a path, and its kind; the end of the range where none is."""
    lost: list[dict[str, Any]] = []
    try:
        document = curve_document(asked, asked.load, to_of(asked))
        lost = [event for event in document["events"] if event["kind"] in LOST]
    except RefusedError:
        pass
    if asked.machine.critical is not None:
        return asked.machine.critical, lost[0]["kind"] if lost else ""
    if lost:
        return lost[0]["force"], lost[0]["kind"]
    return to_of(asked), ""


BESIDE = 0.03
"""Share by which loads are taken below and above a critical one."""


def critical_by_stiffness(asked: Asked) -> Found:
    """Stable below, refused above."""
    there, _ = candidate(asked)

    def stands(factor: float) -> bool:
        try:
            stiffness_document(asked, factor * asked.load)
        except RefusedError as refused:
            if refused.reason is not None and refused.reason.claim in ("unstable", "no equilibrium"):
                return False
            raise
        return True

    low, high = there * (1.0 - BESIDE), there * (1.0 + BESIDE)
    if not stands(low):
        return {"critical": Between(0.0, low)}
    return {"critical": Between(high, np.inf) if stands(high) else Between(low, high)}


def critical_by_modes(asked: Asked) -> Found:
    """Divergence above, none below, and the load at which the lowest frequency reaches zero."""
    there, kind = candidate(asked)

    def at(share: float) -> dict[str, Any]:
        return asked.json("modes", asked.model, *loaded_words(share * there * asked.load), *SEGMENTS)

    def lost(share: float) -> bool:
        try:
            return at(share)["verdict"] in ("divergence", "flutter")
        except RefusedError as refused:
            if refused.reason is not None and refused.reason.claim in ("unstable", "no equilibrium"):
                return True
            raise

    low, high = 1.0 - BESIDE, 1.0 + BESIDE
    if lost(low):
        return {"critical": Between(0.0, low * there)}
    found: Found = {"critical": Between(low * there, high * there) if lost(high) else Between(high * there, np.inf)}
    if kind:
        # squares of frequencies fall linearly to a bifurcation, as a root to a limit
        power = 2 if kind == "bifurcation" else 4
        near, nearer = 0.995, 0.999
        a, b = (at(share)["modes"][0]["frequency_Hz"] ** power for share in (near, nearer))
        if a > b:
            zero = there * (nearer + (nearer - near) * b / (a - b))
            found["load of frequency zero"] = Between(zero, zero, 1e-3)
    return found


def frequency_zero_expected(asked: Asked) -> Found:
    there, kind = candidate(asked)
    return {"load of frequency zero": Between(there, there, 1e-3)} if kind else {}


# --- the least critical force ------------------------------------------------------------------------------


def least_by_map(asked: Asked) -> Found:
    try:
        F, *_ = map_row(asked, "critical", "--most", repr(to_of(asked)))
    except RefusedError as refused:
        if "no critical force up to" in refused.said or "no force moves the end" in refused.said:
            return {"least critical force": Between(to_of(asked), np.inf)}
        raise
    return {"least critical force": Between(F, F, 1e-4)}


def least_direction(asked: Asked) -> Array | None:
    try:
        _, *d = map_row(asked, "critical", "--most", repr(to_of(asked)))
    except RefusedError:
        return None
    return np.array([*d, 0.0, 0.0, 0.0]) if np.all(np.isfinite(d)) else None


def least_by_curve(asked: Asked) -> Found:
    d = least_direction(asked)
    if d is None:
        return {}
    # the direction is that of a bifurcation but for rounding: beside it the path bends sharply
    document = curve_document(asked, d, to_of(asked))
    for kinds in (LOST, ("stiffness-knee",)):
        sharp = [event["force"] for event in document["events"] if event["kind"] in kinds]
        if sharp:
            return {"least critical force": Between(sharp[0], sharp[0], 1e-3)}
    return {"least critical force": of_path(document)["critical"]}


def least_at_most(asked: Asked) -> Found:
    """No larger than along the machine's own load."""
    found = of_path(curve_document(asked, asked.load, to_of(asked)))["critical"]
    assert isinstance(found, Between)
    return {"least critical force": Between(0.0, found.high, LOCATED)} if found.low == found.high else {}


# --- derivatives -------------------------------------------------------------------------------------------


def changed(asked: Asked, key: str, value: float) -> str:
    """A file with another number."""
    file = asked.new_file()
    MachineFiles.read(asked.model).with_numbers({key: value}).write(file, "", "changed")
    return str(file)


def of_file(asked: Asked, model: str, quantity: str) -> float:
    """A quantity of a machine, by another command than `sensitivity`."""
    force = LOADED * asked.machine.scale * asked.load
    match quantity:
        case "deflection":
            return float(stiffness_document(asked, force, model)["displacement"][_along(asked)])
        case "stiffness":
            i = _softest(asked)
            return 1.0 / float(compliance_of(stiffness_document(asked, force, model))[i, i])
        case "frequency":
            document = asked.json("modes", model, *loaded_words(force), *SEGMENTS)
            if document["verdict"] != "stable":
                raise RefusedError(0, f"unstable: {document['verdict']}")
            return float(document["modes"][0]["frequency_Hz"])
        case "critical":
            document = asked.json(
                "curve",
                model,
                "--axis",
                "load",
                "--load",
                comma(asked.load),
                "--to",
                repr(to_of(asked)),
                *ALL_FREE,
                *ENGINE,
            )
            found = of_path(document)["critical"]
            assert isinstance(found, Between)
            if found.low != found.high:
                raise RefusedError(0, "no critical load on this path")
            return found.low
    raise AssertionError(quantity)


def _along(asked: Asked) -> int:
    force = LOADED * asked.machine.scale * asked.load
    return int(np.argmax(np.abs(stiffness_document(asked, force)["displacement"][:3])))


def _softest(asked: Asked) -> int:
    """Number of the axis along which a force deflects the loaded machine most."""
    force = LOADED * asked.machine.scale * asked.load
    return int(np.argmax(np.diag(compliance_of(stiffness_document(asked, force)))[:3]))


def sensitivity_document(asked: Asked, quantity: str) -> dict[str, Any]:
    critical = quantity == "critical"
    force = asked.load if critical else LOADED * asked.machine.scale * asked.load
    along: tuple[str, ...] = ()
    if quantity in ("deflection", "stiffness"):
        along = ("--along", COMPONENTS[_along(asked) if quantity == "deflection" else _softest(asked)])
    return asked.json(
        "sensitivity",
        asked.model,
        "--of",
        quantity,
        *along,
        "--by",
        ",".join(asked.machine.keys),
        *loaded_words(force),
        *SEGMENTS,
    )


def _undeflected(asked: Asked) -> bool:
    """Whether the load moves nothing: what is zero has no change in per cent."""
    return abs(of_file(asked, asked.model, "deflection")) < 1e-6 * asked.length


def derivative(quantity: str) -> list[Way]:
    """Per cent a per cent, by the command and by a difference of other commands' answers."""

    def told(asked: Asked) -> Found:
        if quantity != "critical" and _undeflected(asked):
            return {}
        try:
            document = sensitivity_document(asked, quantity)
        except RefusedError as refused:
            if (quantity == "critical" and NONE_UP_TO.search(refused.said)) or "no critical load" in refused.said:
                return {}
            raise
        # one per cent of the quantity a per cent of the number is 1: what is below 1e-4 is none
        return {row["parameter"]: Value([row["relative"]], DIFFERENCED, 1e-4) for row in document["parameters"]}

    def differenced(asked: Asked) -> Found:
        if quantity != "critical" and _undeflected(asked):
            return {}
        found: Found = {}
        for key in asked.machine.keys:
            value = MachineFiles.read(asked.model).number(key)
            step = STEP * value
            try:
                a, b = (of_file(asked, changed(asked, key, value + s * step), quantity) for s in (-1.0, 1.0))
            except RefusedError as refused:
                # whether there is one at all is another question
                if quantity == "critical" and "no critical load" in refused.said:
                    return {}
                raise
            relative = (b - a) / (2.0 * STEP) / (0.5 * (a + b))
            found[key] = Value([relative], DIFFERENCED, 1e-4)
        return found

    return [Way("sensitivity", told), Way("difference", differenced)]


def value_ways(quantity: str) -> list[Way]:
    """The value itself, by `sensitivity` and by the command that computes it."""

    def told(asked: Asked) -> Found:
        return {quantity: Value([sensitivity_document(asked, quantity)["value"]], LOCATED, 1e-9)}

    def other(asked: Asked) -> Found:
        return {quantity: Value([of_file(asked, asked.model, quantity)], LOCATED, 1e-9)}

    return [Way("sensitivity", told), Way("modes", other)]


# --- designs -----------------------------------------------------------------------------------------------


def by_sweep_end(asked: Asked) -> Found:
    key, value, force = _design(asked)
    document = asked.json(
        "sweep",
        asked.model,
        "--vary",
        f"{key}={value!r}:{1.2 * value!r}:2",
        "--of",
        "deflection",
        "mass",
        *loaded_words(force),
        *SEGMENTS,
    )
    case = document["rows"][-1]["cases"][0]
    if case["why"]:
        raise RefusedError(0, case["why"])
    return {"shift at the end of the sweep": Value(np.array(case["values"][:1]), EXACT, 1e-9 * asked.length)}


def by_changed_file(asked: Asked) -> Found:
    key, value, force = _design(asked)
    document = stiffness_document(asked, force, changed(asked, key, 1.2 * value))
    size = float(np.linalg.norm(document["displacement"][:3]))
    return {"shift at the end of the sweep": Value([size], EXACT, 1e-9 * asked.length)}


def _design(asked: Asked) -> tuple[str, float, Array]:
    key = asked.machine.keys[0]
    return key, MachineFiles.read(asked.model).number(key), LOADED * asked.machine.scale * asked.load


def optimum(asked: Asked) -> tuple[float, str] | None:
    """Deflection of the best machine as the optimiser says it, and its file; None where nothing deflects."""
    if _undeflected(asked):
        return None
    key, value, force = _design(asked)
    out = str(asked.folder / "best.toml")
    document = asked.json(
        "optimise",
        asked.model,
        "--minimise",
        "deflection",
        "--vary",
        f"{key}={0.7 * value!r}:{1.4 * value!r}",
        "--starts",
        "1",
        "--out",
        out,
        *loaded_words(force),
        *SEGMENTS,
    )
    return float(document["value"]), out


def told_optimum(asked: Asked) -> Found:
    best = optimum(asked)
    return {} if best is None else {"best deflection": Value(np.array(best[:1]), EXACT, 1e-9 * asked.length)}


def evaluated_optimum(asked: Asked) -> Found:
    best = optimum(asked)
    if best is None:
        return {}
    again = float(np.linalg.norm(stiffness_document(asked, _design(asked)[2], best[1])["displacement"][:3]))
    return {
        "best deflection": Value([again], EXACT, 1e-9 * asked.length),
        "no worse than the start": Between(again, again, EXACT),
    }


def start_of_optimum(asked: Asked) -> Found:
    before = float(np.linalg.norm(stiffness_document(asked, _design(asked)[2])["displacement"][:3]))
    return {} if _undeflected(asked) else {"no worse than the start": Between(0.0, before, EXACT)}


# --- masses, shares, reach ---------------------------------------------------------------------------------


def of_mass(kg: float, tolerance: float = EXACT) -> Found:
    return {"mass": Value([kg], tolerance)}


def mass_by_check(asked: Asked) -> Found:
    told = re.search(r"mass\s+([\d.e+-]+) kg", asked.text("check", asked.model))
    assert told is not None, "check says no mass"
    # six digits are printed
    return of_mass(float(told[1]), 1e-5)


def mass_by_modes(asked: Asked) -> Found:
    return of_mass(asked.json("modes", asked.model, *SEGMENTS)["mass_kg"])


def mass_by_sensitivity(asked: Asked) -> Found:
    document = asked.json("sensitivity", asked.model, "--of", "mass", "--by", asked.machine.keys[0])
    return of_mass(document["value"])


def mass_drawn(asked: Asked) -> Found:
    return of_mass(asked.machine.mass)


def shares_document(asked: Asked) -> dict[str, Any]:
    force = LOADED * asked.machine.scale * asked.load
    found = asked.json("stiffness", asked.model, *loaded_words(force), "--shares", *SEGMENTS)
    return found["shares"][0]


def shares_told(asked: Asked) -> Found:
    row = shares_document(asked)
    energies = [part["energy"] for part in row["parts"] if part["energy"] is not None]
    found: Found = {}
    if energies:
        found["sum of energies"] = Value([sum(energies)], EXACT)
    total = np.sum([part["deflection"] for part in row["parts"]], axis=0)
    found["linear deflection"] = Value(total * unit_of(asked), EXACT, 1e-9 * asked.length)
    return found


def shares_expected(asked: Asked) -> Found:
    row = shares_document(asked)
    C = compliance_of(stiffness_document(asked, None))
    force = LOADED * asked.machine.scale * asked.load
    found: Found = {"linear deflection": Value(C @ force * unit_of(asked), EXACT, 1e-9 * asked.length)}
    if any(part["energy"] is not None for part in row["parts"]):
        found["sum of energies"] = Value(np.ones(1), EXACT)
    return found


def reach(command: str) -> Way:
    """Whether a command refuses postures that a beam does not reach."""

    def ask(asked: Asked) -> Found:
        found: Found = {}
        for posture in asked.machine.wrong_postures:
            try:
                _there(asked, command, posture)
            except RefusedError as refused:
                reason = refused.reason
                found[posture] = reason.claim if reason is not None and reason.claim else f"refused: {refused.said}"
            else:
                found[posture] = "answered"
        return found

    return Way(command, ask)


def _there(asked: Asked, command: str, posture: str) -> None:
    force = 1e-3 * asked.machine.scale * asked.load
    at = f"--posture={posture}"
    match command:
        case "stiffness":
            asked.json("stiffness", asked.model, at, *loaded_words(force), *SEGMENTS)
        case "curve":
            asked.json(
                "curve", asked.model, at, "--axis", "load", "--load", comma(force), "--to", "1", *ALL_FREE, *ENGINE
            )
        case "modes":
            asked.json("modes", asked.model, at, *loaded_words(force), *SEGMENTS)
        case "sensitivity":
            asked.json(
                "sensitivity", asked.model, at, "--by", asked.machine.keys[0], *loaded_words(force), *SEGMENTS
            )
        case "map":
            name, value = next(pair.split("=") for pair in posture.split(",") if pair.startswith(("ext", "xc")))
            found = asked.json(
                "map", asked.model, "--grid", f"{name}={value}", *ENGINE, "--jobs", "1", "--out", asked.new_folder()
            )
            if found["status"][0] != "ok":
                raise RefusedError(0, found["status"][0])
        case "Python":
            values = {name: float(v) for name, v in (pair.split("=") for pair in posture.split(","))}
            try:
                vjm.stiffness(asked.loaded(), values, wrench=force, options=asked.options)
            except (ValueError, vjm.NoConvergenceError) as error:
                raise RefusedError(2, str(error)) from None
        case "_expected":
            raise RefusedError(2, "beyond its free length")
        case _:
            raise AssertionError(command)


# --- descriptions ------------------------------------------------------------------------------------------


def of_machine(machine: Machine, values: dict[str, float], tool: str) -> Found:
    """What a description of rigid bodies holds: the weight and, in the drawn posture, the tool's place."""
    machine, label = vjm.in_posture(machine, values) if values else (machine, next(iter(machine.postures)))
    model = TreeModel(machine)
    at_end = {part: name for name, part in machine.ends.items()}.get(tool, "tool")
    end = model.ends.index(at_end) if at_end in model.ends else 0
    place = unloaded_frames(model, model.posture(label))[1][0, end]
    # MuJoCo takes no moving body without a mass: such a body has 1e-9 kg there. Rotations are written to 1e-16
    return {
        "mass": Value([sum(getattr(part, "mass", 0.0) for part in machine.parts)], 1e-9, 1e-7),
        "place of the tool": Value(place, 1e-9, 1e-9),
    }


def described(option: str, suffix: str) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        machine = asked.loaded()
        if option == "--urdf" and machine.closures:
            return {}
        written, read = asked.folder / f"out{suffix}", asked.new_file()
        asked.text("export", asked.model, option, str(written), "--force")
        asked.text("import", str(written), "--out", str(read))
        imported = vjm.load(read)
        return of_machine(imported, drawn_values(imported, machine), machine.parts[-1].name)

    return ask


def drawn_values(imported: Machine, machine: Machine) -> dict[str, float]:
    """Coordinates of the drawn posture that an imported machine takes; its own keyframe where loops close."""
    if machine.closures:
        return {}
    values = posture_values(machine, next(iter(machine.postures)))
    return {name: v for name, v in values.items() if name in {part.name for part in imported.moving}}


def as_drawn(asked: Asked) -> Found:
    return of_machine(asked.loaded(), {}, "")


# --- chains whose end is held ------------------------------------------------------------------------------


def held_words(asked: Asked) -> float:
    """mm of pressing by which the chain is bent noticeably."""
    return -1.0


def held_by_stiffness(asked: Asked) -> Found:
    document = asked.json(
        "stiffness", asked.model, "--displacement", comma([held_words(asked), 0, 0, 0, 0, 0]), *SEGMENTS
    )
    return _of_wrench(asked, document["wrench"])


def held_by_python(asked: Asked) -> Found:
    found = vjm.stiffness(asked.loaded(), displacement=(held_words(asked), 0, 0, 0, 0, 0), options=asked.options)
    return _of_wrench(asked, found.wrench)


def held_by_curve(asked: Asked) -> Found:
    document = asked.json("curve", asked.model, "--to", repr(held_words(asked)), *ENGINE)
    return _of_wrench(asked, document["points"][-1]["wrench"]) | _first_event(document)


def held_by_buckling(asked: Asked) -> Found:
    document = asked.json("buckling", asked.model, "--to", repr(-held_words(asked)), "--direction=-", *ENGINE)
    ((_, ways),) = document["chain"].items()
    ((_, engines),) = ways.items()
    ((_, found),) = engines.items()
    if found["critical"] in LOST:
        return {"critical": Between(found["F_cr"], found["F_cr"], LOCATED)}
    return {"critical": Between(found["F_end"], np.inf)}


def _of_wrench(asked: Asked, wrench: Any) -> Found:
    numbers = np.asarray(wrench, dtype=float) / unit_of(asked)
    # several stable branches are mirror images of each other
    return {"force along the ramp": Value(np.abs(numbers[:1]), EXACT, 1e-9 * asked.machine.scale)}


def _first_event(document: dict[str, Any]) -> Found:
    lost = [event for event in document["events"] if event["kind"] in LOST]
    if lost:
        return {"critical": Between(lost[0]["force"], lost[0]["force"], LOCATED)}
    return {"critical": Between(max(abs(p["force"]) for p in document["points"]), np.inf)}


QUESTIONS = (
    Question("unloaded stiffness", stiffness_ways(UNLOADED), free),
    Question("loaded stiffness", stiffness_ways(LOADED), free),
    Question(
        "critical load",
        [
            Way("closed form", critical_in_closed_form),
            Way("curve", critical_by_curve()),
            Way("curve, 7 steps", critical_by_curve("--steps", "7")),
            Way("curve, to its limit", critical_by_curve("--control", "limit"), slow=True),
            Way("curve, ten times as far", critical_by_curve(times=10.0), slow=True),
            Way("Exudyn", critical_by_exudyn, elements=True),
            Way("buckling", critical_by_buckling),
            Way("sensitivity", critical_by_sensitivity_of_few),
            Way("sensitivity of any", critical_by_sensitivity, slow=True),
            Way("stiffness", critical_by_stiffness),
            Way("modes", critical_by_modes),
            Way("load of the path", frequency_zero_expected),
        ],
        free,
    ),
    Question(
        "least critical force",
        [
            Way("map", least_by_map, slow=True),
            Way("curve there", least_by_curve, slow=True),
            Way("curve along the load", least_at_most, slow=True),
        ],
        free,
        every=2,
    ),
    *(
        Question(f"derivative of the {quantity}", derivative(quantity), free, every=2)
        for quantity in ("deflection", "stiffness", "frequency", "critical")
    ),
    Question("frequency", value_ways("frequency"), free),
    Question("sweep", [Way("sweep", by_sweep_end), Way("stiffness", by_changed_file)], free),
    Question(
        "optimum",
        [
            Way("optimise", told_optimum, slow=True),
            Way("stiffness", evaluated_optimum, slow=True),
            Way("start", start_of_optimum, slow=True),
        ],
        free,
        every=3,
    ),
    Question(
        "mass",
        [
            Way("drawing", mass_drawn),
            Way("check", mass_by_check),
            Way("modes", mass_by_modes),
            Way("sensitivity", mass_by_sensitivity),
        ],
        free,
    ),
    Question(
        "description",
        [
            Way("model", as_drawn, slow=True),
            Way("URDF", described("--urdf", ".urdf"), slow=True),
            Way("MJCF", described("--mjcf", ".xml"), slow=True),
        ],
        lambda machine: free(machine) and not machine.wrong_postures,
    ),
    Question("shares", [Way("shares", shares_told), Way("stiffness", shares_expected)], free),
    Question(
        "reach of a beam",
        [reach(name) for name in ("_expected", "stiffness", "curve", "modes", "sensitivity", "map", "Python")],
        lambda machine: bool(machine.wrong_postures),
    ),
    Question(
        "held end",
        [
            Way("stiffness", held_by_stiffness),
            Way("Python", held_by_python),
            Way("curve", held_by_curve),
            Way("buckling", held_by_buckling),
        ],
        lambda machine: machine.end == HELD_END,
    ),
)


QUICK_EVERY = 3
"""Machines of a kind in the quick run: each is asked a third of the questions, and together they are asked all."""


def asked_of(machine: Drawn, *, slow: bool) -> list[Question]:
    """The questions for a machine: over several machines of its kind all that fit."""
    turn = machine.seed // len(KINDS)
    return [
        question
        for place, question in enumerate(QUESTIONS)
        if question.fits(machine)
        and (turn + place) % max(question.every, 1 if slow else QUICK_EVERY) == 0
        and sum(slow or not way.slow for way in question.ways) > 1
    ]
