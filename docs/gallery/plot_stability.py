"""The eigenvalue that passes zero
================================

The smallest eigenvalue of the second variation along two load paths, see :doc:`/theory/stability`. It reaches
zero at the critical point. Behind it the stable branch is followed, on which it is positive again.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

chain = vjm.load("orthoglide-chain")
figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
for engine, end, label in (("vjm-16", -4.0, "16 springs, compression"), ("vjm-paper", 4.0, "one spring, tension")):
    path = vjm.trace(chain, vjm.LoadCase("A", to=end), engine=engine)
    value = np.array([point.eigenvalue for point in path.points])
    (line,) = axes.plot(path.s, value / value[0], ".-", label=label)
    axes.plot(path.critical.s, 0.0, "o", color=line.get_color())
axes.axhline(0.0, color="0.7", linewidth=0.8)
axes.set(xlabel="displacement, mm", ylabel="smallest eigenvalue over the unloaded one")
axes.legend()
plt.show()
