"""The extended machine as a model file.

What the chain's own numbers can express goes into them; laws that a model file has no words for stand in its head
as comments, with their parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from vjm.chain import Chain
from vjm.effects.actuator_compliance import ActuatorCompliance
from vjm.effects.foot_lumping import FootLumping
from vjm.effects.link_length import LinkLength
from vjm.effects.link_lumping import LinkLumping
from vjm.effects.machine import Machine
from vjm.effects.part_compliance import PartCompliance
from vjm.io.model_file import build_chain
from vjm.io.toml_text import toml_text
from vjm.parts import Actuator
from vjm_validation.calibration.calibrated_model import calibrated_document
from vjm_validation.diagnosis.fitting import Fit, Fitter
from vjm_validation.diagnosis.verdict import Estimate
from vjm_validation.measurement import Measurement

INSIDE = (ActuatorCompliance, PartCompliance, LinkLength, LinkLumping, FootLumping)
"""Causes that a model file or the number of springs expresses."""


def extended_chain(fitter: Fitter, fit: Fit) -> Chain:
    """The chain with all of a fit that a chain can hold, its machine's nuisances included."""
    machine: Machine = fitter.forward.machine(fit.found, fit.at.z, fit.hypothesis)
    chain = replace(machine, bow=(0.0, 0.0), asymmetry=(), weight=()).chain()
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        if isinstance(effect, ActuatorCompliance):
            parts = tuple(
                replace(p, compliance=p.compliance + values[0]) if isinstance(p, Actuator) else p
                for p in chain.parts
            )
            chain = replace(chain, parts=parts)
    return chain


def extended_text(
    measurement: Measurement, fitter: Fitter, fit: Fit, verdict: str, found: Mapping[str, Estimate]
) -> str:
    """The text of the model file.

    Raises:
        ValueError: the machine is not one that a model file admits.
    """
    document = calibrated_document(measurement, extended_chain(fitter, fit))
    title = str(measurement.document["title"])
    document["title"] = f"{title}, extended" if fit.hypothesis else title
    document["source"] = (
        f"extended from {measurement.readings.file} with {measurement.sheet.file}; nominal values: "
        f"{measurement.document['source']}"
    )
    build_chain(document, "extended-model.toml")
    head = [
        f"Extended from {measurement.readings.file} with {measurement.sheet.file} by `validate diagnose`.",
        f"Verdict: {verdict}.",
        *_causes(fit, found),
    ]
    return "".join(f"# {line}\n" for line in head) + toml_text(document)


def _causes(fit: Fit, found: Mapping[str, Estimate]) -> Sequence[str]:
    lines = []
    for effect in fit.hypothesis:
        if isinstance(effect, LinkLumping | FootLumping):
            part = "link" if isinstance(effect, LinkLumping) else "foot"
            lines.append(f"{effect.label}: give the {part} springs all along, as the engine vjm does for the link.")
            continue
        own = ", ".join(
            f"{name.partition('.')[2]} = {e.value:.6g} ± {e.std:.2g}"
            for name, e in found.items()
            if name.startswith(f"{effect.cause}.")
        )
        where = (
            "in the numbers below" if isinstance(effect, INSIDE) else "not in the numbers below: it is no spring"
        )
        lines.append(f"{effect.label}: {own}; {where}.")
    return lines
