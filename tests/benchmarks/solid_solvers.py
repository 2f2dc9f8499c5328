"""Solvers of a solid's equations side by side: ``python tests/benchmarks/solid_solvers.py [UNKNOWNS ...]``.

A block of 300 × 60 × 40 mm, clamped at one end, under six wrenches spread over the other. Each solver runs in a
process of its own, which reads the matrix from a file: seconds of the processor, and its peak memory.
Those that are not installed say so; ``pip install cvxopt pyamg`` brings two that the project does not use. Needs
Linux, which tells a process its working memory.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse

TOLERANCE = 1e-8
"""Of the iterative solver."""
LARGEST = {"superlu": 60_000, "amg": 150_000}
"""Unknowns up to which a solver is waited for."""


def solved(name: str, upper: scipy.sparse.csr_matrix, right: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Solutions ``(n, 6)`` by one solver."""
    if name in ("pardiso", "superlu"):
        from vjm_fea.solid.compliance import factorized

        if name == "superlu":
            sys.modules["pypardiso"] = None  # type: ignore[assignment]
        return factorized(upper).solve(right)
    full = (upper + scipy.sparse.triu(upper, 1).T).tocsr()
    if name == "cholmod":
        import cvxopt
        import cvxopt.cholmod

        low = scipy.sparse.tril(full).tocoo()
        matrix = cvxopt.spmatrix(low.data, low.row, low.col, full.shape)
        factor = cvxopt.cholmod.symbolic(matrix)
        cvxopt.cholmod.numeric(matrix, factor)
        x = cvxopt.matrix(right)
        cvxopt.cholmod.solve(factor, x)
        return np.array(x)
    import pyamg

    from vjm_fea.solid.elasticity import rigid_motions

    modes = rigid_motions(points, points.mean(axis=0))
    blocks = full.tobsr((3, 3))
    levels = pyamg.smoothed_aggregation_solver(blocks, B=modes, strength=("symmetric", {"theta": 0.0}))
    return np.column_stack([levels.solve(b, tol=TOLERANCE, accel="cg", maxiter=400) for b in right.T])


def block(unknowns: int, folder: Path) -> int:
    """Write the equations of a block with about so many unknowns; returns how many there are."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from helpers.solids import drawn, prism

    from vjm_fea.solid.compliance import PartEnds, face_centre, loads_and_support
    from vjm_fea.solid.drawing import drawing
    from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial

    path = drawn(folder / "block.step", lambda occ: prism(occ, 300.0, 60.0, 40.0))
    size = 3.55 * (303_300 / unknowns) ** (1.0 / 3.0)
    with drawing(path) as opened:
        solid = ElasticSolid(opened.mesh(size), IsotropicMaterial(70000.0, 0.33))
    loads, kept = loads_and_support(solid, PartEnds((1,), (2,)), face_centre(solid, (2,)))
    upper = scipy.sparse.csr_matrix(scipy.sparse.triu(solid.stiffness()[kept][:, kept]))
    upper.sort_indices()
    scipy.sparse.save_npz(folder / "upper.npz", upper, compressed=False)
    np.savez(folder / "rest.npz", right=loads[kept], points=solid.mesh.points[kept[::3] // 3])
    return int(solid.mesh.unknowns)


def one(name: str, folder: Path) -> None:
    """In a process of its own: print seconds, GB and the compliance along the second axis."""
    upper = scipy.sparse.load_npz(folder / "upper.npz")
    rest = np.load(folder / "rest.npz")
    started = time.process_time()
    u = solved(name, upper, rest["right"], rest["points"])
    seconds = time.process_time() - started
    # (getrusage would also count what the parent had)
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    gigabytes = float(next(line for line in status if line.startswith("VmHWM")).split()[1]) / 1e6
    print(f"{seconds:.1f} {gigabytes:.2f} {float(rest['right'][:, 1] @ u[:, 1]):.9e}")


def main(sizes: list[int]) -> None:
    """Print a line for every solver and size."""
    for size in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            unknowns = block(size, folder)
            for solver in ("pardiso", "cholmod", "amg", "superlu"):
                if unknowns > LARGEST.get(solver, unknowns):
                    continue
                command = [sys.executable, __file__, "--one", solver, str(folder)]
                done = subprocess.run(command, capture_output=True, text=True, check=False)
                if done.returncode:
                    print(f"{unknowns:>8,} {solver:8} {done.stderr.strip().splitlines()[-1]}", flush=True)
                    continue
                seconds, gigabytes, value = done.stdout.split()
                print(f"{unknowns:>8,} {solver:8} {seconds:>6} s {gigabytes:>6} GB  c22 {value}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2], Path(sys.argv[3]))
    else:
        main([int(word) for word in sys.argv[1:]] or [50_000, 100_000, 280_000])
