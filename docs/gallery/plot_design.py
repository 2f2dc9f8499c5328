"""Which joint deflects, and how a load lowers a frequency
==========================================================

Left: the share of each joint of a UR10 in the strain energy under a force on the tool, in three postures.
Right: the square of the lowest frequency of an arm of two joints under a force along it. It falls to zero where the
arm loses its stability, see :doc:`/design`.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

ur10, arm = vjm.load("ur10"), vjm.load("planar-2r")
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")

postures = list(ur10.postures)
found = [vjm.shares(ur10, label, wrench=(20, 10, -100, 0, 0, 0)) for label in postures]
start = np.zeros(len(postures))
for k, row in enumerate(found[0].rows):
    width = np.array([100 * one.energies[k] for one in found])
    left.barh(postures, width, left=start, label=row.part)
    start += width
left.set(xlabel="share in the strain energy, %", xlim=(0, 100))
left.legend(ncols=3, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0))

forces = np.linspace(0.0, 1800.0, 25)
squares = []
for force in forces:
    mode = vjm.modes(arm, "stretched", number=1, wrench=(-force, 0, 0, 0, 0, 0))
    squares.append(mode.frequencies[0] ** 2 - (mode.growth[0] / (2 * np.pi)) ** 2)
right.plot(forces, squares, "o-", ms=3)
right.axhline(0.0, color="black", lw=0.8)
right.set(xlabel="force along the arm, N (compression)", ylabel="square of the lowest frequency, Hz²")
plt.show()
