"""An imported robot against Pinocchio's reading of the same URDF, mimics followed by this file's own arithmetic."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pinocchio

from helpers.urdf_arm import imported, written
from vjm.io.model_file import build_chain
from vjm.io.robot_document import Imported
from vjm.machine.equilibria import equilibria, unloaded_frames
from vjm.model.mechanism import Mechanism

ROBOTS = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
G = 9.81
# the worst of all robots are 2.3e-12 mm, and 1.4e-13 of the largest torque: rounding over some thirty joints
FRAMES, TORQUES = 1e-10, 1e-11
# rad/(N mm) and mm/N: springs so stiff that the machine's weight, up to 1e6 N mm, moves them by 1e-12
RIGID = 1e-18
JOINT = re.compile(r"<joint\b[^>]*?>.*?</joint>", re.DOTALL)


def attribute(text: str, tag: str, key: str, default: str) -> str:
    found = re.search(rf"<{tag}\b[^>]*?\b{key}\s*=\s*[\"']([^\"']*)", text)
    return found.group(1) if found else default


def mimics(file: Path) -> dict[str, tuple[str, float, float]]:
    """Master, multiplier and offset, SI, by follower."""
    text = re.sub(r"<!--.*?-->", "", file.read_text(encoding="utf-8", errors="replace"), flags=re.DOTALL)
    return {
        attribute(joint, "joint", "name", ""): (
            attribute(joint, "mimic", "joint", ""),
            float(attribute(joint, "mimic", "multiplier", "1")),
            float(attribute(joint, "mimic", "offset", "0")),
        )
        for joint in JOINT.findall(text)
        if "<mimic" in joint
    }


class Compared:
    """An imported robot beside Pinocchio's, whose joints all move by themselves.

    Attributes:
        frames: largest difference of a joint's frame, mm.
        rotations: of its rotation's entries.
        torques: largest difference of a holding torque over the largest; of whole robots only.
    """

    def __init__(self, file: Path, found: Imported, *, weighed: bool = True, postures: int = 20) -> None:
        self.robot = pinocchio.buildModelFromUrdf(str(file))
        self.robot.gravity.linear = np.array([0.0, 0.0, -G])
        self.data = self.robot.createData()
        self.found, self.mimics = found, mimics(file)
        document = tomllib.loads(found.text())
        for part in document["parts"]:
            for key in ("compliance_rad_per_Nmm", "compliance_mm_per_N"):
                if key in part:
                    part[key] = RIGID
        names = [part["name"] for part in document["parts"]]
        there = {
            raw: f"{label}-follows" if f"{label}-follows" in names else label for raw, label in found.joints.items()
        }
        self.there = {raw: label for raw, label in there.items() if self._placed(raw)}
        document["ends"] = {f"e{i}": label for i, label in enumerate(self.there.values())}
        self.model = Mechanism(build_chain(document, file.name).split())
        self.frames = self.rotations = self.torques = 0.0
        rng = np.random.default_rng(0)
        for _ in range(postures):
            self._compare(rng, weighed)

    def _placed(self, raw: str) -> bool:
        """Whether the joint has its own place: one off the way that others mimic stands at the base."""
        return not any(
            f"joint '{raw}', which" in line and "not on the way" in line for line in self.found.notes.changed
        )

    def slides(self, raw: str) -> bool:
        return self.robot.joints[self.robot.getJointId(raw)].shortname().startswith("JointModelP")

    def value(self, raw: str, q: dict[str, float]) -> float:
        """SI."""
        if raw in self.mimics:
            master, ratio, offset = self.mimics[raw]
            return ratio * self.value(master, q) + offset
        label = self.found.joints.get(raw)
        return 0.0 if label not in q else q[label] / (1e3 if self.slides(raw) else 1.0)

    def _compare(self, rng: np.random.Generator, weighed: bool) -> None:
        raw_of = {label: raw for raw, label in self.found.joints.items()}
        q = {
            name: rng.uniform(-1.0, 1.0) * (100.0 if self.slides(raw_of[name]) else 1.0)
            for name in self.model.joints
        }
        theirs = pinocchio.neutral(self.robot)
        for raw in self.robot.names[1:]:
            joint, value = self.robot.joints[self.robot.getJointId(raw)], self.value(raw, q)
            if joint.nq == 2:
                theirs[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            elif joint.nq == 1:
                theirs[joint.idx_q] = value
        pinocchio.forwardKinematics(self.robot, self.data, theirs)
        ours = self.model.command_rows(q)
        R, p = unloaded_frames(self.model, ours[0])
        for i, raw in enumerate(self.there):
            place = self.data.oMi[self.robot.getJointId(raw)]
            self.frames = max(self.frames, np.abs(p[0, i] - 1e3 * place.translation).max())
            self.rotations = max(self.rotations, np.abs(R[0, i] - place.rotation).max())
        if weighed:
            self._weigh(theirs, ours)

    def _weigh(self, theirs: np.ndarray, ours: np.ndarray) -> None:
        torque = pinocchio.computeGeneralizedGravity(self.robot, self.data, theirs)
        expected = dict.fromkeys(self.model.joints, 0.0)
        for raw in self.robot.names[1:]:
            value, at, share = torque[self.robot.joints[self.robot.getJointId(raw)].idx_v], raw, 1.0
            while at in self.mimics:
                at, ratio, _ = self.mimics[at]
                share *= ratio
            # N m/rad are 1e3 N mm/rad
            expected[self.found.joints[at]] += share * value * (1.0 if self.slides(at) else 1e3)
        found = equilibria(self.model, ours, gravity=(0.0, 0.0, -G)).torques[0]
        wanted = np.array([expected[name] for name in self.model.joints])
        largest = max(np.abs(wanted).max(), 1e-3)
        self.torques = max(self.torques, np.abs(found - wanted).max() / largest)


def agrees(folder: Path, text: str, like: str | None = None) -> Imported:
    """The import of a text is what Pinocchio reads of it, or of a text without what Pinocchio refuses."""
    found = imported(folder, text)
    compared = Compared(written(folder, like or text), found)
    assert compared.frames < FRAMES
    assert compared.rotations < 1e-12
    assert compared.torques < TORQUES
    return found
