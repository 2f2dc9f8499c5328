"""Buckling in tension or in compression
=====================================

The paper's chain with one spring in the link buckles when it is pulled. The same chain with sixteen springs
buckles when it is pushed, as beams do. See :doc:`/tutorials/table2`.
"""

import matplotlib.pyplot as plt

import vjm

chain = vjm.load("orthoglide-chain")
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for engine in ("vjm-paper", "vjm-16"):
    for end in (4.0, -4.0):
        path = vjm.trace(chain, vjm.LoadCase("A", to=end), engine=engine)
        (line,) = axes.plot(
            path.s if end > 0 else [-s for s in path.s],
            path.force if end > 0 else [-f for f in path.force],
            color="C0" if engine == "vjm-paper" else "C1",
            label=engine if end > 0 else None,
        )
        for event in path.events:
            sign = 1 if end > 0 else -1
            axes.plot(sign * event.s, sign * event.force, "o", color=line.get_color())
axes.set(
    xlabel="displacement along x, mm (tension positive)",
    ylabel="force, N",
    title="Posture A; dots are bifurcations",
)
axes.axhline(0.0, color="0.8", linewidth=0.8)
axes.legend()
plt.show()
