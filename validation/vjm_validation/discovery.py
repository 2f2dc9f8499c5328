"""The suite's own discovery: finite elements' data under a sheet with one spring per link, diagnosed.

Exudyn's beams are pulled and pushed in posture A, with tolerances, zeros, scales and noise drawn as a test rig has
them. The sheet says the paper's model. `vjm_validation.diagnosis` reads the two files and nothing else.
"""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np

from vjm.chain import Chain
from vjm.effects.machine import Machine
from vjm.io.files import write_whole
from vjm.io.model_file import load_chain
from vjm.paths import EventKind
from vjm.programme import Programme
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_fea.exudyn_engine import ExudynEngine
from vjm_validation.blind.designs import Design, Known, Sequence
from vjm_validation.blind.drawing import by_finite_elements
from vjm_validation.blind.noise import read, with_nuisances
from vjm_validation.blind.rig import drawn
from vjm_validation.blind.sheets import data_text, sheet_text
from vjm_validation.diagnosis.command import MODEL, PAGE, diagnose
from vjm_validation.diagnosis.document import Diagnosis
from vjm_validation.discovered import Discovery, DiscoveryStudy
from vjm_validation.engines import engine_by_name
from vjm_validation.measurement import read_measurement

POSTURE = "A"
PULL, PUSH = 1.2, 2.4
"""mm: past where the paper's model buckles in tension, short of where beams buckle in compression."""
FURTHER = 3.4
"""mm of compression to which the models are taken: past all critical points."""
SEED = 31
ELEMENTS = 16


def design() -> Design:
    """Pull and push in posture A, forces along and across read."""
    ux: Array = np.concatenate([np.linspace(0.0, PULL, 25), np.linspace(PULL - 0.05, -PUSH, 60)])
    time = np.linspace(300.0, 298.0 + 2.0 * len(ux), len(ux))
    sequence = Sequence(POSTURE, ux, time, np.full(len(ux), 21.0))
    instruments = {"ux_mm": Known(0.0005, 0.002, 0.001)} | dict.fromkeys(("fx_N", "fz_N"), Known(2.0, 3.0, 0.003))
    return Design(3 * 10**6, "posture A", (sequence,), instruments, link_segments=1, foot_segments=8, memory=0.0)


def write_data(folder: FilePath, seed: int = SEED) -> dict[str, float]:
    """Write ``sheet.toml`` and ``data.csv`` of finite elements; what tolerances and instruments were drawn.

    Raises:
        NoTruthError: the finite elements have no smooth path.
    """
    plan, rng = design(), np.random.default_rng(seed)
    rig, errors = with_nuisances(drawn(plan), plan, rng)
    elements = by_finite_elements(rig)
    assert elements is not None
    seen, _ = read(plan, elements.response(plan), rng)
    write_whole(folder / "sheet.toml", sheet_text(plan, "finite elements, posture A"))
    write_whole(folder / "data.csv", data_text(plan, seen.ux, seen.forces))
    return errors


def study(out: FilePath) -> DiscoveryStudy:
    """Make the data, diagnose them, and take both models along the test and beyond.

    Args:
        out: the run's folder; the files go to ``discovery`` in it.
    """
    folder = out / "discovery"
    errors = write_data(folder)
    data, sheet = folder / "data.csv", folder / "sheet.toml"
    found = diagnose(data, sheet, folder)
    measurement = read_measurement(data, sheet)
    extended = load_chain(folder / MODEL)
    models = (measurement.engine, measurement.chain), (engine_by_name("vjm", chain=extended), extended)
    nominal, longer = (
        (engine.walk(chain, Programme(POSTURE, PULL + 0.1)), engine.walk(chain, Programme(POSTURE, -FURTHER)))
        for engine, chain in models
    )
    readings = measurement.readings
    return DiscoveryStudy(
        _rows(found, _truth(measurement.chain, errors)),
        f"{folder.name}/{PAGE}",
        readings.values["ux_mm"],
        readings.values["fx_N"],
        nominal,
        longer,
    )


def _truth(chain: Chain, errors: dict[str, float]) -> float | None:
    """Critical force in compression of the finite elements that made the data."""
    machine = Machine(chain, VjmEngine()).longer("link", errors["length link"])
    for part in ("foot", "link"):
        machine = machine.times(part, 1.0 / (1.0 + errors[f"modulus {part}"]))
    event = ExudynEngine(elements=ELEMENTS).walk(machine.chain(), Programme(POSTURE, -FURTHER)).critical
    return event.force if event is not None and event.kind is EventKind.BIFURCATION else None


def _rows(found: Diagnosis, truth: float | None) -> Discovery:
    return Discovery(
        verdict=found.verdict,
        causes=found.causes,
        confidence=found.confidence,
        held_out=found.gain.folds if found.gain is not None else [],
        critical=found.critical,
        truth_N=truth,
        readings=found.noise.readings if found.noise is not None else 0,
        seconds=found.seconds,
    )
