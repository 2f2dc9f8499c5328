"""Mutated URDFs, read by the importer and by Pinocchio: no mass and no joint is lost without a word."""

import re
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from helpers.as_pinocchio import ROBOTS
from helpers.urdf_arm import LIMIT, arm, import_urdf, joint, link

from fuzz.mutations import mutated
from vjm.io.bounded_xml import XmlElement, read_xml
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot_document import Imported

TAG = re.compile(r"<(/?)([\w:]+)((?:\s+[\w:]+\s*=\s*(?:\"[^\"<]*\"|'[^'<]*'))*)\s*(/?)>")
ATTRIBUTE = re.compile(r"([\w:]+)\s*=\s*\"([^\"<]*)\"")
ODD_VALUES = (
    "", " ", "nan", "inf", "-inf", "-1", "0", "1e308", "1e999", "1,5", "0x10", "1_0", "${x}", "$(arg x)", "a b",
    "90", "180 0 0", "0 0 0", "0 0 1 0", "1e-320", "é", "fixed", "planar", "floating", "prismatic", "continuous",
    "revolute", "1.0.0", "+2", ".5", "5.", "2 ", "-0",
)  # fmt: skip
MASS = 1e-12
"""Of the whole: a sum of some twenty numbers in another order."""


def subjects() -> dict[str, str]:
    """Sound files by name: a made-up arm with a slide, couplings and a branch, and two public robots."""
    more = "".join(
        link(f"{name}-link", "0.3") + joint(name, "l2", f"{name}-link", kind, more=LIMIT + mimic)
        for name, kind, mimic in (
            ("a", "prismatic", '<mimic joint="b" multiplier="-1" offset="0.01"/>'),
            ("b", "prismatic", ""),
            ("c", "continuous", '<mimic joint="j1" multiplier="2"/>'),
        )
    )
    files = (ROBOTS / "ur_description/urdf/ur5_robot.urdf", ROBOTS / "z1_description/urdf/z1.urdf")
    return {"arm": arm(more=more), **{file.stem: file.read_text(encoding="utf-8") for file in files}}


def _one(found: list[Any], rng: np.random.Generator) -> Any:
    return found[int(rng.integers(len(found)))]


def _value(text: str, rng: np.random.Generator) -> str:
    one = _one(list(ATTRIBUTE.finditer(text)), rng)
    return text[: one.start(2)] + _one(list(ODD_VALUES), rng) + text[one.end(2) :]


def _swap(text: str, rng: np.random.Generator) -> str:
    """A value from elsewhere in the file, such as another's name."""
    found = list(ATTRIBUTE.finditer(text))
    one = _one(found, rng)
    other = _one([each for each in found if each.group(1) == one.group(1)], rng)
    return text[: one.start(2)] + other.group(2) + text[one.end(2) :]


def _rename(text: str, rng: np.random.Generator) -> str:
    one = _one(list(ATTRIBUTE.finditer(text)), rng)
    return (
        text[: one.start(1)] + _one(["valeu", "xml:id", "name", "link", "value", "xyz"], rng) + text[one.end(1) :]
    )


def _drop_attribute(text: str, rng: np.random.Generator) -> str:
    one = _one(list(ATTRIBUTE.finditer(text)), rng)
    return text[: one.start()] + text[one.end() :]


def _span(text: str, rng: np.random.Generator) -> tuple[int, int]:
    """Where an element without another of its name in it begins and ends."""
    one = _one([tag for tag in TAG.finditer(text) if not tag.group(1) and tag.group(2) != "robot"], rng)
    if one.group(4):
        return one.start(), one.end()
    end = text.find(f"</{one.group(2)}>", one.end())
    return one.start(), (end if end >= 0 else one.start()) + len(one.group(2)) + 3


def _drop(text: str, rng: np.random.Generator) -> str:
    start, end = _span(text, rng)
    return text[:start] + text[end:]


def _double(text: str, rng: np.random.Generator) -> str:
    start, end = _span(text, rng)
    return text[:end] + text[start:end] + text[end:]


def _move(text: str, rng: np.random.Generator) -> str:
    start, end = _span(text, rng)
    piece, rest = text[start:end], text[:start] + text[end:]
    at = _one([tag.start() for tag in TAG.finditer(rest) if tag.group(2) in ("link", "joint")], rng)
    return rest[:at] + piece + rest[at:]


def _tag(text: str, rng: np.random.Generator) -> str:
    one = _one([tag for tag in TAG.finditer(text) if tag.group(4)], rng)
    return (
        text[: one.start(2)] + _one(["xacro:if", "Mass", "inertail", "origin", "limits"], rng) + text[one.end(2) :]
    )


def _insert(text: str, rng: np.random.Generator) -> str:
    extra = (
        "<xacro:arm/>",
        "<!-- -- -->",
        "<a:b c='1'/>",
        '<link name="new"/>',
        "text",
        "<gazebo/>",
        "&amp;",
        "&x;",
    )
    at = _one([tag.end() for tag in TAG.finditer(text)], rng)
    return text[:at] + _one(list(extra), rng) + text[at:]


def _header(text: str, rng: np.random.Generator) -> str:
    return _one(["\n", "<!-- a -->", "<?xml version='1.0'?>", "\ufeff", "<!DOCTYPE robot>", "x"], rng) + text


def _bytes(text: str, rng: np.random.Generator) -> str:
    return mutated(text.encode(), int(rng.integers(2**31))).decode("utf-8", "replace")


MUTATIONS: tuple[Callable[[str, np.random.Generator], str], ...] = (
    _value, _value, _value, _swap, _swap, _rename, _drop_attribute, _drop, _double, _move, _tag, _insert,
    _header, _bytes,
)  # fmt: skip


def mutation(text: str, seed: int) -> str:
    """One or two mutations of a file."""
    rng = np.random.default_rng(seed)
    for _ in range(int(rng.integers(1, 3))):
        try:
            text = _one(list(MUTATIONS), rng)(text, rng)
        except ValueError:
            continue  # nothing is left to choose from
    return text


def carried(found: Imported) -> float:
    """Mass behind the moving joints of a document, kg."""
    moves, last, total = {"": False}, "", 0.0
    for part in found.document["parts"]:
        moves[part["name"]] = part["kind"] in ("actuated", "coupled") or moves[part.get("after", last)]
        last = part["name"]
        total += part.get("mass_kg", 0.0) if moves[last] else 0.0
    return total


def repaired(file: Path) -> Path:
    """The same robot without what Pinocchio drops masses or refuses files for, and the importer does not read.

    Pinocchio reads no mimics: a joint that follows a fixed one is fixed for it here.
    """
    root = read_xml(file).root
    fixed = {each.attributes.get("name") for each in root.all("joint") if each.attributes.get("type") == "fixed"}
    for each in root.all("joint"):
        if any(mimic.attributes.get("joint") in fixed for mimic in each.all("mimic")):
            each.attributes["type"] = "fixed"
    for body in root.all("link"):
        body.children = body.all("inertial")[:1]
        for inertial in body.children:
            inertial.children = [one for one in inertial.children if one.tag != "inertia"]
            for origin in inertial.all("origin"):
                origin.attributes.pop("rpy", None)
            for mass in inertial.all("mass"):
                # a number with blanks about it, or a plus sign
                mass.attributes["value"] = mass.attributes.get("value", "").strip().removeprefix("+")
            inertial.children.append(XmlElement("inertia", {k: "1" if k[1] == k[2] else "0" for k in KEYS}, 0))
    out = file.with_name("repaired.urdf")
    out.write_text(_text(root), encoding="utf-8")
    return out


KEYS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _text(element: XmlElement) -> str:
    words = "".join(f' {key}="{_escaped(value)}"' for key, value in element.attributes.items())
    return f"<{element.tag}{words}>{''.join(map(_text, element.children))}</{element.tag}>"


def _escaped(value: str) -> str:
    return value.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")


def pinocchio_reads(file: Path) -> tuple[int, float] | None:
    """Number of joints and the mass that they carry, kg; None where Pinocchio refuses the file."""
    try:
        robot = pinocchio.buildModelFromUrdf(str(file))
    except (ValueError, RuntimeError):
        return None
    return robot.nv, sum(inertia.mass for inertia in robot.inertias[1:])


def wrong(name: str, text: str, seed: int, folder: Path) -> tuple[str, bool]:
    """What is wrong with the importer's answer to a mutated file, if anything; whether Pinocchio reads it."""
    file = folder / f"{name}.urdf"
    file.write_text(mutation(text, seed), encoding="utf-8", newline="")
    try:
        found = import_urdf(file)
        build_chain(found.document, file.name)
    except ModelFileError as error:
        said = str(error)
        return ("" if said and "\n" not in said and len(said) < 3000 else f"{name}, seed {seed}: {said}"), False
    except Exception:
        return f"{name}, seed {seed}: {traceback.format_exc()}", False
    theirs = pinocchio_reads(file)
    if theirs is None:
        return "", False
    ours = len(found.joints), carried(found)
    if not _agree(ours, theirs):
        theirs = pinocchio_reads(repaired(file))
    if theirs is None or not _agree(ours, theirs):
        return f"{name}, seed {seed}: {ours} joints and kg, Pinocchio has {theirs}: {found.notes.lines()}", True
    return "", True


def _agree(ours: tuple[int, float], theirs: tuple[int, float]) -> bool:
    return ours[0] == theirs[0] and abs(ours[1] - theirs[1]) <= MASS * max(1.0, ours[1])
