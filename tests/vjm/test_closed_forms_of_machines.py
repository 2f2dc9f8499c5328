"""Machines with loops and springs between points: closed forms, and by hand from each leg's flexibility."""

import numpy as np
import pytest
from helpers.virtual_work import Solution, Statics
from scipy.linalg import null_space
from scipy.optimize import brentq

from vjm.model.machine import Machine
from vjm.model.parts import Beam, Closure, Joint, PointSpring, RigidOffset, Section
from vjm.rotations import AXES, displaced, frame, rotation_from_vector, skew, translation

EXACT = 1e-9
"""Both to rounding, times a condition of up to 1e6."""


def solution(chain: Machine, values, **loads) -> Solution:
    """The equilibrium of the independent solver."""
    return Statics(chain, values, **loads).solve()


# --- hexapod: universal joint, elastic cylinder and ball in each leg --------------------------------------------

STIFFNESS = np.array([900.0, 1100.0, 800.0, 1000.0, 1200.0, 950.0])
TOOL = translation([20.0, -10.0, 420.0]) @ frame(rotation_from_vector([0.1, -0.15, 0.2]))


def hexapod_points():
    """Feet ``(6, 3)``, in the world, and the platform's points ``(6, 3)``, in its own frame."""
    turn = np.deg2rad([0, 40, 120, 160, 240, 280])
    feet = np.column_stack([300 * np.cos(turn), 300 * np.sin(turn), 5.0 * np.arange(6)])
    heads = np.deg2rad([-30, 70, 90, 190, 210, 310])
    return feet, np.column_stack([150 * np.cos(heads), 150 * np.sin(heads), 3.0 * np.arange(6)])


def leg_frame(foot, head):
    """A frame at the foot with z along the leg."""
    z = (head - foot) / np.linalg.norm(head - foot)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return frame(np.column_stack([x, np.cross(z, x), z]), foot)


def hexapod() -> tuple[Machine, dict[str, float]]:
    """The platform goes with the last leg; balls hold the others."""
    feet, heads = hexapod_points()
    heads = heads @ TOOL[:3, :3].T + TOOL[:3, 3]
    parts, after, values, closures = [], {}, {}, []
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        leg = leg_frame(foot, head)
        parts += [
            RigidOffset(f"foot{i}", leg),
            Joint(f"u{i}", AXES["x"], passive=True),
            Joint(f"v{i}", AXES["y"], passive=True),
            Joint(f"cylinder{i}", AXES["z"], slides=True, compliance=1.0 / STIFFNESS[i]),
        ]
        after[f"foot{i}"] = ""
        values |= {f"u{i}": 0.0, f"v{i}": 0.0, f"cylinder{i}": float(np.linalg.norm(head - foot))}
        if i < 5:
            held = translation(np.linalg.inv(TOOL)[:3, :3] @ (head - TOOL[:3, 3]))
            closures.append(Closure(f"ball{i}", (f"cylinder{i}", "platform"), np.array([np.eye(4), held]), True))
            continue
        parts += [Joint(f"ball-{axis}", AXES[axis], passive=True) for axis in "xyz"]
        values |= {f"ball-{axis}": 0.0 for axis in "xyz"}
        parts.append(RigidOffset("platform", np.linalg.inv(leg @ translation([0, 0, values["cylinder5"]])) @ TOOL))
    return Machine("hexapod", tuple(parts), after=after, closures=tuple(closures)), values


def hexapod_by_hand(tool):
    """Wrench and K^F with the platform at a frame: bars of the stiffness k that bear k times their lengthening.

    ``F = Σ f s``, ``M = Σ r × f s``; a point of the platform at r moves by ``v − r × ω``, its bar's force changes
    by ``[k s sᵀ + f/L (1 − s sᵀ)]`` of that, and its lever by ``ω × r``.
    """
    feet, heads = hexapod_points()
    wrench, K = np.zeros(6), np.zeros((6, 6))
    for k, foot, head in zip(STIFFNESS, feet, heads, strict=True):
        drawn = np.linalg.norm(TOOL[:3, :3] @ head + TOOL[:3, 3] - foot)
        r = tool[:3, :3] @ head
        bar = tool[:3, 3] + r - foot
        length = np.linalg.norm(bar)
        s, f = bar / length, k * (length - drawn)
        wrench += f * np.concatenate([s, np.cross(r, s)])
        A = np.hstack([np.eye(3), -skew(r)])
        K += A.T @ (k * np.outer(s, s) + f / length * (np.eye(3) - np.outer(s, s))) @ A
        K[3:, 3:] += f * skew(s) @ skew(r)
    return wrench, K


def test_an_unloaded_hexapod_is_the_sum_over_its_cylinders():
    chain, values = hexapod()
    K = solution(chain, values, imposed=np.zeros(6)).stiffness[""]
    feet, heads = hexapod_points()
    r = heads @ TOOL[:3, :3].T
    s = r + TOOL[:3, 3] - feet
    s /= np.linalg.norm(s, axis=1)[:, None]
    # the cylinders' speeds by the platform's motion: J⁻¹
    inverse_jacobian = np.hstack([s, np.cross(r, s)])
    expected = inverse_jacobian.T @ np.diag(STIFFNESS) @ inverse_jacobian
    assert K == pytest.approx(expected, abs=EXACT * np.abs(expected).max())


def test_a_displaced_hexapod_is_held_by_its_bars_forces():
    chain, values = hexapod()
    displacement = np.array([12.0, -8.0, 15.0, 0.08, -0.05, 0.12])
    found = solution(chain, values, imposed=displacement)
    wrench, K = hexapod_by_hand(displaced(TOOL, displacement))
    assert found.wrench == pytest.approx(wrench, abs=EXACT * np.abs(wrench).max())
    assert found.stiffness[""] == pytest.approx(K, abs=EXACT * np.abs(K).max())
    free = solution(chain, values, wrenches={"": wrench})
    assert free.displacements[""] == pytest.approx(displacement, abs=EXACT * 15.0)
    assert free.stiffness[""] == pytest.approx(K, abs=EXACT * np.abs(K).max())


# --- tripteron: three legs, each a drive and three hinges along one axis ----------------------------------------

SECTION = Section(EA=4e6, GJ=2e8, EIy=3e8, EIz=5e8)
DRIVE = 2e-4
LEGS = (("x", (0.3, 1.1, -0.6)), ("y", (-0.4, 1.2, -0.5)), ("z", (0.2, 1.0, -0.9)))


def across(axis):
    """A rotation that takes z to a joint's axis: links lie across it along x."""
    z = AXES[axis]
    x = AXES[{"x": "y", "y": "z", "z": "x"}[axis]]
    return np.column_stack([x, np.cross(z, x), z])


def leg_ends():
    """Each leg's hinges and tip from its foot at the origin, and the frames of its links."""
    ends = {}
    for axis, angles in LEGS:
        T, places, links = frame(across(axis)), [], []
        for angle, length in zip(angles, (200.0, 150.0, 0.0), strict=True):
            T = T @ frame(rotation_from_vector([0.0, 0.0, angle]))
            places.append(T[:3, 3].copy())
            links.append(T.copy())
            T = T @ translation([length, 0.0, 0.0])
        ends[axis] = places, links, T
    return ends


def tripteron() -> tuple[Machine, dict[str, float]]:
    parts, after, values, closures = [], {}, {}, []
    ends = leg_ends()
    for axis, angles in LEGS:
        # feet so that all tips meet in the platform's point
        foot = frame(across(axis), -ends[axis][2][:3, 3])
        parts.append(RigidOffset(f"foot-{axis}", foot))
        after[f"foot-{axis}"] = ""
        parts.append(Joint(f"drive-{axis}", AXES["z"], slides=True, compliance=DRIVE))
        values[f"drive-{axis}"] = 0.0
        for i, (angle, length) in enumerate(zip(angles, (200.0, 150.0, None), strict=True)):
            parts.append(Joint(f"hinge-{axis}{i}", AXES["z"], passive=True))
            values[f"hinge-{axis}{i}"] = angle
            if length:
                parts.append(Beam(f"link-{axis}{i}", length, section=SECTION))
    level = ends[LEGS[-1][0]][2][:3, :3].T
    parts.append(RigidOffset("platform", frame(level)))
    for axis, _ in LEGS[:-1]:
        level = frame(ends[axis][2][:3, :3].T)
        closures.append(Closure(f"weld-{axis}", (f"hinge-{axis}2", "platform"), np.array([level, np.eye(4)])))
    return Machine("tripteron", tuple(parts), after=after, closures=tuple(closures)), values


def test_a_tripteron_is_the_sum_of_what_its_legs_can_bear():
    chain, values = tripteron()
    K = solution(chain, values, imposed=np.zeros(6)).stiffness[""]
    expected = np.zeros((6, 6))
    for axis, (places, links, tip) in leg_ends().items():
        z = AXES[axis]
        C = DRIVE * np.outer([*z, 0, 0, 0], [*z, 0, 0, 0])
        for T, length in zip(links, (200.0, 150.0), strict=False):
            L, s = length, SECTION
            # a cantilever's tip: L³/3EI, L²/2EI, L/EI, in the link's axes, carried by a rigid arm to the platform
            own = np.diag([L / s.EA, L**3 / 3 / s.EIz, L**3 / 3 / s.EIy, L / s.GJ, L / s.EIy, L / s.EIz])
            own[1, 5] = own[5, 1] = L**2 / 2 / s.EIz
            own[2, 4] = own[4, 2] = -(L**2) / 2 / s.EIy
            arm = np.eye(6)
            arm[:3, 3:] = -skew(tip[:3, 3] - (T @ translation([L, 0.0, 0.0]))[:3, 3])
            turn = np.kron(np.eye(2), T[:3, :3])
            C += arm @ turn @ own @ turn.T @ arm.T
        # a leg bears only wrenches that turn none of its hinges
        hinges = np.array([np.concatenate([np.cross(z, tip[:3, 3] - p), z]) for p in places])
        W = null_space(hinges * np.repeat([1.0, 200.0], 3) / 200.0) * np.repeat([1.0, 200.0], 3)[:, None]
        expected += W @ np.linalg.inv(W.T @ C @ W) @ W.T
    assert K == pytest.approx(expected, abs=EXACT * np.abs(expected).max())


# --- a crank under its weight with a spring between points ------------------------------------------------------


def crank(angle: float, free_length: float, stiffness: float, mass: float) -> tuple[Machine, dict[str, float]]:
    """A crank of 500 mm about z, gravity along −y; a spring from 200 mm on it to a point 300 mm above its axis."""
    parts = (
        Joint("crank", AXES["z"], passive=True, compliance=5e-07),
        RigidOffset("arm", translation([500.0, 0.0, 0.0]), mass=mass, centre=np.array([400.0, 0.0, 0.0])),
    )
    points = np.array([[0.0, 300.0, 0.0], [200.0, 0.0, 0.0]])
    spring = PointSpring("compensator", ("", "arm"), points, stiffness, free_length)
    return Machine("crank", parts, point_springs=(spring,)), {"crank": angle}


@pytest.mark.parametrize("angle", [-1.0, 0.3, 1.2])
def test_a_spring_without_free_length_balances_a_crank_everywhere(angle: float):
    mass = 10.0
    # its moment about the axis is k a h cos φ, whatever the angle, that of the weight m g c cos φ
    stiffness = mass * 9.81 * 400.0 / (200.0 * 300.0)
    found = solution(*crank(angle, 0.0, stiffness, mass), gravity=(0.0, -9.81, 0.0))
    assert found.parts["crank"] == pytest.approx(0.0, abs=1e-12)
    assert found.torques["crank"] == pytest.approx(0.0, abs=1e-12 * mass * 9.81 * 400.0)


@pytest.mark.parametrize("angle", [-1.0, 0.3, 1.2])
def test_a_crank_stands_where_its_moments_are_in_balance(angle: float):
    k, free, mass = 3.0, 150.0, 10.0
    found = solution(*crank(angle, free, k, mass), gravity=(0.0, -9.81, 0.0))

    def moment(turn):
        phi = angle + turn
        length = np.sqrt(200.0**2 + 300.0**2 - 2.0 * 200.0 * 300.0 * np.sin(phi))
        return k * (1.0 - free / length) * 200.0 * 300.0 * np.cos(phi) - mass * 9.81 * 400.0 * np.cos(phi)

    turn = brentq(lambda t: moment(t) - 2e6 * t, -0.3, 0.3, xtol=1e-15)
    assert abs(turn) > 1e-4
    assert found.parts["crank"] == pytest.approx(turn, rel=EXACT)
    # what holds the joint is what its spring bears
    assert found.torques["crank"] == pytest.approx(-2e6 * turn, rel=EXACT)
