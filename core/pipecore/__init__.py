"""Find pipes in laser scans, measure them, and find where they are deformed.

>>> import pipecore
>>> cloud = pipecore.read("scan.laz")
>>> result = pipecore.detect(cloud, pipecore.Settings())
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipecore.errors import CancelledError, PipecoreError, ReadError, SettingsError, WriteError
    from pipecore.io import read
    from pipecore.pipeline import detect
    from pipecore.settings import Settings
    from pipecore.types import Deformation, Element, PointCloud, Profiles, Result, Stack

__version__ = "0.1.0"

_HOME = {
    "CancelledError": "errors",
    "PipecoreError": "errors",
    "ReadError": "errors",
    "SettingsError": "errors",
    "WriteError": "errors",
    "read": "io",
    "detect": "pipeline",
    "Settings": "settings",
    "Deformation": "types",
    "Element": "types",
    "PointCloud": "types",
    "Profiles": "types",
    "Result": "types",
    "Stack": "types",
}
__all__ = [
    "CancelledError",
    "Deformation",
    "Element",
    "PipecoreError",
    "PointCloud",
    "Profiles",
    "ReadError",
    "Result",
    "Settings",
    "SettingsError",
    "Stack",
    "WriteError",
    "detect",
    "read",
]


def __getattr__(name: str) -> Any:
    # Imported when first used, so that `pipecore --help` does not wait for numba.
    if name in _HOME:
        return getattr(importlib.import_module(f"pipecore.{_HOME[name]}"), name)
    raise AttributeError(f"module 'pipecore' has no attribute {name!r}")
