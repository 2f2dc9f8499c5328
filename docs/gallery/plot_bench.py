"""A tube in a clamp
=================

The readings of :doc:`/tutorials/bench`: weights at the tip of a tube, and two dial gauges. The line is the tube
in a rigid clamp, by beam theory. What the readings lie above it is the rotation of the clamp.
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

import vjm

folder = files("vjm_validation") / "examples/clamped-tube"
readings = np.genfromtxt(folder / "readings.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
beam = vjm.load(folder / "tube.toml").beams[0]
rigid = beam.length**3 / (3.0 * beam.effective_section().EIy)
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
axes.plot(readings["fz_N"], readings["uz_mm"], ".", label="gauge at the tip")
axes.plot(readings["fz_N"], readings["miduz_mm"], ".", label="gauge at the middle")
axes.plot([-100, 100], [-100 * rigid, 100 * rigid], color="0.5", label="tip, rigid clamp")
axes.set(xlabel="weight, N", ylabel="deflection, mm")
axes.legend()
plt.show()
