"""``python -m pipecore``: the command line, as a process of its own."""

import atexit
import gc
import os
import sys

from pipecore.cli import main


def run() -> None:
    """Run one command and end the process with its exit code."""
    # Hardly anything here refers to itself; to look for it took a thirtieth of a detection.
    gc.set_threshold(100_000, 20, 20)
    code = main()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    # To take compiled kernels apart one by one takes half a second; the system needs none.
    os._exit(code)


if __name__ == "__main__":
    run()
