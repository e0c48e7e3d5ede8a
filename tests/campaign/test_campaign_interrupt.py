import contextlib
import os
import signal

import pytest

from socasadi.campaign import interruptible


def lose_one() -> None:
    """Press Ctrl-C, and drop it as a library would."""
    with interruptible(), contextlib.suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
        signal.sigtimedwait([], 0.1)


def test_ctrl_c_that_a_library_drops_is_heard_at_the_end_at_the_latest():
    with pytest.raises(KeyboardInterrupt):
        lose_one()
    with interruptible():
        pass
