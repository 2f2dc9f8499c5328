"""Small tests of a small model, which is its own truth."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm_updating.calibration.fit import CalibrationSolution, problem_of, solve
from vjm_updating.experiment import Measurement, read_measurement

from . import synthetic

ENGINE = VjmEngine(4)
TRUTH = {"link.EA": 0.06, "link.EIz": -0.05, "foot.factor": 0.08}
"""Logarithms of the true values over nominal."""
RAMPS = {"A": (-4.0,), "B": (4.0,), "C": (1.0,)}

Make = Callable[..., Measurement]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A measurement of a machine with parameters moved by z."""

    def made(
        z: Mapping[str, float] = TRUTH,
        ramps: Mapping[str, Sequence[float]] = RAMPS,
        steps: int = 12,
        seed: int = 1,
        sheet: str = "",
        model: str = "",
        columns: Sequence[str] = synthetic.COLUMNS,
        spoil: Callable[[list[synthetic.Row]], None] = lambda rows: None,
        **options: float,
    ) -> Measurement:
        trace = synthetic.of_model(synthetic.changed(z, ENGINE), ENGINE)
        rows = synthetic.readings(trace, ramps, steps, np.random.default_rng(seed), columns=columns, **options)
        spoil(rows)
        page = sheet or synthetic.sheet_text(foot=1, link=4, model=model, columns=columns)
        files = synthetic.write(tmp_path, rows, page)
        return read_measurement(files.data, files.sheet)

    return made


def solved(measurement: Measurement, names: Sequence[str] = tuple(TRUTH)) -> CalibrationSolution:
    """The fit of some parameters."""
    return solve(problem_of(measurement, names))


def errors_in_sigma(found: CalibrationSolution, truth: Mapping[str, float]) -> dict[str, float]:
    """How far each parameter is from the truth, in its own standard deviation."""
    names = [unknown.name for unknown in found.problem.unknowns.all]
    std = np.sqrt(np.diag(found.covariance))
    return {name: float((found.z[names.index(name)] - z) / std[names.index(name)]) for name, z in truth.items()}
