"""A leg with a bow
================

The leg of :doc:`/tutorials/buckling-leg` in compression: perfect, and with a bow at mid-span in the shape in
which it buckles. The bow removes the sharp point, and the stiffness falls earlier.
"""

from importlib.resources import files

import matplotlib.pyplot as plt

import vjm

leg = vjm.load(files("vjm_validation") / "examples/leg/leg.toml")
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
for bow in (0.0, 0.03, 0.3, 1.0):
    path = vjm.trace(leg, vjm.LoadCase("straight", to=-0.5, imperfection=bow))
    axes.plot(path.s, [f / 1e3 for f in path.force], label=f"{bow:g} mm" if bow else "perfect")
axes.set(xlabel="displacement, mm", ylabel="force, kN")
axes.legend(title="bow")
plt.show()
