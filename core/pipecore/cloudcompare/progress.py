"""The progress of a detection in CloudCompare's own dialog, with its button to cancel."""

import pycc

from pipecore.errors import CancelledError

SHARES = {
    "thinning": 3.0,
    "normals": 4.0,
    "stacks": 2.0,
    "profiles": 20.0,
    "segments": 1.0,
    "ellipses": 1.0,
    "axes": 1.0,
    "elements": 45.0,
    "deformations": 23.0,
}
"""What each stage takes of a detection, percent: as the demo scan's takes it."""


class DialogProgress:
    """Shows a dialog, and stops the work when it is cancelled there.

    Only what CloudCompare allows from other threads is called from `update`: its texts stay.
    """

    def __init__(self) -> None:
        self._dialog = pycc.ccProgressDialog(True)
        self._dialog.setMethodTitle("PipeGUI: finding pipes")
        self._dialog.setInfo("The first detection after an update takes a minute longer.")
        self._dialog.start()
        self._done, self._stage = 0.0, ""

    def update(self, stage: str, fraction: float) -> None:
        """Show how far the work is; see `pipecore.progress.Progress`."""
        if self._dialog.isCancelRequested():
            raise CancelledError
        if stage != self._stage:
            self._done += SHARES.get(self._stage, 0.0)
            self._stage = stage
        self._dialog.update(float(min(self._done + SHARES.get(stage, 0.0) * fraction, 100.0)))

    def close(self) -> None:
        """Take the dialog away."""
        self._dialog.stop()
