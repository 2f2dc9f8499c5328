"""``python -m hidden_effects.third_party_sets FOLDER``: the finder on sets that others made, scored by their truth.

The folder holds ``truth.json`` (``sets``: by name the group, the hidden causes, the acceptable class and the
strength ``d``) and a folder for each set with ``DATA.csv`` and ``SHEET.toml``. What the finder says of a set is
kept, so that a run that was cut off goes on, and is said anew only where the finder's own sources have changed.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import App, Parameter

from hidden_effects.finder import diagnosed
from hidden_effects.judging import candidate_sets
from hidden_effects.running import finish
from vjm.batch import map_all
from vjm.io.files import check_writable, write_whole
from vjm_output import terminal

GIVEN = Path(__file__).parents[3] / "shared" / "blind_development"
TRUTH, DATA, SHEET, RESULTS = "truth.json", "DATA.csv", "SHEET.toml", "given-sets.json"
STRONG, OBVIOUS = 8.0, 30.0
"""Strengths from which a single cause is asked for by name, and from which no known cause may be `unknown`."""
THIRD = 3
"""One set of so many is a quick turn's."""
SHUFFLE = 35
"""Seed of the order in which the sets are shared among quick turns."""
OK, BAD_INPUT, INTERRUPTED = 0, 2, 130

app = App(name="given-sets", help="Diagnose sets that others made, and score the verdicts by their truth.")


@dataclass(frozen=True)
class Task:
    """A set to be diagnosed."""

    name: str
    folder: Path
    out: Path


def classes(truth: dict[str, Any]) -> set[frozenset[str]]:
    """Sets of causes that one verdict may hold: the hidden one, and what is one class with it."""
    listed = truth["class"]
    own = {frozenset([one]) if isinstance(one, str) else frozenset(one) for one in listed}
    return own | ({frozenset(truth["causes"])} if truth["causes"] else set())


def right(truth: dict[str, Any], found: dict[str, Any]) -> bool:
    """Whether a verdict is right: `none`, `unknown`, exactly the hidden set, or a class that is part of its own."""
    if "error" in found:
        return False
    if truth["group"] in ("none", "unknown"):
        return bool(found["verdict"] == truth["group"])
    candidates, hidden = candidate_sets(found), frozenset(truth["causes"])
    if found["verdict"] == "named":
        return candidates == [hidden]
    return found["verdict"] == "class" and hidden in candidates and set(candidates) <= classes(truth)


def figures(truths: dict[str, dict[str, Any]], found: dict[str, dict[str, Any]]) -> dict[str, str]:
    """The table of a run: by the name of a row what it says."""
    done = [(truths[name], one) for name, one in found.items()]

    def share(
        of: Callable[[dict[str, Any]], bool], counts: Callable[[dict[str, Any], dict[str, Any]], bool] = right
    ) -> str:
        mine = [counts(truth, one) for truth, one in done if of(truth)]
        return f"{sum(mine)}/{len(mine)}"

    busy = [one["busy"] for one in found.values() if "busy" in one]
    return {
        f"single causes, strength ≥ {STRONG:g}: right": share(
            lambda t: t["group"] == "single" and t["d"] >= STRONG
        ),
        "single causes, weaker: right": share(lambda t: t["group"] == "single" and t["d"] < STRONG),
        "pairs: right": share(lambda t: t["group"] == "pair"),
        "classes: right": share(lambda t: t["group"] == "class"),
        "quiet: alarms": share(lambda t: t["group"] == "none", lambda t, one: not right(t, one)),
        "outside the catalogue `unknown`": share(lambda t: t["group"] == "unknown"),
        f"known, strength ≥ {OBVIOUS:g}, called `unknown`": share(
            lambda t: bool(t["causes"]) and t["d"] >= OBVIOUS,
            lambda _, one: one.get("verdict", "unknown") == "unknown",
        ),
        "no answer": share(lambda _: True, lambda _, one: "error" in one),
        "median seconds of a processor": f"{np.median(busy):.1f}" if busy else "",
        "longest": f"{max(busy):.0f}" if busy else "",
    }


def line(truth: dict[str, Any], found: dict[str, Any]) -> str:
    """A set in one line: what was hidden, and what was said."""
    hidden = " + ".join(sorted(truth["causes"])) or truth["group"]
    if "error" in found:
        said = found["error"]
    else:
        said = " | ".join(" + ".join(sorted(one)) for one in candidate_sets(found))
        said = f"{found['verdict']} {said or found.get('residual', '')} ({found['confidence']:.2f})"
    mark = "right" if right(truth, found) else "WRONG"
    return f"{mark} {truth['group']} {truth['d']:.1f} {hidden}: {said} [{found.get('busy', 0.0):.0f} s]"


def chosen(names: Sequence[str], third: int | None) -> list[str]:
    """All sets, or a random third that is always the same: the first, second or third."""
    if third is None:
        return list(names)
    order = np.random.default_rng(SHUFFLE).permutation(sorted(names)).tolist()
    return sorted(order[third - 1 :: THIRD])


def work(task: Task) -> dict[str, Any]:
    """What the finder says of a set."""
    task.out.mkdir(parents=True, exist_ok=True)
    return diagnosed(task.folder / DATA, task.folder / SHEET, task.out)


@app.default
def third_party_sets(
    folder: Annotated[Path, Parameter(help="Folder of the sets and their truth.")] = GIVEN,
    *,
    out: Annotated[Path, Parameter(help="Folder of the run; one that was cut off goes on there.")] = Path(
        "reports/runs/given-sets"
    ),
    jobs: Annotated[int, Parameter(help="Processes.")] = 1,
    third: Annotated[int | None, Parameter(help="A fixed third of the sets only: 1, 2 or 3.")] = None,
    only: Annotated[tuple[str, ...], Parameter(help="These sets only.", consume_multiple=True)] = (),
    beside: Annotated[Path | None, Parameter(help="Another run's folder, to be shown beside this one.")] = None,
) -> int:
    """Diagnose the sets and print the table, with those that another run decided otherwise."""
    if jobs < 1 or third not in (None, 1, 2, 3):
        raise ValueError("--jobs must be 1 or more and --third 1, 2 or 3")
    if not (folder / TRUTH).is_file():
        terminal.error(f"{folder}: no {TRUTH}: these sets are not here, so nothing is run")
        return OK
    truths = json.loads((folder / TRUTH).read_text(encoding="utf-8"))["sets"]
    names = sorted(only) or chosen(list(truths), third)
    strange = [name for name in names if name not in truths]
    if strange:
        raise ValueError(f"{folder / TRUTH}: no set {strange[0]}; remove it from --only")
    check_writable(out)
    tasks = [Task(name, folder / name, out / name) for name in names]
    try:
        with terminal.progress() as progress:
            said = map_all(work, tasks, jobs, lambda n, of: progress("sets", n, of))
    except KeyboardInterrupt:
        terminal.error(f"interrupted; what is finished is in {out} and is not done again")
        return INTERRUPTED
    found = dict(zip(names, said, strict=True))
    other = _of(beside, names) if beside is not None else {}
    console = terminal.console()
    for name in names:
        console.print(f"{name} {line(truths[name], found[name])}", soft_wrap=True, markup=False)
        if name in other and right(truths[name], other[name]) != right(truths[name], found[name]):
            console.print(f"   beside: {line(truths[name], other[name])}", soft_wrap=True, markup=False)
    text = markdown(figures(truths, found), figures(truths, other) if other else None)
    write_whole(out / RESULTS, json.dumps({"sets": len(found), "figures": figures(truths, found)}, indent=1))
    console.print(text, soft_wrap=True, markup=False)
    return OK


def markdown(new: dict[str, str], old: dict[str, str] | None = None) -> str:
    """The table, with another run's in front of it where there is one."""
    heads = ["", "this"] if old is None else ["", "beside", "this"]
    rows = [[name, value] if old is None else [name, old[name], value] for name, value in new.items()]
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _of(folder: Path, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """What another run has said of sets, whichever finder it was."""
    found = {}
    for name in names:
        run, document = folder / name / "run.json", folder / name / "diagnosis.json"
        if run.is_file():
            took = json.loads(run.read_text(encoding="utf-8"))
            found[name] = took if "error" in took else json.loads(document.read_text(encoding="utf-8")) | took
    return found


def main() -> None:
    """Run and exit; errors are one line."""
    finish(app)


if __name__ == "__main__":
    main()
