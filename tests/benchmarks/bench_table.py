"""``make bench-table``: the table of speed and accuracy in docs/how-well-it-works.md from ``bench.json``."""

import json
import sys
from pathlib import Path
from typing import Any

from helpers.marked_text import renewed

from vjm.io.files import write_whole

BEGIN, END = "<!-- bench: begin -->", "<!-- bench: end -->"
"""Between these the table stands."""
MEANING = {
    "table2_16004_equilibria_s": "the paper's experiment whole: 4 postures, 16 004 displacements; equilibrium, "
    "loaded stiffness and stability at each",
    "speedup_vs_exudyn": "one path through the bifurcation, 16 springs against 16 elements in foot and bar each; "
    "the smaller of the ratios of whole paths and of single equilibria",
    "critical_load_error_vjm_16": "critical force of that path, against 64 springs; to be no worse than the finite "
    "elements'",
    "critical_load_error_exudyn_16": "the finite elements', against the same",
    "cost_ratio_n256_n32": "Newton step, factorisation, inertia and stiffness, 256 springs in the bar over 32",
    "critical_load_error_n4": "posture A in compression, 4 springs against 64",
    "critical_load_error_n8": "the same with 8",
    "critical_load_order": "pinned column against P (1 − P/EA) = π² EI/L², least of the doublings from 2 to 8 "
    "springs",
    "follower_over_dead_16_springs": "a path under a force that follows the tool over one under a dead force, "
    "16 springs",
    "follower_over_dead_64_springs": "the same with 64",
    "moment_over_dead_16_springs": "likewise under a moment, 16 springs",
    "moment_over_dead_64_springs": "the same with 64",
    "calibrate_600_readings_s": "a calibration on 3 postures with 200 readings of 6 channels each, files to page",
    "diagnose_600_readings_s": "a diagnosis of 600 readings, files to page",
    "diagnose_500_poses_2_markers_s": "500 tracked postures of a 7R arm with two markers, seven families of causes",
    "calibrate_500_poses_2_markers_s": "a calibration of the same",
    "diagnose_1500_poses_s": "1,500 tracked postures of a 6R arm, all families",
    "platform_equilibria_a_minute": "platforms on the paper's chains with inverse kinematics, stiffness and "
    "stability, two processes",
    "platform_equilibrium_us": "processor time of one of these",
    "ur10_100000_equilibria_s": "100,000 postures of a 6R arm under its weight: equilibrium and loaded stiffness",
    "delta_pose_ms": "a pose of the Delta, one spring per beam: closing, equilibrium and loaded stiffness",
    "par2_pose_ms": "the same of the Par2",
    "hexapod_pose_ms": "the equilibrium and loaded stiffness of the hexapod",
    **{
        f"{name}_critical_force_s": f"smallest critical force over all directions, one pose of `{name}`"
        for name in ("delta", "par2", "hexapod", "palletiser", "ur10")
    },
    "tree_n256_over_n32": "equilibrium and stiffness of a tree of 256 springs over one of 32",
    "equilibria_speedup_2_workers": "two processes against one at that",
    "weakest_speedup_2_workers": "the same of smallest critical forces over all directions",
    "map_21_stiffness_s": "21³ poses of the Orthoglide: stiffness, from the start of two processes to the files",
    "map_21_critical_s": "the same: smallest critical force over all directions, from two thinner grids",
    "solid_unknowns": "a solid part meshed for the next rows",
    "solid_one_bound_s": "one bound of its compliance, mesh to matrix",
    "solid_memory_gb": "resident memory of that",
    "peak_memory_MB": "resident memory of a process that runs the paper's experiment",
    "curve_first_s": "processor time of `validate curve orthoglide-chain --posture A --to -4`, first after the "
    "installation, which compiles the kernels",
    "curve_later_s": "the same once more",
    "help_s": "processor time of `validate --help`",
    **{
        f"explore_{name}_{what}_ms": f"`validate explore {name}`: the answer to another {what}"
        for name in ("hexapod", "par2", "delta")
        for what in ("load", "posture", "size")
    },
}
"""What each row is, in the table's order. Rows of ``bench.json`` without a requirement may have none."""


def markdown(found: list[dict[str, Any]]) -> str:
    """The rows of a ``bench.json`` as a table, with the machine below it."""
    rows = {row["name"]: row for row in found}
    missing = [name for name in MEANING if name not in rows]
    if missing:
        raise ValueError(f"bench.json: no row {', '.join(missing)}: run `make bench` whole, without ARGS")
    unknown = [name for name, row in rows.items() if row["requirement"] and name not in MEANING]
    if unknown:
        raise ValueError(f"tests/benchmarks/bench_table.py: say in MEANING what {', '.join(unknown)} is")
    lines = ["| row | is | measured | required | |", "| --- | --- | --- | --- | --- |"]
    for name, meaning in MEANING.items():
        row = rows[name]
        unit = f" {row['unit'].replace('us', 'µs')}".rstrip()
        required = row["requirement"].replace("<=", "≤").replace(">=", "≥")
        verdict = ("holds" if row["passed"] else "**missed**") if required else ""
        lines.append(f"| `{name}` | {meaning} | {_number(row['value'])}{unit} | {required} | {verdict} |")
    value = {name: row["value"] for name, row in rows.items()}
    versions = [f"{n.capitalize()} {value[f'version:{n}']}" for n in ("python", "numpy", "numba", "exudyn")]
    machine = f"{value['machine:cores']} cores ({value['machine:processor']}, {', '.join(versions)})"
    return "\n".join([*lines, "", f"Medians, one thread, on a machine with {machine}."]) + "\n"


def with_table(page: str, found: list[dict[str, Any]]) -> str:
    """The page with the table between its marks."""
    return renewed(page, BEGIN, END, markdown(found))


def _number(value: float) -> str:
    """Two figures, or whole where there are more before the point."""
    if value != 0.0 and (abs(value) < 1e-3 or abs(value) >= 1e6):
        return f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e")
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"


if __name__ == "__main__":
    page = Path("docs/how-well-it-works.md")
    try:
        measured = json.loads(Path("bench.json").read_text(encoding="utf-8"))
        write_whole(page, with_table(page.read_text(encoding="utf-8"), measured))
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"error: {error}")
