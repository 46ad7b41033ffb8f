"""Windows and files beside CloudCompare: the app, the settings, the folder of a report."""

import importlib.util
import os
import subprocess
import sys
import webbrowser
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from pipecore.errors import PipecoreError
from pipecore.settings import Settings

NO_APP = (
    "The app is not installed beside the plugin: install it with “{python} -m pip install pipegui”."
)


def python() -> str:
    """Return the interpreter of this environment, as a program: CloudCompare holds it as a library.

    Returns
    -------
    str
    """
    if Path(sys.executable).stem.lower().startswith("python"):
        return sys.executable
    for prefix in (sys.prefix, sys.base_prefix):
        for place in ("python.exe", "Scripts/python.exe", "bin/python3", "bin/python"):
            if (path := Path(prefix, place)).is_file():
                return str(path)
    return "python"


def start_app(paths: Sequence[Path]) -> None:
    """Open files in the app, in a process of its own.

    Parameters
    ----------
    paths : sequence of Path

    Raises
    ------
    PipecoreError
        If the app is not installed.
    """
    _need_app()
    subprocess.Popen([python(), "-m", "pipegui", *map(str, paths)], env=_environment())


def choose_settings(path: Path) -> bool:
    """Let the user choose settings, in a window of its own.

    Without the app the file is made with all settings, to be edited by hand.

    Parameters
    ----------
    path : Path
        Where they are kept.

    Returns
    -------
    bool
        Whether they were chosen.

    Raises
    ------
    PipecoreError
        If the app is not installed and the file has just been made.
    """
    if importlib.util.find_spec("pipegui") is None:
        if path.exists():
            return True
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(Settings().to_toml(), encoding="utf-8")
        raise PipecoreError(
            "The settings are in “{path}”: edit them, then detect again. (With the app installed, "
            "a window opens for them.)",
            path=path,
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    command = [python(), "-m", "pipegui", "--choose-settings", str(path)]
    return subprocess.run(command, env=_environment(), check=False).returncode == 0


def settings_path() -> Path:
    """Return where the settings of the plugin are kept.

    Returns
    -------
    Path
    """
    base = os.environ.get("APPDATA") or os.environ.get("XDG_CONFIG_HOME")
    return Path(base or Path.home() / ".config") / "PipeGUI" / "cloudcompare.toml"


def export_folder(now: datetime) -> Path:
    """Return a new folder for a report, in the user's documents; its parent is made.

    Parameters
    ----------
    now : datetime

    Returns
    -------
    Path
    """
    documents = Path.home() / "Documents"
    parent = (documents if documents.is_dir() else Path.home()) / "PipeGUI"
    parent.mkdir(parents=True, exist_ok=True)
    stem = now.strftime("%Y-%m-%d %H-%M-%S")
    names = (stem, *(f"{stem} ({n})" for n in range(2, 100)))
    return next(parent / name for name in names if not (parent / name).exists())


def show_file(path: Path) -> None:
    """Open a file in the user's browser.

    Parameters
    ----------
    path : Path
    """
    webbrowser.open(path.as_uri())


def _need_app() -> None:
    if importlib.util.find_spec("pipegui") is None:
        raise PipecoreError(NO_APP, python=python())


def _environment() -> dict[str, str]:
    """Our own variables: CloudCompare's paths of Qt would mislead the app's."""
    return {k: v for k, v in os.environ.items() if not k.startswith("QT_")}
