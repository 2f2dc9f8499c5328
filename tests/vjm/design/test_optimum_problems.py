"""Optima of ten problems as by trying all machines of a grid; held tools, costs, weights, fronts, finer models."""

import itertools

import numpy as np
import pytest

import vjm
from vjm.design.optimum import Confirmation, confirmed, limits_of
from vjm.design.sensitivity import reach
from vjm.design.space import Cost, coordinates, design_space, held_tool
from vjm.design.sweep import SMALLER_IS_BETTER, asked, swept
from vjm.io.file_parameters import MachineFiles
from vjm.machine.rigid_mechanism import RigidMechanism

FEW = vjm.VjmEngine(1)
PUSH = [(0.0, -50.0, 0.0, 0.0, 0.0, 0.0)]
ASIDE = [(0.0, -50.0, 0.0, 0.0, 0.0, 0.0), (-30.0, 20.0, 0.0, 0.0, 0.0, 0.0)]
WIDE = {"upper.section.width_mm": (40.0, 90.0), "fore.section.width_mm": (30.0, 70.0)}
LONG = {"upper.length_mm": (350.0, 800.0), "fore.length_mm": (250.0, 700.0)}
TUBES = [{"name": f"{b}x{w}", "width_mm": float(b), "wall_mm": float(w), "cost": float(c)}
         for b, w, c in ((40, 2, 9), (45, 3, 4), (60, 2, 6), (60, 4, 11), (80, 3, 7))]  # fmt: skip
PRICE = "parts + 3.0*mass"

# what is made best, its limits, what varies, and what else is asked for
PROBLEMS = {
    "lightest": ("mass", "deflection<=29.0", WIDE, {}),
    "lightest of a frequency": ("mass", "frequency>=4.3", WIDE, {}),
    "stiffest of a mass": ("stiffness.y", "mass<=3.3", WIDE, {}),
    "fastest": ("frequency", "mass<=3.3", WIDE, {}),
    "cheapest": ("cost", "deflection<=29.0", WIDE, {"cost": "4.0*mass + 0.02*upper.section.width_mm"}),
    "weighted": ("deflection", "mass<=3.3", WIDE, {"wrenches": ASIDE, "weights": (1.0, 3.0)}),
    "of a reach": ("deflection", "reach>=900", LONG, {}),
    "of held tools": ("mass", "deflection<=8; reach>=800", LONG, {"postures": ["bent"], "hold_tool": True}),
    "lightest of a catalogue": ("mass", "deflection<=29.0", {"upper.section": TUBES, "fore.section": TUBES}, {}),
    "cheapest of a catalogue": (
        "cost", "deflection<=29.5", {"upper.section": TUBES, "fore.section": TUBES}, {"cost": PRICE},
    ),
}  # fmt: skip
POINTS = 13
"""Values of each number on a grid."""


def case_of(more):
    own = {key: value for key, value in more.items() if key != "cost"}
    cases = vjm.LoadCases(**({"postures": ["stretched"], "wrenches": PUSH, "engine": FEW} | own))
    return {"cases": cases} | ({"cost": more["cost"]} if "cost" in more else {})


def by_brute_force(of, limits, vary, more):
    """The best value on the grid, or of all combinations of rows, each machine by itself."""
    bounds = limits_of(limits)
    names = [of, *(str(bound.of) for bound in bounds)]
    words = case_of(more)
    weights, price = more.get("weights", ()), words.pop("cost", "")
    if "upper.section" in vary:
        found = []
        for rows in itertools.product(*vary.values()):
            sizes = {
                f"{key}.{column}": [row[column]]
                for key, row in zip(vary, rows, strict=True)
                for column in ("width_mm", "wall_mm")
            }
            asked_for = ["mass", *names[1:]]
            (values,) = vjm.sweep("planar-2r", sizes, asked_for, **words).worst
            cost = sum(row["cost"] for row in rows) + 3.0 * values[0]
            found.append([cost if of == "cost" else values[0], *values[1:]])
        values = np.array(found)
    else:
        grid = {key: np.linspace(*pair, POINTS) for key, pair in vary.items()}
        swept = vjm.sweep("planar-2r", grid, names, **words, cost=price)
        values = swept.worst
        if weights:
            values[:, 0] = swept.values[:, :, 0] @ np.array(weights) / sum(weights)
    kept = np.all(np.isfinite(values), axis=1)
    for k, bound in enumerate(bounds, start=1):
        kept &= np.array([bound.margin(value) >= 0.0 for value in values[:, k]])
    best = values[kept, 0]
    return float(best.min() if asked(of).quantity in SMALLER_IS_BETTER else best.max())


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_an_optimum_is_that_of_trying_all(name):
    of, limits, vary, more = PROBLEMS[name]
    less = asked(of).quantity in SMALLER_IS_BETTER
    best = vjm.optimise("planar-2r", vary, **{"minimise" if less else "maximise": of}, such_that=limits,
                        starts=2, **case_of(more))  # fmt: skip
    brute = by_brute_force(of, limits, vary, more)
    assert best.kept
    if "upper.section" in vary:
        # the same machine, computed in the same way
        assert best.objective == pytest.approx(brute, rel=1e-12)
    else:
        better = (brute - best.objective) * (1.0 if less else -1.0) / abs(brute)
        # no grid point is better but by what limits are tightened; and a grid of 13 values is within some per cent
        assert -1e-5 < better < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", ["of held tools", "cheapest of a catalogue", "weighted"])
def test_an_interrupted_problem_ends_where_it_would_have_ended(tmp_path, name):
    of, limits, vary, more = PROBLEMS[name]
    words = {"minimise": of, "such_that": limits, "starts": 2, **case_of(more)}
    whole = vjm.optimise("planar-2r", vary, **words)
    calls = itertools.count()

    def stop(machines, best):
        if next(calls) == 5:
            raise KeyboardInterrupt

    state = tmp_path / "state.json"
    assert vjm.optimise("planar-2r", vary, **words, progress=stop, state=state).interrupted
    assert vjm.optimise("planar-2r", vary, **words, state=state).to_dict() == whole.to_dict()


def test_a_held_tool_stays_while_lengths_change():
    files = MachineFiles.read("planar-2r")
    goal = RigidMechanism(files.machine("bent")).end_frames(coordinates(files.machine("bent"), "bent"))[0]
    held = held_tool(files, ["bent"]).with_numbers({"upper.length_mm": 430.0, "fore.length_mm": 520.0})
    machine = held.machine("bent")
    there = RigidMechanism(machine).end_frames(coordinates(machine, "bent"))[0]
    # two links alone hold the place: the third number of a pose in the plane turns
    assert there[:3, 3] == pytest.approx(goal[:3, 3], abs=1e-8)
    # law of cosines
    apart = float(goal[:2, 3] @ goal[:2, 3])
    elbow = np.arccos((apart - 430.0**2 - 520.0**2) / (2.0 * 430.0 * 520.0))
    assert machine.held["bent"]["elbow"] == pytest.approx(elbow, abs=1e-9)
    with pytest.raises(ValueError, match="out of reach"):
        held.with_numbers({"fore.length_mm": 50.0}).machine("bent")
    written = held.with_postures
    assert written.number("fore.length_mm") == 520.0
    assert written.machine("bent").held["bent"]["elbow"] == pytest.approx(elbow, abs=1e-9)


def test_a_derivative_with_a_held_tool_is_that_of_machines_solved_again():
    from vjm.design.sensitivity import sensitivity

    held = held_tool(MachineFiles.read("planar-2r"), ["bent"])
    found = sensitivity(
        held.machine("bent"), [held.parameter("fore.length_mm", "bent")], "deflection", "bent", along="y",
        wrench=PUSH[0], engine=FEW,
    )  # fmt: skip
    assert found.rows[0].verification.why == ""
    assert found.rows[0].verification.difference is not None


@pytest.mark.parametrize(
    ("name", "posture", "said"),
    [("planar-2r", "stretched", "stretched or folded"), ("palletiser", "", "closed loops")],
)
def test_a_tool_that_cannot_be_held_is_refused(name, posture, said):
    files = MachineFiles.read(name)
    with pytest.raises(ValueError, match=said):
        held_tool(files, [posture or next(iter(files.machine().postures))])


def test_a_six_axis_arm_holds_the_direction_too():
    assert held_tool(MachineFiles.read("ur10"), ["work"]).places["work"].rows == 6


def test_a_reach_is_that_of_the_stretched_arm_within_its_limits():
    assert reach(vjm.load("planar-2r")) == pytest.approx(900.0, rel=1e-12)
    bent = vjm.build("bent", [
        vjm.Joint("a", vjm.axis("z"), compliance=1e-6), vjm.Beam("p", 300.0, section=STEEL),
        vjm.Joint("b", vjm.axis("z"), compliance=1e-6, limits=(0.5, 2.0)), vjm.Beam("q", 400.0, section=STEEL),
    ], {"here": {"a": 0.0, "b": 1.0}})  # fmt: skip
    # the elbow bends by 0.5 rad at least
    assert reach(bent) == pytest.approx(np.sqrt(300.0**2 + 400.0**2 + 2.0 * 300.0 * 400.0 * np.cos(0.5)), rel=1e-12)
    with pytest.raises(ValueError, match="closed loops"):
        reach(vjm.load("palletiser"))


STEEL = vjm.shape("round_bar", diameter_mm=30.0).stiffness()


@pytest.mark.parametrize("formula", ["", "mass +", "mass; parts", "__import__('os')", "[mass]", "True", "1/0"])
def test_what_is_no_formula_is_refused(formula):
    with pytest.raises(ValueError, match="cost"):
        Cost(formula)


def test_a_cost_may_name_any_number_of_the_file():
    files = MachineFiles.read("delta")
    mass, rod = 3.0, files.number("delta-rod.rod.length_mm")
    price = Cost("-2 + mass**2 / 'delta-rod.rod.length_mm' * parts")
    assert price.value(files.number, mass, 7.0) == pytest.approx(-2.0 + 9.0 / rod * 7.0)
    with pytest.raises(ValueError, match="is no number of a part"):
        vjm.sweep("planar-2r", {"tool.mass_kg": [1.0]}, ["cost"], cost="upper.lenth_mm")
    with pytest.raises(ValueError, match="a cost is of numbers that vary"):
        vjm.sensitivities("planar-2r", ["upper.length_mm"], of="cost")
    with pytest.raises(ValueError, match="say what a machine costs"):
        vjm.optimise("planar-2r", WIDE, minimise="cost", cases=vjm.LoadCases(wrenches=PUSH))
    with pytest.raises(ValueError, match="say what a machine costs"):
        vjm.sweep("planar-2r", {"tool.mass_kg": [1.0]}, ["cost"])


def test_weights_are_of_the_cases():
    with pytest.raises(ValueError, match="give 2 numbers of zero or more"):
        vjm.optimise("planar-2r", WIDE, minimise="mass", cases=vjm.LoadCases(wrenches=ASIDE, weights=(1.0,)))


@pytest.mark.slow
def test_a_front_is_not_beaten_by_a_grid():
    cases = vjm.LoadCases(wrenches=PUSH, engine=FEW)
    front = vjm.pareto_front("planar-2r", WIDE, points=4, starts=1, cases=cases)
    grid = vjm.sweep("planar-2r", {key: np.linspace(*pair, POINTS) for key, pair in WIDE.items()},
                     cases=cases)  # fmt: skip
    assert len(front.points) == 4
    assert np.all(np.diff(front.values[:, 0]) > 0.0)
    assert np.all(np.diff(front.values[:, 1]) < 0.0)
    for mass, deflection in front.values:
        # beyond what limits are tightened by, and the slack of the end that deflects least
        beaten = (grid.worst[:, 0] < mass * (1.0 - 1e-4)) & (grid.worst[:, 1] < deflection * (1.0 - 1e-5))
        assert not beaten.any()
    assert front.plot().get_xlabel() == "mass, kg"
    assert len(front.table()) == 4


def test_a_front_of_one_quantity_is_refused():
    with pytest.raises(ValueError, match="give two quantities"):
        vjm.pareto_front("planar-2r", WIDE, ("mass", "mass"))


@pytest.mark.parametrize(
    ("wrench", "of"),
    [((0.0, -50.0, 0.0, 0.0, 0.0, 0.0), "deflection"), ((0.0, -50.0, 0.0, 0.0, 0.0, 0.0), "stiffness.y"),
     ((-50.0, 0.0, 0.0, 0.0, 0.0, 0.0), "critical")],
)  # fmt: skip
def test_a_design_is_confirmed_by_finer_models(wrench, of):
    cases = vjm.LoadCases(wrenches=[wrench], engine=vjm.VjmEngine(4))
    space = design_space("planar-2r", ["upper.section.width_mm"], cases)
    (value,) = swept(space, np.array([[60.0]]), [asked(of)]).worst[0]
    # a mass depends on no spring
    (found,) = confirmed(space, np.array([60.0]), {asked(of): value, asked("mass"): 3.0})
    assert (found.doubt, found.why) == ("", "")
    # finite elements state what half as many change
    assert found.refined == pytest.approx(found.elements, abs=found.error + 5e-6 * value)


def test_models_that_differ_by_more_than_they_state_are_told():
    of = asked("deflection")
    assert Confirmation(of, 1.0, 1.0, 1.0, 0.0, "").doubt == ""
    assert "differ by 0.1 mm, more than" in Confirmation(of, 1.0, 1.0, 1.1, 0.01, "").doubt
    assert "write more `segments` into its beams" in Confirmation(of, 1.0, 1.01, 1.01, 0.01, "").doubt
    assert Confirmation(of, 1.0, 1.0, np.nan, 0.0, "not installed").doubt == ""
