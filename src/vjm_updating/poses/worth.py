"""What a model file is worth against an uncalibrated one: where postures were held out, and on other series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm_updating.constants import definition
from vjm_updating.observation.paired_gain import Worth, paired_gain
from vjm_updating.poses.document import ComparedRow
from vjm_updating.poses.held_out import SHARE, errors_at_ends
from vjm_updating.poses.state import BY_LEVEL, FittedState
from vjm_updating.poses.study import Study
from vjm_updating.poses.transfer import Series, by_machine, machine_of
from vjm_updating.poses.written import Written, as_it_stands

REGION, ENDS, ON = "held out by region", "at the ends", "on "
SHEETS, OWN = "the sheet's model", "the model with its own compliances"
"""What a file is held against; the second where the sheet sets compliances aside that the model has."""
TURN = definition(2.0 * np.pi, "rad")
"""Of a joint, after which its postures are the same."""
NOTHING_HELD_OUT = "nothing can be held out: all readings are of one posture"


def worth_of(
    study: Study, first: FittedState, model: Written, chain: Machine, series: Sequence[Series]
) -> list[ComparedRow]:
    """The file against the model that is not calibrated, by region, at the ends, and on each other series.

    A reading counts by the larger of the weights that both give it: what only one of them misses is no outlier.

    Args:
        study: the test.
        first: its fit of the frames alone.
        model: the file.
        chain: the model as it stands.
        series: others of the machine; only frames and zeros are fitted there.
    """
    on = [(one, by_machine(one.study, machine_of(one.study, model.chain), zeros=True)) for one in series]
    rows = []
    for against, (there, state) in ((SHEETS, (study, first)), (OWN, as_it_stands(study, first))):
        if against == OWN and there is study:
            continue
        weight = np.maximum(state.weight, model.state.weight)
        held = [(REGION, state.errors.region, model.state.errors.region)]
        if state.errors.levels is not None and model.state.errors.levels is not None:
            held.append((BY_LEVEL, state.errors.levels, model.state.errors.levels))
        held += [(ENDS, _at_ends(there, state), _at_ends(model.study, model.state))]
        rows += [_row(where, against, was, now, study.folds.region, weight) for where, was, now in held]
        for one, (now, of_file) in on:
            machine = one.study.machine if against == SHEETS else machine_of(one.study, chain)
            was, of_model = by_machine(one.study, machine, zeros=True)
            weight = np.maximum(of_model, of_file)
            rows.append(_row(f"{ON}{one.name}", against, was, now, one.study.folds.region, weight))
    return [row for row in rows if row is not None]


def reasons(compared: Sequence[ComparedRow]) -> Iterator[str]:
    """Why a file is not written, in words.

    It must be better than the sheet's model where it was held out, beyond noise, and nowhere worse.
    """
    if not any(row.where == REGION for row in compared):
        yield NOTHING_HELD_OUT
    for worth, against in product((Worth.WORSE, Worth.ALIKE), (SHEETS, OWN)):
        found = [row for row in compared if row.verdict is worth and row.against == against and _counts(row)]
        if found:
            yield f"it is {worth} than {against}: {', '.join(map(_said, found))}"


def _counts(row: ComparedRow) -> bool:
    needed = row.against == SHEETS and not row.where.startswith(ON)
    return row.verdict is Worth.WORSE or (row.verdict is Worth.ALIKE and needed)


def _said(row: ComparedRow) -> str:
    changed = "saved" if row.saved >= 0.0 else "lost"
    by = f"{abs(row.saved):.0%} {changed} in the mean of the regions, where {row.noise:.0%} are noise"
    return f"{row.where} {row.uncalibrated_mm:.4g} to {row.file_mm:.4g} mm ({by})"


def valid_within(study: Study) -> dict[str, tuple[float, float]]:
    """Ranges of the joints that support a file, rad or mm by name, where the joints reach much further.

    Held-out ends show what a file is worth a fifth of the measured range beyond what it was fitted to. Where a
    joint's limits, or its turn, reach further than that, nothing tells.
    """
    found = {}
    for i, name in enumerate(study.data.joints):
        low, high = float(study.data.q[:, i].min()), float(study.data.q[:, i].max())
        limits, turns = study.machine.limits[i], name in study.machine.turning
        whole = min(np.inf if limits is None else limits[1] - limits[0], TURN if turns else np.inf)
        if (high - low) / (1.0 - SHARE) < whole:
            found[name] = (low, high)
    return found


def _at_ends(study: Study, state: FittedState) -> Array:
    return errors_at_ends(study, state.blocks, state.solution, state.sigma)


def _row(where: str, against: str, was: Array, now: Array, block: np.ndarray, weight: Array) -> ComparedRow | None:
    gain = paired_gain(was, now, block, weight)
    if gain is None:
        return None
    return ComparedRow(
        where=where, against=against, uncalibrated_mm=gain.before, file_mm=gain.after, saved=gain.saved,
        noise=gain.noise, blocks=gain.blocks, verdict=gain.worth,
    )  # fmt: skip
