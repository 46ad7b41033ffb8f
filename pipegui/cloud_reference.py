"""Clouds named by their files, and known again by what is in them. Qt-free."""

import hashlib
import os
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from pipecore.errors import WriteError
from pipecore.settings import LengthUnit
from pipegui.document import Scan
from pipegui.texts import tr

N_SAMPLES, SAMPLE_BYTES = 32, 65_536
"""A fingerprint takes this many samples of a file."""


class CloudState(Enum):
    """What became of a cloud since the project was saved."""

    FOUND = "found"
    CHANGED = "changed"
    MISSING = "missing"


@dataclass(frozen=True)
class Fingerprint:
    """What a file is known again by."""

    size: int
    mtime_ns: int
    sample_hash: str

    @classmethod
    def of(cls, path: Path) -> "Fingerprint":
        """Take the fingerprint of a file; `OSError` if it cannot be read."""
        status = path.stat()
        digest = hashlib.sha256(str(status.st_size).encode())
        last = max(status.st_size - SAMPLE_BYTES, 0)
        with path.open("rb") as file:
            for i in range(N_SAMPLES):
                file.seek(last * i // max(N_SAMPLES - 1, 1))
                digest.update(file.read(SAMPLE_BYTES))
        return cls(status.st_size, status.st_mtime_ns, digest.hexdigest())

    def fits(self, path: Path) -> bool:
        """Whether a file holds the same; that it was copied or touched does not matter."""
        if path.stat().st_size != self.size:
            return False
        return Fingerprint.of(path).sample_hash == self.sample_hash


@dataclass(frozen=True)
class CloudReference:
    """Where a cloud is, and what it is known by."""

    path: Path
    relative: str
    """From the project's folder with forward slashes, or ""."""
    fingerprint: Fingerprint
    n_points: int
    length_unit: LengthUnit = LengthUnit.METRE

    @classmethod
    def to(cls, scan: Scan, folder: Path) -> "CloudReference":
        """Refer to the cloud of a scan from a project's folder; `WriteError` if it has no file."""
        source = scan.cloud.source
        if source is None:
            raise WriteError(
                tr("“{name}” was not read from a file, so it cannot be saved.").format(
                    name=scan.name
                )
            )
        source = Path(os.path.abspath(source))  # noqa: PTH100 - links stay links
        try:
            fingerprint = Fingerprint.of(source)
        except OSError as error:
            raise WriteError(
                tr("The scan “{source}” is no longer there.").format(source=source)
            ) from error
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
