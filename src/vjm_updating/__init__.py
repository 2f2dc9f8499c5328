"""What measured data say of a model: calibration, diagnosis, identification of parts, maps.

The names in ``__all__`` are public and stay. Each is imported when it is first used.

Example:
    >>> from importlib.resources import files
    >>> import vjm_updating
    >>> folder = files("vjm_validation") / "examples/soft-springs"
    >>> vjm_updating.load_data(folder / "readings.csv", folder / "sheet.toml")
    <DataSet ramps of orthoglide-chain: 120 readings of time_s, posture, run, ux_mm, fx_N, fy_N, fz_N>
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vjm_updating.analysis import calibrate, diagnose
    from vjm_updating.data_set import DataSet, load_data
    from vjm_updating.identify.command import Identification, identified
    from vjm_updating.maps.run import MapResult, workspace_map
    from vjm_updating.result import CalibrationResult, DiagnosisResult
    from vjm_updating.simulate import Simulation, simulated

_HOME = {
    "CalibrationResult": "result",
    "DataSet": "data_set",
    "DiagnosisResult": "result",
    "Identification": "identify.command",
    "MapResult": "maps.run",
    "Simulation": "simulate",
    "calibrate": "analysis",
    "diagnose": "analysis",
    "identified": "identify.command",
    "load_data": "data_set",
    "simulated": "simulate",
    "workspace_map": "maps.run",
}
"""Module of every public name."""

__all__ = [
    "CalibrationResult",
    "DataSet",
    "DiagnosisResult",
    "Identification",
    "MapResult",
    "Simulation",
    "calibrate",
    "diagnose",
    "identified",
    "load_data",
    "simulated",
    "workspace_map",
]


def __getattr__(name: str) -> object:
    """Import a public name at its first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'vjm_updating' has no attribute '{name}'; it offers {', '.join(_HOME)}")
    value: object = getattr(importlib.import_module(f"vjm_updating.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
