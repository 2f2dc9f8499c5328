"""Answers of cases: numbers, or functions of `vjm_validation.exact` by name."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from vjm.batch import map_all
from vjm_validation.verification.schema import Reference

MODULES = ("arches", "beam_column", "columns", "elastica", "frames", "linear", "postbuckling", "reissner",
           "space", "torsion", "trusses")  # fmt: skip
"""Of `vjm_validation.exact`."""


def answers(references: Sequence[Reference], jobs: int = 1) -> list[float]:
    """The numbers that references stand for, each in its quantity's unit.

    Args:
        references: any of them twice costs nothing.
        jobs: processes.

    Raises:
        ValueError: one names what there is not, or its arguments are out of range.
    """
    calls = list(dict.fromkeys(_call(reference) for reference in references if reference.value is None))
    results = dict(zip(calls, map_all(_result, calls, jobs), strict=True))
    return [
        reference.value if reference.value is not None else _taken(reference, results[_call(reference)])
        for reference in references
    ]


def answer(reference: Reference) -> float:
    """The number that one reference stands for; see `answers`."""
    return answers([reference])[0]


def _call(reference: Reference) -> str:
    """The function and its arguments as text, which two components of one result share."""
    return json.dumps([reference.exact, reference.arguments], sort_keys=True)


def _result(call: str) -> Any:  # noqa: ANN401
    name, arguments = json.loads(call)
    try:
        return named(name)(**made(arguments))
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from error


def _taken(reference: Reference, result: Any) -> float:  # noqa: ANN401
    steps = [reference.take] if isinstance(reference.take, str) else reference.take or []
    for step in steps:
        result = getattr(result, step) if isinstance(step, str) else result[step]
    return float(result) * reference.times


def named(name: str) -> Any:  # noqa: ANN401
    """What ``module.name`` is in `vjm_validation.exact`.

    Raises:
        ValueError: there is no such thing.
    """
    module, *path = name.split(".")
    if module not in MODULES or not path or any(step.startswith("_") for step in path):
        raise ValueError(f"'{name}' is not module.name of vjm_validation.exact ({', '.join(MODULES)})")
    thing: Any = importlib.import_module(f"vjm_validation.exact.{module}")
    for step in path:
        try:
            thing = getattr(thing, step)
        except AttributeError:
            raise ValueError(f"vjm_validation.exact.{module} has no '{step}'") from None
    return thing


def made(value: Any) -> Any:  # noqa: ANN401
    """An argument with the named things in it made: ``{make = "columns.Support", rotational = 3.0}``."""
    if isinstance(value, Mapping):
        inner = {key: made(item) for key, item in value.items()}
        if "constant" in inner:
            return named(inner["constant"])
        if "make" in inner:
            return named(inner.pop("make"))(**inner)
        return inner
    if isinstance(value, list):
        return tuple(made(item) for item in value)
    return value
