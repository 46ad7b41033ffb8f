import io
import os
import re
import signal
import time
from contextlib import redirect_stderr, suppress

import pytest

from pipecore.cli.console import Console
from pipecore.errors import CancelledError


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def wait_for_the_bar():
    """Until the bar draws again: not more often than every 0.1 s."""
    time.sleep(0.15)


def test_that_a_terminal_shows_a_bar_with_the_name_of_the_stage():
    with redirect_stderr(Terminal()) as terminal, Console() as console:
        console.update("profiles", 0.0)
        wait_for_the_bar()
        console.update("profiles", 0.5)
        console.update("ellipses", 0.0)
        wait_for_the_bar()
        console.update("ellipses", 0.25)
    shown = terminal.getvalue()
    assert " 50 %" in shown
    assert " 25 %" in shown
    # What stays on the screen: a line for each stage, and no remains of a bar.
    lines = [line.split("\r")[-1] for line in shown.split("\n")]
    assert [line.split()[0] for line in lines if line.strip()] == ["Profiles", "Ellipses"]
    assert "%" not in "".join(lines)


def test_that_work_that_looks_back_does_not_move_the_bar_back():
    with redirect_stderr(Terminal()) as terminal, Console() as console:
        console.update("axes", 0.9)
        console.update("elements", 0.6)
        console.update("axes", 0.1)
        for fraction in (0.5, 0.7):
            wait_for_the_bar()
            console.update("elements", fraction)
    elements = terminal.getvalue().partition("Elements ")[2]
    assert list(dict.fromkeys(re.findall(r"(\d+) %", elements))) == ["0", "60", "70"]


def test_that_a_stage_that_failed_is_not_reported_as_done(capsys):
    with suppress(ZeroDivisionError), Console() as console:
        console.update("reading", 0.5)
        console.update("reading", 1 / 0)
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(os.name == "nt", reason="Windows ends the process instead")
def test_that_ctrl_c_raises_at_the_next_report_of_progress_and_a_second_at_once():
    # Where the tests run in the background, Ctrl-C is ignored from the start.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with Console(is_quiet=True) as console:
            console.update("profiles", 0.1)
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(CancelledError):
                console.update("profiles", 0.2)
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_that_an_error_is_one_line_whatever_its_text(capsys):
    with Console() as console:
        console.complain("Cannot read\n  “a.laz”.")
    assert capsys.readouterr().err == "pipecore: Cannot read “a.laz”.\n"
