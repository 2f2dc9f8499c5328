"""The residual of the nominal model taken apart into contrasts that a person can read, and how sure each is."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.diagnosis.document import ContrastRow
from vjm_updating.diagnosis.screening import projection
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.inference.residual_basis import driven_place, loading


def contrasts(fitter: Fitter, null: Fit) -> list[ContrastRow]:
    """Every contrast that the data allow, the most significant first."""
    observed = fitter.forward.observed
    space = projection(fitter, null)
    result = []
    for name, column in _columns(fitter, null):
        for c, channel in enumerate(observed.columns):
            if not observed.present[:, c].any():
                continue
            raw = np.zeros(observed.present.shape)
            raw[:, c] = column
            free = np.concatenate([fitter.whitening.flat(raw), np.zeros(len(space.residual) - space.rows)])
            rest = space.rest(free[:, None])[:, 0]
            square = float(rest @ rest)
            if square < 1e-4 * float(free @ free) or square == 0.0:
                continue
            along = float(rest @ space.residual)
            result.append(
                ContrastRow(name=name, channel=channel, size=along / square, significance=along / square**0.5)
            )
    return sorted(result, key=lambda contrast: -abs(contrast.significance))


def _columns(fitter: Fitter, null: Fit) -> list[tuple[str, Array]]:
    """What is compared with what, as a column ``(n,)`` that changes by one between them."""
    observed = fitter.forward.observed
    place, way = driven_place(observed), loading(observed)
    found: list[tuple[str, Array]] = []
    if (way > 0.0).any() and (way < 0.0).any():
        found.append(("way out against way back, along the ramp", 0.5 * way * np.sign(place)))
        found.append(("way out against way back", 0.5 * way))
    if (place > 0.2).any() and (place < -0.2).any():
        found.append(("pull against push", 0.5 * np.sign(place)))
        found.append(("largest displacement, alike in pull and push", np.abs(place)))
    found.append(("curvature along the ramp", np.sign(place) * place**2))
    labels = list(dict.fromkeys(observed.readings.posture.tolist()))
    if len(labels) > 1:
        for label in labels:
            on = observed.readings.posture == label
            found.append((f"posture {label}: offset against the others", on.astype(float)))
            found.append((f"posture {label}: slope against the others", np.where(on, place, 0.0)))
    runs = np.unique(observed.readings.run)
    if len(runs) > 1:
        found.append(("last cycle against the first", (observed.readings.run - runs[0]) / (runs[-1] - runs[0])))
    held = _since_held(way)
    if held.max(initial=0.0) > 1:
        found.append(("decay while held, along the ramp", np.sign(place) * np.log1p(held) / np.log1p(held.max())))
    if observed.clock is not None:
        found.append(("with the clock", observed.clock / np.ptp(observed.clock)))
    if observed.warmth is not None:
        found.append(("with the temperature", observed.warmth / np.ptp(observed.warmth)))
    behind = _behind(fitter, null)
    if behind.any() and not behind.all():
        found.append(("after against before the critical point", behind.astype(float)))
    return found


def _since_held(way: Array) -> Array:
    count = np.zeros(len(way))
    for k in range(1, len(way)):
        count[k] = count[k - 1] + 1.0 if way[k] == 0.0 else 0.0
    return count


def _behind(fitter: Fitter, null: Fit) -> np.ndarray:
    """Readings ``(n,)`` where the tangent along the ray has fallen below a third of the unloaded one."""
    observed = fitter.forward.observed
    result = np.zeros(len(observed.pose), dtype=bool)
    if observed.columns != WRENCH:
        # what was read is not the wrench of the displacement that was imposed: there is no tangent stiffness
        return result
    for ray in observed.rays:
        k = np.einsum("i,nij,j->n", ray.direction, null.at.stiffness[ray.index], ray.direction)
        s = np.abs(observed.pose[ray.index] @ ray.measure)
        result[ray.index] = k < k[np.argmin(s)] / 3.0
    return result
