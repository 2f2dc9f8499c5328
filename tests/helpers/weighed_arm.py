"""A UR10-like arm that is measured under its weight, by the energy minimiser, and the files of such a test."""

import numpy as np
from hidden_effects.poses.injector import Hidden, measure
from hidden_effects.poses.plan import NOISE, save
from hidden_effects.poses.robots import UR10, document, sheet_text

from vjm.io.files import toml_text

GRAVITY = (0.0, 0.0, -9.81)
OWN = np.array([1.0, 1.2, 1.5, 3.0, 3.0, 3.0]) * 1e-8


def files(folder, q, y, *, content=None, order="as taken", gravity=None):
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "model.toml").write_text(toml_text(document(UR10) if content is None else content))
    sheet = sheet_text(UR10, NOISE, order)
    (folder / "sheet.toml").write_text(sheet if gravity is None else sheet.replace("-9.81", gravity))
    save(folder / "readings.csv", q, y)
    return folder / "readings.csv", folder / "sheet.toml"


def drawn(seed, count=100, reach=2.0):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 6))


def measured(hidden, q, seed=9):
    return measure(UR10, hidden, q, NOISE, np.random.default_rng(seed))


def compliant(own=OWN):
    hidden = Hidden.nothing(6)
    hidden.own = np.array(own)
    return hidden
