"""The command, as tests give it."""

import contextlib
import io
import os
import subprocess
import sys
import warnings
from unittest import mock

from socasadi import cli


def socasadi(*arguments, cwd, alone=False, **environment):
    """The command; in this process, which has imported all that it needs, unless the environment is to differ.

    Alone it has a process of its own, and what its workers complain of is in ``stderr``, too.
    """
    command = [sys.executable, "-m", "socasadi.cli", *map(str, arguments)]
    if alone or environment:
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env={**os.environ, **environment})
    said, complained, code = io.StringIO(), io.StringIO(), 0
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(complained),
        mock.patch.object(sys, "argv", ["socasadi", *map(str, arguments)]),
        mock.patch.object(warnings, "showwarning"),
    ):
        try:
            cli.main()
        except SystemExit as ended:
            code = ended.code or 0
    return subprocess.CompletedProcess(command, code, said.getvalue(), complained.getvalue())
