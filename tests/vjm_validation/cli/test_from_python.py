"""Nothing that a command does is out of reach from Python: for every command the functions that do the same."""

import importlib

import pytest

from vjm_validation.cli.main import COMMANDS

BY_COMMAND = {
    "all": ("vjm_validation.runs.paper:run_all", "vjm_validation.runs.own_machine:run_own"),
    "buckling": ("vjm.buckling",),
    "calibrate": ("vjm_updating.load_data", "vjm_updating.calibrate"),
    "check": ("vjm.check",),
    "compare": ("vjm_validation.cli.compare:compared",),
    "compensate": ("vjm.compensate",),
    "curve": ("vjm.trace", "vjm.write_curve"),
    "diagnose": ("vjm_updating.load_data", "vjm_updating.diagnose"),
    "example": ("vjm_validation.cli.example:names",),
    "explore": ("vjm_validation.explore.page:serve",),
    "export": ("vjm.robot_text",),
    "identify": ("vjm_updating.identified", "vjm_updating.identify.solid_part:solid_document"),
    "import": ("vjm.read_robot",),
    "list": (
        *(
            "vjm.library",
            "vjm.catalogues",
            "vjm.io.manipulator_file:manipulators",
            "vjm.io.manipulator_file:machines",
        ),
    ),
    "map": ("vjm_updating.workspace_map",),
    "modes": ("vjm.modes",),
    "new": ("vjm.build", "vjm_validation.cli.new:sheet_for"),
    "optimise": ("vjm.optimise", "vjm.pareto_front", "vjm.catalogue"),
    "postures": ("vjm.tool_postures",),
    "section": ("vjm.shape",),
    "sensitivity": ("vjm.sensitivities",),
    "show": ("vjm_validation.report.machine_view:page",),
    "simulate": ("vjm_updating.simulated",),
    "stiffness": ("vjm.stiffness", "vjm.shares"),
    "sweep": ("vjm.sweep",),
}
"""Public names of `vjm` and `vjm_updating`; a module and a name for what only writes files and pages."""


def there(place: str) -> object:
    module, _, name = place.rpartition(":" if ":" in place else ".")
    owner = importlib.import_module(module)
    if ":" not in place:
        assert name in owner.__all__
    return getattr(owner, name)


def test_every_command_has_its_function_and_none_is_left_over():
    assert BY_COMMAND.keys() == COMMANDS.keys()


@pytest.mark.parametrize("place", sorted({each for places in BY_COMMAND.values() for each in places}))
def test_the_function_is_there_and_says_what_it_does(place):
    found = there(place)
    assert callable(found)
    assert len(found.__doc__ or "") > 20
