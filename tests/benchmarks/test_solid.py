"""Time and peak memory of a solid with 300,000 unknowns: mesh, stiffness, factors and six loads, on one core."""

import resource
import time

import numpy as np
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_fea.solid.compliance import PartEnds, TipLoad, answer
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial

LIMIT_S, LIMIT_GB = 60.0, 6.0


def test_time_and_peak_memory_of_a_large_solid(tmp_path, record):
    """In seconds of the processor: other work on the machine does not count."""
    gmsh_or_skip()
    length, height, width = 300.0, 60.0, 40.0
    path = drawn(tmp_path / "block.step", lambda occ: prism(occ, length, height, width))
    started = time.process_time()
    with drawing(path) as opened:
        solid = ElasticSolid(opened.mesh(3.55), IsotropicMaterial(70000.0, 0.33))
    meshed = time.process_time()
    ends = PartEnds((1,), (2,))
    spread = answer(solid, ends, TipLoad.SPREAD)
    value = time.process_time() - started
    rigid = answer(solid, ends, TipLoad.RIGID)
    both = time.process_time() - started
    gigabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    bending = 4.0 * length**3 / (70000.0 * width * height**3)
    assert 0.95 < spread.compliance[1, 1] / bending < 1.1
    assert np.all(np.diag(rigid.compliance) <= np.diag(spread.compliance))
    record("solid_unknowns", solid.mesh.unknowns, "", ">= 300000", solid.mesh.unknowns >= 300_000)
    record("solid_mesh_s", meshed - started, "s", "", True)
    record("solid_one_bound_s", value, "s", f"<= {LIMIT_S:g}", value <= LIMIT_S)
    record("solid_two_bounds_s", both, "s", "", True)
    record("solid_memory_gb", gigabytes, "GB", f"<= {LIMIT_GB:g}", gigabytes <= LIMIT_GB)
