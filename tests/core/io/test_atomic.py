import os
from pathlib import Path

import pytest

from pipecore.errors import WriteError
from pipecore.io import write_directory, write_file


def names(folder: Path) -> list[str]:
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*"))


def test_that_a_file_appears_only_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "report.csv"
    with write_file(path) as temporary:
        temporary.write_text("half")
        assert not path.exists()
        assert temporary.parent == path.parent
        assert temporary.suffix == ".csv"
        temporary.write_text("whole")
    assert path.read_text() == "whole"
    assert names(tmp_path) == ["report.csv"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_that_an_error_leaves_nothing_and_keeps_what_was_there(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "report.csv"
    path.write_text("before")

    def fail() -> None:
        with write_file(path) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert path.read_text() == "before"
    assert names(tmp_path) == ["report.csv"]


def test_that_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("before")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    with write_file(tmp_path / "link.csv") as temporary:
        temporary.write_text("after")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "after"


def test_that_a_missing_folder_is_told(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "a.csv"
    with pytest.raises(WriteError, match="there is no folder"), write_file(path) as temporary:
        temporary.write_text("x")
    with pytest.raises(WriteError, match="there is no folder"), write_directory(path):
        pass


def test_that_a_file_cannot_take_the_place_of_a_folder_nor_a_folder_of_a_file(
    tmp_path: Path,
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(WriteError, match="is a folder"), write_file(tmp_path / "folder"):
        pass
    with (
        pytest.raises(WriteError, match="is a file"),
        write_directory(tmp_path / "file", overwrite=True),
    ):
        pass


def test_that_a_full_disk_is_told(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match=r"a\.csv.*No space left"), write_file(tmp_path / "a.csv"):
        raise OSError(28, "No space left on device")
    assert names(tmp_path) == []


@pytest.mark.parametrize("exists", [True, False])
@pytest.mark.parametrize("overwrite", [True, False])
def test_that_a_folder_appears_only_when_it_is_whole(
    tmp_path: Path, exists: bool, overwrite: bool
) -> None:
    place = tmp_path / "out"
    if exists:
        place.mkdir()
    with write_directory(place, overwrite=overwrite) as temporary:
        (temporary / "a.csv").write_text("a")
        (temporary / "figures").mkdir()
        (temporary / "figures" / "b.png").write_text("b")
        assert not place.exists() or not names(place)
    assert names(place) == ["a.csv", "figures", "figures/b.png"]
    assert names(tmp_path)[0] == "out"


def test_that_a_folder_with_files_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    place = tmp_path / "out"
    place.mkdir()
    (place / "mine.txt").write_text("mine")
    entered = False
    with pytest.raises(WriteError, match="not empty"), write_directory(place):
        entered = True
    assert not entered
    assert names(tmp_path) == ["out", "out/mine.txt"]


def test_that_overwriting_replaces_only_what_is_written_anew(tmp_path: Path) -> None:
    place = tmp_path / "out"
    (place / "figures").mkdir(parents=True)
    for name in ("mine.txt", "a.csv", "figures/b.png"):
        (place / name).write_text("before")
    with write_directory(place, overwrite=True) as temporary:
        (temporary / "figures").mkdir()
        (temporary / "a.csv").write_text("after")
        (temporary / "figures" / "c.png").write_text("after")
    contents = {name: (place / name).read_text() for name in names(place) if "." in name}
    assert contents == {
        "mine.txt": "before",
        "a.csv": "after",
        "figures/b.png": "before",
        "figures/c.png": "after",
    }
    assert {name.split("/")[0] for name in names(tmp_path)} == {"out"}


def test_that_an_error_while_writing_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    place = tmp_path / "out"
    place.mkdir()
    (place / "a.csv").write_text("before")

    def fail() -> None:
        with write_directory(place, overwrite=True) as temporary:
            (temporary / "a.csv").write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert (place / "a.csv").read_text() == "before"
    assert names(tmp_path) == ["out", "out/a.csv"]


def test_that_replacing_is_undone_if_one_file_cannot_be_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "out"
    place.mkdir()
    for name in ("a.csv", "c.csv"):
        (place / name).write_text("before")
    replace = os.replace

    def refuse(source: Path, target: Path) -> None:
        # As Windows does for a table that is open in a spreadsheet.
        if Path(source) == place / "c.csv":
            raise PermissionError(13, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)

    def write_all() -> None:
        with write_directory(place, overwrite=True) as temporary:
            for name in ("a.csv", "b.csv", "c.csv"):
                (temporary / name).write_text("after")

    with pytest.raises(WriteError, match="permission"):
        write_all()
    assert {name: (place / name).read_text() for name in names(place)} == {
        "a.csv": "before",
        "c.csv": "before",
    }
    assert names(tmp_path) == ["out", "out/a.csv", "out/c.csv"]
