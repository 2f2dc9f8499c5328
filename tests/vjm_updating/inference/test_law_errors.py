"""How far laws of textbooks lie from the catalogue's, each at its best: the prior of a law's relative error."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from vjm_updating.inference.model_error import NINE_IN_TEN, NODES
from vjm_updating.inference.significance import LAW_ERROR
from vjm_updating.mechanisms.contacts import play
from vjm_updating.mechanisms.effect import AlongAxis
from vjm_updating.mechanisms.hysteresis import friction_torques

U = np.linspace(0.0, 1.0, 200)
FORCE = np.linspace(-1.0, 1.0, 400)
LOADING = np.concatenate([np.linspace(0.0, 1.0, 200), np.linspace(1.0, 0.0, 100)])
HIGHEST = np.maximum.accumulate(LOADING)
TIME = np.concatenate([np.linspace(0.0, 1.0, 60), np.linspace(1.0, 10.0, 60)[1:]])
TURN = np.concatenate([np.linspace(0.0, 1.0, 100), np.linspace(1.0, -1.0, 200), np.linspace(-1.0, 1.0, 200)])
OVER_EULER = np.linspace(0.0, 0.8, 200)


def stepped(step, state=0.0):
    """A friction torque ``(n,)`` by its rule for a small turn."""
    result = np.zeros(len(TURN))
    for i, turn in enumerate(np.diff(TURN, prepend=TURN[0])):
        for _ in range(20):
            state = step(state, turn / 20.0)
        result[i] = state
    return result


def dahl(power, presliding):
    """P. R. Dahl, AIAA Journal 14 (1976) 1675."""
    return stepped(lambda f, turn: f + turn / presliding * abs(1.0 - f * np.sign(turn)) ** power)


def breakaway(level, presliding, length):
    """A limit that falls from a level to 1 with the slip since the last reversal (Rabinowicz 1958)."""
    since = {"slip": 0.0, "sign": 0.0}

    def step(f, turn):
        since["slip"] = since["slip"] + abs(turn) if np.sign(turn) == since["sign"] else 0.0
        since["sign"] = np.sign(turn)
        limit = 1.0 + (level - 1.0) * np.exp(-since["slip"] / length)
        return float(np.clip(f + turn / presliding, -limit, limit))

    return stepped(step)


def iwan(least, most):
    """Sliders that slip one after another (W. D. Iwan, J. Appl. Mech. 34 (1967) 612)."""
    return np.mean([prandtl([np.log(at)]) for at in np.geomspace(least, most, 20)], axis=0)


def prandtl(z):
    """The catalogue's friction, by the product's own kernel: 1 N mm, its presliding free."""
    free, give, begins = TURN[:, None] * 1e3, np.full((len(TURN), 1, 1), 1e-9), np.arange(len(TURN)) == 0
    return friction_torques(free, give, np.ones(1), begins, np.zeros_like(free), 1e3 * np.exp(z[0]))[:, 0]


def backlash(z):
    """The catalogue's backlash, by the product's own law: travel 1, crossing and ends free."""
    element = play(AlongAxis((1.0, 0.0, 0.0)), (1.0, 0.0, np.exp(z[0]), np.exp(z[1])), 1.0)
    return element.law(FORCE, None)[0]


def creep(z):
    """The catalogue's two retarded terms, a step's answer."""
    fast, late, times = np.exp(z[0]), 1.0 / (1.0 + np.exp(-z[1])), np.exp(z[2])
    return (1.0 - late) * (1.0 - np.exp(-TIME / fast)) + late * (1.0 - np.exp(-TIME / (fast * times)))


def plastic(z):
    """The catalogue's two sliders: the second yields half-way from first yield to the largest force."""
    first, late = 1.0 / (1.0 + np.exp(-np.asarray(z)))
    second = 0.5 * (first + 1.0)
    return (1.0 - late) * np.maximum(HIGHEST - first, 0.0) + late * np.maximum(HIGHEST - second, 0.0)


def contact(z):
    """The catalogue's power between 0.3 and 0.95."""
    return U[1:] ** (0.3 + 0.65 / (1.0 + np.exp(-z[0])))


def hardening(z):
    """What the catalogue's drive does beyond a linear spring."""
    return U ** (1.0 + np.exp(z[0]))


def beyond_linear(x):
    """Of a displacement by force over `U` what a spring of the same stiffness at no load does not do."""
    return x - U * x[1] / U[1]


def bowed(waves):
    """Shortening of a bowed bar under a load over Euler's, by amplitudes of its half waves (Timoshenko 1936)."""
    return sum(n**2 * a**2 * (1.0 / (1.0 - OVER_EULER / n**2) ** 2 - 1.0) for n, a in waves.items())


def root_to_tip(softness):
    """A part's tip: deflection and turn by force, and turn by moment, each over that of an even part."""
    x = np.linspace(0.0, 1.0, 2001)
    even, own = (np.trapezoid([(1.0 - x) ** 2 * k, (1.0 - x) * k, k], x) for k in (np.ones_like(x), softness(x)))
    return own / even


def duffing():
    x = np.linspace(0.0, 1.0, 2000)
    force = x + 0.3 * x**3
    return np.interp(U, force / force[-1], x)


def three_slopes():
    """A catalogue's strain wave gear: K2 and K3 of 1.3 and 1.6 times K1, from 14 % and 48 % of the torque on."""
    at = np.array([0.0, 0.14, 0.48, 1.0])
    return np.interp(U, at, np.concatenate([[0.0], np.cumsum(np.diff(at) / np.array([1.0, 1.3, 1.6]))]))


LAWS = {
    "drive": (hardening, [[0.0], [1.0], [-1.0]], {
        "tangent": np.tan(U), "Duffing": duffing(), "three slopes": three_slopes(),
        "exponential": np.log1p(2.0 * U), "saturating": np.arctanh(0.8 * U),
    }),
    "contact": (contact, [[0.0], [2.0], [-2.0]], {
        "rough, exponential asperities": np.log1p(U[1:] / 0.1), "line": U[1:] * (1.0 - 0.1 * np.log(U[1:])),
        "rough on a sphere": 0.16 * np.log1p(U[1:] / 0.05) + 0.5 * U[1:] ** (2.0 / 3.0),
    }),
    "creep": (creep, [[a, b, 2.3] for a in (-3.0, -1.0, 1.0, 2.0) for b in (-1.0, 1.0)], {
        "Andrade 1/3": TIME ** (1.0 / 3.0), "power 0.15": TIME**0.15, "logarithmic": np.log1p(TIME / 0.05),
        "stretched exponential": 1.0 - np.exp(-np.sqrt(TIME / 2.0)), "Kelvin": 1.0 - np.exp(-TIME / 1.5),
    }),
    "friction": (prandtl, [[-4.0], [-2.5], [-1.0]], {
        "Dahl, 0.05": dahl(1, 0.05), "Dahl, 0.2": dahl(1, 0.2), "Dahl's square, 0.1": dahl(2, 0.1),
        "breakaway 1.3": breakaway(1.3, 0.02, 0.1), "breakaway 1.5": breakaway(1.5, 0.02, 0.3),
        "Iwan, a decade": iwan(0.02, 0.2), "Iwan, two": iwan(0.005, 0.5),
        "grows with the load": prandtl([np.log(0.02)]) * (1.0 + 0.2 * TURN),
    }),
    "plasticity": (plastic, [[a, b] for a in (-2.0, -0.5, 0.5, 1.5) for b in (-1.0, 1.0)], {
        "Ramberg-Osgood 3": HIGHEST**3, "Ramberg-Osgood 5": HIGHEST**5, "Ramberg-Osgood 10": HIGHEST**10,
        "bilinear": np.maximum(HIGHEST - 0.4, 0.0), "Ludwik": np.maximum(HIGHEST - 0.4, 0.0) ** 2,
    }),
    "backlash": (backlash, [[a, b] for a in (-4.0, -2.0) for b in (-3.0, -1.0)], {
        "linear ends": 0.5 * np.clip(FORCE / 0.02, -1.0, 1.0) + 0.2 * FORCE,
        "ends by a power": 0.5 * np.tanh(FORCE / 0.02) + 0.2 * np.sign(FORCE) * np.abs(FORCE) ** (1.0 / 1.8),
        "arctan": np.arctan(FORCE / 0.05) / np.pi,
        "logarithmic ends": 0.5 * np.tanh(FORCE / 0.02) + 0.1 * np.sign(FORCE) * np.log1p(np.abs(FORCE) / 0.1),
    }),
    "drift": (lambda _: U, [[0.0]], {
        "one time constant": 1.0 - np.exp(-U), "early": 1.0 - np.exp(-U / 0.3), "part of a day": np.sin(2.0 * U),
        "sigmoid": 1.0 / (1.0 + np.exp(-(U - 0.5) / 0.15)) - 1.0 / (1.0 + np.exp(0.5 / 0.15)),
    }),
    "bow": (lambda _: bowed({1: 1.0}), [[0.0]], {
        "parabola": bowed({1: 1.0, 3: 1.0 / 27.0}), "two waves": bowed({1: 1.0, 2: 0.5}),
        "three waves": bowed({1: 1.0, 2: 0.4, 3: 0.3}), "off centre": bowed({1: 1.0, 2: 0.2}),
    }),
    "part": (lambda _: np.ones(3), [[0.0]], {
        "tapered to 0.7": root_to_tip(lambda x: (1.0 - 0.3 * x) ** -3.0),
        "tapered to a half": root_to_tip(lambda x: (1.0 - 0.5 * x) ** -3.0),
        "clamp": root_to_tip(lambda x: np.where(x < 0.1, 4.0, 1.0)),
        "root alone": root_to_tip(lambda x: np.where(x < 0.01, 100.0, 0.0)),
        "weak in the middle": root_to_tip(lambda x: np.where(np.abs(x - 0.5) < 0.1, 3.0, 1.0)),
    }),
}  # fmt: skip
"""By cause: the catalogue's law, where to begin with its shapes, and laws of textbooks."""


def relative_error(model, starts, law):
    """What the catalogue's law leaves of another one, its size and shapes fitted, over that, root mean square."""
    law = law / np.sqrt(np.mean(law**2))

    def left(z):
        made = model(z)
        return made * (made @ law) / (made @ made) - law

    fits = [least_squares(left, start).fun for start in starts]
    return min(float(np.sqrt(np.mean(fit**2))) for fit in fits)


@pytest.fixture(scope="module")
def errors():
    return {
        f"{cause}: {name}": relative_error(model, starts, beyond_linear(law) if cause == "drive" else law)
        for cause, (model, starts, laws) in LAWS.items()
        for name, law in laws.items()
    }


def test_a_law_that_the_catalogue_has_leaves_nothing(errors):
    assert errors["creep: Kelvin"] < 1e-4
    # between the sliders' corners, which a fit by finite differences meets to some thousandths
    assert errors["plasticity: bilinear"] < 5e-3


def test_the_scale_of_the_prior_is_the_median_of_textbooks_laws(errors):
    found = np.array(list(errors.values()))
    middle, near = float(np.median(found)), 1.2533 * float(np.std(np.log(found[found > 1e-3]))) / len(found) ** 0.5
    # the standard error of a median, in its logarithm; two of them
    assert abs(np.log(middle / LAW_ERROR)) < 2.0 * near


def test_the_prior_has_the_tail_of_textbooks_laws(errors):
    found = np.array(list(errors.values()))
    nine = float(np.quantile(found, 0.9))
    # a half-normal prior of that median ends its nine tenths at 2.44 medians, the half-Cauchy one at 6.3
    assert 2.44 * LAW_ERROR < nine < 1.5 * NINE_IN_TEN * LAW_ERROR
    # and no law of a textbook lies beyond its end
    assert found.max() <= LAW_ERROR * NODES[-1] * 1.001
