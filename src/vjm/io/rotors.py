"""Inertia of motors behind gears, as descriptions give it, reflected to their joints."""

from __future__ import annotations

from vjm.io.errors import printed
from vjm.io.robot import Kind, Notes
from vjm.io.urdf_values import FilePlace


def reflected(inertia: float, ratio: float, place: FilePlace, kind: Kind, joint: str, notes: Notes) -> float:
    """Inertia of a rotor that its joint feels: times the squared gear ratio.

    Args:
        inertia: of the rotor, kg m².
        ratio: turns of the motor per turn of the joint, or rad per metre where it slides.
        place: for messages.
        kind: how the joint moves.
        joint: its name.
        notes: what was read is added.

    Returns:
        kg mm², or kg where the joint slides.

    Raises:
        ModelFileError: one of them is negative, or the ratio is zero.
    """
    if inertia < 0.0:
        raise place.error(f"has a rotor of {printed(inertia)} kg m²: it must not be below zero")
    if not ratio:
        raise place.error("has a gear ratio of zero: give turns of the motor per turn of the joint")
    # kg m² are 1e6 kg mm²; rad per metre, squared, make kg of kg m²
    value = inertia * ratio**2 * (1.0 if kind == "slides" else 1e6)
    unit = "kg" if kind == "slides" else "kg m²"
    notes.changed.append(
        f"joint '{joint}' has the inertia of its rotor, {printed(inertia)} kg m² times the squared gear ratio "
        f"{printed(abs(ratio))}, {printed(inertia * ratio**2)} {unit}"
    )
    return value
