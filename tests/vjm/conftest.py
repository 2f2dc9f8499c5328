"""The chains that the tests share, built by hand from parts: independent of the model files and their loader."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from vjm.continuation.path import Path
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Placement, RigidOffset, Section
from vjm.rotations import AXES, displaced, frame, rotation_from_vector, translation
from vjm.statics import Configuration, solve_newton

# Derandomised: a failure on one machine is a failure on all. No deadline: the machines are shared.
settings.register_profile("vjm", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("vjm")

FOOT_ENTRIES = {
    (1, 1): 28e-5, (1, 2): -33e-5, (2, 2): 41e-5, (1, 6): -40e-7, (2, 6): 54e-7, (3, 3): 19e-4,
    (3, 4): 11e-6, (3, 5): -15e-6, (4, 4): 23e-8, (5, 5): 23e-8, (6, 6): 84e-9,
}  # fmt: skip
"""The paper's (19)."""
LINK_ENTRIES = {
    (1, 1): 46e-6, (2, 2): 23e-2, (2, 6): 11e-4, (3, 3): 51e-3, (3, 5): -24e-5,
    (4, 4): 29e-6, (5, 5): 15e-7, (6, 6): 72e-7,
}  # fmt: skip
"""The paper's (20), of one bar, with the misprint in (2,6) corrected."""
LINK_LENGTH = 310.0


def symmetric(entries: dict[tuple[int, int], float]) -> np.ndarray:
    """Matrix (6, 6) from its printed entries, counted from one."""
    k = np.zeros((6, 6))
    for (i, j), value in entries.items():
        k[i - 1, j - 1] = k[j - 1, i - 1] = value
    return k


def paper_chain() -> Machine:
    """The chain of (19) to (22) with Table I's postures; sections are such that L/EA, L/GJ, L/EI are (20)'s."""
    L = LINK_LENGTH
    foot = Beam(
        "foot", 146.5,
        own_frame=rotation_from_vector([-np.pi / 2.0, 0.0, 0.0]),
        section_frame=rotation_from_vector([0.0, 0.0, np.deg2rad(50.3)]),
        end_offset=np.array([17.57, -8.74, 0.0]),
        compliance=symmetric(FOOT_ENTRIES),
        section=Section(EA=7.5e7, GJ=6.40e8, EIy=6.32e8, EIz=1.744e9),
        own_segments=1,
    )  # fmt: skip
    link = Beam(
        "link", L,
        own_frame=rotation_from_vector([np.pi / 2.0, 0.0, 0.0]),
        compliance=symmetric(LINK_ENTRIES),
        section=Section(EA=L / 46e-6, GJ=L / 29e-6, EIy=L / 15e-7, EIz=L / 72e-7),
        count=2,
    )  # fmt: skip
    joints = [
        Joint(name, AXES[axis], passive=True) for name, axis in zip(("q1", "q2", "q3", "q4"), "yzzy", strict=True)
    ]
    a = np.pi / 6.0
    return Machine(
        "orthoglide-chain",
        (Joint("actuator", AXES["x"], slides=True, fixed=True), foot, *joints[:2], link, *joints[2:]),
        base=translation(-foot.tip),
        postures={
            "A": np.zeros(4),
            "B": np.array([0.0, a, -a, 0.0]),
            "C": np.array([a, 0.0, 0.0, -a]),
            "D": np.array([a, a, -a, -a]),
        },
    )


@pytest.fixture(scope="session")
def chain() -> Machine:
    return paper_chain()


@pytest.fixture(scope="session")
def foot_printed() -> dict[tuple[int, int], float]:
    return FOOT_ENTRIES


@pytest.fixture(scope="session")
def column() -> Machine:
    """A pinned column whose two pins turn about z; 100 mm, P_E = 1000 N, rigid in shear, EA/P_E = 1000."""
    EI = 1000.0 * 100.0**2 / np.pi**2
    section = Section(EA=1e6, GJ=EI, EIy=20.0 * EI, EIz=EI)
    return Machine(
        "column",
        (
            Joint("q1", AXES["z"], passive=True),
            Beam("link", 100.0, section=section),
            Joint("q2", AXES["z"], passive=True),
        ),
        postures={"straight": np.zeros(2)},
    )


@pytest.fixture(scope="session")
def trace(chain: Machine) -> Callable[..., Path]:
    """Path of the paper's chain, traced once for all tests that ask for the same."""
    known: dict[tuple, Path] = {}

    def traced(
        posture: str, to: float, segments: int | None = None, foot: int | None = None,
        placement: str = "best", **ramp,
    ) -> Path:  # fmt: skip
        key = (posture, to, segments, foot, placement, *sorted(ramp.items()))
        if key not in known:
            engine = VjmEngine(segments, foot, Placement(placement))
            known[key] = engine.trace(chain, LoadCase(posture, to, **ramp))
        return known[key]

    return traced


@pytest.fixture(scope="session")
def state(chain: Machine, trace) -> Callable[..., Configuration]:
    """The stable equilibrium of the paper's chain at a displacement, as a configuration."""

    def at(posture: str, to: float, segments: int | None = None, placement: str = "best", **ramp) -> Configuration:
        point = trace(posture, to, segments, placement=placement, **ramp).points[-1]
        model = VjmEngine(segments, placement=Placement(placement)).model(chain)
        return Configuration(
            model,
            point.state[: model.size],
            point.state[model.size : model.size + 6],
            point.residual,
            point.iterations,
        )

    return at


@pytest.fixture(scope="session")
def straight(chain: Machine) -> Callable[[float], Configuration]:
    """The unbuckled equilibrium of the paper's posture A, stable or not, reached in steps too small to leave it."""
    model = Mechanism(chain)

    def at(to: float) -> Configuration:
        start = model.configuration(chain.posture("A"))
        pose = model.kinematics(start).end
        x, wrench = start, np.zeros(6)
        for s in np.linspace(0.0, to, 6)[1:]:
            found = solve_newton(model, displaced(pose, [s, 0, 0, 0, 0, 0]), x, wrench)
            x, wrench = found.x, found.wrench
        return found

    return at


# --- random chains --------------------------------------------------------------------------------


def unit_vector(rng: np.random.Generator) -> np.ndarray:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    return rotation_from_vector(unit_vector(rng) * rng.uniform(0.0, 3.0))


def random_section(rng: np.random.Generator, *, shear: bool) -> Section:
    """A steel or aluminium bar some 10 mm thick; shear stiffnesses a third of EA where they count."""
    EA, GJ, EIy, EIz = 10.0 ** rng.uniform([6.0, 7.0, 7.0, 7.0], [7.5, 8.5, 8.5, 8.5])
    return Section(EA, GJ, EIy, EIz, EA / 3.0, EA / 4.0) if shear else Section(EA, GJ, EIy, EIz)


def random_part(kind: str, name: str, rng: np.random.Generator):
    match kind:
        case "offset":
            return RigidOffset(name, frame(random_rotation(rng), rng.uniform(-100.0, 100.0, 3)))
        case "joint":
            return Joint(name, unit_vector(rng), passive=True)
        case "actuator":
            return Joint(
                name, unit_vector(rng), slides=True, fixed=True, compliance=10.0 ** rng.uniform(-6.0, -3.0)
            )
    beam = Beam(
        name, rng.uniform(50.0, 400.0), random_rotation(rng), random_rotation(rng),
        rng.uniform(-20.0, 20.0, 3), random_section(rng, shear=bool(rng.integers(2))),
        count=int(rng.integers(1, 3)),
    )  # fmt: skip
    if kind == "matrix":
        # some symmetric positive definite matrix of a beam's size, and not a beam's
        k = beam.beam_compliance()
        size = np.sqrt(np.diag(k))
        mixed = np.eye(6) + 0.1 * rng.standard_normal((6, 6))
        return replace(beam, section=None, compliance=size[:, None] * (mixed @ mixed.T) * size)
    return beam


@st.composite
def random_chains(draw: st.DrawFn) -> Machine:
    """Chains of up to eight parts with at least one beam, at most three passive joints; posture ``p``."""
    kinds = draw(st.lists(st.sampled_from(["offset", "actuator", "beam", "matrix"]), max_size=4))
    kinds += ["joint"] * draw(st.integers(0, 3)) + [draw(st.sampled_from(["beam", "matrix"]))]
    kinds = draw(st.permutations(kinds))
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    parts = [random_part(kind, f"{kind}{i}", rng) for i, kind in enumerate(kinds)]
    base = frame(random_rotation(rng), rng.uniform(-50.0, 50.0, 3))
    posture = rng.uniform(-1.5, 1.5, kinds.count("joint"))
    return Machine("random", tuple(parts), base, {"p": posture})


@pytest.fixture(scope="session")
def chains() -> st.SearchStrategy[Machine]:
    return random_chains()


@pytest.fixture(scope="session")
def loaded_states() -> st.SearchStrategy[tuple[Mechanism, np.ndarray, np.ndarray]]:
    """Lumped models with some joint coordinates (springs deformed by up to 0.3 rad and 20 mm) and some wrench."""

    @st.composite
    def draw_state(draw: st.DrawFn):
        chain = draw(random_chains())
        n = draw(st.integers(1, 3))
        placement = draw(st.sampled_from(list(Placement)))
        model = Mechanism(chain.refined({b.name: n for b in chain.beams if b.section}, placement))
        rng = np.random.default_rng(draw(st.integers(0, 2**31)))
        x = np.where(model.rotary, 0.3, 20.0) * rng.uniform(-1.0, 1.0, model.size)
        x[model.passive] = chain.posture("p")
        return model, x, rng.standard_normal(6) * np.repeat([1e3, 1e5], 3)

    return draw_state()
