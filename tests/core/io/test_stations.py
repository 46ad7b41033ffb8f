"""Each point knows its station, by what the files say of it."""

from pathlib import Path
from typing import Any
from uuid import UUID

import laspy
import numpy as np
import pytest

from pipecore import io
from pipecore.settings import StationSource
from tests.core.io.cases import START, las_with, pipe, ptx, text
from tests.core.io.writers import cartesian, write_e57, write_pcd


def tile(path: Path, source_id: int, guid: str = "", n: int = 300) -> Path:
    las_with(path, pipe(n), point_source_id=np.full(n, source_id, np.uint16))
    las = laspy.read(path)
    las.header.uuid = UUID(guid or "0" * 32)
    las.write(path)
    return path


def test_that_one_file_that_tells_nothing_has_no_stations(tmp_path: Path) -> None:
    path = tile(tmp_path / "a.las", 4)
    cloud = io.read(path)
    assert cloud.station is None
    assert cloud.station_names == ()
    assert io.info(path).stations == ()


def test_that_point_source_ids_that_vary_are_stations(tmp_path: Path) -> None:
    ids = np.repeat([9, 2], [120, 80]).astype(np.uint16)
    path = las_with(tmp_path / "a.laz", pipe(200), point_source_id=ids)
    cloud, info = io.read(path), io.info(path)
    assert cloud.station.tolist() == [2] * 120 + [1] * 80
    assert cloud.station_names == ("a.laz: 2", "a.laz: 9")
    assert np.isnan(cloud.stations).all()
    assert [(s.name, s.n_points) for s in info.stations] == [("a.laz: 2", 80), ("a.laz: 9", 120)]


def test_that_each_of_several_files_is_a_station_unless_they_are_tiles(tmp_path: Path) -> None:
    guid = "12345678-1234-5678-1234-567812345678"
    plain = [tile(tmp_path / f"{i}.las", 1) for i in range(2)]
    tiles = [tile(tmp_path / f"t{i}.las", 1, guid) for i in range(2)]
    other = tile(tmp_path / "o.las", 2, guid)
    assert np.unique(io.read(plain).station).tolist() == [1, 2]
    assert io.read(plain).station_names == ("0.las", "1.las")
    assert np.unique(io.read(tiles).station).tolist() == [1]
    assert np.unique(io.read([*tiles, other]).station).tolist() == [1, 2]
    assert len(io.read(tiles, stations=StationSource.FILES).station_names) == 2
    assert np.unique(io.read(plain, stations=StationSource.ONE).station).tolist() == [1]


def test_that_scans_of_e57_and_ptx_are_stations_with_their_positions(tmp_path: Path) -> None:
    scans: list[dict[str, Any]] = [
        {"columns": cartesian(pipe(50)), "translation": (1, 2, 3)},
        {"columns": cartesian(pipe(70))},
    ]
    e57 = write_e57(tmp_path / "a.e57", scans)
    cloud = io.read(e57)
    assert np.bincount(cloud.station).tolist() == [0, 50, 70]
    np.testing.assert_allclose(cloud.world(cloud.stations[0]), [1, 2, 3])
    assert np.isnan(cloud.stations[1]).all()
    both = io.read([e57, ptx(tmp_path / "b.ptx", pipe(30))])
    assert np.bincount(both.station).tolist() == [0, 50, 70, 30]
    assert both.station_names == ("a.e57: scan 1", "a.e57: scan 2", "b.ptx: scan 1")
    np.testing.assert_allclose(both.world(both.stations[2]), START)
    assert [s.position for s in io.info(e57).stations] == [(1.0, 2.0, 3.0), None]


def test_that_a_column_named_by_the_user_or_by_its_name_is_the_station(tmp_path: Path) -> None:
    rows = [(*xyz, 7 if i < 40 else 3) for i, xyz in enumerate(pipe(100))]
    bare = text(tmp_path / "bare.xyz", rows, "{:.4f} {:.4f} {:.4f} {}")
    named = text(tmp_path / "named.xyz", rows, "{:.4f} {:.4f} {:.4f} {}", "x y z scan_id\n")
    for cloud in (io.read(bare, columns="x,y,z,station"), io.read(named)):
        assert cloud.station.tolist() == [2] * 40 + [1] * 60
    assert io.read(bare).station is None


@pytest.mark.parametrize("station", ["0 0 0", "5 6 7"])
def test_that_a_viewpoint_of_pcd_is_a_station_where_it_is_known(
    tmp_path: Path, points: Any, station: str
) -> None:
    cloud = io.read(write_pcd(tmp_path / "a.pcd", points, "binary", station=station))
    assert (cloud.station is None) == (station == "0 0 0")
    assert len(cloud.stations) == (station != "0 0 0")
