"""The JSON documents that the single commands print; N, mm, rad."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from vjm_output.documents import DoubtRow, Matrix
from vjm_validation.metrics import PathMetrics


class BucklingDocument(BaseModel):
    """What ``validate buckling --json`` prints."""

    model_config = ConfigDict(frozen=True)

    model: str
    model_sha256: str
    version: str
    chain: dict[str, dict[str, dict[str, PathMetrics]]]
    """By posture, ``tension`` or ``compression``, and engine label, as in ``summary.json``."""
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""


class StiffnessDocument(BaseModel):
    """What ``validate stiffness --json`` prints."""

    model_config = ConfigDict(frozen=True)

    model: str
    model_sha256: str
    version: str
    engine: str
    posture: str
    control: str
    """``displacement``: the pose is imposed; ``wrench``: the end-effector is free under a dead wrench."""
    displacement: list[float]
    """Of the end-effector: shift and rotation vector, world axes."""
    wrench: list[float]
    """On the end-effector, world axes."""
    stiffness_loaded: Matrix
    """K^F of eq. (18)."""
    stiffness_unloaded: Matrix
    """K of eq. (5)."""
    stable: bool
    """Under the control named above. An unstable equilibrium is never reported."""
    eigenvalue: float | None
    """Smallest eigenvalue of the second variation, in units of the model's energy scale; null where the engine
    computes none."""
    iterations: int
    residual: float
    """Largest scaled component of the equilibrium equations."""
    events: list[str]
    """Critical points that the chain passed on the way."""
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""
