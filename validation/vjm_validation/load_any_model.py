"""Machines where commands take a model: loading, postures."""

from __future__ import annotations

from collections.abc import Sequence

from vjm.io.machine_file import load_model
from vjm.model.machine import Machine
from vjm.postures import in_posture


def loaded(name_or_path: str, *, shear: bool = True) -> Machine:
    """The machine of a model.

    Args:
        name_or_path: of the model.
        shear: whether the shear stiffness that it states counts.

    Raises:
        ModelFileError: see `vjm.io.machine_file.load_model`.
    """
    model = load_model(name_or_path)
    return model if shear else model.rigid_in_shear()


def in_postures(model: Machine, wanted: Sequence[str]) -> tuple[Machine, list[str]]:
    """A model that has the postures asked for, and their labels; all of its own where none is asked for.

    Args:
        model: any machine.
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
