"""Whether a part's matrix and its section are of one part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vjm.io.checks import EXCHANGED, SWAPPED, bending_apart, fits_exchanged
from vjm.io.errors import printed
from vjm.io.findings import Grade
from vjm.io.schema import BeamTable, ModelFile
from vjm.rotations import Array

LIKELY = 0.5
"""Of the distance between matrix and section: a mistake that leaves less explains it."""


def matrices(model: ModelFile) -> Iterator[tuple[Grade, str, str]]:
    """A matrix far from its part's section: axes exchanged, an offset in metres, or another modulus.

    Some engines take the matrix and some the section, so that a difference between the two is one between engines.
    Rounding to two digits, as papers print, makes 3 %. Where fillets, tapers or holes make another part of it, the
    section is not that part's, and is doubted too. `drawings` judges what stands for a drawing.
    """
    for table in model.parts:
        if not isinstance(table, BeamTable) or table.drawing is not None:
            continue
        beam = table.part()
        if beam.section is None or beam.compliance is None:
            continue
        where, given, theory = f"part '{table.name}'", beam.tip_compliance(), beam.beam_compliance()
        own = bending_apart(given, theory)
        if own <= SWAPPED:
            continue
        longer = replace(beam, end_offset=1000.0 * beam.end_offset)
        if fits_exchanged(beam):
            yield Grade.DOUBTFUL, f"{where}, section", EXCHANGED
        elif np.any(beam.end_offset) and bending_apart(given, longer.beam_compliance()) < LIKELY * own:
            yield (
                Grade.DOUBTFUL,
                f"{where}, end_offset_mm",
                "the matrix fits the section with an offset a thousand times as long: is it in metres?",
            )
        else:
            yield Grade.DOUBTFUL, f"{where}, compliance", _of_two_parts(given, theory)


def _of_two_parts(given: Array, theory: Array) -> str:
    """How a matrix ``(6, 6)`` differs from that of its section, and the likely mistake."""
    ratios = np.diag(given)[[1, 2, 4, 5]] / np.diag(theory)[[1, 2, 4, 5]]
    logs = np.log(ratios)
    # a modulus and a number of members act on all entries alike, which no change of shape does
    if float(np.std(logs)) < LIKELY * float(np.sqrt(np.mean(logs**2))):
        factor = float(np.exp(np.mean(logs)))
        return (
            f"the matrix is {printed(factor, 3)} times as compliant in bending as the section: is the modulus, or "
            "count, another one? Engines take the one or the other; make them the same part's"
        )
    k = int(np.argmax(np.abs(logs)))
    row = (2, 3, 5, 6)[k]
    return (
        f"({row},{row}) is {printed(float(ratios[k]), 3)} times what the section gives: engines take the one or "
        "the other; make them the same part's, or leave the section out"
    )
