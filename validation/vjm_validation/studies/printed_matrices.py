"""What the paper's printed matrices (19) and (20) are as beams, and what its Table II implies for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from pydantic import BaseModel, ConfigDict

from vjm.batch import map_all
from vjm.model.machine import Machine
from vjm_updating.identify.command import identify_matrix
from vjm_updating.identify.documents import IdentificationDocument
from vjm_validation.studies.table2_document import Table2Document, table2_document
from vjm_validation.studies.table2_fit import TableFit

FOOT, BAR, TABLE = "foot-19", "bar-20-as-printed", "table II"


class PrintedMatrices(BaseModel):
    """The study of the printed matrices."""

    model_config = ConfigDict(frozen=True)

    foot: IdentificationDocument
    """(19), examined as a beam's compliance."""
    bar: IdentificationDocument
    """(20), with its misprint, likewise."""
    table2: Table2Document
    """What the published table implies for the entries within their rounding."""


def printed_matrices(
    chain: Machine, jobs: int = 1, done: Callable[[int, int], None] | None = None
) -> PrintedMatrices:
    """Examine (19) and (20), and fit them to Table II within their rounding.

    Args:
        chain: the paper's.
        jobs: processes.
        done: called with how many of the three are done.
    """
    foot, bar, table = map_all(partial(_study, chain), (FOOT, BAR, TABLE), jobs, done)
    assert isinstance(foot, IdentificationDocument)
    assert isinstance(bar, IdentificationDocument)
    assert isinstance(table, Table2Document)
    return PrintedMatrices(foot=foot, bar=bar, table2=table)


def _study(chain: Machine, what: str) -> IdentificationDocument | Table2Document:
    return table2_document(TableFit(chain)) if what == TABLE else identify_matrix(what)
