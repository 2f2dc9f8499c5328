"""The two questions to tests of a robot in many postures: calibration and diagnosis."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from vjm import __version__
from vjm.io.errors import did_you_mean
from vjm.io.findings import Finding, Grade
from vjm.model.machine import Machine
from vjm.rotations import Array, rotation_vector
from vjm_output.documents import VersionRow, doubt_rows
from vjm_updating.calibration.calibrated_model import model_files
from vjm_updating.constants import shown
from vjm_updating.diagnosis.document import FindingsRow, by_hypotheses, findings_of, groups_of, shares_of
from vjm_updating.experiment.mistakes import columns_mistaken
from vjm_updating.inference.significance import Worth, paired_gain
from vjm_updating.poses import document as rows
from vjm_updating.poses.changes import ChangePoint, cut, found_changes
from vjm_updating.poses.document import ComparedRow, MemberRow, within_words
from vjm_updating.poses.families import TITLES
from vjm_updating.poses.held_out import SHARE, by_machine, errors_at_ends, halves, series_beside
from vjm_updating.poses.identifiability import TURN, RangeSupport, estimates, next_postures
from vjm_updating.poses.kinds import PreparedTest
from vjm_updating.poses.measurement import RobotMeasurement, RobotSheet
from vjm_updating.poses.selection import Selection, Step, select_families, step_of, with_needed
from vjm_updating.poses.state import (
    BY_LEVEL,
    BY_SERIES,
    COUPLING,
    Candidates,
    FittedState,
    Hypothesis,
    mean_distance,
)
from vjm_updating.poses.study import OUTLIER, SeriesStudy, Study, couplings
from vjm_updating.poses.verdict import (
    NEXT,
    PoseVerdict,
    contrasts,
    doubts_of_fit,
    judge,
    missing_more,
    remainder_of,
    said_of,
)
from vjm_updating.poses.written import Written, as_it_stands, asked_candidates, predicted, written
from vjm_updating.result import CALIBRATED, EXTENDED, CalibrationResult, DiagnosisResult

# --- What a model file is worth against an uncalibrated one: where postures were held out, and on other series

REGION, ENDS, ON = "held out by region", "at the ends", "on "
SHEETS, OWN = "the sheet's model", "the model with its own compliances"
"""What a file is held against; the second where the sheet sets compliances aside that the model has."""
NOTHING_HELD_OUT = "nothing can be held out: all readings are of one posture"


def worth_of(
    study: Study, first: FittedState, model: Written, chain: Machine, series: Sequence[SeriesStudy]
) -> list[ComparedRow]:
    """The file against the model that is not calibrated, by region, at the ends, and on each other series.

    A reading counts by the larger of the weights that both give it: what only one of them misses is no outlier. Of
    the study ``first`` is the fit of the frames alone, ``chain`` the model as it stands. On other series only the
    frames and zeros are fitted.
    """
    on = [(one, by_machine(one, model.chain, zeros=True)) for one in series]
    rows = []
    for against, (reference, state) in ((SHEETS, (study, first)), (OWN, as_it_stands(study, first))):
        if against == OWN and reference is study:
            continue
        weight = np.maximum(state.weight, model.state.weight)
        held = [(REGION, state.errors.region, model.state.errors.region)]
        if state.errors.levels is not None and model.state.errors.levels is not None:
            held.append((BY_LEVEL, state.errors.levels, model.state.errors.levels))
        if state.errors.series is not None and model.state.errors.series is not None:
            held.append((BY_SERIES, state.errors.series, model.state.errors.series))
        held += [(ENDS, errors_at_ends(reference, state), errors_at_ends(model.study, model.state))]
        region, series_ = study.folds.region, study.folds.series
        # a series errs as a whole, and so does a region of it
        of_series = region if series_ is None else region + (region.max() + 1) * series_
        rows += [
            _row(where, against, was, now, of_series if where == BY_SERIES else region, weight)
            for where, was, now in held
        ]
        for one, (now, of_file) in on:
            was, of_model = by_machine(one, None if against == SHEETS else chain, zeros=True)
            weight = np.maximum(of_model, of_file)
            rows.append(_row(f"{ON}{one.data.file}", against, was, now, one.folds.region, weight))
    return [row for row in rows if row is not None]


def verdict_of(compared: Sequence[ComparedRow]) -> Worth | None:
    """What a file is worth: the worst of what counts; None where nothing was held out.

    It must be better than the sheet's model where it was held out, beyond noise, and nowhere worse.
    """
    if not any(row.where == REGION for row in compared):
        return None
    counting = {row.verdict for row in compared if _counts(row)}
    return next((worth for worth in (Worth.WORSE, Worth.ALIKE) if worth in counting), Worth.BETTER)


def reasons(compared: Sequence[ComparedRow]) -> Iterator[str]:
    """Why a file is not written, in words; see `verdict_of`."""
    if verdict_of(compared) is None:
        yield NOTHING_HELD_OUT
    for worth, against in product((Worth.WORSE, Worth.ALIKE), (SHEETS, OWN)):
        matching = [row for row in compared if row.verdict is worth and row.against == against and _counts(row)]
        said = []
        for row in matching:
            changed = "saved" if row.saved >= 0.0 else "lost"
            by = f"{abs(row.saved):.0%} {changed} in the mean of the regions, where {row.noise:.0%} are noise"
            said.append(f"{row.where} {row.uncalibrated_mm:.4g} to {row.file_mm:.4g} mm ({by})")
        if said:
            yield f"it is {worth} than {against}: {', '.join(said)}"


def _counts(row: ComparedRow) -> bool:
    """Whether a comparison decides: one that is worse always, one that is no better where a gain is needed."""
    needed = row.against == SHEETS and not row.where.startswith(ON)
    return row.verdict is Worth.WORSE or (row.verdict is Worth.ALIKE and needed)


def valid_within(study: Study) -> dict[str, tuple[float, float]]:
    """Ranges of the joints that support a file, rad or mm by name, where the joints reach much further.

    Held-out ends show what a file is worth a fifth of the measured range beyond what it was fitted to. Where a
    joint's limits, or its turn, reach further than that, nothing tells.
    """
    ranges = {}
    for i, name in enumerate(study.data.joints):
        low, high = float(study.data.q[:, i].min()), float(study.data.q[:, i].max())
        limits, turns = study.machine.limits[i], name in study.machine.turning
        whole = min(np.inf if limits is None else limits[1] - limits[0], TURN if turns else np.inf)
        if (high - low) / (1.0 - SHARE) < whole:
            ranges[name] = (low, high)
    return ranges


def _row(where: str, against: str, was: Array, now: Array, block: np.ndarray, weight: Array) -> ComparedRow | None:
    gain = paired_gain(was, now, block, weight)
    if gain is None:
        return None
    return ComparedRow(
        where=where, against=against, uncalibrated_mm=gain.before, file_mm=gain.after, saved=gain.saved,
        noise=gain.noise, blocks=gain.blocks, verdict=gain.worth,
    )  # fmt: skip


# --- What acts, what may act, and the residual, by the probabilities of a selection's hypotheses ------------------


def pose_findings(selection: Selection, verdict: PoseVerdict) -> FindingsRow:
    """The findings in rows and words."""
    study, state = selection.study, selection.state
    probability, _ = by_hypotheses(verdict.weighed)
    missed: dict[str, float] = {}
    for name in verdict.causes:
        errors = study.tried(state, state.hypothesis.minus(name))[1]
        missed[name] = max(sum(errors.judged) - sum(state.errors.judged), 0.0)
    explained = max(verdict.explained, 0.0)
    return findings_of(
        probability, shares_of(explained, missed), groups_of(verdict.weighed), explained=explained,
        left=verdict.remainder.over_noise, more_than_noise=verdict.remainder.significant,
        trusted=verdict.kind != "unknown",
    )  # fmt: skip


USUAL = ("frame_error", "actuator_compliance")
"""Families of a calibration that names none."""
UNNEEDED = "the readings are as probable without it"
"""Why a drive that was asked keeps the model's compliance, see `vjm_updating.poses.selection.with_needed`."""
SHOWN = shown(12)


def _chosen(study: Study, only: Sequence[str], without: Sequence[str]) -> list[str]:
    """Names of families and couplings that are thought possible.

    Raises:
        ValueError: a name is none.
    """
    known = [*study.families, *couplings(study)]
    for name in (*only, *without):
        reasons = [one.reason for one in study.unasked if one.name.partition(".")[0] == name]
        if name not in known and reasons:
            if name in only:
                raise ValueError(f"these postures cannot know '{name}': {reasons[0]}; leave it out")
            continue
        if name in study.not_asked:
            raise ValueError(f"'{name}' is not seen in these data: {study.not_asked_for}; leave it out")
        if name not in known and name != COUPLING:
            raise ValueError(
                f"no family '{name}' for these data; there are {', '.join(known)}{did_you_mean(name, known)}"
            )

    def is_in(name: str, names: Sequence[str]) -> bool:
        return name in names or name.partition(".")[0] in names

    return [name for name in known if (not only or is_in(name, only)) and not is_in(name, without)]


def diagnose_poses(
    test: PreparedTest, considered: Callable[[], list[Finding]], *, only: Sequence[str] = (),
    without: Sequence[str] = (), beside: Sequence[PreparedTest] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> DiagnosisResult[rows.PoseDiagnosis]:  # fmt: skip
    """Diagnose a test of poses or deflections; arguments as of `vjm_updating.diagnose`.

    ``considered`` says what is implausible about the test.

    Raises:
        ValueError: a name cannot be used; one line.
        vjm.errors.NoConvergenceError: the model has no equilibrium in a posture.
    """
    begun = time.perf_counter()
    measurement, study = test.measurement, test.study
    names = _chosen(study, only, without)
    series = series_beside([other.study for other in beside], study)
    findings = considered()
    # what is fitted to columns that are not what they say means nothing
    doubtful = bool(columns_mistaken(findings))
    selection = select_families(study, [] if doubtful else names, progress, series)
    progress("changes in the course of the series")
    # a drift of the tracker would make up for half of a change
    states = [step.state for step in selection.steps if "tracker_drift" not in step.state.hypothesis.families]
    stepped = [] if doubtful else found_changes(study, states[-1])
    whole, (study, short) = study, cut(study, stepped)
    if study is not whole:
        progress("the series are cut at their changes")
        selection = select_families(study, _asked(study, names), progress, series)
    steps = selection.steps
    progress("verdict")
    verdict = judge(selection, [*findings, *_short(short, measurement)], stepped, fitted=study is not whole)
    first, last = steps[0].state, steps[-1].state
    common, model = _common(measurement, study, steps, verdict.members, begun, findings)
    diagnosis = rows.PoseDiagnosis(
        **common
        | {
            "beside": [one.data.file for one in series],
            "doubts": doubt_rows(_once([*verdict.findings, *model.refusals])),
            "changes": _changes(stepped, fitted=study is not whole),
            "halves": verdict.halves,
        },
        verdict=verdict.kind,
        findings=pose_findings(selection, verdict),
        causes=list(verdict.causes),
        alternatives=[list(names) for names in verdict.alternatives],
        refused=[rows.NotKnownRow(name=name, reason=reason) for name, reason in selection.refused.items()],
        explained=verdict.explained if last.errors.held_out else None,
        selection=[_selection_row(step) for step in steps],
        contrasts_before=contrasts(study, first)[:SHOWN],
        contrasts_after=contrasts(study, last)[:SHOWN],
        remainder=verdict.remainder,
        next=NEXT["surer"] if verdict.next == NEXT["none"] and common["next_postures"] else verdict.next,
    )  # fmt: skip
    progress("report")
    models = model_files(model.texts(EXTENDED), [str(one) for one in model.refusals])
    return DiagnosisResult(diagnosis, models, _page(measurement.sheet, study, steps, model.support))


def calibrate_poses(
    test: PreparedTest, considered: Callable[[], list[Finding]], *, families: Sequence[str] = (),
    candidates: Path | None = None, asked: str | Path = "", beside: Sequence[PreparedTest] = (),
    force: bool = False, progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[rows.PoseCalibration]:  # fmt: skip
    """Calibrate a robot by a test with chosen families, else `USUAL`; see `vjm_updating.calibrate`.

    Its ``fit`` is ``families`` here, its ``next_tests`` ``candidates``; other arguments are the same, and
    ``considered`` says what is implausible about the test.

    Raises:
        ValueError: a name cannot be used; one line.
        vjm.errors.NoConvergenceError: the model has no equilibrium in a posture.
    """
    begun = time.perf_counter()
    measurement, study = test.measurement, test.study
    chosen = _chosen(study, families or [name for name in USUAL if name in study.families], ())
    series = series_beside([other.study for other in beside], study)
    findings = considered()
    hypothesis, first, last = _fitted(study, chosen, progress)
    progress("changes in the course of the series")
    stepped = found_changes(study, last)
    whole, (study, short) = study, cut(study, stepped)
    if study is not whole:
        progress("the series are cut at their changes")
        hypothesis, first, last = _fitted(study, _asked(study, chosen), progress)
    listed = None if candidates is None else test.candidates(candidates)
    wanted = asked_candidates(test, study, asked) if asked else None
    steps = [step_of(study, "", first, series), step_of(study, ", ".join(hypothesis.names), last, series)]
    members = estimates(study, last)
    common, model = _common(measurement, study, steps, members, begun, findings, listed)
    progress("what the model file is worth")
    worth = worth_of(study, first, model, measurement.model.chain, series)
    rest = remainder_of(study, last, contrasts(study, last), None)
    refused = [*map(str, model.refusals), *reasons(worth)]
    if rest.significant and missing_more(first, last):
        refused.append(f"{rest.words}; of the squared error held out more is left than explained")
    within = valid_within(study)
    said_of_file = {
        "verdict": verdict_of(worth),
        "compared": worth,
        "refused": refused,
        "forced": force and bool(refused),
        "valid_within": {name: list(ends) for name, ends in within.items()},
    }
    compared, fitted = halves(study, last, members), study is not whole
    said = [*findings, *_short(short, measurement), *(said_of(one, fitted=fitted) for one in stepped)]
    said += [*doubts_of_fit(study, last, compared, members), *model.refusals]
    calibration = rows.PoseCalibration(
        **common
        | {
            "beside": [one.data.file for one in series],
            "doubts": doubt_rows(_once(said)),
            "changes": _changes(stepped, fitted=fitted),
            "halves": compared,
            "asked_for": None if wanted is None else predicted(study, model, *wanted, within),
            "written": _written(last, model).model_copy(update=said_of_file),
        }
    )
    progress("report")
    models = model_files(model.texts(CALIBRATED), refused, within, within_words(within), force=force)
    return CalibrationResult(calibration, models, _page(measurement.sheet, study, steps, model.support))


def _page(
    sheet: RobotSheet, study: Study, steps: Sequence[Step], support: RangeSupport | None
) -> Callable[[rows.PoseCalibration], str]:
    def made(calibration: rows.PoseCalibration) -> str:
        # matplotlib takes a second to import, and is an extra
        from vjm_updating.poses.page import page

        return page(sheet, study, steps, support, calibration)

    return made


def _once(findings: Sequence[Finding]) -> list[Finding]:
    """Findings, each once, in their order."""
    return list(dict.fromkeys(findings))


def _weighed_down(study: Study, state: FittedState) -> list[rows.WeighedDownRow]:
    """Readings that count little, those one after another together, marker by marker."""
    off, result = study.distance(state.linearised.residual), []
    file = [one.data.file for one in study.groups for _ in range(len(one.data))]
    group = np.repeat(np.arange(len(study.groups)), [len(one.data) for one in study.groups])
    for k, marker in enumerate(study.data.markers):
        low = np.flatnonzero(state.weight[:, k] < OUTLIER)
        for run in np.split(low, np.flatnonzero((np.diff(low) > 1) | (np.diff(group[low]) != 0)) + 1):
            if len(run):
                first, last = (int(study.data.row[i]) for i in run[[0, -1]])
                ends = [float(np.nanmin(off[run, k])), float(np.nanmax(off[run, k]))]
                row = rows.WeighedDownRow(
                    file=file[run[0]], marker=marker, first_row=first, last_row=last, readings=len(run),
                    off_mm=ends,
                )  # fmt: skip
                result.append(row)
    return result


def _changes(changes: Sequence[ChangePoint], *, fitted: bool) -> list[rows.ChangeRow]:
    return [
        rows.ChangeRow.model_validate(
            {"kind": c.kind, "name": c.name, "file": c.study.data.file, "row": int(c.study.data.row[c.where]),
             "size": c.size.tolist(), "gain": c.gain, "share": c.share, "fitted": fitted}
        )
        for c in changes
    ]  # fmt: skip


def _short(left_out: Sequence[tuple[int, int]], measurement: RobotMeasurement) -> list[Finding]:
    """Parts between changes that have too few readings."""
    words = "between two changes stand too few readings for frames and zeros of their own: left out"
    return [
        Finding(Grade.NOTED, f"{measurement.data.file}, rows {first} to {last}", words) for first, last in left_out
    ]


def _asked(study: Study, names: Sequence[str]) -> list[str]:
    """Of names those that a test can show."""
    known = [*study.families, *couplings(study)]
    return [name for name in names if name in known]


def _fitted(
    study: Study, chosen: Sequence[str], progress: Callable[[str], None]
) -> tuple[Hypothesis, FittedState, FittedState]:
    """The hypothesis of chosen families, the fit of the frames alone, and its own."""
    progress("base frame and markers")
    first = study.gauss_newton(Hypothesis())
    hypothesis = Hypothesis()
    for name in chosen:
        hypothesis = hypothesis.plus(name)
    progress("fit")
    return hypothesis, first, with_needed(study, study.judged(study.gauss_newton(hypothesis, first), gears=True))


def _written(judged: FittedState, model: Written) -> rows.WrittenRow:
    return rows.WrittenRow(
        judged_mm=judged.errors.means[0], without=list(model.without), refitted_mm=model.state.errors.means[0],
        file_mm=model.error, refused=[str(one) for one in model.refusals], at_bound=list(model.at_bound),
        whole_range=None if model.support is None else model.support.row,
    )  # fmt: skip


def _common(
    measurement: RobotMeasurement,
    study: Study,
    steps: Sequence[Step],
    members: Sequence[MemberRow],
    begun: float,
    findings: Sequence[Finding],
    candidates: Candidates | None = None,
) -> tuple[dict[str, object], Written]:
    """What a calibration and a diagnosis say alike, and the model file."""
    last = steps[-1].state
    data, frames = study.data, last.frames
    model = written(measurement, study, steps[0].state, last, members)
    # what is fitted to columns that are not what they say is of no use
    model = replace(model, refusals=(*columns_mistaken(findings), *model.refusals))
    as_deflected = [f"{COUPLING}.{joint}" for joint in last.hypothesis.as_deflected]
    member_rows = [one.model_copy(update={"in_file": model.members.get(one.name)}) for one in members]
    families = [
        rows.FamilyRow(
            name=name,
            title=TITLES[name] if name != "actuator_compliance" else f"{TITLES[name]}: {measurement.sheet.bends}",
            size=last.solution.sizes[study.number(name)],
            effective=last.solution.effective[study.number(name)],
            members=[row for row in member_rows if row.name.startswith(f"{name}.")],
        )
        for name in last.hypothesis.families
    ]
    families += [
        rows.FamilyRow(name=n, title=TITLES[COUPLING], size=None, effective=None, members=[]) for n in as_deflected
    ]
    places = {f"marker {name}": [float(v) for v in frames.m[k]] for k, name in enumerate(data.markers)}
    common: dict[str, object] = {
        "kind": measurement.kind,
        "baseline": study.baseline,
        "postures": len(data),
        "different_postures": int(study.folds.posture.max()) + 1,
        "grid": list(study.folds.levels),
        "series": [
            rows.SeriesRow(
                file=one.data.file, sheet=one.sheet.file, first_row=int(one.data.row[0]),
                last_row=int(one.data.row[-1]), postures=len(one.data), markers=list(one.data.markers),
            )
            for one in study.groups
        ],
        "markers": list(data.markers),
        "left_out": data.left_out,
        "outliers": int(np.sum(last.weight < OUTLIER)),
        "weighed_down": _weighed_down(study, last),
        "before": _selection_row(steps[0]),
        "after": _selection_row(steps[-1]).model_copy(update={"added": "", "tried": []}),
        "families": families,
        "frames": {"base": [*map(float, frames.t), *map(float, _vector(frames.R))], **places},
        "next_postures": next_postures(study, last, candidates),
        "joints": measurement.sheet.meaning,
        "not_asked": list(study.not_asked),
        "not_asked_for": study.not_asked_for,
        "not_known": [
            *study.unasked,
            *(rows.NotKnownRow(name=name, reason=UNNEEDED) for name in last.hypothesis.kept),
        ],
        "written": _written(last, model),
        "not_in_model": model.left_out,
        "version": VersionRow(
            package=__version__, model_sha256=measurement.model.chain.sha256, data_sha256=data.sha256
        ),
        "seconds": time.perf_counter() - begun,
    }  # fmt: skip
    return common, model


def _vector(R: np.ndarray) -> np.ndarray:
    try:
        return rotation_vector(R)
    except ValueError:
        dyad = R + np.eye(3)
        axis = dyad[:, int(np.argmax(np.diag(dyad)))]
        return np.pi * axis / np.linalg.norm(axis)


def _selection_row(step: Step) -> rows.SelectionRow:
    state = step.state
    fitted, _, region = state.errors.means
    level = None if state.errors.levels is None else _known(mean_distance(state.errors.levels))
    return rows.SelectionRow(
        added=step.added, fitted_mm=fitted, random_mm=_known(mean_distance(state.errors.random)),
        region_mm=_known(region), level_mm=level,
        series_mm=None if state.errors.series is None else _known(mean_distance(state.errors.series)),
        ends_mm=_known(mean_distance(step.ends)), beside_mm=[float(np.nanmean(one)) for one in step.beside],
        parameters=state.blocks.nuisances + sum(state.solution.effective.values()),
        tried=[rows.TrialRow(name=move.name, log_evidence=move.gain) for move in step.moves],
    )  # fmt: skip


def _known(distance: float) -> float | None:
    """None where nothing was held out."""
    return distance if np.isfinite(distance) else None
