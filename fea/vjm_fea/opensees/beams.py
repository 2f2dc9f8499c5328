"""OpenSees, whether it is installed, and its corotational beams.

The beams give forces and tangent of their nodes, at any positions and orientations.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.parts import Section
from vjm.rotations import Array

MISSING = "engine 'opensees' needs the optional extra: pip install 'vjm-stiffness[opensees]'"


@cache
def opensees() -> ModuleType:
    """The module `openseespy.opensees`.

    Raises:
        ImportError: it is not installed or does not load.
    """
    if importlib.util.find_spec("openseespy") is None:
        raise ImportError(MISSING)
    _load_blas()
    try:
        return importlib.import_module("openseespy.opensees")
    except (ImportError, RuntimeError) as failure:  # its own wrapper turns the one into the other
        raise ImportError(f"{MISSING}; it is there but does not load: {failure}") from failure


def available() -> bool:
    """Whether OpenSeesPy is installed and loads."""
    try:
        opensees()
    except ImportError:
        return False
    return True


def _load_blas() -> None:
    """Load the BLAS that the Linux wheel brings with it.

    Up to 3.7.1 the wheel's LAPACK does not find the BLAS beside it, and loading ends at "libblas.so.3: cannot open
    shared object file" where the system has none. A library that is loaded already is found by its name.
    """
    wheel = importlib.util.find_spec("openseespylinux")
    if wheel is None or wheel.origin is None:
        return
    blas = Path(wheel.origin).parent / "lib" / "libblas.so.3"
    if blas.is_file():
        ctypes.CDLL(str(blas))


POINTS = 2
"""Gauss points of an element with distributed sections: exact for bending, and reduced for the axial strain, which
is constant along the element but for the bow's quartic. With three and more it resists a bow of its own: 16
elements are then 2e-4 off behind buckling instead of 1e-5."""


class ElementKind(StrEnum):
    """Shear-rigid beam elements of OpenSees, each within the corotational frame of its two nodes."""

    LINEAR = "elasticBeamColumn"
    """Linear beam theory: the axial force acts on the element's chord only, which costs two orders."""
    BOWED = "dispBeamColumnNL"
    """With the axial strain of the bow, ``u' + (v'² + w'²)/2``: the axial force acts on the curved line."""


@dataclass(frozen=True)
class ElementLine:
    """A straight row of equal elements.

    Attributes:
        positions: reference positions ``(k, 3)`` of its nodes in mm, world, from root to tip.
        z_axis: the section's z axis ``(3,)``, world.
        section: stiffness of all members together.
    """

    positions: Array
    z_axis: Array
    section: Section


class Beams:
    """All lines of a chain in OpenSees' one domain.

    There is one domain in a process: whoever uses it builds it anew where another stood there before. Nodes are
    numbered line by line. Forces and moments are in world axes, N and N mm, and the tangent is their derivative by
    shifts (mm) and small turns in world axes (rad). That derivative lacks terms of second order in the turn of a
    node against its element: 1e-4 of the moment where it is 0.05 rad.

    Attributes:
        count: number of nodes.
    """

    _tenant: ClassVar[Beams | None] = None

    def __init__(self, lines: list[ElementLine], element: ElementKind) -> None:
        self._ops = opensees()
        self._lines = lines
        self._element = element
        self._at: Array | None = None
        self.count = sum(len(line.positions) for line in lines)

    def forces(self, displacement: Array, rotation: Array) -> Array:
        """Forces and moments ``(n, 6)`` that the elements put up against their nodes' motion.

        Args:
            displacement: ``(n, 3)`` from the reference configuration, mm.
            rotation: rotation vectors ``(n, 3)`` from the reference configuration, rad.

        Raises:
            NoConvergenceError: an element cannot be evaluated there.
        """
        self._put(displacement, rotation)
        self._ops.reactions()
        return np.array([self._ops.nodeReaction(tag) for tag in range(1, self.count + 1)])

    def tangent(self, displacement: Array, rotation: Array) -> Array:
        """Derivative ``(6 n, 6 n)`` of `forces`, not symmetric under moments.

        Raises:
            NoConvergenceError: an element cannot be evaluated there.
        """
        self._put(displacement, rotation)
        ops = self._ops
        # penalties of zero: no node is held and the whole tangent is assembled, which is never solved with
        self._prepare("Penalty", 0.0, 0.0)
        ops.initialize()
        n = ops.systemSize()
        # stored by columns
        K = np.array(ops.printA("-ret")).reshape(n, n).T
        self._prepare("Plain")
        return np.ascontiguousarray(K[: 6 * self.count, : 6 * self.count])

    def _put(self, displacement: Array, rotation: Array) -> None:
        ops = self._ops
        motion = np.hstack([displacement, rotation])
        if Beams._tenant is not self:
            self._build()
        elif self._at is not None and np.array_equal(motion, self._at):
            return
        self._at = None
        # the elements turn their axes by what a node's rotation grows: from the reference there is one growth only,
        # and the state does not depend on what was solved before
        ops.reset()
        for tag, components in enumerate(motion.tolist(), start=1):
            for dof, value in enumerate(components, start=1):
                ops.setNodeDisp(tag, dof, value, "-commit")
        # a step of the spare truss, at which every element takes up its nodes' motion
        if ops.analyze(1) != 0:
            raise NoConvergenceError("OpenSees cannot evaluate an element")
        self._at = motion

    def _build(self) -> None:
        ops = self._ops
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        tag = 0
        for number, line in enumerate(self._lines, start=1):
            ops.geomTransf("Corotational", number, *line.z_axis.tolist())
            s = line.section
            # area, E and G as one product each
            ops.section("Elastic", number, 1.0, s.EA, s.EIz, s.EIy, 1.0, s.GJ)
            ops.beamIntegration("Legendre", number, number, POINTS)
            for i, position in enumerate(line.positions.tolist()):
                tag += 1
                ops.node(tag, *position)
                ops.fix(tag, *[1] * 6)
                if i == 0:
                    continue
                if self._element is ElementKind.LINEAR:
                    ops.element(self._element.value, tag, tag - 1, tag, s.EA, 1.0, 1.0, s.GJ, s.EIy, s.EIz, number)
                else:
                    ops.element(self._element.value, tag, tag - 1, tag, number, number)
        self._build_spare()
        self._prepare("Plain")
        Beams._tenant = self

    def _build_spare(self) -> None:
        """A truss of its own with the one free coordinate that a step of OpenSees needs."""
        ops = self._ops
        first, second = self.count + 1, self.count + 2
        ops.node(first, 0.0, 0.0, 0.0)
        ops.node(second, 1.0, 0.0, 0.0)
        ops.fix(first, *[1] * 6)
        ops.fix(second, 0, *[1] * 5)
        ops.uniaxialMaterial("Elastic", 1, 1.0)
        ops.element("Truss", second, first, second, 1.0, 1)

    def _prepare(self, *constraints: str | float) -> None:
        ops = self._ops
        ops.wipeAnalysis()
        ops.constraints(*constraints)
        ops.numberer("Plain")
        ops.system("FullGeneral")
        ops.algorithm("Linear")
        ops.integrator("LoadControl", 0.0)
        ops.analysis("Static")
