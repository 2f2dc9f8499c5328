"""Chains and manipulators where commands take a model: loading, engines, postures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from vjm.engine import Engine
from vjm.engines import for_model
from vjm.io.manipulator_file import load_model
from vjm.model.chain import Chain
from vjm.postures import in_posture


def loaded(name_or_path: str, *, shear: bool = True) -> tuple[Chain, Callable[[Engine], Engine]]:
    """A model, and what makes of an engine one that traces it.

    A manipulator goes under the name of a chain here: commands ask for its name, postures and size only, and hand
    it to the engine.

    Args:
        name_or_path: of the model.
        shear: whether the shear stiffness that it states counts.

    Raises:
        ModelFileError: see `vjm.io.manipulator_file.load_model`.
    """
    model = load_model(name_or_path)
    if not shear:
        model = model.rigid_in_shear()
    if isinstance(model, Chain):
        return model, lambda engine: engine
    return cast(Chain, model), lambda engine: for_model(engine, model)


def in_postures(model: Chain, wanted: Sequence[str]) -> tuple[Chain, list[str]]:
    """A model that has the postures asked for, and their labels; all of its own where none is asked for.

    Args:
        model: a chain, or a manipulator under its protocol.
        wanted: labels, or coordinates, see `vjm.postures.in_posture`.

    Raises:
        ValueError: there is no such posture, or a coordinate is beyond its joint's limits.
    """
    labels = []
    for text in wanted:
        try:
            model, label = in_posture(model, text)
        except ValueError as error:
            raise ValueError(f"--posture: {error}") from None
        labels.append(label)
    return model, labels or list(model.postures)
