"""``validate all MODEL``: a user's own machine in all its postures, engines side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vjm.engine import Engine
from vjm.engines import EngineOptions, engine_by_name
from vjm.loaded_stiffness import held_by_itself
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.tree.equilibria import Equilibria, equilibria
from vjm.vjm_engine import VjmEngine
from vjm_validation.load_any_model import in_postures, loaded
from vjm_validation.studies.force_directions import unit_of
from vjm_validation.studies.own_machine_design import design
from vjm_validation.studies.own_machine_paths import (
    ELEMENTS,
    FEW_ELEMENTS,
    SPRINGS,
    SPRINGS_HELD,
    converge,
    trace_critical,
    trace_loads,
)
from vjm_validation.studies.own_machine_request import (
    OwnMachine,
    Progress,
    Request,
    end_name,
    extent,
    solved,
)
from vjm_validation.studies.own_machine_rows import EndStiffnessRow

DEFLECTION = 0.005
"""Of the machine's size: how far the default force moves the end at most, by linear theory."""
REACH = 0.013
"""Of the longest part: how far an imposed pose goes by default; the paper's 4 mm of 310 mm."""
RIGID = 1e-12
"""Of the largest compliance of its kind: less is rounding, and no deflection."""


def study(request: Request, progress: Progress = lambda name, done, total: None) -> OwnMachine:
    """Load the machine in every posture and direction with every engine.

    Raises:
        ModelFileError: the file is no model.
        ValueError: no such posture, direction or engine.
    """
    drawn, labels = in_postures(loaded(request.model), request.postures)
    for direction in request.directions:
        unit_of(direction)
    machine = solved(drawn)
    held = not held_by_itself(machine, labels[0])
    springs = SPRINGS_HELD[-2] if held else SPRINGS[-2]
    lumped = engine_by_name(request.engines[0], EngineOptions(springs), machine)
    if not isinstance(lumped, VjmEngine):
        raise ValueError(f"--engine {request.engines[0]}: the first engine must be vjm, vjm-paper or vjm-<n>")
    lumped = _refined(lumped, machine)
    found = OwnMachine(machine, drawn, held, _size(request, machine, labels, lumped, held))
    engines: list[Engine] = [lumped]
    for name in request.engines[1:]:
        try:
            engines.append(engine_by_name(name, EngineOptions(ELEMENTS if held else FEW_ELEMENTS), machine))
        except (ValueError, ImportError) as error:
            found.note(f"{name} was left out: {error}")
    if not held:
        found.stiffness = _stiffness(request, found, labels, lumped)
    trace_loads(request, found, labels, engines, progress)
    trace_critical(request, found, labels, engines, progress)
    converge(found, lumped, progress)
    design(request, found, labels, progress)
    return found


def _refined(engine: VjmEngine, machine: Machine) -> VjmEngine:
    """The engine with its springs in beams too that have a smaller number of their own: elements split them all."""
    n = engine.segments
    if n is None:
        return engine
    few = [beam.name for beam in machine.beams if beam.section is not None and (beam.own_segments or n) < n]
    return replace(engine, parts=(*((name, n) for name in few), *engine.parts))


def _size(request: Request, machine: Machine, labels: Sequence[str], lumped: VjmEngine, held: bool) -> float:
    if held:
        return request.reach or _round(REACH * machine.characteristic_length)
    if request.force is not None:
        return request.force
    largest_compliance, model = 0.0, lumped.model(machine)
    for label in labels:
        C = _compliance(equilibria(model, model.posture(label)))[model.ends.index(end_name(machine))]
        largest_compliance = max(
            largest_compliance, *(float(unit_of(d) @ C @ unit_of(d)) for d in request.directions)
        )
    if not largest_compliance > 0.0:
        raise ValueError(f"{machine.name}: nothing deflects in the directions asked for")
    return _round(DEFLECTION * extent(machine) / largest_compliance)


def _round(value: float) -> float:
    """Down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= value))


def _compliance(at: Equilibria) -> Array:
    """``(e, 6, 6)`` of the first posture."""
    assert at.compliance is not None
    C: Array = at.compliance[0]
    return C


def _stiffness(
    request: Request, found: OwnMachine, labels: Sequence[str], lumped: VjmEngine
) -> list[EndStiffnessRow]:
    model, rows = lumped.model(found.machine), []
    for label in labels:
        for load in ("none", "weight") if request.gravity else ("none",):
            gravity = request.gravity if load == "weight" else None
            at = equilibria(model, model.posture(label), gravity=gravity)
            if not at.found[0]:
                found.note(f"posture {label}, load {load}: no equilibrium, and so no stiffness")
                continue
            for end, C in zip(model.ends, _compliance(at), strict=True):
                along = [_along(C, unit) for unit in np.eye(6)]
                rows.append(EndStiffnessRow(posture=label, end=end, load=load, along=along))
    return rows


def _along(C: Array, unit: Array) -> float | None:
    """Stiffness along or about a direction ``(6,)`` of a compliance ``(6, 6)``; None where nothing deflects."""
    compliance, kind = float(unit @ C @ unit), slice(0, 3) if unit[:3].any() else slice(3, 6)
    # the residual of a direction in which nothing moves is rounding
    return 1.0 / compliance if compliance > RIGID * float(np.diag(C)[kind].max()) else None
