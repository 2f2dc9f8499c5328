"""The campaign: sets made, diagnosed, and kept one by one, so that a kill at any point costs one set.

A set's folder holds ``data.csv`` and ``sheet.toml`` (all that the finder gets), ``truth.json``, and what the finder
wrote: ``found/`` of the readings, ``still/`` of the same readings without noise (what the finder's own law makes of
the truth), ``told/`` of the readings again, told which cause it is (the oracle), ``next/`` with the readings of the
experiment that it proposed.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hidden_effects.finder import diagnosed, identity, understands
from hidden_effects.follow_up import NoExperimentError
from hidden_effects.generate import UnreachableError, make
from hidden_effects.machine import NoTruthError
from hidden_effects.plan import STRONG, Group, Plan
from hidden_effects.store import Store
from vjm.batch import map_all
from vjm.io.files import write_whole

WITHOUT = "--without"
"""Option by which the finder is not told of a cause."""
ONLY = "--only"
"""Option by which it is told which it is."""


@dataclass(frozen=True)
class Task:
    """One set to be made and diagnosed."""

    plan: Plan
    folder: Path
    diagnose: bool
    without: bool

    @property
    def place(self) -> Path:
        """Folder of the set."""
        return self.folder / "sets" / self.plan.name

    @property
    def result(self) -> Path:
        """What there is at the end."""
        return self.place / ("result.json" if self.diagnose else "truth.json")

    @property
    def done(self) -> bool:
        """Whether nothing is left to do: made, and diagnosed by the finder as it is now."""
        if not self.result.is_file():
            return False
        known = json.loads(self.result.read_text(encoding="utf-8"))
        return "found" not in known or known["found"].get("finder") == identity()


def run(
    plans: list[Plan],
    folder: Path,
    *,
    jobs: int = 2,
    diagnose: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Make and diagnose what is not there yet."""
    without = diagnose and understands(WITHOUT)
    tasks = [Task(plan, folder, diagnose, without) for plan in plans]
    todo = [task for task in tasks if not task.done]
    there = len(tasks) - len(todo)

    def tell(done: int, _: int) -> None:
        if progress is not None:
            progress(there + done, len(tasks))

    tell(0, 0)
    map_all(work, _in_turn(todo, jobs), jobs, tell)


def _in_turn(tasks: list[Task], jobs: int) -> list[Task]:
    """Tasks so that neighbours share a design's signatures, but processes do not find the same ones at once."""
    tasks = sorted(tasks, key=lambda task: (task.plan.design, task.plan.number))
    size = -(-len(tasks) // jobs)
    return [task for k in range(size) for task in tasks[k::size]]


def work(task: Task) -> str:
    """One set, from wherever it stands; the name of its folder."""
    truth = _made(task)
    if task.diagnose:
        result = {"truth": truth} | ({} if "skipped" in truth else _found(task, truth))
        write_whole(task.result, json.dumps(result))
    return task.plan.name


def _made(task: Task) -> dict[str, Any]:
    file = task.place / "truth.json"
    if file.is_file():
        known: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return known
    try:
        return make(task.plan, _store(task), task.place)
    except (UnreachableError, NoTruthError) as error:
        plan = task.plan
        skipped = {"set": plan.number, "group": str(plan.group), "held_out": plan.held_out,
                   "causes": list(plan.causes), "skipped": str(error)}  # fmt: skip
        write_whole(file, json.dumps(skipped))
        return skipped


_STORES: dict[tuple[Path, int], Store] = {}


def _store(task: Task) -> Store:
    key = task.folder, task.plan.designs
    return _STORES.setdefault(key, Store(task.folder / "designs", task.plan.designs))


def _found(task: Task, truth: dict[str, Any]) -> dict[str, Any]:
    place, sheet = task.place, task.place / "sheet.toml"
    options: list[str] = []
    if task.plan.group is Group.OMITTED:
        if not task.without:
            return {"found": {"error": f"the finder has no option {WITHOUT}"}}
        options = [WITHOUT, *truth["causes"]]
    result = {"found": diagnosed(place / "data.csv", sheet, place / "found", options)}
    hidden = [one["strength"] for one in truth["hidden"]]
    if task.plan.group is Group.SINGLE and hidden[0] >= STRONG:
        told = [ONLY, *truth["causes"]] if task.without else []
        result["still"] = diagnosed(place / "still.csv", sheet, place / "still", told)
        result["told"] = diagnosed(place / "data.csv", sheet, place / "told", told)
    proposal = result["found"].get("next_experiment") or {}
    if task.plan.group is Group.INSEPARABLE and proposal.get("path"):
        try:
            _made_next(task, proposal)
            result["next"] = diagnosed(place / "next" / "data.csv", place / "next" / "sheet.toml", place / "next")
        except (NoExperimentError, NoTruthError) as error:
            result["next"] = {"error": str(error)}
    return result


def _made_next(task: Task, proposal: dict[str, Any]) -> None:
    """The readings of a proposed experiment, unless that very one has been simulated."""
    place, said = task.place / "next", json.dumps(proposal)
    made = place / "proposal.json"
    if not made.is_file() or made.read_text(encoding="utf-8") != said:
        make(task.plan, _store(task), place, proposal)
        write_whole(made, said)


def results(plans: list[Plan], folder: Path) -> list[dict[str, Any]]:
    """Of the sets that are done, in order."""
    found = []
    for plan in plans:
        file = Task(plan, folder, True, False).result
        if file.is_file():
            found.append(json.loads(file.read_text(encoding="utf-8")))
    return found
