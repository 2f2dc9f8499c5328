"""Readings of a machine that the vjm engine traces, with whatever is changed in it, on made-up instruments."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from helpers.file_texts import instruments_text, table_text
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import compliance_factor
from vjm_updating.experiment.data_file import WRENCH

TOLERANCE = 0.02


def measured(
    folder: Path, model: str | Path, change: Callable[[Machine], Machine], postures: Sequence[str], driven: str,
    reach: float, seed: int,
) -> tuple[Path, Path]:  # fmt: skip
    """Data and sheet of a machine that is changed; its moduli, zeros and scales are drawn, too."""
    rng = np.random.default_rng(seed)
    chain = load_chain(model)
    for beam in chain.beams:
        factor = float(np.exp(TOLERANCE * rng.standard_normal()))
        chain = compliance_factor(chain, beam.name).apply(chain, factor)
    chain = change(chain)
    noise = {name: 0.5 if name.endswith("_N") else 100.0 for name in WRENCH}
    zero = {name: noise[name] * rng.standard_normal() for name in WRENCH}
    scale = {name: 1.0 + 0.003 * rng.standard_normal() for name in WRENCH}
    direction = np.eye(6)["xyz".index(driven[1])]
    rows, clock = [f"time_s,posture,{driven},{','.join(WRENCH)}"], 0.0
    for posture in postures:
        for to in (reach, -reach):
            # twice the springs of the model that the diagnosis takes
            path = VjmEngine(24).trace(chain, LoadCase(posture, to, tuple(direction), steps=12))
            for k in (*range(len(path.s)), *reversed(range(len(path.s) - 1))):
                clock += 2.0
                u = np.sign(to) * path.s[k] + 0.001 * rng.standard_normal()
                read = (
                    path.wrench[k][i] * scale[name] + zero[name] + noise[name] * rng.standard_normal()
                    for i, name in enumerate(WRENCH)
                )
                rows.append(f"{clock},{posture},{u:.5f},{','.join(f'{v:.3f}' for v in read)}")
    data, sheet = folder / "data.csv", folder / "sheet.toml"
    data.write_text("\n".join(rows) + "\n")
    sheet.write_text(
        table_text("test", title="a machine of one's own", model=str(model))
        + table_text("postures", **dict.fromkeys(postures, ()))
        + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
        + instruments_text(**{driven: (0.001, 0.002, 0.001)}, **{n: (s, s, 0.003) for n, s in noise.items()})
    )
    return data, sheet
