"""The JSON Schemas of every JSON file that the suite writes or prints, but for what it keeps to go on from.

``python -m vjm_validation.schemas FOLDER`` writes them; the published ones are in ``docs/schemas``.
"""

from __future__ import annotations

import json
import sys
from functools import cache
from pathlib import Path
from typing import Any

from vjm.io.body_file import BodyFile
from vjm.io.files import write_whole
from vjm.io.manipulator_file import manipulator_schema
from vjm.io.model_file import model_schema
from vjm_output.documents import schema
from vjm_updating.calibration.document import Calibration
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.identify.report import IdentificationDocument
from vjm_updating.identify.solid_part import SolidDocument
from vjm_updating.maps.run import MapDocument
from vjm_updating.poses.document import PoseCalibration, PoseDiagnosis
from vjm_updating.simulate import Truth
from vjm_validation.compensation import CompensationDocument
from vjm_validation.design_documents import FrontDocument, OptimumDocument, SweepDocument
from vjm_validation.documents import (
    BucklingDocument,
    CurveDocument,
    MapRowsDocument,
    MapsDocument,
    ModesDocument,
    SectionsDocument,
    SensitivityDocument,
    StiffnessDocument,
)
from vjm_validation.runs.paper import Summary
from vjm_validation.studies.own_machine import OwnMachineSummary


@cache
def schemas() -> dict[str, dict[str, Any]]:
    """JSON Schemas by file name."""
    return {
        "summary.schema.json": schema(Summary),
        "own-machine.schema.json": schema(OwnMachineSummary),
        "buckling.schema.json": schema(BucklingDocument),
        "curve.schema.json": schema(CurveDocument),
        "compensation.schema.json": schema(CompensationDocument),
        "stiffness.schema.json": schema(StiffnessDocument),
        "modes.schema.json": schema(ModesDocument),
        "section.schema.json": schema(SectionsDocument),
        "sensitivity.schema.json": schema(SensitivityDocument),
        "sweep.schema.json": schema(SweepDocument),
        "optimum.schema.json": schema(OptimumDocument),
        "front.schema.json": schema(FrontDocument),
        "identification.schema.json": schema(IdentificationDocument),
        "solid.schema.json": schema(SolidDocument),
        "calibration.schema.json": schema(Calibration),
        "diagnosis.schema.json": schema(Diagnosis),
        "pose-calibration.schema.json": schema(PoseCalibration),
        "pose-diagnosis.schema.json": schema(PoseDiagnosis),
        "map.schema.json": schema(MapDocument),
        "map-rows.schema.json": schema(MapRowsDocument),
        "maps.schema.json": schema(MapsDocument),
        "truth.schema.json": schema(Truth),
        "manipulator.schema.json": manipulator_schema(),
        "model.schema.json": model_schema(),
        "bodies.schema.json": BodyFile.model_json_schema(),
    }


def main(folder: Path) -> None:
    """Write every schema into a folder."""
    for name, content in schemas().items():
        write_whole(folder / name, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
