"""Every URDF and MJCF file that installed packages bring is read as Pinocchio or MuJoCo reads it, or refused."""

from __future__ import annotations

import os
import re
import sysconfig
from collections import Counter
from pathlib import Path

import pytest
from helpers.as_described import OfMujoco, OfPinocchio, compared
from helpers.as_pinocchio import ROBOTS

from vjm.io.mjcf_text import mjcf_text
from vjm.io.model_file import build_chain
from vjm.io.robot_file import Description, import_robot

INSTALLED = Path(sysconfig.get_paths()["purelib"])
CACHE = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
"""Of the package ``robot_descriptions``; nothing is downloaded."""
REFUSED = {
    "nothing moves": "no joint moves",
    "a joint that is not there": r"mimics '.*', which is no joint",
    "an empty robot": "has no <link>",
    "more than one base": "links without a parent",
    "MuJoCo refuses it": "MuJoCo does not read it",
    "no URDF": "is no URDF, which begins with <robot>",
    "loops that do not close": r"posture '.*': .*(does not close|is singular|out of reach)",
    "macros": "xacro",
}
"""Kinds of reasons, and how each is said."""


def files(folder: Path, suffix: str) -> list[Path]:
    return sorted(file for file in folder.rglob(f"*{suffix}") if "vjm" not in file.parts[-2])


def is_mjcf(file: Path) -> bool:
    return b"<mujoco" in file.read_bytes()[:10000] and b"<mujocoinclude" not in file.read_bytes()[:10000]


def counted(found: list[Path], engine: type[OfPinocchio] | type[OfMujoco]) -> Counter[str]:
    """Outcomes by kind; fails where a machine differs, or is refused for a reason of no kind."""
    kinds: Counter[str] = Counter()
    for file in found:
        outcome = compared(file, engine)
        kind = outcome.kind
        if kind == "refused":
            why = [word for word, pattern in REFUSED.items() if re.search(pattern, outcome.why)]
            assert why, f"{file}: {outcome.why}"
            kind = f"refused: {why[0]}"
        assert kind != "differs", f"{file}: {outcome.why}"
        kinds[kind] += 1
    print(f"{len(found)} files:", ", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))
    return kinds


@pytest.mark.slow
def test_installed_urdfs_are_read_as_pinocchio_reads_them():
    """Also what the file leaves out is said: moments of inertia that no body has."""
    kinds = counted(files(ROBOTS, ".urdf"), OfPinocchio)
    assert kinds["right"] > 50
    assert kinds["right but for moments"] < 0.2 * kinds["right"]


@pytest.mark.slow
def test_installed_mjcf_files_are_read_as_mujoco_reads_them(tmp_path, monkeypatch):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    # MuJoCo writes its warnings into a file where one stands
    monkeypatch.chdir(tmp_path)
    assert counted([file for file in files(INSTALLED, ".xml") if is_mjcf(file)], OfMujoco).total() > 0


@pytest.mark.slow
@pytest.mark.skipif(not CACHE.is_dir(), reason=f"robot_descriptions has nothing in its cache {CACHE}")
def test_cached_descriptions_are_read_as_the_engines_read_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = counted(files(CACHE, ".urdf"), OfPinocchio)
    found += counted([file for file in files(CACHE, ".xml") if is_mjcf(file)], OfMujoco)
    assert found.total() > 0


@pytest.mark.slow
def test_what_is_written_as_mjcf_is_what_mujoco_reads(tmp_path, monkeypatch):
    """Each robot goes to MJCF, and comes back with the mass matrix that MuJoCo finds there."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'vjm-stiffness[mjcf]'")
    monkeypatch.chdir(tmp_path)
    written = []
    for k, file in enumerate(files(ROBOTS, ".urdf")):
        if compared(file, OfPinocchio).kind == "right":
            machine = build_chain(import_robot(Description(file)).document, file.name)
            written.append(tmp_path / f"{file.stem}-{k}.xml")
            written[-1].write_text(mjcf_text(machine), encoding="utf-8")
    assert counted(written, OfMujoco) == {"right": len(written)}
