"""Files written by version 0.1 open, with all that is in them."""

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipecore.geometry import ArcAxis, LineAxis
from pipecore.io import read
from pipecore.report import write_result_json
from pipecore.settings import Settings
from pipecore.types import ElementKind, ReviewState, Verdict
from pipegui.model.document import Background, ClipBox, ColourBy, Tool
from pipegui.project.cloud_reference import CloudState
from pipegui.project.project_file import read_project, write_project

KEPT = Path(__file__).parents[1] / "data" / "ac01052"


@pytest.fixture
def document():
    saved = read_project(KEPT / "two-scans.pipegui")
    assert [state for _, state in saved.located()] == [CloudState.FOUND] * 2
    clouds = [read(path) for path, _ in saved.located()]
    return saved.document(
        tuple(
            s.with_cloud(c, s.cloud.how_read(saved.settings))
            for s, c in zip(saved.scans, clouds, strict=True)
        )
    )


def test_that_results_and_edits_are_in_the_project(document):
    pump_house, riser = document.scans
    assert (pump_house.name, riser.name) == ("pump-house.laz", "riser.laz")
    elements = pump_house.result.elements
    assert [e.label for e in elements[:2]] == ["Feed line", "Bend 2"]
    assert [type(e.axis) for e in elements[:3]] == [LineAxis, ArcAxis, LineAxis]
    assert [e.kind for e in elements[:2]] == [ElementKind.CYLINDER, ElementKind.TORUS]
    assert elements[0].radius == pytest.approx(0.0571, abs=1e-4)
    assert len(elements) == 5, "one was split"
    assert pump_house.result.run_names == {1: "Line 7"}
    [dent] = pump_house.result.deformations
    assert (dent.depth, dent.verdict) == (pytest.approx(0.0109, abs=1e-4), Verdict.REJECT)
    assert dent.not_measurable["strain"] == "the wall thickness is not set"
    assert len(pump_house.result.profiles.of_element(1, 0)) == 47
    assert np.count_nonzero(riser.result.element_id == 1) > 1000
    assert len(riser.result.elements) == 2


def test_that_reviews_settings_and_view_are_in_the_project(document):
    review = document.scans[0].review(1)
    assert (review.state, review.comment) == (ReviewState.REJECTED, "Ask the owner")
    assert document.settings.elements.min_radius_mm == 20.0
    assert document.settings.stacks.directions == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0, 25.0))
    assert document.active == 0
    assert (document.selection.element_id, document.selection.deformation_id) == (1, 1)
    view = document.view
    assert (view.colour_by, view.tool) == (ColourBy.DEVIATION, Tool.SELECT)
    assert view.background is Background.SYSTEM
    assert view.clip_box == ClipBox((-0.5, -0.5, -0.5), (2.0, 2.0, 1.0))
    assert (view.hidden_elements, view.pinned_elements) == (frozenset({5}), (1,))


def test_that_a_project_saved_anew_is_the_same_and_names_no_classes(document, tmp_path):
    for path in KEPT.glob("*.laz"):
        shutil.copy(path, tmp_path)
    path = tmp_path / "again.pipegui"
    write_project(path, document)
    with zipfile.ZipFile(path) as archive:
        contents = json.loads(archive.read("project.json"))
    assert '"type"' not in json.dumps(contents)
    assert [e["axis"]["kind"] for e in contents["scans"][0]["result"]["elements"][:2]] == [
        "line",
        "arc",
    ]
    assert contents["view"]["background"] == "system"
    again = read_project(path)
    assert again.view == document.view
    assert again.selection == document.selection
    assert again.settings == document.settings
    for now, before in zip(again.scans, document.scans, strict=True):
        assert now.reviews == before.reviews
        assert [e.label for e in now.result.elements] == [e.label for e in before.result.elements]
        assert np.array_equal(now.result.deviation, before.result.deviation, equal_nan=True)


def test_that_the_project_is_opened_in_the_window(make_app, qtbot):
    app = make_app(read=lambda path, settings, progress: read(path))
    app.controllers.scans.open_files([KEPT / "two-scans.pipegui"])
    qtbot.waitUntil(lambda: len(app.session.document.scans) == 2)
    assert app.window.windowTitle() == "two-scans[*] – PipeGUI"
    assert not app.window.isWindowModified()
    assert app.window.panels.docks["Element"].windowTitle() == "Feed line · dent 1"
    assert app.window.views.scene.camera_set == {
        "focus": [0.5, 0.0, 0.0],
        "look": [3.0, 0.5, 0.25],
    }


def test_that_settings_are_read():
    settings = Settings.from_toml(KEPT / "settings.toml")
    assert settings.elements.min_radius_mm == 20.0
    assert settings.stacks.directions == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0, 25.0))


def differences(before: Any, now: Any, place: str = "") -> list[str]:
    """Where `now` lacks something of `before`, or has another value."""
    if isinstance(before, dict) and isinstance(now, dict):
        lost = [f"{place}/{key}" for key in before if key not in now]
        return lost + [
            text
            for key in before.keys() & now.keys()
            for text in differences(before[key], now[key], f"{place}/{key}")
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [text for i, (b, n) in pairs for text in differences(b, n, f"{place}/{i}")]
    return [] if before == now else [f"{place}: {before} is {now}"]


def test_that_result_json_still_has_all_keys_with_their_values(document, tmp_path):
    """A program that reads what version 0.1 wrote reads what this one writes."""
    write_result_json(tmp_path / "result.json", document.scans[1].result)
    before, now = (
        json.loads((folder / "result.json").read_text(encoding="utf-8"))
        for folder in (KEPT, tmp_path)
    )
    assert now.pop("created") != before.pop("created")
    assert before.pop("versions").keys() <= now.pop("versions").keys()
    assert not differences(before, now)
