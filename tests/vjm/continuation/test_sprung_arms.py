"""Arms of sprung joints under load: their buckling loads in closed form, and none where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import ARC, COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset
from vjm.rotations import AXES, translation

K, A = 2e5, 100.0
"""N mm/rad and mm: the springs of the joints and the lengths of the links."""


def column(count: int = 3, preload: float = 0.0) -> Machine:
    """Links in a row on springs that turn about z."""
    parts: list = []
    for i in range(count):
        joint = (
            Joint(f"q{i}", AXES["z"], passive=True, compliance=1.0 / K, preload=preload)
            if i
            else Joint("q0", AXES["z"], compliance=1.0 / K)
        )
        parts += [joint, RigidOffset(f"l{i}", translation([A, 0.0, 0.0]))]
    held = {"straight": {f"q{i}": 0.0 for i in range(count)}}
    return Machine("column", tuple(parts), postures={"straight": np.zeros(0)}, held=held)


def under(force: float, *, follower: bool) -> LoadCase:
    """A load along the column at its free end, from nothing."""
    load = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0), follower=follower)
    return LoadCase("straight", force, "load", free=COMPONENTS, loads=(load,))


def test_a_dead_load_buckles_it_at_the_closed_form():
    stiff = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]) * K
    # links turn by φ_i: ½ φᵀ stiff φ against the load's ½ P a Σ φ_i²
    critical = float(np.linalg.eigvalsh(stiff / A)[0])
    path = VjmEngine().trace(column(), under(1.2 * critical, follower=False))
    events = [event for event in path.events if event.kind is EventKind.BIFURCATION]
    assert len(events) == 1
    # critical loads are located to 1e-9 of the path
    assert events[0].s == pytest.approx(critical, rel=1e-8)


def test_a_follower_gives_no_static_event():
    # Ziegler's column flutters, which needs masses; it has no other equilibrium at any load
    path = VjmEngine().trace(column(), under(10.0 * K / A, follower=True))
    assert path.complete
    assert path.events == ()
    assert np.abs(path.points[-1].displacement).max() < 1e-9


def test_a_preload_is_in_balance_where_the_path_begins():
    torque = 0.02 * K
    path = VjmEngine().trace(column(2, torque), under(1.0, follower=False))
    # the second joint turns by torque/K; the first bears nothing
    start = path.points[0].displacement
    assert start[:2] == pytest.approx([A * (np.cos(0.02) - 1.0), A * np.sin(0.02)], abs=1e-9)


ARMS = np.array([400.0, 300.0, 200.0])
SPRINGS = np.array([2e6, 1.5e6, 1e6])


def arm_of_short_parts() -> Machine:
    """Long rigid links, each on a spring that is a part 0.1 mm long, which gives way at its tip."""
    parts: list = []
    for i, (arm, k) in enumerate(zip(ARMS, SPRINGS, strict=True)):
        compliance = np.diag([1e-9, 1e-9, 1e-9, 1e-12, 1e-12, 1.0 / k])
        parts += [
            Beam(f"s{i}", 0.1, compliance=compliance),
            RigidOffset(f"l{i}", translation([arm - 0.1 * (i < 2), 0.0, 0.0])),
        ]
    return Machine("short", tuple(parts), postures={"straight": np.zeros(0)})


def critical_of_arm() -> float:
    """½ φᵀ K φ of the springs against ½ P Σ a φ²."""
    K = np.diag(SPRINGS) + np.diag([*SPRINGS[1:], 0.0]) - np.diag(SPRINGS[1:], 1) - np.diag(SPRINGS[1:], -1)
    root = 1.0 / np.sqrt(ARMS)
    return float(np.linalg.eigvalsh(K * root[:, None] * root)[0])


@pytest.mark.parametrize("reach", [1.01, 1.02, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3, 1.4, 1.5, 1.6, 1.75, 2.0, 2.5])
def test_the_branch_is_taken_however_far_the_load_goes(reach):
    critical = critical_of_arm()
    path = VjmEngine().trace(arm_of_short_parts(), under(reach * critical, follower=False))
    assert path.complete, path.stopped
    (event,) = [event for event in path.events if event.kind is EventKind.BIFURCATION]
    assert event.switched
    # critical loads are located to 1e-9 of the path, and the links' compliance of 1e-9 mm/N shortens them
    assert event.s == pytest.approx(critical, rel=1e-7)


def test_an_arc_measures_the_arm_by_its_links():
    case = replace(under(1.5 * critical_of_arm(), follower=False), control=ARC)
    path = VjmEngine().trace(arm_of_short_parts(), case)
    assert path.complete, path.stopped
    assert len(path.points) < 200
