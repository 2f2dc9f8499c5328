"""Stiffness of a platform under load
==================================

The Orthoglide at three poses, with a force along x: its stiffness along x. The platform's stiffness is the sum
of its legs' loaded stiffnesses. See :doc:`/theory/platforms`.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

robot = vjm.load("orthoglide")
forces = np.linspace(-4000.0, 4000.0, 5)
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for pose in ("Q1", "isotropic", "Q2"):
    along = [vjm.stiffness(robot, pose, wrench=[f, 0, 0, 0, 0, 0]).loaded[0, 0] for f in forces]
    axes.plot(forces, np.array(along) / along[2], "o-", label=pose)
axes.set(xlabel="force along x, N", ylabel="stiffness along x over the unloaded one")
axes.legend()
plt.show()
