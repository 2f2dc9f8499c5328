"""``python -m hidden_effects.poses``: hide causes in tests of poses, have them diagnosed, score the verdicts."""

import argparse
import json
import tempfile
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

from helpers.from_files import diagnose_poses
from helpers.marked_text import renewed

from hidden_effects.poses.plan import GROUPS, Planned, plans, write
from hidden_effects.statistics import rate, wilson

PUBLISHED = 901177
"""Seed of the figures in docs/how-well/robots.md."""
BEGIN, END = "<!-- hidden_effects.poses: begin -->", "<!-- hidden_effects.poses: end -->"
HIDDEN = {
    "none": "nothing",
    "single": "one family",
    "pair": "two families",
    "outside": "a cause outside the catalogue",
    "soft wrist": "drives of a heavy robot, fifty times as soft in the wrist; half of them with frame errors",
}
PAYS = 0.2
"""Share of the error held out that what was named saves, from which on a set counts as one that can be named."""
STANDS_FOR = {"frame_error": {"frame_error", "joint_offset"}}
"""Families that name a cause besides the one of its own name: the frames' errors hidden have offsets among them."""


@dataclass(frozen=True)
class Scored:
    """One set's outcome."""

    number: int
    group: str
    robot: str
    causes: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    pays: bool
    right: bool
    false_alarm: bool
    seconds: float


def run(plan: Planned, folder: Path) -> Scored:
    """Make, diagnose and score a set."""
    found = diagnose_poses(*write(plan, folder), folder / "out")
    named = set(found.causes)
    wanted = set(plan.causes)
    allowed = set().union(wanted, *(STANDS_FOR.get(c, set()) for c in wanted))
    before, after = found.before.random_mm, found.after.random_mm
    gain = float("nan") if before is None or after is None else 1.0 - after / before
    if plan.group == "outside":
        right = found.verdict == "unknown"
    elif plan.group == "none":
        right = found.verdict == "none"
    else:
        sets = [named, *(set(row) for row in found.alternatives)]
        right = found.verdict in ("named", "class") and any(wanted <= one <= allowed for one in sets)
    return Scored(
        plan.number, plan.group, plan.robot.name, plan.causes, found.verdict, tuple(found.causes), gain >= PAYS,
        right, plan.group == "none" and bool(named), found.seconds,
    )  # fmt: skip


def counted(rows: list[Scored]) -> dict[str, tuple[int, list[bool]]]:
    """How many sets each group has, and which of those that can be named are right."""
    groups = defaultdict(list)
    for row in rows:
        groups[row.group].append(row)
    return {
        name: (len(own), [row.right for row in own if row.pays or name in ("none", "outside")])
        for name, own in groups.items()
    }


def summary(rows: list[Scored]) -> dict[str, dict[str, float | int | list[float] | None]]:
    """Shares by group, of the sets that can be named, and of false alarms where nothing is hidden."""
    result = {name: rate(flags) for name, (_, flags) in counted(rows).items()}
    return result | {"false alarms": rate([row.false_alarm for row in rows if row.group == "none"])}


def markdown(rows: list[Scored], seed: int) -> str:
    """The table of the docs."""
    lines = [f"Seed {seed}, {len(rows)} sets.", "", "| hidden | sets | of these counted | right | 95 % interval |"]
    lines.append("| --- | ---: | ---: | ---: | ---: |")
    for name, (made, flags) in counted(rows).items():
        low, high = wilson(sum(flags), len(flags))
        lines.append(
            f"| {HIDDEN[name]} | {made} | {len(flags)} | {sum(flags)} | {100 * low:.0f} to {100 * high:.0f} % |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run a campaign and print its score."""
    parser = argparse.ArgumentParser(prog="python -m hidden_effects.poses", description=__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=PUBLISHED)
    parser.add_argument("--group", choices=sorted(GROUPS), default=None, help="only the sets of one group")
    parser.add_argument("--out", type=Path, default=None, help="JSON file of all rows")
    parser.add_argument("--rows", type=Path, default=None, help="such a file of this seed: score it, run nothing")
    parser.add_argument("--renew", type=Path, default=None, help="page whose table is renewed")
    options = parser.parse_args()
    rows = [] if options.rows is None else [Scored(**row) for row in json.loads(options.rows.read_text())]
    with tempfile.TemporaryDirectory() as folder:
        for plan in plans(options.sets, options.seed):
            if options.rows is not None or options.group not in (None, plan.group):
                continue
            row = run(plan, Path(folder) / str(plan.number))
            rows.append(row)
            mark = "" if row.right else "  <-"
            print(f"{row.number:4d} {row.robot:15s} {'+'.join(row.causes) or 'nothing':40s} {row.verdict:8s} "
                  f"{'+'.join(row.named)}{mark}", flush=True)  # fmt: skip
    print(json.dumps(summary(rows)))
    if options.renew is not None:
        table = markdown(rows, options.seed) + "\n"
        options.renew.write_text(renewed(options.renew.read_text("utf-8"), BEGIN, END, table), "utf-8")
    if options.out is not None:
        options.out.write_text(json.dumps([asdict(row) for row in rows], indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
