"""A disc spring that snaps through
================================

The law of :doc:`/tutorials/own-effect`: the extension that the drive adds by the force on it. Around 1500 N it
grows by 0.02 mm; below and above it is stiff.
"""

import matplotlib.pyplot as plt
import numpy as np

distance, threshold, width = 0.02, 1500.0, 100.0
force = np.linspace(-4000.0, 4000.0, 801)
start = np.tanh(-threshold / width)
extension = np.sign(force) * distance / 2 * (np.tanh((np.abs(force) - threshold) / width) - start)
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
axes.plot(force, 1e3 * extension)
axes.set(xlabel="force on the drive, N", ylabel="extension, µm")
plt.show()
