"""Random machines of every kind, as the model files that commands read.

Each kind is a function of a random generator. Dimensions, places in the world, springs and loads are drawn anew
for every seed. A symmetric load is symmetric on purpose: it leads to a bifurcation. An inclined one leads to a
limit, or to none. `critical` is a closed form where there is one.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from contradictions.loops import (
    beam_loop,
    bennett,
    bent_bars,
    four_bar,
    hexapod,
    released_bars,
    rssr,
    sprung_knee,
    straight_bars,
    three_rps,
)
from contradictions.sketches import (
    HELD_END,
    MODEL,
    Drawn,
    Sketch,
    Table,
    chain_text,
    link,
    listed,
    log_uniform,
    part,
    round_section,
    unit,
)

# --- chains, arms, trees ----------------------------------------------------------------------------------


def arm(rng: np.random.Generator) -> Drawn:
    """Joints, links and beams in series with a free tip, under a force in any direction."""
    parts, held, mass = [], {}, 0.0
    for i in range(int(rng.integers(2, 5))):
        slides = i > 0 and rng.random() < 0.2
        key = "compliance_mm_per_N" if slides else "compliance_rad_per_Nmm"
        axis = str(rng.choice(["x", "y", "z"]))
        joint: Table = part("actuated", f"j{i}", axis=axis)
        joint |= {"motion": "slides"} if slides else {}
        joint[key] = log_uniform(rng, 1e-4, 1e-3) if slides else log_uniform(rng, 2e-8, 2e-7)
        if not slides and rng.random() < 0.4:
            joint["lateral_rad_per_Nmm"] = [log_uniform(rng, 1e-9, 3e-8) for _ in range(2)]
        parts.append(joint)
        held[f"j{i}"] = float(rng.uniform(-20, 20) if slides else rng.uniform(-1.2, 1.2))
        if rng.random() < 0.5:
            length = float(rng.uniform(150, 400))
            parts.append(
                part("beam", f"b{i}", length_mm=length, section=round_section(rng, float(rng.uniform(14, 25))))
            )
            diameter = parts[-1]["section"]["diameter_mm"]
            mass += 7.85e-6 * math.pi / 4 * diameter**2 * length
        else:
            kg = float(rng.uniform(0.5, 4.0))
            parts.append(link(f"l{i}", listed(rng.uniform(80, 300, 3)), kg, listed(rng.uniform(-80, 80, 3))))
            mass += kg
    text = chain_text("arm", parts, postures={"home": held})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn({MODEL: text}, force, bending_force(3e-7, 600.0), (_first_key(parts),), mass)


def bending_force(compliance: float, reach: float) -> float:
    """N, under which a joint of such a compliance (rad/(N mm)) turns by half a radian or so at such an arm (mm)."""
    return 0.5 / (compliance * reach)


def _first_key(parts: list[Table]) -> str:
    for table in parts:
        for key in table:
            if key.startswith("compliance_"):
                return f"{table['name']}.{key}"
    raise AssertionError("no joint has a compliance")


def stretched_arm(rng: np.random.Generator) -> Drawn:
    """A planar arm stretched along its force, which presses: a bifurcation."""
    parts: list[Table] = []
    stiffness, length, mass, springs = 0.0, 0.0, 0.0, []
    for i in range(int(rng.integers(1, 4))):
        k, own, kg = log_uniform(rng, 3e6, 3e7), float(rng.uniform(150, 400)), float(rng.uniform(0.5, 3.0))
        parts.append(part("actuated", f"j{i}", axis="z", compliance_rad_per_Nmm=1.0 / k))
        parts.append(link(f"l{i}", [own, 0.0, 0.0], kg, [own / 2, 0.0, 0.0]))
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
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        1.5 * critical,
        ("j0.compliance_rad_per_Nmm", "l0.translation_mm.1"),
        mass,
        critical=critical,
    )


def column(rng: np.random.Generator) -> Drawn:
    """A chain with passive joints, whose end has to be held."""
    length = float(rng.uniform(300, 700))
    beam = part("beam", "link", length_mm=length, section=round_section(rng, rng.uniform(10, 20)))
    parts = [
        part("actuator", "drive", axis="x", compliance_mm_per_N=log_uniform(rng, 1e-5, 1e-4)),
        part("joint", "u1", axis="y"),
        part("joint", "u2", axis="z"),
        beam,
        part("joint", "u3", axis="z"),
        part("joint", "u4", axis="y"),
    ]
    bent = rng.random() < 0.5
    angles = [0.2, 0.3, -0.3, -0.2] if bent else [0.0] * 4
    text = chain_text("column", parts, postures={"home": angles})
    diameter = beam["section"]["diameter_mm"]
    euler = math.pi**2 * 210_000.0 * math.pi / 64 * diameter**4 / length**2
    mass = 7.85e-6 * math.pi / 4 * diameter**2 * length
    return Drawn(
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        euler,
        ("drive.compliance_mm_per_N", "link.section.diameter_mm"),
        mass,
        end=HELD_END,
    )


def tree(rng: np.random.Generator) -> Drawn:
    """A stem with two arms; the loaded one is the last."""
    drawn = [float(rng.uniform(150, 300)) for _ in range(3)]
    kg = [float(rng.uniform(0.5, 4.0)) for _ in range(3)]

    def own_link(name: str, i: int) -> Table:
        return link(name, [drawn[i], 20.0 * i, 0.0], kg[i], [drawn[i] / 2, 0.0, 10.0])

    def joint(name: str, axis: str, **more: Any) -> Table:
        return part("actuated", name, axis=axis, compliance_rad_per_Nmm=log_uniform(rng, 3e-8, 3e-7), **more)

    parts = [
        joint("pan", "y"),
        own_link("stem", 0),
        joint("right", "z"),
        own_link("counter", 1),
        joint("left", "z", after="stem"),
        own_link("hand", 2),
    ]
    q = {name: float(rng.uniform(-0.8, 0.8)) for name in ("pan", "right", "left")}
    text = chain_text("tree", parts, postures={"home": q})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn(
        {MODEL: text},
        force,
        bending_force(5e-7, 400.0),
        ("left.compliance_rad_per_Nmm", "stem.translation_mm.1"),
        sum(kg),
    )


def geared_arm(rng: np.random.Generator) -> Drawn:
    """An arm with a joint that follows another one."""
    kg = [float(rng.uniform(0.5, 4.0)) for _ in range(3)]
    parts: list[Table] = []
    for i in range(3):
        c = log_uniform(rng, 3e-8, 3e-7)
        if i == 1:
            parts.append(
                part(
                    "coupled",
                    "j1",
                    axis="y",
                    to={"j0": float(rng.uniform(-1.5, 1.5))},
                    coupling=str(rng.choice(["as deflected", "as commanded"])),
                    compliance_rad_per_Nmm=c,
                )
            )
        else:
            parts.append(part("actuated", f"j{i}", axis="y" if i == 0 else "z", compliance_rad_per_Nmm=c))
        parts.append(link(f"l{i}", [float(rng.uniform(100, 300)), 0.0, 30.0], kg[i], [50.0, 0.0, 0.0]))
    q = {"j0": float(rng.uniform(-0.8, 0.8)), "j2": float(rng.uniform(-0.8, 0.8))}
    text = chain_text("geared-arm", parts, postures={"home": q})
    force = (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0)
    return Drawn(
        {MODEL: text},
        force,
        bending_force(5e-7, 500.0),
        ("j0.compliance_rad_per_Nmm", "l1.translation_mm.1"),
        sum(kg),
    )


def stressed_arm(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        last,
        at,
        s.force(*rng.normal(size=3)),
        bending_force(5e-7, 400.0),
        ("j0.stiffness_Nmm_per_rad", "stay.stiffness_N_per_mm"),
    )


# --- springs between points alone -------------------------------------------------------------------------


def mises(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        "apex", (0, 0, h), s.force(0, 0, -1), 2.0 * critical, ("left.stiffness_N_per_mm",), critical=critical
    )


def stayed_bar(rng: np.random.Generator) -> Drawn:
    """A bar on a hinge that an inclined spring holds, pressed along itself: an asymmetric bifurcation."""
    s = Sketch(rng, "stayed-bar")
    L, a, k = float(rng.uniform(200, 500)), float(rng.uniform(200, 500)), log_uniform(rng, 1.0, 10.0)
    s.body("bar", 1.0, (0, 0, L / 2))
    s.joint("foot", ("ground", "bar"), (0, 0, 0), (0, 1, 0))
    s.spring("stay", ("ground", "bar"), [(-a, 0, 0), (0, 0, L)], k)
    critical = k * (a * L / math.hypot(a, L)) ** 2 / L
    return s.drawn(
        "bar", (0, 0, L), s.force(0, 0, -1), 1.5 * critical, ("stay.stiffness_N_per_mm",), critical=critical
    )


def cables(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        "plate", (0, 0, 0), s.force(rng.normal(), 0.0, rng.normal()), 100.0 * k, ("cable0.stiffness_N_per_mm",)
    )


def tied(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(last, at, s.force(*rng.normal(size=3)), 2e4, ("s0.stiffness_N_per_mm",))


# --- carriages --------------------------------------------------------------------------------------------


def boom(rng: np.random.Generator) -> Drawn:
    """A beam that comes out of its root."""
    length, d = float(rng.uniform(700, 1200)), float(rng.uniform(16, 26))
    out = float(rng.uniform(0.3, 0.9)) * length
    c = log_uniform(rng, 1e-5, 1e-3) if rng.random() < 0.5 else 0.0
    parts: list[Table] = [
        part("actuated", "ext", motion="slides", axis="x", compliance_mm_per_N=c),
        part("beam", "tube", length_mm=length, free_length="ext", section=round_section(rng, d)),
    ]
    text = chain_text("boom", parts, postures={"home": {"ext": out}})
    inertia = 210_000.0 * math.pi / 64 * d**4
    critical = math.pi**2 * inertia / 4 / out**2
    mass = 7.85e-6 * math.pi / 4 * d**2 * out
    wrong = (f"ext={1.4 * length:.6g}", f"ext={-0.3 * length:.6g}")
    return Drawn(
        {MODEL: text},
        (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        1.5 * critical,
        ("tube.section.diameter_mm",),
        mass,
        wrong_postures=wrong,
    )


def gantry(rng: np.random.Generator) -> Drawn:
    """A carriage along a beam between two rails: it rides on it, or one beam grows as the other one shrinks."""
    span, at, rides = float(rng.uniform(900, 1500)), float(rng.uniform(0.2, 0.8)), bool(rng.random() < 0.5)
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
        return part("actuated", name, motion="slides", axis=axis, compliance_mm_per_N=c, **more)

    def block(name: str, kg: float) -> Table:
        return link(name, [0.0] * 3, kg, [0.0] * 3)

    def half(name: str, joint: str) -> Table:
        return part("beam", name, length_mm=span, free_length=joint, section=dict(tube))

    left = [slide("y1", "y", log_uniform(rng, 1e-5, 1e-4)), block("left", 8.0)]
    right = [block("right", 8.0), slide("y2", "y", log_uniform(rng, 1e-5, 1e-4))]
    carriage = block("carriage", 12.0)
    ram = [slide("zc", "z", log_uniform(rng, 1e-5, 1e-4), after="carriage"), block("flange", 6.0)]
    if rides:
        beam: Table = part("beam", "beam", length_mm=span, section=dict(tube))
        guide = slide("xc", "x", log_uniform(rng, 1e-5, 1e-4), rides_on="beam", lateral_rad_per_Nmm=[1e-8, 2e-8])
        parts = [*left, beam, *right, guide, carriage, *ram]
    else:
        halves = slide("xc", "x", 0.0), half("beam-left", "xc"), slide("x2", "x", 0.0), half("beam-right", "x2")
        parts = [*left, *halves[:2], carriage, *halves[2:], *right, *ram]
    closures = [
        {
            "name": "rail",
            "between": ["y2", ""],
            "holds": "weld",
            "frames": [{"position_mm": [0.0] * 3}, {"position_mm": [span, 0.0, 0.0]}],
        }
    ]
    x = at * span
    other = {} if rides else {"x2": span - x}
    postures = {"home": {"y1": 0.0, "xc": x, **other, "zc": 0.0, "y2": 0.0}}
    text = chain_text("gantry", parts, closures=closures, postures=postures)
    area = 60.0 * 40.0 - 52.0 * 32.0
    beyond = [
        f"y1=0,xc={v:.6g},{'' if rides else f'x2={span - v:.6g},'}zc=0,y2=0" for v in (-0.2 * span, 1.2 * span)
    ]
    return Drawn(
        {MODEL: text},
        (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0),
        2e4,
        ("y1.compliance_mm_per_N", *(["beam.section.wall_mm"] if rides else [])),
        34.0 + 2.7e-6 * area * span,
        wrong_postures=tuple(beyond),
    )


KINDS: dict[str, Callable[[np.random.Generator], Drawn]] = {
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
    return replace(KINDS[kind](np.random.default_rng([seed, number])), kind=kind, seed=number)
