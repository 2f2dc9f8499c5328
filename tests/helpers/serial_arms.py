"""Serial arms and tables, and where their ends go: as textbooks print the matrices, and joint by joint."""

import csv
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vjm.model.machine import Machine
from vjm.model.parts import Joint, RigidOffset

Real = np.longdouble
"""Of the tables' own products: offsets of hundreds of metres have 1e-17 m of rounding there."""


def dh_matrix(theta, d, a, alpha):
    """Distal, as in Siciliano et al., Robotics, (2.52)."""
    ct, st, ca, sa = (f(Real(x)) for x in (theta, alpha) for f in (np.cos, np.sin))
    return np.array(
        [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]], Real
    )


def mdh_matrix(theta, d, a, alpha):
    """Modified, as in Craig, Introduction to Robotics, (3.6)."""
    ct, st, ca, sa = (f(Real(x)) for x in (theta, alpha) for f in (np.cos, np.sin))
    return np.array(
        [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]], Real
    )


def about_y(beta):
    c, s = np.cos(Real(beta)), np.sin(Real(beta))
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]], Real)


def end_by_hand(convention: str, rows: Sequence[Mapping[str, float]], q: Sequence[float], slides: Sequence[bool]):
    """The end's frame ``(4, 4)`` of a table's rows; lengths in their unit, angles in rad."""
    T = np.eye(4, dtype=Real)
    for row, value, slide in zip(rows, q, slides, strict=True):
        theta, d = Real(row["theta"]) + (0.0 if slide else value), Real(row["d"]) + (value if slide else 0.0)
        a, alpha, beta = Real(row["a"]), row["alpha"], row.get("beta", 0.0)
        if convention == "dh":
            T = T @ dh_matrix(theta, d, a, alpha) @ about_y(beta)
        elif beta:
            # the turn about y stands before the joint
            T = T @ mdh_matrix(0.0, 0.0, a, alpha) @ about_y(beta) @ mdh_matrix(theta, d, 0.0, 0.0)
        else:
            T = T @ mdh_matrix(theta, d, a, alpha)
    return T


def rpy_frame(xyz, rpy):
    """A frame by roll, pitch and yaw about fixed axes, as URDF has it."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), xyz
    return T


def end_of_file(file: Path, q: Mapping[str, float]):
    """The end's frame of a written table's file, mm, by its own numbers."""
    text = file.read_text()
    if file.suffix == ".csv":
        head = "\n".join(line[2:] for line in text.splitlines() if line.startswith("#"))
        content = tomllib.loads(head)
        plain = [line for line in text.splitlines() if not line.startswith("#")]
        joints = [
            {key: value if key in ("name", "kind") else float(value) for key, value in row.items() if value}
            for row in csv.DictReader(plain)
        ]
    else:
        content = tomllib.loads(text)
        joints = content["joints"]
    assert content["units"] == {"length": "mm", "angle": "rad"}
    slides = [row["kind"] == "prismatic" for row in joints]
    T = end_by_hand(content["convention"], joints, [q[row["name"]] for row in joints], slides)
    before, behind = (
        rpy_frame(one["xyz"], one["rpy"]) if (one := content.get(key)) else np.eye(4) for key in ("base", "tool")
    )
    return before @ T @ behind


def end_of(machine: Machine, q: Mapping[str, float]):
    """The end's frame of a chain of rigid pieces and joints, one after another."""
    T = machine.base.copy()
    for part in machine.parts:
        if isinstance(part, Joint):
            step = np.eye(4)
            if part.slides:
                step[:3, 3] = part.axis * q[part.name]
            else:
                step[:3, :3] = Rotation.from_rotvec(part.axis * q[part.name]).as_matrix()
        else:
            assert isinstance(part, RigidOffset)
            step = part.transform
        T = T @ step
    return T


def random_arm(seed: int) -> Machine:
    """Two to seven joints of any axes, some of them parallel, nearly parallel, opposite, or through one point."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(int(rng.integers(2, 8))):
        shift = rng.uniform(-400.0, 400.0, 3)
        kind = rng.choice(["any", "nearly", "parallel", "opposite", "across", "meeting"])
        axis = np.array([0.0, 0.0, 1.0])
        R = Rotation.random(random_state=rng)
        if kind in ("nearly", "opposite"):
            tilt = rng.normal(size=2)
            tilt *= 10.0 ** rng.uniform(-9, -1) / np.linalg.norm(tilt)
            R = Rotation.from_rotvec([*tilt, 0.0]) * Rotation.from_rotvec([0.0, 0.0, rng.uniform(-3, 3)])
            R = Rotation.from_rotvec([np.pi if kind == "opposite" else 0.0, 0.0, 0.0]) * R
        elif kind == "parallel":
            R = Rotation.identity()
        elif kind == "across":
            R = Rotation.from_euler("x", 90.0 * float(rng.choice([-1, 1])), degrees=True)
        else:
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
        if kind == "meeting":
            shift *= 0.0
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R.as_matrix(), shift
        limits = (-1.0, 2.0) if rng.random() < 0.5 else None
        parts += [
            RigidOffset(f"l{k}", T),
            Joint(f"j{k}", axis, bool(rng.random() < 0.3), compliance=1e-8, limits=limits),
        ]
    tool = rpy_frame(rng.uniform(-200.0, 200.0, 3), rng.uniform(-3.0, 3.0, 3)) if rng.random() < 0.7 else np.eye(4)
    parts.append(RigidOffset("tool", tool))
    base = rpy_frame(rng.uniform(-200.0, 200.0, 3), rng.uniform(-3.0, 3.0, 3)) if rng.random() < 0.5 else np.eye(4)
    return Machine(f"arm-{seed}", tuple(parts), base)


def reach(machine: Machine) -> float:
    """Sum of all steps of a chain, mm."""
    return sum(float(np.linalg.norm(p.transform[:3, 3])) for p in machine.parts if isinstance(p, RigidOffset))


def postures(machine: Machine, rng: np.random.Generator, count: int) -> list[dict[str, float]]:
    """Random coordinates of all joints."""
    return [
        {one.name: float(rng.uniform(-300, 300) if one.slides else rng.uniform(-3, 3)) for one in machine.moving}
        for _ in range(count)
    ]
