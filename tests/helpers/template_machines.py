"""The machines of `validate new`, made in Python."""

from typing import Any

import numpy as np

import vjm
from vjm.rotations import frame, turn

ALUMINIUM = {"youngs_modulus_MPa": 70000.0, "poissons_ratio": 0.33, "density_kg_per_m3": 2700.0}
STEEL = {"youngs_modulus_MPa": 210000.0, "poissons_ratio": 0.3, "density_kg_per_m3": 7850.0}


def box(width: float, thickness: float, wall: float) -> vjm.Section:
    """A rectangular tube of aluminium, mm."""
    return vjm.shape(
        "rectangular_tube", width_mm=width, thickness_mm=thickness, wall_mm=wall, **ALUMINIUM
    ).stiffness()


def square(width: float, wall: float) -> vjm.Section:
    """A square tube of steel, mm."""
    return vjm.shape("square_tube", width_mm=width, wall_mm=wall, **STEEL).stiffness()


def tube(diameter: float, wall: float) -> vjm.Section:
    """A round tube of aluminium, mm."""
    return vjm.shape("round_tube", diameter_mm=diameter, wall_mm=wall, **ALUMINIUM).stiffness()


def slide(name: str, axis: str, **more: Any) -> vjm.Joint:
    """A joint that slides."""
    return vjm.Joint(name, vjm.axis(axis), slides=True, **more)


def held(name: str, parts: tuple[str, str], place: list[float], other: list[float]) -> vjm.Closure:
    """A weld between places of two parts, mm."""
    return vjm.Closure(name, parts, np.array([frame(p=place), frame(p=other)]))


def axis() -> vjm.Machine:
    """``validate new axis``."""
    parts = [
        vjm.Beam("profile", 1000.0, section=box(80.0, 60.0, 5.0)),
        slide("x", "x", rides_on="profile", limits=(50.0, 950.0), compliance=2e-5, lateral=(2e-9, 2e-9)),
        vjm.RigidOffset("table", frame(p=[0.0, 0.0, 60.0]), 4.0, np.array([0.0, 0.0, 40.0])),
    ]
    far = held("far-end", ("profile", ""), [0.0, 0.0, 0.0], [1000.0, 0.0, 0.0])
    return vjm.build("axis", parts, {"middle": {"x": 500.0}, "end": {"x": 100.0}}, closures=[far])


def gantry() -> vjm.Machine:
    """``validate new gantry``."""
    follows = vjm.JointCoupling((("y", -1.0),), as_deflected=False)
    parts = [
        slide("y", "y", limits=(0.0, 800.0), compliance=2e-5),
        vjm.RigidOffset("left", mass=8.0),
        vjm.Beam("bridge", 1200.0, section=box(120.0, 80.0, 6.0)),
        vjm.RigidOffset("right", mass=8.0),
        slide("y-right", "y", coupling=follows, compliance=2e-5),
        slide("x", "x", rides_on="bridge", limits=(50.0, 1150.0), compliance=1e-5, lateral=(1e-9, 1e-9)),
        vjm.RigidOffset("carriage", mass=12.0),
        slide("z", "z", limits=(0.0, 300.0), compliance=3e-5),
        vjm.Beam("ram", 400.0, own_frame=turn(vjm.axis("y"), np.pi / 2)[:3, :3], section=square(60.0, 4.0)),
        vjm.RigidOffset("tool", mass=6.0),
    ]
    rail = held("right-rail", ("y-right", ""), [0.0, 0.0, 0.0], [1200.0, 0.0, 500.0])
    postures = {"middle": {"x": 600.0}, "corner": {"y": 300.0, "x": 150.0, "z": 200.0}}
    return vjm.build("gantry", parts, postures, base=frame(p=[0.0, 0.0, 500.0]), closures=[rail])


def boom() -> vjm.Machine:
    """``validate new boom``."""
    parts = [
        vjm.Joint("raise", vjm.axis("-y"), limits=(-0.2, 1.4), compliance=2e-10),
        vjm.Beam("outer", 2000.0, section=square(120.0, 6.0)),
        slide("out", "x", limits=(200.0, 1600.0), compliance=1e-5, lateral=(5e-10, 5e-10)),
        vjm.Beam("inner", 1600.0, section=square(100.0, 5.0), free_length="out"),
        vjm.RigidOffset("load", mass=50.0),
    ]
    postures = {"short": {"out": 200.0}, "long": {"out": 1500.0}, "raised": {"raise": 0.8, "out": 1000.0}}
    return vjm.build("boom", parts, postures)


def scara() -> vjm.Machine:
    """``validate new scara``."""
    z = vjm.axis("z")
    parts = [
        vjm.Joint("shoulder", z, limits=(-2.3, 2.3), compliance=3e-8, lateral=(2e-9, 2e-9)),
        vjm.Beam("upper", 350.0, section=box(90.0, 120.0, 6.0)),
        vjm.Joint("elbow", z, limits=(-2.6, 2.6), compliance=6e-8, lateral=(4e-9, 4e-9)),
        vjm.Beam("fore", 250.0, section=box(70.0, 90.0, 5.0)),
        slide("z", "z", limits=(-200.0, 0.0), compliance=2e-5),
        vjm.Joint("turn", z, compliance=5e-7),
        vjm.RigidOffset("spindle", frame(p=[0.0, 0.0, -150.0]), 2.0, np.array([0.0, 0.0, -50.0])),
        vjm.RigidOffset("tool", mass=3.0),
    ]
    bent = {"shoulder": 0.4, "elbow": 1.2, "z": -100.0, "turn": 0.3}
    return vjm.build("scara", parts, {"stretched": {}, "bent": bent}, base=frame(p=[0.0, 0.0, 300.0]))


def five_bar() -> vjm.Machine:
    """``validate new five-bar``: each side is a branch from the base; the ends of both rods are held together."""
    z, parts, after = vjm.axis("z"), list[Any](), dict[str, str]()
    arm, rod = tube(40.0, 3.0), tube(30.0, 2.0)

    def along(vector: list[float]) -> np.ndarray:
        return turn(z, float(np.arctan2(vector[1], vector[0])))[:3, :3]

    for side, sign in (("left", -1.0), ("right", 1.0)):
        after[f"{side}-foot"] = ""
        parts += [
            vjm.RigidOffset(f"{side}-foot", frame(p=[100.0 * sign, 0.0, 0.0])),
            vjm.Joint(side, z, compliance=5e-8),
            vjm.Beam(f"{side}-arm", 250.0, own_frame=along([150.0 * sign, 200.0]), section=arm),
            vjm.Joint(f"{side}-pin", z, passive=True),
            vjm.Beam(
                f"{side}-rod", float(np.hypot(250, 200)), own_frame=along([-250.0 * sign, 200.0]), section=rod
            ),
        ]
    parts += [vjm.Joint("middle-pin", z, passive=True), vjm.RigidOffset("tool", mass=1.5)]
    after["tool"] = "left-rod"
    loop = held("middle", ("middle-pin", "left-rod"), [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    return vjm.build("five-bar", parts, {"drawn": {}}, after=after, closures=[loop])


def delta() -> vjm.Machine:
    """``validate new delta``, by bodies and joints as a file has them."""
    base, length, platform, rod, half = 160.0, 200.0, 50.0, 400.0, 40.0
    down = -float(np.sqrt(rod**2 - (base + length - platform) ** 2))
    bodies: list[dict[str, Any]] = [
        {"name": "platform", "mass_kg": 1.0, "centre_of_mass_mm": [0.0, 0.0, down]}
    ]  # fmt: skip
    joints, beams = list[dict[str, Any]](), list[dict[str, Any]]()
    sections = [
        {"shape": "round_tube", "diameter_mm": diameter, "wall_mm": wall, **ALUMINIUM}
        for diameter, wall in ((40.0, 3.0), (16.0, 1.5))
    ]

    def beam(name: str, between: list[str], ends: list[Any], section: dict[str, Any]) -> None:
        beams.append({
            "name": name, "between": between, "from_mm": ends[0].tolist(), "to_mm": ends[1].tolist(),
            "section": section,
        })  # fmt: skip

    for k, leg in enumerate("abc"):
        out = turn(vjm.axis("z"), 2.0 * np.pi * k / 3.0)[:3, 0]
        across = np.cross([0.0, 0.0, 1.0], out)
        hub, elbow = base * out, (base + length) * out
        bodies += [{"name": f"hub-{leg}"}, {"name": f"elbow-{leg}"}]
        joints.append({
            "name": leg, "kind": "actuated", "between": ["ground", f"hub-{leg}"], "at_mm": hub.tolist(),
            "axis": across.tolist(), "compliance_rad_per_Nmm": 5e-8,
        })  # fmt: skip
        beam(f"arm-{leg}", [f"hub-{leg}", f"elbow-{leg}"], [hub, elbow], sections[0])
        for number, sign in (("1", 1.0), ("2", -1.0)):
            one = leg + number
            top, low = elbow + sign * half * across, platform * out + sign * half * across + [0.0, 0.0, down]
            second = np.cross(low - top, across) / rod
            bodies += [{"name": f"top-{one}"}, {"name": f"low-{one}"}]
            joints.append({
                "name": f"u-{one}", "kind": "universal", "between": [f"elbow-{leg}", f"top-{one}"],
                "at_mm": top.tolist(), "axes": [across.tolist(), second.tolist()],
            })  # fmt: skip
            joints.append({
                "name": f"s-{one}", "kind": "ball", "between": [f"low-{one}", "platform"], "at_mm": low.tolist()
            })  # fmt: skip
            beam(f"rod-{one}", [f"top-{one}", f"low-{one}"], [top, low], sections[1])
    return vjm.load({
        "format": 1, "kind": "bodies", "name": "delta", "title": "Delta", "source": "made up",
        "units": {"length": "mm", "force": "N", "angle": "rad"}, "bodies": bodies, "joints": joints, "beams": beams,
        "end": {"body": "platform", "at_mm": [0.0, 0.0, down]},
        "postures": {"low": {"a": 0.3, "b": 0.3, "c": 0.3}, "aside": {"a": 0.2, "b": 0.0, "c": -0.1}},
    })  # fmt: skip
