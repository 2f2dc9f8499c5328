"""How often a diagnosis is right
==============================

The table of :doc:`/how-well/diagnosis` as a figure: sets by other authors, with the share that was asked for.
"""

import re
from pathlib import Path

import matplotlib.pyplot as plt

ROWS = {
    "single causes, strength ≥ 8: right": "single causes",
    "pairs: right": "pairs",
    "classes: right": "classes",
    "causes outside the catalogue `unknown`": "outside the catalogue",
}
page = Path("../how-well/diagnosis.md").read_text(encoding="utf-8")
figure, axes = plt.subplots(figsize=(7, 2.8), layout="constrained")
for place, (row, label) in enumerate(reversed(ROWS.items())):
    asked, *_, present = re.findall(rf"^\| {re.escape(row)} \| (\d+) % \|(.*?)\| (\d+/\d+) \|$", page, re.M)[0]
    right, of = map(int, present.split("/"))
    axes.barh(place, 100 * right / of, color="C0")
    axes.text(2, place, f"{label}: {right} of {of}", va="center", color="white")
    axes.plot([float(asked)] * 2, [place - 0.4, place + 0.4], color="black", label="asked" if not place else None)
axes.set(xlabel="right, %", xlim=(0, 100), yticks=[])
figure.legend(loc="outside lower right")
plt.show()
