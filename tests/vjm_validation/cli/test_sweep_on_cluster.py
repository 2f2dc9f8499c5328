"""``validate sweep --scheduler``: the rows of a Dask cluster are those of one process."""

from __future__ import annotations

import csv

import pytest

from vjm_validation.cli import design
from vjm_validation.cli.main import run

distributed = pytest.importorskip("distributed", reason="Dask is an optional extra and is not installed")


@pytest.mark.filterwarnings("ignore")
def test_a_sweep_by_a_cluster(tmp_path, monkeypatch):
    done, by_cluster = [], design.on_cluster

    def counted(*given):
        for index, result in by_cluster(*given):
            done.append(index)
            yield index, result

    monkeypatch.setattr(design, "on_cluster", counted)
    words = [
        "sweep", "ur10", "--vary", "elbow.compliance_rad_per_Nmm=1e-8:3e-8:3", "--of", "mass,deflection,frequency",
        "--posture", "stretched", "--wrench", "0,0,-100,0,0,0", "--csv",
    ]  # fmt: skip
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    assert run([*words, str(here)]) == 0
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
    ) as cluster:
        assert run([*words, str(there), "--scheduler", cluster.scheduler_address]) == 0
    # rows go in parcels
    assert done
    tables = []
    for file in (here, there):
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        tables.append(sorted(csv.DictReader(lines), key=lambda row: float(row["elbow.compliance_rad_per_Nmm"])))
    assert tables[0] == tables[1]
    # a softer elbow deflects more and vibrates more slowly
    for quantity, sign in (("deflection", 1.0), ("frequency", -1.0)):
        column = next(name for name in tables[0][0] if name.startswith(quantity))
        values = [sign * float(row[column]) for row in tables[0]]
        assert len(values) == 3
        assert values[0] < values[1] < values[2]
