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
    from vjm.errors import MechanismError, NoConvergenceError
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

__version__ = "0.4.0"

_MODULES = {
    "vjm.analysis": "Buckling buckling LoadedStiffness stiffness trace",
    "vjm.building": "axis build",
    "vjm.compensation": "compensate Compensation",
    "vjm.continuation.path": "Equilibrium Event EventKind Path",
    "vjm.design.best_machine": "optimise pareto_front ParetoFront",
    "vjm.design.modes": "Modes modes",
    "vjm.design.optimum": "Optimum",
    "vjm.design.sensitivity": "Sensitivities sensitivities",
    "vjm.design.shares": "Shares shares",
    "vjm.design.space": "LoadCases",
    "vjm.design.sweep": "Sweep sweep",
    "vjm.engines": "engine_by_name EngineOptions VjmEngine",
    "vjm.errors": "MechanismError NoConvergenceError",
    "vjm.io.catalogues": "catalogue catalogues",
    "vjm.io.errors": "ModelFileError",
    "vjm.io.machine_file": "load",
    "vjm.io.model_file": "library",
    "vjm.io.model_report": "check ModelCheck",
    "vjm.io.path_files": "read_curve write_curve",
    "vjm.io.shapes": "shape",
    "vjm.model.laws": "DeadZone Law OneSided Polynomial StrainWave Tabulated",
    "vjm.model.load_case": "Load LoadCase PointControl",
    "vjm.model.machine": "Machine",
    "vjm.model.parts": "Beam Closure Coupling Joint JointCoupling PointSpring RigidOffset Section",
    "vjm.outcome": "Outcome",
    "vjm.postures": "in_posture tool_postures",
    "vjm.robots": "read_robot robot_text",
    "vjm.rotations": "translation turn",
}
"""Public names by their modules."""
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

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
    "MechanismError",
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
    if name not in _HOME:
        raise AttributeError(f"module 'vjm' has no attribute '{name}'; it offers {', '.join(_HOME)}")
    # one name would hide what it loads
    attribute = "load_model" if name == "load" else name
    value: object = getattr(importlib.import_module(_HOME[name]), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
