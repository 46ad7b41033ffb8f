"""References to the files of clouds: paths and fingerprints."""

import os
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from pipecore.errors import WriteError
from pipecore.settings import InputSettings, LengthUnit, Settings
from pipegui.i18n.texts import tr
from pipegui.model.document import Scan
from pipegui.model.fingerprint import Fingerprint


class CloudState(Enum):
    """State of a cloud's file since the project was saved."""

    FOUND = "found"
    CHANGED = "changed"
    MISSING = "missing"


@dataclass(frozen=True)
class FileReference:
    """Where a file is, and what was in it."""

    path: Path
    relative: str
    """From the project's folder with forward slashes, or ""."""
    fingerprint: Fingerprint

    @classmethod
    def to_file(
        cls, path: Path, folder: Path, fingerprint: Fingerprint | None = None
    ) -> "FileReference":
        """Refer to a file from a project's folder; `WriteError` if it is no longer there."""
        path = Path(os.path.abspath(path))  # noqa: PTH100 - links stay links
        fingerprint = fingerprint or Fingerprint.if_there(path)
        if fingerprint is None:
            raise WriteError(tr("The scan “{source}” is no longer there.").format(source=path))
        try:
            relative = os.path.relpath(path, folder).replace(os.sep, "/")
        except ValueError:  # on another drive
            relative = ""
        return cls(path, relative, fingerprint)

    def locate(self, folder: Path) -> tuple[Path, CloudState]:
        """Find the file from the project's folder; the place beside the project comes first."""
        places = [self.path]
        if self.relative:
            places.insert(0, Path(os.path.normpath(folder / self.relative)))
        there = [p for p in places if _is_file(p)]
        for path in there:
            if _fits(self.fingerprint, path):
                return path, CloudState.FOUND
        return (there[0], CloudState.CHANGED) if there else (places[0], CloudState.MISSING)


@dataclass(frozen=True)
class CloudReference(FileReference):
    """Where a cloud's files are, and how they were read."""

    n_points: int
    length_unit: LengthUnit = LengthUnit.METRE
    """All that projects of earlier versions know of how it was read."""
    reading: InputSettings | None = None
    others: tuple[FileReference, ...] = ()
    """More files of the same cloud."""

    @classmethod
    def to(cls, scan: Scan, folder: Path) -> "CloudReference":
        """Refer to the cloud of a scan from a project's folder; `WriteError` if it has no file.

        The fingerprint is that of the file when the cloud was read: if it has been changed
        since, it holds another cloud.
        """
        if scan.cloud.source is None:
            raise WriteError(
                tr("“{name}” was not read from a file, so it cannot be saved.").format(
                    name=scan.name
                )
            )
        first = FileReference.to_file(scan.cloud.source, folder, scan.fingerprint)
        return cls(
            first.path,
            first.relative,
            first.fingerprint,
            len(scan.cloud),
            scan.reading.length_unit,
            scan.reading,
            tuple(FileReference.to_file(path, folder) for path in scan.others),
        )

    def how_read(self, settings: Settings) -> InputSettings:
        """Return the settings with which it was read; `settings` are those of the project."""
        return self.reading or replace(settings.input, length_unit=self.length_unit)


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
