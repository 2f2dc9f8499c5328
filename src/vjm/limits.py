"""What an engine does not take, and the physical reason: every refusal of a machine or a load case by an engine.

An engine refuses what its own equations lack, and nothing else. The table is what the docs list.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vjm.model.load_case import RAMP, LoadCase
from vjm.model.machine import Machine

Found = Callable[[Machine, LoadCase | None], str]
"""Says what in a machine or a load case is beyond a limit; empty where nothing is."""


@dataclass(frozen=True)
class Limit:
    """Something that an engine does not take.

    Attributes:
        what: it does not take, as the docs list it.
        why: the physical reason.
        evidence: what offends in a machine, whose held joints stand at coordinates, or in a load case.
        remedy: what takes it.
    """

    what: str
    why: str
    evidence: Found
    remedy: str

    def refusal(self, engine: str, offender: str) -> ValueError:
        """The error of an engine, ``offender`` being what offends."""
        return ValueError(f"{offender}: {engine} does not take {self.what}: {self.why}; {self.remedy}")


def _stressed_joint(chain: Machine, _: LoadCase | None) -> str:
    standing = (joint for joint in chain.held_joints if joint.value is not None)
    return next((f"joint '{joint.name}'" for joint in standing if joint.stretch), "")


def _slack_at_rest(chain: Machine, _: LoadCase | None) -> str:
    springs = {f"spring '{spring.name}'" for spring in chain.point_springs}
    joints = ((words, law) for words, law in chain.laws if words not in springs)
    return next((words for words, law in joints if not law.rest_stiffness > 0.0), "")


def _bowed(chain: Machine, _: LoadCase | None) -> str:
    return next((f"part '{beam.name}'" for beam in chain.beams if any(beam.bow)), "")


def _without_section(chain: Machine, _: LoadCase | None) -> str:
    return next((f"part '{beam.name}'" for beam in chain.beams if beam.section is None), "")


def _without_section_but_foot(chain: Machine, _: LoadCase | None) -> str:
    return next((f"part '{beam.name}'" for beam in chain.beams if beam.section is None and beam.name != "foot"), "")


def _no_beam(chain: Machine, _: LoadCase | None) -> str:
    return "" if chain.beams else f"{chain.name}"


def _imperfect(_: Machine, load_case: LoadCase | None) -> str:
    return "the load case's imperfection" if load_case is not None and load_case.imperfection else ""


def _otherwise_controlled(_: Machine, load_case: LoadCase | None) -> str:
    return "the load case's control" if load_case is not None and load_case.control != RAMP else ""


def _misassembled(chain: Machine, _: LoadCase | None) -> str:
    return f"{chain.name}" if chain.nominal_ends else ""


VJM = "engine vjm takes them"
PRESTRESS = Limit(
    "springs and closures under stress in this posture",
    "it is linear about a machine without forces",
    _stressed_joint,
    VJM,
)
"""Joints are told by the machine alone; springs between points and closures when their places are known."""
SLOPED = Limit(
    "laws of springs without a slope at rest",
    "it is linear about the rest of each spring, and has the tangent there",
    _slack_at_rest,
    VJM,
)
STRAIGHT = Limit(
    "beams with a bow", "its beams are straight", _bowed, "take vjm with 2 springs a beam or more"
)  # fmt: skip
PERFECT = Limit("imperfections", "nothing bends its beams before they are loaded", _imperfect, VJM)
RAMPS = Limit(
    "other control than the ramp",
    "its path is a straight line, which does not turn back",
    _otherwise_controlled,
    VJM,
)
MESHED = Limit(
    "beams without a section",
    "a 6×6 compliance says nothing of what lies between a beam's ends",
    _without_section,
    "give it a section, or take vjm or vjm-paper, for which its matrix is enough",
)
MESHED_BUT_FOOT = Limit(MESHED.what, MESHED.why, _without_section_but_foot, MESHED.remedy)
ASSEMBLED = Limit(
    "errors of assembly",
    "it begins at a posture in which all loops close without a force",
    _misassembled,
    "take vjm or exudyn",
)
BEAMS = Limit("machines without a beam", "it has elements of beams only", _no_beam, VJM)

LIMITS: Mapping[str, tuple[Limit, ...]] = {
    "vjm-linear": (PRESTRESS, SLOPED, ASSEMBLED, RAMPS, PERFECT),
    "msa": (PRESTRESS, SLOPED, ASSEMBLED, STRAIGHT, RAMPS, PERFECT),
    "exudyn": (STRAIGHT, MESHED, PERFECT),
    "exudyn-footspring": (STRAIGHT, MESHED_BUT_FOOT, PERFECT),
    "opensees": (BEAMS, ASSEMBLED, STRAIGHT, MESHED, PERFECT),
}
"""By engine; ``vjm`` and ``vjm-paper`` have none here."""


LINEAR = ("vjm-linear", "msa")
"""Engines whose answer is a straight line about the rest of each spring."""


def refuse(engine: str, chain: Machine, load_case: LoadCase | None = None) -> None:
    """Refuse what an engine does not take.

    Args:
        engine: its label.
        chain: the machine; its springs under stress are looked for where its held joints stand at coordinates.
        load_case: what is done to it.

    Raises:
        ValueError: in one line: what it is, why, and what takes it.

    Example:
        >>> from vjm.model.parts import Beam
        >>> try:
        ...     refuse("msa", Machine("column", (Beam("bar", 100.0, bow=(0.1, 0.0)),)))
        ... except ValueError as refusal:
        ...     print(str(refusal).split(";")[0])
        part 'bar': msa does not take beams with a bow: its beams are straight
    """
    for limit in LIMITS[engine]:
        offender = limit.evidence(chain, load_case)
        if offender:
            raise limit.refusal(engine, offender)
