"""The two questions to measured data, for any kind of test: what the model lacks, and what its numbers are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import assert_never

from vjm.io.findings import Finding, present_causes
from vjm.io.provenance import Provenance, digest
from vjm.threads import single_threaded
from vjm_updating.calibration.document import Calibration
from vjm_updating.calibration.joint import calibrate_joint
from vjm_updating.calibration.run import calibrate_ramps
from vjm_updating.data_set import DataSet, as_joint_test, together
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.diagnosis.run import diagnose_ramps
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.mistakes import DIAGNOSED, TAKEN_BY_FORCE, refuse_mistaken
from vjm_updating.frequencies.calibration import calibrate_frequencies
from vjm_updating.frequencies.measurement import FrequencyMeasurement
from vjm_updating.mechanisms.catalogue import Maker
from vjm_updating.poses.document import PoseCalibration, PoseDiagnosis
from vjm_updating.poses.kinds import KINDS, PreparedTest
from vjm_updating.poses.run import calibrate_poses, diagnose_poses
from vjm_updating.result import CalibrationResult, DiagnosisResult

JOINT = "joint"


@single_threaded
def diagnose(
    data: DataSet | Sequence[DataSet],
    *,
    effects: Sequence[Path | Maker] = (),
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    beside: Sequence[DataSet] = (),
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> DiagnosisResult[Diagnosis] | DiagnosisResult[PoseDiagnosis]:
    """Which causes a test shows that its model lacks, and how surely.

    Args:
        data: the test, see `vjm_updating.load_data`; of poses and deflections also several series of one machine,
            each with frames, markers and zeros of its own.
        effects: causes of one's own, or files with them; see docs/effects.md. Not of poses and deflections.
        only: the causes that are thought possible; all where none is given.
        without: causes that are not.
        beside: other tests on which the findings are judged: one of another specimen, or series of poses or
            deflections of the same machine.
        strict: whether doubtful readings are refused.
        warn: told what is implausible, before anything is fitted.
        progress: told what is being done.

    Raises:
        ValueError: the data or a name cannot be used; one line.
        vjm.errors.NoConvergenceError: the nominal model does not reach the readings.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import diagnose, load_data
        >>> folder = files("vjm_validation") / "examples/fanuc-deflections"
        >>> data = load_data(folder / "readings.csv", folder / "sheet.toml")
        >>> diagnosis = diagnose(data, only=("actuator_compliance",))
        >>> [(row["cause"], row["said"]) for row in diagnosis.rows()]
        [('actuator_compliance', 'may act')]
        >>> diagnosis.figures.findings.more_than_noise
        True
    """
    data = together(data)
    only, without = _present(data, only, "--only", warn), _present(data, without, "--without", warn)
    made_of = data.made_of(only=only, without=without, strict=strict)
    made_of = made_of.reading({f"effects {file.name}": digest(file.read_bytes()) for file in map(_source, effects)})
    made_of = _beside(made_of, beside)
    test = data.test if effects or beside else _as_it_is(data.test)
    seen = replace(data, test=test)
    match test:
        case FrequencyMeasurement():
            raise ValueError(
                f'{data.sheet}: kind = "frequencies" is for `validate calibrate`: frequencies tell how stiff the '
                "parts are, and no causes; test by loads, poses or deflections to diagnose"
            )
        case Measurement():
            _refuse(data, len(beside) > 1, "--beside takes one other specimen of a ramp: leave the others out")
            second = next((one.test for one in beside), None)
            if isinstance(second, PreparedTest | FrequencyMeasurement):
                raise ValueError(
                    f"{data.sheet}: --beside takes a test of the same kind: {beside[0].sheet} is another"
                )
            # it tells when names of causes are known to be right, which is once mistaken readings are put right
            return diagnose_ramps(
                test, _considered(seen, strict=strict), warn, effects=effects, only=only, without=without,
                beside=second, progress=progress,
            ).stamped(made_of)  # fmt: skip
        case PreparedTest():
            _refuse(data, effects, f"--effects is for ramps, and this is {KINDS[data.kind]}")
            return diagnose_poses(
                test, _considered(seen, warn, strict=strict), only=only, without=without,
                beside=_series(data, beside), progress=progress,
            ).stamped(made_of)  # fmt: skip
        case _:
            assert_never(test)


@single_threaded
def calibrate(
    data: DataSet | Sequence[DataSet],
    *,
    fit: Sequence[str] = (),
    next_tests: Sequence[str] = (),
    figure: str = "",
    asked: str | Path = "",
    beside: Sequence[DataSet] = (),
    force: bool = False,
    strict: bool = False,
    warn: Callable[[Sequence[Finding]], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationResult[Calibration] | CalibrationResult[PoseCalibration]:
    """The numbers of a model by a test, with their uncertainty.

    Args:
        data: the test, see `vjm_updating.load_data`; of poses and deflections also several series of one machine,
            each with frames, markers and zeros of its own.
        fit: what to look for: parameters, see docs/calibration.md, or of poses and deflections families, see
            docs/poses.md. By default a factor for every elastic part, or the usual families. Of a test of one
            joint all that it has is looked for.
        next_tests: what could be measured next: ramps ``POSTURE:END`` or ``POSTURE:AXIS:END`` in mm or rad; of
            poses and deflections one CSV file of postures.
        figure: predicted figure of ramps that the next test is to make certain, such as ``D:compression:F_cr``.
        asked: of poses and deflections, where the file will be used: a CSV file of postures, or places of the end
            in the base's axes as ``x=400,y=0:200,z=300`` in mm. The errors there are predicted.
        beside: of poses and deflections, other series of the same machine on which the model file is judged.
        force: whether a model is written that is not for use; it says so in its head.
        strict: whether doubtful readings are refused.
        warn: told what is implausible, before anything is fitted.
        progress: told what is being done.

    Raises:
        ValueError: the data or an option cannot be used; one line.
        vjm.errors.NoConvergenceError: the nominal model does not reach the readings.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import calibrate, load_data
        >>> folder = files("vjm_validation") / "examples/soft-springs"
        >>> calibration = calibrate(load_data(folder / "readings.csv", folder / "sheet.toml"))
        >>> [f"{row['name']} {row['value']:.2f}" for row in calibration.rows()]
        ['foot.factor 1.10', 'link.factor 1.20']
    """
    data = together(data)
    fit = _present(data, fit, "--fit", warn)
    made_of = data.made_of(fit=fit, next=next_tests, figure=figure, asked=str(asked), force=force, strict=strict)
    made_of = _beside(made_of, beside)
    for option, given in (("--for", asked), ("--beside", beside)):
        wrong = given and not isinstance(data.test, PreparedTest)
        _refuse(data, wrong, f"{option} is for calibrations by poses or deflections: leave it out")
    asked_more = fit or next_tests or figure or asked or beside
    test = data.test if asked_more else _as_it_is(data.test)
    considered = _considered(replace(data, test=test), warn, strict=strict, force=force)
    match test:
        case FrequencyMeasurement():
            _refuse(data, next_tests or figure, "is a test of frequencies: leave --next and --figure out")
            return calibrate_frequencies(test, considered, fit=fit, force=force, progress=progress).stamped(made_of)
        case Measurement() if test.sheet.kind == JOINT:
            why = (
                "is a test of one joint: stiffness, hardening, backlash and friction are looked for; leave --fit, "
                "--next and --figure out"
            )
            _refuse(data, fit or next_tests or figure, why)
            return calibrate_joint(test, considered, force=force, progress=progress).stamped(made_of)
        case Measurement():
            return calibrate_ramps(
                test, considered, fit=fit, ramps=next_tests, figure=figure, force=force, progress=progress
            ).stamped(made_of)
        case PreparedTest():
            why = f"is {KINDS[data.kind]}, which has no --figure, and --next takes one CSV file"
            _refuse(data, figure or len(next_tests) > 1, why)
            candidates = Path(next_tests[0]) if next_tests else None
            poses = calibrate_poses(
                test, considered, families=fit, candidates=candidates, asked=asked, beside=_series(data, beside),
                force=force, progress=progress,
            )  # fmt: skip
            if candidates is not None:
                made_of = made_of.reading({f"next {candidates.name}": digest(candidates.read_bytes())})
            return poses.stamped(made_of)
        case _:
            assert_never(test)


def _considered(
    data: DataSet, warn: Callable[[Sequence[Finding]], None] = lambda _: None, *, strict: bool, force: bool = True
) -> Callable[[], list[Finding]]:
    """What looks at a test of any kind before anything is fitted, and tells what is implausible about it.

    A kind of test calls it once the names that it was given are known to be right. Without ``force`` columns that
    are not what they say are refused: a machine that fits them is another one.
    """

    def considered() -> list[Finding]:
        findings = data.considered(strict=strict)
        if not force:
            diagnosed = () if isinstance(data.test, FrequencyMeasurement) else (DIAGNOSED,)
            refuse_mistaken(findings, *diagnosed, TAKEN_BY_FORCE)
        warn(findings)
        return findings

    return considered


def _refuse(data: DataSet, given: object, why: str) -> None:
    """Refuse what was given."""
    if given:
        raise ValueError(f"{data.sheet}: {why}")


def _as_it_is(test: Measurement | PreparedTest) -> Measurement | PreparedTest:
    """A test of the only joint that yields as one of that joint, in whichever file it was written."""
    return as_joint_test(test) or test


def _present(
    data: DataSet, names: Sequence[str], word: str, warn: Callable[[Sequence[Finding]], None]
) -> Sequence[str]:
    """Causes by their present names; tests of poses and deflections had others, which are told."""
    if not isinstance(data.test, PreparedTest):
        return names
    present, old = present_causes(names, word)
    if old:
        warn(old)
    return present


def _beside(made_of: Provenance, beside: Sequence[DataSet]) -> Provenance:
    """With the files of other tests."""
    return made_of.reading({f"beside {name}": own for one in beside for name, own in one.files.items()})


def _series(data: DataSet, beside: Sequence[DataSet]) -> list[PreparedTest]:
    """Other tests of a robot.

    Raises:
        ValueError: one is of another kind.
    """
    others = [one.test for one in beside if isinstance(one.test, PreparedTest)]
    if len(others) < len(beside):
        raise ValueError(f"{data.sheet}: --beside takes poses or deflections of the same machine here")
    return others


def _source(effects: Path | Maker) -> Path:
    """The file of effects of one's own."""
    return effects if isinstance(effects, Path) else Path(effects.__code__.co_filename)
