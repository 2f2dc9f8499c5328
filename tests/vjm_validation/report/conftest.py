"""A small run: one posture, cheap lumped paths, a coarse stand-in under the finite elements' label."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.model.load_case import Direction, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import rotation_from_vector
from vjm_validation.report import page
from vjm_validation.studies.chain import Key, LumpingStudy, Run

ENGINES = {
    "vjm-paper": VjmEngine(),
    "vjm-16": VjmEngine(4),
    "vjm-16f16": VjmEngine(4, 4),
    "exudyn": VjmEngine(5, 5),
    "exudyn-footspring": VjmEngine(5),
}


ERRORS = {
    "end": lambda n: 2.0 / n**2 if n > 1 else None,
    "middle": lambda n: -0.6 / n**2,
    "two-thirds": lambda n: -0.4 / n**4,
    "best": lambda n: -0.5 / n**6,
}
"""Relative error of the critical force by placement and number of springs; None where there is none."""


def make_chain():
    quarter = rotation_from_vector([math.pi / 2, 0.0, 0.0])
    foot = Beam(
        "foot", 146.5, own_frame=quarter.T, section_frame=rotation_from_vector([0.0, 0.0, math.radians(50.3)]),
        end_offset=np.array([17.57, -8.74, 0.0]), section=Section(7.5e7, 6.40e8, 6.32e8, 1.744e9),
        own_segments=1,
    )  # fmt: skip
    bar = Beam("bar", 310.0, own_frame=quarter, count=2, section=Section(6.74e6, 1.07e7, 2.07e8, 4.31e7))
    y, z = np.eye(3)[1], np.eye(3)[2]
    joints = [Joint(name, axis, passive=True) for name, axis in (("q1", y), ("q2", z), ("q3", z), ("q4", y))]
    return Machine(
        "small", (foot, *joints[:2], bar, *joints[2:]), postures={"A": np.zeros(4)}, title="A leg",
        source="made for a test",
    )  # fmt: skip


def metrics(path):
    event = path.critical
    return {
        "K0": float(path.tangent[0]),
        "K1": event and event.stiffness_before,
        "critical": event and str(event.kind),
        "F_cr": event and event.force,
        "d_cr": event and event.s,
        "K2": event and event.stiffness_after,
        "F_end": float(path.force[-1]),
        "d_end": float(path.s[-1]),
        "K3": float(path.tangent[-1]),
    }


@pytest.fixture(scope="session")
def computed():
    run = Run(make_chain())
    chain = {"A": {}}
    for direction in Direction:
        for label, engine in ENGINES.items():
            path = replace(engine.trace(run.chain, LoadCase("A", 4.0 * direction.sign)), engine=label)
            run.paths[Key("A", direction, label)] = path
            chain["A"].setdefault(str(direction), {})[label] = metrics(path)
    fe = chain["A"]["compression"]["exudyn"]["F_cr"]
    run.lumping = (
        LumpingStudy("A", Direction.TENSION, None, (("end", 1, 2690.0), ("end", 2, 10760.0), ("end", 4, None))),
        LumpingStudy(
            "A", Direction.COMPRESSION, fe, tuple(
                (place, n, error(n) and fe * (1.0 + error(n)))
                for place, error in ERRORS.items()
                for n in (1, 2, 4, 8, 16)
            ),
        ),
    )  # fmt: skip
    pulled = chain["A"]["tension"]["vjm-paper"]
    run.summary = {
        "chain": chain,
        "published": [
            row("F_cr", "N", 2661.0, pulled["F_cr"], 2500.0, 2900.0, inside=True),
            row("d_cr", "mm", 0.82, pulled["d_cr"], None, None, inside=False),
            row("K3", "N/mm", 8.56, None, None, None, inside=False, differs=True),
        ],
        "verification": [
            {"name": "column", "kind": "exact", "quantity": "critical force, N", "reference": 8844.0,
             "source": "π²EI/L²", "value": 8843.0, "error": 1e-4, "tolerance": 1e-3, "order": None, "passed": True},
        ],
        "acceptance": [{"name": "residuals", "requirement": "below 1e-9", "value": 3e-12, "passed": True}],
        "timings": {"paths": {"A": 1.5}, "total": 2.0},
        "versions": {"python": "3.11"},
        "hashes": {"model": "ab" * 32},
        "command": "validate all --quick",
    }  # fmt: skip
    return run


def row(quantity, unit, published, ours, low, high, *, inside, differs=False):
    return {
        "posture": "A", "quantity": quantity, "unit": unit, "published": published, "ours": ours,
        "ratio": ours and ours / published, "reach_low": low, "reach_high": high, "inside": inside,
        "definition_differs": differs, "note": "",
    }  # fmt: skip


@pytest.fixture(scope="session")
def folder(computed, tmp_path_factory):
    """Where the run's report is written, pictures and all."""
    out = tmp_path_factory.mktemp("report")
    assert page.write_report(computed, out) == out / "index.html"
    return out


@pytest.fixture
def run(computed):
    """A copy that a test may spoil."""
    return replace(computed, paths=dict(computed.paths), summary=copy.deepcopy(computed.summary))


@pytest.fixture
def bare(monkeypatch):
    """No pictures: for tests of the words around them."""
    monkeypatch.setattr(page, "why_not_rendered", lambda: "a test says so")
    monkeypatch.setattr(page, "posture_pictures", lambda run, posture: [])
    monkeypatch.setattr(page, "lumping_pictures", lambda run: [])
    monkeypatch.setattr(page, "foot_picture", lambda run: None)
    monkeypatch.setattr(page, "published_picture", lambda run: None)
