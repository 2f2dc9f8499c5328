"""What the installation compiles is what commands call."""

import importlib
import pkgutil
from importlib import resources
from types import ModuleType

import pytest
from helpers.from_files import calibrate, calibrate_poses, diagnose, diagnose_poses
from numba.core.dispatcher import Dispatcher

import vjm
import vjm_updating
from vjm import warm_up as machines
from vjm_updating import warm_up

EXAMPLES = resources.files("vjm_validation") / "examples"


def modules(package: ModuleType) -> list[ModuleType]:
    # a package's __main__ runs when it is imported
    return [
        importlib.import_module(each.name)
        for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not each.name.endswith("__main__")
    ]


@pytest.fixture(scope="module")
def kernels() -> dict[str, Dispatcher]:
    """What Python calls of the compiled functions, by its name, after what the installation computes."""
    for work in (machines.paths, machines.platforms, machines.postures, warm_up.histories):
        work()
    return {
        f"{module.__name__}.{name}": each
        for package in (vjm, vjm_updating)
        for module in modules(package)
        for name, each in vars(module).items()
        if isinstance(each, Dispatcher)
        and each.py_func.__module__ == module.__name__
        # what only kernels call is in their code
        and not each.targetoptions.get("no_cpython_wrapper")
    }


def test_every_kernel_is_compiled(kernels):
    assert len(kernels) > 30
    assert [name for name, each in kernels.items() if not each.signatures] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "data", "sheet"),
    [
        (diagnose, "hidden-bow/readings.csv", "hidden-bow/sheet.toml"),
        (diagnose, "unknown-cause/readings.csv", "unknown-cause/sheet.toml"),
        (diagnose, "joint-test/readings.csv", "joint-test/sheet.toml"),
        (calibrate, "tap-test/readings.csv", "tap-test/sheet.toml"),
        (diagnose_poses, "ur10-poses/readings.csv", "ur10-poses/sheet.toml"),
        (calibrate_poses, "fanuc-deflections/readings.csv", "fanuc-deflections/sheet.toml"),
    ],
)
def test_measured_data_leave_nothing_to_compile(command, data, sheet, kernels, tmp_path):
    before = {name: list(each.signatures) for name, each in kernels.items()}
    command(EXAMPLES / data, EXAMPLES / sheet, tmp_path)
    assert {name: list(each.signatures) for name, each in kernels.items()} == before
