"""Tests of one joint with hidden causes: models, sheets and readings.

Nothing here is of the finder. A gear of three slopes is a broken line through its kinks, with sharp corners. A
spring that hardens has a torque that is a sum of two powers of its wind-up, or a wind-up that is one of its torque.
Backlash is a dead zone with hard ends. Friction is a slider behind a spring, stepped finely between readings, or
Dahl's law, which has no corner.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from helpers.file_texts import instruments_text, model_text, part_text, table_text

from vjm.rotations import Array

NOMINAL = 1e-7
"""Compliance in the model, rad/(N mm)."""
RATED = 5e4
"""Rated torque, N mm."""
NOISE, ZERO, SCALE = 60.0, 100.0, 0.005
"""Of the cell: N mm, N mm, relative."""
ANGLE_NOISE, ANGLE_ZERO, ANGLE_SCALE = 2e-6, 2e-5, 5e-4
"""Of the gauge of angles: rad, rad, relative."""
FINE = 60
"""Steps of friction between two readings."""
MODEL = model_text(
    "joint",
    part_text("actuated", "elbow", axis="y", compliance_rad_per_Nmm=NOMINAL),
    part_text("link", "fore", translation_mm=[300.0, 0.0, 0.0]),
    postures={"home": {"elbow": 0.0}},
)
SHEET = (
    'kind = "joint"\n'
    + table_text("test", title="Elbow, motor locked", model="joint.toml", joint="elbow")
    + instruments_text(angle_rad=(ANGLE_NOISE, ANGLE_ZERO, ANGLE_SCALE), torque_Nmm=(NOISE, ZERO, SCALE))
)


@dataclass(frozen=True)
class HiddenJoint:
    """What a joint has, and its numbers by the names that a diagnosis reports.

    Attributes:
        stiffness: of the spring at no load, N mm/rad.
        spring: straight, three slopes, cubic or hyperbolic.
        kinks: torques T1 and T2 of three slopes.
        slopes: K1, K2, K3 over the stiffness at no load.
        bend: of the others: share of the wind-up that hardening takes away at the largest torque.
        gap: whole free travel, rad.
        friction: torque at which it slips, N mm.
        presliding: elastic turn before, rad.
        smooth: friction by Dahl's law.
        torque: largest of the test, N mm.
        steps: readings from zero to that.
        cycles: of the test.
    """

    stiffness: float = 1.0 / NOMINAL
    spring: str = "straight"
    kinks: tuple[float, float] = (1e4, 3e4)
    slopes: tuple[float, float, float] = (1.0, 1.0, 1.0)
    bend: float = 0.0
    gap: float = 0.0
    friction: float = 0.0
    presliding: float = 1e-5
    smooth: bool = False
    torque: float = RATED
    steps: int = 25
    cycles: int = 1
    causes: tuple[str, ...] = field(default=())

    def wound(self, torque: Array) -> Array:
        """Wind-up ``(n,)`` of the spring under torques ``(n,)``, rad."""
        size = np.abs(torque)
        if self.spring == "three slopes":
            k1, k2, k3 = self.stiffness * np.array(self.slopes)
            t1, t2 = self.kinks
            far = max(10.0 * t2, 3.0 * float(size.max(initial=0.0)))
            at = [0.0, t1 / k1, t1 / k1 + (t2 - t1) / k2, t1 / k1 + (t2 - t1) / k2 + (far - t2) / k3]
            x = np.interp(size, [0.0, t1, t2, far], at)
        elif self.spring == "hyperbolic":
            # its compliance falls as a hyperbola of the torque
            a = 2.0 * self.bend / (1.0 - self.bend) / self.torque
            x = np.log1p(a * size) / (a * self.stiffness)
        elif self.spring == "cubic":
            end = self.torque / self.stiffness * (1.0 - self.bend)
            third = (self.torque - self.stiffness * end) / end**3
            fine = np.linspace(0.0, 1.5 * end, 4001)
            x = np.interp(size, self.stiffness * fine + third * fine**3, fine)
        else:
            x = size / self.stiffness
        return np.sign(torque) * x

    def spring_torque(self, angle: Array) -> Array:
        """Torques ``(n,)`` of spring and dead zone at angles ``(n,)``, N mm, found by halving."""
        wanted = np.maximum(np.abs(angle) - 0.5 * self.gap, 0.0)
        low, high = np.zeros(len(angle)), np.full(len(angle), 3.0 * self.torque)
        for _ in range(70):
            middle = 0.5 * (low + high)
            short = self.wound(middle) < wanted
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        result: Array = np.sign(angle) * 0.5 * (low + high)
        return result

    def torques(self, angles: Array) -> Array:
        """Torques ``(n,)`` on the output along angles ``(n,)``, N mm."""
        held, found, before = 0.0, [], 0.0
        for a in angles.tolist():
            step = (a - before) / FINE
            for _ in range(FINE if self.friction else 0):
                if self.smooth:
                    held += self.friction / self.presliding * step * (1.0 - held / self.friction * np.sign(step))
                    held = float(np.clip(held, -self.friction, self.friction))
                else:
                    most = self.friction
                    held = float(np.clip(held + most / self.presliding * step, -most, most))
            found.append(held)
            before = a
        return self.spring_torque(angles) + np.array(found)

    def angles(self) -> Array:
        """The path: out and back in both directions, rad."""
        most = float(self.wound(np.array([self.torque]))[0]) + 0.5 * self.gap
        up = np.linspace(0.0, most, self.steps + 1)[1:]
        one = np.concatenate([up, up[-2::-1], [0.0], -up, -up[-2::-1], [0.0]])
        return np.tile(one, self.cycles)

    def truth(self) -> dict[str, float]:
        """Its numbers by the names of a diagnosis' parameters."""
        found = {}
        if "actuator_three_slopes" in self.causes:
            for name, share in zip(("K1", "K2", "K3"), self.slopes, strict=True):
                found[f"actuator_three_slopes.{name}_Nmm_per_rad"] = share * self.stiffness
            for name, kink in zip(("T1", "T2"), self.kinks, strict=True):
                found[f"actuator_three_slopes.{name}_Nmm"] = kink
        if "actuator_compliance" in self.causes:
            found["actuator_compliance.compliance_rad_per_Nmm"] = 1.0 / self.stiffness - NOMINAL
        if "actuator_hardening" in self.causes:
            found["actuator_hardening.compliance_rad_per_Nmm"] = 1.0 / self.stiffness
        if self.gap:
            found["actuator_backlash.gap_rad"] = self.gap
        if self.friction:
            found["joint_friction.torque_Nmm"] = self.friction
            if not self.smooth:
                found["joint_friction.presliding_rad"] = self.presliding
        return found


def drawn(seed: int) -> HiddenJoint:
    """A joint of a seed: nothing, one cause or two, weak to strong, loaded to 5 to 100 % of the rated torque."""
    rng = np.random.default_rng([seed, 20261128])
    torque = RATED * float(np.exp(rng.uniform(np.log(0.05), 0.0)))
    own: dict[str, Any] = {
        "torque": torque, "steps": int(rng.integers(12, 40)), "cycles": int(rng.choice([1, 1, 2, 3])),
    }  # fmt: skip
    kind = str(rng.choice(["none", "spring", "backlash", "friction", "two"], p=[0.15, 0.35, 0.1, 0.15, 0.25]))
    parts = list(rng.choice(["spring", "backlash", "friction"], 2, replace=False)) if kind == "two" else [kind]
    causes: list[str] = []
    if "spring" in parts:
        law = str(rng.choice(["straight", "three slopes", "cubic", "hyperbolic"], p=[0.25, 0.4, 0.2, 0.15]))
        own["spring"] = law
        if law == "straight":
            own["stiffness"] = float(rng.choice([0.5, 0.7, 1.4, 2.0]) * np.exp(rng.normal(0.0, 0.1)) / NOMINAL)
            causes.append("actuator_compliance")
        elif law == "three slopes":
            first = float(rng.uniform(1.2, 1.7))
            own["slopes"] = (1.0, first, first * float(rng.uniform(1.05, 1.6)))
            kink = float(rng.uniform(0.08, 0.6)) * torque
            own["kinks"] = (kink, kink * float(rng.uniform(2.5, 3.7)))
            own["stiffness"] = float(np.exp(rng.normal(0.0, 0.2)) / NOMINAL)
            causes.append("actuator_three_slopes")
        else:
            own["bend"] = float(rng.uniform(0.1, 0.4))
            own["stiffness"] = float(np.exp(rng.normal(0.0, 0.2)) / NOMINAL)
            causes.append("actuator_hardening")
    if "backlash" in parts:
        own["gap"] = float(np.exp(rng.uniform(np.log(2e-5), np.log(5e-4))))
        causes.append("actuator_backlash")
    if "friction" in parts:
        own["friction"] = torque * float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))))
        own["presliding"] = float(np.exp(rng.uniform(np.log(1e-7), np.log(1e-4))))
        own["smooth"] = bool(rng.random() < 0.2)
        causes.append("joint_friction")
    return HiddenJoint(**own, causes=tuple(causes))


def write(folder: Path, joint: HiddenJoint, seed: int) -> tuple[Path, Path]:
    """Model, sheet and readings of a test; errors of the instruments are drawn with the noise."""
    rng = np.random.default_rng([seed, 7])
    turned = joint.angles()
    borne = joint.torques(turned)
    angle = turned * (1.0 + ANGLE_SCALE * rng.standard_normal()) + ANGLE_ZERO * rng.standard_normal()
    torque = borne * (1.0 + SCALE * rng.standard_normal()) + ZERO * rng.standard_normal()
    angle = angle + ANGLE_NOISE * rng.standard_normal(len(turned))
    torque = torque + NOISE * rng.standard_normal(len(turned))
    lines = ["angle_rad,torque_Nmm", *(f"{a:.9g},{t:.7g}" for a, t in zip(angle, torque, strict=True))]
    (folder / "joint.toml").write_text(MODEL)
    (folder / "sheet.toml").write_text(SHEET)
    (folder / "readings.csv").write_text("\n".join(lines) + "\n")
    return folder / "readings.csv", folder / "sheet.toml"


def strengths(joint: HiddenJoint) -> dict[str, float]:
    """By cause the standard deviations by which readings miss the best joint without it.

    Errors of the instruments are marginalised. Beside causes that are not the stiffness itself, that is free.
    """
    angles = joint.angles()
    here = joint.torques(angles)
    found = {}
    for cause in joint.causes:
        less = {"actuator_backlash": {"gap": 0.0}, "joint_friction": {"friction": 0.0}}.get(
            cause, {"spring": "straight", "bend": 0.0, "stiffness": 1.0 / NOMINAL}
        )
        numbers = {name: getattr(joint, name) for name in joint.__dataclass_fields__}
        r = here - HiddenJoint(**(numbers | less)).torques(angles)
        slope = 1e3 if cause != "actuator_compliance" else SCALE
        columns = np.column_stack([np.full(len(r), np.hypot(ZERO, ANGLE_ZERO / NOMINAL)), slope * here])
        noise = NOISE**2 + (ANGLE_NOISE * joint.stiffness) ** 2
        W = columns / np.sqrt(noise)
        w = r / np.sqrt(noise)
        left = w @ w - w @ W @ np.linalg.solve(np.eye(2) + W.T @ W, W.T @ w)
        found[cause] = float(np.sqrt(max(left, 0.0)))
    return found
