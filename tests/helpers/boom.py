"""GIRAF's extending boom, as a model document, a sheet of a test of poses, and its readings.

Readings: the public repository StanleyWang1/GIRAF, no licence stated: extension, force at the tip, a vertical scale
there. Neither the section nor the weight of the boom is published with them. EI is that of deflections from the
unloaded posture of each extension by F L³/3EI + c F L², 150 N m²; the weight, 3 N/m, that of what they droop
without force.
"""

import csv
from pathlib import Path
from typing import Any

EI = 1.5e8
"""N mm²."""
ABOVE = 375.0
"""mm: the scale's reading that the shortest boom nearly has."""


def document() -> dict[str, Any]:
    """The model."""
    return {
        "format": 1, "name": "giraf-boom", "title": "An extending boom", "source": "StanleyWang1/GIRAF",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "parts": [
            {"kind": "actuated", "name": "extension", "axis": "x", "motion": "slides",
             "limits_mm": [200.0, 2100.0]},
            {"kind": "beam", "name": "boom", "length_mm": 2100.0, "free_length": "extension", "mass_kg": 0.65,
             "section": {"EA_N": 1e6, "GJ_Nmm2": 0.5 * EI, "EIy_Nmm2": EI, "EIz_Nmm2": EI}},
        ],
        "postures": {"out": {"extension": 1500.0}},
    }  # fmt: skip


SHEET = f"""kind = "poses"

[test]
title = "GIRAF's extending boom"
model = "model.toml"
order = "unknown"
source = "StanleyWang1/GIRAF"

[markers.tip]
sigma_mm = 1.0

[tracker]
noise_mm = 1.0        # the scale is read to a millimetre

[base]                # a scale shows heights only: its zero and the boom's tilt are found, the rest stays
position_mm = [0.0, 0.0, {ABOVE}]
sigma_mm = 50.0
sigma_rad = 0.05
"""


def readings(source: Path) -> str:
    """The CSV file of the test from the repository's."""
    with source.open(encoding="utf-8") as file:
        rows = [
            f"{row['extension_mm']},{row['reading_mm']},{-float(row['force_N'])}" for row in csv.DictReader(file)
        ]
    return "\n".join(["extension.q_mm,tip.z_mm,tip.fz_N", *rows]) + "\n"
