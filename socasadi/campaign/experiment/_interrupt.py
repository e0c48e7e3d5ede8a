"""Ctrl-C that no library loses.

A KeyboardInterrupt that strikes while CasADi converts arguments is dropped there. So it is noted when it comes, and
raised again where an experiment looks.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_heard = threading.Event()


@contextmanager
def interruptible() -> Iterator[None]:
    """Inside, Ctrl-C ends the next experiment's sample at the latest.

    Where a program has its own handler, and outside the main thread, nothing is changed.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _heard.clear()
    signal.signal(signal.SIGINT, _note)
    try:
        yield
        check_interrupt()  # one that was lost where no experiment followed
    except Exception as error:
        if _heard.is_set():  # a conversion that was broken off may fail in its own way
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _heard.clear()


def check_interrupt() -> None:
    """KeyboardInterrupt if Ctrl-C was pressed."""
    if _heard.is_set():
        raise KeyboardInterrupt


def _note(number: int, frame: FrameType | None) -> None:
    _heard.set()
    raise KeyboardInterrupt
