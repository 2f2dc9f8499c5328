"""Ways to derivatives, designs, masses, shares, reach, descriptions, and held ends."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
from helpers.virtual_work import posture_values

import vjm
from contradictions.answers import Asked, Between, Found, RefusedError, Value, Way
from contradictions.load_ways import (
    DIFFERENCED,
    ENGINE,
    EXACT,
    LOADED,
    LOCATED,
    LOST,
    NONE_UP_TO,
    SEGMENTS,
    STEP,
    comma,
    compliance_of,
    curve_document,
    loaded_words,
    of_buckling,
    of_path,
    stiffness_document,
    to_of,
    unit_of,
)
from vjm.io.file_parameters import MachineFiles
from vjm.machine.equilibria import unloaded_frames
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array

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
            i = _most_compliant(asked)
            return 1.0 / float(compliance_of(stiffness_document(asked, force, model))[i, i])
        case "frequency":
            document = asked.json("modes", model, *loaded_words(force), *SEGMENTS)
            if document["verdict"] != "stable":
                raise RefusedError(0, f"unstable: {document['verdict']}")
            return float(document["modes"][0]["frequency_Hz"])
        case "critical":
            found = of_path(curve_document(asked, asked.load, to_of(asked), model=model))["critical"]
            assert isinstance(found, Between)
            if found.low != found.high:
                raise RefusedError(0, "no critical load on this path")
            return found.low
    raise AssertionError(quantity)


def _along(asked: Asked) -> int:
    force = LOADED * asked.machine.scale * asked.load
    return int(np.argmax(np.abs(stiffness_document(asked, force)["displacement"][:3])))


def _most_compliant(asked: Asked) -> int:
    """Number of the axis along which a force deflects the loaded machine most."""
    force = LOADED * asked.machine.scale * asked.load
    return int(np.argmax(np.diag(compliance_of(stiffness_document(asked, force)))[:3]))


def sensitivity_document(asked: Asked, quantity: str) -> dict[str, Any]:
    critical = quantity == "critical"
    force = asked.load if critical else LOADED * asked.machine.scale * asked.load
    along: tuple[str, ...] = ()
    if quantity in ("deflection", "stiffness"):
        along = ("--along", COMPONENTS[_along(asked) if quantity == "deflection" else _most_compliant(asked)])
    words = (f"--of={quantity}", *along, f"--by={','.join(asked.machine.keys)}", *loaded_words(force), *SEGMENTS)
    return asked.json("sensitivity", asked.model, *words)


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
    words = ("--vary", f"{key}={value!r}:{1.2 * value!r}:2", "--of", "deflection", "mass")
    document = asked.json("sweep", asked.model, *words, *loaded_words(force), *SEGMENTS)
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
    vary = ("--vary", f"{key}={0.7 * value!r}:{1.4 * value!r}")
    words = ("--no-confirm", "--minimise=deflection", *vary, "--starts=1", "--out", out)
    document = asked.json("optimise", asked.model, *words, *loaded_words(force), *SEGMENTS)
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
            curve_document(asked, force, 1.0, at)
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
    model = Mechanism(machine.split())
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


PRESSED = -1.0
"""mm by which the chain is pressed and bent noticeably."""


def held_by_stiffness(asked: Asked) -> Found:
    document = asked.json("stiffness", asked.model, "--displacement", comma([PRESSED, 0, 0, 0, 0, 0]), *SEGMENTS)
    return _of_wrench(asked, document["wrench"])


def held_by_python(asked: Asked) -> Found:
    found = vjm.stiffness(asked.loaded(), displacement=(PRESSED, 0, 0, 0, 0, 0), options=asked.options)
    return _of_wrench(asked, found.wrench)


def held_by_curve(asked: Asked) -> Found:
    document = asked.json("curve", asked.model, "--to", repr(PRESSED), *ENGINE)
    return _of_wrench(asked, document["points"][-1]["wrench"]) | _first_event(document)


def held_by_buckling(asked: Asked) -> Found:
    return of_buckling(asked.json("buckling", asked.model, f"--to={-PRESSED!r}", "--direction=-", *ENGINE))


def _of_wrench(asked: Asked, wrench: Any) -> Found:
    numbers = np.asarray(wrench, dtype=float) / unit_of(asked)
    # several stable branches are mirror images of each other
    return {"force along the ramp": Value(np.abs(numbers[:1]), EXACT, 1e-9 * asked.machine.scale)}


def _first_event(document: dict[str, Any]) -> Found:
    lost = [event for event in document["events"] if event["kind"] in LOST]
    if lost:
        return {"critical": Between(lost[0]["force"], lost[0]["force"], LOCATED)}
    return {"critical": Between(max(abs(p["force"]) for p in document["points"]), np.inf)}
