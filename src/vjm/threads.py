"""One thread of linear algebra around many small solves."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def single_threaded(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a function's linear algebra run in one thread; whoever calls it keeps the threads that they had.

    The matrices of a path have 6 to some hundred rows. With a thread for each core their factorisations take five
    times as long and more. What the function itself is the first to import keeps its threads until it returns.

    Example:
        >>> import numpy as np
        >>> single_threaded(np.linalg.det)(np.eye(3))
        1.0
    """

    @wraps(function)
    def limited(*args: Arguments.args, **options: Arguments.kwargs) -> Result:
        with _libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
            return function(*args, **options)

    return limited


@lru_cache(maxsize=1)
def _libraries(_modules: int) -> ThreadpoolController:
    """The linear algebra that is loaded, NumPy's, SciPy's, MKL's; a library can only have come with a module."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
