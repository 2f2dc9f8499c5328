"""The catalogue: MEASURED's causes are all there, and a file of one's own is one of them."""

import re

import numpy as np
import pytest
from helpers import linear_arm

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm_updating.mechanisms.catalogue import catalogue, errors_within, plug_in
from vjm_updating.mechanisms.effect import ExperimentContext
from vjm_updating.mechanisms.hysteresis import Creep
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of

MECHANICAL = {
    "link_lumping", "foot_lumping", "actuator_compliance", "actuator_hardening", "actuator_backlash",
    "joint_clearance", "joint_friction", "contact_compliance", "base_compliance", "foot_compliance",
    "link_compliance", "link_bow", "link_length", "load_misalignment", "tension_compression_asymmetry", "gravity",
    "creep", "plasticity",
}  # fmt: skip


def scene(segments=None):
    chain = load_chain("orthoglide-chain")
    return ExperimentContext(chain, VjmEngine(segments), force=3000.0, reach=2.0, duration=600.0, interval=2.0)


def test_every_cause_is_there():
    causes = {e.cause for segments in (None, 8) for e in catalogue(scene(segments))}
    assert causes == MECHANICAL


def test_an_error_in_a_file_of_ones_own_names_its_line(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("def effects(scene):\n    return scene.nothing\n")
    make = plug_in(file)
    with pytest.raises(ValueError, match=f"^{re.escape(str(file))}:2: AttributeError: "), errors_within([file]):
        make(scene())
    # what is not of the file stays what it was
    with pytest.raises(KeyError), errors_within([file]):
        raise KeyError


PAPER = [
    "link_lumping", "foot_lumping", "actuator_compliance", "actuator_hardening", "actuator_backlash",
    "joint_clearance", "joint_friction", "contact_compliance.actuator", "contact_compliance.joints",
    "base_compliance", "foot_compliance", "link_compliance", "link_length", "load_misalignment",
    "tension_compression_asymmetry.actuator", "tension_compression_asymmetry.foot",
    "tension_compression_asymmetry.link", "creep.foot", "creep.link",
    "plasticity.actuator", "plasticity.foot", "plasticity.joints",
]  # fmt: skip


def test_a_foot_and_one_link_have_these_causes_in_these_places():
    assert [effect.label for effect in catalogue(scene())] == PAPER
    split = [effect.label for effect in catalogue(scene(8))]
    assert sorted(split) == sorted({*PAPER, "link_bow", "gravity"} - {"link_lumping"})


ARM = linear_arm.arm("upper", "fore", "hand")
BY_LINK = (
    "joint_clearance", "contact_compliance", "plasticity", "creep", "tension_compression_asymmetry",
    "link_compliance", "link_length", "link_bow",
)  # fmt: skip
BY_JOINT = (
    "actuator_compliance", "actuator_hardening", "actuator_backlash", "plasticity", "creep",
    "tension_compression_asymmetry",
)  # fmt: skip


ALONG = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def arm_scene(tmp_path, angles, change=lambda text: text, **more):
    file = tmp_path / "arm.toml"
    file.write_text(change(linear_arm.model(ARM, angles)))
    return ExperimentContext(load_chain(file), VjmEngine(8), 500.0, 1.0, 100.0, 1.0, **more)


def parts(found, cause, joints=False):
    """Links in which a cause is looked for, or joints, whose names begin with j."""
    return [effect.part for effect in found if effect.cause == cause and effect.part.startswith("j-") is joints]


def test_every_link_of_an_arm_has_every_cause_of_links(tmp_path):
    found = catalogue(arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)}))
    for cause in BY_LINK:
        assert parts(found, cause) == ["upper", "fore", "hand"], cause
    assert len({effect.label for effect in found}) == len(found)


def test_every_joint_of_an_arm_has_every_cause_of_drives(tmp_path):
    found = catalogue(arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)}))
    for cause in BY_JOINT:
        assert parts(found, cause, joints=True) == ["j-upper", "j-fore", "j-hand"], cause

    def rigid(text):
        return text.replace("compliance_rad_per_Nmm = 1e-9", "")

    # what has no spring has none that relaxes
    found = catalogue(arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)}, rigid))
    causes = [cause for cause in BY_JOINT if parts(found, cause, joints=True)]
    assert causes == [cause for cause in BY_JOINT if cause != "creep"]


def test_links_in_one_line_are_one_place_for_what_slips_along_it(tmp_path):
    postures = {"straight": (0.3, 0.0, 0.6), "bent": (0.1, 0.5, 0.7)}
    found = catalogue(arm_scene(tmp_path, postures, rays=(("straight", ALONG),)))
    for cause in ("joint_clearance", "contact_compliance", "plasticity"):
        assert parts(found, cause) == ["upper or fore", "hand"], cause
    # what bends is another thing in each
    assert parts(found, "creep") == ["upper", "fore", "hand"]
    both = catalogue(arm_scene(tmp_path, postures, rays=(("straight", ALONG), ("bent", ALONG))))
    assert parts(both, "joint_clearance") == ["upper", "fore", "hand"]


def test_what_a_test_only_bends_does_not_differ_between_pull_and_push(tmp_path):
    # all in one plane, of which the end-effector is taken out
    flat = {"P": (0.4, 0.0, 0.9)}
    across, along = tuple(np.eye(6)[2]), ALONG
    out_of_plane = catalogue(arm_scene(tmp_path, flat, _about_z, rays=(("P", across),)))
    assert parts(out_of_plane, "tension_compression_asymmetry") == []
    both = catalogue(arm_scene(tmp_path, flat, _about_z, rays=(("P", across), ("P", along))))
    assert parts(both, "tension_compression_asymmetry") == ["upper", "fore", "hand"]


def _about_z(text):
    return text.replace('axis = "y"', 'axis = "z"')


def test_only_a_link_with_a_joint_has_play(tmp_path):
    def clamped(text):
        """Without the joints on either side of the upper beam, which turn by nothing."""
        return re.sub(r'\[\[parts\]\]\nkind = "actuated"\nname = "j-(upper|fore)"(\n.+){2}\n', "", text).replace(
            "j-upper = 0.0, j-fore = 0.0, ", ""
        )

    found = catalogue(arm_scene(tmp_path, {"P": (0.0, 0.0, 0.7)}, clamped))
    assert parts(found, "joint_clearance") == ["fore", "hand"]
    assert parts(found, "plasticity") == ["upper or fore", "hand"]


def test_the_weight_is_that_of_every_link(tmp_path):
    own = arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)})
    gravity = next(effect for effect in catalogue(own) if effect.cause == "gravity")
    weights = dict(gravity.machine(own.machine, (4.0,)).weight)
    volumes = {link.name: link.EA * link.length for link in ARM}
    # shares of 4 kg: rounding
    assert weights == pytest.approx(
        {name: 4.0 * v / sum(volumes.values()) for name, v in volumes.items()}, rel=1e-12
    )


@pytest.mark.parametrize("axis", range(3))
def test_a_device_is_turned_about_whatever_axis_it_drives_along(tmp_path, axis):
    own = arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)}, rays=(("P", tuple(-np.eye(6)[axis])),))
    tilt = next(effect for effect in catalogue(own) if effect.cause == "load_misalignment")
    assert tilt.axis == tuple(np.eye(3)[axis])
    went = tilt.tilted((0.02, 0.01))
    # both angles tilt it, whichever way it goes
    assert np.arccos(went[axis]) == pytest.approx(np.hypot(0.02, 0.01), rel=1e-9)


def test_a_links_asymmetry_contains_that_links_compliance_only(tmp_path):
    found = {effect.label: effect for effect in catalogue(arm_scene(tmp_path, {"P": (0.1, 0.5, 0.7)}))}
    assert found["tension_compression_asymmetry.fore"].contains == ("link_compliance.fore",)
    only = {effect.label: effect for effect in catalogue(scene(8))}
    assert only["tension_compression_asymmetry.link"].contains == ("link_compliance",)


def test_lumping_is_a_cause_of_lumped_models_only():
    assert "link_lumping" in {e.cause for e in catalogue(scene())}
    assert "link_lumping" not in {e.cause for e in catalogue(scene(8))}
    assert "link_bow" not in {e.cause for e in catalogue(scene())}


def test_column_without_foot_or_drive_has_no_such_causes():
    column = ExperimentContext(load_chain("pinned-column"), VjmEngine(16), force=500.0, reach=1.0)
    found = {e.label for e in catalogue(column)}
    assert not [label for label in found if "foot" in label or "actuator" in label]
    assert "creep" not in {label.partition(".")[0] for label in found}


@pytest.mark.parametrize("part", ["foot", "link"])
@pytest.mark.parametrize(("as_drawn", "same"), [(1.0, True), (-1.0, False)])
def test_one_way_of_an_asymmetry_may_be_as_drawn(part, as_drawn, same):
    ratio = 1.3
    effect = next(e for e in catalogue(scene(8)) if e.label == f"tension_compression_asymmetry.{part}")
    nominal = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))
    changed = effect.machine(nominal, (ratio, as_drawn))
    for pulls in (True, False):
        drawn, made = (beam_of(m.chain(pulls), effect.beam).effective_section().EA for m in (nominal, changed))
        factor = 1.0 if pulls is same else (ratio if pulls else 1.0 / ratio)
        # a root and a few products of doubles
        assert made == pytest.approx(drawn * factor, rel=1e-12)


def test_times_of_creep_are_any_between_a_readings_and_the_tests():
    time = Creep(duration=1200.0, interval=2.0).quantities()[1]
    logarithms = np.linspace(np.log(2.0), np.log(1200.0), 10_001)
    # the standard deviation of n even steps is √(1 + 2/n) of an even distribution's: twice what that is more
    assert time.spread == pytest.approx(np.std(logarithms), rel=2e-4)
    # rounding of a sum of ten thousand logarithms
    assert np.log(time.usual) == pytest.approx(np.mean(logarithms), rel=1e-12)


def test_trials_lie_within_the_bounds_and_act():
    for effect in catalogue(scene(8)):
        for trial in effect.trials():
            assert len(trial) == len(effect.quantities())
            for q, v in zip(effect.quantities(), trial, strict=True):
                assert q.low <= v <= q.high, effect.label
                # a logarithm and back: rounding
                assert q.value(q.coordinate(v)) == pytest.approx(v, rel=1e-13) if v or not q.log else True
        machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))
        trial = effect.trials()[0]
        pose = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
        acts = (
            effect.machine(machine, trial) != machine
            or effect.elements(machine, trial)
            or effect.relaxation(machine, trial)
            or np.any(effect.friction(trial))
            or not np.array_equal(effect.imposed(pose, trial), pose)
        )
        assert acts, effect.label


PLUG_IN = """
from dataclasses import dataclass
from vjm_updating.mechanisms.effect import Effect, Quantity

@dataclass(frozen=True)
class Magnet(Effect):
    cause = "magnet"
    title = "a magnet pulls"
    def quantities(self):
        return (Quantity("pull_N", 0.0, 100.0, 1.0, neutral=0.0),)
    def trials(self):
        return [(5.0,)]

def effects(scene):
    return [Magnet()]
"""


def test_a_file_of_ones_own_is_a_cause(tmp_path):
    file = tmp_path / "magnet.py"
    file.write_text(PLUG_IN)
    assert "magnet" in {e.cause for e in catalogue(scene(), [plug_in(file)])}


@pytest.mark.parametrize(
    ("text", "says"), [("", "no function effects"), ("1/0", "ZeroDivisionError"), (None, "no Python file")]
)
def test_a_bad_file_is_named(tmp_path, text, says):
    file = tmp_path / "bad.py"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ValueError, match=says) as error:
        plug_in(file)
    assert "bad.py" in str(error.value)
