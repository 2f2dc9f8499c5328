"""Manipulators where commands take a model: their engines, and one loaded equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from vjm import __version__
from vjm.continuation.load_stepping import follow
from vjm.continuation.path import Equilibrium
from vjm.engine import Engine
from vjm.io.manipulator_file import load_model
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.platform.manipulator import Manipulator
from vjm.platform.problem import ManipulatorEngine, ManipulatorProblem
from vjm.statics.equilibrium import NoConvergenceError
from vjm.vjm_engine import VjmEngine
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.exudyn.manipulator_engine import ManipulatorExudynEngine
from vjm_validation.documents import StiffnessDocument


def loaded(name_or_path: str) -> tuple[Chain, Callable[[Engine], Engine]]:
    """A model, and what makes of an engine one that walks it.

    A manipulator goes under the name of a chain here: commands ask for its name, postures and size only, and hand
    it to the engine.

    Raises:
        ModelFileError: see `vjm.io.manipulator_file.load_model`.
    """
    model = load_model(name_or_path)
    if isinstance(model, Chain):
        return model, lambda engine: engine
    return cast(Chain, model), lambda engine: cast(Engine, solver(engine))


def postures(model: Chain, wanted: Sequence[str]) -> list[str]:
    """The labels that are asked for, or all; of a manipulator also coordinates, see `Manipulator.displacement`.

    Raises:
        ValueError: there is no such posture.
    """
    for label in wanted:
        if isinstance(model, Manipulator):
            try:
                model.displacement(label)
            except ValueError as error:
                raise ValueError(f"--posture: {error}") from None
        elif label not in model.postures:
            raise ValueError(
                f"--posture: {model.name} has no posture '{label}' (it has {', '.join(model.postures)})"
            )
    return list(wanted or model.postures)


def solver(engine: Engine) -> ManipulatorEngine | ManipulatorExudynEngine:
    """The engine of the same name for whole manipulators.

    Raises:
        ValueError: it knows single chains only.
    """
    if isinstance(engine, VjmEngine):
        return ManipulatorEngine(engine)
    if isinstance(engine, ExudynEngine) and not engine.foot_spring:
        return ManipulatorExudynEngine(engine.elements, engine.shear)
    raise ValueError(
        f"--engine {engine.label}: walks single chains only; manipulators take vjm, vjm-paper and exudyn"
    )


def stiffness_document(
    manipulator: Manipulator, engine: VjmEngine, pose: str, control: str, values: Sequence[float]
) -> StiffnessDocument:
    """A stable equilibrium of a platform under an imposed displacement or, free, under a dead wrench.

    Args:
        manipulator: the machine.
        engine: how beams become springs.
        pose: label of the unloaded pose.
        control: ``displacement`` or ``wrench``.
        values: ``(6,)`` mm, rad or N, N mm.

    Raises:
        NoConvergenceError: there is none; the message says how far the path goes.
    """
    at_rest = ManipulatorProblem(manipulator, LoadCase(pose, 1.0), engine)
    K0 = at_rest.unloaded().stiffness
    if not np.any(values):
        point, events = at_rest.unloaded(), []
    else:
        load_case = LoadCase(pose, 1.0, axis=tuple(values))
        if control == "wrench":
            load_case = LoadCase(pose, 1.0, "load", loads=(Load(tuple(values)),), free=COMPONENTS)
        path = follow(ManipulatorProblem(manipulator, load_case, engine, at_rest.model.pose), load_case)
        if not path.complete:
            raise NoConvergenceError(f"the {control} is reached only to {path.points[-1].s:.1%}: {path.stopped}")
        point = path.points[-1]
        events = [f"{e.kind} at {e.s:.4%} of the {control}" for e in path.events]
    return _document(manipulator, engine, pose, control, point, np.asarray(K0), events)


def _document(
    manipulator: Manipulator,
    engine: VjmEngine,
    pose: str,
    control: str,
    point: Equilibrium,
    K0: np.ndarray,
    events: list[str],
) -> StiffnessDocument:
    assert point.stiffness is not None
    return StiffnessDocument(
        model=manipulator.name,
        model_sha256=manipulator.sha256,
        version=__version__,
        engine=engine.label,
        posture=pose,
        control=control,
        displacement=point.displacement.tolist(),
        wrench=point.wrench.tolist(),
        stiffness_loaded=point.stiffness.tolist(),
        stiffness_unloaded=K0.tolist(),
        stable=point.unstable <= 0,
        eigenvalue=point.eigenvalue,
        iterations=point.iterations,
        residual=point.residual,
        events=events,
    )
