"""Compile every kernel, those of histories too: ``python -m vjm_updating.warm_up``, which the installation runs.

The first diagnosis would wait for those of histories else, ten seconds.
"""

from __future__ import annotations

import numpy as np

from vjm import warm_up
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.laws import StrainWave
from vjm_updating.inference.bounded_normal import bounded_step
from vjm_updating.inference.noise import uncorrelated_noise
from vjm_updating.mechanisms.column import column_force
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, Sheaf, tabulate
from vjm_updating.mechanisms.history_kernels import hardening_deflections
from vjm_updating.mechanisms.hysteresis import friction_torques
from vjm_updating.mechanisms.modified_chain import ModifiedMachine
from vjm_updating.mechanisms.relaxation import Relaxation, relaxing
from vjm_updating.mechanisms.series_elements import (
    AlongAxis,
    History,
    SeriesElement,
    balance,
    deflections,
    retarded,
    yielding,
)


def histories() -> None:
    """Go through two readings of every kind."""
    along = np.eye(6)[[0, 0]]
    machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(4))
    table = tabulate(machine, HalfRay.of("A", along[0], 0.1), ())
    both, own = np.zeros((2, 2), dtype=np.int64), 0.05 * along
    sheaf = Sheaf([table], both, along, along)
    sheaf.at(own)
    sheaf.yielding(own)
    table.at(own[:, 0])
    history = History(np.array([0.0, 1.0]), np.array([True, False]), along[:, :3], along[:, :3])
    relaxing([(np.arange(2), along, table, table)], history, Relaxation("link", (0.1,), (10.0,)))(own)
    force = np.array([0.0, 1.0])
    retarded(1e-6, 10.0)(force, history)
    balance(sheaf.at, own, [SeriesElement(AlongAxis((1.0, 0.0, 0.0)), yielding(0.5, 1e-6))], history)
    friction_torques(np.zeros((2, 1)), np.ones((2, 1, 1)), 1.0, history.begins, np.zeros((2, 1)))
    column_force(force, 100.0, 1e6)
    deflections(StrainWave(K1=1.0, K2=2.0, K3=4.0, T1=1.0, T2=3.0).curve, force)
    hardening_deflections(force, 2.0, 2.0)
    noise = uncorrelated_noise(np.zeros(2), np.ones((2, 1), dtype=bool))
    noise.back(noise.remove(np.ones((2, 1))))
    # a step that its bounds cut short: two coordinates that act together
    one, free = np.ones(2), np.zeros(2, dtype=bool)
    bounded_step(np.eye(2) + 0.5, one, 0.0, free, free, 0.0 * one, 0.0 * one, 0.1 * one)


if __name__ == "__main__":
    warm_up.main([histories])
