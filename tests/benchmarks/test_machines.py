"""How fast single machines are: postures under weight, poses of platforms, critical forces, large trees."""

import time

import numpy as np
import pytest

import vjm
from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.critical_force import CriticalForce
from vjm.machine.equilibria import equilibria
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, RigidOffset
from vjm.rotations import AXES, translation

RUNS = 5
"""Of which the fastest counts: what other programs take is not the code's."""
EQUILIBRIA, ARM_S = 100_000, 0.5
POSES, POSE_MS = 100, 1.0
CRITICAL_S, LARGEST_N = 0.2, 20_000.0
GRAVITY = (0.0, 0.0, -9.81)
SMALL, LARGE, RATIO = 32, 256, 10.0


def fastest(work):
    """Least processor time of some runs, s, after one that compiles."""
    work()
    times = []
    for _ in range(RUNS):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    return min(times)


def test_an_arm_in_many_postures_under_its_weight(record):
    model = VjmEngine().model(vjm.load("ur10"))
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (EQUILIBRIA, len(model.joints)))
    assert equilibria(model, q, gravity=GRAVITY).converged.all()
    value = fastest(lambda: equilibria(model, q, gravity=GRAVITY))
    record("ur10_100000_equilibria_s", value, "s", f"<= {ARM_S:g}", value <= ARM_S)


def searched(name):
    """A machine's model, and coordinates of a pose without a load."""
    chain = vjm.load(name)
    model = VjmEngine().model(chain)
    return model, model.posture(next(iter(chain.postures)))


@pytest.mark.parametrize("name", ["delta", "par2", "hexapod"])
def test_a_pose_of_a_platform(name, record):
    force = np.array([30.0, -20.0, 10.0, 0.0, 0.0, 0.0])
    model, q = searched(name)
    rows, closing = np.tile(q, (POSES, 1)), None
    if name != "hexapod":
        robot = load_model(name)
        closing = LoopClosure(robot, home_label(robot))
        low, high = robot.workspace
        poses = np.zeros((POSES, 6))
        # a scan: neighbours next to one another
        poses[:, :3] = low + np.linspace(0.1, 0.9, POSES)[:, None] * (high - low)

    def work():
        q = rows if closing is None else closing.all_displaced(poses)[0]
        return equilibria(model, q, wrench=force).stable

    assert work().all()
    value = 1e3 * fastest(work) / POSES
    record(f"{name}_pose_ms", value, "ms", f"<= {POSE_MS:g}", value <= POSE_MS)


@pytest.mark.parametrize("name", ["delta", "par2", "hexapod", "palletiser", "ur10"])
def test_the_smallest_critical_force_of_a_posture(name, record):
    model, q = searched(name)
    search = CriticalForce(model, 0, 1e6)
    assert not search.weakest(q).why
    value = fastest(lambda: search.weakest(q))
    record(f"{name}_critical_force_s", value, "s", f"<= {CRITICAL_S:g}", value <= CRITICAL_S)


def branched(n):
    """A tree of n links of 100 mm on gears: each second one begins at the one before the last."""
    parts, after = [], {}
    for i in range(n):
        if i > 1 and i % 2:
            after[f"j{i}"] = f"l{i - 2}"
        parts += [
            Joint(f"j{i}", AXES["xyz"[i % 3]], compliance=1e-8 / n**2),
            RigidOffset(f"l{i}", translation([100.0, 0.0, 0.0]), 0.1),
        ]
    return Mechanism(Machine("tree", tuple(parts), after=after, ends={"tip": f"l{n - 1}"}).split())


def test_what_a_large_tree_takes_over_a_small_one(record):
    took = []
    for n in (SMALL, LARGE):
        model = branched(n)
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (400, n))
        found = equilibria(model, q, gravity=GRAVITY)
        assert found.converged.all()
        took.append(fastest(lambda model=model, q=q: equilibria(model, q, gravity=GRAVITY)))
    value = took[1] / took[0]
    record("tree_n256_over_n32", value, "", f"<= {RATIO:g}", value <= RATIO)
