"""A part and its faces
====================

The foot of :doc:`/tutorials/part-to-spring` as ``validate show`` draws it: the numbers name its faces. This
needs the extra ``solid``.
"""

from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

from vjm_validation.cli.main import run

with TemporaryDirectory() as folder:
    picture = Path(folder) / "foot.png"
    run(["show", str(files("vjm_validation") / "examples/parts/slotted-foot.step"), "--out", str(picture)])
    image = plt.imread(picture)
inked = np.argwhere(image[..., :3].min(axis=2) < 0.99)
(top, left), (bottom, right) = inked.min(axis=0), inked.max(axis=0)
image = image[top : bottom + 1, left : right + 1]
figure, axes = plt.subplots(figsize=(8, 2.6), layout="constrained")
axes.imshow(image)
axes.axis("off")
plt.show()
