"""How fast platforms and maps are; the two cores of the requirements are two processes."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm_updating.maps.evaluate import OK, MapQuantity, MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map

ROBOT, POSES = "orthoglide", 5_000
A_MINUTE, EACH_US = 1e6, 120.0
MAP_S, SPEEDUP = 120.0, 1.7
SIDES = (5, 9)
"""Of the grids from whose difference the time of 21 a side follows."""


def team(work, processes):
    """What `team.py` beside this file measured."""
    script = Path(__file__).with_name("team.py")
    done = subprocess.run(
        [sys.executable, str(script), work, str(processes)], capture_output=True, text=True, timeout=900, check=True
    )
    return json.loads(done.stdout)


def test_platforms_a_minute_on_two_cores(record):
    found = team("equilibria", 2)
    # all are solved but those that lie beyond a critical force, and every run says the same
    (good,) = found["good"]
    assert good > 0.98 * POSES
    rate = 60.0 * 2 * POSES / found["wall_s"]
    record("platform_equilibria_a_minute", rate, "", f">= {A_MINUTE:g}", rate >= A_MINUTE)
    each = 1e6 * found["processor_s"] / POSES
    record("platform_equilibrium_us", each, "us", f"<= {EACH_US:g}", each <= EACH_US)


@pytest.mark.parametrize("work", ["equilibria", "weakest"])
def test_two_workers_do_twice_the_work(work, record):
    alone, both = team(work, 1), team(work, 2)
    assert alone["good"] == both["good"]
    assert len(both["good"]) == 1
    value = 2.0 * alone["wall_s"] / both["wall_s"]
    record(f"{work}_speedup_2_workers", value, "", f">= {SPEEDUP:g}", value >= SPEEDUP)
    # what the wall time would say of two cores that have nothing else to do
    record(f"{work}_speedup_of_processor_time", 2.0 * alone["processor_s"] / both["processor_s"], "", "", True)


def timed_map(quantity, side, folder):
    """Seconds of a whole map with two processes, their start and the files included."""
    machine = load_model(ROBOT)
    setting = MapSetting(machine, VjmEngine(), quantity)
    started = time.perf_counter()
    wanted = Map(setting, points_of(setting.model, parsed_grid(str(side), setting.model), "isotropic"))
    result = run_map(wanted, folder, jobs=2)
    took = time.perf_counter() - started
    assert set(result.why) == {OK}
    return took


def test_time_of_a_map_of_the_stiffness(tmp_path, record):
    value = timed_map(MapQuantity.STIFFNESS, 21, tmp_path)
    record("map_21_stiffness_s", value, "s", f"<= {MAP_S:g}", value <= MAP_S)


def test_time_of_a_map_of_critical_forces(tmp_path, record):
    few, many = SIDES
    # what it takes to start the processes is the same in both
    short, long = (timed_map(MapQuantity.CRITICAL, side, tmp_path / str(side)) for side in SIDES)
    value = short + (long - short) * (21**3 - few**3) / (many**3 - few**3)
    record("map_21_critical_s", value, "s", f"<= {MAP_S:g}", value <= MAP_S)
