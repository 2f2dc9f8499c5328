"""The effects that there are, and those that a user adds: a module with a function ``effects(scene)``."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from vjm_updating.mechanisms import (
    actuator_compliance,
    actuator_hardening,
    base_compliance,
    contact_compliance,
    creep,
    foot_lumping,
    gravity,
    joint_friction,
    link_bow,
    link_length,
    link_lumping,
    load_misalignment,
    part_compliance,
    plasticity,
    play,
    tension_compression_asymmetry,
)
from vjm_updating.mechanisms.effect import Effect, Scene

MODULES = (
    link_lumping, foot_lumping, actuator_compliance, actuator_hardening, play, joint_friction, contact_compliance,
    base_compliance, part_compliance, link_bow, link_length, load_misalignment, tension_compression_asymmetry,
    gravity, creep, plasticity,
)  # fmt: skip
Maker = Callable[[Scene], list[Effect]]


def catalogue(scene: Scene, more: Sequence[Maker] = ()) -> list[Effect]:
    """Every effect that makes sense in a scene, each variant on its own."""
    return [effect for make in (*(module.effects for module in MODULES), *more) for effect in make(scene)]


def plug_in(path: Path) -> Maker:
    """The effects of a user's file.

    Raises:
        ValueError: the file cannot be run, or has no function ``effects``.
    """
    spec = importlib.util.spec_from_file_location(f"effect_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f"{path}: no Python file with a function effects(scene)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their own module up
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f"{path}: {type(error).__name__}: {error}") from error
    make = getattr(module, "effects", None)
    if not callable(make):
        raise ValueError(f"{path}: has no function effects(scene) that returns a list of effects")
    result: Maker = make
    return result
