"""Notebook: reproduce the paper
=============================

The published chain buckles in tension, beams buckle in compression. Each step can be run and changed: the notebook
is below this page. :doc:`/tutorials/table2` says more.
"""

# %%
# One spring per link
# -------------------

import matplotlib.pyplot as plt

import vjm

chain = vjm.load("orthoglide-chain")
print(vjm.buckling(chain, ["A"], engine="vjm-paper"))

# %%
# Sixteen springs, and finite elements
# ------------------------------------

for engine in ("vjm-16f16", "exudyn"):
    found = vjm.buckling(chain, ["A"], ["compression"], engine=engine)
    (row,) = found.rows()
    print(f"{engine}: {row['critical']} at {row['F_cr']:.2f} N")

# %%
# Both load paths
# ---------------

ax = None
for engine in ("vjm-paper", "vjm-16f16"):
    for to in (4.0, -4.0):
        path = vjm.trace(chain, vjm.LoadCase("A", to=to), engine=engine)
        ax = path.plot(ax)
plt.show()
