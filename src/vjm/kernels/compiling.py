"""Who wants to know that kernels are being compiled. Nothing here imports Numba.

The first use after an installation compiles them, unless `vjm.warm_up` did. That takes some minutes.
"""

from __future__ import annotations

from collections.abc import Callable

watchers: list[Callable[[str], None]] = []
"""Called with the name of each kernel before it is compiled; kernels that are kept on disk are not compiled."""
