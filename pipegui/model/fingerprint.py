"""Fingerprints of files: a hash of samples, so that not all of a file is read."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

N_SAMPLES, SAMPLE_BYTES = 32, 65_536
"""Number and size of the samples."""


@dataclass(frozen=True)
class Fingerprint:
    """Size and sampled content of a file."""

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

    @classmethod
    def if_there(cls, path: Path) -> "Fingerprint | None":
        """Take the fingerprint of a file; None if it cannot be read."""
        try:
            return cls.of(path)
        except OSError:
            return None

    def fits(self, path: Path) -> bool:
        """Return whether a file has the same content, even if it was copied or touched."""
        if path.stat().st_size != self.size:
            return False
        return Fingerprint.of(path).sample_hash == self.sample_hash
