"""What contributes to the deflection of a user's own machine, how it vibrates, what to stiffen, and a map."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vjm import __version__
from vjm.design.modes import modes
from vjm.design.sensitivity import DesignQuantity, sensitivity
from vjm.design.shares import shares
from vjm.errors import NoConvergenceError
from vjm.io.file_parameters import MachineFiles
from vjm.machine.closing import Closing
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.tree.inverse_kinematics import ranges_of
from vjm.vjm_engine import VjmEngine
from vjm_updating.maps.evaluate import MapSetting
from vjm_updating.maps.grid import grid_origin, parsed_grid, points_of
from vjm_updating.maps.quantity import COLUMNS, MapQuantity
from vjm_updating.maps.run import Map, run_map
from vjm_validation.design_documents import SOUGHT, sensitivity_document, shares_row
from vjm_validation.documents import MapRowsDocument
from vjm_validation.studies.force_directions import unit_of
from vjm_validation.studies.own_machine_request import OwnMachine, Progress, Request, end_name, extent
from vjm_validation.studies.own_machine_rows import FrequencyRow, LoadRow

SPRINGS, FEW_SPRINGS = VjmEngine(4), VjmEngine(2)
"""Of frequencies, good to 1e-4 with four springs a beam; and of shares, sensitivities and the map, which at small
loads do not depend on the number."""
SMALL = 0.01
"""Of the largest force: what shares are asked under. So little is linear and far from any loss of
stability, behind which there are other equilibria."""
MODES = 6
"""Natural frequencies of a posture."""
TRIED = 2 * SOUGHT
"""Numbers of the file that matter most, of which it is looked for what doubles the stiffness: some do not."""
ASIDE = 0.1
"""Of the machine's size, or rad: how far a map goes to each side of its posture where there is no workspace."""
POINTS = {1: (21,), 2: (11, 11), 3: (7, 7, 3)}
"""Of a map, by the number of its axes."""
REACHED = 1e-6
"""Of a unit motion along an axis: what the drives leave of it where they can make it."""
SINGULAR = 1e-3
"""Singular value over the largest below which the end does not move by the drives."""
MECHANISM = (
    "no compliance shares, natural frequencies, sensitivities and map: passive joints let the end move without "
    "straining a spring"
)


def design(request: Request, found: OwnMachine, labels: Sequence[str], progress: Progress) -> None:
    """Shares, natural frequencies, sensitivities and a map of a machine that its drives hold."""
    if found.held:
        found.note(MECHANISM)
        return
    steps: list[Callable[[], None]] = [
        lambda: _shares(found, labels),
        lambda: _modes(request, found, labels),
        lambda: _sensitivity(request, found),
        lambda: _map(request, found, labels),
    ]
    for done, step in enumerate(steps):
        progress("design", done, len(steps))
        step()
    progress("design", len(steps), len(steps))


def least_stiff(found: OwnMachine, labels: Sequence[str]) -> list[LoadRow]:
    """The load path of each posture along which the stiffness is least, by virtual springs."""
    rows = []
    for label in labels:
        known = [row for row in found.loads if row.posture == label and row.K0 and row.engine.startswith("vjm")]
        rows += [min(known, key=lambda row: row.K0 or np.inf)] if known else []
    return rows


def _shares(found: OwnMachine, labels: Sequence[str]) -> None:
    for row in least_stiff(found, labels):
        wrench = SMALL * found.size * unit_of(row.direction)
        try:
            result = shares(found.machine, row.posture, wrench=wrench.tolist(), engine=FEW_SPRINGS)
        except (ValueError, NoConvergenceError) as error:
            found.note(f"no compliance shares in posture {row.posture}: {error}")
            continue
        found.shares.append(shares_row(result))
        found.shares_along[row.posture] = row.direction


def _modes(request: Request, found: OwnMachine, labels: Sequence[str]) -> None:
    for label in labels:
        try:
            result = modes(found.machine, label, number=MODES, gravity=request.gravity, engine=SPRINGS)
        except ValueError as error:
            found.note(f"no natural frequencies: {error}")
            continue
        except NoConvergenceError as error:
            found.note(f"no natural frequencies in posture {label}: {error}")
            continue
        found.shapes[label] = result
        found.modes += [
            FrequencyRow(posture=label, mode=k + 1, frequency_Hz=f, growth_per_s=g, largest_at=result.largest(k))
            for k, (f, g) in enumerate(zip(result.frequencies.tolist(), result.growth.tolist(), strict=True))
        ]
        if result.massless:
            found.note(f"for natural frequencies these beams have no mass: {', '.join(result.massless)}")


# --- what to stiffen ----------------------------------------------------------------------------------


def _sensitivity(request: Request, found: OwnMachine) -> None:
    ways = least_stiff(found, list(dict.fromkeys(row.posture for row in found.loads)))
    if not ways:
        found.note("nothing to stiffen: nothing deflects along the directions asked for")
        return
    row = min(ways, key=lambda each: each.K0 or np.inf)
    files = MachineFiles.read(request.model)
    parameters = [files.parameter(key, row.posture) for key in files.keys()]  # noqa: SIM118
    along = COMPONENTS[int(np.argmax(np.abs(unit_of(row.direction))))]
    try:
        result = sensitivity(
            found.machine, parameters, DesignQuantity.STIFFNESS, row.posture, along=along, engine=FEW_SPRINGS,
            factors=TRIED, leave_out=True,
        )  # fmt: skip
    except (ValueError, NoConvergenceError) as error:
        found.note(f"no sensitivities: {error}")
        return
    if not any(each.relative for each in result.rows):
        found.note("nothing to stiffen: no number of a part in the model file changes the stiffness")
        return
    found.sensitivity = sensitivity_document(result)
    found.stiffened = row
    if result.left_out:
        name, why = result.left_out[0]
        found.note(f"what to stiffen leaves out {len(result.left_out)} numbers of the file, such as {name}: {why}")


# --- map ----------------------------------------------------------------------------------------------


def _map(request: Request, found: OwnMachine, labels: Sequence[str]) -> None:
    """A map of the stiffness about the posture that is farthest from a singular one."""
    try:
        grid, posture = _grid(found, labels)
        setting = MapSetting(
            found.machine, SPRINGS, MapQuantity.STIFFNESS, gravity=request.gravity, end=end_name(found.machine)
        )
        points = points_of(setting.model, parsed_grid(grid, setting.model), posture, setting.end)
        result = run_map(Map(setting, points))
    except ValueError as error:
        found.note(f"no map of the stiffness: {error}")
        return

    def numbers(values: Array) -> list[float | None]:
        return [float(v) if np.isfinite(v) else None for v in values]

    found.map_axes, found.map_posture = {n: list(v) for n, v in points.grid.ordered.items()}, posture
    found.map = MapRowsDocument(
        model=found.machine.name, model_sha256=found.machine.sha256, version=__version__,
        engine=setting.engine.label, quantity=str(setting.quantity), columns=list(COLUMNS[setting.quantity]),
        places_mm=[numbers(row) for row in points.places],
        joints={name: numbers(values) for name, values in result.joints.items()},
        values=[numbers(row) for row in result.values], status=list(result.why), wrench=[0.0] * 6, against="",
        difference_percent=[], files=[],
    )  # fmt: skip


def _grid(found: OwnMachine, labels: Sequence[str]) -> tuple[str, str]:
    """The grid as ``validate map`` has it, and its posture.

    It is over the axes along which the drives can move the end, or over the first two drives where these are fewer
    than two.

    Raises:
        ValueError: nothing is driven.
    """
    machine = found.machine
    model = FEW_SPRINGS.model(machine)
    ranges = ranges_of(model)
    driven = [name for name, is_driven in zip(model.joints, ranges.driven, strict=True) if is_driven]
    if not driven:
        raise ValueError("no joint is driven")
    best = max(labels, key=lambda label: _dexterity(machine, label, driven))
    axes = _reached(machine, best, driven)
    if len(axes) < 2:
        return ",".join(_joint_axis(found, model, name, best, min(2, len(driven))) for name in driven[:2]), best
    place = _end(machine, best)[:3, 3] - grid_origin(model)
    words = []
    for k, count in zip(axes, POINTS[len(axes)], strict=True):
        low, high = place[k] + extent(machine) * ASIDE * np.array([-1.0, 1.0])
        if machine.workspace is not None:
            low, high = machine.workspace[:, k]
        words.append(f"{'xyz'[k]}={low:.9g}:{high:.9g}:{count}" if high > low else f"{'xyz'[k]}={low:.9g}")
    return ",".join(words), best


def _joint_axis(found: OwnMachine, model: Mechanism, name: str, posture: str, count: int) -> str:
    k = model.joints.index(name)
    ranges, at = ranges_of(model), float(model.posture(posture)[k])
    aside = ASIDE * (1.0 if ranges.turns[k] else extent(found.machine))
    low, high = max(at - aside, float(ranges.low[k])), min(at + aside, float(ranges.high[k]))
    return f"{name}={low:.9g}:{high:.9g}:{POINTS[count][0]}"


def _motions(machine: Machine, label: str, driven: Sequence[str]) -> Array:
    """Shifts ``(3, k)`` of the end by independent motions of the drives, lengths over the machine's."""
    closing = Closing(machine, label)
    _, J, _, J_end = closing.tree.linearised(closing.home[None])
    moving = np.array([name in driven for name in closing.tree.names]) | closing.tree.passive * machine.closes
    gaps, shifts = J[0][:, moving], J_end[0][:3, moving]
    if not len(gaps):
        return shifts
    _, s, Vt = np.linalg.svd(gaps)
    result: Array = shifts @ Vt[int(np.count_nonzero(s > SINGULAR * s[0])) :].T
    return result


def _dexterity(machine: Machine, label: str, driven: Sequence[str]) -> tuple[int, float]:
    """In how many directions the end moves, and its smallest motion over its largest."""
    s = np.linalg.svd(_motions(machine, label, driven), compute_uv=False)
    kept = s[s > SINGULAR * s[0]] if s[0] > 0.0 else s[:0]
    return len(kept), float(kept[-1] / kept[0]) if len(kept) else 0.0


def _reached(machine: Machine, label: str, driven: Sequence[str]) -> list[int]:
    """Axes 0 to 2 along which the drives can move the end."""
    U, s, _ = np.linalg.svd(_motions(machine, label, driven))
    kept = U[:, : int(np.count_nonzero(s > SINGULAR * s[0]))] if s[0] > 0.0 else U[:, :0]
    left = np.eye(3) - kept @ kept.T
    return [k for k in range(3) if np.linalg.norm(left[:, k]) < REACHED]


def _end(machine: Machine, label: str) -> Array:
    result: Array = Closing(machine, label).end
    return result
