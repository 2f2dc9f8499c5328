"""A machine as arrays, and what its kernels share: frames, small systems."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vjm.kernels.compilation import kernel
from vjm.kernels.packed_model import Floats, Ints, PackedModel, Workspace, model_of, work_of


class Machine(NamedTuple):
    """A machine with l legs, as arrays.

    Attributes:
        integers: the legs' buffers, see `vjm.kernels.packed_model.Buffers`, one behind the other, and
        integers_at: ``(l + 1,)`` where each begins; likewise the next three.
        coordinates_at: ``(l + 1,)`` where each leg's coordinates begin among all.
        units: ``(l, 2)`` length in mm and energy in N mm.
        seats: ``(l, 12)`` frames where the drives act: rotation row by row, position.
        axes: ``(l, 3)`` of the drives in their seats.
        slides: ``(l,)`` whether they slide; −1 where there is none.
        worlds: ``(l, 12)`` frames of the legs' worlds in the seats, drives at zero.
        attachments: ``(l, 12)`` in the platform.
        home: ``(12,)`` of the platform.
        x_home: coordinates ``(n,)`` at home.
        drives_home: ``(l,)``.
    """

    integers: Ints
    integers_at: Ints
    numbers: Floats
    numbers_at: Ints
    work_integers: Ints
    work_integers_at: Ints
    work_numbers: Floats
    work_numbers_at: Ints
    coordinates_at: Ints
    units: Floats
    seats: Floats
    axes: Floats
    slides: Ints
    worlds: Floats
    attachments: Floats
    home: Floats
    x_home: Floats
    drives_home: Floats


@kernel
def legs_of(machine: Machine) -> tuple[list[PackedModel], list[Workspace]]:
    """Every leg's model and workspace as views of the machine's buffers.

    They are some fifty arrays a leg: to make them anew in every iteration would take a quarter of all time.
    """
    models, works = [], []
    for leg in range(len(machine.slides)):
        integers = machine.integers[machine.integers_at[leg] : machine.integers_at[leg + 1]]
        models.append(model_of(integers, machine.numbers[machine.numbers_at[leg] : machine.numbers_at[leg + 1]]))
        works.append(
            work_of(
                integers[:6],
                machine.work_integers[machine.work_integers_at[leg] : machine.work_integers_at[leg + 1]],
                machine.work_numbers[machine.work_numbers_at[leg] : machine.work_numbers_at[leg + 1]],
            )
        )
    return models, works


@kernel
def times(A: Floats, B: Floats, out: Floats) -> None:
    """Product of two frames ``(12,)``."""
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j]
        out[9 + i] = A[9 + i] + A[3 * i] * B[9] + A[3 * i + 1] * B[10] + A[3 * i + 2] * B[11]


@kernel
def back(A: Floats, B: Floats, out: Floats) -> None:
    """``A⁻¹ B`` of two frames ``(12,)``."""
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j]
        out[9 + i] = A[i] * (B[9] - A[9]) + A[3 + i] * (B[10] - A[10]) + A[6 + i] * (B[11] - A[11])


@kernel
def turned_by(R: Floats, v: Floats) -> None:
    """Turn a frame ``(12,)`` by a rotation vector ``(3,)``, world axes; its position stays."""
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if angle == 0.0:
        return
    c, s = np.cos(angle), np.sin(angle)
    a0, a1, a2 = v[0] / angle, v[1] / angle, v[2] / angle
    for j in range(3):
        r0, r1, r2 = R[j], R[3 + j], R[6 + j]
        d = (1.0 - c) * (a0 * r0 + a1 * r1 + a2 * r2)
        R[j] = c * r0 + s * (a1 * r2 - a2 * r1) + d * a0
        R[3 + j] = c * r1 + s * (a2 * r0 - a0 * r2) + d * a1
        R[6 + j] = c * r2 + s * (a0 * r1 - a1 * r0) + d * a2


@kernel
def driven_world(machine: Machine, leg: int, drive: float, world: Floats) -> None:
    """Frame ``(12,)`` of a leg's world with its drive at a coordinate."""
    moved = machine.worlds[leg].copy()
    axis = machine.axes[leg]
    if machine.slides[leg] == 1:
        for a in range(3):
            moved[9 + a] += drive * axis[a]
    elif machine.slides[leg] == 0:
        turn = drive * axis
        p = np.eye(3).copy().ravel()
        frame = np.zeros(12)
        frame[:9] = p
        turned_by(frame, turn)
        times(frame, machine.worlds[leg], moved)
    times(machine.seats[leg], moved, world)


@kernel
def solve_small(A: Floats, b: Floats) -> bool:
    """Solve ``A x = b`` in place by Gauss's elimination with pivots; false where it is singular."""
    n = len(b)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if abs(A[best, k]) < 1e-300:
            return False
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= f * A[k, j]
            b[i] -= f * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return True


@kernel
def negatives(M: Floats) -> int:
    """Number of negative eigenvalues of the symmetric part of a matrix, by its pivots; −1 where one vanishes."""
    n = len(M)
    A = 0.5 * (M + M.T)
    count = 0
    for k in range(n):
        if abs(A[k, k]) < 1e-300:
            return -1
        if A[k, k] < 0.0:
            count += 1
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= f * A[k, j]
    return count


@kernel
def rotation_between(a: Floats, b: Floats, out: Floats) -> None:
    """Rotation vector ``(3,)`` from one frame ``(12,)`` to another."""
    R = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            R[i, j] = b[3 * i] * a[3 * j] + b[3 * i + 1] * a[3 * j + 1] + b[3 * i + 2] * a[3 * j + 2]
    x, y, z = 0.5 * (R[2, 1] - R[1, 2]), 0.5 * (R[0, 2] - R[2, 0]), 0.5 * (R[1, 0] - R[0, 1])
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    scale = np.arctan2(sine, cosine) / sine if sine > 1e-9 else 1.0
    out[0], out[1], out[2] = x * scale, y * scale, z * scale
