"""Where progress and words go: a bar on a terminal, plain lines elsewhere."""

import signal
import sys
import threading
import time
from collections.abc import Iterable
from types import FrameType, TracebackType
from typing import Any, Self

from pipecore.errors import CancelledError
from pipecore.notes import Note


class Console:
    """The terminal, which is also the `Progress` of a command.

    While it is entered, Ctrl-C asks the work to stop: the next report of progress raises
    `CancelledError`, so that everything is left in order. A second Ctrl-C stops at once.

    Parameters
    ----------
    is_quiet : bool
        Whether nothing but errors is printed.
    shows_stages : bool
        Whether each finished stage leaves a line with its time.
    """

    def __init__(self, *, is_quiet: bool = False, shows_stages: bool = True) -> None:
        self._is_quiet = is_quiet
        self._shows_stages = shows_stages
        self._bar: Any = None
        self._stage = ""
        self._stages_seen: set[str] = set()
        self._stage_began = 0.0
        self._is_cancelled = False
        self._old_handlers: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        """Take over Ctrl-C and the request to terminate."""
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._old_handlers[number] = signal.signal(number, self._cancel)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give back what `__enter__` took and leave the terminal in order."""
        self._end_stage(is_done=error is None)
        for number, handler in self._old_handlers.items():
            signal.signal(number, handler)

    def _cancel(self, number: int, frame: FrameType | None) -> None:
        self._is_cancelled = True
        for taken, handler in self._old_handlers.items():
            signal.signal(taken, handler)

    def update(self, stage: str, fraction: float) -> None:
        """Show how far `stage` is; raise `CancelledError` after Ctrl-C."""
        if self._is_cancelled:
            raise CancelledError
        if self._is_quiet:
            return
        if stage not in self._stages_seen:
            self._end_stage(is_done=True)
            self._begin_stage(stage)
        # Work may look back into a former stage; the bar does not.
        if self._bar is not None and stage == self._stage:
            self._bar.update(max(0.0, 100 * fraction - self._bar.n))

    def _begin_stage(self, stage: str) -> None:
        self._stages_seen.add(stage)
        self._stage, self._stage_began = stage, time.monotonic()
        if sys.stderr.isatty():
            from tqdm import tqdm  # noqa: PLC0415

            self._bar = tqdm(
                total=100,
                desc=stage.capitalize(),
                leave=False,
                miniters=0,  # else a quick start of a stage holds the bar back later on
                bar_format="{desc:<18} {bar:30} {percentage:3.0f} %  {remaining} left",
                file=sys.stderr,
            )

    def _end_stage(self, *, is_done: bool) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        if self._stage and is_done and self._shows_stages:
            seconds = time.monotonic() - self._stage_began
            print(f"{self._stage.capitalize():<18} {seconds:6.1f} s", file=sys.stderr, flush=True)
        self._stage = ""

    def say(self, text: str = "") -> None:
        """Print a result on standard output."""
        self._end_stage(is_done=True)
        if not self._is_quiet:
            print(text, flush=True)

    def note(self, text: str) -> None:
        """Print a word on what is being done on standard error."""
        self._end_stage(is_done=True)
        if not self._is_quiet:
            print(text, file=sys.stderr, flush=True)

    def warn(self, notes: Iterable[Note]) -> None:
        """Print notes on what was read on standard error, a line each, also when quiet."""
        for note in notes:
            self._end_stage(is_done=True)
            print(f"Note: {' '.join(str(note).split())}", file=sys.stderr, flush=True)

    def complain(self, text: str) -> None:
        """Print an error as one line on standard error."""
        self._end_stage(is_done=False)
        print(f"pipecore: {' '.join(text.split())}", file=sys.stderr, flush=True)
