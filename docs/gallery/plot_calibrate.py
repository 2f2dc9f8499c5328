"""Springs that are softer than the model says
===========================================

The readings of :doc:`/tutorials/calibrate` in posture A, beside the model before and after the calibration. The
calibration finds factors of 1.10 and 1.20 of the compliances; :doc:`/calibration` says how.
"""

from importlib.resources import files
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

import vjm
from vjm_updating import calibrate, load_data

folder = files("vjm_validation") / "examples/soft-springs"
readings = np.genfromtxt(folder / "readings.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
readings = readings[readings["posture"] == "A"]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(readings["ux_mm"], readings["fx_N"] / 1e3, "k.", label="readings")
with TemporaryDirectory() as out:
    calibrate(load_data(folder / "readings.csv", folder / "sheet.toml")).write(out)
    models = {"as drawn": vjm.load("orthoglide-chain"), "calibrated": vjm.load(f"{out}/calibrated-model.toml")}
for label, model in models.items():
    ends = readings["ux_mm"].min(), readings["ux_mm"].max()
    paths = [vjm.trace(model, vjm.LoadCase("A", to=float(end))) for end in ends if abs(end) > 0.01]
    s = np.concatenate([np.sign(p.load_case.to) * np.array(p.s) for p in paths])
    force = np.concatenate([np.sign(p.load_case.to) * np.array(p.force) for p in paths])
    order = np.argsort(s)
    left.plot(s[order], force[order] / 1e3, label=label)
    predicted = np.interp(readings["ux_mm"], s[order], force[order])
    right.plot(readings["ux_mm"], readings["fx_N"] - predicted, ".", label=label)
left.set(xlabel="displacement along x, mm", ylabel="force, kN")
right.set(xlabel="displacement along x, mm", ylabel="reading − model, N")
left.legend()
right.legend()
plt.show()
