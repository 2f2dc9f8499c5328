"""The extended machine as a model file.

What a quasi-static chain without history can express goes into the file's values. What belongs to the test, and
laws that a model file has no words for, stand in its head as comments, with their parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from vjm.io.model_file import build_chain
from vjm.model.machine import Machine
from vjm_updating.calibration.calibrated_model import calibrated_document, model_text
from vjm_updating.diagnosis.column import ColumnYield
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.experiment import Measurement
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.instrument import InstrumentScale, InstrumentZero, ThermalDrift
from vjm_updating.mechanisms.actuator_compliance import ActuatorCompliance
from vjm_updating.mechanisms.base_compliance import BaseCompliance
from vjm_updating.mechanisms.effect import Effect, part_table
from vjm_updating.mechanisms.foot_lumping import FootLumping
from vjm_updating.mechanisms.gravity import Gravity
from vjm_updating.mechanisms.link_bow import LinkBow
from vjm_updating.mechanisms.link_length import LinkLength
from vjm_updating.mechanisms.link_lumping import LinkLumping
from vjm_updating.mechanisms.load_misalignment import LoadMisalignment
from vjm_updating.mechanisms.modified_chain import STANDARD_GRAVITY, ModifiedChain, beam_of
from vjm_updating.mechanisms.part_compliance import PartCompliance
from vjm_updating.mechanisms.single_joint import JointHardening, JointThreeSlopes

FILE = "extended-model.toml"
WORDS: dict[type[Effect], str] = {
    ActuatorCompliance: "in the drive's compliance",
    JointHardening: "in the joint's compliance at no load; what it stiffens by is not in the numbers below",
    JointThreeSlopes: "in the joint's law",
    BaseCompliance: "in the mounts before the chain",
    PartCompliance: "in the part's section and matrix",
    LinkLength: "in the link's length_mm",
    LinkBow: "in the link's bow_mm",
    Gravity: "in the link's mass_kg; it weighs where a command says --gravity",
    LinkLumping: "in link_segments",
    FootLumping: "in foot_segments",
    ColumnYield: "in the section's yield_stress_MPa; springs stay elastic beyond it, so the numbers below hold up "
    "to it",
}
"""Causes that the file's values express, and where."""
ERRORS = (InstrumentZero, InstrumentScale, ThermalDrift)


def extended_chain(fitter: Fitter, fit: Fit) -> Machine:
    """The chain as the extended file has it, its machine's nuisances included."""
    measurement = fitter.forward.observed.measurement
    return build_chain(extended_document(measurement, fitter, fit), FILE)


def extended_document(measurement: Measurement, fitter: Fitter, fit: Fit, way: str = "extended") -> dict[str, Any]:
    """The model document of a fit's machine.

    Args:
        measurement: the test.
        fitter: of it.
        fit: of a hypothesis.
        way: in which the model was changed.

    Raises:
        ValueError: the machine is not one that a model file admits.
    """
    machine: ModifiedChain = fitter.forward.machine(fit.found, fit.at.z, fit.hypothesis)
    springs = replace(machine, bow=(), asymmetry=(), weight=()).chain()
    document = calibrated_document(measurement, springs, way)
    if not fit.hypothesis:
        document["title"] = measurement.document["title"]
    engine = machine.engine
    document["springs"] = {"link_segments": engine.segments or 1, "foot_segments": engine.foot_segments or 1}
    for name, along_y, along_z in machine.bow:
        y, z = beam_of(machine.nominal, name).bow
        part_table(document, name)["bow_mm"] = [float(y + along_y), float(z + along_z)]
    for name, mass in machine.weight:
        part = part_table(document, name)
        part["mass_kg"] = float(mass)
        part.get("section", {}).pop("density_kg_per_m3", None)
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        effect.write(document, machine.nominal, values)
    build_chain(document, FILE)
    return document


def extended_text(
    measurement: Measurement, fitter: Fitter, fit: Fit, verdict: str, found: Mapping[str, ValueRow]
) -> str:
    """The text of the model file.

    Raises:
        ValueError: the machine is not one that a model file admits.
    """
    document = extended_document(measurement, fitter, fit)
    machine: ModifiedChain = fitter.forward.machine(fit.found, fit.at.z, fit.hypothesis)
    notes = [f"Verdict: {verdict}.", *_causes(fit, found, machine)]
    return model_text(measurement, document, notes, "Extended", "diagnose")


def _causes(fit: Fit, found: Mapping[str, ValueRow], machine: ModifiedChain) -> list[str]:
    lines = []
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        own = ", ".join(
            f"{name.partition('.')[2]} = {e.words}"
            for name, e in found.items()
            if name.startswith(f"{effect.cause}.")
        )
        said = f"{effect.label}: {own}; " if own else f"{effect.label}: "
        lines.append(said + _where(effect, values, machine) + ".")
    return lines


def _where(effect: Effect, values: Sequence[float], machine: ModifiedChain) -> str:
    """Where an effect is in the file, or why it is not."""
    words = next((words for kind, words in WORDS.items() if isinstance(effect, kind)), "")
    if isinstance(effect, Gravity):
        g = ",".join(f"{STANDARD_GRAVITY * v:.6g}" for v in machine.gravity)
        return f"{words} {g}"
    if isinstance(effect, LoadMisalignment):
        tilted = effect.tilted(values)
        return f"of the test, not of the machine: a command says --axis {','.join(f'{v:.6g}' for v in tilted)}"
    if isinstance(effect, ActuatorCompliance) and not effect.is_written(machine.nominal, values):
        return "not in the numbers below: the joint's matrix is rigid in a direction askew to its axis"
    if isinstance(effect, ERRORS):
        return "an error of the instrument, not in the numbers below"
    return words or "not in the numbers below: a chain of springs has no word for it"
