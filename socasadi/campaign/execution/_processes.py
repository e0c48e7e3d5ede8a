"""Worker processes for trials: an executor that knows which of them died, and can end one that hangs."""

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from typing import Any

# Each worker is a fresh interpreter that does not run the script that started it.
_START = "import sys; sys.path[:] = {path!r}; from {module} import work; work({handle})"


class Processes(Executor):
    """So many processes, each doing one task at a time.

    A process that dies takes only its own task with it, and another takes its place. Functions go there by name,
    arguments and results as JSON. Ctrl-C does not reach the processes; they end with the executor, or with its process.

    Parameters
    ----------
    jobs
        How many.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._tasks: queue.SimpleQueue[tuple[Future, str] | None] = queue.SimpleQueue()
        self._busy: dict[Future, _Worker] = {}
        self._workers: set[_Worker] = set()
        self._changing, self._closed = threading.Lock(), False
        self._threads = [threading.Thread(target=self._serve, args=(self._hire(),), daemon=True) for _ in range(jobs)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        """Have ``fn``, a public function of a module, done by the next process that is free."""
        if self._closed:
            raise BrokenExecutor("the processes were ended")
        future: Future = Future()
        self._tasks.put((future, json.dumps([fn.__module__, fn.__qualname__, args, kwargs])))
        return future

    def abandon(self, future: Future) -> bool:
        """End the process that is busy with ``future``; another takes its place, so that True is returned."""
        if (worker := self._busy.get(future)) is not None:
            worker.kill()
        return True

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes, whatever they do."""
        with self._changing:
            self._closed = True
            for worker in self._workers:
                worker.kill()
        for _ in self._threads:
            self._tasks.put(None)
        for thread in self._threads if wait else ():
            thread.join()

    def _serve(self, worker: "_Worker | None") -> None:
        while (task := self._tasks.get()) is not None:
            future, order = task
            if not future.set_running_or_notify_cancel():
                continue
            try:
                self._busy[future] = worker = worker or self._hire()
                answer = worker.ask(order)
            except (EOFError, OSError) as error:
                future.set_exception(BrokenExecutor(self._dismiss(worker) if worker else str(error)))
                worker = None
            else:
                if "error" in answer:
                    future.set_exception(RuntimeError(answer["error"]))
                else:
                    future.set_result(answer["result"])
            finally:
                self._busy.pop(future, None)

    def _hire(self) -> "_Worker":
        with self._changing:
            if self._closed:
                raise OSError("the processes were ended")
            self._workers.add(worker := _Worker())
        return worker

    def _dismiss(self, worker: "_Worker") -> str:
        with self._changing:
            self._workers.discard(worker)
        return f"process {worker.number} ended ({worker.kill()})"


class _Worker:
    """One process, seen from here."""

    def __init__(self) -> None:
        self._connection, there = Pipe()
        code = _START.format(path=sys.path, module=__name__, handle=there.fileno())
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-c", code], stdin=subprocess.DEVNULL, pass_fds=[there.fileno()], process_group=0
            )
        self.number = self._process.pid

    def ask(self, order: str) -> dict[str, Any]:
        """The answer to ``order``; EOFError or OSError when the process has died."""
        self._connection.send_bytes(order.encode())
        return json.loads(self._connection.recv_bytes())

    def kill(self) -> str:
        """End it, and say how it ended."""
        self._process.kill()
        code = self._process.wait()
        return f"signal {-code}" if code < 0 else f"exit code {code}"


def work(handle: int) -> None:
    """What a worker process does until its connection, an open file of that number, is closed."""
    connection = Connection(handle)
    orders: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                orders.put(connection.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)  # whoever would want the result is gone, even in the middle of a task

    threading.Thread(target=listen, daemon=True).start()
    while True:  # tasks are done in the main thread, which alone hears an alarm
        module, name, args, kwargs = json.loads(orders.get())
        try:
            answer = {"result": getattr(import_module(module), name)(*args, **kwargs)}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        connection.send_bytes(json.dumps(answer).encode())
