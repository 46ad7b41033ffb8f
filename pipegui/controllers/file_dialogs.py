"""Asking for files: what to open, where to export to, which ones were open lately."""

import os
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSettings, QStandardPaths
from PySide6.QtWidgets import QFileDialog, QWidget

from pipecore.errors import PipecoreError
from pipecore.io import file_filter, formats
from pipecore.resources import resource
from pipegui.controllers.session import Session
from pipegui.i18n.texts import error_text, tr
from pipegui.project.project_file import SUFFIX

N_RECENT = 10
DEMO = resource("demo", "demo.laz")
"""Nobody looks for their own files beside it."""
WRITTEN_CLOUDS = (".laz", ".las", ".ply", ".e57")


def ask_scans(parent: QWidget, settings: QSettings) -> list[Path]:
    """Ask for scans to open."""
    names, _ = QFileDialog.getOpenFileNames(
        parent,
        tr("Open laser scans"),
        _last_folder(settings),
        _scans_filter() + ";;" + tr("Projects (*{suffix})").format(suffix=SUFFIX),
    )
    paths = [Path(name) for name in names]
    if paths:
        settings.setValue("files/folder", str(paths[0].parent))
    return paths


def ask_text(parent: QWidget, settings: QSettings) -> list[Path]:
    """Ask for text files to open."""
    endings = next(" ".join(f"*{e}" for e in f.endings) for f in formats() if f.module == "text")
    names, _ = QFileDialog.getOpenFileNames(
        parent,
        tr("Open text with columns"),
        _last_folder(settings),
        ";;".join([tr("Text ({endings})").format(endings=endings), tr("All files") + " (*)"]),
    )
    paths = [Path(name) for name in names]
    if paths:
        settings.setValue("files/folder", str(paths[0].parent))
    return paths


def ask_scan(parent: QWidget, settings: QSettings, name: str) -> Path | None:
    """Ask where a scan is."""
    found, _ = QFileDialog.getOpenFileName(
        parent, tr("Locate “{name}”").format(name=name), _last_folder(settings), _scans_filter()
    )
    return Path(found) if found else None


def ask_project(parent: QWidget, settings: QSettings) -> Path | None:
    """Ask for a project to open."""
    name, _ = QFileDialog.getOpenFileName(
        parent,
        tr("Open project"),
        _last_folder(settings),
        tr("Projects (*{suffix})").format(suffix=SUFFIX),
    )
    if not name:
        return None
    settings.setValue("files/folder", str(Path(name).parent))
    return Path(name)


def ask_settings(parent: QWidget, settings: QSettings) -> Path | None:
    """Ask for a settings file to load."""
    name, _ = QFileDialog.getOpenFileName(
        parent, tr("Load settings"), _last_folder(settings), tr("Settings (*.toml)")
    )
    return Path(name) if name else None


def ask_target(
    parent: QWidget, settings: QSettings, title: str, name: str, name_filter: str
) -> Path | None:
    """Ask where to write a file; `name` is proposed, with its ending.

    Parameters
    ----------
    parent : QWidget
        The dialog opens over it.
    settings : QSettings
        Remembers the folder used last.
    title : str
        Of the dialog.
    name : str
        The file's proposed name.
    name_filter : str
        Kinds of files, as Qt writes them: "Tables (*.csv)".

    Returns
    -------
    Path or None
        None if the user cancels.
    """
    proposed = Path(_last_folder(settings)) / name
    chosen, _ = QFileDialog.getSaveFileName(parent, title, str(proposed), name_filter)
    if not chosen:
        return None
    path = Path(chosen)
    settings.setValue("files/folder", str(path.parent))
    return path if path.suffix else path.with_suffix(Path(name).suffix)


def ask_cloud_target(
    parent: QWidget,
    settings: QSettings,
    title: str,
    name: str,
    suffix: str,
    beside: Path | None = None,
) -> Path | None:
    """Ask where to write points, and in which format.

    Parameters
    ----------
    parent : QWidget
        The dialog opens over it.
    settings : QSettings
        Remembers the folder used last.
    title : str
        Of the dialog.
    name : str
        The file's proposed name, without ending.
    suffix : str
        Ending of the format that is proposed; of LAZ if nothing can be written so.
    beside : Path, optional
        The file that the points came from: it is proposed to write beside it.

    Returns
    -------
    Path or None
        None if the user cancels. A name without an ending gets that of the format chosen.
    """
    proposed = suffix if suffix in WRITTEN_CLOUDS else ".laz"
    kinds = {f"{ending[1:].upper()} (*{ending})": ending for ending in WRITTEN_CLOUDS}
    first = next(kind for kind, ending in kinds.items() if ending == proposed)
    folder = Path(_last_folder(settings))
    if beside is not None and os.access(beside.parent, os.W_OK) and beside != DEMO:
        folder = beside.parent
    start = str(folder / (name + proposed))
    chosen, kind = QFileDialog.getSaveFileName(parent, title, start, ";;".join(kinds), first)
    if not chosen:
        return None
    path = Path(chosen)
    settings.setValue("files/folder", str(path.parent))
    if path.suffix.lower() in WRITTEN_CLOUDS:
        return path
    # The dialog asked of a name without ending whether it may be overwritten.
    return _vacant_file(path.with_name(path.name + kinds.get(kind, proposed)))


def save_as(
    session: Session,
    parent: QWidget,
    title: str,
    name: str,
    name_filter: str,
    write: Callable[[Path], None],
) -> None:
    """Ask where to write a file as `ask_target` does, write it, and say what came of it.

    Parameters
    ----------
    session : Session
        Shows what came of it.
    parent, title, name, name_filter
        As for `ask_target`.
    write : callable
        Writes the file at a path.
    """
    path = ask_target(parent, session.stored, title, name, name_filter)
    if path is None:
        return
    try:
        write(path)
    except (PipecoreError, OSError) as error:
        text = tr("“{path}” was not saved: {error}").format(path=path, error=error_text(error))
        session.show_message(text, "error")
    else:
        session.show_message(tr("Saved “{path}”.").format(path=path))


def ask_report_folder(parent: QWidget, settings: QSettings, name: str) -> Path | None:
    """Ask for the folder in which a report's own folder `name` is made."""
    chosen = QFileDialog.getExistingDirectory(
        parent, tr("Make the report folder in"), _last_folder(settings)
    )
    if not chosen:
        return None
    settings.setValue("files/folder", chosen)
    return _vacant(Path(chosen) / name)


def _vacant(folder: Path) -> Path:
    """`folder`, numbered where it is there already, so that no report is overwritten."""
    number, vacant = 1, folder
    while vacant.exists():
        number += 1
        vacant = folder.with_name(f"{folder.name} {number}")
    return vacant


def _vacant_file(path: Path) -> Path:
    number, vacant = 1, path
    while vacant.exists():
        number += 1
        vacant = path.with_stem(f"{path.stem} {number}")
    return vacant


def recent(settings: QSettings) -> list[Path]:
    """Return the scans and projects opened last that are still there, the latest first."""
    stored = settings.value("files/recent", [])
    # A list of one comes back as plain text.
    names = [stored] if isinstance(stored, str) else stored
    if not isinstance(names, list):
        return []
    return [path for path in map(Path, names) if path.is_file()]


def remember(settings: QSettings, path: Path) -> None:
    """Put a scan or project at the top of the recent ones."""
    paths = [path.resolve(), *(p for p in recent(settings) if p != path.resolve())]
    settings.setValue("files/recent", [str(p) for p in paths[:N_RECENT]])


def preset_folder() -> Path:
    """Return the folder of the settings that the user keeps by name."""
    place = QStandardPaths.StandardLocation.AppDataLocation
    return Path(QStandardPaths.writableLocation(place)) / "presets"


def _last_folder(settings: QSettings) -> str:
    folder = settings.value("files/folder", "")
    return str(folder) if folder and Path(str(folder)).is_dir() else str(Path.home())


def _scans_filter() -> str:
    """The core's filter of kinds of files; what is no name of a format is translated."""
    kinds = [kind.partition(" (") for kind in file_filter().split(";;")]
    return ";;".join(f"{tr(name)}{opening}{endings}" for name, opening, endings in kinds)
