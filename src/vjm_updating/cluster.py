"""Work over the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, TypeVar

from vjm_updating.constants import numerical

Item = TypeVar("Item")
Result = TypeVar("Result")

RETRIES = numerical(5)
"""Times that a cluster may lose a task with its worker before it gives up."""
PATIENCE = "10s"
"""How long a scheduler has to answer."""


def on_cluster(
    function: Callable[[Item], Result], tasks: Sequence[Item], address: str
) -> Iterator[tuple[int, Result]]:
    """Index and result of each task as the cluster finishes it; what dies with a worker is done again by another.

    Args:
        function: that can be pickled; its result must follow from its argument alone.
        tasks: its arguments.
        address: of a Dask scheduler, such as ``tcp://host:8786``.

    Raises:
        ImportError: the optional extra is not installed.
        ValueError: no scheduler answers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise ImportError(
            "--scheduler needs Dask: install the optional extra, pip install 'vjm-stiffness[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as failure:
        reason = " ".join(str(failure).split())[:200]
        raise ValueError(f"--scheduler {address}: no Dask scheduler answers there ({reason})") from None
    with client:
        futures = {
            client.submit(function, task, pure=False, retries=RETRIES): index for index, task in enumerate(tasks)
        }
        for future, result in distributed.as_completed(list(futures), with_results=True):
            yield futures[future], result
