"""A run: every path of every engine on one chain, and what was found, before it becomes files and pages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from vjm.continuation.direction import Direction
from vjm.continuation.imperfections import ImperfectionCurve
from vjm.continuation.path import Path
from vjm.model.machine import Machine
from vjm_validation.studies.discovery_results import DiscoveryStudy
from vjm_validation.studies.printed_matrices import PrintedMatrices

if TYPE_CHECKING:
    # they need the finite elements, which a page of one path does not
    from vjm_validation.studies.parallelogram import ParallelogramComparison
    from vjm_validation.studies.robots import RobotStudy


@dataclass(frozen=True, order=True)
class Key:
    """Which path of a run: posture label, direction, engine label."""

    posture: str
    direction: Direction
    engine: str

    @property
    def stem(self) -> str:
        """Name of the path's files without their ending."""
        return f"{self.posture}_{self.direction}_{self.engine}"


@dataclass(frozen=True)
class LumpingStudy:
    """Critical force of one posture against the number and the placement of the bar's springs.

    Attributes:
        posture: label.
        direction: of the ramp.
        reference: critical force of the finite elements, N; None where they have none on the path.
        rows: (placement, number of springs, critical force in N or None where the path has no bifurcation).
    """

    posture: str
    direction: Direction
    reference: float | None
    rows: tuple[tuple[str, int, float | None], ...]


@dataclass(frozen=True)
class IterationPoint:
    """What it took to find one equilibrium: iterations, None where the solver did not get there.

    Attributes:
        s: displacement, mm.
        force: N.
        contraction: by what (13) multiplies a small error here; above 1 it diverges.
        predicted: F/F_cr, what the contraction should be before a bifurcation; None elsewhere.
        paper: iterations of (13) from the neighbouring point, to the suite's tolerance.
        paper_loose: the same to the loose tolerance.
        disturbed: iterations of (13) from a disturbed start, to the suite's tolerance.
        disturbed_loose: the same to the loose tolerance.
        newton: iterations of Newton-Raphson from the neighbouring point, to the suite's tolerance.
        newton_loose: the same to the loose tolerance.
    """

    s: float
    force: float
    contraction: float
    predicted: float | None
    paper: int | None
    paper_loose: int | None
    disturbed: int | None
    disturbed_loose: int | None
    newton: int | None
    newton_loose: int | None


@dataclass(frozen=True)
class IterationStudy:
    """Iterations along one path of the paper's model.

    Attributes:
        posture: label.
        direction: of the ramp.
        points: in the order of the path.
        critical: kind of the first event, None without one.
        d_cr: its displacement, mm.
        stopped: why the path ends early; empty where it does not.
    """

    posture: str
    direction: Direction
    points: tuple[IterationPoint, ...]
    critical: str | None
    d_cr: float | None
    stopped: str = ""


@dataclass(frozen=True)
class EndConditionStudy:
    """What the support of the end-effector decides.

    Attributes:
        paths: compression by posture, end condition and engine; under dead loads to the first limit point.
        imperfections: largest force against the size of an imperfection by posture, under a dead load on a hinged
            end-effector, where the perfect chain buckles and then collapses.
    """

    paths: Mapping[tuple[str, str, str], Path]
    imperfections: Mapping[str, ImperfectionCurve]


@dataclass
class Run:
    """What `validate all` computed.

    Attributes:
        chain: the machine.
        paths: by posture, direction and engine.
        lumping: the study that names the tension artefact's cause, one per direction.
        end_conditions: critical points under other supports than the paper's; None without the study.
        matrices: what the printed matrices are as beams, and what Table II implies; None without the study.
        parallelogram: the real one beside one bar of double stiffness; None without the study.
        robots: whole robots beside Exudyn's; None without the study.
        discovery: a diagnosis of finite elements' data under the paper's model; None without the study.
        iterations: what the paper's iteration and Newton-Raphson take, one study per posture.
        summary: the content of ``summary.json``.
    """

    chain: Machine
    paths: dict[Key, Path] = field(default_factory=dict)
    lumping: tuple[LumpingStudy, ...] = ()
    end_conditions: EndConditionStudy | None = None
    matrices: PrintedMatrices | None = None
    parallelogram: ParallelogramComparison | None = None
    robots: RobotStudy | None = None
    discovery: DiscoveryStudy | None = None
    iterations: tuple[IterationStudy, ...] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)
