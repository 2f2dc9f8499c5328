"""Chains and manipulators where commands take a model: loading, postures."""

from __future__ import annotations

from collections.abc import Sequence

from vjm.io.manipulator_file import load_model
from vjm.platform.manipulator import Machine, Manipulator


def loaded(name_or_path: str, *, shear: bool = True) -> Machine:
    """A model, chain or manipulator.

    Args:
        name_or_path: of the model.
        shear: whether the shear stiffness that it states counts.

    Raises:
        ModelFileError: see `vjm.io.manipulator_file.load_model`.
    """
    model = load_model(name_or_path)
    return model if shear else model.rigid_in_shear()


def postures(model: Machine, wanted: Sequence[str]) -> list[str]:
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
