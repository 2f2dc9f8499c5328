"""An arm of four elastic joints and point masses, whose frequencies follow from energies alone.

Kinetic energy: the masses' places are differentiated by the joints' angles. No code of the project is used.
"""

from pathlib import Path

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

AXES = ("z", "y", "y", "x")
LENGTHS = ((0.0, 0.0, 300.0), (420.0, 0.0, 0.0), (360.0, 0.0, 0.0), (120.0, 0.0, 60.0))
"""From each joint to the next, mm."""
MASSES = (9.0, 6.0, 4.0, 2.5)
"""At the end of each link, kg."""
COMPLIANCE = (6e-9, 9e-9, 1.6e-8, 9e-8)
"""rad/(N mm)."""
NAMES = ("waist", "shoulder", "elbow", "roll")
POSTURES = ((0.0, -0.9, 1.2, 0.3), (0.4, -0.3, 0.7, -0.8), (-0.5, -1.3, 2.0, 1.2), (0.2, 0.2, 0.3, 2.0))


def places(q: np.ndarray) -> np.ndarray:
    """Of the masses ``(4, 3)``, mm."""
    R, p, found = np.eye(3), np.zeros(3), []
    for axis, angle, shift in zip(AXES, q, LENGTHS, strict=True):
        R = R @ Rotation.from_euler(axis, angle).as_matrix()
        p = p + R @ np.array(shift)
        found.append(p)
    return np.array(found)


def frequencies(q, compliance, masses=MASSES, payload: float = 0.0) -> np.ndarray:
    """Hz ``(4,)``, ascending; ``payload`` kg at the last mass."""
    q, step = np.array(q, dtype=float), 1e-5
    J = np.stack([(places(q + h) - places(q - h)) / (2.0 * step) for h in step * np.eye(4)], axis=2)
    weight = np.array(masses) + np.array([0.0, 0.0, 0.0, payload])
    M = np.einsum("k,kai,kaj->ij", weight, J, J)
    return np.sqrt(1000.0 * eigh(np.diag(1.0 / np.array(compliance)), M, eigvals_only=True)) / (2.0 * np.pi)


def model(compliance=COMPLIANCE) -> str:
    """The model file."""
    text = 'format = 1\nname = "tapped"\ntitle = "four joints"\nsource = "made up"\n'
    text += '[units]\nlength = "mm"\nforce = "N"\nangle = "rad"\n'
    for name, axis, c, shift, mass in zip(NAMES, AXES, compliance, LENGTHS, MASSES, strict=True):
        text += (
            f'[[parts]]\nname = "{name}"\nkind = "actuated"\naxis = "{axis}"\n'
            f"compliance_rad_per_Nmm = {c}\n"
            f'[[parts]]\nname = "after-{name}"\nkind = "link"\ntranslation_mm = {list(shift)}\n'
            f"mass_kg = {mass}\ncentre_of_mass_mm = {list(shift)}\n"
        )
    return text + "[postures]\nhome = {" + ", ".join(f"{name} = 0.0" for name in NAMES) + "}\n"


def sheet(model_file: str = "arm.toml", more: str = "", noise: float = 0.02) -> str:
    """The sheet of a test."""
    rows = "\n".join(
        f"{label} = {{{', '.join(f'{n} = {v}' for n, v in zip(NAMES, q, strict=True))}}}"
        for label, q in zip("ABCD", POSTURES, strict=True)
    )
    return (
        f'kind = "frequencies"\n[test]\nmodel = "{model_file}"\n[frequencies]\nnoise_Hz = {noise}\n{more}\n'
        f"[postures]\n{rows}\n"
    )


def write(folder: Path, table: np.ndarray, more: str = "", noise: float = 0.02) -> tuple[Path, Path]:
    """Readings ``(4, k)`` Hz, nan where none was read, their sheet, and the model beside it."""
    (folder / "arm.toml").write_text(model())
    data, page = folder / "readings.csv", folder / "sheet.toml"
    page.write_text(sheet(more=more, noise=noise))
    header = ",".join(["posture", *(f"f{k + 1}_Hz" for k in range(table.shape[1]))])
    lines = [
        ",".join([label, *("" if np.isnan(f) else f"{f:.12g}" for f in row)])
        for label, row in zip("ABCD", table, strict=True)
    ]
    data.write_text("\n".join([header, *lines]) + "\n")
    return data, page
