"""Draw the example parts and write their STEP files: ``python make_parts.py FOLDER``.

Needs the extra ``vjm-stiffness[solid]``. What is learnt from the parts stands in docs/solid-parts.md.
"""

import re
import sys
from pathlib import Path
from typing import Any

import gmsh

from vjm_fea.solid.drawing import gmsh_session


def slotted_foot(occ: Any) -> None:
    """A foot of 120 mm along x with a section of 30 × 20 mm and a slot of 60 × 10 mm through it along z."""
    body = occ.addBox(0.0, -15.0, -10.0, 120.0, 30.0, 20.0)
    slot = occ.addBox(30.0, -5.0, -10.0, 60.0, 10.0, 20.0)
    ends = [occ.addCylinder(x, 0.0, -10.0, 0.0, 0.0, 20.0, 5.0) for x in (30.0, 90.0)]
    occ.cut([(3, body)], [(3, slot), *[(3, end) for end in ends]])


def l_bracket(occ: Any) -> None:
    """A bracket of two legs, 100 and 70 mm long, 20 mm wide and 10 mm thick, with a fillet of 6 mm inside."""
    floor = occ.addBox(0.0, -10.0, 0.0, 100.0, 20.0, 10.0)
    wall = occ.addBox(0.0, -10.0, 10.0, 10.0, 20.0, 60.0)
    inside = occ.addBox(10.0, -10.0, 10.0, 6.0, 20.0, 6.0)
    round_ = occ.addCylinder(16.0, -10.0, 16.0, 0.0, 20.0, 0.0, 6.0)
    fillet, _ = occ.cut([(3, inside)], [(3, round_)])
    occ.fuse([(3, floor)], [(3, wall), *fillet])


def flanged_tube(occ: Any) -> None:
    """A tube of 40 mm outside and 3 mm wall along x, 200 mm long with its flange, a disc of 80 by 8 mm."""
    flange = occ.addCylinder(0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 40.0)
    tube = occ.addCylinder(8.0, 0.0, 0.0, 192.0, 0.0, 0.0, 20.0)
    bore = occ.addCylinder(0.0, 0.0, 0.0, 200.0, 0.0, 0.0, 17.0)
    joined, _ = occ.fuse([(3, flange)], [(3, tube)])
    occ.cut(joined, [(3, bore)])


PARTS = {"slotted-foot": slotted_foot, "l-bracket": l_bracket, "flanged-tube": flanged_tube}
ENDS = {
    "slotted-foot": {"base": (0.0, None, None), "tip": (120.0, None, None)},
    "l-bracket": {"base": (100.0, None, None), "tip": (None, None, 70.0)},
    "flanged-tube": {"base": (0.0, None, None), "tip": (200.0, None, None)},
}
"""Planes in which the faces lie that get these names."""


def names_of(part: str) -> list[str]:
    """Names of the faces of the part that gmsh holds, in its order."""
    names = []
    for _, face in gmsh.model.getEntities(2):
        low, high = (gmsh.model.getBoundingBox(2, face)[k : k + 3] for k in (0, 3))
        inside = [
            name
            for name, plane in ENDS[part].items()
            if all(
                p is None or (abs(a - p) < 1e-3 and abs(b - p) < 1e-3)
                for p, a, b in zip(plane, low, high, strict=True)
            )
        ]
        names.append(inside[0] if inside else "")
    return names


def normalised(text: str, part: str, names: list[str]) -> str:
    """A STEP text that only depends on the part, with its faces named.

    The writer notes the time and how many files this process has written before.
    """
    header = f"'{part}','1970-01-01T00:00:00',(''),(''),'','',''"
    text = re.sub(r"(FILE_NAME\s*\().*?(\);)", rf"\1{header}\2", text, flags=re.DOTALL)
    text = re.sub(r"Open CASCADE STEP translator [\d.]+(\s+[\d.]+)?", part, text)
    (listed,) = re.findall(r"CLOSED_SHELL\s*\(\s*'[^']*'\s*,\s*\(([^)]*)\)", text)
    faces = [one.strip() for one in listed.split(",")]
    if len(faces) != len(names):
        raise ValueError(f"{part}: {len(faces)} faces are written and {len(names)} drawn")
    for label, name in zip(faces, names, strict=True):
        text = re.sub(rf"({label}\s*=\s*ADVANCED_FACE\s*\(\s*)'[^']*'", rf"\1'{name}'", text)
    return text


def make(folder: Path) -> None:
    """Write every part into a folder."""
    with gmsh_session():
        for part, draw in PARTS.items():
            gmsh.clear()
            gmsh.model.add(part)
            draw(gmsh.model.occ)
            gmsh.model.occ.synchronize()
            file = folder / f"{part}.step"
            gmsh.write(str(file))
            # as whoever reads the file numbers them
            gmsh.clear()
            gmsh.model.occ.importShapes(str(file))
            gmsh.model.occ.synchronize()
            file.write_text(normalised(file.read_text(encoding="utf-8"), part, names_of(part)), encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]))
