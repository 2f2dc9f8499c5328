"""The suite's own discovery: finite elements' data under a sheet with one spring per link, diagnosed.

Exudyn's beams are pulled and pushed in posture A, with tolerances, zeros, scales and noise drawn as a test rig has
them. The sheet says the paper's model. `vjm_updating.diagnosis` reads the two files and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from scipy.interpolate import CubicSpline

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine, engine_by_name
from vjm.io.files import write_whole
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_updating import diagnose, load_data
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.experiment import read_measurement
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.result import EXTENDED
from vjm_validation.studies.chain import Discovery, DiscoveryStudy
from vjm_validation.virtual_rig import Design, Known, RigResponse, Sequence, data_text, read, sheet_text

POSTURE = "A"
PULL, PUSH = 1.2, 2.4
"""mm: past where the paper's model buckles in tension, short of where beams buckle in compression."""
FURTHER = 3.4
"""mm of compression to which the models are taken: past all critical points."""
SEED = 31
ELEMENTS, STEPS = 16, 16
"""Of each beam, and of each direction's path."""


def design() -> Design:
    """Pull and push in posture A, forces along and across read."""
    ux: Array = np.concatenate([np.linspace(0.0, PULL, 25), np.linspace(PULL - 0.05, -PUSH, 60)])
    time = np.linspace(300.0, 298.0 + 2.0 * len(ux), len(ux))
    sequence = Sequence(POSTURE, ux, time, np.full(len(ux), 21.0))
    instruments = {"ux_mm": Known(0.0005, 0.002, 0.001)} | dict.fromkeys(("fx_N", "fz_N"), Known(2.0, 3.0, 0.003))
    return Design(
        3 * 10**6, "posture A", (sequence,), instruments, link_segments=1, foot_segments=8, autocorrelation=0.0
    )


@dataclass(frozen=True)
class DrawnMachine:
    """The machine on the rig, drawn within its sheet's tolerances.

    Attributes:
        longer: mm by which the link is longer than drawn.
        foot: compliance of the foot over its nominal one.
        link: of the link, likewise.
    """

    longer: float
    foot: float
    link: float

    def chain(self, nominal: Machine) -> Machine:
        """The chain that was built."""
        machine = ModifiedChain(nominal, VjmEngine()).longer("link", self.longer)
        return machine.times("foot", self.foot).times("link", self.link).chain()


def draw(plan: Design, rng: np.random.Generator) -> tuple[DrawnMachine, dict[str, tuple[float, float]]]:
    """A machine within its sheet's tolerances, and each channel's errors of scale and zero."""
    longer = plan.length * float(rng.standard_normal())
    foot, link = (1.0 / (1.0 + plan.modulus * float(rng.standard_normal())) for _ in range(2))
    errors = {}
    for name, known in plan.instruments.items():
        scale = known.scale * float(rng.standard_normal())
        errors[name] = scale, known.zero * float(rng.standard_normal())
    return DrawnMachine(longer, foot, link), errors


def forces(plan: Design, chain: Machine) -> Array:
    """Wrench channels ``(n, c)`` that finite elements need at the plan's displacements.

    Raises:
        ValueError: the finite elements have no smooth path.
    """
    engine, ux = ExudynEngine(foot_spring=False, elements=ELEMENTS), plan.sequences[0].ux
    wrench = np.zeros((len(ux), 6))
    for sign in (1.0, -1.0):
        mask = ux * sign > 0.0
        path = engine.trace(chain, LoadCase(POSTURE, sign * float(np.abs(ux[mask]).max()), steps=STEPS))
        if not path.complete or path.events:
            raise ValueError(f"posture {POSTURE}: no smooth path of finite elements")
        wrench[mask] = CubicSpline(path.s, path.wrench)(np.abs(ux[mask]))
    result: Array = wrench[:, plan.columns]
    return result


def write_data(folder: FilePath, seed: int = SEED) -> DrawnMachine:
    """Write ``sheet.toml`` and ``data.csv`` of finite elements; the machine that was drawn.

    Raises:
        ValueError: the finite elements have no smooth path.
    """
    plan, rng = design(), np.random.default_rng(seed)
    specimen, errors = draw(plan, rng)
    values = {"ux_mm": plan.sequences[0].ux} | dict(
        zip(plan.channels, forces(plan, specimen.chain(plan.chain())).T, strict=True)
    )
    for name, (scale, zero) in errors.items():
        values[name] = values[name] + (scale * values[name] + zero)
    still = RigResponse(values["ux_mm"], np.column_stack([values[name] for name in plan.channels]))
    seen, _ = read(plan, still, rng)
    write_whole(folder / "sheet.toml", sheet_text(plan, "finite elements, posture A"))
    write_whole(folder / "data.csv", data_text(plan, seen.ux, seen.forces))
    return specimen


def study(out: FilePath) -> DiscoveryStudy:
    """Make the data, diagnose them, and take both models along the test and beyond.

    Args:
        out: the run's folder; the files go to ``discovery`` in it.
    """
    folder = out / "discovery"
    specimen = write_data(folder)
    data, sheet = folder / "data.csv", folder / "sheet.toml"
    diagnosed = diagnose(load_data(data, sheet))
    diagnosed.write(folder)
    diagnosis = diagnosed.found
    assert isinstance(diagnosis, Diagnosis)  # the sheet is one of ramps
    measurement = read_measurement(data, sheet)
    extended = load_chain(folder / EXTENDED)
    models = (measurement.engine, measurement.chain), (engine_by_name("vjm", chain=extended), extended)
    nominal, longer = (
        (engine.trace(chain, LoadCase(POSTURE, PULL + 0.1)), engine.trace(chain, LoadCase(POSTURE, -FURTHER)))
        for engine, chain in models
    )
    readings = measurement.readings
    return DiscoveryStudy(
        _rows(diagnosis, _truth(measurement.chain, specimen)),
        f"{folder.name}/diagnosis.html",
        readings.values["ux_mm"],
        readings.values["fx_N"],
        nominal,
        longer,
    )


def _truth(chain: Machine, specimen: DrawnMachine) -> float | None:
    """Critical force in compression of the finite elements that made the data."""
    event = ExudynEngine(elements=ELEMENTS).trace(specimen.chain(chain), LoadCase(POSTURE, -FURTHER)).critical
    return event.force if event is not None and event.kind is EventKind.BIFURCATION else None


def _rows(diagnosis: Diagnosis, truth: float | None) -> Discovery:
    return Discovery(
        verdict=diagnosis.verdict,
        causes=diagnosis.causes,
        confidence=diagnosis.confidence,
        held_out=diagnosis.gain.folds if diagnosis.gain is not None else [],
        critical=diagnosis.critical,
        truth_N=truth,
        readings=diagnosis.noise.readings if diagnosis.noise is not None else 0,
        seconds=diagnosis.seconds,
    )
