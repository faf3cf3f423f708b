"""A batch over Ray on a local cluster of two nodes, one of which is killed midway: nothing lost, nothing done twice."""

from __future__ import annotations

import os
import threading
import time

import pytest
from tests.app.batches import make, rows
from tests.stand_ins import log, wait_for

from imdim.app.batch.engine import PartJob
from imdim.app.batch.folder import Part
from imdim.app.batch.process import ProcessLimits
from imdim.app.batch.run import main
from imdim.app.cli import main as imdim
from imdim.install import install_command


def test_without_a_cluster_is_one_line(parts, tmp_path, capsys, monkeypatch):
    make(parts, "a.stl")
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    assert imdim(["batch", str(parts), "-o", str(tmp_path / "out"), "--address", "127.0.0.1:1"]) == 2
    error = capsys.readouterr().err
    assert error.splitlines()[-1] == f"imdim: --address needs Ray: {install_command('cluster')}"


def test_a_shipped_job_brings_its_results(tmp_path, stand_in):
    from imdim.app.batch.engine import run_shipped

    for name, why in (("a", ""), ("crash", "ended by signal SIGABRT")):
        job = PartJob(Part(name, tmp_path / f"{name}.stl", ""), tmp_path / "nowhere", tuple(stand_in()), (), ProcessLimits(20.0))
        ended, files = run_shipped(job, b"content")
        assert ended.why == why
        assert files.keys() == {"fit.log"} | ({f"parts/{name}/report.json", f"parts/{name}/preview.png"} if name == "a" else set())


@pytest.mark.cluster
@pytest.mark.filterwarnings("ignore")
def test_a_node_that_is_killed_midway_costs_nothing(parts, tmp_path, stand_in):
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    names = [f"p{i:02}" for i in range(24)]
    make(parts, *(f"{name}.stl" for name in names), "crash.stl", "hang.stl")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    doomed = cluster.add_node(num_cpus=1)
    arguments = [str(parts), "-o", str(tmp_path / "out"), "--address", cluster.address, "--limit", "5"]
    status: list[int] = []

    def kill() -> None:
        wait_for(lambda: sum(line.startswith("end") for line in log(tmp_path)) >= 8, 120.0)
        cluster.remove_node(doomed, allow_graceful=False)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        status.append(main(arguments, stand_in(0.5)))
    finally:
        killer.join()
        cluster.shutdown()
    found = rows(tmp_path / "out")
    assert status == [1]
    assert len(found) == 26
    failures = {name: row["failure"] for name, row in found.items() if row["failure"]}
    assert failures == {"crash.stl": "ended by signal SIGABRT", "hang.stl": "took more than 5 s and was ended"}
    lines = log(tmp_path)
    ends = [line.split()[1] for line in lines if line.startswith("end")]
    assert sorted(ends) == names
    # what the dead node was doing began again; its processes ended with it
    begun_again = sum(lines.count(f"start {name}") - 1 for name in names)
    assert 0 <= begun_again <= 1
    time.sleep(1.0)
    assert log(tmp_path) == lines
