"""Trials on a Dask cluster."""

import re
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from typing import Any

from ..store import RunError

# s to wait for the scheduler, also when the way to it was lost, for a first worker, and for one that starts again.
_PATIENCE = 30.0


class DaskExecutor(Executor):
    """A Dask cluster as an executor; see :func:`dask_executor`."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._tasks: dict[Future, Any] = {}

    @property
    def jobs(self) -> int:
        """How many trials the cluster's workers can fly at once: one a thread."""
        return max(1, sum(self._client.nthreads().values()))

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """Have ``fn`` done by the cluster, which does it again itself when a worker dies.

        Raises
        ------
        BrokenExecutor
            The scheduler is gone.
        """
        deadline = time.monotonic() + _PATIENCE
        while not self._connected and self._client.status == "connecting" and time.monotonic() < deadline:
            time.sleep(0.1)
        if not self._connected:
            raise BrokenExecutor("its scheduler is gone")
        future: Future = Future()
        self._tasks[future] = task = self._client.submit(fn, *args, pure=False, **kwargs)
        task.add_done_callback(lambda task: self._pass_on(task, future))
        return future

    @property
    def _connected(self) -> bool:
        return self._client.status == "running"

    def _pass_on(self, task: Any, future: Future) -> None:
        self._tasks.pop(future, None)
        if not future.set_running_or_notify_cancel():
            return
        if task.status == "finished":
            future.set_result(task.result())
        elif task.status == "error":
            future.set_exception(task.exception())
        else:
            future.set_exception(BrokenExecutor(f"the cluster has {task.status} it"))

    def abandon(self, future: Future) -> bool:
        """Start the worker again that is busy with ``future``; False without a nanny to do so, or a scheduler."""
        if (task := self._tasks.pop(future, None)) is None:
            return True
        if not self._connected:
            return False
        busy = [worker for worker, keys in self._client.processing().items() if task.key in keys]
        task.cancel()
        try:
            self._client.restart_workers(busy, timeout=_PATIENCE)
        except (ValueError, TimeoutError):
            return False
        return True

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster, and drop what it still does for this process."""
        for task in list(self._tasks.values()):
            task.cancel()
        self._client.close()


def dask_executor(address: str) -> DaskExecutor:
    """The Dask cluster whose scheduler listens at ``address``, such as ``"tcp://10.0.0.5:8786"``.

    Raises
    ------
    RunError
        The package ``distributed`` is not installed, or nobody answers at ``address``.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise RunError(
            f"trials on a Dask cluster need the package distributed ({error}): pip install 'socasadi[distributed]'"
        ) from error
    # A client that is given anything else waits for a minute at the end of the process.
    if not re.fullmatch(r"(\w+://)?[^\s:/]+:\d+", address):
        raise RunError(f"{address!r} is no address of a Dask scheduler: give one such as tcp://10.0.0.5:8786")
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
        client.wait_for_workers(1, timeout=_PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise RunError(f"no Dask cluster with a worker answers at {address}: {error}") from error
    return DaskExecutor(client)
