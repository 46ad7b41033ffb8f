"""Reading a result back from wherever it was saved."""

import os
from pathlib import Path

from pipecore.progress import NoProgress, Progress
from pipecore.report.project import load_project
from pipecore.report.reading import load_folder
from pipecore.types import Result


def load(
    folder: str | os.PathLike[str], scan: str | None = None, *, progress: Progress | None = None
) -> Result:
    """Read a result from a report folder or from a project of the app.

    Parameters
    ----------
    folder : path
        As `write_report`, `Result.save` or ``pipecore detect`` made it; needed are
        ``result.json`` and, for what belongs to each point, ``segments.laz``. Or a
        ``.pipegui`` file.
    scan : str, optional
        Which scan of a project, by its name there; needed where several have results.
    progress : Progress, optional
        Receives updates of the stage "reading"; may cancel.

    Returns
    -------
    Result
        Equal to the one that was written, with the name alone of its `source`; from a
        report folder numbers of profiles to the nanometre, deviations of points to float32.
        Without ``segments.laz`` its arrays by point are empty.

    Raises
    ------
    ReadError
        If there is no report of a version that this program knows, no such scan in the
        project, or what is there contradicts itself.
    CancelledError
        From `progress`.
    """
    path, progress = Path(folder), progress or NoProgress()
    if path.is_file():
        return load_project(path, scan, progress)
    return load_folder(path, progress)
