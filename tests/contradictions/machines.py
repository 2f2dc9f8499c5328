"""Random machines of every kind, as the model files that commands read.

Each kind is a function of a random generator. Dimensions, places in the world, springs and loads are drawn anew
for every seed. A symmetric load is symmetric on purpose: it leads to a bifurcation. An inclined one leads to a
limit, or to none. `critical` is a closed form where there is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.io.toml_text import toml_text
from vjm.rotations import rotation_from_vector, rotation_vector

Table = dict[str, Any]
MODEL = "machine.toml"
UNITS = {"length": "mm", "force": "N", "angle": "rad"}
FREE_END, HELD_END = "free", "held"


@dataclass(frozen=True)
class Drawn:
    """A machine with what is asked of it.

    Attributes:
        kind: one of `KINDS`.
        seed: its number, see `drawn`.
        files: text by name; `MODEL` is the machine.
        load: ``(6,)`` unit wrench that grows to a critical one, N and N mm.
        scale: N, a load of the size at which stability may be lost.
        keys: numbers of the file by which quantities are differentiated.
        end: whether the machine carries its free end.
        twin: name of a file with the same machine in another form; empty without.
        critical: factor on the load at which stability is lost, in closed form; None where there is none.
        wrong_postures: postures in which a beam would be longer than it is, or shorter than nothing.
        mass: kg, as drawn.
    """

    kind: str
    seed: int
    files: Mapping[str, str]
    load: tuple[float, ...]
    scale: float
    keys: tuple[str, ...]
    mass: float
    end: str = FREE_END
    twin: str = ""
    critical: float | None = None
    wrong_postures: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.kind} {self.seed}"


def unit(*values: float) -> np.ndarray:
    """A unit vector."""
    v = np.array(values, dtype=float)
    return v / np.linalg.norm(v)


def listed(v: Any) -> list[float]:
    """Numbers of an array, rounding away."""
    return [float(x) for x in np.asarray(v, dtype=float)]


class Sketch:
    """Bodies, joints, beams and springs of a file, drawn in axes of their own and placed in the world."""

    def __init__(self, rng: np.random.Generator, name: str) -> None:
        # half of the machines stand along the world's axes: rounding and symmetry differ there
        turned = rng.random() < 0.5
        self.R = rotation_from_vector(rng.normal(size=3)) if turned else np.eye(3)
        self.p = rng.uniform(-100.0, 100.0, 3) if turned else np.zeros(3)
        self.name = name
        self.tables: dict[str, list[Table]] = {}
        self.mass = 0.0

    def point(self, x: Any) -> list[float]:
        """A place in the world, mm."""
        return listed(self.p + self.R @ np.asarray(x, dtype=float))

    def axis(self, v: Any) -> list[float]:
        """A unit vector in the world."""
        return listed(self.R @ unit(*v))

    def add(self, table: str, content: Table) -> None:
        self.tables.setdefault(table, []).append(content)

    def body(self, name: str, mass: float = 0.0, centre: Any = (0.0, 0.0, 0.0)) -> str:
        weight = {"mass_kg": mass, "centre_of_mass_mm": self.point(centre)} if mass else {}
        self.mass += mass
        self.add("bodies", {"name": name, **weight})
        return name

    def joint(self, name: str, between: tuple[str, str], at: Any, axis: Any = None, **keys: Any) -> None:
        turning = {} if axis is None else {"axis": self.axis(axis)}
        self.add("joints", {"name": name, "between": list(between), "at_mm": self.point(at), **turning, **keys})

    def spring(
        self,
        name: str,
        between: tuple[str, str],
        points: Any,
        stiffness: float,
        stretch: float = 0.0,
    ) -> None:
        """A spring between points; drawn it is longer than free by a share of itself."""
        drawn = float(np.linalg.norm(np.subtract(*np.asarray(points, dtype=float))))
        self.add(
            "point_springs",
            {
                "name": name,
                "between": list(between),
                "points_mm": [self.point(x) for x in points],
                "stiffness_N_per_mm": stiffness,
                "free_length_mm": drawn / (1.0 + stretch),
            },
        )

    def text(self, body: str, at: Any, **more: Any) -> str:
        return toml_text(
            {
                "format": 1,
                "kind": "bodies",
                "name": self.name,
                "title": self.name,
                "source": "drawn at random",
                "units": UNITS,
                "end": {"body": body, "at_mm": self.point(at)},
                **self.tables,
                **more,
            }
        )

    def force(self, *direction: float) -> tuple[float, ...]:
        """A unit force."""
        return (*self.axis(direction), 0.0, 0.0, 0.0)


def chain_text(name: str, parts: list[Table], **more: Any) -> str:
    return toml_text(
        {
            "format": 1,
            "name": name,
            "title": name,
            "source": "drawn at random",
            "units": UNITS,
            "parts": parts,
            **more,
        }
    )


def round_section(rng: np.random.Generator, diameter: float) -> Table:
    return {
        "shape": "round_bar",
        "diameter_mm": diameter,
        "youngs_modulus_MPa": 210_000.0,
        "poissons_ratio": 0.3,
        "density_kg_per_m3": 7850.0,
    }


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


# --- chains, arms, trees ----------------------------------------------------------------------------------


def arm(rng: np.random.Generator, seed: int) -> Drawn:
    """Joints, links and beams in series with a free tip, under a force in any direction."""
    parts, held, mass = [], {}, 0.0
    for i in range(int(rng.integers(2, 5))):
        slides = i > 0 and rng.random() < 0.2
        key = "compliance_mm_per_N" if slides else "compliance_rad_per_Nmm"
        axis = str(rng.choice(["x", "y", "z"]))
        joint: Table = {"kind": "actuated", "name": f"j{i}", "axis": axis}
        joint |= {"motion": "slides"} if slides else {}
        joint[key] = log_uniform(rng, 1e-4, 1e-3) if slides else log_uniform(rng, 2e-8, 2e-7)
        if not slides and rng.random() < 0.4:
            joint["lateral_rad_per_Nmm"] = [log_uniform(rng, 1e-9, 3e-8) for _ in range(2)]
        parts.append(joint)
        held[f"j{i}"] = float(rng.uniform(-20, 20) if slides else rng.uniform(-1.2, 1.2))
        if rng.random() < 0.5:
            length = float(rng.uniform(150, 400))
            parts.append(
                {
                    "kind": "beam",
                    "name": f"b{i}",
                    "length_mm": length,
                    "section": round_section(rng, float(rng.uniform(14, 25))),
                }
            )
            diameter = parts[-1]["section"]["diameter_mm"]
            mass += 7.85e-6 * math.pi / 4 * diameter**2 * length
        else:
            kg = float(rng.uniform(0.5, 4.0))
            parts.append(
                {
                    "kind": "link",
                    "name": f"l{i}",
                    "translation_mm": listed(rng.uniform(80, 300, 3)),
                    "mass_kg": kg,
                    "centre_of_mass_mm": listed(rng.uniform(-80, 80, 3)),
                }
            )
            mass += kg
    text = chain_text("arm", parts, postures={"home": held})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn("arm", seed, {MODEL: text}, force, bending_force(3e-7, 600.0), (_first_key(parts),), mass)


def bending_force(compliance: float, reach: float) -> float:
    """N, under which a joint of such a compliance (rad/(N mm)) turns by half a radian or so at such an arm (mm)."""
    return 0.5 / (compliance * reach)


def _first_key(parts: list[Table]) -> str:
    for part in parts:
        for key in part:
            if key.startswith("compliance_"):
                return f"{part['name']}.{key}"
    raise AssertionError("no joint has a compliance")


def stretched_arm(rng: np.random.Generator, seed: int) -> Drawn:
    """A planar arm stretched along its force, which presses: a bifurcation."""
    parts: list[Table] = []
    stiffness, length, mass, springs = 0.0, 0.0, 0.0, []
    for i in range(int(rng.integers(1, 4))):
        k, own, kg = log_uniform(rng, 3e6, 3e7), float(rng.uniform(150, 400)), float(rng.uniform(0.5, 3.0))
        parts.append({"kind": "actuated", "name": f"j{i}", "axis": "z", "compliance_rad_per_Nmm": 1.0 / k})
        parts.append(
            {
                "kind": "link",
                "name": f"l{i}",
                "translation_mm": [own, 0.0, 0.0],
                "mass_kg": kg,
                "centre_of_mass_mm": [own / 2, 0.0, 0.0],
            }
        )
        springs.append((k, own))
        stiffness, length, mass = max(stiffness, k), length + own, mass + kg
    text = chain_text("stretched-arm", parts, postures={"home": {f"j{i}": 0.0 for i in range(len(springs))}})
    # links turn by sums of the joints' angles; a pressing force P has the energy -P Σ l (1 - cos)
    n = len(springs)
    sums = np.tril(np.ones((n, n)))
    K = np.diag([k for k, _ in springs])
    G = sums.T @ np.diag([own for _, own in springs]) @ sums
    critical = float(np.linalg.eigvals(np.linalg.solve(G, K)).real.min())
    return Drawn(
        "stretched arm",
        seed,
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        1.5 * critical,
        ("j0.compliance_rad_per_Nmm", "l0.translation_mm.1"),
        mass,
        critical=critical,
    )


def column(rng: np.random.Generator, seed: int) -> Drawn:
    """A chain with passive joints, whose end has to be held."""
    length = float(rng.uniform(300, 700))
    beam = {"kind": "beam", "name": "link", "length_mm": length, "section": round_section(rng, rng.uniform(10, 20))}
    parts = [
        {"kind": "actuator", "name": "drive", "axis": "x", "compliance_mm_per_N": log_uniform(rng, 1e-5, 1e-4)},
        {"kind": "joint", "name": "u1", "axis": "y"},
        {"kind": "joint", "name": "u2", "axis": "z"},
        beam,
        {"kind": "joint", "name": "u3", "axis": "z"},
        {"kind": "joint", "name": "u4", "axis": "y"},
    ]
    bent = rng.random() < 0.5
    angles = [0.2, 0.3, -0.3, -0.2] if bent else [0.0] * 4
    text = chain_text("column", parts, postures={"home": angles})
    diameter = beam["section"]["diameter_mm"]
    euler = math.pi**2 * 210_000.0 * math.pi / 64 * diameter**4 / length**2
    mass = 7.85e-6 * math.pi / 4 * diameter**2 * length
    return Drawn(
        "chain",
        seed,
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        euler,
        ("drive.compliance_mm_per_N", "link.section.diameter_mm"),
        mass,
        end=HELD_END,
    )


def tree(rng: np.random.Generator, seed: int) -> Drawn:
    """A stem with two arms; the loaded one is the last."""
    drawn = [float(rng.uniform(150, 300)) for _ in range(3)]
    kg = [float(rng.uniform(0.5, 4.0)) for _ in range(3)]

    def link(name: str, i: int) -> Table:
        return {
            "kind": "link",
            "name": name,
            "translation_mm": [drawn[i], 20.0 * i, 0.0],
            "mass_kg": kg[i],
            "centre_of_mass_mm": [drawn[i] / 2, 0.0, 10.0],
        }

    def joint(name: str, axis: str, **more: Any) -> Table:
        return {
            "kind": "actuated",
            "name": name,
            "axis": axis,
            "compliance_rad_per_Nmm": log_uniform(rng, 3e-8, 3e-7),
            **more,
        }

    parts = [
        joint("pan", "y"),
        link("stem", 0),
        joint("right", "z"),
        link("counter", 1),
        joint("left", "z", after="stem"),
        link("hand", 2),
    ]
    q = {name: float(rng.uniform(-0.8, 0.8)) for name in ("pan", "right", "left")}
    text = chain_text("tree", parts, postures={"home": q})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn(
        "tree",
        seed,
        {MODEL: text},
        force,
        bending_force(5e-7, 400.0),
        ("left.compliance_rad_per_Nmm", "stem.translation_mm.1"),
        sum(kg),
    )


def geared_arm(rng: np.random.Generator, seed: int) -> Drawn:
    """An arm with a joint that follows another one."""
    kg = [float(rng.uniform(0.5, 4.0)) for _ in range(3)]
    parts: list[Table] = []
    for i in range(3):
        c = log_uniform(rng, 3e-8, 3e-7)
        if i == 1:
            parts.append(
                {
                    "kind": "coupled",
                    "name": "j1",
                    "axis": "y",
                    "to": {"j0": float(rng.uniform(-1.5, 1.5))},
                    "coupling": str(rng.choice(["as deflected", "as commanded"])),
                    "compliance_rad_per_Nmm": c,
                }
            )
        else:
            parts.append(
                {"kind": "actuated", "name": f"j{i}", "axis": "y" if i == 0 else "z", "compliance_rad_per_Nmm": c}
            )
        parts.append(
            {
                "kind": "link",
                "name": f"l{i}",
                "translation_mm": [float(rng.uniform(100, 300)), 0.0, 30.0],
                "mass_kg": kg[i],
                "centre_of_mass_mm": [50.0, 0.0, 0.0],
            }
        )
    q = {"j0": float(rng.uniform(-0.8, 0.8)), "j2": float(rng.uniform(-0.8, 0.8))}
    text = chain_text("geared-arm", parts, postures={"home": q})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn(
        "geared arm",
        seed,
        {MODEL: text},
        force,
        bending_force(5e-7, 500.0),
        ("j0.compliance_rad_per_Nmm", "l1.translation_mm.1"),
        sum(kg),
    )


def stressed_arm(rng: np.random.Generator, seed: int) -> Drawn:
    """An arm on sprung joints, one of them under stress as drawn, and a stressed spring to the base."""
    s = Sketch(rng, "stressed-arm")
    at, last = np.zeros(3), "ground"
    for i in range(3):
        own = rng.uniform(80, 200, 3)
        s.body(f"b{i}", float(rng.uniform(0.5, 2.0)), at + own / 2)
        k = log_uniform(rng, 1e6, 2e7)
        more: Table = {"stiffness_Nmm_per_rad": k}
        if i == 1:
            more |= {"preload_Nmm": float(rng.uniform(-0.02, 0.02)) * k}
        s.joint(f"j{i}", (last, f"b{i}"), at, rng.normal(size=3), **more)
        at, last = at + own, f"b{i}"
    s.spring("stay", ("ground", last), [rng.uniform(-300, 0, 3), at], log_uniform(rng, 1.0, 10.0), 0.02)
    return Drawn(
        "stressed arm",
        seed,
        {MODEL: s.text(last, at)},
        s.force(*rng.normal(size=3)),
        bending_force(5e-7, 400.0),
        ("j0.stiffness_Nmm_per_rad", "stay.stiffness_N_per_mm"),
        s.mass,
    )


# --- planar loops -----------------------------------------------------------------------------------------


def _bars(
    rng: np.random.Generator, s: Sketch, count: int, bent: float, *, redundant: bool
) -> tuple[list[float], list[float]]:
    """Bars on a foot that press a head on a guide; springs at the knees. Their lengths and the springs."""
    lengths = [float(rng.uniform(150, 350)) for _ in range(count)]
    springs, at, last = [], np.zeros(3), "ground"
    for i, own in enumerate(lengths):
        far = at + np.array([bent * own * (-1) ** i, 0.0, own * math.sqrt(1.0 - bent**2)])
        s.body(f"bar{i}", float(rng.uniform(0.1, 0.5)), (at + far) / 2)
        k = log_uniform(rng, 3e5, 3e6)
        s.joint(
            "foot" if i == 0 else f"knee{i}",
            (last, f"bar{i}"),
            at,
            (0, 1, 0),
            **({} if i == 0 else {"stiffness_Nmm_per_rad": k}),
        )
        springs += [k] if i else []
        at, last = far, f"bar{i}"
    s.body("head", float(rng.uniform(0.1, 0.5)), at)
    if redundant:
        s.joint("top", (last, "head"), at, (0, 1, 0))
        s.joint("guide", ("ground", "head"), at, (0, 0, 1), motion="slides")
    else:
        s.body("cross")
        s.joint("top", (last, "head"), at, kind="ball")
        s.joint("guide", ("ground", "cross"), at, (0, 0, 1), motion="slides")
        s.joint("across", ("cross", "head"), at, (0, 1, 0), motion="slides")
    s.tip = at
    return lengths, springs


def _bars_critical(lengths: list[float], springs: list[float]) -> float:
    """Of straight bars under a dead load along them: K v = P G v, the head on its guide."""
    n = len(lengths)
    # angles of the bars; knees turn by differences; the head stays on the line: Σ l a = 0
    D = np.diff(np.eye(n), axis=0)
    K, G = D.T @ np.diag(springs) @ D, np.diag(lengths)
    _, _, V = np.linalg.svd(np.array([lengths]))
    N = V[1:].T
    return float(np.linalg.eigvals(np.linalg.solve(N.T @ G @ N, N.T @ K @ N)).real.min())


def straight_bars(rng: np.random.Generator, seed: int) -> Drawn:
    """Two or three bars in a line between a foot and a guide: planar, overconstrained, a bifurcation."""
    s = Sketch(rng, "straight-bars")
    lengths, springs = _bars(rng, s, int(rng.integers(2, 4)), 0.0, redundant=True)
    critical = _bars_critical(lengths, springs)
    return Drawn(
        "planar loop, redundant",
        seed,
        {MODEL: s.text("head", s.tip)},
        s.force(0, 0, -1),
        1.5 * critical,
        ("knee1.stiffness_Nmm_per_rad",),
        s.mass,
        critical=critical,
    )


def bent_bars(rng: np.random.Generator, seed: int) -> Drawn:
    """The same bars with a bend."""
    s = Sketch(rng, "bent-bars")
    lengths, springs = _bars(rng, s, 2, float(rng.uniform(0.1, 0.5)), redundant=True)
    return Drawn(
        "planar loop, bent",
        seed,
        {MODEL: s.text("head", s.tip)},
        s.force(0, 0, -1),
        _bars_critical(lengths, springs),
        ("knee1.stiffness_Nmm_per_rad",),
        s.mass,
    )


def released_bars(rng: np.random.Generator, seed: int) -> Drawn:
    """The same bars with joints that leave no constraint redundant."""
    s = Sketch(rng, "released-bars")
    lengths, springs = _bars(rng, s, 2, 0.0, redundant=False)
    critical = _bars_critical(lengths, springs)
    return Drawn(
        "planar loop, released",
        seed,
        {MODEL: s.text("head", s.tip)},
        s.force(0, 0, -1),
        1.5 * critical,
        ("knee1.stiffness_Nmm_per_rad",),
        s.mass,
        critical=critical,
    )


def sprung_knee(rng: np.random.Generator, seed: int) -> Drawn:
    """Two bars in a line, their knee held by a spring across: a bifurcation, subcritical."""
    s = Sketch(rng, "sprung-knee")
    own, far = (float(rng.uniform(150, 350)) for _ in range(2))
    k, reach = log_uniform(rng, 3.0, 30.0), float(rng.uniform(200, 600))
    s.body("lower", 0.3, (0, 0, own / 2))
    s.body("upper", 0.3, (0, 0, own + far / 2))
    s.body("head", 0.2, (0, 0, own + far))
    s.joint("foot", ("ground", "lower"), (0, 0, 0), (0, 1, 0))
    s.joint("knee", ("lower", "upper"), (0, 0, own), (0, 1, 0))
    s.joint("top", ("upper", "head"), (0, 0, own + far), (0, 1, 0))
    s.joint("guide", ("ground", "head"), (0, 0, own + far), (0, 0, 1), motion="slides")
    s.spring("stay", ("ground", "lower"), [(-reach, 0, own), (0, 0, own)], k)
    # P u (1/l1 + 1/l2) against k u
    critical = k / (1.0 / own + 1.0 / far)
    return Drawn(
        "planar loop, spring between points",
        seed,
        {MODEL: s.text("head", (0, 0, own + far))},
        s.force(0, 0, -1),
        1.5 * critical,
        ("stay.stiffness_N_per_mm",),
        s.mass,
        critical=critical,
    )


def four_bar(rng: np.random.Generator, seed: int) -> Drawn:
    """A planar four-bar linkage with a driven crank and a loaded coupler, its hinges parallel."""
    s = Sketch(rng, "four-bar")
    A, D = np.zeros(3), np.array([rng.uniform(300, 400), 0.0, 0.0])
    B = np.array([rng.uniform(-40, 60), 0.0, rng.uniform(120, 180)])
    C = np.array([rng.uniform(320, 420), 0.0, rng.uniform(200, 300)])
    P = (B + C) / 2 + [0.0, 0.0, rng.uniform(40, 120)]
    s.body("crank", float(rng.uniform(0.5, 2.0)), (A + B) / 2)
    s.body("coupler", float(rng.uniform(0.5, 2.0)), (B + C) / 2)
    s.body("rocker", float(rng.uniform(0.5, 2.0)), (C + D) / 2)
    c = log_uniform(rng, 3e-8, 3e-7)
    s.joint("motor", ("ground", "crank"), A, (0, 1, 0), kind="actuated", compliance_rad_per_Nmm=c)
    s.joint("b", ("crank", "coupler"), B, (0, 1, 0))
    s.joint("c", ("coupler", "rocker"), C, (0, 1, 0))
    more = {"stiffness_Nmm_per_rad": 1e5, "preload_Nmm": 1e3} if rng.random() < 0.4 else {}
    s.joint("d", ("ground", "rocker"), D, (0, 1, 0), **more)
    return Drawn(
        "planar four-bar",
        seed,
        {MODEL: s.text("coupler", P)},
        s.force(rng.normal(), 0.3 * rng.normal(), rng.normal()),
        0.3 / c / 200.0,
        ("motor.compliance_rad_per_Nmm",),
        s.mass,
    )


def beam_loop(rng: np.random.Generator, seed: int) -> Drawn:
    """A four-bar linkage whose coupler is an elastic beam."""
    s = Sketch(rng, "beam-loop")
    A, D = np.zeros(3), np.array([rng.uniform(300, 400), 0.0, 0.0])
    B = np.array([rng.uniform(-40, 60), 0.0, rng.uniform(120, 180)])
    C = np.array([rng.uniform(320, 420), 0.0, rng.uniform(200, 300)])
    for name, mass, at in (("crank", 1.0, B / 2), ("near", 0.1, B), ("far", 0.1, C), ("rocker", 1.0, (C + D) / 2)):
        s.body(name, mass, at)
    c, d = log_uniform(rng, 3e-8, 3e-7), float(rng.uniform(10, 16))
    s.joint("motor", ("ground", "crank"), A, (0, 1, 0), kind="actuated", compliance_rad_per_Nmm=c)
    s.joint("b", ("crank", "near"), B, (0, 1, 0))
    s.joint("c", ("far", "rocker"), C, (0, 1, 0))
    s.joint("d", ("ground", "rocker"), D, (0, 1, 0))
    s.add(
        "beams",
        {
            "name": "coupler",
            "between": ["near", "far"],
            "from_mm": s.point(B),
            "to_mm": s.point(C),
            "y_axis": s.axis((0, 1, 0)),
            "section": round_section(rng, d),
        },
    )
    s.mass += 7.85e-6 * math.pi / 4 * d**2 * float(np.linalg.norm(C - B))
    return Drawn(
        "loop with a beam",
        seed,
        {MODEL: s.text("rocker", C)},
        s.force(rng.normal(), 0.0, rng.normal()),
        0.3 / c / 200.0,
        ("motor.compliance_rad_per_Nmm", "coupler.section.diameter_mm"),
        s.mass,
    )


# --- spatial loops ----------------------------------------------------------------------------------------


def rssr(rng: np.random.Generator, seed: int) -> Drawn:
    """A crank and a rocker on skew axes, joined by a rod with a universal joint and a ball."""
    s = Sketch(rng, "rssr")
    A, D = np.zeros(3), rng.uniform([250, -80, -60], [350, 80, 60])
    B, C = A + rng.uniform([-40, -40, 100], [60, 40, 180]), D + rng.uniform([-20, -60, 150], [80, 60, 250])
    s.body("crank", float(rng.uniform(0.3, 1.5)), B / 2)
    s.body("rod", float(rng.uniform(0.3, 1.5)), (B + C) / 2)
    s.body("rocker", float(rng.uniform(0.3, 1.5)), (C + D) / 2)
    c = log_uniform(rng, 3e-8, 3e-7)
    s.joint(
        "motor",
        ("ground", "crank"),
        A,
        unit(0.2 * rng.normal(), 1.0, 0.2 * rng.normal()),
        kind="actuated",
        compliance_rad_per_Nmm=c,
    )
    along = unit(*(C - B))
    across = unit(*np.cross(along, (0.0, 1.0, 0.0)))
    s.joint("b", ("crank", "rod"), B, kind="universal", axes=[s.axis(across), s.axis(np.cross(along, across))])
    s.joint("c", ("rod", "rocker"), C, kind="ball")
    s.joint("d", ("ground", "rocker"), D, unit(0.3 * rng.normal(), 1.0, 0.3 * rng.normal()))
    return Drawn(
        "spatial loop",
        seed,
        {MODEL: s.text("rocker", C)},
        s.force(*rng.normal(size=3)),
        0.3 / c / 200.0,
        ("motor.compliance_rad_per_Nmm",),
        s.mass,
    )


def bennett(rng: np.random.Generator, seed: int) -> Drawn:
    """Bennett's linkage: four hinges that are not parallel, three constraints redundant."""
    s = Sketch(rng, "bennett")
    a, alpha, ratio = float(rng.uniform(150, 300)), float(rng.uniform(0.4, 0.9)), float(rng.uniform(0.5, 0.9))
    b, beta = a * ratio, math.asin(ratio * math.sin(alpha))
    first = float(rng.uniform(0.8, 2.0))
    second = 2.0 * math.atan(math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2) / math.tan(first / 2))
    T, axes, places = np.eye(4), [], []
    for length, twist, angle in ((a, alpha, first), (b, beta, second), (a, alpha, -first), (b, beta, -second)):
        axes.append(T[:3, 2].copy())
        places.append(T[:3, 3].copy())
        z, x, shift = np.eye(4), np.eye(4), np.eye(4)
        z[:3, :3], x[:3, :3] = rotation_from_vector((0, 0, angle)), rotation_from_vector((twist, 0, 0))
        shift[0, 3] = length
        T = T @ z @ shift @ x
    assert np.abs(T - np.eye(4)).max() < 1e-9 * a, "Bennett's linkage does not close"
    c = log_uniform(rng, 3e-8, 3e-7)
    for i in range(3):
        s.body(f"b{i}", float(rng.uniform(0.3, 1.5)), (places[i] + places[(i + 1) % 4]) / 2)
    names = ["ground", "b0", "b1", "b2", "ground"]
    for i in range(4):
        drive = {"kind": "actuated", "compliance_rad_per_Nmm": c} if i == 0 else {}
        s.joint(f"h{i}", (names[i], names[i + 1]), places[i], axes[i], **drive)
    return Drawn(
        "Bennett's linkage",
        seed,
        {MODEL: s.text("b1", places[2])},
        s.force(*rng.normal(size=3)),
        0.3 / c / 200.0,
        ("h0.compliance_rad_per_Nmm",),
        s.mass,
    )


def hexapod(rng: np.random.Generator, seed: int) -> Drawn:
    """Six struts, written as bodies and as legs on a platform."""
    name, files = "hexapod", {}
    s = Sketch(rng, name)
    s.R, s.p = np.eye(3), np.zeros(3)
    height, mass = float(rng.uniform(300, 500)), float(rng.uniform(2, 15))
    centre = np.array([*rng.uniform(-10, 10, 2), height])
    tip = np.array([0.0, 0.0, height + 50.0])
    s.body("plat", mass, centre)
    legs = []
    for i in range(6):
        on_base = math.radians(60 * i + float(rng.uniform(-25, 25)))
        on_top = math.radians(60 * i + 30 * (-1) ** i + float(rng.uniform(-10, 10)))
        foot = np.array([300 * math.cos(on_base), 300 * math.sin(on_base), float(rng.uniform(-30, 30))])
        head = np.array([140 * math.cos(on_top), 140 * math.sin(on_top), height + float(rng.uniform(-40, 40))])
        length, along = float(np.linalg.norm(head - foot)), unit(*(head - foot))
        y = unit(*np.cross((0.1 * rng.normal(), 0.1 * rng.normal(), 1.0), along))
        R = np.column_stack([along, y, np.cross(along, y)])
        c, low, up = log_uniform(rng, 5e-5, 7e-4), 0.5, 0.4
        s.body(f"lo{i}", low, foot + 100.0 * along)
        s.body(f"up{i}", up, foot + (length - 100.0) * along)
        s.joint(f"u{i}", ("ground", f"lo{i}"), foot, kind="universal", axes=[listed(R[:, 1]), listed(R[:, 2])])
        s.joint(f"s{i}", (f"lo{i}", f"up{i}"), foot, along, motion="slides", kind="actuated", compliance_mm_per_N=c)
        s.joint(f"k{i}", (f"up{i}", "plat"), head, kind="ball")
        parts = [
            {"kind": "joint", "name": "u1", "axis": "y"},
            {"kind": "joint", "name": "u2", "axis": "z"},
            {"kind": "payload", "name": "lo", "mass_kg": low, "centre_of_mass_mm": [100.0, 0.0, 0.0]},
            {"kind": "actuator", "name": "slide", "axis": "x", "compliance_mm_per_N": c},
            {
                "kind": "link",
                "name": "up",
                "translation_mm": [length, 0.0, 0.0],
                "mass_kg": up,
                "centre_of_mass_mm": [length - 100.0, 0.0, 0.0],
            },
            *({"kind": "joint", "name": f"s{k}", "axis": axis} for k, axis in enumerate("xyz", start=1)),
        ]
        files[f"leg{i}.toml"] = chain_text(f"leg{i}", parts, postures={"home": [0.0] * 5})
        v = rotation_vector(R)
        turn = {"turn_about": listed(unit(*v)), "angle_deg": math.degrees(float(np.linalg.norm(v)))}
        legs.append(
            {
                "name": f"l{i}",
                "chain": f"leg{i}.toml",
                "posture": "home",
                "base": {"position_mm": listed(foot), "turns": [turn]},
                "attachment": {"position_mm": listed(head - tip), "turns": [turn]},
            }
        )
    files[MODEL] = s.text("plat", tip)
    files["legs.toml"] = toml_text(
        {
            "format": 1,
            "kind": "manipulator",
            "name": "hexapod-legs",
            "title": name,
            "source": "drawn at random",
            "units": UNITS,
            "platform": {"position_mm": listed(tip), "mass_kg": mass, "centre_of_mass_mm": listed(centre - tip)},
            "legs": legs,
            "poses": {"home": [0.0, 0.0, 0.0]},
        }
    )
    return Drawn(
        "hexapod",
        seed,
        files,
        (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0),
        1e4,
        ("s0.compliance_mm_per_N",),
        s.mass,
        twin="legs.toml",
    )


def three_rps(rng: np.random.Generator, seed: int) -> Drawn:
    """Three legs, each a hinge, a driven slide and a ball."""
    s = Sketch(rng, "three-rps")
    height = float(rng.uniform(300, 500))
    s.body("plat", float(rng.uniform(2, 10)), (0, 0, height))
    for i in range(3):
        angle = math.radians(120 * i + float(rng.uniform(-8, 8)))
        out, side = (
            np.array([math.cos(angle), math.sin(angle), 0.0]),
            np.array([-math.sin(angle), math.cos(angle), 0]),
        )
        foot, head = 250.0 * out, 120.0 * out + [0, 0, height]
        along = unit(*(head - foot))
        s.body(f"lo{i}", 0.5, foot + 100 * along)
        s.body(f"up{i}", 0.4, head - 100 * along)
        s.joint(f"r{i}", ("ground", f"lo{i}"), foot, side)
        s.joint(
            f"s{i}",
            (f"lo{i}", f"up{i}"),
            foot,
            along,
            motion="slides",
            kind="actuated",
            compliance_mm_per_N=log_uniform(rng, 1e-4, 1e-3),
        )
        s.joint(f"k{i}", (f"up{i}", "plat"), head, kind="ball")
    return Drawn(
        "3-RPS",
        seed,
        {MODEL: s.text("plat", (0, 0, height + 30.0))},
        s.force(*rng.normal(size=3)),
        1e4,
        ("s0.compliance_mm_per_N",),
        s.mass,
    )


# --- springs between points alone -------------------------------------------------------------------------


def mises(rng: np.random.Generator, seed: int) -> Drawn:
    """Two springs that hold an apex on a guide: a limit and a snap to the other side."""
    s = Sketch(rng, "mises")
    b, h, k = float(rng.uniform(200, 400)), float(rng.uniform(30, 90)), log_uniform(rng, 10, 100)
    s.body("apex", 0.5, (0, 0, h))
    s.joint("guide", ("ground", "apex"), (0, 0, h), (0, 0, 1), motion="slides")
    s.spring("left", ("ground", "apex"), [(-b, 0, 0), (0, 0, h)], k)
    s.spring("right", ("ground", "apex"), [(b, 0, 0), (0, 0, h)], k)
    if rng.random() < 0.5:
        # a spring of another kind far away: the commands' own tests of what deflects pass
        s.body("aside", 0.1, (900, 0, 0))
        s.joint("hinge", ("ground", "aside"), (900, 0, 0), (0, 1, 0), stiffness_Nmm_per_rad=1e6)
    free = math.hypot(b, h)
    at = (free * b**2) ** (1.0 / 3.0)
    critical = 2.0 * k * (free / at - 1.0) * math.sqrt(at**2 - b**2)
    return Drawn(
        "point springs, snap through",
        seed,
        {MODEL: s.text("apex", (0, 0, h))},
        s.force(0, 0, -1),
        2.0 * critical,
        ("left.stiffness_N_per_mm",),
        s.mass,
        critical=critical,
    )


def stayed_bar(rng: np.random.Generator, seed: int) -> Drawn:
    """A bar on a hinge that an inclined spring holds, pressed along itself: an asymmetric bifurcation."""
    s = Sketch(rng, "stayed-bar")
    L, a, k = float(rng.uniform(200, 500)), float(rng.uniform(200, 500)), log_uniform(rng, 1.0, 10.0)
    s.body("bar", 1.0, (0, 0, L / 2))
    s.joint("foot", ("ground", "bar"), (0, 0, 0), (0, 1, 0))
    s.spring("stay", ("ground", "bar"), [(-a, 0, 0), (0, 0, L)], k)
    critical = k * (a * L / math.hypot(a, L)) ** 2 / L
    return Drawn(
        "point springs, stayed bar",
        seed,
        {MODEL: s.text("bar", (0, 0, L))},
        s.force(0, 0, -1),
        1.5 * critical,
        ("stay.stiffness_N_per_mm",),
        s.mass,
        critical=critical,
    )


def cables(rng: np.random.Generator, seed: int) -> Drawn:
    """A plate in a plane that four springs under tension hold."""
    s = Sketch(rng, "cables")
    for name in ("cx", "cz"):
        s.body(name)
    s.body("plate", float(rng.uniform(2, 8)), (0, 0, 0))
    s.joint("x", ("ground", "cx"), (0, 0, 0), (1, 0, 0), motion="slides")
    s.joint("z", ("cx", "cz"), (0, 0, 0), (0, 0, 1), motion="slides")
    s.joint("ry", ("cz", "plate"), (0, 0, 0), (0, 1, 0))
    k, stretch = log_uniform(rng, 5, 50), float(rng.uniform(0.002, 0.02))
    for i, (x, z) in enumerate([(-1, 1), (1, 1), (1, -1), (-1, -1)]):
        far = (x * float(rng.uniform(800, 1100)), 0, z * float(rng.uniform(700, 900)))
        near = (x * 100.0, 0, z * float(rng.choice([-1, 1])) * 60.0)
        s.spring(f"cable{i}", ("ground", "plate"), [far, near], k, stretch)
    return Drawn(
        "point springs, cables",
        seed,
        {MODEL: s.text("plate", (0, 0, 0))},
        s.force(rng.normal(), 0.0, rng.normal()),
        100.0 * k,
        ("cable0.stiffness_N_per_mm",),
        s.mass,
    )


def tied(rng: np.random.Generator, seed: int) -> Drawn:
    """Links on passive hinges that springs between points and a coupling hold."""
    s = Sketch(rng, "tied")
    at, last, centres = np.zeros(3), "ground", []
    for i in range(3):
        own = rng.uniform(-60, 180, 3)
        s.body(f"b{i}", float(rng.uniform(0.5, 3)), at + own / 2)
        s.joint(f"j{i}", (last, f"b{i}"), at, rng.normal(size=3))
        centres.append(at + own / 2)
        at, last = at + own, f"b{i}"
    for i in (0, 1, 2, 0):
        far = centres[i] + 200.0 * unit(*rng.normal(size=3))
        s.spring(
            f"s{len(s.tables.get('point_springs', []))}",
            ("ground", f"b{i}"),
            [far, centres[i] + rng.uniform(-20, 20, 3)],
            log_uniform(rng, 50, 300),
        )
    if rng.random() < 0.5:
        terms = [{"joint": f"j{i}", "weight": float(w)} for i, w in enumerate([1.0, *rng.uniform(0.5, 1.5, 2)])]
        s.add("couplings", {"name": "gear", "terms": terms, "total": 0.0})
    return Drawn(
        "point springs, tied links",
        seed,
        {MODEL: s.text(last, at)},
        s.force(*rng.normal(size=3)),
        2e4,
        ("s0.stiffness_N_per_mm",),
        s.mass,
    )


# --- carriages --------------------------------------------------------------------------------------------


def boom(rng: np.random.Generator, seed: int) -> Drawn:
    """A beam that comes out of its root."""
    length, d = float(rng.uniform(700, 1200)), float(rng.uniform(16, 26))
    out = float(rng.uniform(0.3, 0.9)) * length
    c = log_uniform(rng, 1e-5, 1e-3) if rng.random() < 0.5 else 0.0
    parts: list[Table] = [
        {"kind": "actuated", "name": "ext", "motion": "slides", "axis": "x", "compliance_mm_per_N": c},
        {
            "kind": "beam",
            "name": "tube",
            "length_mm": length,
            "free_length": "ext",
            "section": round_section(rng, d),
        },
    ]
    text = chain_text("boom", parts, postures={"home": {"ext": out}})
    inertia = 210_000.0 * math.pi / 64 * d**4
    critical = math.pi**2 * inertia / 4 / out**2
    mass = 7.85e-6 * math.pi / 4 * d**2 * out
    wrong = (f"ext={1.4 * length:.6g}", f"ext={-0.3 * length:.6g}")
    return Drawn(
        "boom",
        seed,
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        1.5 * critical,
        ("tube.section.diameter_mm",),
        mass,
        wrong_postures=wrong,
    )


def gantry(rng: np.random.Generator, seed: int) -> Drawn:
    """A carriage along a beam between two rails: one beam grows as the other one shrinks."""
    span, at = float(rng.uniform(900, 1500)), float(rng.uniform(0.2, 0.8))
    tube = {
        "shape": "rectangular_tube",
        "width_mm": 60.0,
        "thickness_mm": 40.0,
        "wall_mm": 4.0,
        "youngs_modulus_MPa": 70_000.0,
        "poissons_ratio": 0.33,
        "density_kg_per_m3": 2700.0,
    }

    def slide(name: str, axis: str, c: float, **more: Any) -> Table:
        return {
            "kind": "actuated",
            "name": name,
            "motion": "slides",
            "axis": axis,
            "compliance_mm_per_N": c,
            **more,
        }

    def block(name: str, kg: float) -> Table:
        return {
            "kind": "link",
            "name": name,
            "translation_mm": [0.0] * 3,
            "mass_kg": kg,
            "centre_of_mass_mm": [0.0] * 3,
        }

    def half(name: str, joint: str) -> Table:
        return {"kind": "beam", "name": name, "length_mm": span, "free_length": joint, "section": dict(tube)}

    parts = [
        slide("y1", "y", log_uniform(rng, 1e-5, 1e-4)),
        block("left", 8.0),
        slide("xc", "x", 0.0),
        half("beam-left", "xc"),
        block("carriage", 12.0),
        slide("x2", "x", 0.0),
        half("beam-right", "x2"),
        block("right", 8.0),
        slide("y2", "y", log_uniform(rng, 1e-5, 1e-4)),
        slide("zc", "z", log_uniform(rng, 1e-5, 1e-4), after="carriage"),
        block("flange", 6.0),
    ]
    closures = [
        {
            "name": "rail",
            "between": ["y2", ""],
            "holds": "weld",
            "frames": [{"position_mm": [0.0] * 3}, {"position_mm": [span, 0.0, 0.0]}],
        }
    ]
    x = at * span
    postures = {"home": {"y1": 0.0, "xc": x, "x2": span - x, "zc": 0.0, "y2": 0.0}}
    text = chain_text("gantry", parts, closures=closures, postures=postures)
    area = 60.0 * 40.0 - 52.0 * 32.0
    beyond = [f"y1=0,xc={v:.6g},x2={span - v:.6g},zc=0,y2=0" for v in (-0.2 * span, 1.2 * span)]
    return Drawn(
        "gantry",
        seed,
        {MODEL: text},
        (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0),
        2e4,
        ("y1.compliance_mm_per_N",),
        34.0 + 2.7e-6 * area * span,
        wrong_postures=tuple(beyond),
    )


KINDS: dict[str, Callable[[np.random.Generator, int], Drawn]] = {
    "arm": arm,
    "stretched arm": stretched_arm,
    "chain": column,
    "tree": tree,
    "geared arm": geared_arm,
    "stressed arm": stressed_arm,
    "planar loop, redundant": straight_bars,
    "planar loop, bent": bent_bars,
    "planar loop, released": released_bars,
    "planar loop, spring between points": sprung_knee,
    "planar four-bar": four_bar,
    "loop with a beam": beam_loop,
    "spatial loop": rssr,
    "Bennett's linkage": bennett,
    "hexapod": hexapod,
    "3-RPS": three_rps,
    "point springs, snap through": mises,
    "point springs, stayed bar": stayed_bar,
    "point springs, cables": cables,
    "point springs, tied links": tied,
    "boom": boom,
    "gantry": gantry,
}
"""In the order of the numbers: machine ``i`` is of kind ``i`` modulo their count."""


def drawn(seed: int, number: int) -> Drawn:
    """Machine ``number`` of a seed."""
    kind = list(KINDS)[number % len(KINDS)]
    return KINDS[kind](np.random.default_rng([seed, number]), number)
