"""A robot and a laser tracker
===========================

The readings of :doc:`/tutorials/ur10`: positions of a target on the flange of a UR10. They are of every
third of 1,495 postures, in the frame of the tracker.
"""

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

file = files("vjm_validation") / "examples/ur10-poses/readings.csv"
readings = np.genfromtxt(file, delimiter=",", names=True)
x, y, z = (readings[f"tmac{axis}_mm"] / 1e3 for axis in "xyz")
figure = plt.figure(figsize=(7, 4.6), layout="constrained")
axes = figure.add_subplot(projection="3d")
points = axes.scatter(x, y, z, c=np.degrees(readings["shoulder_lift_jointq_rad"]), s=8)
axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
# the numbers of the axes are wide
axes.yaxis.labelpad, axes.zaxis.labelpad = 10, 8
figure.colorbar(points, label="shoulder lift, degrees", shrink=0.7, pad=0.13)
plt.show()
