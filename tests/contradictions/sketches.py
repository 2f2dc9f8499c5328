"""A machine as it is drawn at random: its model file, and what is known of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.io.files import toml_text
from vjm.rotations import rotation_from_vector

Table = dict[str, Any]
MODEL = "machine.toml"
UNITS = {"length": "mm", "force": "N", "angle": "rad"}
FREE_END, HELD_END = "free", "held"


@dataclass(frozen=True)
class Drawn:
    """A machine with what is asked of it.

    Attributes:
        files: text by name; `MODEL` is the machine.
        load: ``(6,)`` unit wrench that grows to a critical one, N and N mm.
        scale: N, a load of the size at which stability may be lost.
        keys: numbers of the file by which quantities are differentiated.
        end: whether the machine carries its free end.
        twin: name of a file with the same machine in another form; empty without.
        critical: factor on the load at which stability is lost, in closed form; None where there is none.
        wrong_postures: postures in which a beam would be longer than it is, or shorter than nothing.
        mass: kg, as drawn.
        kind: one of `KINDS`, and
        seed: its number, see `drawn`.
    """

    files: Mapping[str, str]
    load: tuple[float, ...]
    scale: float
    keys: tuple[str, ...]
    mass: float
    end: str = FREE_END
    twin: str = ""
    critical: float | None = None
    wrong_postures: tuple[str, ...] = ()
    kind: str = ""
    seed: int = 0

    @property
    def name(self) -> str:
        return f"{self.kind} {self.seed}"


def unit(*values: float) -> np.ndarray:
    """A unit vector."""
    v = np.array(values, dtype=float)
    return v / np.linalg.norm(v)


def listed(v: Any) -> list[float]:
    """Numbers of an array, rounding away."""
    return [float(x) for x in np.asarray(v, dtype=float)]


class Sketch:
    """Bodies, joints, beams and springs of a file, drawn in axes of their own and placed in the world."""

    def __init__(self, rng: np.random.Generator, name: str) -> None:
        # half of the machines stand along the world's axes: rounding and symmetry differ there
        turned = rng.random() < 0.5
        self.R = rotation_from_vector(rng.normal(size=3)) if turned else np.eye(3)
        self.p = rng.uniform(-100.0, 100.0, 3) if turned else np.zeros(3)
        self.name = name
        self.tables: dict[str, list[Table]] = {}
        self.mass = 0.0

    def point(self, x: Any) -> list[float]:
        """A place in the world, mm."""
        return listed(self.p + self.R @ np.asarray(x, dtype=float))

    def axis(self, v: Any) -> list[float]:
        """A unit vector in the world."""
        return listed(self.R @ unit(*v))

    def add(self, table: str, content: Table) -> None:
        self.tables.setdefault(table, []).append(content)

    def body(self, name: str, mass: float = 0.0, centre: Any = (0.0, 0.0, 0.0)) -> str:
        weight = {"mass_kg": mass, "centre_of_mass_mm": self.point(centre)} if mass else {}
        self.mass += mass
        self.add("bodies", {"name": name, **weight})
        return name

    def joint(self, name: str, between: tuple[str, str], at: Any, axis: Any = None, **keys: Any) -> None:
        turning = {} if axis is None else {"axis": self.axis(axis)}
        self.add("joints", {"name": name, "between": list(between), "at_mm": self.point(at), **turning, **keys})

    def spring(
        self, name: str, between: tuple[str, str], points: Any, stiffness: float, stretch: float = 0.0
    ) -> None:
        """A spring between points; drawn it is longer than free by a share of itself."""
        drawn = float(np.linalg.norm(np.subtract(*np.asarray(points, dtype=float))))
        self.add(
            "point_springs",
            {
                "name": name,
                "between": list(between),
                "points_mm": [self.point(x) for x in points],
                "stiffness_N_per_mm": stiffness,
                "free_length_mm": drawn / (1.0 + stretch),
            },
        )

    def text(self, body: str, at: Any, **more: Any) -> str:
        return toml_text(
            {
                "format": 1,
                "kind": "bodies",
                "name": self.name,
                "title": self.name,
                "source": "drawn at random",
                "units": UNITS,
                "end": {"body": body, "at_mm": self.point(at)},
                **self.tables,
                **more,
            }
        )

    def drawn(
        self, body: str, at: Any, load: tuple[float, ...], scale: float, keys: tuple[str, ...], **more: Any
    ) -> Drawn:
        """The machine with its end on a body, see `Drawn`."""
        return Drawn({MODEL: self.text(body, at)}, load, scale, keys, self.mass, **more)

    def force(self, *direction: float) -> tuple[float, ...]:
        """A unit force."""
        return (*self.axis(direction), 0.0, 0.0, 0.0)


def part(kind: str, name: str, **keys: Any) -> Table:
    return {"kind": kind, "name": name, **keys}


def link(name: str, along: list[float], mass: float, centre: list[float]) -> Table:
    return part("link", name, translation_mm=along, mass_kg=mass, centre_of_mass_mm=centre)


def chain_text(name: str, parts: list[Table], **more: Any) -> str:
    return toml_text(
        {
            "format": 1,
            "name": name,
            "title": name,
            "source": "drawn at random",
            "units": UNITS,
            "parts": parts,
            **more,
        }
    )


def round_section(rng: np.random.Generator, diameter: float) -> Table:
    return {
        "shape": "round_bar",
        "diameter_mm": diameter,
        "youngs_modulus_MPa": 210_000.0,
        "poissons_ratio": 0.3,
        "density_kg_per_m3": 7850.0,
    }


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))
