"""What the parts of the window are told: without Qt."""

import gc
import subprocess
import sys
import weakref
from dataclasses import replace

import numpy as np
import pytest

from pipegui.model import commands, selection_commands
from pipegui.model.document import Document, ProfileKey, Scan
from pipegui.states.view_state import resolve
from tests.factories import NOISE, make_scan

CLOUD, RESULT = make_scan()
DETECTED = Document(scans=(Scan("plant.laz", CLOUD, RESULT),))
PARTS = ("scene", "tree", "stacks", "settings", "table", "properties", "radius_plot", "map")


def changed_parts(before, after):
    a, b = resolve(before), resolve(after)
    return {name for name in (*PARTS, "section", "window") if getattr(a, name) != getattr(b, name)}


def test_that_the_same_document_gives_equal_states():
    document = selection_commands.select_profile(
        selection_commands.select_deformation(DETECTED, 1), 0, 40
    )
    assert changed_parts(document, replace(document)) == set()


def test_that_a_setting_concerns_only_those_who_show_it():
    after = commands.change_settings(DETECTED, {"elements.min_radius_mm": 40.0})
    assert changed_parts(DETECTED, after) == {"settings"}
    after = commands.add_stack(DETECTED, (1.0, 0.0, 0.0))
    assert changed_parts(DETECTED, after) == {"settings", "stacks"}


def test_that_stepping_to_the_next_profile_leaves_tables_and_map_points_alone():
    before = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 2), 0, 40
    )
    after = selection_commands.step_profile(before, 1)
    assert {"table", "settings", "stacks"}.isdisjoint(changed_parts(before, after))
    assert resolve(before).map.points is resolve(after).map.points


def test_that_a_selected_profile_names_the_same_thing_to_all():
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 2), 0, 40
    )
    state = resolve(document)
    assert state.radius_plot.selected_index == 40
    assert state.section.profile.profile_index[0] == 40
    assert state.properties.profile.profile_index[0] == 40
    assert state.scene.profile.profile_index[0] == 40
    assert state.map.selected_chainage == state.section.profile.chainage[0]


def test_that_a_selected_dent_shows_the_section_at_its_peak():
    state = resolve(selection_commands.select_deformation(DETECTED, 1))
    peak = RESULT.deformation(1).chainage
    assert state.section.profile.chainage[0] == pytest.approx(peak, abs=0.02)
    assert [d.deformation_id for d in state.section.deformations] == [1]
    assert state.scene.profile is None


def test_that_a_clean_section_lies_on_its_reference_circle_in_the_clock_frame():
    """Points at known clock angles come out where a clock face has them."""
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 7), 0, 10
    )
    state = resolve(document).section
    relative = state.section.points_uv - state.section.reference.centre_uv
    radius = np.hypot(*relative.T)
    assert np.median(radius) == pytest.approx(state.section.reference.semi_minor, abs=NOISE)
    # Compare with pipe coordinates, which are tested on their own.
    index = np.flatnonzero(RESULT.element_id == 7)
    axis = RESULT.element(7).axis
    chainage, _, clock = axis.pipe_coordinates(CLOUD.xyz[index])
    inside = np.abs(chainage - state.profile.chainage[0]) <= 0.01
    assert len(relative) == inside.sum()
    angle = np.mod(np.arctan2(relative[:, 0], relative[:, 1]), 2 * np.pi)
    assert np.sort(angle) == pytest.approx(np.sort(clock[inside]), abs=0.01)


def test_that_an_oblique_cut_of_a_round_pipe_lies_on_its_reference_ellipse():
    """Pipe 7 falls a little across X, so its X profiles are ellipses, if only slightly."""
    rows = RESULT.profiles.of_element(7, 1)
    clean = np.abs(rows.chainage - RESULT.deformation(3).chainage) > 0.2
    index = int(rows.profile_index[clean][5])
    document = selection_commands.select_profile(
        selection_commands.select_element(DETECTED, 7), 1, index
    )
    state = resolve(document).section
    reference = state.section.reference
    cos, sin = np.cos(reference.angle), np.sin(reference.angle)
    u, v = (state.section.points_uv - reference.centre_uv).T
    along, across = cos * u + sin * v, -sin * u + cos * v
    level = np.hypot(along / reference.semi_major, across / reference.semi_minor)
    assert len(level) > 10
    assert reference.semi_major > reference.semi_minor
    assert np.median(level) == pytest.approx(1, abs=0.01)


def test_that_a_bend_cut_twice_by_a_plane_shows_one_branch_only():
    rows = RESULT.profiles.of_element(3)
    for stack_id, index in zip(rows.stack_id, rows.profile_index, strict=True):
        document = selection_commands.select_element(DETECTED, 3)
        document = selection_commands.select_profile(document, int(stack_id), int(index))
        state = resolve(document).section
        extent = np.hypot(*state.section.points_uv.T).max(initial=0)
        assert extent < 2.2 * RESULT.element(3).radius


def test_that_the_plot_falls_back_to_a_stack_that_cuts_the_element():
    document = commands.show_plot_stack(selection_commands.select_element(DETECTED, 2), 3)
    assert 3 not in RESULT.profiles.of_element(2).stack_id
    state = resolve(document).radius_plot
    assert state.stack_id == 0
    assert len(state.shown) == RESULT.element(2).n_profiles


def test_that_nothing_is_kept_of_a_scan_that_was_closed():
    cloud, result = replace(CLOUD), replace(RESULT)
    document = Document(scans=(Scan("scan", cloud, result),))
    document = selection_commands.select_profile(
        selection_commands.select_element(document, 2), 0, 40
    )
    assert resolve(document).section.section is not None
    gone = weakref.ref(cloud), weakref.ref(result)
    del cloud, result, document
    gc.collect()
    assert [ref() for ref in gone] == [None, None]


def test_that_a_profile_key_that_is_not_there_shows_an_empty_section():
    document = selection_commands.select_element(DETECTED, 2)
    selection = replace(document.selection, profile=ProfileKey(0, 9999))
    state = resolve(selection_commands.select(document, selection))
    assert state.section.profile is None


@pytest.mark.parametrize(
    "module",
    [
        "model.document",
        "model.commands",
        "model.history",
        "model.selection",
        "states.view_state",
        "states.descriptions",
    ],
)
def test_that_the_documents_modules_load_without_qt_and_vtk(module):
    code = (
        f"import sys, pipegui.{module}; "
        "print([m for m in sys.modules if m.split('.')[0] in ('PySide6', 'vtkmodules', 'pyvista')])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600
    )
    assert loaded.stdout.strip() == "[]"
