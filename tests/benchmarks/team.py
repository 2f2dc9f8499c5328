"""Work for some processes that begin at once, as a script: prints the fastest run as JSON.

``python team.py WORK PROCESSES``, with one of `WORKS`. A script of its own, so that its processes can import it
wherever tests are started from.
"""

import json
import multiprocessing
import sys
import time

import numpy as np

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.machine.equilibria import equilibria
from vjm.machine.rigid_mechanism import LoopClosure, home_label
from vjm_updating.maps.evaluate import OK, MapQuantity, MapSetting, MapTask, evaluate
from vjm_updating.maps.grid import parsed_grid, points_of

ROBOT = "orthoglide"
POSES = 5_000
RUNS = 8
"""Of which the fastest counts: what other programs take is not the code's."""


def platforms():
    """Equilibria of the paper's chains along a scan of the workspace, inverse kinematics included.

    Each platform is under a force of its own, 240 N on average.
    """
    robot = load_model(ROBOT)
    model, closing = VjmEngine().model(robot), LoopClosure(robot, home_label(robot))
    axes = [np.linspace(a, b, 28) for a, b in zip(*robot.workspace, strict=True)]
    scan = np.array(np.meshgrid(*axes, indexing="ij")).reshape(3, -1).T[:POSES]
    wrenches = np.zeros((len(scan), 1, 6))
    wrenches[:, 0, :3] = 150.0 * np.random.default_rng(0).standard_normal((len(scan), 3))
    poses = np.hstack([scan, np.zeros_like(scan)])

    def solved(rows):
        return int(equilibria(model, closing.all_displaced(poses[:rows])[0], wrench=wrenches[:rows]).stable.sum())

    solved(2)
    return lambda: solved(POSES)


def weakest():
    """The weakest directions of some poses of the workspace."""
    machine = load_model(ROBOT)
    setting = MapSetting(machine, VjmEngine(), MapQuantity.CRITICAL)
    grid = parsed_grid("x=-70:120:2,y=-70:120:3,z=-70:120:4", setting.model)
    q = points_of(setting.model, grid, "isotropic").q
    task = MapTask(0, setting, q)
    evaluate(MapTask(0, setting, q[:1]))
    return lambda: evaluate(task).why.count(OK)


WORKS = {"equilibria": platforms, "weakest": weakest}


def member(name, together, answers):
    """Prepare, wait for the others, and work: when each run began and ended, processor time, and what came out."""
    work = WORKS[name]()
    for run in range(RUNS):
        together.wait()
        started, spent = time.perf_counter(), time.process_time()
        good = work()
        answers.put((run, started, time.perf_counter(), time.process_time() - spent, good))


def fastest(name, processes):
    """Wall time of the fastest run, the least processor time of one process, and what came out."""
    context = multiprocessing.get_context("spawn")
    together, answers = context.Barrier(processes), context.Queue()
    team = [context.Process(target=member, args=(name, together, answers)) for _ in range(processes)]
    for one in team:
        one.start()
    found = [answers.get(timeout=600) for _ in range(RUNS * processes)]
    for one in team:
        one.join()
    runs = [[row for row in found if row[0] == run] for run in range(RUNS)]
    return {
        "wall_s": min(max(row[2] for row in run) - min(row[1] for row in run) for run in runs),
        "processor_s": min(row[3] for row in found),
        "good": sorted({row[4] for row in found}),
    }


if __name__ == "__main__":
    print(json.dumps(fastest(sys.argv[1], int(sys.argv[2]))))
