"""Running cases: every engine on every mesh, over processes, kept as they finish."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as FilePath

from vjm.batch import map_all
from vjm.errors import NoConvergenceError
from vjm.io.provenance import Provenance
from vjm_output.documents import Row
from vjm_validation.verification.families import engine
from vjm_validation.verification.geometry import chain_of, load_case_of
from vjm_validation.verification.library import Case
from vjm_validation.verification.measures import measured
from vjm_validation.verification.schema import Family

COST = {"exudyn": 3.0, "opensees": 5.0}
"""Seconds that a mesh takes, roughly, relative to the lumped model's: the longest items are begun first."""


class Answers(Row):
    """What one family answered to one case, as it is kept in the run's folder."""

    case: str
    family: Family
    values: list[list[float | None]]
    """By question, by mesh; null where the engine did not get there."""
    failures: list[str]
    """By question: why its finest value is missing, empty where it is not."""
    refused: str = ""
    """Why the family cannot answer at all."""
    seconds: float = 0.0
    """Of processor time."""


class AnswerStore:
    """Finished answers in a run's folder, which an interrupted run uses again; without a folder nothing is kept."""

    def __init__(self, folder: FilePath | None) -> None:
        self._folder = folder / "verification" if folder is not None else None

    def find(self, case: str, files: Mapping[str, str], family: Family) -> Answers | None:
        """The answers to the same files by the same program, if they are there."""
        if self._folder is None:
            return None
        kept = self._made_of(case, files, family).kept(self._file(self._folder, case, family))
        found = None if kept is None else Answers.model_validate(kept)
        # what was refused may have been installed or learned since
        return found if found is not None and not found.refused else None

    def keep(self, answers: Answers, files: Mapping[str, str]) -> None:
        """Write what one family answered."""
        if self._folder is not None:
            made_of = self._made_of(answers.case, files, answers.family)
            made_of.keep(self._file(self._folder, answers.case, answers.family), answers.model_dump())

    @staticmethod
    def _made_of(case: str, files: Mapping[str, str], family: Family) -> Provenance:
        return Provenance.of(files, case=case, family=family)

    @staticmethod
    def _file(folder: FilePath, case: str, family: str) -> FilePath:
        return folder / f"{case}_{family}.json"


def run_cases(
    cases: Sequence[Case],
    families: Sequence[str] | None = None,
    jobs: int = 1,
    folder: FilePath | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Answers]:
    """The answers of every family that a case names.

    Args:
        cases: what is asked.
        families: only these; None for all that the cases name.
        jobs: processes.
        folder: of the run, to keep answers in and to find those of an interrupted one.
        progress: called with how many items are done, and of how many.
    """
    store = AnswerStore(folder)
    wanted: list[tuple[Case, Family]] = [
        (case, family) for case in cases for family in case.file.engines if families is None or family in families
    ]
    found = {(case.name, family): store.find(case.name, case.files, family) for case, family in wanted}
    files = {case.name: case.files for case in cases}
    missing = [item for item in wanted if found[item[0].name, item[1]] is None]
    missing.sort(key=lambda item: -_cost(*item))
    ready = len(wanted) - len(missing)

    def done(_: int, answers: Answers) -> None:
        store.keep(answers, files[answers.case])
        found[answers.case, answers.family] = answers

    def count(finished: int, _: int) -> None:
        if progress is not None:
            progress(ready + finished, len(wanted))

    map_all(_answered, missing, jobs, count, done)
    return [answers for case, family in wanted if (answers := found[case.name, family]) is not None]


def _cost(case: Case, family: Family) -> float:
    table = case.file.engines[family]
    return COST.get(family, 1.0) * len(case.file.runs) * sum(table.meshes)


def _answered(item: tuple[Case, Family]) -> Answers:
    return answered(*item)


def answered(case: Case, family: Family, meshes: Sequence[int] | None = None) -> Answers:
    """What one family answers to a case.

    Args:
        case: what is asked.
        family: of engines; the case must name it.
        meshes: only these; None for all that the case names.
    """
    table = case.file.engines[family]
    return new_answers(
        case.name,
        family,
        meshes or table.meshes or [1],
        len(case.questions),
        lambda mesh: _on_mesh(case, family, mesh),
    )


def new_answers(
    name: str,
    family: Family,
    meshes: Sequence[int],
    count: int,
    on_mesh: Callable[[int], Sequence[tuple[float | None, str]]],
) -> Answers:
    """Ask on every mesh.

    Args:
        name: of the case.
        family: who is asked.
        meshes: from coarse to fine.
        count: of questions.
        on_mesh: gives for every question a value, or none and why. What it raises as `ValueError` or `ImportError`
            is a refusal of the whole case.
    """
    started = time.process_time()
    values: list[list[float | None]] = [[] for _ in range(count)]
    failures = [""] * count
    refused = ""
    try:
        for mesh in meshes:
            for i, (value, failure) in enumerate(on_mesh(mesh)):
                values[i].append(value)
                failures[i] = failure
    except (ValueError, ImportError) as error:
        refused = " ".join(str(error).split())
    return Answers(
        case=name,
        family=family,
        values=values,
        failures=failures,
        refused=refused,
        seconds=time.process_time() - started,
    )


def _on_mesh(case: Case, family: Family, mesh: int) -> list[tuple[float | None, str]]:
    """Value of every question, or why there is none.

    Raises:
        ValueError: the engine cannot express the case.
        ImportError: it is not installed.
    """
    table = case.file.engines[family]
    elements = 1 if case.file.sided else mesh
    solver = engine(family, elements, shear=table.shear, foot=False if table.foot_spring else None)
    chain = chain_of(case, mesh)
    found: list[tuple[float | None, str]] = []
    for run in case.file.runs:
        load_case = load_case_of(run, mesh)
        try:
            path = solver.trace(chain, load_case)
        except NoConvergenceError as failure:
            found += [(None, str(failure))] * len(run.asked)
            continue
        for asked in run.asked:
            try:
                found.append((measured(asked, solver, chain, load_case, path, mesh), ""))
            except NoConvergenceError as failure:
                found.append((None, str(failure)))
    return found
