"""Rank by the gap in singular values, and what follows from it on loops that hold some directions several times."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.file_texts import model_text, table_text

import vjm
from vjm.analysis import trace
from vjm.continuation.path import EventKind
from vjm.design.critical import critical_state
from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.sensitivity import DesignQuantity, compliance, derivative_at
from vjm.engines import VjmEngine
from vjm.io.files import toml_text
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.load_case import COMPONENTS, LOAD, Load, LoadCase
from vjm.model.parameters import Parameter
from vjm.rank import decided, least_norm, null_space, rank_of, span
from vjm.rotations import rotation_from_vector


@pytest.mark.parametrize(
    ("values", "rank"),
    [
        ([], 0),
        ([3e-17, 1e-18], 0),  # all rounding
        ([1.0, 0.5, 1e-3], 3),
        ([1.0, 0.5, 1e-6], 3),  # a posture near a singular one is regular
        ([1.0, 0.5, 2e-16], 2),
        ([1.0, 0.5, 1e-11, 3e-12], 2),  # a file of twelve digits
        ([1e-5, 2e-6, 1e-21], 2),  # a small mechanism on a long arm
    ],
)
def test_the_rank_is_where_singular_values_part(values, rank):
    assert decided(np.array(values), 6)[0] == rank


def test_null_space_span_and_least_norm_agree_on_it():
    rng = np.random.default_rng(5)
    A = rng.standard_normal((4, 3)) @ rng.standard_normal((3, 7))
    A = np.vstack([A, A[0] + 2.0 * A[1]])
    found = rank_of(A)
    # rounding of products of a few numbers is some 1e-15 of them
    assert found.rank == 3
    assert found.gap > 1e12
    assert np.abs(A @ null_space(A)).max() < 1e-13
    assert null_space(A).shape == (7, 4)
    assert span(A).shape == (5, 3)
    b = A @ rng.standard_normal(7)
    x = least_norm(A[None], b[None])[0]
    np.testing.assert_allclose(x, np.linalg.pinv(A, rcond=1e-10) @ b, atol=1e-12)


def two_bars(rng: np.random.Generator, stiffness: float, file):
    """Two bars of rigid links in line between a hinge and a guide, a spring in the knee; and its critical load.

    With angles φ and ψ of the bars, ``a sin φ = b sin ψ``, the energy is ``½ K (φ + ψ)²`` and the head comes down
    by ``a (1 − cos φ) + b (1 − cos ψ)``: to second order the load is ``K (1/a + 1/b)``. In space the loop holds
    three of its six directions twice.
    """
    a, b = rng.uniform(100.0, 600.0, 2)
    R = rotation_from_vector(rng.uniform(-1.0, 1.0, 3))

    def place(z):
        return (R @ [0.0, 0.0, z]).tolist()

    content = {
        "format": 1, "kind": "bodies", "name": "two-bars", "title": "two bars", "source": "closed form",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "end": {"body": "head", "at_mm": place(a + b)},
        "bodies": [{"name": name} for name in ("lo", "up", "head")],
        "joints": [
            {"name": "foot", "between": ["ground", "lo"], "at_mm": place(0.0), "axis": R[:, 1].tolist()},
            {"name": "knee", "between": ["lo", "up"], "at_mm": place(a), "axis": R[:, 1].tolist(),
             "stiffness_Nmm_per_rad": stiffness},
            {"name": "top", "between": ["up", "head"], "at_mm": place(a + b), "axis": R[:, 1].tolist()},
            {"name": "guide", "between": ["ground", "head"], "at_mm": place(a + b), "axis": R[:, 2].tolist(),
             "motion": "slides"},
        ],
    }  # fmt: skip
    file.write_text(toml_text(content), encoding="utf-8")
    return vjm.load(file), R, stiffness * (1.0 / a + 1.0 / b)


def hexapod(rng: np.random.Generator, compliances, file):
    """A hexapod of sliding legs, and the motion ``(6, 6)`` of its end by the extension of each leg."""
    end, toml, rows = np.array([0.0, 0.0, 450.0]), [], []
    for i, c in enumerate(compliances):
        around, above = np.pi / 3.0 * i + rng.uniform(-0.2, 0.2), np.pi / 3.0 * (i + (1, -1)[i % 2] * 0.6)
        foot = np.array([300.0 * np.cos(around), 300.0 * np.sin(around), rng.uniform(-20.0, 20.0)])
        head = np.array([150.0 * np.cos(above), 150.0 * np.sin(above), 400.0 + rng.uniform(-20.0, 20.0)])
        u = (head - foot) / np.linalg.norm(head - foot)
        rows.append(np.concatenate([u, np.cross(head - end, u)]))
        first = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        middle = 0.5 * (foot + head)
        toml += [
            table_text("[bodies]", name=f"lower{i}"),
            table_text("[bodies]", name=f"upper{i}"),
            table_text(
                "[joints]", name=f"universal{i}", between=["ground", f"lower{i}"], kind="universal",
                at_mm=foot.tolist(), axes=first[:2].tolist(),
            ),
            table_text(
                "[joints]", name=f"slide{i}", between=[f"lower{i}", f"upper{i}"], at_mm=middle.tolist(),
                axis=u.tolist(), motion="slides", kind="actuated", compliance_mm_per_N=float(c),
            ),
            table_text(
                "[joints]", name=f"ball{i}", between=[f"upper{i}", "platform"], at_mm=head.tolist(), kind="ball"
            ),
        ]  # fmt: skip
    platform, frame = table_text("[bodies]", name="platform"), {"body": "platform", "at_mm": end.tolist()}
    file.write_text(model_text("hexapod", platform, *toml, kind="bodies", end=frame), encoding="utf-8")
    return vjm.load(file), np.linalg.inv(rows)


@pytest.mark.parametrize("stiffness", [1e-3, 1e6, 1e13])
def test_a_loop_of_rigid_bars_buckles_at_its_closed_form(stiffness, tmp_path):
    rng = np.random.default_rng(7)
    machine, R, load = two_bars(rng, stiffness, tmp_path / "bars.toml")
    mobility = LoopClosure(machine, "drawn").mobility(LoopClosure(machine, "drawn").home)
    # in line the head does not move to first order
    assert (mobility.redundant, mobility.freedom) == (3, 0)
    down = [*(-R[:, 2]).tolist(), 0.0, 0.0, 0.0]
    case = LoadCase("drawn", 2.0 * load, axis=LOAD, free=COMPONENTS, loads=(Load(tuple(down)),))
    path = trace(machine, case, VjmEngine(4))
    # located to 1e-6 of the path, which is twice as long
    # the load moves nothing before: its stiffness is infinite, and has no knee
    assert path.critical.kind is EventKind.BIFURCATION
    assert np.all(np.isinf([point.tangent for point in path.points if point.ramp < load]))
    assert path.critical.point.ramp == pytest.approx(load, rel=1e-5)
    assert path.points[0].unstable == 0
    found = critical_state(loaded_posture(machine, wrench=tuple(load * v for v in down)))
    # Newton's method ends at 1e-11 of the factor
    assert found.factor == pytest.approx(1.0, rel=1e-9)


def test_the_smallest_eigenvalue_of_one_motion_is_that_of_the_dense_tangent(tmp_path):
    machine, R, load = two_bars(np.random.default_rng(3), 2e5, tmp_path / "bars.toml")
    down = [*(-R[:, 2]).tolist(), 0.0, 0.0, 0.0]
    case = LoadCase("drawn", 1.6 * load, axis=LOAD, free=COMPONENTS, loads=(Load(tuple(down)),))
    engine = VjmEngine(4)
    problem, path = engine.problem(machine, case), trace(machine, case, engine)
    branch = [point for point in path.points if point.ramp > 1.1 * load]
    assert len(branch) > 3
    for point in branch:
        at = problem.configuration(point)
        S = problem.model.compiled.inverse(at.x, at.wrench, at.load)
        inverse = np.linalg.eigvalsh(0.5 * (S + S.T))
        # iterated to a relative residual of 3e-5, whose square is the error
        assert point.eigenvalue == pytest.approx(1.0 / inverse[-1], rel=1e-8)


def test_compliances_of_many_decades_are_no_matter_of_rank(tmp_path):
    """A leg's extension moves the platform by geometry alone: by the inverse of the legs' lengths' derivatives."""
    rng = np.random.default_rng(11)
    compliances = 10.0 ** rng.permutation([-14.0, -11.0, -8.0, -6.0, -4.0, -3.0])
    machine, moves = hexapod(rng, compliances, tmp_path / "hexapod.toml")
    wrench = rng.uniform(-1.0, 1.0, 6) * np.repeat([1.0, 100.0], 3)
    asked = loaded_posture(machine, wrench=(1e-3 * wrench).tolist())
    state = state_of(asked)
    expected = (moves * compliances) @ moves.T
    unit = np.repeat([300.0, 1.0], 3)
    np.testing.assert_allclose(
        compliance(state) / unit[:, None] / unit, expected / unit[:, None] / unit,
        atol=1e-6 * np.abs(expected / unit[:, None] / unit).max(),  # deflections are large by that
    )  # fmt: skip
    # each rod turns between its two joints, and nothing feels it
    assert state.neutral.shape[1] == 0
    for i in range(6):
        by_leg = moves[:, i] * (moves[:, i] @ (1e-3 * wrench))
        part = next(part for part in machine.parts if part.name == f"slide{i}")

        def changed(m, value, part=part):
            parts = tuple(replace(p, compliance=value) if p.name == part.name else p for p in m.parts)
            return replace(m, parts=parts)

        parameter = Parameter(part.name, "mm/N", part.compliance, part.compliance, changed)
        found = derivative_at(asked, parameter, DesignQuantity.DEFLECTION, "y")
        # second order in the deflection
        assert found == pytest.approx(by_leg[1], rel=1e-5), i
