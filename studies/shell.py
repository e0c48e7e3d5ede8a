"""How the tutorials give a command: printed as you would type it, then really run."""

import contextlib
import shlex
import subprocess
import sys

from socasadi import cli


def shell(line: str, refused: bool = False) -> None:
    """Print one command and run it; the tutorial ends unless it succeeds, or is ``refused`` where it should be.

    `socasadi` runs in this process, which spares a second or two of starting Python each time.
    """
    print(f"\n$ {line}", flush=True)
    words = shlex.split(line)
    if words[0] == "socasadi":
        own, sys.argv = sys.argv, words
        try:
            with contextlib.redirect_stderr(sys.stdout):
                cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        sys.argv = own
    else:
        code = subprocess.run(words, stderr=subprocess.STDOUT).returncode
    if bool(code) != refused:
        sys.exit(f"the tutorial ends here: this command should have {'been refused' if refused else 'succeeded'}")
