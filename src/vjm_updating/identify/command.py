"""A part's compliance from virtual experiments, and the beam behind a compliance.

For `validate identify`, and as a result in Python.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm import __version__
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.outcome import Outcome
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.identify import report as words
from vjm_updating.identify.beam_fit import Target
from vjm_updating.identify.experiments import MESHES, BeamPath, Specimen, measure, part_specimen
from vjm_updating.identify.matrix_file import RawMatrix, read_matrix, target
from vjm_updating.identify.report import (
    IdentificationDocument,
    beam_document,
    experiments_document,
    intervals,
    reference_document,
    scaling,
    searches,
)

FIT_RESOLUTION = numerical(1e-6)
"""Scaled rounding half-width in which a measured compliance is met, where its uncertainty is smaller: closer beams
are the same beam to whoever builds them."""
PATH_MESHES = numerical((8, 16, 32))
"""Refinements of a beam path, whose tapers are steps."""


def identify_part(chain: Machine, part: str) -> IdentificationDocument:
    """A part's compliance from virtual experiments, and the uniform beam that it is; see `identified`.

    Raises:
        ValueError: no such part, or one that cannot be meshed.
        NoConvergenceError: a finite element solution was not found.
    """
    return _by_experiment(part_specimen(chain, part), MESHES, chain.name, chain.sha256)


def identify_path(path: BeamPath, sha256: str = "") -> IdentificationDocument:
    """A beam path's compliance from virtual experiments, and the uniform beam nearest to it.

    Raises:
        NoConvergenceError: a finite element solution was not found.
    """
    return _by_experiment(path.specimen(), PATH_MESHES, path.name, sha256)


def identify_matrix(name_or_path: str | Path) -> IdentificationDocument:
    """The uniform beam behind a matrix of the library or a file, whose entries may be rounded.

    Raises:
        MatrixFileError: no matrix of an elastic body, with the line and the remedy.
        OSError: the file cannot be read.
    """
    return examine(read_matrix(name_or_path))


def examine(raw: RawMatrix) -> IdentificationDocument:
    """As `identify_matrix`, of a matrix already read."""
    aim = target(raw)
    beams = [beam_document(one) for one in searches(aim)]
    return IdentificationDocument(
        version=__version__, source="matrix", name=raw.file, model=None, sha256=raw.sha256,
        axes="the file's own", kind=raw.kind, rounding=raw.rounding, compliance=aim.matrix.tolist(),
        uncertainty=intervals(aim.half), experiments=None, references=[], beams=beams,
        findings=[*words.of_matrix(raw), *words.of_beams(beams)],
    )  # fmt: skip


def _by_experiment(
    specimen: Specimen, meshes: tuple[int, int, int], model: str, sha256: str
) -> IdentificationDocument:
    measured = measure(specimen, meshes)
    C = measured.compliance
    aim = Target(C, np.maximum(measured.uncertainty, FIT_RESOLUTION * scaling(C)))
    references = [reference_document("beam theory", specimen.theory, C, printed=False)]
    if specimen.given is not None:
        references.append(reference_document("model file", specimen.given, C, printed=True))
    experiments = experiments_document(measured, meshes)
    beams = [beam_document(one) for one in searches(aim)]
    return IdentificationDocument(
        version=__version__, source="part", name=specimen.name, model=model, sha256=sha256, axes=specimen.axes,
        kind="compliance", rounding=f"of the experiments, at least {FIT_RESOLUTION:g} of √(c_ii c_jj)",
        compliance=C.tolist(), uncertainty=measured.uncertainty.tolist(), experiments=experiments,
        references=references, beams=beams,
        findings=[*words.of_experiments(experiments, references), *words.of_beams(beams)],
    )  # fmt: skip


@dataclass(frozen=True)
class Identification(Outcome):
    """What virtual experiments or a matrix say of a part.

    Attributes:
        document: every figure, as the JSON document of `validate identify` has it.

    Example:
        >>> import vjm_updating
        >>> vjm_updating.identified(matrix="foot-19").compliance.shape
        (6, 6)
    """

    document: IdentificationDocument

    @property
    def compliance(self) -> Array:
        """``(6, 6)`` mm/N, 1/N, rad/(N mm)."""
        return np.array(self.document.compliance)

    def table(self) -> list[dict[str, Any]]:
        """The compliance, a row for each component of the motion."""
        rows = zip(COMPONENTS, self.document.compliance, strict=True)
        return [{"motion": name, **dict(zip(COMPONENTS, row, strict=True))} for name, row in rows]

    def to_dict(self) -> dict[str, Any]:
        """As the JSON document."""
        return self.document.model_dump(mode="json")


def identified(
    machine: Machine | None = None, part: str = "", *, matrix: str | Path | None = None
) -> Identification:
    """A part's 6×6 compliance from virtual experiments, or of a matrix the uniform beam behind it.

    Args:
        machine: see `vjm.load`.
        part: name of one of its parts, or ``first..last`` for parts in series without passive joints.
        matrix: a matrix of the library or a file instead.

    Raises:
        ValueError: neither or both are given, no such part, or one that cannot be meshed.
        NoConvergenceError: a finite element solution was not found.
        ImportError: experiments need the extra ``fea``.

    Example:
        >>> import vjm_updating
        >>> identification = vjm_updating.identified(matrix="foot-19")
        >>> identification.compliance.shape
        (6, 6)
    """
    if (machine is None) == (matrix is None) or (matrix is not None and part):
        raise ValueError("give either a machine with one of its parts, or a matrix")
    if matrix is not None:
        return Identification(identify_matrix(matrix))
    assert machine is not None
    if not part:
        raise ValueError(f"part: which one? {machine.name} has {', '.join(beam.name for beam in machine.beams)}")
    return Identification(identify_part(machine, part))
