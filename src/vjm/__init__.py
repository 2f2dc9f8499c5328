"""The virtual joint method for manipulators under load.

Rigid links, perfect passive joints and lumped six-dimensional springs, after Pashkevich, Klimchik and
Chablat, *Nonlinear Effects in Stiffness Modeling of Robotic Manipulators*. Equation numbers in this package
are that paper's. Units inside are N, mm and rad.

The names in ``__all__`` are public and stay. Each is imported when it is first used: ``import vjm`` takes
milliseconds.

Example:
    >>> import vjm
    >>> chain = vjm.load("orthoglide-chain")
    >>> vjm.trace(chain, vjm.LoadCase("A", to=-4.0))
    <Path orthoglide-chain, posture A, vjm-16: x to -4 mm, 58 equilibria
     K0 = 3300.3 N/mm; 0 of 58 unstable
     bifurcation at s = 2.72324, force 8849.14>
"""

from __future__ import annotations

import importlib
import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vjm.analysis import Buckling, LoadedStiffness, buckling, stiffness, trace
    from vjm.building import axis, build
    from vjm.compensation import Compensation, compensate
    from vjm.continuation.path import Equilibrium, Event, EventKind, Path
    from vjm.design.best_machine import ParetoFront, optimise, pareto_front
    from vjm.design.modes import Modes, modes
    from vjm.design.optimum import Optimum
    from vjm.design.sensitivity import Sensitivities, sensitivities
    from vjm.design.shares import Shares, shares
    from vjm.design.space import LoadCases
    from vjm.design.sweep import Sweep, sweep
    from vjm.engines import EngineOptions, VjmEngine, engine_by_name
    from vjm.errors import NoConvergenceError
    from vjm.io.catalogues import catalogue, catalogues
    from vjm.io.errors import ModelFileError
    from vjm.io.machine_file import load_model as load
    from vjm.io.model_file import library
    from vjm.io.model_report import ModelCheck, check
    from vjm.io.path_files import read_curve, write_curve
    from vjm.io.shapes import shape
    from vjm.model.laws import DeadZone, Law, OneSided, Polynomial, StrainWave, Tabulated
    from vjm.model.load_case import Load, LoadCase, PointControl
    from vjm.model.machine import Machine
    from vjm.model.parts import Beam, Closure, Coupling, Joint, JointCoupling, PointSpring, RigidOffset, Section
    from vjm.outcome import Outcome
    from vjm.postures import in_posture, tool_postures
    from vjm.robots import read_robot, robot_text
    from vjm.rotations import translation, turn

__version__ = "0.3.0"

_HOME = {
    "Outcome": "vjm.outcome",
    "Beam": "vjm.model.parts",
    "Buckling": "vjm.analysis",
    "Closure": "vjm.model.parts",
    "Compensation": "vjm.compensation",
    "Coupling": "vjm.model.parts",
    "DeadZone": "vjm.model.laws",
    "EngineOptions": "vjm.engines",
    "Equilibrium": "vjm.continuation.path",
    "Event": "vjm.continuation.path",
    "EventKind": "vjm.continuation.path",
    "Joint": "vjm.model.parts",
    "JointCoupling": "vjm.model.parts",
    "Law": "vjm.model.laws",
    "Load": "vjm.model.load_case",
    "LoadCase": "vjm.model.load_case",
    "LoadCases": "vjm.design.space",
    "LoadedStiffness": "vjm.analysis",
    "Machine": "vjm.model.machine",
    "ModelCheck": "vjm.io.model_report",
    "ModelFileError": "vjm.io.errors",
    "Modes": "vjm.design.modes",
    "NoConvergenceError": "vjm.errors",
    "OneSided": "vjm.model.laws",
    "Optimum": "vjm.design.optimum",
    "ParetoFront": "vjm.design.best_machine",
    "Path": "vjm.continuation.path",
    "PointControl": "vjm.model.load_case",
    "PointSpring": "vjm.model.parts",
    "Polynomial": "vjm.model.laws",
    "RigidOffset": "vjm.model.parts",
    "Section": "vjm.model.parts",
    "Sensitivities": "vjm.design.sensitivity",
    "Shares": "vjm.design.shares",
    "StrainWave": "vjm.model.laws",
    "Sweep": "vjm.design.sweep",
    "Tabulated": "vjm.model.laws",
    "VjmEngine": "vjm.engines",
    "axis": "vjm.building",
    "buckling": "vjm.analysis",
    "build": "vjm.building",
    "catalogue": "vjm.io.catalogues",
    "catalogues": "vjm.io.catalogues",
    "check": "vjm.io.model_report",
    "compensate": "vjm.compensation",
    "engine_by_name": "vjm.engines",
    "in_posture": "vjm.postures",
    "library": "vjm.io.model_file",
    "load": "vjm.io.machine_file:load_model",
    "modes": "vjm.design.modes",
    "optimise": "vjm.design.best_machine",
    "pareto_front": "vjm.design.best_machine",
    "read_curve": "vjm.io.path_files",
    "sensitivities": "vjm.design.sensitivity",
    "read_robot": "vjm.robots",
    "robot_text": "vjm.robots",
    "shape": "vjm.io.shapes",
    "shares": "vjm.design.shares",
    "stiffness": "vjm.analysis",
    "sweep": "vjm.design.sweep",
    "tool_postures": "vjm.postures",
    "trace": "vjm.analysis",
    "translation": "vjm.rotations",
    "turn": "vjm.rotations",
    "write_curve": "vjm.io.path_files",
}
"""Module of every public name; behind a colon the name there, where it is another."""

__all__ = [
    "Beam",
    "Buckling",
    "Closure",
    "Compensation",
    "Coupling",
    "DeadZone",
    "EngineOptions",
    "Equilibrium",
    "Event",
    "EventKind",
    "Joint",
    "JointCoupling",
    "Law",
    "Load",
    "LoadCase",
    "LoadCases",
    "LoadedStiffness",
    "Machine",
    "ModelCheck",
    "ModelFileError",
    "Modes",
    "NoConvergenceError",
    "OneSided",
    "Optimum",
    "Outcome",
    "ParetoFront",
    "Path",
    "PointControl",
    "PointSpring",
    "Polynomial",
    "RigidOffset",
    "Section",
    "Sensitivities",
    "Shares",
    "StrainWave",
    "Sweep",
    "Tabulated",
    "VjmEngine",
    "__version__",
    "axis",
    "buckling",
    "build",
    "catalogue",
    "catalogues",
    "check",
    "compensate",
    "engine_by_name",
    "in_posture",
    "library",
    "load",
    "modes",
    "optimise",
    "pareto_front",
    "read_curve",
    "read_robot",
    "robot_text",
    "sensitivities",
    "shape",
    "shares",
    "stiffness",
    "sweep",
    "tool_postures",
    "trace",
    "translation",
    "turn",
    "write_curve",
]


def __getattr__(name: str) -> object:
    """Import a public name at its first use (PEP 562)."""
    if name == "Chain":
        warnings.warn(
            "vjm.Chain is now called vjm.Machine; the old name goes in 0.4.0", FutureWarning, stacklevel=2
        )
        name = "Machine"
    if name not in _HOME:
        raise AttributeError(f"module 'vjm' has no attribute '{name}'; it offers {', '.join(_HOME)}")
    module, _, attribute = _HOME[name].partition(":")
    value: object = getattr(importlib.import_module(module), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
