"""What the paper's printed matrices (19) and (20) are as beams, and what its Table II implies for them."""

from __future__ import annotations

from vjm.model.machine import Machine
from vjm_output.documents import Row
from vjm_updating.identify.command import identify_matrix
from vjm_updating.identify.report import IdentificationDocument
from vjm_validation.studies.table2 import Table2Document, TableFit, table2_document


class PrintedMatrices(Row):
    """The study of the printed matrices."""

    foot: IdentificationDocument
    """(19), examined as a beam's compliance."""
    bar: IdentificationDocument
    """(20), with its misprint, likewise."""
    table2: Table2Document
    """What the published table implies for the entries within their rounding."""


def printed_matrices(chain: Machine) -> PrintedMatrices:
    """Examine (19) and (20) of the paper's chain, and fit them to Table II within their rounding."""
    return PrintedMatrices(
        foot=identify_matrix("foot-19"),
        bar=identify_matrix("bar-20-as-printed"),
        table2=table2_document(TableFit(chain)),
    )
