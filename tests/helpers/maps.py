"""A map of a machine over a grid as an option writes it."""

from vjm_updating.maps.evaluate import MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map


def mapped(machine, engine, quantity, grid, posture, **asked):
    setting = MapSetting(machine, engine, quantity, **asked)
    return run_map(Map(setting, points_of(setting.model, parsed_grid(grid, setting.model), posture, setting.end)))
