"""The command line: ``pipecore detect | judge | simulate | info | convert``.

Exit code 0: done; 1: the input or settings were wrong; 2: usage; 130: cancelled.
"""

import importlib
import os
import sys
from collections.abc import Sequence

from pipecore.cli.console import Console
from pipecore.cli.parser import make_parser
from pipecore.errors import CancelledError, PipecoreError

DONE, WRONG, CANCELLED = 0, 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; by default those of the process.
    """
    _replace_unencodable()
    args = make_parser().parse_args(arguments)
    with Console(is_quiet=args.quiet, shows_stages=args.shows_stages) as console:
        try:
            # Imported when needed: `--help` and `info` do not wait for numba.
            importlib.import_module(f"pipecore.cli.{args.command}").run(args, console)
        except (CancelledError, KeyboardInterrupt):
            console.complain("Cancelled; nothing was written.")
            return CANCELLED
        except PipecoreError as error:
            if os.environ.get("PIPECORE_DEBUG"):
                raise
            console.complain(str(error))
            return WRONG
        except MemoryError:
            console.complain("There is not enough memory for this; thin or split the cloud.")
            return WRONG
        except BrokenPipeError:
            # Whoever read our output has left, such as `head`.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return DONE
    return DONE


def _replace_unencodable() -> None:
    """Let consoles of other encodings print “±” as a question mark instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
