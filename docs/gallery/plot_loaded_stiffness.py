"""Loaded and unloaded stiffness
==============================

The stiffness along x of the paper's chain in posture B, by (18) at the loaded equilibrium and by (5) without
load, see :doc:`/theory/stiffness`. In compression the chain loses most of its stiffness; the unloaded model
cannot show it.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

chain = vjm.load("orthoglide-chain")
displacements = np.linspace(-10.0, 4.0, 15)
found = [vjm.stiffness(chain, "B", displacement=(s, 0, 0, 0, 0, 0)) for s in displacements]
figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
axes.plot(displacements, [one.loaded[0, 0] for one in found], "o-", label="loaded, (18)")
axes.axhline(found[0].unloaded[0, 0], color="C1", label="unloaded, (5)")
axes.set(xlabel="displacement along x, mm (tension positive)", ylabel="stiffness along x, N/mm", ylim=(0, None))
axes.legend()
plt.show()
