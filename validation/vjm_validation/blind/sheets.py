"""A design as a test sheet, and readings as a data file, as docs/measured-data.md has them."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_validation.blind.designs import MODEL, POSTURES, Design


def sheet_text(design: Design, title: str) -> str:
    """The test sheet."""
    labels = dict.fromkeys(s.posture for s in design.sequences)
    lines = [
        "[test]",
        f'title = "{title}"',
        f'model = "{MODEL}"',
        'control = "displacement"',
        f"gravity = {_list(design.down)}",
        "",
        "[model]",
        f"link_segments = {design.link_segments}",
        f"foot_segments = {design.foot_segments}",
        f"actuator_compliance_mm_per_N = {design.drive!r}",
        "",
        "[postures]",
        *(f"{label} = {_list(POSTURES[label])}" for label in labels),
    ]
    for name, known in design.instruments.items():
        lines += ["", f"[instrument.{name}]", f"noise = {known.noise!r}", f"zero = {known.zero!r}"]
        lines += [f"scale = {known.scale!r}"]
    lines += ["", "[tolerance]", f"link_length_mm = {design.length!r}", f"modulus_rel = {design.modulus!r}"]
    return "\n".join(lines) + "\n"


def data_text(design: Design, ux: Array, forces: Array) -> str:
    """The data file.

    Args:
        design: of the test.
        ux: displacements as read ``(n,)``, nan where missed.
        forces: wrench channels as read ``(n, c)``, nan where missed.
    """
    header = ["time_s", "posture", "ux_mm", *design.channels]
    header += ["temperature_C"] if design.thermometer else []
    lines, row = [",".join(header)], 0
    for sequence in design.sequences:
        for k in range(len(sequence)):
            cells = [f"{sequence.time[k]:.2f}", sequence.posture, _cell(ux[row]), *map(_cell, forces[row])]
            cells += [f"{sequence.temperature[k]:.3f}"] if design.thermometer else []
            lines.append(",".join(cells))
            row += 1
    return "\n".join(lines) + "\n"


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6f}"


def _list(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"
