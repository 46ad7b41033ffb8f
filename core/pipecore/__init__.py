"""Find pipes in laser scans, measure them, and find where they are deformed.

>>> import pipecore
>>> cloud = pipecore.read("scan.laz")
>>> result = pipecore.detect(cloud)
>>> result.deformations_table()["depth_mm"]
>>> result.save("report", cloud)

Everything is imported when it is first used: `pipecore.io`, `pipecore.report` and the other
packages of `dir(pipecore)` need no import of their own.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipecore import (
        catalogues,
        deformation,
        editing,
        errors,
        geometry,
        inspection,
        io,
        preview,
        report,
        rules,
        settings,
        simulate,
        types,
    )
    from pipecore.errors import CancelledError, PipecoreError, ReadError, SettingsError, WriteError
    from pipecore.io import info, read, write
    from pipecore.pipeline import detect
    from pipecore.report import load, write_report
    from pipecore.settings import Settings
    from pipecore.table import Table
    from pipecore.types import (
        Deformation,
        DeformationKind,
        Element,
        ElementKind,
        PointCloud,
        Profiles,
        Result,
        Stack,
        Verdict,
    )

__version__ = "0.1.0"

__all__ = [
    "CancelledError",
    "Deformation",
    "DeformationKind",
    "Element",
    "ElementKind",
    "PipecoreError",
    "PointCloud",
    "Profiles",
    "ReadError",
    "Result",
    "Settings",
    "SettingsError",
    "Stack",
    "Table",
    "Verdict",
    "WriteError",
    "catalogues",
    "deformation",
    "detect",
    "editing",
    "errors",
    "geometry",
    "info",
    "inspection",
    "io",
    "load",
    "preview",
    "read",
    "report",
    "rules",
    "settings",
    "simulate",
    "types",
    "write",
    "write_report",
]

_NAMES_OF = {
    "errors": ("CancelledError", "PipecoreError", "ReadError", "SettingsError", "WriteError"),
    "io": ("info", "read", "write"),
    "pipeline": ("detect",),
    "report": ("load", "write_report"),
    "settings": ("Settings",),
    "table": ("Table",),
    "types": (
        "Deformation",
        "DeformationKind",
        "Element",
        "ElementKind",
        "PointCloud",
        "Profiles",
        "Result",
        "Stack",
        "Verdict",
    ),
}
_MODULE_OF = {name: module for module, names in _NAMES_OF.items() for name in names}


def __getattr__(name: str) -> Any:
    # Imported when first used, so that `pipecore --help` does not wait for numba.
    if name in _MODULE_OF:
        return getattr(importlib.import_module(f"pipecore.{_MODULE_OF[name]}"), name)
    if name in __all__:
        return importlib.import_module(f"pipecore.{name}")
    raise AttributeError(f"module 'pipecore' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
