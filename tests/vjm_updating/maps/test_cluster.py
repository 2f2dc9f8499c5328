"""Maps on a Dask cluster: the same rows, also when a worker is killed half-way; a scheduler that is not there."""

import os
import signal
import socket

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm_updating.maps import run as cluster
from vjm_updating.maps import run as runner
from vjm_updating.maps.evaluate import MapQuantity, MapSetting
from vjm_updating.maps.grid import parsed_grid, points_of
from vjm_updating.maps.run import Map, run_map
from vjm_validation.cli.main import run

distributed = pytest.importorskip("distributed", reason="Dask is an optional extra and is not installed")


def free_port():
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


@pytest.mark.filterwarnings("ignore")
def test_a_dead_scheduler_is_one_line_and_status_2(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", "2s")
    address = f"tcp://127.0.0.1:{free_port()}"
    arguments = ["map", "orthoglide", "--grid", "x=0", "--scheduler", address, "--out", str(tmp_path / "out")]
    assert run(arguments) == 2
    assert f"--scheduler {address}: no Dask scheduler answers there" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "POINTS", dict.fromkeys(MapQuantity, 4))
    setting = MapSetting(load_model("orthoglide"), VjmEngine(), MapQuantity.CRITICAL)
    wanted = Map(setting, points_of(setting.model, parsed_grid("5", setting.model), "isotropic"))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        victims = [worker["id"] for worker in cluster.scheduler_info["workers"].values()]
        assert len(victims) == 2
        killed = []

        def progress(done, total):
            if done >= total // 2 and not killed:
                killed.append(cluster.workers[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        found = run_map(wanted, tmp_path / "cluster", scheduler=cluster.scheduler_address, progress=progress)
    assert killed
    alone = run_map(wanted, tmp_path / "alone", jobs=1)
    assert found.why == alone.why
    assert np.array_equal(found.values, alone.values, equal_nan=True)
