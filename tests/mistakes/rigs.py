"""Sound tests of machines of several kinds, made by the lumped model under each sheet's noise and tolerances."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from helpers.command import validate
from helpers.file_texts import instruments_text, table_text

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm_updating.experiment.data_file import POSE, WRENCH


@dataclass(frozen=True)
class Rig:
    """A machine and how it is tested.

    Attributes:
        model: of the library, or ``new`` and a kind of `validate new`.
        moved: the displacement that is imposed, mm.
        loaded: force along it.
        across: another channel of the wrench.
        ramps: by posture, where the displacement goes.
        noises: of displacement and wrench.
    """

    model: str
    moved: str
    loaded: str
    across: str
    ramps: tuple[str, ...]
    noises: tuple[float, float]


RIGS = {
    "chain": Rig("new chain", "ux_mm", "fx_N", "fy_N", ("straight:x:0.5", "bent:x:-2"), (0.001, 2.0)),
    "arm": Rig("new arm", "uz_mm", "fz_N", "fx_N", ("home:z:-10", "stretched:z:-10"), (0.005, 1.0)),
    "planar-2r": Rig(
        "planar-2r", "uy_mm", "fy_N", "fx_N", ("bent:y:8", "folded:y:8", "stretched:y:8"), (0.005, 1.0)
    ),
    "ur10": Rig("ur10", "uz_mm", "fz_N", "fy_N", ("work:z:-5",), (0.005, 1.0)),
    "column": Rig("pinned-column", "ux_mm", "fx_N", "fy_N", ("straight:x:-0.02",), (0.0002, 1.0)),
}
"""Tests by name."""


def made(name: str, folder: Path, seed: int = 0) -> Path:
    """Make a test: ``DATA.csv`` and ``SHEET.toml`` in a folder of its name."""
    rig, out = RIGS[name], folder / name
    out.mkdir(parents=True, exist_ok=True)
    model = rig.model
    if model.startswith("new "):
        model = f"{name}.toml"
        _run("new", rig.model.split()[1], str(out / model))
    chain = load_chain(out / model if model.endswith(".toml") else model)
    labels = dict.fromkeys(ramp.split(":")[0] for ramp in rig.ramps)
    moved, loaded = rig.noises
    sheet = out / "SHEET.toml"
    sheet.write_text(
        table_text("test", title=name, model=model)
        + table_text("model", link_segments=8)
        + table_text("postures", **{label: chain.postures[label].tolist() for label in labels})
        + instruments_text(
            **{rig.moved: (moved, moved, 0.001), rig.loaded: (loaded, loaded, 0.003), rig.across: (loaded, loaded)}
        )
        + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02),
        encoding="utf-8",
    )
    if not chain.beams:
        _by_stiffness(rig, chain, out / "DATA.csv", seed)
        return out
    ramps = [word for ramp in rig.ramps for word in ("--ramp", ramp)]
    test = ["--test", str(sheet), "--seed", str(seed), "--out", str(out / "made")]
    _run("simulate", str(out / model) if model.endswith(".toml") else model, *test, *ramps)
    (out / "DATA.csv").write_bytes((out / "made" / "readings.csv").read_bytes())
    return out


def _by_stiffness(rig: Rig, chain: Machine, data: Path, seed: int) -> None:
    """Readings of an arm of rigid links, which `validate simulate` does not take: stiffness times displacement."""
    rng, lines = np.random.default_rng(seed), [f"time_s,posture,{rig.moved},{rig.loaded},{rig.across}"]
    k, rows = POSE.index(rig.moved), [WRENCH.index(name) for name in (rig.loaded, rig.across)]
    for ramp in rig.ramps:
        label, _, end = ramp.split(":")
        K = VjmEngine(1).problem(chain, LoadCase(label, 1.0)).unloaded().stiffness
        assert K is not None
        for u in np.linspace(0.0, float(end), 25):
            f = K[rows, k] * u + rig.noises[1] * rng.standard_normal(2)
            read = u + rig.noises[0] * rng.standard_normal()
            lines.append(f"{10 * len(lines)},{label},{read:.4f},{f[0]:.2f},{f[1]:.2f}")
    data.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _run(*words: str) -> None:
    done = validate(*words, status=None)
    if done.status:
        raise RuntimeError(f"validate {' '.join(words)}: {done.err}")
