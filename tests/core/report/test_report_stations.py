"""Stations and the scan's own values in what a report holds."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.report import elements_table, load, write_report, write_segments
from pipecore.types import PointCloud, Result
from tests.factories import make_scan


def scan_file(path: Path) -> tuple[Any, Result]:
    """A scan of two stations in a LAS file with values of its own, and its result."""
    cloud, result = make_scan(2000)
    rng = np.random.default_rng(3)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 2e-4), np.round(cloud.origin)
    header.add_extra_dims([laspy.ExtraBytesParams("width", "u2", "", None, None, [0])])
    las = laspy.LasData(header)
    las.xyz = cloud.world(cloud.xyz)
    las.gps_time = rng.uniform(0, 6e5, len(cloud))
    las.point_source_id = np.where(np.arange(len(cloud)) % 2 == 0, 40, 7)
    las.user_data, las["width"] = rng.integers(0, 256, (2, len(cloud)))
    las.write(path)
    return las, result


def read(path: Path, result: Result) -> tuple[PointCloud, Result]:
    cloud = io.read(path)
    return cloud, replace(result, origin=cloud.origin)


def test_that_the_segmented_cloud_has_all_that_the_scan_had(tmp_path: Path) -> None:
    was, result = scan_file(tmp_path / "scan.laz")
    cloud, result = read(tmp_path / "scan.laz", result)
    assert write_report(tmp_path / "report", cloud, result) == ()
    now = laspy.read(tmp_path / "report" / "segments.laz")
    for name in was.points.array.dtype.names:
        np.testing.assert_array_equal(now.points.array[name], was.points.array[name])
    np.testing.assert_array_equal(now.header.scales, was.header.scales)
    np.testing.assert_array_equal(now.element_id, result.element_id)


def test_that_the_segmented_cloud_keeps_stations_if_the_scan_is_gone(tmp_path: Path) -> None:
    _, result = scan_file(tmp_path / "scan.las")
    cloud, result = read(tmp_path / "scan.las", result)
    (tmp_path / "scan.las").unlink()
    (note,) = write_segments(tmp_path / "segments.laz", cloud, result)
    assert "“segments.laz” has no other values of the scan’s own file: There is no file" in note
    now = laspy.read(tmp_path / "segments.laz")
    np.testing.assert_array_equal(now.point_source_id, cloud.station)
    assert now.header.scales[0] == 2e-4


def test_that_several_files_have_their_stations_in_the_segmented_cloud(tmp_path: Path) -> None:
    cloud, result = make_scan(2000)
    halves = [cloud.take(slice(0, 1200)), cloud.take(slice(1200, 2000))]
    paths = [tmp_path / f"{i}.ply" for i in range(2)]
    for half, path in zip(halves, paths, strict=True):
        io.write(replace(half, station=None, stations=np.empty((0, 3))), path)
    both = io.read(paths)
    write_segments(tmp_path / "segments.laz", both, replace(result, origin=both.origin))
    again = io.read(tmp_path / "segments.laz")
    assert np.bincount(again.station).tolist() == [0, 1200, 800]


@pytest.mark.parametrize("has_stations", [True, False])
def test_that_the_table_of_elements_says_which_stations_saw_each(has_stations: bool) -> None:
    cloud, result = make_scan(2000)
    station = np.ones(2000, np.uint16)
    ids = [e.element_id for e in result.elements]
    first, second = (np.flatnonzero(result.element_id == i) for i in ids[:2])
    station[first[: len(first) // 2]] = 3
    station[second] = 2
    table = elements_table(result, replace(cloud, station=station if has_stations else None))
    expected = ["1+3", "2", *["1"] * (len(ids) - 2)] if has_stations else [""] * len(ids)
    assert [
        s for s, i in zip(table["stations"], ids, strict=True) if (result.element_id == i).any()
    ] == [s for s, i in zip(expected, ids, strict=True) if (result.element_id == i).any()]


def test_that_the_stations_of_a_report_do_not_stop_it_from_being_loaded(tmp_path: Path) -> None:
    cloud, result = make_scan(2000)
    station = np.ones(2000, np.uint16)
    write_report(tmp_path / "report", replace(cloud, station=station), result)
    rows = (tmp_path / "report" / "elements.csv").read_text(encoding="utf-8").splitlines()
    assert "stations" in rows[0].split(",")
    assert len(load(tmp_path / "report").elements) == len(rows) - 1
