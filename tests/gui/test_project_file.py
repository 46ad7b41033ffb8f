"""Project files: round trips, references to clouds, damage. Without Qt."""

import dataclasses
import json
import math
import os
import zipfile
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pipecore
from pipecore.errors import CancelledError, WriteError
from pipecore.io import read, write_laz
from pipecore.json_codec import from_plain, to_plain
from pipecore.settings import InputSettings, LengthUnit, Settings
from pipecore.types import Profiles, Result, Review, ReviewState
from pipegui.model.document import (
    ClipBox,
    ColourBy,
    Document,
    ProfileKey,
    Scan,
    Selection,
    ViewOptions,
)
from pipegui.project import project_file
from pipegui.project.cloud_reference import CloudState
from pipegui.project.project_file import ProjectError, read_project, work_of, write_project
from tests.factories import make_scan

N = 3000


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A scan with its result whose cloud is a file."""
    cloud, result = make_scan(N)
    path = tmp_path_factory.mktemp("clouds") / "plant.laz"
    write_laz(path, cloud)
    read_back = read(path)
    return Scan(
        "plant.laz",
        read_back,
        replace(
            result,
            source=path,
            origin=read_back.origin,
            run_names={1: "Feed line"},
            own_settings={2: Settings().replace({"deformation.min_depth_mm": 7.5})},
        ),
        {1: Review(ReviewState.REJECTED, "seen “on site”\nby A.")},
    )


@pytest.fixture
def document(stored):
    return Document(
        (replace(stored, name="other"), stored),
        1,
        Settings().replace({"elements.min_radius_mm": 20.0, "stacks.directions": "0,0,1,30"}),
        Selection(1, 2, 1, ProfileKey(0, 3), frozenset({4})),
        ViewOptions(ColourBy.HEIGHT, 4.5, frozenset({7}), clip_box=ClipBox((0, 0, 0), (1, 2, 3.5))),
    )


def same(a, b) -> bool:
    """Equal by value through dataclasses, arrays and nan."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a)
        )
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    both_nan = isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    return both_nan or a == b


def reopened(saved) -> Document:
    scans = [
        s.with_cloud(read(path), s.cloud.how_read(saved.settings))
        for s, (path, _) in zip(saved.scans, saved.located(), strict=True)
    ]
    return saved.document(tuple(scans))


def test_that_what_is_saved_comes_back_to_the_last_bit(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document, {"position": [1.0, 2.0, 3.0]})
    saved = read_project(path)
    assert [state for _, state in saved.located()] == [CloudState.FOUND] * 2
    assert saved.camera == {"position": [1.0, 2.0, 3.0]}
    again = reopened(saved)
    assert same(again, document)


def test_that_the_library_loads_a_scan_of_a_project_as_the_window_has_it(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    loaded = pipecore.load(path, "plant.laz")
    kept = document.scans[1].result
    assert loaded.source == Path(kept.source.name)
    assert same(replace(loaded, source=kept.source), kept)


def test_that_a_project_of_nothing_comes_back(tmp_path):
    path = tmp_path / "empty.pipegui"
    write_project(path, Document())
    assert same(reopened(read_project(path)), Document())


def test_that_looking_is_no_work_and_reviewing_is(document):
    assert work_of(document) == work_of(replace(document, selection=Selection(), active=0))
    scans = (replace(document.scans[0], reviews={}), document.scans[1])
    assert work_of(document) != work_of(replace(document, scans=scans))


def test_that_nothing_in_the_file_is_pickled_and_json_is_strict(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        contents = json.loads(archive.read("project.json"), parse_constant=pytest.fail)
        assert contents["format_version"] == 2
        for name in archive.namelist():
            if name.endswith(".npy"):
                with archive.open(name) as file:
                    np.lib.format.read_array(file, allow_pickle=False)


finite = st.floats(allow_nan=True, allow_infinity=True, width=64)
plain_views = st.builds(
    ViewOptions,
    st.sampled_from(ColourBy),
    st.floats(0.1, 1000),
    st.frozensets(st.integers(1, 99)),
    st.booleans(),
    clip_box=st.none()
    | st.builds(ClipBox, st.tuples(*[finite] * 3), st.tuples(*[finite] * 3), st.booleans()),
    height_limits=st.none() | st.tuples(finite, finite),
    intensity_limits=st.none() | st.tuples(finite, finite),
)


@given(plain_views)
def test_that_any_view_survives_json(view):
    again = from_plain(ViewOptions, json.loads(json.dumps(to_plain(view), allow_nan=False)))
    assert same(again, view)


@given(
    st.dictionaries(st.integers(1, 99), st.builds(Review, st.sampled_from(ReviewState), st.text()))
)
def test_that_any_reviews_survive_json(reviews):
    from collections.abc import Mapping

    plain = json.loads(json.dumps(to_plain(reviews)))
    assert from_plain(Mapping[int, Review], plain) == reviews


# Clouds


def test_that_a_project_moved_with_its_cloud_finds_it(document, stored, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    cloud = home / "plant.laz"
    cloud.write_bytes(stored.cloud.source.read_bytes())
    scan = replace(stored, cloud=replace(stored.cloud, source=cloud))
    write_project(home / "work.pipegui", Document((scan,)))
    away = home.rename(tmp_path / "away")
    [(found, state)] = read_project(away / "work.pipegui").located()
    assert (found, state) == (away / "plant.laz", CloudState.FOUND)


def test_that_a_project_moved_alone_finds_its_cloud_where_it_was(stored, tmp_path):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    path = tmp_path / "work.pipegui"
    write_project(path, Document((stored,)))
    moved = path.rename(tmp_path / "deep" / "er" / "work.pipegui")
    [(found, state)] = read_project(moved).located()
    assert found.samefile(stored.cloud.source)
    assert state is CloudState.FOUND


def test_that_a_cloud_that_is_gone_or_changed_is_told(stored, tmp_path):
    cloud = tmp_path / "plant.laz"
    cloud.write_bytes(stored.cloud.source.read_bytes())
    scan = replace(stored, cloud=replace(stored.cloud, source=cloud))
    path = tmp_path / "work.pipegui"
    write_project(path, Document((scan,)))
    os.utime(cloud, (1, 1))
    [(_, state)] = read_project(path).located()
    assert state is CloudState.FOUND, "the same, only touched"
    changed = bytearray(cloud.read_bytes())
    changed[len(changed) // 2] ^= 1
    cloud.write_bytes(changed)
    assert read_project(path).located() == [(cloud, CloudState.CHANGED)]
    cloud.unlink()
    assert read_project(path).located() == [(cloud, CloudState.MISSING)]


def test_that_another_cloud_is_not_taken_for_the_scan(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    saved = read_project(path).scans[0]
    with pytest.raises(ProjectError, match="another scan"):
        saved.with_cloud(make_scan(N + 1)[0], InputSettings())
    cloud = replace(make_scan(N)[0], origin=np.array([1.0, 2.0, 3.0]))
    with pytest.raises(ProjectError, match="elsewhere"):
        saved.with_cloud(cloud, InputSettings())


def test_that_a_cloud_without_a_file_cannot_be_saved(stored, tmp_path):
    scan = replace(stored, cloud=replace(stored.cloud, source=None))
    with pytest.raises(WriteError, match="not read from a file"):
        write_project(tmp_path / "work.pipegui", Document((scan,)))
    assert not list(tmp_path.iterdir())


def test_that_the_unit_of_the_file_is_kept(stored, tmp_path):
    path = tmp_path / "work.pipegui"
    reading = InputSettings(length_unit=LengthUnit.FOOT, columns="x,y,z,-")
    write_project(path, Document((replace(stored, reading=reading),)))
    assert read_project(path).scans[0].cloud.how_read(Settings()) == reading


# Whole or not at all; damaged and foreign files


class StopAfter:
    def __init__(self, n: int) -> None:
        self.n = n

    def update(self, stage: str, fraction: float) -> None:
        self.n -= 1
        if self.n < 0:
            raise CancelledError


@pytest.mark.parametrize("n", [0, 3, 17])
def test_that_saving_that_is_cancelled_leaves_the_file_before(document, tmp_path, n):
    path = tmp_path / "work.pipegui"
    write_project(path, Document())
    before = path.read_bytes()
    with pytest.raises(CancelledError):
        write_project(path, document, progress=StopAfter(n))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def rewritten(path: Path, change) -> Path:
    """The project with its JSON changed."""
    target = path.with_name("changed.pipegui")
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(target, "w") as other:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "project.json":
                contents = json.loads(data)
                change(contents)
                data = json.dumps(contents).encode()
            other.writestr(name, data)
    return target


def test_that_a_newer_version_is_named_as_such(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    newer = rewritten(path, lambda c: c.update(format_version=3, program="9.9"))
    with pytest.raises(ProjectError, match=r"newer PipeGUI \(9\.9\)"):
        read_project(newer)


def test_that_fields_of_a_later_program_are_left_out_and_missing_ones_have_defaults(
    document, tmp_path
):
    path = tmp_path / "work.pipegui"
    write_project(path, document)

    def change(contents):
        contents["view"] |= {"shadows": True}
        del contents["view"]["fly"]
        contents["scans"][1]["result"]["elements"][0]["colour"] = "red"
        del contents["scans"][1]["result"]["elements"][0]["name"]

    saved = read_project(rewritten(path, change))
    assert saved.view == document.view
    assert len(saved.scans[1].result.elements) == len(document.result.elements)


def test_that_a_view_that_makes_no_sense_does_not_cost_the_project(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    for change in (
        lambda c: c["view"].update(colour_by="Smell"),
        lambda c: c["selection"].update(element_id=99),
        lambda c: c["selection"].update(profile={"stack_id": 7, "profile_index": 1}),
        lambda c: c.update(camera={"position": ["a"]}),
    ):
        saved = read_project(rewritten(path, change))
        assert len(saved.scans) == 2


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c.pop("scans"),
        lambda c: c.update(format="something"),
        lambda c: c.update(format_version=True),
        lambda c: c.update(active=5),
        lambda c: c["settings"]["elements"].update(min_radius_mm="wide"),
        lambda c: c["scans"][1]["result"]["elements"][0].update(radius=-1),
        lambda c: c["scans"][1]["result"]["elements"][0].update(element_id=2),
        lambda c: c["scans"][1]["result"]["elements"][0]["axis"].update(start=[1, 2]),
        lambda c: c["scans"][1]["result"]["elements"][0]["axis"].update(kind="spiral"),
        lambda c: c["scans"][1]["result"]["elements"].pop(),
        lambda c: c["scans"][1]["result"].update(n_cloud_points=5),
        lambda c: c["scans"][1]["reviews"].update({"77": {}}),
        lambda c: c["scans"][1]["result"].update(stacks=[]),
    ],
)
def test_that_contents_that_do_not_go_together_are_refused_in_one_sentence(
    document, tmp_path, change
):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    with pytest.raises(ProjectError) as caught:
        read_project(rewritten(path, change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"PK", b"hello" * 1000, b"\x00" * 5000])
def test_that_a_file_of_another_kind_is_told(tmp_path, content):
    path = tmp_path / "work.pipegui"
    path.write_bytes(content)
    with pytest.raises(ProjectError, match="“work"):
        read_project(path)
    with pytest.raises(ProjectError, match="no file"):
        read_project(tmp_path / "none.pipegui")
    with pytest.raises(ProjectError):
        read_project(tmp_path)


@pytest.fixture(scope="module")
def healthy(stored, tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("fuzz") / "work.pipegui"
    write_project(path, Document((stored,)))
    return path.read_bytes()


@settings(
    max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_that_any_damage_ends_in_a_sound_project_or_a_clear_error(healthy, tmp_path, data):
    damaged = bytearray(healthy)
    n = len(damaged)
    for _ in range(data.draw(st.integers(1, 4))):
        kind = data.draw(st.sampled_from(["flip", "cut", "zero", "repeat"]))
        # Near the end lies the archive's directory.
        at = data.draw(st.integers(0, n - 1) | st.integers(max(n - 4000, 0), n - 1))
        length = data.draw(st.integers(1, 300))
        if kind == "flip":
            damaged[at % len(damaged)] ^= 1 << data.draw(st.integers(0, 7))
        elif kind == "cut":
            del damaged[at : at + length]
        elif kind == "zero":
            damaged[at : at + length] = bytes(len(damaged[at : at + length]))
        else:
            damaged[at:at] = damaged[at : at + length]
        if not damaged:
            break
    path = tmp_path / "damaged.pipegui"
    path.write_bytes(damaged)
    # Nothing but this one error comes out; what is opened all the same goes together.
    with suppress(ProjectError):
        for scan in read_project(path).scans:
            assert scan.result is None or isinstance(scan.result, Result)


def test_that_columns_of_profiles_are_all_kept(document, tmp_path):
    path = tmp_path / "work.pipegui"
    write_project(path, document)
    names = zipfile.ZipFile(path).namelist()
    for f in fields(Profiles):
        assert f"scans/1/profiles/{f.name}.npy" in names
    assert project_file.FORMAT_VERSION == 2
