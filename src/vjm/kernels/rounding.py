"""What rounding leaves of the residual of a loaded machine, from the sizes of its terms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vjm.kernels.arrays import BEAM_COLUMN, LINEAR, MachineArrays, Work
from vjm.rotations import Array


def rounding(arrays: MachineArrays, work: Work, x: Array, natural: Array) -> tuple[Array, Array]:
    """Bounds ``(n,)`` of the statics' rounding and ``(f,)`` of the closures', at the state where bodies are placed.

    Each row is a sum of spring forces, loads' moments or distances. The sum of their sizes, times the relative
    rounding of a number, times the number of joints that they pass, bounds what rounding leaves of it.

    Args:
        arrays: the machine.
        work: at the state.
        x: coordinates ``(n,)``.
        natural: ``(n,)`` those at which the springs are free of stress.
    """
    strain, unit = np.abs(x - natural), arrays.unit
    springs = np.zeros(len(unit))
    for block, (first, end) in enumerate(pairwise(arrays.first)):
        if arrays.kind[block] == LINEAR:
            springs[first:end] += np.abs(arrays.K[block, : end - first, : end - first]) @ strain[first:end]
        elif arrays.kind[block] == BEAM_COLUMN:
            EA, GJ, EIy, EIz, h = arrays.beam[block, :5]
            stiff = np.array([EA, 12.0 * EIz / h**2, 12.0 * EIy / h**2, GJ, EIy, EIz]) / h
            springs[first:end] += stiff * strain[first:end]
    springs[arrays.border] += np.abs(arrays.border_K) @ strain[arrays.border]
    of_law = arrays.border[arrays.border_law >= 0]
    springs[of_law] += arrays.law_most[arrays.border_law[arrays.border_law >= 0]] * strain[of_law]
    springs[arrays.border] += np.abs(arrays.coupling).T @ np.abs(work.wrench[int(arrays.size[1]) :])
    # moments are summed about the world's origin
    far = max(float(np.abs(places).max(initial=0.0)) for places in (work.p, work.point, work.place))
    force = moment = 0.0
    for wrench in (*work.acting, *np.split(work.wrench, arrays.closure_first[1:])):
        force, moment = force + float(np.abs(wrench[:3]).sum()), moment + float(np.abs(wrench[3:6]).sum())
    if len(arrays.spring):
        lengths = np.linalg.norm(work.spring_at[:, 1] - work.spring_at[:, 0], axis=1)
        force += float(arrays.spring[:, 0] @ (lengths + arrays.spring[:, 1]) + np.abs(arrays.spring[:, 2]).sum())
    loads = (force * np.maximum(far, unit) + moment) / unit
    gaps = np.full(len(work.gap), max(1.0, far))
    for first, rows in zip(arrays.closure_first, arrays.closure_rows, strict=False):
        gaps[first + 3 : first + rows] = 1.0
    count = len(arrays.parent) * np.finfo(float).eps
    return count * (springs + loads), count * gaps
