"""Ten lines: stiffness along a path, and a sweep as a table
=========================================================

Left: the stiffness of an arm of two joints along y, over a path of its elbow. Right: the deflection of its tool
over its mass, for some widths and walls of its upper arm, see :doc:`/design`.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

arm = vjm.load("planar-2r")
path = [{"shoulder": 0.2, "elbow": float(angle)} for angle in np.linspace(0.2, 2.0, 10)]
along_y = [1.0 / vjm.stiffness(arm, posture).loaded_compliance[1, 1] for posture in path]
sizes = {"upper.section.width_mm": [50, 60, 70, 80], "upper.section.wall_mm": [2, 3, 4]}
push = vjm.LoadCases(wrenches=[(0, -50, 0, 0, 0, 0)])
frame = vjm.sweep("planar-2r", sizes, ["mass", "deflection"], cases=push).to_frame()

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot([posture["elbow"] for posture in path], along_y, "o-", ms=3)
left.set(xlabel="elbow, rad", ylabel="stiffness along y, N/mm")
for on_front, rows in frame.groupby("front"):
    right.plot(rows["mass"], rows["deflection"], "o", label="beaten by no other" if on_front else "others")
right.set(xlabel="mass, kg", ylabel="deflection, mm")
right.legend()
plt.show()
