"""The JSON documents that the single commands print; N, mm, rad."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from vjm_output.documents import DoubtRow, Matrix
from vjm_validation.metrics import PathMetrics
from vjm_validation.yielding import YieldRow


class BucklingDocument(BaseModel):
    """What ``validate buckling --json`` prints."""

    model_config = ConfigDict(frozen=True)

    model: str
    model_sha256: str
    version: str
    chain: dict[str, dict[str, dict[str, PathMetrics]]]
    """By posture, ``tension`` or ``compression``, and engine label, as in ``summary.json``."""
    yields: list[YieldRow] = []
    """Where the material yields first, path by path, where the model file says a yield stress; ``vjm`` only."""
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
    end: str = ""
    """Name of the end frame; empty where the machine names none."""
    gravity: list[float] | None = None
    """m/s², where the parts have their weight."""
    stiffness_loaded: Matrix | None
    """K^F of eq. (18); null where a wrench moves nothing, so that it is infinite: see ``compliance_loaded``."""
    stiffness_unloaded: Matrix | None
    """K of eq. (5); null likewise."""
    compliance_loaded: Matrix | None = None
    """The inverse of K^F, mm/N, 1/N, rad/(N mm), of an end-effector that nothing but the machine holds; null where
    passive joints let it move without a force, or where the pose is imposed."""
    compliance_unloaded: Matrix | None = None
    """The inverse of K; null likewise."""
    rigid: list[list[float]] = []
    """Unit wrenches under which the end-effector does not deflect: those that make K infinite."""
    torques: dict[str, float] | None = None
    """What holds each joint, N mm or N; null where it is not computed."""
    stable: bool
    """Under the control named above. An unstable equilibrium is never reported."""
    eigenvalue: float | None
    """Smallest eigenvalue of the second variation, in units of the model's energy scale; null where the engine
    computes none."""
    eigenvalue_relative: float | None = None
    """The same over that of the unloaded machine, as ``validate curve`` has it: 0 at a critical point."""
    iterations: int | None
    """Null where postures are solved as a batch, which does not count them."""
    residual: float
    """Largest scaled component of the equilibrium equations."""
    events: list[str]
    """Critical points that the chain passed on the way."""
    doubts: list[DoubtRow] = []
    """What is implausible about the model."""
