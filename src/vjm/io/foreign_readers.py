"""What MuJoCo and xacro do with a robot's file, each in a child process with limits.

This module imports next to nothing, for a child imports it at its start.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from vjm.child_process import GIB, ChildLimits, installed, run_in_child

Specification = Any
"""MuJoCo's ``MjSpec``, which has no type where it is not installed."""
LIMITS = ChildLimits(
    60.0, 4.0 * GIB, "take out of the file what no machine needs: what is repeated, shapes, meshes"
)
"""A robot with a million triangles in its meshes, more than files of robots have, takes MuJoCo 9 s and 1.4 GB, by
measurement: there is room for three times that on a machine that is half as fast."""


class CompiledMjcf(NamedTuple):
    """What MuJoCo made of a file.

    Attributes:
        model: MuJoCo's ``MjModel``, which is arrays.
        balanced: moments of inertia that no body has were changed by MuJoCo, which does not tell where.
        repaired: moments of inertia that no body has and those that took their place, ``(3, 3)`` in kg m² by the
            number of the body.
        warnings: its own.
    """

    model: Any
    balanced: bool
    repaired: dict[int, tuple[Any, Any]]
    warnings: list[str]


def compiled_mjcf(path: Path) -> CompiledMjcf:
    """A file as MuJoCo compiles it.

    Raises:
        ValueError: MuJoCo does not read it, or met a limit; one line.
        ImportError: MuJoCo, an optional extra, is not installed.
    """
    installed("mujoco")
    return run_in_child(_compile_mjcf, str(path), what=f"{path.name}: MuJoCo", limits=LIMITS)


def _compile_mjcf(path: str) -> CompiledMjcf:
    mujoco: Any = importlib.import_module("mujoco")
    warnings: list[str] = []
    # else it writes them into a file where the user stands
    mujoco.set_mju_user_warning(warnings.append)
    try:
        return CompiledMjcf(mujoco.MjSpec.from_file(path).compile(), False, {}, warnings)
    except ValueError:
        # perhaps moments of inertia that no body has
        pass
    for balanced in (False, True):
        spec = mujoco.MjSpec.from_file(path)
        spec.compiler.balanceinertia = balanced
        repaired = _with_possible_moments(spec)
        try:
            model = spec.compile()
        except ValueError:
            if balanced:
                raise
            continue
        return CompiledMjcf(model, balanced, {body.id: pair for body, pair in repaired}, warnings)
    raise AssertionError


def _with_possible_moments(spec: Specification) -> list[tuple[Any, tuple[Any, Any]]]:
    """Replace the moments of inertia in a specification that no body has; bodies, with what they had and have."""
    # only here, for most files need none of it
    import numpy as np

    from vjm.io import inertia

    found = []
    for body in spec.bodies:
        full = not np.isnan(body.fullinertia[0])
        given = inertia.inertia_matrix(body.fullinertia if full else [*body.inertia, 0.0, 0.0, 0.0])
        if not body.explicitinertial or inertia.is_of_a_body(inertia.inertia_values(given), rounded=0.0):
            continue
        nearest = inertia.nearest_of_a_body(given)
        # MuJoCo takes no zero, and bears no rounding where one moment is the sum of the others
        nearest = nearest + inertia.PLATE * np.linalg.norm(nearest) * np.eye(3)
        if full:
            body.fullinertia = inertia.inertia_values(nearest)
        else:
            body.inertia = np.diag(nearest)
        found.append((body, (given, nearest)))
    return found


def expanded_xacro(path: Path, arguments: Mapping[str, str]) -> str:
    """The text of a file behind its xacro macros, whose expressions are Python.

    Raises:
        ValueError: they cannot be expanded, or met a limit; one line.
        ImportError: xacro, an optional extra, is not installed.
    """
    installed("xacro")
    return run_in_child(_expand_xacro, str(path), dict(arguments), what=f"{path.name}: xacro", limits=LIMITS)


def _expand_xacro(path: str, arguments: dict[str, str]) -> str:
    xacro: Any = importlib.import_module("xacro")
    try:
        return str(xacro.process_file(path, mappings=arguments).toxml())
    except Exception as error:  # its macros are expressions, and raise whatever those do
        if isinstance(error, MemoryError) or isinstance(error.__context__, MemoryError):
            raise MemoryError from error
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from error
