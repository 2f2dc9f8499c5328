"""A URDF written as SDF, placed by Pinocchio: each link where it stands in the world, in frames drawn at random."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
from pinocchio.rpy import matrixToRpy, rpyToMatrix

from helpers.as_described import as_pinocchio_reads

Array = np.ndarray


def numbers(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)


class SdfOf:
    """The text of one robot.

    Link frames are moved away from those of the URDF at random, and poses are written in frames drawn at random:
    the model's, that of a link before, or that of a ``<frame>``; as angles in rad, degrees, or quaternions.
    """

    def __init__(self, file: Path, seed: int = 0, *, minor: int = 11) -> None:
        self.rng = np.random.default_rng(seed)
        self.minor = minor
        text = as_pinocchio_reads(file)
        self.urdf = ElementTree.fromstring(text)
        self.robot = pinocchio.buildModelFromXML(text)
        data = self.robot.createData()
        pinocchio.framesForwardKinematics(self.robot, data, pinocchio.neutral(self.robot))
        self.old = {
            frame.name: data.oMf[k]
            for k, frame in enumerate(self.robot.frames)
            if frame.type == pinocchio.FrameType.BODY
        }
        links = [link.get("name", "") for link in self.urdf.findall("link")]
        children = {joint.find("child").get("link") for joint in self.urdf.findall("joint")}
        self.root = next(name for name in links if name not in children)
        # the first link is where the world holds it, or the world would be another
        self.moved = {name: pinocchio.SE3.Identity() if name == self.root else self.some_place() for name in links}
        self.new = {name: self.old[name] * self.moved[name] for name in links}
        self.frames = {f"frame-{k}": self.some_place() for k in range(3)}
        self.written = ["__model__", *self.frames]

    def some_place(self) -> pinocchio.SE3:
        turn = pinocchio.exp3(self.rng.normal(size=3))
        return pinocchio.SE3(turn, 0.2 * self.rng.normal(size=3))

    def pose(self, T: pinocchio.SE3, usual: pinocchio.SE3 | None = None) -> str:
        """A pose of a frame ``T`` in the world; where it says no other, in the ``usual`` one."""
        base, said = usual, ""
        if self.minor > 6 and (usual is None or self.rng.random() < 0.5):
            name = str(self.rng.choice(self.written))
            said = f' relative_to="{name}"'
            base = {"__model__": pinocchio.SE3.Identity(), **self.frames, **self.new}[name]
        own = (base or pinocchio.SE3.Identity()).inverse() * T
        kind = self.rng.integers(3) if self.minor > 8 else 0
        if kind == 0:
            return f"<pose{said}>{numbers([*own.translation, *matrixToRpy(own.rotation)])}</pose>"
        if kind == 1:
            angles = np.degrees(matrixToRpy(own.rotation))
            return f'<pose{said} degrees="true">{numbers([*own.translation, *angles])}</pose>'
        quaternion = pinocchio.Quaternion(own.rotation).coeffs()
        return f'<pose{said} rotation_format="quat_xyzw">{numbers([*own.translation, *quaternion])}</pose>'

    def link(self, element: ElementTree.Element) -> str:
        name = element.get("name", "")
        pose = self.pose(self.new[name], pinocchio.SE3.Identity())
        self.written.append(name)
        inertial = element.find("inertial")
        if inertial is None or inertial.find("mass") is None:
            return f'<link name="{name}">{pose}</link>'
        own = pinocchio.SE3.Identity()
        if (origin := inertial.find("origin")) is not None:
            xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
            own = pinocchio.SE3(rpyToMatrix(rpy), xyz)
        own = self.moved[name].inverse() * own
        angles = matrixToRpy(own.rotation)
        moments = inertial.find("inertia")
        given = "".join(
            f"<{key}>{value}</{key}>" for key, value in (moments.attrib if moments is not None else {}).items()
        )
        return (
            f'<link name="{name}">{pose}<inertial><pose>{numbers([*own.translation, *angles])}</pose>'
            f"<mass>{inertial.find('mass').get('value')}</mass><inertia>{given}</inertia></inertial></link>"
        )

    def joint(self, element: ElementTree.Element) -> str:
        name, kind = element.get("name", ""), element.get("type", "")
        parent, child = (element.find(tag).get("link") for tag in ("parent", "child"))
        # the joint's frame may be turned against the URDF's about its origin, which is where the joint is
        turned = self.old[child] * pinocchio.SE3(pinocchio.exp3(self.rng.normal(size=3)), np.zeros(3))
        text = f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>'
        text += self.pose(turned, self.new[child])
        if kind == "fixed":
            return text + "</joint>"
        given = element.find("axis")
        axis = np.array((given.get("xyz", "1 0 0") if given is not None else "1 0 0").split(), dtype=float)
        in_world = self.old[child].rotation @ axis
        text += "<axis>" + self.axis(turned.rotation.T @ in_world, in_world)
        limit = element.find("limit")
        if limit is not None and kind != "continuous":
            ends = (f"<{key}>{limit.get(key, '0')}</{key}>" for key in ("lower", "upper"))
            text += f"<limit>{''.join(ends)}</limit>"
        if (mimic := element.find("mimic")) is not None:
            ratio, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
            reference = float(self.rng.normal())
            text += (
                f'<mimic joint="{mimic.get("joint")}"><multiplier>{ratio!r}</multiplier><reference>{reference!r}'
                f"</reference><offset>{offset + ratio * reference!r}</offset></mimic>"
            )
        return text + "</axis></joint>"

    def axis(self, own: Array, in_model: Array) -> str:
        """An axis in the joint's frame, or expressed in that of the model."""
        if self.minor <= 4:
            return f"<xyz>{numbers(in_model)}</xyz>"
        if self.rng.random() < 0.5:
            return f"<xyz>{numbers(own)}</xyz>"
        if self.minor <= 6:
            return f"<xyz>{numbers(in_model)}</xyz><use_parent_model_frame>true</use_parent_model_frame>"
        return f'<xyz expressed_in="__model__">{numbers(in_model)}</xyz>'

    def text(self) -> str:
        frames = "".join(
            f'<frame name="{name}"><pose>{numbers([*T.translation, *matrixToRpy(T.rotation)])}</pose></frame>'
            for name, T in self.frames.items()
            if self.minor > 6
        )
        # a URDF's link of this name is what SDF has for every file
        links = "".join(self.link(link) for link in self.urdf.findall("link") if link.get("name") != "world")
        joints = "".join(self.joint(joint) for joint in self.urdf.findall("joint"))
        model = f'<model name="{self.urdf.get("name")}">{frames}{links}{joints}</model>'
        return f'<?xml version="1.0"?><sdf version="1.{self.minor}">{model}</sdf>'
