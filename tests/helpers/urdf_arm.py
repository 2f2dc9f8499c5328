"""An arm of two joints as a URDF, to be changed piece by piece."""

import tomllib
from pathlib import Path

import pytest

from vjm.io.bounded_xml import read_xml
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import USUAL, Reading
from vjm.io.robot_document import Imported, robot_document
from vjm.io.urdf import urdf_robot

INERTIA = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
LIMIT = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'


def link(name: str, mass: str = "2", more: str = "", inertia: str = INERTIA) -> str:
    heavy = f'<origin xyz="0.15 0.01 0.02"/><mass value="{mass}"/>{inertia}'
    return f'<link name="{name}"><inertial>{heavy}</inertial>{more}</link>\n'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    origin: str = "",
    axis: str = "0 1 0",
    more: str = LIMIT,
) -> str:
    origin = origin or '<origin xyz="0.3 0.02 0.4" rpy="0.1 -0.2 0.3"/>'
    turns = f'<axis xyz="{axis}"/>' if axis else ""
    return (
        f'<joint name="{name}" type="{kind}">{origin}<parent link="{parent}"/><child link="{child}"/>{turns}{more}'
        "</joint>\n"
    )


PIECES = {
    "header": '<?xml version="1.0"?>\n',
    "robot": '<robot name="arm">\n',
    "base": link("base"),
    "l1": link("l1"),
    "l2": link("l2"),
    "tool": '<link name="tool"/>\n',
    "j1": joint("j1", "base", "l1", axis="0 0 1"),
    "j2": joint("j2", "l1", "l2"),
    "jt": joint("jt", "l2", "tool", "fixed", axis="", more=""),
    "more": "",
    "end": "</robot>\n",
}


def arm(**changes: str) -> str:
    """The text of the arm with some of its pieces changed."""
    assert set(changes) <= set(PIECES)
    return "".join({**PIECES, **changes}.values())


def written(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    file = folder / "arm.urdf"
    file.write_bytes(text.encode(encoding))
    return file


def import_urdf(path: Path, tip: str | None = None, reading: Reading = USUAL) -> Imported:
    """The model document of a URDF alone, with no word on its units."""
    return robot_document(urdf_robot(read_xml(path), path.name, tip, reading), tip)


def imported(folder: Path, text: str, tip: str | None = None, encoding: str = "utf-8", **how) -> Imported:
    """The import of a text, which builds."""
    found = import_urdf(written(folder, text, encoding), tip, Reading(**how))
    build_chain(tomllib.loads(found.text()), "arm.toml")
    return found


def refusal(folder: Path, text: str, tip: str | None = None, **how) -> str:
    """Why a text is refused, in one line."""
    with pytest.raises(ModelFileError) as caught:
        import_urdf(written(folder, text), tip, Reading(**how))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def said(found: Imported) -> str:
    """All that is to be said of an import."""
    return "\n".join(found.notes.lines())


def parts(found: Imported) -> dict[str, dict[str, object]]:
    """Tables by the parts' names."""
    return {part["name"]: part for part in found.document["parts"]}
