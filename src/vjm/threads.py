"""One thread of linear algebra around many small solves."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def single_threaded(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a function's linear algebra run in one thread; whoever calls it keeps the threads that they had.

    The matrices of a path have 6 to some hundred rows. With a thread for each core their factorisations take five
    times as long and more.

    Example:
        >>> import numpy as np
        >>> single_threaded(np.linalg.det)(np.eye(3))
        1.0
    """

    @wraps(function)
    def limited(*args: Arguments.args, **options: Arguments.kwargs) -> Result:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **options)

    return limited


@cache
def _libraries() -> ThreadpoolController:
    """The linear algebra of NumPy and of SciPy, which bring one each."""
    # only what is loaded by now is found; the compiled kernels load SciPy's too
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
