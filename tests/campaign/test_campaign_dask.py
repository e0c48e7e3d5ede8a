"""Trials on a real Dask cluster: processes that talk over TCP on this machine."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from test_campaign_parallel import outcomes, script

from socasadi.baselines import fly_cell, load_comparison, run_comparison
from socasadi.campaign import RunError, dask_executor, load_study
from socasadi.campaign.execution import _dask, _loop

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


COMPARISON = """
from socasadi import Circle, Cost, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.baselines import PID, Comparison, Linearised

study = Study(plant=SimulatedPlant(Rod.preset("paper"), noise=1e-3), mpc=LinearMPC(Modal()), task=Circle(duration=1.0))
comparison = Comparison(
    study, tasks={"circle": study.task}, methods={"a": Linearised(), "b": PID(8.0)}, seeds=(0, 1),
    checkpoints=(12,), flights=1,
)
"""


def test_the_cells_of_a_comparison_come_out_as_in_this_process(tmp_path, executor):
    (file := tmp_path / "comparison.py").write_text(COMPARISON)
    cells = run_comparison(file, "full", tmp_path / "out", executor)
    comparison = load_comparison(file)
    assert len(cells) == 4
    for cell in cells:
        here = fly_cell(comparison, cell["task"], cell["method"], cell["seed"])
        assert cell["broke"] is None
        assert cell["points"][-1]["J"] == here["points"][-1]["J"]


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_scheduler_that_dies_ends_the_run_in_a_sentence_and_resuming_finishes_it(script, tmp_path, monkeypatch):
    monkeypatch.setattr(_dask, "_PATIENCE", 5.0)
    file = script("time.sleep(0.01)")
    study, scheduler = load_study(file), tmp_path / "scheduler.json"
    started = [
        subprocess.Popen([sys.executable, "-m", f"distributed.cli.dask_{role}", *arguments], stderr=subprocess.DEVNULL)
        for role, arguments in (
            ("scheduler", ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", scheduler]),
            ("worker", ["--scheduler-file", scheduler, "--no-dashboard", "--nthreads", "1"]),
        )
    ]

    def kill(progress):
        if progress.done == 4:
            started[0].kill()

    try:
        deadline = time.monotonic() + 60
        while not scheduler.exists() and time.monotonic() < deadline:
            time.sleep(0.1)
        with (
            dask_executor(json.loads(scheduler.read_text())["address"]) as executor,
            pytest.raises(RunError, match=r"takes no more trials .*its scheduler is gone.*what was told is stored"),
        ):
            study.run(tmp_path / "run", executor=executor, script=file, progress=kill)
    finally:
        for process in started:
            process.kill()
            process.wait()
    again = study.run(tmp_path / "run", resume=True, progress=None)
    assert outcomes(again) == outcomes(study.run(tmp_path / "alone", progress=None))


def test_a_scheduler_that_is_not_there_is_said(monkeypatch):
    monkeypatch.setattr(_dask, "_PATIENCE", 1.0)
    with pytest.raises(RunError, match=r"no Dask cluster with a worker answers at tcp://127\.0\.0\.1:1: "):
        dask_executor("tcp://127.0.0.1:1")


def test_without_the_package_its_name_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RunError, match=r"pip install 'socasadi\[distributed\]'"):
        dask_executor("tcp://127.0.0.1:1")
