"""Four postures in compression
============================

In A and C the straight chain buckles sharply. In B and D the foot stands across the load, and the
stiffness falls smoothly, in a knee.
"""

import matplotlib.pyplot as plt

import vjm

chain = vjm.load("orthoglide-chain")
found = vjm.buckling(chain, directions=["compression"])
print(found)
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for (posture, _), path in found.paths.items():
    axes.plot(path.s, path.force, label=posture)
axes.set(xlabel="displacement, mm", ylabel="force, N", xlim=(0, 14))
axes.legend(title="posture")
plt.show()
