"""Causes sit in the parts of whatever machine a user has: the softened beam is named, whatever it is called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.model.parameters import compliance_factor
from vjm.vjm_engine import VjmEngine
from vjm_updating.diagnose.command import diagnose
from vjm_updating.diagnose.document import Diagnosis
from vjm_updating.diagnose.ramp_test import observe_ramps
from vjm_updating.experiment import read_measurement
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.inference.parameters import nuisance_coordinates
from vjm_updating.mechanisms.catalogue import catalogue
from vjm_updating.mechanisms.effect import Scene
from vjm_updating.mechanisms.modified_chain import foot_of, links_of

SOFTER, TOLERANCE = 1.207, 0.02
HEAD = """format = 1
name = "chain"
title = "Beams behind one another"
source = "made up"
[units]
length = "mm"
force = "N"
angle = "rad"
"""
BEAM = """
[[parts]]
kind = "{kind}"
name = "j-{name}"
axis = "{axis}"
{compliance}
[[parts]]
kind = "beam"
name = "{name}"
length_mm = {length}
[parts.section]
shape = "square_tube"
width_mm = {width}
wall_mm = 3.0
youngs_modulus_MPa = 70000.0
poissons_ratio = 0.33
"""
SHEET = """[test]
title = "a machine of one's own"
model = "{model}"
[postures]
{postures}
[tolerance]
link_length_mm = 0.2
modulus_rel = 0.02
[instrument.{driven}]
noise = 0.001
zero = 0.002
scale = 0.001
"""
INSTRUMENT = "[instrument.{name}]\nnoise = {noise}\nzero = {noise}\nscale = 0.003\n"


def four_beams(folder: Path) -> Path:
    """An arm of four beams on geared joints."""
    beams = (("root", "z", 300, 60), ("upper", "y", 400, 50), ("fore", "z", 350, 45), ("hand", "y", 200, 40))
    text = HEAD + "".join(
        BEAM.format(kind="actuated", name=n, axis=a, length=v, width=w, compliance="compliance_rad_per_Nmm = 2e-7")
        for n, a, v, w in beams
    )
    text += "[postures]\n" + "".join(
        f"{label} = {{ j-root = {a}, j-upper = {b}, j-fore = {c}, j-hand = {d} }}\n"
        for label, a, b, c, d in (
            ("P", 0.0, 0.6, 0.8, -0.5),
            ("Q", 0.3, -0.9, 1.4, 0.9),
            ("R", -0.2, 1.2, -1.0, 1.3),
        )
    )
    file = folder / "four.toml"
    file.write_text(text)
    return file


def measured(
    folder: Path, model: str | Path, soft: str, postures: Sequence[str], driven: str, reach: float, seed: int
) -> tuple[Path, Path]:
    """Data and sheet of a machine with one part softened; its moduli, zeros and scales are drawn, too."""
    rng = np.random.default_rng(seed)
    chain = load_chain(model)
    for beam in chain.beams:
        factor = float(np.exp(TOLERANCE * rng.standard_normal())) * (SOFTER if beam.name == soft else 1.0)
        chain = compliance_factor(chain, beam.name).apply(chain, factor)
    noise = {name: 0.5 if name.endswith("_N") else 100.0 for name in WRENCH}
    zero = {name: noise[name] * rng.standard_normal() for name in WRENCH}
    scale = {name: 1.0 + 0.003 * rng.standard_normal() for name in WRENCH}
    direction = np.eye(6)["xyz".index(driven[1])]
    rows, clock = [f"time_s,posture,{driven},{','.join(WRENCH)}"], 0.0
    for posture in postures:
        for to in (reach, -reach):
            # twice the springs of the model that the finder takes
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
    text = SHEET.format(model=model, postures="\n".join(f"{p} = []" for p in postures), driven=driven)
    sheet.write_text(text + "".join(INSTRUMENT.format(name=n, noise=s) for n, s in noise.items()))
    return data, sheet


def is_named(found: Diagnosis, part: str) -> bool:
    """Whether a diagnosis says that this part is too soft, and by how much."""
    factor = found.parameters.get("link_compliance.factor")
    return (
        found.verdict == "named"
        and [candidate.places for candidate in found.candidates] == [[f"link_compliance({part})"]]
        and found.parameters["link_compliance.part"] == part
        # three standard deviations of the part's own modulus, which the factor contains
        and abs(np.log(factor.value / SOFTER)) < 3.0 * TOLERANCE + 3.0 * factor.std
    )


@pytest.mark.parametrize("part", ["upper", pytest.param("fore", marks=pytest.mark.slow)])
def test_each_link_of_a_library_arm_is_named(tmp_path: Path, part: str) -> None:
    # across its plane, where both links bend and twist
    data, sheet = measured(tmp_path, "planar-2r", part, ("bent", "folded"), "uz_mm", 3.0, seed=0)
    found = diagnose(data, sheet, tmp_path / "out")
    assert is_named(found, part)
    assert f"link_compliance.{part}" in (tmp_path / "out" / "extended-model.toml").read_text()


def test_every_part_of_a_machine_has_its_tolerances_and_causes(tmp_path: Path) -> None:
    model = four_beams(tmp_path)
    data, sheet = measured(tmp_path, model, "hand", ("P",), "uz_mm", 1.0, seed=1)
    measurement = read_measurement(data, sheet)
    names = ["root", "upper", "fore", "hand"]
    coordinates = nuisance_coordinates(observe_ramps(measurement))
    for kind in ("modulus", "length"):
        assert [c.subject for c in coordinates if c.kind == kind] == names
    effects = catalogue(Scene(measurement.chain, measurement.engine, 100.0, 1.0))
    for cause in ("link_compliance", "link_length", "link_bow", "tension_compression_asymmetry"):
        assert [e.part for e in effects if e.cause == cause and e.part != "actuator"] == names
    assert len({e.label for e in effects}) == len(effects)


def test_single_link_needs_no_word_for_its_place() -> None:
    chain = load_chain("orthoglide-chain")
    assert (foot_of(chain), links_of(chain)) == ("foot", ["link"])
    labels = {e.label for e in catalogue(Scene(chain, VjmEngine(12), 1000.0, 1.0))}
    assert {"link_compliance", "foot_compliance", "link_length", "link_bow"} <= labels


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("part", ["root", "upper", "fore", "hand"])
def test_each_of_four_beams_is_named(tmp_path: Path, part: str, seed: int) -> None:
    data, sheet = measured(tmp_path, four_beams(tmp_path), part, ("P", "Q", "R"), "uz_mm", 2.0, seed)
    assert is_named(diagnose(data, sheet, tmp_path / "out"), part)
