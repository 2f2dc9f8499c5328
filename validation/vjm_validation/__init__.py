"""Comparisons of the lumped model with finite elements and with published figures, and their report."""

import os

# Threaded linear algebra makes matrices of this size five to a hundred times slower. It must be said before
# numpy is imported, and whoever wants another number of threads can say so.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
