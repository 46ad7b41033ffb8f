"""The CloudCompare plugin, found by its entry point and run against a strict stand-in."""

import importlib
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipecore.geometry import surface_points
from pipecore.settings import Settings
from pipecore.types import ElementKind
from tests.factories import make_scan

from . import fake_pycc

SHIFT = -432_000.0, -6_201_000.0, -100.0


@pytest.fixture
def app(monkeypatch):
    """The running CloudCompare."""
    pycc, core, app = fake_pycc.modules()
    for name in [n for n in sys.modules if n.startswith("pipecore.cloudcompare")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pycc", pycc)
    monkeypatch.setitem(sys.modules, "cccorelib", core)
    yield app
    for name in [n for n in sys.modules if n.startswith("pipecore.cloudcompare")]:
        sys.modules.pop(name)


@pytest.fixture
def plugin(app):
    """The plugin as the runtime makes it: by group, module and class."""
    [entry] = importlib.metadata.entry_points(group="cloudcompare.plugins")
    assert entry.value.count(":") == 1
    module, name = entry.value.split(":")
    return getattr(importlib.import_module(module), name)()


def cloud_of(scan, scale: float = 1.0):
    """Points of a scan as CloudCompare holds them: shifted, scaled, single precision."""
    world = scan.xyz.astype(np.float64) + scan.origin
    shown = scale * (world + SHIFT)
    cloud = fake_pycc.ccPointCloud(*shown.T.astype(np.float32))
    cloud.setName("Plant")
    cloud.setGlobalShift(*SHIFT)
    cloud.setGlobalScale(scale)
    return cloud


def run(plugin, name: str) -> None:
    [action] = [a for a in plugin.getActions() if a.name == name]
    action.target()


def errors() -> list[str]:
    return [text for level, text in fake_pycc.LOG if level in ("error", "warning")]


@pytest.fixture(scope="module")
def scan():
    return make_scan(60_000)


@pytest.fixture
def found(app, plugin, scan):
    """The demo installation, selected and detected."""
    app.selection = [cloud_of(scan[0])]
    run(plugin, "Find pipes")
    assert errors() == []
    return app


def children(group) -> list:
    return [group.getChild(i) for i in range(group.getChildrenNumber())]


def field(cloud, name: str) -> np.ndarray:
    return cloud.getScalarField(cloud.getScalarFieldIndexByName(name)).asArray()


def primitives(group) -> list:
    inside = children(group)
    mine = [c for c in inside if isinstance(c, fake_pycc.ccGenericPrimitive)]
    return mine + [p for c in inside for p in primitives(c)]


def test_that_the_plugin_is_found_with_icon_and_actions(plugin):
    assert plugin.is_initialised
    assert Path(plugin.getIcon()).read_bytes().startswith(b"\x89PNG")
    names = [a.name for a in plugin.getActions()]
    assert names == ["Find pipes", "Detect with settings…", "Open in PipeGUI", "Export tables…"]


def test_that_pipes_are_found_where_they_are(found, scan, plugin):
    [group] = found.db
    cloud = found.selection[0]
    _, result = plugin._last
    assert {e.kind for e in result.elements} >= {ElementKind.CYLINDER, ElementKind.TORUS}
    surfaces = primitives(group)
    assert len(surfaces) >= len(result.elements)
    for surface in surfaces:
        shift = surface.getAssociatedCloud().getGlobalShift()
        assert (shift.x, shift.y, shift.z) == SHIFT
    pipes = [e for e in result.elements if e.kind is ElementKind.CYLINDER]
    longest = max(pipes, key=lambda e: e.axis.length)
    [tube] = [s for s in surfaces if s.getName().startswith(f"{longest.label}:")]
    assert tube.radii == pytest.approx((longest.radius, longest.radius))
    assert tube.height == pytest.approx(longest.axis.length)
    # Its frame holds in the coordinates that CloudCompare shows.
    middle = longest.axis.at(longest.axis.length / 2) + result.origin + SHIFT
    assert tube.frame[:3, 3] == pytest.approx(middle, abs=1e-3)
    assert abs(tube.frame[:3, 2] @ longest.axis.direction) == pytest.approx(1.0)
    assert np.linalg.det(tube.frame[:3, :3]) == pytest.approx(1.0, abs=1e-5)
    assert cloud.sfShown()
    shown = cloud.getScalarFieldName(cloud.getCurrentDisplayedScalarFieldIndex())
    assert shown == "Pipe deviation (mm)"


def test_that_a_torus_starts_and_ends_with_its_bend(found, plugin):
    _, result = plugin._last
    [bend] = [e for e in result.elements if e.kind is ElementKind.TORUS]
    [torus] = [s for s in primitives(found.db[0]) if isinstance(s, fake_pycc.ccTorus)]
    radius = (torus.inside + torus.outside) / 2
    for angle, end in ((0.0, bend.axis.start), (torus.angle, bend.axis.end)):
        local = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.0, 1.0])
        shown = (torus.frame @ local)[:3]
        assert shown == pytest.approx(end + result.origin + SHIFT, abs=1e-3)


def test_that_fields_stand_in_the_same_cloud_and_are_replaced(found, plugin):
    cloud = found.selection[0]
    names = [cloud.getScalarFieldName(i) for i in range(cloud.getNumberOfScalarFields())]
    assert len(names) == 5
    own, result = plugin._last
    element_id = field(cloud, "Pipe element")
    assert np.array_equal(np.nan_to_num(element_id), result.element_id)
    row = int(np.flatnonzero(result.element_id == result.elements[0].element_id)[0])
    chainage, clock = (field(cloud, f"Pipe {n}")[row] for n in ("chainage (m)", "clock (h)"))
    axis, radius = result.elements[0].axis, result.elements[0].radius
    place = surface_points(axis, chainage, radius, clock * np.pi / 6)
    assert np.linalg.norm(place - own.xyz[row]) < 0.03
    run(plugin, "Find pipes")
    assert cloud.getNumberOfScalarFields() == 5


def test_that_deformations_are_labelled_at_their_peaks(found, plugin):
    _, result = plugin._last
    assert result.deformations
    group = found.db[0]
    [labels] = [c for c in children(group) if c.getName() == "Deformations"]
    places = labels.getChild(0)
    for index, deformation in enumerate(result.deformations):
        label = places.getChild(index)
        [(cloud, point)] = label.picked
        shown = cloud.points()[point]
        assert np.linalg.norm(shown - (deformation.peak + result.origin + SHIFT)) < 0.05
        assert str(deformation.verdict) in label.getName()


def test_that_a_scaled_cloud_has_the_same_radii(app, plugin, scan, found):
    _, result = plugin._last
    app.selection = [cloud_of(scan[0], scale=1000.0)]
    run(plugin, "Find pipes")
    assert errors() == []
    _, scaled = plugin._last
    radii = [sorted(e.radius for e in r.elements) for r in (result, scaled)]
    assert radii[1] == pytest.approx(radii[0], abs=2e-4)
    tube = next(s for s in primitives(app.db[1]) if isinstance(s, fake_pycc.ccCylinder))
    assert tube.radii[0] > 10  # in the millimetres that are shown


def test_that_several_clouds_are_one_scan_and_get_their_own_points(app, plugin, scan):
    whole = cloud_of(scan[0])
    half = whole.size() // 2
    halves = slice(half), slice(half, None)
    parts = [fake_pycc.ccPointCloud(*whole.points()[rows].T) for rows in halves]
    for part in parts:
        part.setGlobalShift(*SHIFT)
    app.selection = parts
    run(plugin, "Find pipes")
    assert errors() == []
    cloud, result = plugin._last
    assert cloud.station is not None
    for part, rows in zip(parts, halves, strict=True):
        assert np.array_equal(np.nan_to_num(field(part, "Pipe element")), result.element_id[rows])


def test_that_cancelling_changes_nothing(app, plugin, scan):
    app.selection = [cloud_of(scan[0])]
    fake_pycc.ccProgressDialog.cancel_after = 30.0
    run(plugin, "Find pipes")
    assert app.db == []
    assert app.selection[0].getNumberOfScalarFields() == 0
    assert "cancelled" in fake_pycc.LOG[-1][1]


def test_that_mistakes_are_told_as_messages(app, plugin):
    run(plugin, "Find pipes")
    assert fake_pycc.LOG[-1] == ("error", "[PipeGUI] Select one or more point clouds first.")
    run(plugin, "Export tables…")
    assert "nothing to export" in fake_pycc.LOG[-1][1]
    bad = fake_pycc.ccPointCloud(*np.array([[0.0, np.nan], [0, 0], [0, 0]], np.float32))
    bad.setName("Torn")
    app.selection = [bad]
    run(plugin, "Find pipes")
    assert "“Torn” holds coordinates that are not numbers" in fake_pycc.LOG[-1][1]


def test_that_tables_are_written_and_shown(found, plugin, monkeypatch, tmp_path):
    shown = []
    monkeypatch.setattr("webbrowser.open", shown.append)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    run(plugin, "Export tables…")
    assert errors() == []
    [folder] = (tmp_path / "PipeGUI").iterdir()
    assert (folder / "elements.csv").exists()
    assert shown == [(folder / "report.html").as_uri()]


def test_that_the_app_opens_the_cloud_with_its_fields(app, plugin, scan, monkeypatch):
    import pipecore

    started = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, env: started.append(command))
    cloud = cloud_of(scan[0])
    cloud.setName("a/b: <Plant>")
    cloud.setColors(scan[0].rgb)
    cloud.addScalarField("Temperature", np.arange(cloud.size()))
    app.selection = [cloud]
    run(plugin, "Open in PipeGUI")
    assert errors() == []
    [[python, *command]] = started
    assert Path(python).stem.startswith("python")
    path = Path(command[-1])
    assert path.name == "1 a_b_ _Plant_.laz"
    read = pipecore.read(path, has_fields=True)
    world = scan[0].xyz.astype(np.float64) + scan[0].origin
    assert np.abs(read.xyz + read.origin - world).max() < 2e-3  # CloudCompare's own steps
    assert np.array_equal(read.rgb, scan[0].rgb)
    assert read.fields["Temperature"].scaled()[-1] == cloud.size() - 1


def test_that_settings_come_from_their_own_window(app, plugin, scan, monkeypatch, tmp_path):
    monkeypatch.setenv("APPDATA", str(tmp_path))
    path = tmp_path / "PipeGUI" / "cloudcompare.toml"

    def choose(command, *, env, check):
        assert command[1:] == ["-m", "pipegui", "--choose-settings", str(path)]
        settings = Settings().replace({"elements.min_radius_mm": 75.0})
        path.write_text(settings.to_toml(), encoding="utf-8")
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", choose)
    app.selection = [cloud_of(scan[0])]
    run(plugin, "Detect with settings…")
    assert errors() == []
    _, result = plugin._last
    assert result.settings.elements.min_radius_mm == 75.0
    cancelled = subprocess.CompletedProcess((), 1)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: cancelled)
    run(plugin, "Detect with settings…")
    assert "nothing was detected" in fake_pycc.LOG[-1][1]


def test_that_without_the_app_settings_are_a_file_to_edit(plugin, app, scan, monkeypatch, tmp_path):
    monkeypatch.setenv("APPDATA", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    app.selection = [cloud_of(scan[0])]
    run(plugin, "Detect with settings…")
    assert fake_pycc.LOG[-1][0] == "error"
    assert Settings.from_toml(tmp_path / "PipeGUI" / "cloudcompare.toml") == Settings()
    run(plugin, "Open in PipeGUI")
    assert "pip install pipegui" in fake_pycc.LOG[-1][1]
