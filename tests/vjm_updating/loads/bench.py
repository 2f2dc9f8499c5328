"""A tube in a clamp that turns a little, weights at its tip: by closed forms, none of the suite's."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from helpers.file_texts import model_text, part_text, section_of

from vjm.rotations import Array

LENGTH, MODULUS = 600.0, 210000.0
INERTIA = np.pi / 64.0 * (40.0**4 - 36.0**4)
MODEL = model_text(
    "tube",
    part_text("mount", "clamp", axis="y", compliance_rad_per_Nmm=1e-9),
    part_text(
        "beam",
        "tube",
        length_mm=600.0,
        section=section_of("round_tube", 40.0, 2.0, youngs=210000.0, poisson=0.3, density=7850.0),
    ),
    postures={"bench": []},
)
CHANNELS = {"fz_N": (0.02, 0.05, 0.001), "my_Nmm": (5.0, 10.0, 0.001), "uz_mm": (0.003, 0.01, 0.002),
            "ry_rad": (5e-6, 1e-5, 0.002), "mid.uz_mm": (0.003, 0.01, 0.002)}  # fmt: skip
"""Noise, zero and scale by column."""


@dataclass(frozen=True)
class Tube:
    """The tube as it is.

    Attributes:
        clamp: rotational compliance of the clamp, rad/(N mm).
        factor: of the tube's compliance over the drawn one.
        guided: whether the tip's rotation about y is held.
    """

    clamp: float = 5e-9
    factor: float = 1.0
    guided: bool = False

    def read(self, channel: str, force: Array, moment: Array) -> Array:
        """What a gauge reads under forces along z and moments about y at the tip, small deflections."""
        bend = self.factor / (MODULUS * INERTIA)
        F, M = force, -moment  # a moment about −y turns the tip up
        if self.guided:
            # the support's moment takes the tip's turn back
            M = -F * (0.5 * LENGTH**2 * bend + LENGTH * self.clamp) / (LENGTH * bend + self.clamp)
        point, _, name = channel.rpartition(".")
        x = 0.5 * LENGTH if point else LENGTH
        root = self.clamp * (F * LENGTH + M)
        if name == "ry_rad":
            return -(root + bend * (F * (LENGTH * x - 0.5 * x**2) + M * x))
        return root * x + bend * (F * (0.5 * LENGTH * x**2 - x**3 / 6.0) + 0.5 * M * x**2)


def write(
    folder: Path,
    tube: Tube,
    columns: tuple[str, ...],
    seed: int,
    *,
    force: float = 100.0,
    moment: float = 0.0,
    held: tuple[str, ...] = (),
    model: str = MODEL,
) -> tuple[Path, Path]:
    """Model, sheet and readings: up, down, up the other way and back, with noise, zeros and scales drawn."""
    rng = np.random.default_rng(seed)
    up = np.linspace(0.0, 1.0, 11)
    way = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    loads = {"fz_N": force * way, "my_Nmm": moment * way}
    values = {}
    for name in columns:
        noise, zero, scale = CHANNELS[name]
        true = loads[name] if name in loads else tube.read(name, loads["fz_N"], loads["my_Nmm"])
        off = zero * rng.standard_normal() + noise * rng.standard_normal(len(way))
        values[name] = true * (1.0 + scale * rng.standard_normal()) + off
    lines = [",".join(["posture", *columns])]
    lines += [",".join(["bench", *(f"{values[name][k]:.9g}" for name in columns)]) for k in range(len(way))]
    instruments = "".join(
        f'[instrument."{name}"]\nnoise = {noise}\nzero = {zero}\nscale = {scale}\n'
        for name, (noise, zero, scale) in CHANNELS.items()
        if name in columns
    )
    points = '[points.mid]\nbody = "tube"\nat = 0.5\n' if "mid.uz_mm" in columns else ""
    support = f"held = {list(held)!r}\n".replace("'", '"') if held else ""
    sheet = (
        f'[test]\ntitle = "tube"\nmodel = "tube.toml"\ncontrol = "force"\n{support}[postures]\nbench = []\n'
        f"{points}{instruments}[tolerance]\nlink_length_mm = 0.5\nmodulus_rel = 0.02\n"
    )
    (folder / "tube.toml").write_text(model)
    (folder / "sheet.toml").write_text(sheet)
    (folder / "readings.csv").write_text("\n".join(lines) + "\n")
    return folder / "readings.csv", folder / "sheet.toml"
