"""``python -m hidden_effects.fresh``: sets with hidden causes, diagnosed, and scored by their probabilities.

Four generators are of this package: ramps, `poses`, `poses.deflections` and `joints`. Two are by other authors and
lie beside the project on some machines; a folder of ready sets with their ``truth.json`` may stand for a generator.
Where one is not there its sets are left out, and the document says so. What is finished is kept in the folder, so
that a run that was cut off goes on.
"""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter
from helpers.marked_text import renewed

from hidden_effects.finder import POSES, RAMPS, diagnosed, identity, kept
from hidden_effects.generate import UnreachableError, make
from hidden_effects.joints.injector import drawn, strengths
from hidden_effects.joints.injector import write as write_joint
from hidden_effects.machine import NoTruthError
from hidden_effects.outcome import Outcome, Truth, found_of, of_deflections, of_given, of_joint, of_own, of_poses
from hidden_effects.outcome_score import figures, markdown, paired, paired_markdown
from hidden_effects.plan import COUNTS, Plan, plans
from hidden_effects.poses import deflections
from hidden_effects.poses.plan import Planned
from hidden_effects.poses.plan import plans as pose_plans
from hidden_effects.poses.plan import write as write_poses
from hidden_effects.running import finish
from hidden_effects.store import Store
from vjm.io.files import check_writable, write_whole
from vjm_output import terminal

BESIDE = Path(__file__).parents[3] / "shared"
OTHERS = (BESIDE / "blind_generator", BESIDE / "blind_generator2")
TRUTH, DATA, SHEET = "truth.json", "DATA.csv", "SHEET.toml"
"""Of a folder by other authors: what all sets hide, and the files of each."""
STRENGTHS = (8.0, 16.0, 32.0)
"""Of single causes: those that the aims are about."""
SETS_OF_A_DESIGN = 6
"""Sets for one design of the package's injector, whose signatures take long."""
BEGIN, END = "<!-- fresh: begin -->", "<!-- fresh: end -->"
"""Between these the tables of a page stand."""
OK = 0

app = App(name="fresh", help="Draw sets with hidden causes, have them diagnosed, score the probabilities.")


@dataclass(frozen=True)
class Set:
    """Files of a set, and what it hides."""

    data: Path
    sheet: Path
    out: Path
    truth: Truth
    entry: str = RAMPS


def own_sets(count: int, seed: int, folder: Path) -> list[Set]:
    """Sets of this package's injector of ramps; those that cannot be made are left out."""
    designs = max(1, round(count / SETS_OF_A_DESIGN))
    todo = plans(count / sum(COUNTS.values()), seed, designs, STRENGTHS)[:count]
    store = Store(folder / "designs", designs)
    made = [(plan, _made(plan, store, folder / plan.name)) for plan in todo]
    return [
        Set(place / "data.csv", place / "sheet.toml", place / "found", of_own(truth))
        for plan, truth in made
        if "skipped" not in truth
        for place in [folder / plan.name]
    ]


def _made(plan: Plan, store: Store, place: Path) -> dict[str, Any]:
    file = place / TRUTH
    if not file.is_file():
        try:
            make(plan, store, place)
        except (UnreachableError, NoTruthError) as error:
            write_whole(file, json.dumps({"skipped": str(error)}))
    truth: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return truth


def others_sets(count: int, seed: int, folder: Path, generator: Path) -> list[Set]:
    """Sets of a generator beside the project, or those of a folder that are ready; none where it is not there."""
    ready = (generator / TRUTH).is_file()
    if not ready and not (generator / "make.py").is_file():
        return []
    if not ready and not (folder / TRUTH).is_file():
        # it keeps its compiled kernels beside itself
        own = folder.with_name(f"{folder.name}-generator")
        shutil.copytree(generator, own, dirs_exist_ok=True)
        options = ["--seed", str(seed), "--only", str(count), "--out", str(folder.resolve()), "--jobs", "1"]
        made = subprocess.run(
            [sys.executable, "make.py", *options], cwd=own, capture_output=True, text=True, check=False
        )
        if made.returncode:
            raise ValueError(f"{generator / 'make.py'}: {' '.join(made.stderr.split())[-200:]}")
    sets = generator if ready else folder
    truths = json.loads((sets / TRUTH).read_text(encoding="utf-8"))["sets"]
    return [
        Set(
            sets / name / DATA, sets / name / SHEET, folder / name / "found", of_given(generator.name, name, truth)
        )
        for name, truth in truths.items()
    ]  # fmt: skip


def poses_sets(count: int, seed: int, folder: Path) -> list[Set]:
    """Tests of poses, all groups mixed."""
    todo = pose_plans(count, seed)
    # one of each group in turn, so that a part of them is a small campaign
    groups = [[p for p in todo if p.group == group] for group in dict.fromkeys(p.group for p in todo)]
    mixed = [plan for turn in zip_longest(*groups) for plan in turn if plan is not None]
    return [_pose_set(plan, folder / f"{plan.number:04d}") for plan in mixed[:count]]


def _pose_set(plan: Planned, place: Path) -> Set:
    data, sheet = place / "readings.csv", place / "sheet.toml"
    if not data.is_file():
        write_poses(plan, place)
    return Set(data, sheet, place / "found", of_poses(plan.number, plan.group, plan.causes), POSES)


def joint_sets(count: int, seed: int, folder: Path) -> list[Set]:
    """Tests of one joint."""
    return [joint_set(1000 * seed + k, folder / f"{k:04d}") for k in range(count)]


def joint_set(seed: int, place: Path) -> Set:
    """A test of one joint of a seed."""
    place.mkdir(parents=True, exist_ok=True)
    joint = drawn(seed)
    return Set(
        *write_joint(place, joint, seed),
        place / "found",
        of_joint(seed, joint.causes, strengths(joint), joint.truth()),
    )


def deflection_sets(count: int, seed: int, folder: Path) -> list[Set]:
    """Tests of deflections."""
    sets = []
    for number in range(1000 * seed, 1000 * seed + count):
        place = folder / f"{number:06d}"
        kind, files = deflections.write(number, place)
        truth = of_deflections(number, frozenset(deflections.HIDDEN[kind]))
        sets.append(Set(*files, place / "found", truth, POSES))
    return sets


def outcome_of(one: Set) -> Outcome:
    """A set's diagnosis; one that is there is read."""
    one.out.mkdir(parents=True, exist_ok=True)
    return Outcome(one.truth, found_of(diagnosed(one.data, one.sheet, one.out, entry=one.entry)))


def in_turn(*sets: list[Set]) -> Iterator[Set]:
    """Sets of all generators, spread so that each has the same part of its own done at any time."""
    placed = [((k + 0.5) / len(own), one) for own in sets for k, one in enumerate(own)]
    return iter([one for _, one in sorted(placed, key=lambda pair: pair[0])])


def document(outcomes: list[Outcome], seed: int, made: dict[str, int], left_out: str) -> dict[str, Any]:
    """The figures of every generator and of all, with what they were made by."""
    names = [name for name in made if any(o.truth.generator == name for o in outcomes)]
    own = {name: figures([o for o in outcomes if o.truth.generator == name]) for name in names}
    return {
        "seed": seed,
        "finder": {entry: identity(entry) for entry in (RAMPS, POSES)},
        "made": made,
        "left_out": left_out,
        "figures": own | {"all": figures(outcomes)},
        "sets": [
            {"generator": o.truth.generator, "set": o.truth.name, "group": o.truth.group,
             "strength": o.truth.strength, "causes": sorted(o.truth.causes), "verdict": o.found.verdict,
             "probability": dict(o.found.probability), "share": dict(o.found.share), "acts": sorted(o.found.acts),
             "groups": [sorted(g) for g in o.found.groups], "error": o.found.error}
            for o in outcomes
        ],
    }  # fmt: skip


def words(found: dict[str, Any], command: str) -> str:
    """The tables, and by what they were made."""
    made = ", ".join(f"{figures['sets']} of {name}" for name, figures in found["figures"].items() if name != "all")
    left = f" {found['left_out']}" if found["left_out"] else ""
    failed = found["figures"]["all"]["no_answer"]
    failed = f" Without an answer, and wrong: {'; '.join(failed)}." if failed else ""
    return f"Seed {found['seed']}; sets: {made}. Made by `{command}`.{left}{failed}\n\n{markdown(found['figures'])}"


@app.default
def fresh(
    *,
    seed: Annotated[int, Parameter(help="Of all generators: one that no set was looked at of.")],
    out: Annotated[Path, Parameter(help="Folder; a run that was cut off goes on there.")] = Path(
        "reports/runs/fresh"
    ),
    sets: Annotated[int, Parameter(help="Sets of each generator.")] = 40,
    others: Annotated[
        int | None, Parameter(help="Sets of each generator by other authors, which are slow to make; else as many.")
    ] = None,
    poses_seed: Annotated[int | None, Parameter(help="Seed of the tests of poses; else the same.")] = None,
    others_seed: Annotated[int | None, Parameter(help="Seed of those generators; else the same.")] = None,
    minutes: Annotated[float, Parameter(help="Of a processor, after which no other set is begun.")] = 25.0,
    generators: Annotated[
        tuple[Path, ...], Parameter(help="Folders of generators by other authors, or of ready sets.")
    ] = OTHERS,
    against: Annotated[
        Path | None, Parameter(help="Such a folder with the same sets, as another version has diagnosed them.")
    ] = None,
    only_make: Annotated[bool, Parameter(negative="", help="Make the sets and diagnose none.")] = False,
    renew: Annotated[tuple[Path, ...], Parameter(help="Pages whose tables are renewed.")] = (),
) -> int:
    """Make the sets, diagnose as many as there is time for, write fresh.json and fresh.md."""
    if sets < 10 or (others or 10) < 10 or seed < 0 or minutes <= 0.0:
        raise ValueError("--sets and --others must be 10 or more, --seed 0 or more, --minutes above 0")
    check_writable(out)
    others_count, others_from = sets if others is None else others, seed if others_seed is None else others_seed
    of = {
        "poses": poses_sets(sets, seed if poses_seed is None else poses_seed, out / "poses"),
        "deflections": deflection_sets(sets, seed, out / "deflections"),
        "joints": joint_sets(sets, seed, out / "joints"),
        "ramps": own_sets(sets, seed, out / "ramps"),
    } | {one.name: others_sets(others_count, others_from, out / one.name, one) for one in generators}
    if only_make:
        return OK
    missing = [str(one) for one in generators if not of[one.name]]
    left_out = f"Generators by other authors that are not here: {', '.join(missing)}." if missing else ""
    outcomes, spent = [], 0.0
    both: list[tuple[Outcome, Outcome]] = []
    for one in in_turn(*of.values()):
        if spent > 60.0 * minutes:
            break
        outcomes.append(outcome_of(one))
        spent += outcomes[-1].found.seconds
        before = None if against is None else kept(against / one.out.relative_to(out))
        if before is not None:
            both.append((Outcome(one.truth, found_of(before)), outcomes[-1]))
    made = {name: len(own) for name, own in of.items()}
    result = document(outcomes, seed, made, left_out)
    write_whole(out / "fresh.json", json.dumps(result, indent=1))
    given = {
        "seed": seed, "poses-seed": poses_seed, "others-seed": others_seed, "sets": sets, "others": others,
        "minutes": f"{minutes:g}",
    }  # fmt: skip
    # of other folders the names: where they lie is another matter on each machine
    folders = [("generators", one.name) for one in generators if generators != OTHERS]
    folders += [] if against is None else [("against", against.name)]
    options = " ".join(f"--{name} {value}" for name, value in (*given.items(), *folders) if value is not None)
    text = words(result, f"python -m hidden_effects.fresh {options}")
    if both:
        text += f"\nOf these, {len(both)} sets by another version too:\n\n"
        text += paired_markdown(paired(both))
    write_whole(out / "fresh.md", text)
    for page in renew:
        write_whole(page, renewed(page.read_text(encoding="utf-8"), BEGIN, END, text))
    terminal.console().print(text, soft_wrap=True, markup=False)
    return OK


def main() -> None:
    """Run and exit; errors are one line."""
    finish(app)


if __name__ == "__main__":
    main()
