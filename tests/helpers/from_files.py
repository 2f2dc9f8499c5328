"""Diagnoses and calibrations from files to files, as the commands make them.

A page takes as long as some diagnoses: it is drawn where a test asks for it.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, assert_never

from vjm_updating import calibrate as calibrated
from vjm_updating import diagnose as diagnosed
from vjm_updating import load_data
from vjm_updating.calibration.document import Calibration
from vjm_updating.diagnosis.document import SURE, Diagnosis, Word
from vjm_updating.poses.document import PoseCalibration, PoseDiagnosis
from vjm_updating.poses.kinds import read_test
from vjm_updating.poses.measurement import RobotMeasurement
from vjm_updating.poses.study import Study
from vjm_updating.result import Result

DIAGNOSIS, DIAGNOSIS_PAGE, EXTENDED = "diagnosis.json", "diagnosis.html", "extended-model.toml"
CALIBRATION, CALIBRATION_PAGE, CALIBRATED = "calibration.json", "calibration.html", "calibrated-model.toml"


def _write(result: Result[Any], out: Path, *, page: bool) -> None:
    (result if page else replace(result, draw=None)).write(out)


def _diagnose(
    data: Path, sheet: Path, out: Path, beside: Sequence[tuple[Path, Path]], *, page: bool = False, **options: Any
) -> Diagnosis | PoseDiagnosis:
    result = diagnosed(load_data(data, sheet), beside=[load_data(*files) for files in beside], **options)
    _write(result, out, page=page)
    assert contradictions(result.figures) == []
    return result.figures


def contradictions(said: Diagnosis | PoseDiagnosis) -> list[str]:
    """Where the verdict's word says something else than the findings beside it."""
    acts = {row.cause for row in said.findings.causes if row.word is Word.ACTS}
    sure, unknown = acts.union(*(row.causes for row in said.findings.groups)), said.findings.unknown or 0.0
    match said.verdict:
        case "none" | "unknown":
            result = [f"{said.verdict}, but {cause} acts" for cause in sorted(sure)]
            # tests of robots say no such probability
            if said.verdict == "unknown" and said.findings.unknown is not None and unknown < 0.5:
                result.append(f"unknown, but that with a probability of {unknown:.2f}")
            return result
        case "named" | "class" | "partly":
            result = [f"{said.verdict} without {cause}, which acts" for cause in sorted(acts - set(said.causes))]
            if (said.findings.nothing or 0.0) > 1.0 - SURE:
                result.append(f"{said.verdict}, but nothing may act")
            if isinstance(said, Diagnosis) and "nothing explains the others" in said.residual:
                result.append(f"{said.verdict}, but nothing explains the readings that are not left out")
            if said.verdict == "named" and unknown < 1.0 - SURE:
                result += [f"named, but {cause} only may act" for cause in sorted(set(said.causes) - sure)]
            return result
        case _:
            assert_never(said.verdict)


def diagnose(
    data: Path, sheet: Path, out: Path, *, beside: Sequence[tuple[Path, Path]] = (), **options: Any
) -> Diagnosis:
    """Of a test of ramps, of a column, by loads or of a joint."""
    found = _diagnose(data, sheet, out, beside, **options)
    assert isinstance(found, Diagnosis)
    return found


def diagnose_poses(
    data: Path, sheet: Path, out: Path, *, beside: Sequence[tuple[Path, Path]] = (), **options: Any
) -> PoseDiagnosis:
    """Of a test of poses or deflections."""
    found = _diagnose(data, sheet, out, beside, **options)
    assert isinstance(found, PoseDiagnosis)
    return found


def calibrate(
    data: Path, sheet: Path, out: Path, fit: Sequence[str] = (), *, page: bool = False, **options: Any
) -> Calibration:
    """By a test of ramps, by loads or of a joint."""
    result = calibrated(load_data(data, sheet), fit=fit, **options)
    _write(result, out, page=page)
    assert isinstance(result.figures, Calibration)
    return result.figures


def calibrate_poses(
    data: Path,
    sheet: Path,
    out: Path,
    *,
    families: Sequence[str] = (),
    candidates: Path | None = None,
    beside: Sequence[tuple[Path, Path]] = (),
    page: bool = False,
    **options: Any,
) -> PoseCalibration:
    """By a test of poses or deflections."""
    further = [] if candidates is None else [str(candidates)]
    others = [load_data(*files) for files in beside]
    result = calibrated(load_data(data, sheet), fit=families, next_tests=further, beside=others, **options)
    _write(result, out, page=page)
    assert isinstance(result.figures, PoseCalibration)
    return result.figures


def prepared(data: Path, sheet: Path) -> tuple[RobotMeasurement, Study]:
    """A test of poses or deflections that was read, checked and aligned."""
    test = read_test(data, sheet)
    return test.measurement, test.study
