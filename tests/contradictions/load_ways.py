"""Ways to the stiffness, the deflection, and the critical load of a machine."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from helpers.random_machines import REGULAR
from helpers.virtual_work import NoEquilibriumError, Statics, posture_values

import vjm
from contradictions.answers import GIVEN, SPRINGS, Asked, Between, Found, RefusedError, Value, Way
from contradictions.sketches import FREE_END, Drawn
from vjm.io.file_parameters import MachineFiles
from vjm.machine.equilibria import unloaded_frames
from vjm.machine.inverse_kinematics import ranges_of
from vjm.model.load_case import COMPONENTS
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm_updating.maps.evaluate import principal
from vjm_updating.maps.grid import grid_origin

EXACT = 1e-6
"""Relative. Equilibria are solved to 1e-11 of their forces, and closed loops have conditions up to 1e5."""
DIFFERENCED = 1e-3
"""Relative, of a quotient of differences over a thousandth: the third derivative, and rounding over the step."""
LOCATED = 1e-5
"""Relative. Critical points are located to 1e-9 of a path; four springs a beam are the same everywhere."""
QUARTERS = (0.0, 0.25, 0.5, 0.75)
HALVINGS = 6
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
    most_compliant = [1.0 / kt_min, asked.length**2 / kr_min]
    return {
        "compliance": Value(scaled(asked, C).ravel(), EXACT, least),
        "most compliant directions": Value(np.array(most_compliant), EXACT, least),
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


def of_stiffness(asked: Asked, share: float, model: str = "") -> Found:
    """What `stiffness` says of a file, the machine's own where none is named."""
    document = stiffness_document(asked, share * asked.machine.scale * asked.load if share else None, model)
    return of_compliance(asked, compliance_of(document)) | of_shift(asked, document["displacement"])


def by_command(share: float) -> Callable[[Asked], Found]:
    return lambda asked: of_stiffness(asked, share)


def by_twin(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        twin = asked.machine.twin
        return of_stiffness(asked, share, str(asked.folder / twin)) if twin else {}

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
        return of_stiffness(asked, share, str(file))

    return ask


def by_virtual_work(share: float) -> Callable[[Asked], Found]:
    """By a solver that shares nothing with the package but the description of the parts."""

    def ask(asked: Asked) -> Found:
        engine = vjm.engine_by_name("vjm", asked.options, asked.loaded())
        assert isinstance(engine, vjm.VjmEngine)
        machine = engine.split(asked.loaded())
        q = posture_values(machine, next(iter(machine.postures)))
        full = share * asked.machine.scale * asked.load
        statics = Statics(machine, q, wrenches={"": full})
        if asked.loaded().closures and statics.first_step()[1] < REGULAR:
            # its equations take closures to be independent: of redundant ones it knows nothing
            return {}
        try:
            found = statics.solve()
            before = [Statics(machine, q, wrenches={"": part * full}).solve() for part in QUARTERS if share]
        except NoEquilibriumError:
            # Newton's method from the drawing: what it does not find, it does not deny
            return {}
        steps = np.diff([each.displacements[""][:3] for each in (*before, found)], axis=0)
        change = np.linalg.norm(np.diff(steps, axis=0), axis=1)
        if np.any(change > 0.5 * np.linalg.norm(steps[1:], axis=1)):
            # it may have jumped to a state that no path leads to
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
    model = Mechanism(machine.split())
    q = model.posture(next(iter(machine.postures)))
    for name, value, driven in zip(model.joints, q, ranges_of(model).driven, strict=True):
        if driven:
            return f"{name}={float(value)!r}"
    x, y, z = (unloaded_frames(model, q)[1] - grid_origin(model))[0, 0]
    return f"x={float(x)!r},y={float(y)!r},z={float(z)!r}"


def map_row(asked: Asked, quantity: str, *more: str) -> list[float]:
    """Values at the one point."""
    words = (f"--grid={grid_here(asked)}", f"--quantity={quantity}", *ENGINE, "--jobs=1", *more)
    found = asked.json("map", asked.model, *words, "--out", asked.new_folder())
    (status,) = found["status"]
    if status != "ok":
        raise RefusedError(0, status)
    return [np.inf if v is None else v for v in found["values"][0]]


def by_map(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        force = share * asked.machine.scale * asked.load
        kt, _, kr, _ = map_row(asked, "stiffness", *(loaded_words(force) if share else ()))
        numbers = np.array([1.0 / kt, asked.length**2 / kr])
        found: Found = {"most compliant directions": Value(numbers, EXACT, floor_of(asked))}
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
            by = ("--along=x", f"--by={asked.machine.keys[0]}")
            document = asked.json("sensitivity", asked.model, "--of=stiffness", *by, *words, *SEGMENTS)
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


def ramp_of(load: Array, to: float) -> tuple[str, ...]:
    """Words for a load that grows, and nothing holds the end."""
    return ("--axis=load", f"--load={comma(load)}", f"--to={float(to)!r}", *ALL_FREE)


def curve_document(asked: Asked, load: Array, to: float, *more: str, engine=ENGINE, model="") -> dict[str, Any]:
    return asked.json("curve", model or asked.model, *ramp_of(load, to), *engine, *more)


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
    """By displacements under a little less and a little more load, with steps that halve."""

    def ask(asked: Asked) -> Found:
        whole = share * asked.machine.scale
        size = STEP * (whole or 0.1 * asked.machine.scale)
        coarse = change = np.nan
        for _ in range(HALVINGS):
            try:
                ends = [stiffness_document(asked, (whole + s * size) * asked.load) for s in (-1.0, 1.0)]
            except RefusedError as refused:
                if refused.reason is None:
                    raise
                # which is said of a load beside
                return {}
            a, b = (np.array(each["displacement"]) for each in ends)
            fine = float(asked.load @ (b - a)) / (2.0 * size)
            floor = floor_of(asked) + DIFFERENCED * abs(fine)
            before, change = change, fine - coarse
            # by the third derivative each change is a quarter of the one before, and the error a third of it
            if abs(change) <= floor or abs(before - 4.0 * change) <= abs(change):
                return {"compliance along the load": Value([fine], 0.0, floor + abs(change))}
            coarse, size = fine, 0.5 * size
        return {}

    return ask


def by_modes(share: float) -> Callable[[Asked], Found]:
    def ask(asked: Asked) -> Found:
        force = share * asked.machine.scale * asked.load
        document = asked.json("modes", asked.model, *loaded_words(force), *SEGMENTS)
        if document["verdict"] == "divergence":
            return {GIVEN: "unstable"}
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
    return of_path(curve_document(asked, asked.load, to_of(asked), engine=("--engine=exudyn",)))


def critical_by_buckling(asked: Asked) -> Found:
    words = ramp_of(asked.load, to_of(asked))
    return of_buckling(asked.json("buckling", asked.model, *words, "--direction=+", *ENGINE))


def of_buckling(document: dict[str, Any]) -> Found:
    """What `buckling` says of one posture, direction and engine."""
    ((_, ways),) = document["chain"].items()
    ((_, engines),) = ways.items()
    ((_, found),) = engines.items()
    if found["critical"] in LOST:
        return {"critical": Between(found["F_cr"], found["F_cr"], LOCATED)}
    return {"critical": Between(found["F_end"], np.inf)}


NONE_UP_TO = re.compile(r"no critical load up to ([-+.\de]+) times|after 5000 points: it is at ([-+.\de]+)")


def critical_by_sensitivity(asked: Asked) -> Found:
    try:
        by = f"--by={asked.machine.keys[0]}"
        document = asked.json("sensitivity", asked.model, "--of=critical", by, *loaded_words(asked.load), *SEGMENTS)
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


NEARLY = 0.02
"""Eigenvalue beside a bifurcation, over that without a force: by the root of the 1e-5 to which its place is known,
and a few steps of the path."""


def least_by_map(asked: Asked) -> Found:
    try:
        F, *_ = map_row(asked, "critical", "--most", repr(to_of(asked)))
    except RefusedError as refused:
        if "no critical force up to" in refused.said:
            return {"least critical force": Between(to_of(asked), np.inf)}
        raise
    return {"least critical force": Between(F, F, 1e-4)}


def least_by_curve(asked: Asked) -> Found:
    try:
        F, *d = map_row(asked, "critical", "--most", repr(to_of(asked)))
    except RefusedError:
        return {}
    if not np.all(np.isfinite(d)):
        return {}
    # in steps as short as the force asks for
    document = curve_document(asked, np.array([*d, 0.0, 0.0, 0.0]), min(to_of(asked), 1.5 * F))
    found = of_path(document)["critical"]
    assert isinstance(found, Between)
    # the direction is that of a bifurcation but for rounding: beside it the smallest eigenvalue all but vanishes
    force, left = np.array([[p["force"], p["eigenvalue_relative"]] for p in document["points"]]).T
    dips = [k for k in range(1, len(left) - 1) if left[k] <= min(*left[[k - 1, k + 1]], NEARLY * left[0])]
    if dips and force[dips[0] + 1] < found.low:
        return {"least critical force": Between(force[dips[0] - 1], force[dips[0] + 1], 1e-3)}
    return {"least critical force": Between(found.low, found.high, 1e-3)}


def least_at_most(asked: Asked) -> Found:
    """No larger than along the machine's own load."""
    found = of_path(curve_document(asked, asked.load, to_of(asked)))["critical"]
    assert isinstance(found, Between)
    return {"least critical force": Between(0.0, found.high, LOCATED)} if found.low == found.high else {}
