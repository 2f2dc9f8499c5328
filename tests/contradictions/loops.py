"""Planar and spatial loops, drawn at random; straight bars with their critical loads in closed form."""

import math

import numpy as np

from contradictions.sketches import (
    MODEL,
    UNITS,
    Drawn,
    Sketch,
    chain_text,
    link,
    listed,
    log_uniform,
    part,
    round_section,
    unit,
)
from vjm.io.files import toml_text
from vjm.rotations import rotation_from_vector, rotation_vector

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


def straight_bars(rng: np.random.Generator) -> Drawn:
    """Two or three bars in a line between a foot and a guide: planar, overconstrained, a bifurcation."""
    s = Sketch(rng, "straight-bars")
    lengths, springs = _bars(rng, s, int(rng.integers(2, 4)), 0.0, redundant=True)
    critical = _bars_critical(lengths, springs)
    return s.drawn(
        "head", s.tip, s.force(0, 0, -1), 1.5 * critical, ("knee1.stiffness_Nmm_per_rad",), critical=critical
    )


def bent_bars(rng: np.random.Generator) -> Drawn:
    """The same bars with a bend."""
    s = Sketch(rng, "bent-bars")
    lengths, springs = _bars(rng, s, 2, float(rng.uniform(0.1, 0.5)), redundant=True)
    return s.drawn(
        "head", s.tip, s.force(0, 0, -1), _bars_critical(lengths, springs), ("knee1.stiffness_Nmm_per_rad",)
    )


def released_bars(rng: np.random.Generator) -> Drawn:
    """The same bars with joints that leave no constraint redundant."""
    s = Sketch(rng, "released-bars")
    lengths, springs = _bars(rng, s, 2, 0.0, redundant=False)
    critical = _bars_critical(lengths, springs)
    return s.drawn(
        "head", s.tip, s.force(0, 0, -1), 1.5 * critical, ("knee1.stiffness_Nmm_per_rad",), critical=critical
    )


def sprung_knee(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        "head",
        (0, 0, own + far),
        s.force(0, 0, -1),
        1.5 * critical,
        ("stay.stiffness_N_per_mm",),
        critical=critical,
    )


def four_bar(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        "coupler",
        P,
        s.force(rng.normal(), 0.3 * rng.normal(), rng.normal()),
        0.3 / c / 200.0,
        ("motor.compliance_rad_per_Nmm",),
    )


def beam_loop(rng: np.random.Generator) -> Drawn:
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
    return s.drawn(
        "rocker",
        C,
        s.force(rng.normal(), 0.0, rng.normal()),
        0.3 / c / 200.0,
        ("motor.compliance_rad_per_Nmm", "coupler.section.diameter_mm"),
    )


# --- spatial loops ----------------------------------------------------------------------------------------


def rssr(rng: np.random.Generator) -> Drawn:
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
    return s.drawn("rocker", C, s.force(*rng.normal(size=3)), 0.3 / c / 200.0, ("motor.compliance_rad_per_Nmm",))


def bennett(rng: np.random.Generator) -> Drawn:
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
    return s.drawn("b1", places[2], s.force(*rng.normal(size=3)), 0.3 / c / 200.0, ("h0.compliance_rad_per_Nmm",))


def hexapod(rng: np.random.Generator) -> Drawn:
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
            part("joint", "u1", axis="y"),
            part("joint", "u2", axis="z"),
            part("payload", "lo", mass_kg=low, centre_of_mass_mm=[100.0, 0.0, 0.0]),
            part("actuator", "slide", axis="x", compliance_mm_per_N=c),
            link("up", [length, 0.0, 0.0], up, [length - 100.0, 0.0, 0.0]),
            *(part("joint", f"s{k}", axis=axis) for k, axis in enumerate("xyz", start=1)),
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
        files,
        (*unit(*rng.normal(size=3)), 0.0, 0.0, 0.0),
        1e4,
        ("s0.compliance_mm_per_N",),
        s.mass,
        twin="legs.toml",
    )


def three_rps(rng: np.random.Generator) -> Drawn:
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
    return s.drawn("plat", (0, 0, height + 30.0), s.force(*rng.normal(size=3)), 1e4, ("s0.compliance_mm_per_N",))
