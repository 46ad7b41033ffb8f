"""What the parts of the window are told: without Qt."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pipegui.model import commands
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
    document = commands.select_profile(commands.select_deformation(DETECTED, 1), 0, 40)
    assert changed_parts(document, replace(document)) == set()


def test_that_a_setting_concerns_only_those_who_show_it():
    after = commands.change_settings(DETECTED, {"elements.min_radius_mm": 40.0})
    assert changed_parts(DETECTED, after) == {"settings"}
    after = commands.add_stack(DETECTED, (1.0, 0.0, 0.0))
    assert changed_parts(DETECTED, after) == {"settings", "stacks"}


def test_that_stepping_to_the_next_profile_leaves_tables_and_map_points_alone():
    before = commands.select_profile(commands.select_element(DETECTED, 2), 0, 40)
    after = commands.step_profile(before, 1)
    assert {"table", "settings", "stacks"}.isdisjoint(changed_parts(before, after))
    assert resolve(before).map.chainage is resolve(after).map.chainage


def test_that_a_selected_profile_names_the_same_thing_to_all():
    document = commands.select_profile(commands.select_element(DETECTED, 2), 0, 40)
    state = resolve(document)
    assert state.radius_plot.selected_index == 40
    assert state.section.profile.profile_index[0] == 40
    assert state.properties.profile.profile_index[0] == 40
    assert state.scene.profile.profile_index[0] == 40
    assert state.map.selected_chainage == state.section.profile.chainage[0]


def test_that_a_selected_dent_shows_the_section_at_its_peak():
    state = resolve(commands.select_deformation(DETECTED, 1))
    peak = RESULT.deformation(1).chainage
    assert state.section.profile.chainage[0] == pytest.approx(peak, abs=0.02)
    assert [d.deformation_id for d in state.section.deformations] == [1]
    assert state.scene.profile is None


def test_that_a_clean_section_lies_on_its_reference_circle_in_the_clock_frame():
    """Points at known clock angles come out where a clock face has them."""
    document = commands.select_profile(commands.select_element(DETECTED, 7), 0, 10)
    section = resolve(document).section
    relative = section.cut.points_uv - section.cut.reference.centre_uv
    radius = np.hypot(*relative.T)
    assert np.median(radius) == pytest.approx(section.cut.reference.semi_minor_mm, abs=1000 * NOISE)
    # Compare with pipe coordinates, which are tested on their own.
    index = np.flatnonzero(RESULT.element_id == 7)
    axis = RESULT.element(7).axis
    chainage, _, clock = axis.pipe_coordinates(CLOUD.xyz[index])
    inside = np.abs(chainage - section.profile.chainage[0]) <= 0.01
    assert len(relative) == inside.sum()
    angle = np.mod(np.arctan2(relative[:, 0], relative[:, 1]), 2 * np.pi)
    assert np.sort(angle) == pytest.approx(np.sort(clock[inside]), abs=0.01)


def test_that_an_oblique_cut_of_a_round_pipe_lies_on_its_reference_ellipse():
    """Pipe 7 falls a little across X, so its X profiles are ellipses, if only slightly."""
    rows = RESULT.profiles.of_element(7, 1)
    clean = np.abs(rows.chainage - RESULT.deformation(3).chainage) > 0.2
    index = int(rows.profile_index[clean][5])
    document = commands.select_profile(commands.select_element(DETECTED, 7), 1, index)
    section = resolve(document).section
    reference = section.cut.reference
    cos, sin = np.cos(reference.angle_rad), np.sin(reference.angle_rad)
    u, v = (section.cut.points_uv - reference.centre_uv).T
    along, across = cos * u + sin * v, -sin * u + cos * v
    level = np.hypot(along / reference.semi_major_mm, across / reference.semi_minor_mm)
    assert len(level) > 10
    assert reference.semi_major_mm > reference.semi_minor_mm
    assert np.median(level) == pytest.approx(1, abs=0.01)


def test_that_a_bend_cut_twice_by_a_plane_shows_one_branch_only():
    rows = RESULT.profiles.of_element(3)
    for stack_id, index in zip(rows.stack_id, rows.profile_index, strict=True):
        document = commands.select_element(DETECTED, 3)
        document = commands.select_profile(document, int(stack_id), int(index))
        section = resolve(document).section
        extent = np.hypot(*section.cut.points_uv.T).max(initial=0)
        assert extent < 2.2 * 1000 * RESULT.element(3).radius


def test_that_the_plot_falls_back_to_a_stack_that_cuts_the_element():
    document = commands.show_plot_stack(commands.select_element(DETECTED, 2), 3)
    assert 3 not in RESULT.profiles.of_element(2).stack_id
    state = resolve(document).radius_plot
    assert state.stack_id == 0
    assert len(state.shown) == RESULT.element(2).n_profiles


def test_that_a_profile_key_that_is_not_there_shows_an_empty_section():
    document = commands.select_element(DETECTED, 2)
    selection = replace(document.selection, profile=ProfileKey(0, 9999))
    state = resolve(commands.select(document, selection))
    assert state.section.profile is None


@pytest.mark.parametrize(
    "module", ["document", "commands", "view_state", "history", "selecting", "describe"]
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
