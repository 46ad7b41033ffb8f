"""Files and folders that are whole or not there.

What is written goes to a temporary name beside its place and is moved there at the end.
After an error nothing is left behind, and what stood there before still does.
"""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipecore.errors import WriteError


@contextmanager
def write_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the name under which to write a file; it takes the place of `path` when whole.

    Parameters
    ----------
    path : path

    Raises
    ------
    WriteError
        If the operating system refuses, such as for a full disk or a missing folder.

    Examples
    --------
    >>> with write_file("elements.csv") as temporary:
    ...     temporary.write_text("element_id,run_id")
    """
    place = _place(path)
    if place.is_dir():
        raise WriteError("“{path}” is a folder; give a file name.", path=path)
    temporary = _beside(place)
    with _told_as_write_errors(path):
        try:
            yield temporary
            _sync(temporary)
            os.replace(temporary, place)  # noqa: PTH105
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
        _sync(place.parent)


@contextmanager
def write_directory(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Yield the folder into which to write; it takes the place of `path` when whole.

    Parameters
    ----------
    path : path
        A folder that is not there yet, or is empty; its parent must be there.
    overwrite : bool
        Whether `path` may hold files. Those that are written anew are replaced at the
        end, all or none of them; others stay.

    Raises
    ------
    WriteError
        If `path` is a file, or holds files and `overwrite` is not set, before anything
        is written; or if the operating system refuses.
    """
    place = _place(path)
    with _told_as_write_errors(path):
        _check_vacant(place, overwrite)
        temporary = _beside(place)
        temporary.mkdir()
        try:
            yield temporary
            for file in _files_in(temporary):
                _sync(temporary / file)
            # Somebody may have put something there in the meantime.
            if _check_vacant(place, overwrite):
                with suppress(FileNotFoundError):
                    place.rmdir()
                os.replace(temporary, place)  # noqa: PTH105
            else:
                _replace_files(temporary, place)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        _sync(place.parent)


def _check_vacant(place: Path, overwrite: bool) -> bool:
    """Tell whether the place is free or an empty folder; refuse what must not be touched."""
    if not place.exists():
        return True
    if not place.is_dir():
        raise WriteError("“{place}” is a file; give a folder.", place=place)
    is_empty = next(place.iterdir(), None) is None
    if not is_empty and not overwrite:
        raise WriteError(
            "The folder “{place}” is not empty; give another or allow overwriting.", place=place
        )
    return is_empty


def _replace_files(new: Path, place: Path) -> None:
    """Move all files of `new` into `place`; if one of them cannot be, undo the others."""
    replaced = _beside(place)
    moved: list[Path] = []
    try:
        for file in _files_in(new):
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            if (place / file).exists():
                (replaced / file).parent.mkdir(parents=True, exist_ok=True)
                os.replace(place / file, replaced / file)  # noqa: PTH105
            moved.append(file)
            os.replace(new / file, place / file)  # noqa: PTH105
    except BaseException:
        for file in moved:
            with suppress(OSError):
                (place / file).unlink(missing_ok=True)
        for file in _files_in(replaced):
            with suppress(OSError):
                os.replace(replaced / file, place / file)  # noqa: PTH105
        raise
    finally:
        shutil.rmtree(replaced, ignore_errors=True)
    _sync(place)


def _files_in(folder: Path) -> list[Path]:
    return sorted(p.relative_to(folder) for p in folder.rglob("*") if not p.is_dir())


def _place(path: str | os.PathLike[str]) -> Path:
    # A link stays a link: what it points to is replaced.
    return Path(os.path.realpath(path))


def _beside(place: Path) -> Path:
    # The ending stays, for libraries that go by it.
    return place.with_name(f".{place.stem}.{secrets.token_hex(4)}.part{place.suffix}")


def _sync(path: Path) -> None:
    """Make sure that a file (or a folder's list of files) is on the disk, where that can be."""
    if path.is_dir() and os.name == "nt":
        return
    flags = os.O_RDONLY if path.is_dir() else os.O_RDWR
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _told_as_write_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except PermissionError as error:
        raise WriteError("You have no permission to write “{path}”.", path=path) from error
    except OSError as error:
        folder = _place(path).parent
        if not folder.is_dir():
            raise WriteError(
                "“{path}” cannot be written: there is no folder “{folder}”.",
                path=path,
                folder=folder,
            ) from error
        raise WriteError(
            "“{path}” cannot be written ({reason}).", path=path, reason=error.strerror or error
        ) from error
