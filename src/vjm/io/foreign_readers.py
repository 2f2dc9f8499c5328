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
Quaternion = Any
"""``(4,)`` of numpy, which a child imports where it needs it."""
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
        repaired: moments of inertia that no body has and those that took their place, ``(3, 3)`` in kg m² and in
            the body's axes, by the number of the body.
        exchanged: numbers of joints whose limits were reversed.
        bare: files of meshes or pictures are not there, and shapes that no mass follows from were taken out.
        warnings: its own.
    """

    model: Any
    balanced: bool
    repaired: dict[int, tuple[Any, Any]]
    exchanged: list[int]
    bare: bool
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
    spec = mujoco.MjSpec.from_file(path)
    exchanged = _with_limits_in_order(spec)
    bare = False
    if not spec.compiler.balanceinertia:
        try:
            model = spec.compile()
            return CompiledMjcf(model, False, {}, [joint.id for joint in exchanged], False, warnings)
        except ValueError as error:
            # perhaps files of meshes that are not there, perhaps moments of inertia that no body has
            bare = "opening file" in str(error)
    for balanced in (False, True):
        spec = mujoco.MjSpec.from_file(path)
        spec.compiler.balanceinertia = balanced
        exchanged = _with_limits_in_order(spec)
        if bare:
            _without_pictures(spec)
        repaired = _with_possible_moments(spec)
        try:
            model = spec.compile()
        except ValueError:
            if balanced:
                raise
            continue
        pairs = {
            body.id: pair if full else _in_axes(model.body_iquat[body.id], pair) for body, full, pair in repaired
        }
        return CompiledMjcf(model, balanced, pairs, [joint.id for joint in exchanged], bare, warnings)
    raise AssertionError


def _in_axes(quaternion: Quaternion, moments: tuple[Any, Any]) -> tuple[Any, Any]:
    """Moments of inertia in axes of their own, turned into those of their body."""
    import numpy as np

    mujoco: Any = importlib.import_module("mujoco")
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, quaternion)
    R = turned.reshape(3, 3)
    return R @ moments[0] @ R.T, R @ moments[1] @ R.T


def _without_pictures(spec: Specification) -> None:
    """Take meshes, height fields and textures out of a specification that say nothing of masses."""
    inertia: Any = importlib.import_module("mujoco").mjtInertiaFromGeom
    compiler, kept = spec.compiler, set()
    for geom in list(spec.geoms):
        explicit = geom.parent.explicitinertial and compiler.inertiafromgeom != inertia.mjINERTIAFROMGEOM_TRUE
        low, high = compiler.inertiagrouprange
        weightless = geom.mass == 0.0 or (geom.mass != geom.mass and geom.density == 0.0)
        if explicit or weightless or not low <= geom.group <= high or geom.hfieldname:
            if geom.meshname or geom.hfieldname:
                spec.delete(geom)
        elif geom.meshname:
            kept.add(geom.meshname)
    for one in (*spec.geoms, *spec.sites, *spec.tendons):
        one.material = ""
    unused = [mesh for mesh in spec.meshes if mesh.name not in kept]
    for one in (*unused, *spec.hfields, *spec.skins, *spec.materials, *spec.textures):
        spec.delete(one)


def _with_limits_in_order(spec: Specification) -> list[Any]:
    """Exchange limits in a specification of which the lower one is above the upper one; the joints that have them.

    MuJoCo refuses them, or takes them as none and does not say so.
    """
    none = importlib.import_module("mujoco").mjtLimited.mjLIMITED_FALSE
    joints = [joint for joint in spec.joints if joint.range[0] > joint.range[1] and joint.limited != none]
    for joint in joints:
        joint.range = joint.range[::-1].copy()
    return joints


def _with_possible_moments(spec: Specification) -> list[tuple[Any, bool, tuple[Any, Any]]]:
    """Replace the moments of inertia in a specification that no body has."""
    # only here, for most files need none of it
    import numpy as np

    from vjm.io import inertia

    repaired = []
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
        repaired.append((body, full, (given, nearest)))
    return repaired


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
