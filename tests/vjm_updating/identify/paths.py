"""Beam paths with compliances in closed form."""

from helpers.file_texts import model_text, section_of, stiffness_of, table_text

L_FRAME = model_text(
    "l-frame",
    table_text(
        "[pieces]", length_mm=200.0, section=stiffness_of(1e7, 3e8, 4e8, 4e8) | {"GAy_N": 3e6, "GAz_N": 3e6}
    ),
    table_text(
        "[pieces]", length_mm=150.0, turns=[{"turn_about": "z", "angle_deg": 90.0}],
        section=stiffness_of(5e6, 1e8, 2e8, 2e8) | {"GAy_N": 2e6, "GAz_N": 2e6},
    ),
)  # fmt: skip
TAPER = model_text(
    "taper",
    table_text(
        "[pieces]", length_mm=240.0, section=section_of("rectangle", 60.0, 12.0),
        end_section=section_of("rectangle", 20.0, 12.0),
    ),
)  # fmt: skip
