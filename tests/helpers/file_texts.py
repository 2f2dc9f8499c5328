"""Texts of the files that users write, by hand: tables of TOML, sheets' instruments, parts of a model.

Nothing of the package is in it. Small machines that several tests take are named in `small_machines`.
"""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any


def value_text(value: Any) -> str:
    """A value as TOML writes it, 1e-7 without a zero in its exponent; tables and lists in a line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {value_text(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(value_text, value)) + "]"
    return re.sub(r"e([+-])0", r"e\1", repr(float(value))) if isinstance(value, float) else json.dumps(value)


def keys_text(keys: Mapping[str, Any]) -> str:
    """A line a key."""
    return "".join(f"{key} = {value_text(value)}\n" for key, value in keys.items())


def table_text(header: str, /, **keys: Any) -> str:
    """A table of TOML; ``[parts]`` is one of several."""
    return f"[{header}]\n{keys_text(keys)}"


def instruments_text(**instruments: Sequence[float]) -> str:
    """The instruments of a sheet by the column: noise, and where they are given the zero and the scale."""
    return "".join(
        table_text(f'instrument."{column}"' if "." in column else f"instrument.{column}")
        + keys_text(dict(zip(("noise", "zero", "scale"), sigma, strict=False)))
        for column, sigma in instruments.items()
    )


def part_text(kind: str, name: str, /, **keys: Any) -> str:
    """A part of a chain or tree."""
    return table_text("[parts]", kind=kind, name=name, **keys)


SIZES = {
    "square_tube": ("width_mm", "wall_mm"),
    "round_tube": ("diameter_mm", "wall_mm"),
    "rectangle": ("width_mm", "thickness_mm"),
}


def section_of(
    shape: str, *sizes: float, youngs: float = 70000.0, poisson: float = 0.33, density: float | None = None
) -> dict[str, Any]:
    """A section of a shape with two sizes, mm; of aluminium where nothing else is said, MPa and kg/m³."""
    material = {"youngs_modulus_MPa": youngs, "poissons_ratio": poisson}
    weight = {} if density is None else {"density_kg_per_m3": density}
    return {"shape": shape, **dict(zip(SIZES[shape], sizes, strict=True)), **material, **weight}


def stiffness_of(EA: float, GJ: float, EIy: float, EIz: float) -> dict[str, float]:
    """A section by its stiffnesses, N and N mm²."""
    return {"EA_N": EA, "GJ_Nmm2": GJ, "EIy_Nmm2": EIy, "EIz_Nmm2": EIz}


def model_text(name: str, /, *tables: str, postures: Mapping[str, Any] | None = None, **head: Any) -> str:
    """A model file in mm, N and rad of the tables given, with more keys in its head."""
    first = {"format": 1, "name": name, "title": f"a test's {name}", "source": "made up"}
    units = {"units": {"length": "mm", "force": "N", "angle": "rad"}}
    last = "" if postures is None else table_text("postures", **postures)
    return keys_text(first | units | head) + "".join(tables) + last
