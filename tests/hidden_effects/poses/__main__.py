"""``python -m hidden_effects.poses``: hide causes in tests of poses, have them diagnosed, score the verdicts."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

from hidden_effects.poses.plan import GROUPS, Planned, plans, write
from vjm_updating.poses.command import diagnose_poses

PUBLISHED = 92
"""Seed of the figures in docs/poses.md."""
PAYS = 0.2
"""Share of the error held out that what was named saves, from which on a set counts as one that can be named."""
STANDS_FOR = {
    "frame_error": {"frame_error", "joint_offset"},
}
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
    gain = 1.0 - found.after.random_mm / found.before.random_mm
    if plan.group == "stranger":
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


def summary(rows: list[Scored]) -> dict[str, object]:
    """Shares by group."""
    groups = defaultdict(list)
    for row in rows:
        groups[row.group].append(row)
    result: dict[str, object] = {}
    for name, own in groups.items():
        counted = own if name in ("none", "stranger") else [row for row in own if row.pays]
        result[name] = {"sets": len(own), "counted": len(counted), "right": sum(row.right for row in counted)}
    result["false_alarms"] = sum(row.false_alarm for row in rows)
    return result


def main() -> None:
    """Run a campaign and print its score."""
    parser = argparse.ArgumentParser(prog="python -m hidden_effects.poses", description=__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=PUBLISHED)
    parser.add_argument("--group", choices=sorted(GROUPS), default=None, help="only the sets of one group")
    parser.add_argument("--out", type=Path, default=None, help="JSON file of all rows")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for plan in plans(options.sets, options.seed):
            if options.group not in (None, plan.group):
                continue
            row = run(plan, Path(folder) / str(plan.number))
            rows.append(row)
            mark = "" if row.right else "  <-"
            print(f"{row.number:4d} {row.robot:15s} {'+'.join(row.causes) or 'nothing':40s} {row.verdict:8s} "
                  f"{'+'.join(row.named)}{mark}", flush=True)  # fmt: skip
    print(json.dumps(summary(rows)))
    if options.out is not None:
        options.out.write_text(json.dumps([asdict(row) for row in rows], indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
