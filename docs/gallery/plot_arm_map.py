"""From a URDF to a stiffness map
===============================

The tutorial :doc:`/tutorials/urdf-arm` as a program: an arm from a URDF, the compliance of its gears, one load,
and a map over two joints.
"""

# %%
# The geometry
# ------------
#
# A URDF has axes, lengths, masses and limits, and no elasticity: ``validate import`` leaves a placeholder for the
# compliance of each joint. ``arm.toml`` is the same arm with the compliances of its gears filled in, one over the
# torsional stiffness of the manufacturer's table.
from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

import vjm
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

arm = vjm.load(files("vjm_validation") / "examples/arm/arm.toml")
print(arm)

# %%
# One load
# --------
#
# 100 N downwards on the tool, and the arm's own weight: how far the tool sinks, and what the motors hold. The
# vertical compliance is entry (uz, fz) of the loaded 6×6 matrix.
model = Mechanism(arm.split())
load, weight = np.array([0.0, 0.0, -100.0, 0.0, 0.0, 0.0]), (0.0, 0.0, -9.81)
found = equilibria(model, model.posture("reach"), gravity=weight, wrench=load)
print("the tool moves by", np.round(found.deflection[0, 0, :3], 3), "mm")
for joint, torque in zip(model.joints, found.torques[0], strict=True):
    print(f"{joint} is held by {torque / 1e3:.1f} N m")
print("vertical compliance:", round(found.compliance[0, 0, 2, 2], 4), "mm/N")

# %%
# The map
# -------
#
# All postures of a grid in one call. The stiffness against a force in the weakest direction is one over the largest
# eigenvalue of the compliance's upper left block.
shoulder, elbow = np.linspace(-1.4, 0.4, 41), np.linspace(0.2, 2.2, 41)
q = np.tile(model.posture("reach"), (shoulder.size * elbow.size, 1))
q[:, model.joints.index("shoulder")] = np.repeat(shoulder, elbow.size)
q[:, model.joints.index("elbow")] = np.tile(elbow, shoulder.size)
compliance = equilibria(model, q).compliance[:, 0, :3, :3]
weakest = (1.0 / np.linalg.eigvalsh(compliance)[:, -1]).reshape(shoulder.size, elbow.size)
print(f"from {weakest.min():.1f} to {weakest.max():.1f} N/mm")

figure, axes = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
mesh = axes.pcolormesh(shoulder, elbow, weakest.T, shading="nearest")
axes.set(xlabel="shoulder, rad", ylabel="elbow, rad")
figure.colorbar(mesh, label="smallest stiffness against a force, N/mm")
plt.show()
