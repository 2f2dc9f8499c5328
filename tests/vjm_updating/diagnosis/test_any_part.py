"""Causes sit in the parts of whatever machine a user has: the softened beam is named, whatever it is called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers import traced
from helpers.from_files import diagnose

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.machine import Machine
from vjm.model.parameters import compliance_factor
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.parameters import nuisance_coordinates
from vjm_updating.mechanisms.catalogue import catalogue
from vjm_updating.mechanisms.effect import Scene
from vjm_updating.mechanisms.modified_chain import foot_of, links_of

SOFTER, TOLERANCE = 1.207, traced.TOLERANCE
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
    """Data and sheet of a machine with one part softened."""

    def softer(chain: Machine) -> Machine:
        return compliance_factor(chain, soft).apply(chain, SOFTER)

    return traced.measured(folder, model, softer, postures, driven, reach, seed)


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


@pytest.mark.slow
@pytest.mark.parametrize("part", ["upper", "fore"])
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
        assert [e.part for e in effects if e.cause == cause and not e.part.startswith("j-")] == names
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
