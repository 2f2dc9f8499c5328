"""Notebook: design a machine
==========================

From parts to a better arm, step by step. Each step can be run and changed: the notebook is below this page.
:doc:`/design` says more.
"""

# %%
# Build
# -----
#
# An arm of two tubes. Its arguments are the numbers that vary later.

import matplotlib.pyplot as plt

import vjm


def arm(upper: float = 60.0, fore: float = 40.0, wall: float = 3.0) -> vjm.Machine:
    """An arm in the plane, of square tubes of steel."""

    def tube(width: float) -> vjm.Section:
        return vjm.shape("square_tube", width_mm=width, wall_mm=wall).stiffness()

    parts = [
        vjm.Joint("shoulder", vjm.axis("z"), compliance=5e-7),
        vjm.Beam("upper", 500.0, section=tube(upper)),
        vjm.Joint("elbow", vjm.axis("z"), compliance=1e-6),
        vjm.Beam("fore", 400.0, section=tube(fore)),
        vjm.RigidOffset("tool", mass=2.0),
    ]
    return vjm.build("arm", parts, {"stretched": {"shoulder": 0.0, "elbow": 0.0}})


push = (0.0, -50.0, 0.0, 0.0, 0.0, 0.0)
found = vjm.stiffness(arm(), wrench=push)
print(f"The tool moves by {found.displacement[1]:.2f} mm.")

# %%
# What deflects
# -------------

for row in vjm.shares(arm(), wrench=push).table():
    print(f"{row['part']:10} {row['energy']:.1%}")

# %%
# The lightest arm of a given deflection
# --------------------------------------
#
# The result is computed again with twice as many springs and with finite elements.

bounds = {"upper": (40.0, 90.0), "fore": (30.0, 70.0)}
cases = vjm.LoadCases(wrenches=[push], engine=vjm.VjmEngine(4))
best = vjm.optimise(arm, bounds, minimise="mass", such_that="deflection<=28.5", cases=cases, starts=1)
print(f"{best.objective:.3f} kg: {best.table()}")
for row in best.confirmed():
    print(f"{row.of}: {row.value:.4f}, {row.refined:.4f} and {row.elements:.4f} {row.of.unit} {row.doubt}")

# %%
# Mass against deflection
# -----------------------

front = vjm.pareto_front(arm, bounds, ("mass", "deflection"), points=5, cases=cases, starts=1)
front.plot()
plt.show()
