"""Columns of the readings of a robot: by their names, and refused where they are of nothing that is known."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vjm.io.errors import did_you_mean
from vjm.rotations import Array
from vjm_updating.experiment.channels import converted
from vjm_updating.experiment.source import DataTable
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.sheet import RobotSheet


class Owners(NamedTuple):
    """Tables of a sheet whose names columns have: what each is, their names, what stands behind these."""

    what: str
    names: tuple[str, ...]
    keys: tuple[str, ...]


def columns_of(by_name: Mapping[str, Array], names: tuple[str, ...], keys: tuple[str, ...], absent: Array) -> Array:
    """Columns of several tables ``(g, names, keys)``; one that the file has not is ``absent`` (g,)."""
    return np.stack(
        [np.column_stack([by_name.get(f"{name}.{key}", absent) for key in keys]) for name in names], axis=1
    )


def numbers_by_name(table: DataTable, sheet: RobotSheet, skip: Callable[[str], bool]) -> dict[str, Array]:
    """Columns ``(g,)`` by their names, those of joints by the model's names.

    Args:
        table: as it was read.
        sheet: which names columns that differ.
        skip: whether a column with this key, what stands behind the name's point or the whole, is left out.

    Raises:
        ValueError: a cell is no number.
    """
    result = {}
    for column in table.cells:
        name, dot, key = column.partition(".")
        if not skip(key if dot else column):
            result[f"{sheet.joints.get(name, name)}.{key}" if dot else column] = table.numbers(column)
    return result


def check_columns(
    header: Sequence[str], sheet: RobotSheet, machine: PoseMachine, keys: Collection[str], owners: Sequence[Owners],
    whole: Sequence[str],
) -> None:  # fmt: skip
    """Refuse columns that are of nothing that the sheet or the model has.

    Args:
        header: names of the columns.
        sheet: of the test.
        machine: of the model.
        keys: what stands behind a joint's name.
        owners: tables of the sheet whose names columns have.
        whole: names of columns of none of them.

    Raises:
        ValueError: one is; one line.
    """
    followers = [f"{one.name}.{'q_mm' if one.slides else 'q_rad'}" for one in machine.followers]
    known = [*machine.joints, *sheet.joints, *(name for one in owners for name in one.names)]
    every = [*keys, *(key for one in owners for key in one.keys)]
    for column in header:
        name, _, key = column.partition(".")
        joint = sheet.joints.get(name, name)
        if (
            column in whole
            or column in followers
            or (joint in machine.joints and key in keys)
            or any(name in one.names and key in one.keys for one in owners)
        ):
            continue
        if key in keys:
            raise ValueError(
                f"column '{column}': the model has no joint '{joint}' that is driven; it has "
                f"{', '.join(machine.joints)}: name it in [joints] or delete it{did_you_mean(joint, known)}"
            )
        for one in owners:
            if key in one.keys:
                raise ValueError(
                    f"column '{column}': no {one.what} '{name}': add [{one.what}s.{name}] or delete it"
                    f"{did_you_mean(name, one.names)}"
                )
        for right in every:
            (quantity, _, unit), (given, _, other) = right.rpartition("_"), key.rpartition("_")
            if name in known and given == quantity:
                how = converted(other, unit)
                raise ValueError(f"column '{column}' must be in {unit}: {how} and name it {name}.{right}")
        raise ValueError(
            f"column '{column}' is not known: a joint's is JOINT.{next(iter(keys))}, "
            + "".join(f"a {one.what}'s {one.what.upper()}.{one.keys[0]}, " for one in owners)[:-2]
            + f": rename or delete it{did_you_mean(key or column, [*whole, *every])}"
        )


def check_noise(by_name: Mapping[str, Array], keys: Collection[str], rows: np.ndarray) -> None:
    """Refuse standard deviations below zero.

    Raises:
        ValueError: one is; one line.
    """
    for column, values in by_name.items():
        if column.partition(".")[2] in keys and (values < 0.0).any():
            row = rows[int(np.argmax(values < 0.0))]
            raise ValueError(
                f"row {row}, column {column}: a standard deviation is not negative; leave it blank for the sheet's"
            )
