"""How far the probabilities of a diagnosis hold
=============================================

The table of :doc:`/how-well-it-works` as a figure: of all causes that diagnoses of fresh sets list, the share that
acts, by the probability that was said. Bars are 95 % intervals.
"""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

page = Path("../how-well-it-works.md").read_text(encoding="utf-8")
number = r"([\d.]+)"
row = rf"^\| {number} to {number} \| (\d+) \| {number} \| {number} \| {number} to {number} \|$"
rows = np.array([[float(v) for v in cells] for cells in re.findall(row, page, re.M)])
said, acts, low, high = rows[:, 3], rows[:, 4], rows[:, 5], rows[:, 6]
figure, axes = plt.subplots(figsize=(4.5, 4.2), layout="constrained")
axes.plot([0, 1], [0, 1], color="gray", label="as said")
axes.errorbar(said, acts, [acts - low, high - acts], fmt="o", color="C0", capsize=3, label="found")
for x, y, count in zip(said, acts, rows[:, 2], strict=True):
    axes.annotate(f"{count:.0f}", (x, y), xytext=(6, -9), textcoords="offset points", fontsize=8)
axes.set(xlabel="probability said", ylabel="share that acts", xlim=(0, 1.05), ylim=(-0.02, 1.05))
axes.legend(loc="upper left")
plt.show()
