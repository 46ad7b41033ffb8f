"""A report folder reads back to an equal result, and a damaged one says that it is."""

import csv
import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pipecore
from pipecore import Table
from pipecore.errors import CancelledError, ReadError, WriteError
from pipecore.notes import Note
from pipecore.reasons import Reason
from pipecore.report import deformations_table, result_from_dict, result_to_dict
from pipecore.settings import Settings
from pipecore.types import NominalSize, Profiles, Result, Review, ReviewState
from pipecore.units import FileUnit
from tests.factories import make_scan, make_station_check

N_POINTS = 2000
NANOMETRE = 1e-9


@pytest.fixture(scope="module")
def edited() -> Result:
    """A result with all that only some results have, of a file in feet that notes are on."""
    result = make_scan(N_POINTS)[1]
    short_arc = Reason("{seen}° of arc seen, {needed}° are needed", seen="120", needed="200")
    gappy = replace(
        result.elements[1],
        gaps=((0.2, 0.35),),
        name="=Feed, “north”",
        not_measurable={"ovality": short_arc},
    )
    return replace(
        result,
        elements=(result.elements[0], gappy, *result.elements[2:]),
        edits=("pipes 3 and 4 merged",),
        run_names={2: "Return"},
        own_settings={4: Settings().replace({"stacks.width_mm": 12})},
        unit=FileUnit("us-ft", 1200 / 3937, "m", 1.0),
        notes=(Note("“{name}” has {n:,} points.", name="a.las", n=2000), Note("It is {old}.")),
        station_check=make_station_check(),
    )


@pytest.fixture(scope="module")
def saved(edited: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved") / "report"
    edited.save(folder, make_scan(N_POINTS)[0])
    return folder


def assert_equal(a: Any, b: Any, what: str = "result") -> None:
    """Field by field; arrays to the nanometre, nan equal to nan."""
    if isinstance(a, np.ndarray | float):
        np.testing.assert_allclose(b, a, rtol=0, atol=NANOMETRE, err_msg=what)
        assert np.asarray(a).dtype == np.asarray(b).dtype, what
    elif is_dataclass(a) and not isinstance(a, Settings):
        assert type(a) is type(b), what
        for f in fields(a):
            assert_equal(getattr(a, f.name), getattr(b, f.name), f"{what}.{f.name}")
    elif isinstance(a, tuple):
        assert len(a) == len(b), what
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_equal(x, y, f"{what}[{i}]")
    else:
        assert a == b, what
        assert type(a) is type(b) or isinstance(a, dict), what
    if isinstance(a, dict):
        for key in a:
            assert_equal(a[key], b[key], f"{what}[{key}]")
    if isinstance(a, Reason):
        assert (a.template, a.values) == (b.template, b.values), what


def test_that_a_saved_result_loads_as_it_was(edited: Result, saved: Path) -> None:
    assert_equal(edited, pipecore.load(saved))


def test_that_a_loaded_result_saves_to_the_same_tables(saved: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    pipecore.load(saved).save(again, make_scan(N_POINTS)[0])
    for name in ("elements.csv", "deformations.csv", "settings.toml"):
        assert (again / name).read_bytes() == (saved / name).read_bytes()


def test_that_a_report_without_its_points_loads_without_theirs(
    edited: Result, saved: Path, tmp_path: Path
) -> None:
    shutil.copy(saved / "result.json", tmp_path)
    loaded = pipecore.load(tmp_path)
    none = {"segment_id": np.empty(0, np.int32), "element_id": np.empty(0, np.int32)}
    assert_equal(replace(edited, deviation=np.empty(0, np.float32), **none), loaded)


def test_that_a_result_saves_without_its_cloud(edited: Result, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    edited.save(folder)
    assert sorted(path.name for path in folder.iterdir()) == [
        "candidates.csv",
        "deformations.csv",
        "elements.csv",
        "pairs.csv",
        "profiles.csv",
        "result.json",
        "settings.toml",
        "stations.csv",
    ]
    assert len(pipecore.load(folder).elements) == len(edited.elements)
    with pytest.raises(WriteError, match="not empty"):
        edited.save(folder)
    edited.save(folder, overwrite=True)


def test_that_a_cloud_of_another_result_is_refused(edited: Result, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the cloud has 500 points"):
        edited.save(tmp_path / "report", make_scan(500)[0])
    assert not (tmp_path / "report").exists()


def test_that_an_empty_result_loads(tmp_path: Path) -> None:
    result = pipecore.detect(np.empty((0, 3)))
    result.save(tmp_path / "report")
    assert_equal(result, pipecore.load(tmp_path / "report"))


def test_that_what_an_older_program_did_not_write_keeps_its_default(edited: Result) -> None:
    plain = result_to_dict(edited)
    for key in ("edits", "run_names", "own_settings", "templates", "notes", "length_unit"):
        del plain[key]
    del plain["elements"][0]["name"]
    plain["elements"][0]["colour"] = "of a newer one"
    del plain["profiles"]["curvature_variation"]
    loaded = result_from_dict(plain)
    assert (loaded.edits, loaded.run_names, loaded.own_settings) == ((), {}, {})
    assert loaded.elements[0].name == ""
    assert np.isnan(loaded.profiles.curvature_variation).all()
    assert loaded.notes == ()
    assert loaded.elements[1].not_measurable == edited.elements[1].not_measurable


# Projects of the app

PROJECT = Path(__file__).parents[2] / "data" / "ac01052" / "two-scans.pipegui"


def test_that_a_project_loads_by_the_name_of_a_scan() -> None:
    riser = pipecore.load(PROJECT, "riser.laz")
    pump_house = pipecore.load(PROJECT, "pump-house.laz")
    assert (len(riser.elements), len(pump_house.elements)) == (2, 5)
    assert pump_house.run_names == {1: "Line 7"}
    assert len(riser.element_id) == riser.n_cloud_points == 5141
    assert len(pump_house.profiles.of_element(1, 0)) == 47


@pytest.mark.parametrize("scan", [None, "third.laz"])
def test_that_a_project_without_one_such_scan_says_what_it_holds(scan: str | None) -> None:
    with pytest.raises(ReadError, match=f"results of {0 if scan else 2} scans.*name one"):
        pipecore.load(PROJECT, scan)


def test_that_what_is_no_project_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "work.pipegui"
    for content in (b"", b"PK", PROJECT.read_bytes()[:-30], PROJECT.read_bytes()[100:]):
        path.write_bytes(content)
        with pytest.raises(ReadError, match=r"“.*work\.pipegui” (is damaged|cannot be read)"):
            pipecore.load(path, "riser.laz")


def test_that_a_project_of_a_newer_program_is_named_as_such(tmp_path: Path) -> None:
    path = tmp_path / "newer.pipegui"
    with zipfile.ZipFile(path, "w") as archive:
        contents = {"format": "pipegui project", "format_version": 3, "program": "9.9"}
        archive.writestr("project.json", json.dumps(contents))
    with pytest.raises(ReadError, match=r"“newer\.pipegui” was saved by a newer PipeGUI \(9\.9\)"):
        pipecore.load(path)


# What is damaged


def set_to(*path: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(plain: dict[str, Any]) -> None:
        *way, last = path
        for step in way:
            plain = plain[step]
        plain[last] = to

    return change


@pytest.mark.parametrize(
    "change",
    [
        set_to("format", to="something else"),
        set_to("format_version", to=2),
        set_to("elements", 0, "kind", to="banana"),
        set_to("elements", 0, "axis", "kind", to="spiral"),
        set_to("elements", 0, "axis", "start", to=[0.0, None, 0.0]),
        set_to("elements", 0, "radius", to=-1.0),
        set_to("elements", 1, "element_id", to=1),
        set_to("elements", to=None),
        set_to("deformations", 0, "element_id", to=77),
        set_to("profiles", "radius", to=[1.0]),
        set_to("profiles", "element_id", to="all"),
        set_to("profiles", "stack_id", 0, to=99),
        set_to("settings", "stacks", "width_mm", to="wide"),
        set_to("n_cloud_points", to=-5),
        set_to("n_cloud_points", to=N_POINTS + 1),
        set_to("origin", to=[0.0, 0.0]),
        lambda plain: plain.pop("stacks"),
        lambda plain: plain.pop("profiles"),
    ],
)
def test_that_a_damaged_report_is_refused_in_words(
    saved: Path, tmp_path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    plain = json.loads((saved / "result.json").read_text(encoding="utf-8"))
    change(plain)
    (tmp_path / "result.json").write_text(json.dumps(plain), encoding="utf-8")
    shutil.copy(saved / "segments.laz", tmp_path)
    with pytest.raises(ReadError, match=str(tmp_path)):
        pipecore.load(tmp_path)


@pytest.mark.parametrize("contents", [b"", b"[1, 2", b"null", b"\xff\xfe", b"[]", b"3"])
def test_that_a_file_that_is_no_result_is_refused(tmp_path: Path, contents: bytes) -> None:
    (tmp_path / "result.json").write_bytes(contents)
    with pytest.raises(ReadError, match="is damaged"):
        pipecore.load(tmp_path)


@pytest.mark.parametrize("keep", [0, 100, 0.5, 0.95])
def test_that_cut_off_points_are_refused(saved: Path, tmp_path: Path, keep: float) -> None:
    shutil.copy(saved / "result.json", tmp_path)
    whole = (saved / "segments.laz").read_bytes()
    n = int(keep if keep >= 1 else keep * len(whole))
    (tmp_path / "segments.laz").write_bytes(whole[:n])
    with pytest.raises(ReadError, match=str(tmp_path)):
        pipecore.load(tmp_path)


def test_that_a_folder_without_a_report_is_named(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match=r"nowhere.*No such file"):
        pipecore.load(tmp_path / "nowhere")


def test_that_loading_can_be_cancelled(saved: Path) -> None:
    class Stop:
        def update(self, stage: str, fraction: float) -> None:
            raise CancelledError

    with pytest.raises(CancelledError):
        pipecore.load(saved, progress=Stop())


# Tables


@pytest.mark.parametrize("name", ["elements", "profiles", "deformations"])
def test_that_tables_hold_what_the_files_hold(edited: Result, saved: Path, name: str) -> None:
    table: Table = getattr(edited, f"{name}_table")()
    with (saved / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
        assert list(table) == reader.fieldnames
    assert table.n_rows == len(rows) > 0
    for column, values in table.items():
        cells = [row[column] for row in rows]
        assert values.shape == (len(rows),)
        if column in table.decimals:
            assert values.dtype == np.float64
            numbers = np.array([float(cell) if cell else np.nan for cell in cells])
            np.testing.assert_array_equal(values, numbers, err_msg=column)
        elif values.dtype == np.int32:
            np.testing.assert_array_equal(values, [int(cell or 0) for cell in cells])
        else:
            # A text that a spreadsheet would take for a formula has a quote before it.
            assert [text.removeprefix("'") for text in cells] == values.tolist()


def test_that_reviews_stand_in_the_table_too(edited: Result) -> None:
    table = deformations_table(edited, {2: Review(ReviewState.REJECTED, "see\nphoto")})
    assert table["review"].tolist() == ["open", "rejected", "open", "open"]
    assert table["comment"][1] == "see photo"


def test_that_a_table_of_nothing_has_its_columns() -> None:
    nothing = pipecore.detect(np.empty((0, 3)))
    full = make_scan(N_POINTS)[1]
    for name in ("elements_table", "profiles_table", "deformations_table"):
        table, like = getattr(nothing, name)(), getattr(full, name)()
        assert list(table) == list(like)
        assert [v.dtype for v in table.values()] == [v.dtype for v in like.values()]
        assert table.n_rows == 0


def test_that_a_table_becomes_a_data_frame(edited: Result) -> None:
    pandas = pytest.importorskip("pandas", reason="a data frame is not tried without pandas")
    table = edited.elements_table()
    frame = table.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == list(table)
    assert frame["radius_mm"].dtype == np.float64
    assert frame["name"][1] == "=Feed, “north”"


def test_that_without_pandas_a_data_frame_is_answered_in_words() -> None:
    code = """
import sys
sys.modules["pandas"] = None
import numpy, pipecore
try:
    pipecore.Table([("n", numpy.arange(3), None)]).to_pandas()
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install pandas" in done.stdout


def test_that_a_size_s_name_may_hold_commas_and_quotes(tmp_path: Path) -> None:
    result = make_scan(N_POINTS)[1]
    size = NominalSize('DN 150, "6 inch"', 0.1683)
    odd = replace(result, elements=(replace(result.elements[0], nominal=size),), deformations=())
    odd = replace(odd, profiles=Profiles.empty())
    pipecore.report.write_elements_csv(tmp_path / "elements.csv", odd)
    with (tmp_path / "elements.csv").open(encoding="utf-8", newline="") as file:
        assert next(csv.DictReader(file))["nominal_size"] == size.name
