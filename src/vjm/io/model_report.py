"""Every error of a model file with its line, and what a sane one describes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, assert_never

import numpy as np
import pydantic

from vjm.engines import refuse_unbuildable
from vjm.io.errors import ModelFileError, every_line, printed
from vjm.io.findings import Finding, Grade
from vjm.io.machine_file import is_legs, load_model
from vjm.io.model_file import Model, build_chain, read_document
from vjm.io.model_plausibility import findings_of, length_of, mass_of
from vjm.io.schema import ModelFile, known_keys
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset
from vjm.outcome import Outcome

Location = tuple[int | str, ...]


@dataclass(frozen=True)
class ModelCheck(Outcome):
    """What a model is, and what is wrong or doubtful about it.

    Attributes:
        errors: one line each; empty where it is sound.
        findings: what is implausible, refusals first.
        name: of the machine; empty where it has errors.
        title: likewise.
        summary: what the machine is, in rows of what and how much.

    Example:
        >>> import vjm
        >>> vjm.check("planar-2r").table()
        []
    """

    errors: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    name: str = ""
    title: str = ""
    summary: tuple[tuple[str, str], ...] = ()

    @property
    def sound(self) -> bool:
        """Whether it has no errors, and nothing that is impossible."""
        return not self.errors and all(finding.grade is not Grade.REFUSED for finding in self.findings)

    def table(self) -> list[dict[str, Any]]:
        """A row for each error and finding: its grade and what was found."""
        rows = [{"grade": "error", "found": line} for line in self.errors]
        return [*rows, *({"grade": str(each.grade), "found": str(each)} for each in self.findings)]


def check(model: Model | Machine) -> ModelCheck:
    """Every error of a model, or what machine it is and what is doubtful about it.

    Args:
        model: as for `vjm.load`, or a machine made in Python, which is asked for what can be computed with it.

    Returns:
        Errors stand in the result, and none is raised.

    Example:
        >>> import vjm
        >>> report = vjm.check("planar-2r")
        >>> report.sound, report.name, dict(report.summary)["parts"]
        (True, 'planar-2r', '5')
        >>> vjm.check({"name": "arm", "parts": [{"kind": "beam"}]}).errors[0]
        'arm: part 1: name is missing: add it'
    """
    if isinstance(model, Machine):
        machine, findings = model, tuple[Finding, ...]()
    else:
        try:
            errors = [] if is_legs(model) else errors_of(model)
            if errors:
                return ModelCheck(tuple(errors))
            machine, findings = load_model(model), tuple(findings_of(model))
        except ModelFileError as error:
            return ModelCheck((str(error),))
    try:
        refuse_unbuildable(machine)
    except ValueError as error:
        return ModelCheck((f"{model if isinstance(model, str | Path) else machine.name}: {error}",))
    return ModelCheck((), findings, machine.name, machine.title, tuple(_summary_of(machine)))


def errors_of(name_or_path: Model) -> list[str]:
    """What is wrong with a model file, one line each with its place; none where it is sane.

    Raises:
        ModelFileError: it cannot be read at all.
    """
    document = read_document(name_or_path)
    path = None if isinstance(name_or_path, Mapping) else Path(name_or_path)
    text = path.read_text(encoding="utf-8-sig") if path is not None and path.is_file() else ""
    try:
        ModelFile.model_validate(document.content)
    except pydantic.ValidationError as error:
        details = sorted(error.errors(include_url=False), key=lambda one: line_of(text, one["loc"]) or 0)
        return [
            f"{_at(document.file, line_of(text, detail['loc']) if detail['loc'] else _named(text, line))}: {line}"
            for detail, line in zip(details, every_line(details, document.content, known_keys), strict=True)
        ]
    try:
        build_chain(document.content, document.file)
    except ModelFileError as error:
        said = str(error).removeprefix(f"{document.file}: ")
        return [f"{_at(document.file, _named(text, said))}: {said}"]
    return []


def _at(file: str, line: int | None) -> str:
    return file if line is None else f"{file}:{line}"


def line_of(text: str, loc: Location) -> int | None:
    """Line, from one, of a key in a TOML text that has its parts as ``[[parts]]``; None where it is not found."""
    lines = text.splitlines()
    top = str(loc[0]) if loc else ""
    if len(loc) > 1 and isinstance(loc[1], int):
        headers = [i for i, line in enumerate(lines) if re.match(rf"\s*\[\[\s*{re.escape(top)}\s*\]\]", line)]
        if loc[1] >= len(headers):
            return None
        start, keys = headers[loc[1]], [str(key) for key in loc[2:] if isinstance(key, str)]
    else:
        start = next((i for i, line in enumerate(lines) if re.match(rf"\s*\[\s*{re.escape(top)}\s*\]", line)), 0)
        keys = [str(key) for key in loc if isinstance(key, str)]
    for key in reversed(keys):
        for i in range(start, len(lines)):
            if i > start and re.match(r"\s*\[\[", lines[i]):
                break
            if re.match(rf"\s*\"?{re.escape(key)}\"?\s*=", lines[i]):
                return i + 1
    return start + 1 if lines else None


def _named(text: str, said: str) -> int | None:
    """Line where a part, joint or posture that a message names in quotes is defined."""
    for name in re.findall(r"'([^']+)'", said):
        pattern = rf"\s*(name\s*=\s*\"{re.escape(name)}\"|\"?{re.escape(name)}\"?\s*=)"
        for i, line in enumerate(text.splitlines(), start=1):
            if re.match(pattern, line):
                return i
    return None


def _summary_of(chain: Machine) -> list[tuple[str, str]]:
    """What a machine is, in rows of what and how much."""
    first = next(iter(chain.postures), "")
    # of a beam that comes out of its root only what is out of it moves with the machine
    parts = chain.at(first).parts if chain.pushing and first else chain.parts
    mass, reach = sum(map(mass_of, parts)), sum(map(length_of, chain.parts))
    joints = [part for part in chain.parts if isinstance(part, Joint)]
    actuated = [joint.name for joint in joints if not joint.passive and joint.coupling is None]
    passive = [joint.name for joint in chain.moving if joint.passive]
    coupled = [joint.name for joint in joints if joint.coupling is not None]
    rows = [
        ("parts", str(len(chain.parts))),
        ("mass", f"{printed(mass)} kg" + (f", in posture {first}" if chain.pushing else "")),
        ("length along the parts", f"{printed(reach)} mm"),
        ("actuated joints", _listed(actuated)),
        ("passive joints", _listed(passive)),
    ]
    rows += [("coupled joints", _listed(coupled))] if coupled else []
    rows += [("deflects", f"{name}: {how}") for name, how in elastic_parts(chain)]
    rows += [(f"posture {label}", _posture(chain, label)) for label in chain.postures]
    rows += [("end frame", f"{name}, behind {part}") for name, part in chain.ends.items()]
    rows += _mobility_rows(chain) if chain.closes else []
    for one in chain.point_springs:
        law = f"law '{one.law.kind}'" if one.law is not None else f"{printed(one.stiffness)} N/mm"
        rows.append(("point spring", f"{one.name}: {law}"))
    return rows


def _mobility_rows(machine: Machine) -> list[tuple[str, str]]:
    """What the rigid machine can do at home, and by what its loops are held more than they need."""
    closing = LoopClosure(machine, home_label(machine))
    mobility = closing.mobility(closing.home)
    drives = int(np.count_nonzero(~closing.tree.passive))
    idle = "; ".join(", ".join(group) for group in mobility.idle)
    return [
        ("closed loops", _listed([closure.name for closure in machine.closures])),
        ("freedom", f"{mobility.freedom} of the end-effector, {drives} held joints"),
        ("redundant constraints", str(mobility.redundant)),
        ("gap in singular values", f"{mobility.gap:.0e} between constraints that count and those that do not"),
        ("idle motions", f"{mobility.idle_freedom}: {idle}" if idle else "none"),
    ]


def elastic_parts(chain: Machine) -> list[tuple[str, str]]:
    """The parts that deflect by name, and what of them does."""
    rows = []
    for part in chain.parts:
        match part:
            case Beam():
                kind = "6×6 compliance" if part.section is None else "section"
                if part.section is not None:
                    shear = (("y", part.section.GAy), ("z", part.section.GAz))
                    if rigid := [axis for axis, GA in shear if np.isinf(GA)]:
                        kind = f"section without shear along {' and '.join(rigid)}"
                rows.append((part.name, f"beam of {printed(part.length)} mm, {kind}"))
            case Joint():
                if part.elastic:
                    rows.append((part.name, _compliance_of(part)))
            case RigidOffset():
                pass
            case _:
                assert_never(part)
    return rows


def _compliance_of(joint: Joint) -> str:
    unit = "mm/N" if joint.slides else "rad/(N mm)"
    own = f"{printed(joint.compliance)} {unit}" if joint.compliance > 0.0 else ""
    if joint.law is not None:
        stiffness = f"{printed(joint.law.rest_stiffness)} {'N/mm' if joint.slides else 'N mm/rad'}"
        own = f"law '{joint.law.kind}', {stiffness} at rest"
        if joint.passive and not joint.fixed:
            return own
    if joint.matrix is not None:
        return f"6×6 compliance, {own}" if own else "6×6 compliance"
    if joint.fixed:
        return f"{own} {'along' if joint.slides else 'about'} its axis"
    if joint.passive:
        return f"spring of {printed(joint.stiffness)} {'N/mm' if joint.slides else 'N mm/rad'}"
    across = " and ".join(printed(compliance) for _, compliance in joint.bearings)
    return ", ".join(text for text in (own, f"{across} rad/(N mm) across" if across else "") if text)


def _listed(names: list[str]) -> str:
    return f"{len(names)}: {', '.join(names)}" if names else "none"


def _posture(chain: Machine, label: str) -> str:
    values: dict[str, Any] = dict(chain.held.get(label, {}))
    # where loops are closed the passive joints follow
    values |= () if chain.closes else zip((joint.name for joint in chain.joints), chain.posture(label), strict=True)
    slides = {joint.name for joint in chain.moving if joint.slides}
    text = ", ".join(f"{k} {printed(float(v))} {'mm' if k in slides else 'rad'}" for k, v in values.items())
    return text or "no joints"
