"""What a newcomer meets first: names, arrays in, short texts out, mistakes answered in words."""

import importlib
import math
import pkgutil
import subprocess
import sys
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

import pipecore
from pipecore import PointCloud
from pipecore.geometry import LineAxis
from tests.core.shapes import tube
from tests.factories import make_scan

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def run_python(code: str) -> str:
    """What a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_that_all_that_dir_shows_is_there() -> None:
    assert set(pipecore.__all__) <= set(dir(pipecore))
    for name in dir(pipecore):
        assert getattr(pipecore, name) is not None
    with pytest.raises(AttributeError, match="'pipecore' has no attribute 'detekt'"):
        pipecore.detekt  # noqa: B018


def test_that_every_module_has_what_it_says_it_exports(monkeypatch) -> None:
    # CloudCompare's modules are in its process only.
    monkeypatch.setitem(sys.modules, "pycc", MagicMock(PythonPluginInterface=object))
    monkeypatch.setitem(sys.modules, "cccorelib", MagicMock())
    modules = pkgutil.walk_packages(pipecore.__path__, "pipecore.")
    for name in (m.name for m in modules if m.name != "pipecore.__main__"):
        module = importlib.import_module(name)
        assert [n for n in getattr(module, "__all__", ()) if not hasattr(module, n)] == [], name


def test_that_subpackages_need_no_import_of_their_own() -> None:
    code = "import pipecore; print(pipecore.io.read is pipecore.read, pipecore.report.__name__)"
    assert run_python(code).split() == ["True", "pipecore.report"]


def test_that_to_import_the_library_imports_neither_numba_nor_scipy() -> None:
    code = (
        "import pipecore, sys; print([m for m in ('numba', 'scipy', 'laspy') if m in sys.modules])"
    )
    assert run_python(code).strip() == "[]"


# From arrays


def test_that_a_cloud_of_arrays_keeps_a_tenth_of_a_millimetre_anywhere(
    rng: np.random.Generator,
) -> None:
    for extent in (10.0, 5000.0):
        world = np.array([4.3e5, 6.2e6, 112.0]) + rng.uniform(-extent, extent, (1000, 3))
        cloud = PointCloud.from_points(world)
        assert np.abs(cloud.world(cloud.xyz) - world).max() < 1e-4
        assert np.all(cloud.origin % 100.0 == 0.0)
        assert cloud.xyz.flags.c_contiguous


def test_that_lists_and_whole_numbers_are_points_too() -> None:
    cloud = PointCloud.from_points([[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.world(cloud.xyz), [[1, 2, 3], [4, 5, 6]])
    assert len(PointCloud.from_points([])) == 0


def test_that_values_of_points_get_the_types_of_a_cloud() -> None:
    cloud = PointCloud.from_points(
        CORNERS,
        intensity=[1, 2, 3],
        rgb=[[0, 128, 255]] * 3,
        classification=[2, 6, 1],
        stations=[0.0, 0.0, 1.5],
    )
    assert cloud.intensity is not None
    assert cloud.rgb is not None
    assert cloud.classification is not None
    kinds = (cloud.intensity.dtype, cloud.rgb.dtype, cloud.classification.dtype)
    assert kinds == (np.float32, np.uint8, np.uint8)
    np.testing.assert_allclose(cloud.world(cloud.stations), [[0.0, 0.0, 1.5]])


@pytest.mark.parametrize(("station", "ids"), [(2, [2, 2, 2]), ([1, 3, 1], [1, 3, 1])])
def test_that_points_have_one_station_or_each_its_own(station: Any, ids: list[int]) -> None:
    cloud = PointCloud.from_points(CORNERS, station=station)
    assert cloud.station is not None
    assert cloud.station.dtype == np.uint16
    assert cloud.station.tolist() == ids
    assert len(cloud.station_names) == max(ids)
    known = PointCloud.from_points(CORNERS, station=station, stations=np.ones((4, 3)))
    assert len(known.station_names) == len(known.stations) == 4


def test_that_the_caller_s_array_may_change_afterwards() -> None:
    points = np.array(CORNERS)
    cloud = PointCloud.from_points(points)
    points += 1.0
    np.testing.assert_array_equal(cloud.world(cloud.xyz), CORNERS)


@pytest.mark.parametrize(
    ("points", "error", "words"),
    [
        ("scan.laz", TypeError, "pipecore.read reads files"),
        ([[1, 2, 3], [4, 5]], ValueError, "cannot be made an array"),
        (np.zeros((5, 2)), ValueError, r"shape \(n, 3\), not \(5, 2\)"),
        (np.zeros((3, 5)), ValueError, r"shape \(n, 3\), not \(3, 5\)"),
        ([1.0, 2.0, 3.0], ValueError, r"shape \(n, 3\), not \(3,\)"),
        (7.0, ValueError, r"shape \(n, 3\), not \(\)"),
        (np.zeros((5, 3), np.float16), TypeError, "float16, which keeps three digits"),
        ([[0, 0, math.nan], [0, 0, 0]], ValueError, "1 of 2 points are nan, infinite"),
        ([[0, math.inf, 0]], ValueError, "nan, infinite or farther"),
        ([[0, 1e12, 0]], ValueError, r"farther than 1e\+09 m"),
        (np.zeros((2, 3), bool), TypeError, "real numbers, not bool"),
        (np.zeros((2, 3), complex), TypeError, "real numbers, not complex128"),
        ([["1", "2", "3"]], TypeError, "real numbers, not <U1"),
        (None, TypeError, "real numbers, not object"),
    ],
)
def test_that_what_are_no_points_is_answered_with_what_is_wrong(
    points: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        PointCloud.from_points(points)
    with pytest.raises(error, match=words):
        pipecore.detect(points)


@pytest.mark.parametrize(
    ("values", "error", "words"),
    [
        ({"intensity": [1.0, 2.0]}, ValueError, r"the intensity must have shape \(3,\)"),
        ({"rgb": np.zeros((3, 4), int)}, ValueError, r"the colours must have shape \(3, 3\)"),
        ({"rgb": np.zeros((3, 3))}, TypeError, "the colours must be whole numbers"),
        ({"rgb": [[0, 0, 256]] * 3}, ValueError, "the colours must be from 0 to 255"),
        ({"classification": [-1, 2, 2]}, ValueError, "the classes must be from 0 to 255"),
        ({"stations": [1.0, 2.0]}, ValueError, r"shape \(3,\) or \(k, 3\)"),
        ({"stations": [[0.0, 0.0, math.inf]]}, ValueError, "infinite"),
        ({"intensity": ["a", "b", "c"]}, TypeError, "the intensity must be real numbers"),
        ({"station": [1, 2]}, ValueError, r"the stations' numbers must have shape \(3,\)"),
        ({"station": 1.5}, TypeError, "the stations' numbers must be whole numbers"),
        ({"station": [0, 1, 2]}, ValueError, "numbered from 1 on"),
        ({"station": 70_000}, ValueError, "from 0 to 65535"),
        ({"station": [1, 3, 2], "stations": np.zeros((2, 3))}, ValueError, "but only 2 scanner"),
    ],
)
def test_that_values_that_do_not_fit_the_points_are_named(
    values: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        PointCloud.from_points(CORNERS, **values)


def test_that_settings_are_settings() -> None:
    with pytest.raises(TypeError, match=r"must be pipecore\.Settings, not dict"):
        pipecore.detect(CORNERS, {"stacks.width_mm": 20})  # type: ignore[arg-type]


def test_that_an_array_gives_what_its_cloud_gives(rng: np.random.Generator) -> None:
    axis = LineAxis.between([0.0, 0.0, 1.0], [1.0, 0.2, 1.0])
    points, _ = tube(rng, axis, 0.1, spacing=0.008, noise=0.001)
    from_array = pipecore.detect(points)
    from_cloud = pipecore.detect(PointCloud.from_points(points))
    assert len(from_array.elements) == 1
    assert from_array.elements[0].radius == from_cloud.elements[0].radius
    assert from_array.elements[0].radius == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.zeros((1, 3)),
        np.zeros((500, 3)),
        np.outer(np.linspace(0.0, 5.0, 400), [1.0, 2.0, 3.0]),
        np.array(CORNERS),
        1e6 * np.array(CORNERS),
    ],
    ids=["none", "one", "one place", "a line", "three", "far apart"],
)
def test_that_points_without_pipes_give_a_result_without_elements(points: Any) -> None:
    result = pipecore.detect(points)
    assert result.elements == result.deformations == ()
    assert len(result.element_id) == result.n_cloud_points == len(points)
    assert result.elements_table().n_rows == 0


# Short texts


def test_that_a_prompt_shows_each_thing_on_one_short_line() -> None:
    cloud, result = make_scan(2000)
    shown = {
        "PointCloud": cloud,
        "Result": result,
        "Element Pipe 2": result.elements[1],
        "Deformation 1": result.deformations[0],
        "Profiles": result.profiles,
        "Settings": result.settings,
        "Table": result.elements_table(),
    }
    for title, thing in shown.items():
        text = repr(thing)
        assert text.startswith(f"<{title}: ")
        assert "\n" not in text
        assert len(text) < 500


def test_that_the_short_texts_say_what_counts() -> None:
    cloud, result = make_scan(2000)
    assert "points 2,000" in repr(cloud)
    assert "elements 9 (5 pipe," in repr(result)
    assert "deformations 4 (3 review, 1 reject)" in repr(result)
    assert "size DN 150 / NPS 6, radius 84.15 ±" in repr(result.elements[1])
    assert "kind dent, element 2, depth 12.1 ± 0.3 mm" in repr(result.deformations[0])
    assert "height 8.0 ± 0.3 mm" in repr(result.deformations[2])  # a bulge has a height
    assert "ovality not measurable" in repr(result.elements[8])  # seen from one side


def test_that_a_notebook_shows_tables_with_their_texts_escaped() -> None:
    result = make_scan(2000)[1]
    page = result._repr_html_()
    assert page.count("<table>") == page.count("</table>") == 3
    assert "<th>radius_mm</th>" in page
    assert "<td>84.15</td>" in page
    named = pipecore.Table([("name", np.array(["<b>A & B</b>"], object), None)])
    assert "&lt;b&gt;A &amp; B&lt;/b&gt;" in named._repr_html_()
    assert list(named.rows()) == [{"name": "<b>A & B</b>"}]
    many = pipecore.Table([("n", np.arange(1000), None)])
    assert "10 of 1,000 rows" in many._repr_html_()
    assert many._repr_html_().count("<tr>") == 11
