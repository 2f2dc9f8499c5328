"""``validate all MODEL`` from the model file to the run's folder."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vjm.io.files import check_writable, write_whole
from vjm.io.findings import Finding
from vjm.io.machine_file import load_model
from vjm.io.path_files import write_curve
from vjm.io.provenance import Provenance, digest
from vjm_output.documents import as_json, doubt_rows, versions
from vjm_validation.acceptance import AcceptanceRow, at_most, none_of
from vjm_validation.studies.own_machine import (
    CONVERGED,
    REFERENCE,
    OwnMachine,
    OwnMachineSummary,
    Progress,
    Request,
    extent,
    study,
)
from vjm_validation.summary import discard_outdated

NOTHING_CHECKED = "anything checked"
"""Name of the only row of a run that looked at nothing, which is no pass."""
AGREEMENT = 2e-3
"""Of what both engines compute: 16 springs a beam, and 8 elements, are good to 1e-4 and to 7e-4 near buckling, and
what is refined to `CONVERGED` is good to 7e-4 together."""
RESIDUAL = 1e-8
"""Scaled; the lumped solver stops at 1e-11, Exudyn at 1e-9 of its own norm."""
FAR = 3.0
"""Times the machine's first critical force, up to which critical points must agree."""
BENT = 0.1
"""Of the machine's size: displacement up to which they must."""


def run_own(
    request: Request, out: Path, command: str, progress: Progress, doubts: Sequence[Finding] = ()
) -> OwnMachineSummary:
    """Study a machine and write ``index.html``, ``summary.json``, ``findings.md``, curves, figures and renders.

    Args:
        request: what is asked.
        out: folder.
        command: that makes the run again.
        progress: told what is done.
        doubts: what is implausible about the model.

    Raises:
        ModelFileError: the file is no model.
        ValueError: no such posture, direction or engine.
        OSError: the folder cannot be written to.
    """
    started = time.perf_counter()
    check_writable(out)
    made_of = Provenance.of(load_model(request.model).files, command=command)
    discard_outdated(out, made_of)
    found = study(request, progress)
    hashes = {}
    for (posture, direction, engine), path in found.paths.items():
        stem = "".join(c if c.isalnum() or c in "-_+" else "_" for c in f"{posture}_{direction}_{engine}")
        file = out / "curves" / f"{stem}.csv"
        write_curve(path, file)
        hashes[file.name] = digest(file.read_bytes())
    progress("report", 0, 1)
    summary = OwnMachineSummary(
        command=command,
        model=found.machine.name,
        control="held" if found.held else "free",
        gravity=list(request.gravity) if request.gravity else None,
        stiffness=found.stiffness,
        loads=found.loads,
        critical=found.critical,
        convergence=found.convergence,
        elements=found.elements,
        shares=found.shares,
        shares_along=found.shares_along,
        modes=found.modes,
        sensitivity=found.sensitivity,
        map=found.map,
        acceptance=own_acceptance(found),
        seconds=time.perf_counter() - started,
        versions=versions(),
        made_of=dict(made_of.inputs),
        hashes=hashes,
        notes=found.notes,
        doubts=doubt_rows(doubts),
    )
    from vjm_validation.report.own_machine_page import write_own_report  # drawing libraries take seconds to import

    write_own_report(found, summary, out)
    write_whole(out / "summary.json", as_json(summary))
    progress("report", 1, 1)
    return summary


def own_acceptance(found: OwnMachine) -> list[AcceptanceRow]:
    """What the solvers must do on a machine of which nothing is known beforehand."""
    rows = []
    if found.paths:
        early = [f"{'_'.join(key)}: {path.stopped}" for key, path in found.paths.items() if not path.complete]
        residuals = [p.residual for path in found.paths.values() for p in path.points if np.isfinite(p.residual)]
        rows += [
            none_of("paths complete", "every load path reaches its end", early),
            at_most("equilibrium residual", max(residuals, default=0.0), RESIDUAL, " (scaled)"),
        ]
    apart = [row.difference for row in found.loads if row.difference is not None]
    if apart:
        what = "forces" if found.held else "deflections"
        rows.append(at_most(f"{what}: virtual springs against {REFERENCE}", max(apart), AGREEMENT))
        theirs = {(row.posture, row.direction): row.K0 for row in found.loads if row.engine == REFERENCE}
        K = [
            abs(row.K0 / reference - 1.0)
            for row in found.loads
            if row.engine != REFERENCE and row.K0 and (reference := theirs.get((row.posture, row.direction)))
        ]
        rows.append(
            at_most(f"unloaded stiffness: virtual springs against {REFERENCE}", max(K, default=0.0), AGREEMENT)
        )
    rows += _critical_rows(found)
    if len(found.convergence) > 1:
        row = found.convergence[-2]
        name = f"{row.quantity.split(',')[0]}: {row.springs} springs a beam against twice as many"
        rows.append(at_most(name, row.error, CONVERGED))
    if not rows:
        why = "; ".join(found.notes) or "no load path, no equilibrium and no second engine"
        what = "an equilibrium, another engine or more springs"
        rows.append(AcceptanceRow(name=NOTHING_CHECKED, requirement=what, value=f"not run: {why}", passed=None))
    return rows


def _critical_rows(found: OwnMachine) -> list[AcceptanceRow]:
    theirs = {(row.posture, row.direction): row for row in found.critical if row.engine == REFERENCE}
    pairs = [
        (row, theirs[row.posture, row.direction])
        for row in found.critical
        if row.engine != REFERENCE and (row.posture, row.direction) in theirs
    ]
    if not pairs:
        return []
    # where one of them gave up before the other's critical point, there is nothing to compare
    comparable = [(a, b) for a, b in pairs if not (a.stopped or b.stopped) or (a.kind and b.kind)]
    first = min((row.F_cr for pair in pairs for row in pair if row.F_cr), default=0.0)
    # what lies far beyond the first loss of stability, or behind large displacements, is listed only
    far = BENT * extent(found.machine)
    comparable = [
        pair
        for pair in comparable
        if not any(row.F_cr and (row.F_cr > FAR * first or abs(row.d_cr or 0.0) > far) for row in pair)
    ]
    kinds = [
        f"{a.posture} {a.direction}: {a.kind or 'none'} and {b.kind or 'none'}"
        for a, b in comparable
        if a.kind is not b.kind
    ]
    rows = [none_of("kinds of critical points", f"those of {REFERENCE}", kinds)]
    gaps = [abs(a.F_cr / b.F_cr - 1.0) for a, b in comparable if a.F_cr and b.F_cr]
    if gaps and not found.held and found.elements is not None:
        # where the end is free finite elements follow one force, the one that both engines refine
        gaps = [abs(found.convergence[-1].value / found.elements - 1.0)]
    if gaps:
        rows.append(at_most(f"critical forces: virtual springs against {REFERENCE}", max(gaps), AGREEMENT))
    return rows
