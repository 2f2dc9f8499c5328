"""Chains and manipulators where commands take a model: loading, engines, postures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from vjm.engine import Engine
from vjm.engines import for_model
from vjm.io.manipulator_file import load_model
from vjm.model.chain import Chain
from vjm.platform.manipulator import Manipulator


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
