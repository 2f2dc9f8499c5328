"""The smallest critical force over all directions: closed forms, and searches over all directions."""

import numpy as np
import pytest
from helpers.first_losses import first_losses

import vjm
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.critical_force import CriticalForce, Weakest
from vjm.machine.critical_search import TOLERANCE
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm.model.load_case import COMPONENTS, TO_LIMIT, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES, translation

C, L = 1e-8, 400.0
SLACK = 2.0 * TOLERANCE
"""The tolerance is of the stiffness that is left, which falls about in a line with the force."""


def links(n: int) -> Machine:
    """Rigid links of 400 mm on gears about z."""
    parts = [
        part
        for i in range(n)
        for part in (Joint(f"j{i}", AXES["z"], compliance=C), RigidOffset(f"l{i}", translation([L, 0.0, 0.0])))
    ]
    held = {f"j{i}": 0.0 for i in range(n)}
    return Machine("links", tuple(parts), postures={"p": np.zeros(0)}, held={"p": held})


def weakest(chain: Machine, q) -> tuple[float, np.ndarray]:
    found = CriticalForce(Mechanism(chain.split()), 0, 1e9).weakest(np.array(q))
    assert not found.why
    return found.force, found.direction


def test_a_link_on_a_gear_falls_over_under_a_push_towards_the_gear():
    """``F = 1/(c L)``: a rigid strut on a torsion spring."""
    force, direction = weakest(links(1), [0.7])
    assert force == pytest.approx(1.0 / (C * L), rel=SLACK)
    assert -direction @ [np.cos(0.7), np.sin(0.7), 0.0] > np.cos(0.05)


@pytest.mark.parametrize("n", [2, 3])
def test_links_in_a_row_buckle_as_a_chain_of_struts(n: int):
    """The smallest eigenvalue of the gears' stiffness over that of the push along the row."""
    K = (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) / C
    K[-1, -1] = 1.0 / C
    force, direction = weakest(links(n), np.zeros(n))
    assert force == pytest.approx(np.linalg.eigvalsh(K)[0] / L, rel=SLACK)
    assert -direction[0] > np.cos(0.05)


class TwoLinks:
    """The same arm of two links by two equations, for a search of its own over all angles of a force."""

    def __init__(self, elbow: float) -> None:
        self.elbow = elbow

    def least_stiff(self, force: float, angles: np.ndarray) -> np.ndarray:
        """Smallest eigenvalue over ``1/c`` ``(k,)`` where the force along each angle has grown from zero."""
        d = np.column_stack([np.cos(angles), np.sin(angles)])
        x = np.zeros((len(angles), 2))
        lowest = np.full(len(angles), np.inf)
        for share in np.linspace(0.0, 1.0, 301)[1:]:
            for _ in range(12):
                a = x[:, 0]
                b = a + self.elbow + x[:, 1]
                p1, p2 = (L * np.column_stack([np.cos(angle), np.sin(angle)]) for angle in (a, b))
                along = [np.einsum("ki,ki->k", p, d) for p in (p1 + p2, p2)]
                across = [d[:, 1] * p[:, 0] - d[:, 0] * p[:, 1] for p in (p1 + p2, p2)]
                r = x / C - share * force * np.column_stack(across)
                H = np.empty((len(angles), 2, 2))
                H[:, 0, 0], H[:, 0, 1] = along[0], along[1]
                H[:, 1, 0], H[:, 1, 1] = along[1], along[1]
                H = np.eye(2) / C + share * force * H
                x = x - np.linalg.solve(H, r[:, :, None])[:, :, 0]
            lowest = np.minimum(lowest, np.linalg.eigvalsh(H)[:, 0] * C)
        return lowest

    def critical(self, low: float, high: float) -> float:
        """The force at which the least of them over all angles is zero: by a straight line from below."""
        values = []
        for force in (low, 0.5 * (low + high)):
            around, width = np.linspace(0.0, 2.0 * np.pi, 721), np.pi / 360.0
            for _ in range(4):
                least_stiff = self.least_stiff(force, around)
                best = around[int(np.argmin(least_stiff))]
                around, width = np.linspace(best - 2.0 * width, best + 2.0 * width, 41), 0.1 * width
            values.append(float(least_stiff.min()))
        slope = (values[1] - values[0]) / (0.5 * (high - low))
        return low - values[0] / slope


@pytest.mark.slow
@pytest.mark.parametrize("elbow", [0.5, 1.0, 2.0])
def test_a_bent_arm_loses_its_stability_under_the_force_that_a_search_over_all_angles_finds(elbow: float):
    force, direction = weakest(links(2), [0.0, elbow])
    # the straight line is drawn over a tenth before the end, along which it bends by a thousandth of that
    assert force == pytest.approx(TwoLinks(elbow).critical(0.9 * force, 0.99 * force), rel=1e-4)
    assert abs(direction[2]) < 1e-6


@pytest.mark.parametrize("machine", ["palletiser", "ur10"])
def test_no_direction_of_many_is_weaker_for_arms_and_closed_loops(machine: str):
    """Along the direction that is found a force that goes up finds the same; no other is weaker."""
    chain = vjm.load(machine)
    model = VjmEngine(2).model(chain)
    q = model.posture(next(iter(chain.postures)))
    held_to_directions(CriticalForce(model, 0, 1e6).weakest(q), model, q)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("machine", ["delta", "par2", "orthoglide"])
def test_no_direction_of_many_is_weaker_for_platforms(machine: str):
    """Two poses, 60 directions each by a force that goes up; and those beside the one that is found."""
    robot = load_model(machine)
    model = VjmEngine().model(robot)
    low, high = robot.workspace
    rng = np.random.default_rng(2)
    poses = np.zeros((2, 6))
    poses[1, :3] = rng.uniform(low, high)
    q, why = LoopClosure(robot, home_label(robot)).all_displaced(poses)
    assert not any(why)
    for row, found in zip(q, CriticalForce(model, 0, 20_000.0).each(q), strict=True):
        held_to_directions(found, model, row)


def held_to_directions(found: Weakest, model: Mechanism, q: np.ndarray) -> None:
    """Forces that go up along it, along those beside it and along 60 anywhere."""
    assert not found.why
    assert found.negative[0] == 0
    assert found.negative[1] >= 1
    assert found.error < 1e-4 * found.force
    rng = np.random.default_rng(3)
    beside, anywhere = found.direction + 0.05 * rng.standard_normal((12, 3)), rng.standard_normal((60, 3))
    directions = np.vstack([found.direction, beside, anywhere])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    forces = first_losses(model, q, directions, 1.5 * found.force)
    # of the last interval, and of a step beside a bifurcation
    assert forces[0] == pytest.approx(found.force, rel=1e-4)
    assert forces.min() > found.force * (1.0 - 1e-4)


def test_along_the_direction_found_a_path_loses_its_stability_there():
    """The palletiser: a closed loop, an elastic forearm and a spring between points."""
    chain, engine = vjm.load("palletiser"), VjmEngine(2)
    model = engine.model(chain)
    found = CriticalForce(model, 0, 1e6).weakest(model.posture("home"))
    load = Load((*found.direction, 0.0, 0.0, 0.0))
    case = LoadCase("home", 1.3 * found.force, "load", loads=(load,), free=COMPONENTS, control=TO_LIMIT)
    path = vjm.trace(chain, case, engine)
    least_stiff = [point.eigenvalue for point in path.points]
    # beside a bifurcation the path keeps a little of its stiffness, by what the direction is off
    near = [e for p, e in zip(path.points, least_stiff, strict=True) if abs(p.ramp / found.force - 1.0) < 0.15]
    assert path.events or min(near) < 0.1 * least_stiff[0]


def test_a_force_that_is_not_tried_is_no_answer():
    found = CriticalForce(Mechanism(links(1).split()), 0, 1e4).weakest(np.array([0.0]))
    assert np.isnan(found.force)
    assert found.why == "no critical force up to 10000 N"
