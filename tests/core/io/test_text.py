import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from pipecore.io import table
from tests.core.io.writers import FORMS, lines


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("has_mark", [False, True])
def test_that_every_kind_of_table_gives_the_same_points(
    tmp_path: Path, points: Any, name: str, line_end: str, has_mark: bool
) -> None:
    header, form = FORMS[name]
    text = (header + lines(points, form)).replace("\n", line_end)
    (tmp_path / name).write_bytes((b"\xef\xbb\xbf" if has_mark else b"") + text.encode())
    cloud = io.read(tmp_path / name)
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.intensity, points.intensity)
    np.testing.assert_array_equal(cloud.rgb, points.rgb)


@pytest.mark.parametrize("separator", [";", "; ", " ", "\t"])
def test_that_decimal_commas_are_understood(tmp_path: Path, points: Any, separator: str) -> None:
    form = separator.join(["{0:.4f}", "{1:.4f}", "{2:.4f}", "{3}", "{4}", "{5}", "{6}"])
    (tmp_path / "de.csv").write_text(lines(points, form).replace(".", ","))
    cloud = io.read(tmp_path / "de.csv")
    assert points.hold(cloud)
    np.testing.assert_array_equal(cloud.rgb, points.rgb)


def test_that_intensities_of_pts_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "a.pts").write_text("3\n1 2 3 -2048\n1 2 4 0\n1 2 5 2047\n")
    np.testing.assert_array_equal(io.read(tmp_path / "a.pts").intensity, [-2048, 0, 2047])


def test_that_a_pts_file_may_hold_several_scans(tmp_path: Path) -> None:
    (tmp_path / "a.pts").write_text("2\n1 2 3\n1 2 4\n1\n1 2 5\n")
    assert len(io.read(tmp_path / "a.pts")) == 3


@pytest.mark.parametrize("text", ["4\n1 2 3\n1 2 4\n", "1\n1 2 3\n5\n1 2 4\n"])
def test_that_fewer_points_than_announced_are_read_with_a_word(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.pts").write_text(text)
    cloud = io.read(tmp_path / "a.pts")
    assert len(cloud) == 2
    assert "“a.pts” is truncated" in str(cloud.notes[0])


@pytest.mark.parametrize("column", ["nx", "normal"])
def test_that_values_that_are_no_colours_are_not_taken_for_them(
    tmp_path: Path, rng: np.random.Generator, column: str
) -> None:
    header = f"x y z {column} b c\n" if column == "normal" else ""
    rows = np.hstack([rng.uniform(0, 9, (50, 3)), rng.uniform(-1, 1, (50, 3))])
    np.savetxt(tmp_path / "a.txt", rows, header=header, comments="")
    assert io.read(tmp_path / "a.txt").rgb is None


@pytest.mark.parametrize("n_rows_before", [1, 3, 150_000])
@pytest.mark.parametrize(
    "bad", ["1 2", "1 2 3 4", "1 2 three", "1 2 3 4 5 6 7", "\x02", "1;2;3", "1 2 1_0"]
)
def test_that_the_error_names_the_line_that_is_no_point(
    tmp_path: Path, n_rows_before: int, bad: str
) -> None:
    text = "# remark\nx y z\n" + "1.5 2.5 3.5\n" * n_rows_before + bad + "\n1 2 3\n"
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(ReadError, match=rf"a\.txt”: line {n_rows_before + 3} is no point"):
        io.read(tmp_path / "a.txt")


def test_that_rows_that_all_become_longer_in_the_middle_are_an_error(tmp_path: Path) -> None:
    # Over the border of the blocks in which text is read.
    text = "1.5000 2.5000 3.5000\n" * 200_000 + "1.5000 2.5000 3.5000 4\n" * 200_000
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(ReadError, match="line 200001 is no point"):
        io.read(tmp_path / "a.txt")


def test_that_a_line_end_of_two_characters_may_stand_over_the_border_of_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = b"1 2 3\r\n" * 100 + b"1 2\r\n"
    (tmp_path / "a.txt").write_bytes(text)
    for size in range(20, 35):
        monkeypatch.setattr(table, "BLOCK_BYTES", size)
        with pytest.raises(ReadError, match="line 101 is no point"):
            io.read(tmp_path / "a.txt")


def test_that_remarks_and_empty_lines_between_points_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("1 2 3\n\n# remark\n1 2 4\n   \n// x\n1 2 5")
    assert io.read(tmp_path / "a.xyz").xyz[:, 2].tolist() == [3, 4, 5]


def test_that_points_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("1 2 3 1\nnan 2 4 2\n1 inf 5 3\n1 2 6 4\n1e300 2 6 5\n")
    cloud = io.read(tmp_path / "a.xyz")
    assert cloud.intensity.tolist() == [1, 4]


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        (b"\n\n\n", "no points"),
        (b"# only a remark\n", "no points"),
        (b"12\n", "no points"),
        (b"1 2\n3 4\n", "line 1"),
        (b"a b c\n1 2 3\n", "line 1"),
        (b"x y z\n", "no points"),
        (b"x y z i\n1 2 3\n", "header names 4 columns, line 2 has 3"),
        (b"nan nan nan\n", "no valid points"),
        ("1 2 3\n".encode("utf-16"), "UTF-16"),
        (b"1 2 3\n" + b"7" * 3_000_000, "characters long"),
    ],
)
def test_that_the_error_says_what_is_wrong(tmp_path: Path, text: bytes, cause: str) -> None:
    (tmp_path / "odd.txt").write_bytes(text)
    with pytest.raises(ReadError, match=re.escape(cause)) as caught:
        io.read(tmp_path / "odd.txt")
    assert "odd.txt" in str(caught.value)
