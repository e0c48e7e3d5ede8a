"""Trials on a real Dask cluster: processes that talk over TCP on this machine."""

import os
import signal

import pytest
from test_campaign_parallel import outcomes, script

from socasadi.campaign import RunError, dask_executor, load_study
from socasadi.campaign.execution import _loop

distributed = pytest.importorskip("distributed", reason="the package distributed is not installed")
__all__ = ["script"]


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=":0"
    ) as cluster:
        yield cluster


@pytest.fixture
def executor(cluster):
    cluster.wait_for_workers(2, timeout=60)
    with dask_executor(cluster.scheduler_address) as executor:
        yield executor


def workers(cluster):
    """Ids of the processes that do the cluster's work."""
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        return set(client.run(os.getpid).values())


def test_a_worker_lost_in_the_middle_loses_no_trial(script, tmp_path, cluster, executor):
    file = script("time.sleep(0.01)", "search='sobol', seed_points=12, iterations=0, give_up=None")
    study = load_study(file)
    assert cluster.scheduler_address.startswith("tcp://127.0.0.1")
    killed = []

    def kill(progress):
        if progress.done == 4:
            killed.append(workers(cluster).pop())
            os.kill(killed[0], signal.SIGKILL)

    result = study.run(tmp_path / "run", executor=executor, script=file, progress=kill)
    assert killed
    assert executor.jobs >= 1
    assert outcomes(result) == outcomes(study.run(tmp_path / "alone", progress=None))


def test_a_worker_that_hangs_is_ended_and_its_trial_has_failed(script, tmp_path, cluster, executor, monkeypatch):
    settings = "search='sobol', seed_points=6, iterations=0, time_limit=2.0"
    file = script("if self.trial == 2: time.sleep(1000)", settings)
    monkeypatch.setattr(_loop, "GRACE", 10.0)
    before = workers(cluster)
    result = load_study(file).run(tmp_path / "run", executor=executor, script=file, progress=None)
    failed = {trial.number: trial.failure for trial in result.trials if trial.outcome == "failed"}
    assert failed == {2: "TimeoutError: no answer 10 s after its limit of 2 s"}
    assert len(result.trials) == 6
    assert len(before - workers(cluster)) == 1


def test_a_scheduler_that_is_not_there_is_said(monkeypatch):
    from socasadi.campaign.execution import _dask

    monkeypatch.setattr(_dask, "_PATIENCE", 1.0)
    with pytest.raises(RunError, match=r"no Dask cluster with a worker answers at tcp://127\.0\.0\.1:1: "):
        dask_executor("tcp://127.0.0.1:1")


def test_without_the_package_its_name_is_said(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RunError, match=r"pip install 'socasadi\[distributed\]'"):
        dask_executor("tcp://127.0.0.1:1")
