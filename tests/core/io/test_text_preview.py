"""What is said of a text file's columns, and what comes of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore import io
from pipecore.errors import ReadError
from pipecore.io import DecimalSign, Separator, TextFormat, guessed_columns, preview_text
from tests.core.io.cases import pipe

ROWS = "{0:.4f} {1:.4f} {2:.4f} 200 100 50 255\n"


def written(tmp_path: Path, form: str = ROWS, header: str = "", name: str = "a.txt") -> Path:
    path = tmp_path / name
    path.write_text(header + "".join(form.format(*row) for row in pipe(300)))
    return path


@pytest.mark.parametrize(
    "text",
    ["", "x,y,z", "x,-,y,z,intensity|separator=tab", "|decimal=comma", "x,y,z|skip=12"],
)
def test_that_a_format_is_written_as_it_is_read(text: str) -> None:
    assert str(TextFormat.parse(text)) == text


@pytest.mark.parametrize("text", ["x,y", "x,y,z|skip=-1", "x,y,z|separator=dot", "x,y,z|what"])
def test_that_what_is_no_format_is_refused(text: str) -> None:
    with pytest.raises(ReadError):
        TextFormat.parse(text)


@pytest.mark.parametrize(
    ("form", "columns", "truth"),
    [
        ("{0:.4f}\t{1:.4f}\t{2:.4f}\n", "x,y,z|separator=tab", pipe(300)),
        ("{0:.0f},5 {1:.0f},5 {2:.0f},5\n", "x,y,z|decimal=comma", np.round(pipe(300)) + 0.5),
        ("{0:.0f},{1:.0f},{2:.0f}\n", "x,y,z|decimal=point", np.round(pipe(300))),
        ("{0:.0f},{1:.0f},{2:.0f}\n", "x,y,z|separator=comma", np.round(pipe(300))),
        ("{0:.4f};{1:.4f};{2:.4f};\n", "x,y,z|separator=semicolon", pipe(300)),
        ("{0:.4f}   {1:.4f}\t{2:.4f}\n", "x,y,z|separator=blank", pipe(300)),
    ],
)
def test_that_separator_and_decimal_sign_are_as_said(
    tmp_path: Path, form: str, columns: str, truth: Any
) -> None:
    cloud = io.read(written(tmp_path, form), columns=columns)
    assert np.abs(cloud.world(cloud.xyz.astype(float)) - truth).max() < 1e-4


def test_that_lines_are_skipped_before_anything_is_made_of_them(tmp_path: Path) -> None:
    path = written(tmp_path, header="1 2 3 4 5 6 7\n8 9 10 11 12 13 14\n")
    assert len(preview_text(path, TextFormat()).lines) == 50
    assert preview_text(path, TextFormat()).lines[0].is_point
    assert len(io.read(path, columns="x,y,z|skip=2")) == 300


def test_that_a_guess_is_told_only_where_nothing_names_the_columns(tmp_path: Path) -> None:
    assert guessed_columns(written(tmp_path)) == "x,y,z,red,green,blue,-"
    assert guessed_columns(written(tmp_path, header="x y z r g b a\n")) == ""
    assert guessed_columns(written(tmp_path, "{0:.4f} {1:.4f} {2:.4f}\n")) == ""
    assert guessed_columns(tmp_path / "missing.txt") == ""


def test_that_a_preview_shows_lines_roles_and_the_points_that_come_of_them(tmp_path: Path) -> None:
    path = written(tmp_path, header="# a remark\n")
    preview = preview_text(path, TextFormat())
    assert preview.columns == ("x", "y", "z", "red", "green", "blue", "-")
    assert (preview.separator, preview.decimal) == (Separator.BLANK, DecimalSign.POINT)
    assert [line.is_point for line in preview.lines[:2]] == [False, True]
    assert preview.lines[1].values[3:] == ("200", "100", "50", "255")
    assert preview.points is not None
    assert np.abs(preview.points.xyz - pipe(300)).max() < 1e-4
    assert (preview.points.rgb == (200, 100, 50)).all()


def test_that_a_preview_reads_no_more_than_it_shows(tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    np.savetxt(path, np.random.default_rng(0).normal(size=(40_000, 3)))
    preview = preview_text(path, TextFormat())
    assert preview.points is not None
    assert len(preview.points) == 2000
    assert len(preview.lines) == 50


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (("x", "y", "-", "-", "-", "-", "-"), "holds z"),
        (("-", "-", "-", "-", "-", "-", "-"), "holds x, y, z"),
        (("x", "y", "z", "x", "-", "-", "-"), "Only one column can hold x"),
        (("x", "y", "z", "red", "-", "-", "-"), "red, green and blue"),
    ],
)
def test_that_a_wrong_choice_is_answered_in_one_sentence(
    tmp_path: Path, columns: tuple[str, ...], said: str
) -> None:
    preview = preview_text(written(tmp_path), TextFormat(columns))
    assert preview.points is None
    assert said in str(preview.error)
    assert preview.columns == columns


def test_that_a_separator_that_leaves_one_column_is_told(tmp_path: Path) -> None:
    preview = preview_text(written(tmp_path), TextFormat(separator=Separator.SEMICOLON))
    assert "another separator" in str(preview.error)


def test_that_commas_in_quotes_stay_in_their_column(tmp_path: Path) -> None:
    path = written(tmp_path, '"{0:.0f},5","{1:.0f},5","{2:.0f},5"\n')
    preview = preview_text(path, TextFormat())
    assert preview.lines[0].values[0].endswith(",5")
    assert len(preview.columns) == 3
    assert preview.decimal is DecimalSign.COMMA
