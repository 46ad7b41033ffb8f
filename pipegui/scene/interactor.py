"""VTK's widget from pyvistaqt without its plotter: that would bring matplotlib, and a second.

pyvistaqt imports its plotter when it is imported itself, so the package is entered by its
path. Whoever imports the plotter afterwards gets it as ever.
"""

import sys
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any

NAME = "pyvistaqt"


def _load() -> Any:
    if NAME in sys.modules:
        return import_module(f"{NAME}.rwi").QVTKRenderWindowInteractor
    spec = find_spec(NAME)
    if spec is None:
        raise ModuleNotFoundError(NAME)
    sys.modules[NAME] = module_from_spec(spec)  # with its path, but not run
    try:
        return import_module(f"{NAME}.rwi").QVTKRenderWindowInteractor
    finally:
        del sys.modules[NAME]


QVTKRenderWindowInteractor = _load()
