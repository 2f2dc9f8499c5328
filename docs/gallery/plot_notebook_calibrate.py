"""Notebook: calibrate and diagnose
================================

From readings to springs, and to what the model lacks. Each step can be run and changed: the notebook is below this
page. :doc:`/calibration` and :doc:`/diagnosis` say more.
"""

# %%
# Readings
# --------
#
# A machine of the library with 10 % and 20 % more compliance, measured in ramps.

from importlib.resources import files

import matplotlib.pyplot as plt
import numpy as np

from vjm_updating import calibrate, diagnose, load_data

folder = files("vjm_validation") / "examples/soft-springs"
data = load_data(folder / "readings.csv", folder / "sheet.toml")
print(data)

# %%
# Calibrate
# ---------

found = calibrate(data)
for row in found.rows():
    print(f"{row['name']}: {row['value']:.3f}")

# %%
# Diagnose
# --------
#
# The deflections of a FANUC arm under loads on its tool. Is it the compliance of its joints?

folder = files("vjm_validation") / "examples/fanuc-deflections"
fanuc = load_data(folder / "readings.csv", folder / "sheet.toml")
causes = diagnose(fanuc, only=("joint_compliance",))
for row in causes.rows():
    print(f"{row['cause']}: {row['said']}")

# %%
# The readings
# ------------

folder = files("vjm_validation") / "examples/soft-springs"
readings = np.genfromtxt(folder / "readings.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
for posture in np.unique(readings["posture"]):
    own = readings[readings["posture"] == posture]
    plt.plot(own["ux_mm"], own["fx_N"] / 1e3, ".", label=f"posture {posture}")
plt.xlabel("displacement along x, mm")
plt.ylabel("force, kN")
plt.legend()
plt.show()
