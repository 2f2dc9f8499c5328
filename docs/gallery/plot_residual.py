"""The residual that a missing cause leaves
========================================

Made-up readings of a machine with backlash in its drive, and the model without it. The residual has a step
where the force changes its sign: a shape that noise does not have. :doc:`/diagnosis` asks which cause makes
such a shape.
"""

import matplotlib.pyplot as plt
import numpy as np

import vjm

GAP, NOISE = 0.04, 10.0  # mm, N
chain = vjm.load("orthoglide-chain")
paths = [vjm.trace(chain, vjm.LoadCase("A", to=end)) for end in (-2.0, 2.0)]
s = np.concatenate([-np.array(paths[0].s[:0:-1]), paths[1].s])
force = np.concatenate([-np.array(paths[0].force[:0:-1]), paths[1].force])

# %%
# The drive moves by half of the gap before the machine feels it. Seeded noise makes the readings.
read_at = np.linspace(-1.5, 1.5, 61)
felt = np.sign(read_at) * np.maximum(np.abs(read_at) - GAP / 2, 0.0)
readings = np.interp(felt, s, force) + np.random.default_rng(7).normal(0.0, NOISE, read_at.size)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(s, force / 1e3, label="model without backlash")
left.plot(read_at, readings / 1e3, ".", label="readings")
left.set(xlabel="displacement along x, mm", ylabel="force, kN", xlim=(-1.6, 1.6), ylim=(-6, 6))
left.legend()
right.axhspan(-2 * NOISE, 2 * NOISE, color="0.9", label="noise, ± 2 sigma")
right.plot(read_at, readings - np.interp(read_at, s, force), ".", color="C1", label="reading − model")
backlash = np.interp(felt, s, force) - np.interp(read_at, s, force)
right.plot(read_at, backlash, color="C2", label="backlash of 0.04 mm")
right.set(xlabel="displacement along x, mm", ylabel="residual, N")
right.legend()
plt.show()
