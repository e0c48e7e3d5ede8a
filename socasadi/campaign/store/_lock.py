"""One writer at a time: a lock on the run folder, which ends with the process that holds it."""

import contextlib
import fcntl
import os
import time
from pathlib import Path

# s for which a writer waits for another: what a colleague asks or tells is soon done.
_PATIENCE = 3.0

_held: set[int] = set()


class LockedError(RuntimeError):
    """Another process holds the lock; the message is its number."""


def lock(path: Path) -> int:
    """Hold the lock in that file, made unless it is there; OSError when it cannot be made or opened."""
    # For all that the umask lets in: colleagues who share a folder share its lock.
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    deadline = time.monotonic() + _PATIENCE
    while not _taken(handle):
        if time.monotonic() > deadline:
            holder = os.read(handle, 32).decode(errors="replace").strip() or "unknown"
            os.close(handle)
            raise LockedError(holder)
        time.sleep(0.1)
    # On a full disk the name is missing, not the lock.
    with contextlib.suppress(OSError):
        os.ftruncate(handle, 0)
        os.write(handle, str(os.getpid()).encode())
    _held.add(handle)
    return handle


def unlock(handle: int) -> None:
    """Let go of it."""
    _held.discard(handle)
    fcntl.flock(handle, fcntl.LOCK_UN)
    os.close(handle)


def _taken(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _leave_to_the_parent() -> None:
    """A child that was forked shares the lock, and would hold it when its parent is dead."""
    for handle in _held:
        os.close(handle)
    _held.clear()


os.register_at_fork(after_in_child=_leave_to_the_parent)
