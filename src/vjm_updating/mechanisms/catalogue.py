"""The effects that there are, and those that a user adds: a module with a function ``effects(scene)``."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from vjm_updating.mechanisms.contacts import contact_compliance_effects, lost_motion_effects
from vjm_updating.mechanisms.drives import (
    actuator_compliance_effects,
    actuator_hardening_effects,
    asymmetry_effects,
)
from vjm_updating.mechanisms.effect import Effect, ExperimentContext
from vjm_updating.mechanisms.hysteresis import creep_effects, joint_friction_effects, plasticity_effects
from vjm_updating.mechanisms.loads import gravity_effects, load_misalignment_effects
from vjm_updating.mechanisms.structure import (
    base_compliance_effects,
    foot_lumping_effects,
    link_bow_effects,
    link_length_effects,
    link_lumping_effects,
    part_compliance_effects,
)

Maker = Callable[[ExperimentContext], list[Effect]]
MAKERS: tuple[Maker, ...] = (
    link_lumping_effects, foot_lumping_effects, actuator_compliance_effects, actuator_hardening_effects,
    lost_motion_effects, joint_friction_effects, contact_compliance_effects, base_compliance_effects,
    part_compliance_effects, link_bow_effects, link_length_effects, load_misalignment_effects, asymmetry_effects,
    gravity_effects, creep_effects, plasticity_effects,
)  # fmt: skip


def catalogue(scene: ExperimentContext, more: Sequence[Maker] = ()) -> list[Effect]:
    """Every effect that makes sense in a scene, each variant on its own."""
    return [effect for make in (*MAKERS, *more) for effect in make(scene)]


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
    return make


@contextmanager
def errors_within(paths: Sequence[Path]) -> Iterator[None]:
    """Say an error of a user's file in one line with the line that it comes from.

    Raises:
        ValueError: something in one of the files raised an error.
    """
    try:
        yield
    except Exception as error:
        files = {str(path) for path in paths}
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in files]
        if not own:
            raise
        raise ValueError(f"{own[-1].filename}:{own[-1].lineno}: {type(error).__name__}: {error}") from error
