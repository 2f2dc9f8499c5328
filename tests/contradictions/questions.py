"""The questions that several commands answer."""

from contradictions.answers import Question, Way
from contradictions.design_ways import (
    as_drawn,
    by_changed_file,
    by_sweep_end,
    derivative,
    described,
    evaluated_optimum,
    held_by_buckling,
    held_by_curve,
    held_by_python,
    held_by_stiffness,
    mass_by_check,
    mass_by_modes,
    mass_by_sensitivity,
    mass_drawn,
    reach,
    shares_expected,
    shares_told,
    start_of_optimum,
    told_optimum,
    value_ways,
)
from contradictions.load_ways import (
    LOADED,
    UNLOADED,
    critical_by_buckling,
    critical_by_curve,
    critical_by_exudyn,
    critical_by_modes,
    critical_by_sensitivity,
    critical_by_sensitivity_of_few,
    critical_by_stiffness,
    critical_in_closed_form,
    free,
    frequency_zero_expected,
    least_at_most,
    least_by_curve,
    least_by_map,
    stiffness_ways,
)
from contradictions.machines import KINDS
from contradictions.sketches import HELD_END, Drawn

QUESTIONS = (
    Question("unloaded stiffness", stiffness_ways(UNLOADED), free),
    Question("loaded stiffness", stiffness_ways(LOADED), free),
    Question(
        "critical load",
        [
            Way("closed form", critical_in_closed_form),
            Way("curve", critical_by_curve()),
            Way("curve, 7 steps", critical_by_curve("--steps", "7")),
            Way("curve, to its limit", critical_by_curve("--control", "limit"), slow=True),
            Way("curve, ten times as far", critical_by_curve(times=10.0), slow=True),
            Way("Exudyn", critical_by_exudyn, elements=True),
            Way("buckling", critical_by_buckling),
            Way("sensitivity", critical_by_sensitivity_of_few),
            Way("sensitivity of any", critical_by_sensitivity, slow=True),
            Way("stiffness", critical_by_stiffness),
            Way("modes", critical_by_modes),
            Way("load of the path", frequency_zero_expected),
        ],
        free,
    ),
    Question(
        "least critical force",
        [
            Way("map", least_by_map, slow=True),
            Way("curve there", least_by_curve, slow=True),
            Way("curve along the load", least_at_most, slow=True),
        ],
        free,
        every=2,
    ),
    *(
        Question(f"derivative of the {quantity}", derivative(quantity), free, every=2)
        for quantity in ("deflection", "stiffness", "frequency", "critical")
    ),
    Question("frequency", value_ways("frequency"), free),
    Question("sweep", [Way("sweep", by_sweep_end), Way("stiffness", by_changed_file)], free),
    Question(
        "optimum",
        [
            Way("optimise", told_optimum, slow=True),
            Way("stiffness", evaluated_optimum, slow=True),
            Way("start", start_of_optimum, slow=True),
        ],
        free,
        every=3,
    ),
    Question(
        "mass",
        [
            Way("drawing", mass_drawn),
            Way("check", mass_by_check),
            Way("modes", mass_by_modes),
            Way("sensitivity", mass_by_sensitivity),
        ],
        free,
    ),
    Question(
        "description",
        [
            Way("model", as_drawn, slow=True),
            Way("URDF", described("--urdf", ".urdf"), slow=True),
            Way("MJCF", described("--mjcf", ".xml"), slow=True),
        ],
        lambda machine: free(machine) and not machine.wrong_postures,
    ),
    Question("shares", [Way("shares", shares_told), Way("stiffness", shares_expected)], free),
    Question(
        "reach of a beam",
        [reach(name) for name in ("_expected", "stiffness", "curve", "modes", "sensitivity", "map", "Python")],
        lambda machine: bool(machine.wrong_postures),
    ),
    Question(
        "held end",
        [
            Way("stiffness", held_by_stiffness),
            Way("Python", held_by_python),
            Way("curve", held_by_curve),
            Way("buckling", held_by_buckling),
        ],
        lambda machine: machine.end == HELD_END,
    ),
)


QUICK_EVERY = 3
"""Machines of a kind in the quick run: each is asked a third of the questions, and together they are asked all."""


def asked_of(machine: Drawn, *, slow: bool) -> list[Question]:
    """The questions for a machine: over several machines of its kind all that fit."""
    turn = machine.seed // len(KINDS)
    return [
        question
        for place, question in enumerate(QUESTIONS)
        if question.fits(machine)
        and (turn + place) % max(question.every, 1 if slow else QUICK_EVERY) == 0
        and sum(slow or not way.slow for way in question.ways) > 1
    ]
