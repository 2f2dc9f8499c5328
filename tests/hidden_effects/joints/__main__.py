"""``python -m hidden_effects.joints``: joints with hidden causes, diagnosed, and counts of what was found."""

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from hidden_effects.joints.injector import drawn, strengths, write
from vjm.errors import NoConvergenceError
from vjm_updating.diagnosis.run import diagnose_ramps
from vjm_updating.experiment import read_measurement

STRONG = 8.0
"""Standard deviations from which a cause is expected to be found."""
SPRINGS = {"actuator_compliance", "actuator_hardening", "actuator_three_slopes"}


def judged(seed: int, folder: Path) -> dict[str, Any]:
    """A set of a seed, diagnosed: what was hidden, what was said, and whether intervals hold what was put in."""
    joint = drawn(seed)
    begun = time.process_time()
    try:
        document = diagnose_ramps(read_measurement(*write(folder, joint, seed))).figures
    except (NoConvergenceError, ValueError) as error:
        return {"seed": seed, "causes": joint.causes, "strengths": strengths(joint), "error": str(error)}
    strong = strengths(joint)
    members = [sorted(row.causes) for row in document.candidates]
    truth = sorted(joint.causes)
    seen = {cause for cause, strength in strong.items() if strength >= STRONG}
    # of a spring whose bend does not show its straight part may
    allowed = set(truth) | (SPRINGS if set(truth) & SPRINGS - seen else set())
    chosen = next((row for row in document.candidates if sorted(row.causes) == truth), None)
    intervals = {}
    if chosen is not None:
        for name, value in joint.truth().items():
            row = chosen.parameters.get(name)
            if row is not None and not isinstance(row, str):
                intervals[name] = row.interval95[0] <= value <= row.interval95[1]
    return {
        "seed": seed, "causes": truth, "strengths": strong, "verdict": document.verdict, "members": members,
        "right": (document.verdict == "none" and not truth) or truth in members,
        # of a class that holds what was hidden, no cause is said to act that does not
        "false": sorted(set(members[0]) - allowed) if members and truth not in members else [],
        "intervals": intervals, "seconds": time.process_time() - begun,
    }  # fmt: skip


def counts(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """What was found, over all sets of a campaign."""
    done = [row for row in rows if "error" not in row]
    strong = [row for row in done if row["causes"] and min(row["strengths"].values()) >= STRONG]
    quiet = [row for row in done if not row["causes"]]
    held = [inside for row in done for inside in row["intervals"].values()]
    seconds = sorted(row["seconds"] for row in done)
    return {
        "sets": len(rows),
        "no answer": len(rows) - len(done),
        "strong": len(strong),
        "strong and right": sum(row["right"] for row in strong),
        "quiet": len(quiet),
        "quiet with an alarm": sum(row["verdict"] != "none" for row in quiet),
        "false causes": sum(len(row["false"]) for row in done),
        "intervals": len(held),
        "intervals that hold": sum(held),
        "median seconds": seconds[len(seconds) // 2] if seconds else None,
    }


def main() -> None:
    """Diagnose the sets that the file of results does not have yet, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1000, help="of the first set")
    parser.add_argument("--out", type=Path, default=Path("reports/runs/joints.jsonl"))
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    known = asked.out.read_text().splitlines() if asked.out.is_file() else []
    rows = {row["seed"]: row for row in map(json.loads, known)}
    with asked.out.open("a") as file:
        for seed in range(asked.seed, asked.seed + asked.sets):
            if seed not in rows:
                with tempfile.TemporaryDirectory() as folder:
                    rows[seed] = judged(seed, Path(folder))
                file.write(json.dumps(rows[seed]) + "\n")
                file.flush()
    own = [row for seed, row in rows.items() if asked.seed <= seed < asked.seed + asked.sets]
    print(json.dumps(counts(own), indent=1))


if __name__ == "__main__":
    main()
