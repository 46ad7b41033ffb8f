"""PTX: several scans, each in its pose."""

from pathlib import Path

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from tests.core.io.cases import pipe, ptx


def test_that_scans_follow_each_other_with_and_without_colours(tmp_path: Path) -> None:
    xyz = pipe(400)
    first = ptx(tmp_path / "a.ptx", xyz[:150]).read_text()
    second = ptx(tmp_path / "b.ptx", xyz[150:], " -1024").read_text()
    (tmp_path / "both.ptx").write_text(first + second)
    cloud = io.read(tmp_path / "both.ptx")
    assert np.abs(cloud.world(cloud.xyz.astype(float)) - xyz).max() < 1e-4
    assert np.bincount(cloud.station).tolist() == [0, 150, 250]
    # Intensities stand as they are, from 0 to 1 or as Leica's whole numbers.
    assert set(cloud.intensity[:150]) == {np.float32(0.5)}
    assert set(cloud.intensity[150:]) == {np.float32(-1024)}
    assert (cloud.rgb[:150] == (10, 20, 30)).all()
    assert not cloud.rgb[150:].any()


def test_that_the_whole_lines_of_a_truncated_file_are_read(tmp_path: Path) -> None:
    path = ptx(tmp_path / "a.ptx", pipe(400))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:210]))
    cloud = io.read(path)
    assert len(cloud) == 200
    assert "announces 2,500 points; the 200 that are whole" in str(cloud.notes[0])


@pytest.mark.parametrize(
    ("number", "line", "cause"),
    [
        (6, "0 0 0 0\n", "no PTX|does not begin"),
        (8, "a b c d\n", "does not begin"),
        (12, "1 2 three 0.5 1 2 3\n", "line 13 is no point"),
        (15, "1 2 3\n", "is no point"),
    ],
)
def test_that_the_error_names_the_line(tmp_path: Path, number: int, line: str, cause: str) -> None:
    path = ptx(tmp_path / "a.ptx", pipe(400))
    lines = path.read_text().splitlines(keepends=True)
    lines[number] = line
    path.write_text("".join(lines))
    with pytest.raises(ReadError, match=cause):
        io.read(path)
