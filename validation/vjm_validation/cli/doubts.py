"""What is implausible about an input, said once before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated

from cyclopts import Parameter

from vjm.continuation.limits_along import limits_passed
from vjm.continuation.path import Path
from vjm.engine import Engine
from vjm.io.findings import Finding, Grade, refuse
from vjm.io.machine_file import load_model
from vjm.io.model_file import read_document
from vjm.io.model_plausibility import findings_of, weight_findings
from vjm.model.joint_limits import beyond_measured
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_output import terminal

Strict = Annotated[
    bool, Parameter(name="--strict", negative="", help="Refuse what is doubtful, such as a mistaken unit.")
]


def warn(findings: Iterable[Finding]) -> None:
    """Each finding as a line on standard error."""
    for finding in findings:
        word = "note" if finding.grade is Grade.NOTED else "warning"
        terminal.error(f"{word}: {finding}")


def considered(model: str, strict: bool, *, weighed: bool = False) -> list[Finding]:
    """What is implausible about a model, said as warnings; ``weighed``: also about one that has its weight.

    Raises:
        ModelFileError: it cannot be read.
        ImplausibleError: it is refused, see `vjm.io.findings.refuse`.
    """
    findings = findings_of(model)
    if weighed:
        findings += weight_findings(load_model(model), read_document(model).file)
    refuse(findings, strict=strict)
    warn(findings)
    return findings


def beyond_calibration(machine: Machine, coordinates: Mapping[str, Array], strict: bool) -> list[Finding]:
    """Joints that stand where a calibrated model was not measured, said as warnings.

    Args:
        machine: that is asked.
        coordinates: ``(g,)`` of joints by name, rad or mm.
        strict: whether it is refused.

    Raises:
        ImplausibleError: in strict use there is one.
    """
    found = beyond_measured(machine, coordinates)
    findings = [Finding(Grade.DOUBTFUL, f"{machine.name}: [calibrated.valid_within]", one) for one in found]
    refuse(findings, strict=strict)
    warn(findings)
    return findings


def along_paths(chain: Machine, traced: Sequence[tuple[Engine, Path]], strict: bool) -> list[Finding]:
    """Joints that paths lead beyond their limits, said as warnings; of engines whose coordinates are the joints'.

    Raises:
        ImplausibleError: in strict use there is one.
    """
    findings = [
        Finding(
            Grade.DOUBTFUL,
            f"{path.model}, posture {path.load_case.posture}, {path.engine}",
            passed.words,
        )
        for engine, path in traced
        if isinstance(engine, VjmEngine) and path.points
        for passed in limits_passed(engine.problem(chain, path.load_case).model, path)
    ]
    refuse(findings, strict=strict)
    warn(findings)
    return findings
