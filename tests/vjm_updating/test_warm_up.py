"""What the installation compiles is what a diagnosis calls."""

from importlib import resources

import pytest
from helpers.from_files import diagnose

from vjm_updating import warm_up
from vjm_updating.mechanisms import column, history_kernels

ENTRIES = (
    column._forces,
    history_kernels.interpolated,
    history_kernels.looked_up,
    history_kernels.curve_deflections,
    history_kernels.hardening_deflections,
    history_kernels.friction_along,
    history_kernels.decaying,
    history_kernels.flowing,
    history_kernels.relaxed_wrenches,
)


def compiled() -> list[list[object]]:
    return [list(entry.signatures) for entry in ENTRIES]


def test_every_kernel_is_compiled():
    warm_up.histories()
    assert all(compiled())


@pytest.mark.slow
def test_a_diagnosis_has_nothing_left_to_compile(tmp_path):
    warm_up.histories()
    before = compiled()
    folder = resources.files("vjm_validation") / "examples/hidden-bow"
    only = ("joint_friction", "creep", "plasticity")
    diagnose(folder / "readings.csv", folder / "sheet.toml", tmp_path, only=only)
    assert compiled() == before
