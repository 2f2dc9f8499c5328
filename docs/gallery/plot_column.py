"""Springs that converge with the tenth order
==========================================

The critical load of a column between two pins, with n springs, against Euler's load with the bar's shortening:
P (1 − P/EA) = π² EI/L². See :doc:`/virtual-springs`.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

column = vjm.load("pinned-column")
beam = column.beams[0]
section = beam.effective_section()
euler = np.pi**2 * min(section.EIy, section.EIz) / beam.length**2
exact = section.EA / 2 * (1 - np.sqrt(1 - 4 * euler / section.EA))

numbers = [1, 2, 3, 4, 6, 8]
placements = {
    "best": "beam-column springs",
    "two-thirds": "at two thirds",
    "middle": "at the middle",
    "end": "at the end",
}
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for placement, label in placements.items():
    n, errors = [], []
    for count in numbers:
        engine = vjm.engine_by_name(f"vjm-{count}", vjm.EngineOptions(placement=placement))
        path = vjm.trace(column, vjm.LoadCase("straight", to=-20.0), engine)
        if path.critical is not None:
            n.append(count)
            errors.append(abs(path.critical.force / exact - 1))
    axes.loglog(n, errors, "o-", label=label)
axes.set(xlabel="springs in the column", ylabel="relative error of the critical load")
axes.legend()
plt.show()
