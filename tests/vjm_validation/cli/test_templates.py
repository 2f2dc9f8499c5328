"""Templates of `validate new`: against hand values, finite elements, and the same machines made in Python."""

import numpy as np
import pytest
from helpers import template_machines
from helpers.command import validate

import vjm
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.postures import in_posture
from vjm_fea.exudyn.engine import ExudynEngine

PYTHON = {
    "axis": template_machines.axis, "gantry": template_machines.gantry, "boom": template_machines.boom,
    "scara": template_machines.scara, "five-bar": template_machines.five_bar, "delta": template_machines.delta,
}  # fmt: skip


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    folder = tmp_path_factory.mktemp("templates")
    found = {}
    for kind in PYTHON:
        validate("new", kind, folder / f"my-{kind}.toml")
        validate("check", "--strict", folder / f"my-{kind}.toml")
        found[kind] = vjm.load(folder / f"my-{kind}.toml")
    return found


def hand_values(kind: str, machine: Machine) -> list[tuple[str, str, float]]:
    """Postures, components and compliances there in mm/N, by the theory of slender beams."""
    beams = {beam.name: beam.section for beam in machine.beams}

    def clamped(section: vjm.Section, at: float, length: float) -> float:
        return at**3 * (length - at) ** 3 / (3.0 * section.EIy * length**3)

    def on_tip(section: vjm.Section, length: float, beyond: float) -> float:
        """At a point ``beyond`` the tip of a cantilever, rigid from there on."""
        return (length**3 / 3.0 + length**2 * beyond + length * beyond**2) / section.EIy

    match kind:
        case "axis":
            return [(p, "z", clamped(beams["profile"], x, 1000.0)) for p, x in (("middle", 500.0), ("end", 100.0))]
        case "gantry":
            behind = 3e-5 + 400.0 / beams["ram"].EA
            return [
                (p, "z", clamped(beams["bridge"], x, 1200.0) + behind)
                for p, x in (("middle", 600.0), ("corner", 150.0))
            ]
        case "boom":
            return [
                (p, "z", 2e-10 * (2000.0 + x) ** 2 + on_tip(beams["outer"], 2000.0, x) + 5e-10 * x**2
                 + on_tip(beams["inner"], x, 0.0))
                for p, x in (("short", 200.0), ("long", 1500.0))
            ]  # fmt: skip
        case "scara":
            return [
                ("stretched", "z", 2e-9 * 600.0**2 + on_tip(beams["upper"], 350.0, 250.0) + 4e-9 * 250.0**2
                 + on_tip(beams["fore"], 250.0, 0.0) + 2e-5)
            ]  # fmt: skip
        case "five-bar":
            arm, rod = beams["left-arm"], beams["left-rod-tube"]
            long = float(np.hypot(250.0, 200.0))
            pull = 0.5 / (200.0 / long)
            # the rod's direction seen along and across the arm, (-150, 200)/250
            along, across = (pull * abs(np.dot([250.0, 200.0], e)) / long for e in ([-0.6, 0.8], [0.8, 0.6]))
            side = pull**2 * long / rod.EA + along**2 * 250.0 / arm.EA
            return [("drawn", "y", 2.0 * (side + across**2 * (250.0**3 / (3.0 * arm.EIz) + 5e-8 * 250.0**2)))]
        case "delta":
            arm, rod = beams["arm-a"], beams["rod-a1"]
            steep = np.sqrt(400.0**2 - 310.0**2) / 400.0
            pull = 1.0 / (6.0 * steep)
            out = 2.0 * pull * 310.0 / 400.0
            bent = (1.0 / 3.0) ** 2 * (200.0**3 / (3.0 * arm.EIy) + 5e-8 * 200.0**2)
            return [("drawn", "z", 6.0 * pull**2 * 400.0 / rod.EA + 3.0 * (bent + out**2 * 200.0 / arm.EA))]
    raise ValueError(kind)


@pytest.mark.parametrize("kind", PYTHON)
def test_small_deflections_are_those_by_hand(machines, kind):
    for posture, component, compliance in hand_values(kind, machines[kind]):
        k, load = COMPONENTS.index(component), np.zeros(6)
        load[k] = -1.0
        found = vjm.stiffness(machines[kind], posture, wrench=tuple(load.tolist()))
        # the second order: 0.006 mm of the five-bar's 400 mm, 3e-5
        assert found.displacement[k] == pytest.approx(-compliance, rel=1e-4), posture


@pytest.mark.parametrize("kind", PYTHON)
def test_finite_elements_agree_under_weight_and_a_load(machines, kind):
    machine = machines[kind]
    posture = list(machine.postures)[-1]
    push = Load((30.0, -60.0, -200.0, 0.0, 0.0, 0.0), "")
    case = LoadCase(posture, 1.0, "load", free=COMPONENTS, loads=(push,), gravity=(0.0, 0.0, -9.81), steps=1)
    engines = vjm.VjmEngine(8), ExudynEngine(elements=8)
    found, other = (engine.trace(machine, case).points[-1].displacement[:3] for engine in engines)
    # 8 elements a beam: of fourth order in their length, and of the second in what they bend by
    assert other == pytest.approx(found, abs=1e-4 * np.abs(found).max())


@pytest.mark.parametrize("kind", PYTHON)
def test_python_makes_the_same_machine(machines, kind):
    mine = PYTHON[kind]()
    wrench = (30.0, -60.0, -200.0, 0.0, 0.0, 0.0)
    for label, held in machines[kind].held.items():
        # loops close from the drives' coordinates
        posture = dict(held) if machines[kind].closes else label
        one, other = (
            vjm.stiffness(machine, posture, wrench=wrench, gravity=(0.0, 0.0, -9.81), engine=vjm.VjmEngine(2))
            for machine in (mine, machines[kind])
        )
        # places in the files have six decimals
        assert one.displacement == pytest.approx(other.displacement, rel=1e-6, abs=1e-9)


def test_mujocos_format_has_the_gantry_where_it_is(machines, tmp_path):
    """Its base is off the world's origin, where the closure of the right rail is."""
    pytest.importorskip("mujoco", reason="MuJoCo, which reads what is written, is not installed")
    written, back = tmp_path / "gantry.xml", tmp_path / "back.toml"
    written.write_text(vjm.robot_text(machines["gantry"], "mjcf").text, encoding="utf-8")
    validate("import", written, "--out", back)
    read = vjm.load(back)
    for posture in ({"y": 0.0, "x": 50.0, "z": 300.0}, {"y": 400.0, "x": 900.0, "z": 20.0}):
        ends = [
            LoopClosure(*in_posture(machine, posture)).end[:3, 3] for machine in (machines["gantry"], read)
        ]  # fmt: skip
        # metres with all digits, and a few shifts of 1 m in doubles
        assert ends[1] == pytest.approx(ends[0], abs=1e-9)
