"""Where the files in ``resources/`` are: in the wheel, or beside the sources."""

from pathlib import Path

_IN_WHEEL = Path(__file__).parent / "resources"
_IN_SOURCES = Path(__file__).parents[2] / "resources"


def resource(*parts: str) -> Path:
    """Path of a file or folder in ``resources/``.

    Parameters
    ----------
    *parts : str
        Names of folders and the file, below ``resources/``.

    Returns
    -------
    Path
    """
    root = _IN_WHEEL if _IN_WHEEL.is_dir() else _IN_SOURCES
    return root.joinpath(*parts)
