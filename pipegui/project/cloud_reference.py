"""References to the files of clouds: path and fingerprint."""

import os
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from pipecore.errors import WriteError
from pipecore.settings import LengthUnit
from pipegui.i18n.texts import tr
from pipegui.model.document import Scan
from pipegui.model.fingerprint import Fingerprint


class CloudState(Enum):
    """State of a cloud's file since the project was saved."""

    FOUND = "found"
    CHANGED = "changed"
    MISSING = "missing"


@dataclass(frozen=True)
class CloudReference:
    """Where a cloud's file is, and what was in it."""

    path: Path
    relative: str
    """From the project's folder with forward slashes, or ""."""
    fingerprint: Fingerprint
    n_points: int
    length_unit: LengthUnit = LengthUnit.METRE

    @classmethod
    def to(cls, scan: Scan, folder: Path) -> "CloudReference":
        """Refer to the cloud of a scan from a project's folder; `WriteError` if it has no file.

        The fingerprint is that of the file when the cloud was read: if it has been changed
        since, it holds another cloud.
        """
        source = scan.cloud.source
        if source is None:
            raise WriteError(
                tr("“{name}” was not read from a file, so it cannot be saved.").format(
                    name=scan.name
                )
            )
        source = Path(os.path.abspath(source))  # noqa: PTH100 - links stay links
        fingerprint = scan.fingerprint or Fingerprint.if_there(source)
        if fingerprint is None:
            raise WriteError(tr("The scan “{source}” is no longer there.").format(source=source))
        try:
            relative = os.path.relpath(source, folder).replace(os.sep, "/")
        except ValueError:  # on another drive
            relative = ""
        return cls(source, relative, fingerprint, len(scan.cloud), scan.length_unit)

    def locate(self, folder: Path) -> tuple[Path, CloudState]:
        """Find the cloud from the project's folder; the place beside the project comes first."""
        places = [self.path]
        if self.relative:
            places.insert(0, Path(os.path.normpath(folder / self.relative)))
        there = [p for p in places if _is_file(p)]
        for path in there:
            if _fits(self.fingerprint, path):
                return path, CloudState.FOUND
        return (there[0], CloudState.CHANGED) if there else (places[0], CloudState.MISSING)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _fits(fingerprint: Fingerprint, path: Path) -> bool:
    try:
        return fingerprint.fits(path)
    except OSError:
        return False
