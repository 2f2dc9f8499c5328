"""Reference values of section constants by sectionproperties, an independent finite element program.

    pip install sectionproperties==3.10.2
    python tests/helpers/make_section_constants.py

writes ``tests/vjm/io/section_constants.json`` in some minutes. The program is no dependency of the tests: it brings
400 MB, and its mesher has no wheel for Python 3.14. Its torsion constant and shear areas carry the error of the
re-entrant corner, which falls with the 2/3 power of the triangles' area; two meshes are extrapolated to none.
"""

import json
from pathlib import Path

from sectionproperties.analysis import Section
from sectionproperties.pre import Material
from sectionproperties.pre.library import (
    circular_hollow_section,
    circular_section,
    i_section,
    rectangular_hollow_section,
    rectangular_section,
)

TRIANGLES = 800, 4000
"""Of the two meshes, about."""
POWER = 2.0 / 3.0
"""Of the triangles' area with which errors fall at a re-entrant corner of 270°."""
AROUND = 720
"""Corners of a circle: its area is 1.3e-5 low."""
FILE = Path(__file__).parents[1] / "vjm/io/section_constants.json"


def i_beam(width: float, height: float, flange: float, web: float) -> dict:
    return {"shape": "i_beam", "width_mm": width, "height_mm": height, "flange_mm": flange, "web_mm": web}


def tube(width: float, thickness: float, wall: float) -> dict:
    return {"shape": "rectangular_tube", "width_mm": width, "thickness_mm": thickness, "wall_mm": wall}


def rectangle(width: float, thickness: float) -> dict:
    return {"shape": "rectangle", "width_mm": width, "thickness_mm": thickness}


CASES = [
    *((i_beam(*sides), 0.3) for sides in (
        (40.0, 40.0, 12.0, 16.0), (40.0, 40.0, 16.0, 12.0), (100.0, 200.0, 8.5, 5.6), (40.0, 40.0, 19.0, 10.0),
        (40.0, 40.0, 5.0, 38.0), (200.0, 100.0, 2.0, 2.0), (30.0, 300.0, 6.0, 2.0), (12.0, 80.0, 2.0, 4.0),
    )),
    (i_beam(100.0, 200.0, 8.5, 5.6), 0.0),
    *((tube(*sides), 0.3) for sides in (
        (60.0, 40.0, 4.0), (100.0, 20.0, 1.0), (20.0, 100.0, 4.0), (30.0, 20.0, 9.5), (100.0, 100.0, 1.0),
    )),
    *(({"shape": "square_tube", "width_mm": 40.0, "wall_mm": wall}, 0.3) for wall in (2.0, 10.0, 19.0)),
    ({"shape": "square_tube", "width_mm": 40.0, "wall_mm": 10.0}, 0.0),
    *((rectangle(*sides), nu) for sides, nu in (
        ((20.0, 20.0), 0.3), ((50.0, 10.0), 0.3), ((10.0, 50.0), 0.3), ((100.0, 2.0), 0.3), ((50.0, 10.0), 0.49),
        ((50.0, 10.0), 0.0),
    )),
    *(({"shape": "round_bar", "diameter_mm": 20.0}, nu) for nu in (0.0, 0.3, 0.49)),
    *(({"shape": "round_tube", "diameter_mm": 20.0, "wall_mm": wall}, 0.3) for wall in (0.5, 5.0, 9.0)),
]  # fmt: skip


def geometry(section: dict) -> object:
    match section:
        case {"shape": "i_beam"}:
            return i_section(
                d=section["height_mm"],
                b=section["width_mm"],
                t_f=section["flange_mm"],
                t_w=section["web_mm"],
                r=0,
                n_r=1,
            )
        case {"shape": "rectangular_tube" | "square_tube"}:
            width = section["width_mm"]
            return rectangular_hollow_section(
                d=section.get("thickness_mm", width), b=width, t=section["wall_mm"], r_out=0, n_r=1
            )
        case {"shape": "rectangle"}:
            return rectangular_section(d=section["thickness_mm"], b=section["width_mm"])
        case {"shape": "round_bar"}:
            return circular_section(d=section["diameter_mm"], n=AROUND)
        case {"shape": "round_tube"}:
            return circular_hollow_section(d=section["diameter_mm"], t=section["wall_mm"], n=AROUND)
    raise ValueError(section)


def constants(section: dict, nu: float, triangles: int) -> dict[str, float]:
    drawn = geometry(section)
    # a modulus of one: E J and E A_s are the geometry's J and A_s
    drawn.material = Material("unit", 1.0, nu, 1.0, 1.0, "white")
    drawn.create_mesh([drawn.calculate_area() / triangles])
    found = Section(drawn)
    found.calculate_geometric_properties()
    found.calculate_warping_properties()
    # its x is the section's z; its shear area x is that of a force along x
    along_z, along_y = found.get_eas()
    about_z, about_y, _ = found.get_eic()
    return {
        "area": found.get_area(), "Iy": about_y, "Iz": about_z, "J": found.get_ej(), "Iw": found.get_egamma(),
        "Ay": along_y, "Az": along_z,
    }  # fmt: skip


def main() -> None:
    rows = []
    for section, nu in CASES:
        coarse, fine = (constants(section, nu, triangles) for triangles in TRIANGLES)
        ratio = (TRIANGLES[1] / TRIANGLES[0]) ** POWER
        corner = section["shape"] in ("i_beam", "square_tube", "rectangular_tube")
        row = {key: float(b + (b - coarse[key]) / (ratio - 1.0)) if corner else float(b) for key, b in fine.items()}
        apart = max(abs(fine[key] / coarse[key] - 1.0) for key in ("J", "Ay", "Az"))
        rows.append({"section": section, "poissons_ratio": nu, "meshes_apart": float(apart), **row})
        print(section, nu, row, flush=True)
    FILE.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
