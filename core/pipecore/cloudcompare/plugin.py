"""The actions that CloudCompare shows, and what each does. Loaded at CloudCompare's start."""

import traceback
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import pycc

from pipecore.errors import CancelledError, PipecoreError
from pipecore.resources import resource


class PipeGUI(pycc.PythonPluginInterface):
    """Finds pipes in the selected clouds and shows them beside these."""

    def __init__(self) -> None:
        pycc.PythonPluginInterface.__init__(self)
        self._app = pycc.GetInstance()
        self._last: tuple[Any, Any] | None = None
        """The cloud and the result of the last detection."""

    def getIcon(self) -> str:  # noqa: N802 - CloudCompare's name
        """Return the path of the icon."""
        return str(resource("cloudcompare/pipegui.png"))

    def getActions(self) -> list[Any]:  # noqa: N802 - CloudCompare's name
        """Return the actions, in the order of the menu."""
        targets: Sequence[tuple[str, Callable[[], None]]] = (
            ("Find pipes", self._find_pipes),
            ("Detect with settings…", self._detect_with_settings),
            ("Open in PipeGUI", self._open_in_app),
            ("Export tables…", self._export_tables),
        )
        icon = self.getIcon()
        return [
            pycc.Action(name=name, target=_reporting(name, target), icon=icon)
            for name, target in targets
        ]

    # The actions

    def _find_pipes(self) -> None:
        from pipecore.settings import Settings  # noqa: PLC0415 - CloudCompare starts sooner

        self._detect(Settings())

    def _detect_with_settings(self) -> None:
        from pipecore.cloudcompare import processes  # noqa: PLC0415
        from pipecore.settings import Settings  # noqa: PLC0415

        path = processes.settings_path()
        if not _in_thread(processes.choose_settings, path):
            pycc.ccLog.Print("[PipeGUI] No settings chosen: nothing was detected.")
            return
        self._detect(Settings.from_toml(path))

    def _open_in_app(self) -> None:
        from pipecore.cloudcompare import clouds, processes  # noqa: PLC0415
        from pipecore.io import write  # noqa: PLC0415

        selected = clouds.selected(self._app)
        paths = []
        folder = Path(mkdtemp(prefix="pipegui-"))
        for number, cloud in enumerate(selected, start=1):
            path = folder / f"{number} {clouds.file_name(cloud)}.laz"
            notes = _in_thread(write, clouds.with_fields(cloud), path)
            for note in notes:
                pycc.ccLog.Warning(f"[PipeGUI] {note}")
            paths.append(path)
        processes.start_app(paths)
        pycc.ccLog.Print(f"[PipeGUI] Opened in PipeGUI: {', '.join(p.name for p in paths)}")

    def _export_tables(self) -> None:
        if self._last is None:
            raise PipecoreError("Find pipes first: there is nothing to export yet.")
        from pipecore.cloudcompare import processes  # noqa: PLC0415
        from pipecore.report import write_report  # noqa: PLC0415

        cloud, result = self._last
        folder = processes.export_folder(datetime.now())
        for note in _in_thread(write_report, folder, cloud, result):
            pycc.ccLog.Warning(f"[PipeGUI] {note}")
        pycc.ccLog.Print(f"[PipeGUI] Tables and report: {folder}")
        processes.show_file(folder / "report.html")

    # Detecting

    def _detect(self, settings: Any) -> None:
        from pipecore.cloudcompare import clouds, fields, shapes  # noqa: PLC0415
        from pipecore.cloudcompare.progress import DialogProgress  # noqa: PLC0415
        from pipecore.pipeline import detect  # noqa: PLC0415
        from pipecore.report.summary import summarise  # noqa: PLC0415

        selected = clouds.selected(self._app)
        cloud = clouds.joined(selected)
        progress = DialogProgress()
        try:
            result = _in_thread(detect, cloud, settings, progress)
        finally:
            progress.close()
        self._last = cloud, result
        if result.elements:
            fields.write(selected, cloud, result)
            self._app.addToDB(shapes.group_of(cloud, result, selected[0]))
            self._app.redrawAll()
            self._app.updateUI()
        for note in result.notes:
            pycc.ccLog.Warning(f"[PipeGUI] {note}")
        pycc.ccLog.Print(f"[PipeGUI] {summarise(result)}.")


def _reporting(name: str, target: Callable[[], None]) -> Callable[[], None]:
    """What an action does, with its errors told as CloudCompare's own; nothing is half done."""

    def act() -> None:
        try:
            target()
        except CancelledError:
            pycc.ccLog.Print(f"[PipeGUI] {name} was cancelled; nothing was changed.")
        except PipecoreError as error:
            pycc.ccLog.Error(f"[PipeGUI] {error}")
        except Exception as error:
            pycc.ccLog.Warning(f"[PipeGUI] {traceback.format_exc()}")
            pycc.ccLog.Error(f"[PipeGUI] {name} failed: {error}. The console has the details.")

    return act


def _in_thread(work: Callable[..., Any], *arguments: Any) -> Any:
    """Run work in the runtime's thread, while CloudCompare goes on drawing.

    The runtime would turn an exception into a bare "std::exception": it is carried over.
    """

    def caught() -> tuple[Any, Exception | None]:
        try:
            return work(*arguments), None
        except Exception as error:
            return None, error

    value, error = pycc.RunInThread(caught)
    if error is not None:
        raise error
    return value
