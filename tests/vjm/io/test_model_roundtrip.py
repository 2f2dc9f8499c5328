"""A random valid model, written as TOML by hand, loads as the same machine."""

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vjm.io.model_file import load_chain
from vjm.model.parts import Beam, Joint, JointKind, RigidOffset, Section
from vjm.rotations import AXES, rotate_matrix6, shift_compliance, turn

VECTORS = st.lists(st.floats(-200.0, 200.0), min_size=3, max_size=3)
TURNS = st.lists(
    st.fixed_dictionaries({"turn_about": st.sampled_from("xyz"), "angle_deg": st.floats(-180.0, 180.0)}),
    max_size=3,
)
SECTIONS = st.builds(
    lambda E, iy, iz, torsion: {
        "EA_N": E, "EIy_Nmm2": E * iy**2, "EIz_Nmm2": E * iz**2, "GJ_Nmm2": torsion * E * (iy**2 + iz**2),
    },
    st.floats(1e5, 1e9), st.floats(0.5, 10.0), st.floats(0.5, 10.0), st.floats(1e-3, 0.5),
)  # fmt: skip


@st.composite
def beams(draw: st.DrawFn) -> dict[str, Any]:
    beam: dict[str, Any] = {
        "kind": "beam", "length_mm": draw(st.floats(50.0, 2000.0)), "count": draw(st.integers(1, 4)),
        "own_axes": draw(TURNS), "section_axes": draw(TURNS), "end_offset_mm": draw(VECTORS),
    }  # fmt: skip
    section = draw(SECTIONS)
    given = draw(st.sampled_from(["section", "compliance", "both"]))
    if given != "compliance":
        beam["section"] = section
    if given != "section":
        stiff = Section(section["EA_N"], section["GJ_Nmm2"], section["EIy_Nmm2"], section["EIz_Nmm2"])
        at_end = rotate_matrix6(stiff.compliance(beam["length_mm"]), rotation(beam["section_axes"]))
        # a part that is a little softer than its beam, as identified ones are
        k = draw(st.floats(0.5, 2.0)) * shift_compliance(at_end, beam["end_offset_mm"])
        beam["compliance"] = (0.5 * (k + k.T)).tolist()
    return beam


OTHERS = st.one_of(
    st.fixed_dictionaries({"kind": st.just("offset"), "translation_mm": VECTORS, "turns": TURNS}),
    st.fixed_dictionaries(
        {
            "kind": st.just("actuator"),
            "axis": st.sampled_from("xyz"),
            "compliance_mm_per_N": st.floats(0, 1e-3),
        }
    ),
)


@st.composite
def models(draw: st.DrawFn) -> dict[str, Any]:
    """Anything in series, with one hinge at the most: it can always turn alone."""
    parts = [*draw(st.lists(beams() | OTHERS, max_size=4)), draw(beams())]
    angles = []
    if draw(st.booleans()):
        axis = np.array(draw(VECTORS.filter(lambda v: math.hypot(*v) > 1.0)))
        joint = {"kind": "joint", "axis": (axis / np.linalg.norm(axis)).tolist()}
        parts.insert(draw(st.integers(0, len(parts))), joint)
        angles = [draw(st.floats(-3.0, 3.0))]
    for i, part in enumerate(parts):
        part["name"] = f"p{i}"
    return {
        "format": 1, "name": "random", "title": 'a "title" with \\ in it', "source": "hypothesis",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "base": {"position_mm": draw(VECTORS), "turns": draw(TURNS)},
        "parts": parts,
        "postures": {"P": angles},
    }  # fmt: skip


def rotation(turns: list[dict[str, Any]]) -> np.ndarray:
    """The product of elementary turns, as (1) and (21) string them."""
    T = np.eye(4)
    for one in turns:
        T = T @ turn(AXES[one["turn_about"]], math.radians(one["angle_deg"]))
    return T[:3, :3]


def toml(value: Any) -> str:
    """A value as inline TOML."""
    match value:
        case dict():
            return "{" + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(toml, value)) + "]"
        case str():
            return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        case _:
            return repr(value)


@settings(max_examples=40, deadline=None)
@given(models())
def test_roundtrip(document):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "random.toml"
        file.write_text("".join(f"{key} = {toml(value)}\n" for key, value in document.items()), "utf-8")
        chain = load_chain(file)
    assert (chain.name, chain.title, chain.source) == ("random", document["title"], "hypothesis")
    np.testing.assert_array_equal(chain.base[:3, 3], document["base"]["position_mm"])
    np.testing.assert_allclose(chain.base[:3, :3], rotation(document["base"]["turns"]), atol=1e-14)
    np.testing.assert_array_equal(chain.posture("P"), document["postures"]["P"])
    assert len(chain.parts) == len(document["parts"])
    for part, raw in zip(chain.parts, document["parts"], strict=True):
        assert part.name == raw["name"]
        match part:
            case RigidOffset():
                np.testing.assert_array_equal(part.transform[:3, 3], raw["translation_mm"])
                np.testing.assert_allclose(part.transform[:3, :3], rotation(raw["turns"]), atol=1e-14)
            case Joint(fixed=True):
                assert (part.kind, part.slides) == (JointKind.ACTUATOR, True)
                np.testing.assert_array_equal(part.axis, AXES[raw["axis"]])
                assert part.compliance == raw["compliance_mm_per_N"]
            case Joint():
                assert part.kind is JointKind.FREE
                np.testing.assert_allclose(part.axis, raw["axis"], atol=1e-15)
            case Beam():
                check_beam(part, raw)


def check_beam(part: Beam, raw: dict[str, Any]) -> None:
    assert (part.length, part.count, part.segments) == (raw["length_mm"], raw["count"], None)
    np.testing.assert_array_equal(part.end_offset, raw["end_offset_mm"])
    np.testing.assert_allclose(part.own_frame, rotation(raw["own_axes"]), atol=1e-14)
    np.testing.assert_allclose(part.section_frame, rotation(raw["section_axes"]), atol=1e-14)
    if "section" in raw:
        s = raw["section"]
        assert part.section == Section(s["EA_N"], s["GJ_Nmm2"], s["EIy_Nmm2"], s["EIz_Nmm2"])
    else:
        assert part.section is None
    if "compliance" in raw:
        np.testing.assert_array_equal(part.compliance, raw["compliance"])
    else:
        assert part.compliance is None
