"""A robot pulled at its tool
==========================

The measured displacement of the tool of a FANUC R-2000iC in 43 postures, and what a rigid model and
the authors' joint stiffnesses leave of it. :doc:`/tutorials/fanuc` finds better ones.
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

import vjm
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

folder = files("vjm_validation") / "examples/fanuc-deflections"
lines = [line for line in (folder / "readings.csv").read_text().splitlines() if not line.startswith("#")]
rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
q, force, measured = rows[:, :6], rows[:, 6:9], rows[:, 9:12]

robot = Mechanism(vjm.load(folder / "fanuc-r2000ic.toml").split())
wrench = np.hstack([force, np.zeros_like(force)])
published = equilibria(robot, q, wrench=wrench[:, None]).deflection[:, 0, :3]
left = {
    "rigid": np.linalg.norm(measured, axis=1),
    "authors' springs": np.linalg.norm(measured - published, axis=1),
}
figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
order = np.argsort(left["rigid"])
for label, size in left.items():
    axes.plot(np.arange(1, 44), size[order], "o-", label=f"{label}: {size.mean():.2f} mm in the mean")
axes.set(xlabel="posture, sorted by its displacement", ylabel="displacement not explained, mm", ylim=(0, None))
axes.legend()
plt.show()
