"""Virtual experiments: a body's 6×6 compliance from nonlinear finite element solutions at finite loads.

Also of beams that turn corners and taper: straight pieces one behind the other, and their file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, assert_never

import numpy as np
import pydantic
from pydantic import Field, model_validator

from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.fields import LengthMM, StiffnessSection, Table
from vjm.io.schema import Label, Turn, Turns, Units, rotation
from vjm.io.shapes import SHAPES, AnySection
from vjm.model import parts
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Part, RigidOffset, Section
from vjm.rotations import Array, frame, rotate_matrix6, shift_compliance, translation
from vjm_updating.constants import numerical

if TYPE_CHECKING:
    from vjm_fea.exudyn.engine import ExudynProblem


# --- What virtual experiments are made on: parts of a chain between passive joints, taken out and clamped ---------

BETWEEN = ".."
"""Stands between the first and the last part of a range."""
POSTURE = "-"
"""Label of the only posture of a chain without joints."""


@dataclass(frozen=True)
class Specimen:
    """An elastic body between a clamped root and a loaded tip.

    Attributes:
        name: of the part or range.
        axes: in words, those of the compliance.
        meshed: the body and the number of elements for each of its beams, at refinement n.
        theory: its compliance ``(6, 6)`` by linear beam theory.
        given: the compliance ``(6, 6)`` that the model file states, where it does.
    """

    name: str
    axes: str
    meshed: Callable[[int], tuple[Machine, int]]
    theory: Array
    given: Array | None = None


def part_specimen(chain: Machine, name: str) -> Specimen:
    """One part, or the parts ``first..last``, of a chain.

    One beam is taken alone, as one member, in its own axes, as the model file states its compliance. A range is
    taken whole, with all members, in the axes of the chain frame at its root.

    Raises:
        ValueError: no such part, nothing elastic in it, a passive joint inside, or a beam without a section.
    """
    first, _, last = name.partition(BETWEEN)
    names = [part.name for part in chain.parts]
    for one in (first, last or first):
        if one not in names:
            raise ValueError(
                f"--part: {chain.name} has no part '{one}' (it has {', '.join(names)}){did_you_mean(one, names)}"
            )
    start, end = names.index(first), names.index(last or first)
    if end < start:
        raise ValueError(f"--part: '{last}' comes before '{first}' in {chain.name}: write {last}{BETWEEN}{first}")
    parts = chain.parts[start : end + 1]
    if len(parts) == 1 and isinstance(parts[0], Beam):
        member = replace(parts[0], own_frame=np.eye(3), count=1)
        body = _alone(name, (member,))
        return Specimen(name, "the part's own", lambda n: (body, n), member.beam_compliance(), member.compliance)
    joints = [part.name for part in parts if isinstance(part, Joint) and part.free]
    if joints:
        raise ValueError(
            f"--part {name}: '{joints[0]}' is a passive joint, which moves freely: take parts between joints"
        )
    if not any(isinstance(part, Beam) for part in parts):
        raise ValueError(f"--part {name}: nothing in it is a beam: it deflects in no direction that can be meshed")
    body = _alone(name, parts)
    return Specimen(name, f"chain frame at the root of '{first}'", lambda n: (body, n), series_compliance(body))


def series_compliance(chain: Machine) -> Array:
    """Compliance ``(6, 6)`` at the tip of beams, offsets and drives in series, base axes, by linear beam theory.

    Raises:
        ValueError: a beam without a section, or a joint, which has a coordinate or moves freely.
    """
    frames, T = [], chain.base
    for part in chain.parts:
        frames.append(T)
        match part:
            case RigidOffset():
                T = T @ part.transform
            case Beam():
                T = T @ translation(part.tip)
            case Joint(free=True):
                raise ValueError(f"part '{part.name}' is a passive joint: it moves freely")
            case Joint(fixed=False):
                raise ValueError(f"part '{part.name}' is a joint with a coordinate: name the beams beside it alone")
            case Joint():
                pass
            case _:
                assert_never(part)
    C = np.zeros((6, 6))
    for part, part_frame in zip(chain.parts, frames, strict=True):
        R, p = part_frame[:3, :3], part_frame[:3, 3]
        if isinstance(part, Beam):
            own = rotate_matrix6(part.beam_compliance(), R @ part.own_frame)
            C += shift_compliance(own, T[:3, 3] - p - R @ part.tip)
        elif isinstance(part, Joint):
            axis = R @ part.axis
            moves = np.append(axis, np.zeros(3))
            if not part.slides:
                moves = np.append(np.cross(axis, T[:3, 3] - p), axis)
            C += part.compliance * np.outer(moves, moves)
    return C


def _alone(name: str, parts: tuple[Part, ...]) -> Machine:
    for part in parts:
        if isinstance(part, Beam):
            part.effective_section()
    return Machine(name, parts, base=frame(), postures={POSTURE: np.zeros(0)})


MESHES = numerical((4, 8, 16))
"""Refinements, each twice the one before."""
TURN = numerical(4e-3)
"""Rad, about: no load turns the tip by more, and an axial one is 1/600 of what would buckle a cantilever."""
CORRECTIONS = numerical(6)
"""Newton steps from the linear answer to the pose at which the tip carries the wanted wrench."""
AGREED = numerical(1e-10)
"""Correction of a pose, relative to its size, at which the wrench counts as the wanted one."""
POLISHES = numerical(2)
"""Chord steps behind each solution, each of which takes off what it finds but for some `TURN` of it."""
NOISE = numerical(1e-7)
"""Scaled change of the compliance from mesh to mesh below which no order can be observed."""
NEAR_ORDER = numerical(0.3)
"""How far from a whole number an observed order may be."""


@dataclass(frozen=True)
class ComplianceMeasurement:
    """A compliance with what is known of its errors.

    Scaled means entry over √(c_ii c_jj), which makes shifts and turns comparable.

    Attributes:
        compliance: ``(6, 6)``, symmetric, mm, N, rad.
        uncertainty: ``(6, 6)`` of every entry, the sum of the three below.
        linearity: ``(6, 6)`` what the second size of load took out.
        discretisation: ``(6, 6)`` what is open after the extrapolation over the meshes.
        rounding: ``(6, 6)`` from the largest scaled asymmetry.
        asymmetry: largest scaled difference of mirrored entries that was removed.
        order: observed order of convergence; None where the meshes agree to rounding, or too irregularly.
        extrapolated: whether the order was used to extrapolate.
        smallest_eigenvalue: of the scaled compliance; above zero, or the measurement is no compliance.
        loads: size ``(6,)`` of the larger loads, N and N mm.
    """

    compliance: Array
    uncertainty: Array
    linearity: Array
    discretisation: Array
    rounding: Array
    asymmetry: float
    order: float | None
    extrapolated: bool
    smallest_eigenvalue: float
    loads: Array


def measure(
    specimen: Specimen, meshes: tuple[int, int, int] = MESHES, *, corrected: bool = True
) -> ComplianceMeasurement:
    """Compliance of a body at its tip, with the uncertainty of every entry, by meshes each twice the one before.

    ``corrected`` takes the finite element's residual-flexibility correction, see `vjm_fea.common.mesh.Mesh`.

    Raises:
        NoConvergenceError: a solution at finite load was not found.
        ValueError: a beam that cannot be meshed.
    """
    sizes = _sizes(specimen.theory)
    results = [_on_mesh(specimen, n, sizes, corrected) for n in meshes]
    coarse, middle, fine = (C for C, _ in results)
    linearity = np.abs(results[-1][1])
    scale = np.sqrt(np.outer(np.diag(fine), np.diag(fine)))
    order, C, discretisation = _extrapolated([coarse, middle, fine], scale)
    skew = 0.5 * np.abs(C - C.T)
    asymmetry = 2.0 * float(np.max(skew / scale))
    C = 0.5 * (C + C.T)
    rounding = 0.5 * asymmetry * scale
    linearity, discretisation = (np.maximum(part, part.T) for part in (linearity, discretisation))
    return ComplianceMeasurement(
        compliance=C, uncertainty=linearity + discretisation + rounding, linearity=linearity,
        discretisation=discretisation, rounding=rounding, asymmetry=asymmetry, order=order,
        extrapolated=_whole(order) is not None, smallest_eigenvalue=float(np.linalg.eigvalsh(C / scale)[0]),
        loads=sizes,
    )  # fmt: skip


def _sizes(compliance: Array) -> Array:
    """Size ``(6,)`` of the loads, N and N mm: the most compliant turn by `TURN`, at an arm that suits the body."""
    most_compliant = float(np.linalg.eigvalsh(compliance[3:, 3:])[-1])
    # a cantilever's length over √3; a force at the whole length then turns the tip by less than a moment does
    arm = float(np.sqrt(np.linalg.eigvalsh(compliance[:3, :3])[-1] / most_compliant))
    return TURN / most_compliant / np.repeat([np.sqrt(3.0) * arm, 1.0], 3)


def _on_mesh(specimen: Specimen, n: int, sizes: Array, corrected: bool) -> tuple[Array, Array]:
    """Compliance ``(6, 6)``, column by column, and the cubic part that was taken out of it."""
    # Exudyn is an extra, which solids and matrices do not need
    from vjm_fea.exudyn.engine import ExudynEngine

    chain, elements = specimen.meshed(n)
    engine = ExudynEngine(elements=elements, shear=True, corrected=corrected)
    bench = _Bench(engine.problem(chain, LoadCase(POSTURE, 1.0)))
    whole, half = (
        np.column_stack([bench.odd_part(f * e) / f for f, e in zip(s, np.eye(6), strict=True)])
        for s in (sizes, 0.5 * sizes)
    )
    return (4.0 * half - whole) / 3.0, (whole - half) / 3.0


class _Bench:
    """A meshed body under imposed wrenches."""

    def __init__(self, problem: ExudynProblem) -> None:
        self.problem = problem
        self.unloaded = problem.unloaded()
        self.tangent = problem.statics.tangent(self.unloaded.state)
        self.guess = np.linalg.inv(np.asarray(self.unloaded.stiffness))

    def odd_part(self, wrench: Array) -> Array:
        """Half the difference ``(6,)`` of the displacements under a wrench and its opposite."""
        return 0.5 * (self.answer(wrench) - self.answer(-wrench))

    def answer(self, wrench: Array) -> Array:
        """Displacement ``(6,)`` of the tip under a wrench that keeps its direction.

        The finite elements impose the pose; it is corrected, with the unloaded compliance, until the reaction is
        the wanted wrench.
        """
        pose = correction = self.guess @ wrench
        equilibrium = self.unloaded
        for _ in range(CORRECTIONS):
            equilibrium = self.problem.solve_pose(pose, equilibrium)
            correction = self.guess @ (wrench - self._wrench(equilibrium.state))
            pose = pose + correction
            if np.max(np.abs(correction[:3])) <= AGREED * np.max(np.abs(pose[:3])) and np.max(
                np.abs(correction[3:])
            ) <= AGREED * np.max(np.abs(pose[3:])):
                break
        return pose

    def _wrench(self, state: Array) -> Array:
        """Wrench ``(6,)`` on the tip, once what the solver leaves of the residual is gone.

        Its tolerance suits loads near buckling; against loads as small as these it would show.
        """
        statics = self.problem.statics
        for _ in range(POLISHES):
            motion = np.zeros(len(statics.unit))
            motion[statics.free] = self.tangent.solve(-statics.residual(state)[statics.free])
            state = statics.moved(state, motion)
        return statics.wrench(state)


def _whole(order: float | None) -> int | None:
    """The whole number that an observed order means, where it means one."""
    if order is None or abs(order - round(order)) > NEAR_ORDER or round(order) not in (1, 2, 3, 4):
        return None
    return round(order)


def _extrapolated(C: list[Array], scale: Array) -> tuple[float | None, Array, Array]:
    """Observed order, the compliance for ever finer meshes, and a bound on its error."""
    first, second = C[1] - C[0], C[2] - C[1]
    small, large = (float(np.max(np.abs(d / scale))) for d in (second, first))
    order = float(np.log2(large / small)) if min(small, large) > NOISE else None
    p = _whole(order)
    if p is None:
        return order, C[2], np.abs(second)
    factor = 2.0**p - 1.0
    before, after = C[1] + first / factor, C[2] + second / factor
    # the next order's error in `after` is a fraction of this
    return order, after, np.abs(after - before)


# --- A beam that turns corners and tapers: straight pieces one behind the other, each with sections of its own ----

PANELS, POINTS = numerical(16), numerical(8)
"""Gauss's rule along a piece: to rounding for any taper that a machine has."""


@dataclass(frozen=True)
class BeamPathPiece:
    """A straight piece.

    Attributes:
        length: mm.
        section: at a fraction of the length, 0 at the root and 1 at the end.
        turn: rotation ``(3, 3)`` of its axes, x along the piece, against those of the piece before it.
    """

    length: float
    section: Callable[[float], Section]
    turn: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class BeamPath:
    """Pieces from a clamped root to a tip.

    Attributes:
        name: for people.
        pieces: one behind the other; the first one's turn counts from the axes of the compliance.
    """

    name: str
    pieces: tuple[BeamPathPiece, ...]

    def chain(self, steps: int) -> Machine:
        """The path with every piece in ``steps`` uniform beams, each with the section at its middle.

        The compliance errs by 1/steps², as the midpoint rule does, and not at all where no piece tapers.
        """
        parts: list[Part] = []
        for i, piece in enumerate(self.pieces):
            parts.append(RigidOffset(f"turn{i}", frame(piece.turn)))
            parts += [
                Beam(f"piece{i}-{k}", piece.length / steps, section=piece.section((k + 0.5) / steps))
                for k in range(steps)
            ]
        return Machine(self.name, tuple(parts), postures={POSTURE: np.zeros(0)})

    def compliance(self) -> Array:
        """Compliance ``(6, 6)`` at the tip, base axes: beam theory's integral ``∫ Gᵀ c(s) G ds`` along the path."""
        where, R, p = [], np.eye(3), np.zeros(3)
        for piece in self.pieces:
            R = R @ piece.turn
            where.append((R, p))
            p = p + piece.length * R[:, 0]
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        C = np.zeros((6, 6))
        for piece, (R, root) in zip(self.pieces, where, strict=True):
            for panel in range(PANELS):
                for node, weight in zip(nodes, weights, strict=True):
                    fraction = (panel + 0.5 * (node + 1.0)) / PANELS
                    s = piece.section(fraction)
                    c = np.diag(1.0 / np.array([s.EA, s.GAy, s.GAz, s.GJ, s.EIy, s.EIz]))
                    ds = 0.5 * weight * piece.length / PANELS
                    C += shift_compliance(rotate_matrix6(ds * c, R), p - root - fraction * piece.length * R[:, 0])
        return C

    def specimen(self) -> Specimen:
        """The path to make experiments on: the mesh and the taper's steps are refined together."""
        return Specimen(self.name, "the path's own", lambda n: (self.chain(n), 1), self.compliance())


# --- Beam paths in TOML: pieces with a section at the root, perhaps another one at the end, and turns between them-


class PieceTable(Table):
    """A straight piece; between two sections of one shape every dimension runs linearly."""

    source: str = ""
    length_mm: LengthMM
    turns: Turns = Field([], description="from the axes of the piece before, x along the piece")
    section: AnySection = Field(description="at the root; all along where there is no end_section")
    end_section: AnySection | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> PieceTable:
        if self.end_section is not None:
            if type(self.end_section) is not type(self.section):
                raise ValueError("has a section and an end_section of different shapes: give both the same keys")
            for key, value in self.section:
                if (value is None) != (getattr(self.end_section, key) is None):
                    raise ValueError(f"has {key} in one of section and end_section only: give it in both")
        return self

    def section_at(self, fraction: float) -> parts.Section:
        """The section at a fraction of the length."""
        if self.end_section is None:
            return self.section.stiffness()
        between = {
            key: (1.0 - fraction) * value + fraction * getattr(self.end_section, key)
            for key, value in self.section
            if isinstance(value, float)
        }
        return self.section.model_copy(update=between).stiffness()

    def piece(self) -> BeamPathPiece:
        """The piece that the table describes."""
        return BeamPathPiece(self.length_mm, self.section_at, rotation(self.turns))


class PathFile(Table):
    """A beam path, clamped at the root of its first piece."""

    format: Literal[1]
    name: Label
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: Units
    pieces: list[PieceTable] = Field(min_length=1)

    def path(self) -> BeamPath:
        """The path that the file describes."""
        return BeamPath(self.name, tuple(piece.piece() for piece in self.pieces))


_TABLES: dict[str, type[Table]] = {
    "": PathFile,
    "piece": PieceTable,
    "units": Units,
    "turn": Turn,
    "stiffness": StiffnessSection,
    **SHAPES,
}


def is_path(content: Mapping[str, Any]) -> bool:
    """Whether a TOML document is a beam path and not a model."""
    return "pieces" in content


def build_path(content: Mapping[str, Any], file: str) -> BeamPath:
    """The path of a TOML document.

    Raises:
        ModelFileError: one line that names the file, the key and the remedy.
    """
    try:
        return PathFile.model_validate(content).path()
    except pydantic.ValidationError as error:
        raise ModelFileError(f"{file}: {one_line(error, content, _keys)}") from error


def _keys(table: str) -> Iterable[str]:
    # what a section's table must not hold may belong above it
    return list(_TABLES["piece" if table == "beam" else table].model_fields)
