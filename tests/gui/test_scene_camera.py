"""Camera, projection, picking, aiming and label places, without a window."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPointF, QRect, QRectF, QSize
from vtkmodules.vtkRenderingCore import vtkCamera

from pipegui.model.document import Document, ProfileKey, Scan, Selection
from pipegui.scene import pose as poses
from pipegui.scene import shapes
from pipegui.scene.aiming import aim
from pipegui.scene.label_places import place_box
from pipegui.scene.overlay import length_text, round_length
from pipegui.scene.picking import PICK_RADIUS_PX, _find_near, pick_point, points_near
from pipegui.scene.point_layer import estimate_spacing
from pipegui.scene.pose import VIEW_ANGLE, Pose
from pipegui.scene.projection import Projection, as_array
from pipegui.states.view_state import resolve
from tests.factories import make_scan

SIZE = (800, 600)
ASPECT = SIZE[0] / SIZE[1]
CLOUD, RESULT = make_scan()


def projection_of(pose: Pose) -> Projection:
    """As VTK's own camera projects."""
    camera = vtkCamera()
    camera.SetViewAngle(np.rad2deg(VIEW_ANGLE))
    camera.SetFocalPoint(pose.focus)
    camera.SetPosition(pose.position)
    camera.SetViewUp(pose.up)
    camera.SetClippingRange(0.01, 100)
    to_clip = camera.GetCompositeProjectionTransformMatrix(ASPECT, 0.01, 100)
    to_eye = camera.GetViewTransformMatrix()
    return Projection.of_camera(as_array(to_clip), as_array(to_eye), SIZE, VIEW_ANGLE)


@pytest.fixture
def pose(rng) -> Pose:
    return Pose(rng.uniform(-1, 1, 3), rng.uniform(1, 5), *rng.uniform([-3, -1.3], [3, 1.3]))


def test_that_the_focus_is_in_the_middle_and_right_and_up_are_so(pose):
    projection = projection_of(pose)
    points = np.stack([pose.focus, pose.focus + 0.1 * pose.right, pose.focus + 0.1 * pose.up])
    (middle, right, up), depth = projection.to_screen(points)
    assert middle == pytest.approx([400, 300], abs=1e-6)
    assert right[0] > 400
    assert right[1] == pytest.approx(300, abs=1e-6)
    assert up[1] < 300
    assert depth == pytest.approx(pose.distance)
    pixels = 0.1 / projection.pixel_size(pose.distance)
    assert right[0] - 400 == pytest.approx(pixels, rel=1e-6)


def test_that_a_ray_goes_through_what_its_pixel_shows(pose, rng):
    projection = projection_of(pose)
    point = pose.focus + rng.uniform(-0.3, 0.3, 3)
    ((u, v),), _ = projection.to_screen(point)
    origin, direction = projection.ray(u, v)
    off = np.cross(point - origin, direction)
    assert np.linalg.norm(off) < 1e-9
    assert origin == pytest.approx(pose.position, abs=1e-9)


def test_that_points_behind_the_camera_are_nowhere(pose):
    pixels, _ = projection_of(pose).to_screen(pose.position - 0.5 * pose.forward)
    assert np.isnan(pixels).all()


def test_that_standard_views_look_where_their_names_say():
    start = Pose(np.zeros(3), 1.0)
    looks = {"top": [0, 0, -1], "front": [0, 1, 0], "right": [-1, 0, 0], "back": [0, -1, 0]}
    for name, forward in looks.items():
        assert poses.standard_view(start, name).forward == pytest.approx(forward, abs=1e-12)
    assert poses.standard_view(start, "top").up == pytest.approx([0, 1, 0], abs=1e-12)


def test_that_orbiting_keeps_the_pivot_in_its_pixel(pose, rng):
    pivot = pose.focus + rng.uniform(-0.2, 0.2, 3)
    turned = poses.orbit(pose, 0.4, 0.1, pivot)
    before, _ = projection_of(pose).to_screen(pivot)
    after, _ = projection_of(turned).to_screen(pivot)
    assert after == pytest.approx(before, abs=1e-6)
    assert turned.right[2] == pytest.approx(0)


def test_that_zooming_keeps_the_target_in_its_pixel(pose, rng):
    target = pose.focus + rng.uniform(-0.2, 0.2, 3)
    zoomed = poses.zoom(pose, 0.5, target)
    before, depth = projection_of(pose).to_screen(target)
    after, new_depth = projection_of(zoomed).to_screen(target)
    assert after == pytest.approx(before, abs=1e-6)
    assert new_depth == pytest.approx(0.5 * depth)


def test_that_framing_shows_all_points_and_fills_the_picture(pose, rng):
    points = rng.normal(0, [3, 0.5, 0.2], (200, 3))
    framed = poses.framing(pose, points, ASPECT, margin=1.25)
    pixels, _ = projection_of(framed).to_screen(points)
    # In one direction the points reach both edges of what the margin leaves.
    reach = np.abs(pixels - np.array(SIZE) / 2).max(axis=0) / (np.array(SIZE) / 2)
    assert reach.max() == pytest.approx(1 / 1.25, abs=1e-6)
    edges = (pixels.max(axis=0) + pixels.min(axis=0))[np.argmax(reach)]
    assert edges == pytest.approx(SIZE[np.argmax(reach)], abs=1e-6)


def test_that_a_flight_starts_and_ends_where_it_should_and_turns_the_short_way(rng):
    start = Pose(np.zeros(3), 1.0, heading=np.deg2rad(170))
    end = Pose(np.ones(3), 4.0, heading=np.deg2rad(-170))
    for share, pose in ((0, start), (1, end)):
        there = poses.between(start, end, share)
        assert there.position == pytest.approx(pose.position)
        assert there.forward == pytest.approx(pose.forward)
    middle = poses.between(start, end, 0.5)
    assert middle.forward[1] < -0.5
    assert middle.distance == pytest.approx(2)


# Picking


def pick_twin(xyz, projection, cursor):
    """Rows within reach of the cursor, in plain numpy."""
    pixels, _ = projection.to_screen(xyz)
    away = np.linalg.norm(pixels - cursor, axis=1)
    return np.flatnonzero(away <= PICK_RADIUS_PX)


def test_that_the_kernel_finds_the_same_points_as_its_plain_twin(pose, rng):
    xyz = pose.focus + rng.uniform(-1, 1, (5000, 3))
    xyz[:200] = pose.position - rng.uniform(0, 1, (200, 1)) * pose.forward  # behind
    projection = projection_of(pose)
    for cursor in rng.uniform(0, SIZE, (20, 2)):
        rows, depths, distances = points_near(xyz, projection, cursor, PICK_RADIUS_PX)
        assert rows.tolist() == pick_twin(xyz, projection, cursor).tolist()
        pixels, depth = projection.to_screen(xyz[rows])
        assert depths == pytest.approx(depth)
        assert distances == pytest.approx(np.linalg.norm(pixels - cursor, axis=1))


def test_that_the_kernel_runs_the_same_compiled_and_plain(pose, rng):
    xyz = pose.focus + rng.uniform(-0.1, 0.1, (2000, 3))
    args = xyz, projection_of(pose), (400.0, 300.0), 80.0
    compiled, plain = points_near(*args), points_near(*args, kernel=_find_near)
    assert len(plain[0]) > 1024  # more than there is room for at first
    for fast, slow in zip(compiled, plain, strict=True):
        assert fast == pytest.approx(slow)


def test_that_the_front_surface_is_picked_and_on_it_the_nearest_to_the_cursor(pose, rng):
    front = pose.focus - 0.3 * pose.forward
    back = pose.focus + 0.3 * pose.forward
    projection = projection_of(pose)
    pixel = projection.pixel_size(pose.distance - 0.3)
    xyz = np.stack(
        [back, front + 3 * pixel * pose.right, front + 2 * pixel * pose.up + pixel * pose.forward]
    )
    assert pick_point([xyz], projection, (400.0, 300.0)) == 2
    assert pick_point([xyz[:1]], projection, (400.0, 300.0)) == 0
    assert pick_point([xyz], projection, (400.0, 300.0 + 2 * PICK_RADIUS_PX)) == -1


# Aiming


def scene_state(selection):
    return resolve(Document(scans=(Scan("a", CLOUD, RESULT),), selection=selection)).scene


OVERVIEW = poses.framing(Pose(np.zeros(3), 1.0), CLOUD.xyz.astype(float), ASPECT)


@pytest.mark.parametrize("element", RESULT.elements, ids=lambda e: e.label)
def test_that_a_selected_element_is_all_in_view(element):
    selection = Selection(element.run_id, element.element_id)
    pose = aim(scene_state(selection), OVERVIEW, ASPECT, stay_if_seen=False)
    points = CLOUD.xyz[RESULT.element_id == element.element_id].astype(float)
    pixels, _ = projection_of(pose).to_screen(points)
    assert (pixels >= 0).all()
    assert (pixels <= SIZE).all()


@pytest.mark.parametrize("deformation", RESULT.deformations, ids=lambda d: str(d.kind))
def test_that_a_deformation_is_looked_at_from_outside(deformation):
    element = RESULT.element(deformation.element_id)
    selection = Selection(element.run_id, element.element_id, deformation.deformation_id)
    pose = aim(scene_state(selection), OVERVIEW, ASPECT, stay_if_seen=False)
    outward = deformation.peak - element.axis.at(deformation.chainage)
    assert outward @ pose.forward < 0
    pixels, _ = projection_of(pose).to_screen(deformation.peak)
    assert np.abs(pixels[0] - (400, 300)).max() < 150


def test_that_a_profile_is_in_the_middle_and_seen_as_an_ellipse():
    state = scene_state(Selection(1, 2, 0, ProfileKey(0, 30)))
    along = replace(OVERVIEW, heading=0.0, elevation=0.0)  # square to the pipe along X
    pose = aim(state, along, ASPECT, stay_if_seen=False)
    assert pose.focus == pytest.approx(state.profile.centre[0])
    assert abs(pose.forward @ state.profile.normal[0]) > 0.3


def test_that_the_camera_stays_where_a_picked_element_is_seen_well():
    state = scene_state(Selection(1, 2))
    assert aim(state, OVERVIEW, ASPECT, stay_if_seen=True) is None
    away = replace(OVERVIEW, distance=20 * OVERVIEW.distance)
    assert aim(state, away, ASPECT, stay_if_seen=True) is not None


def test_that_nothing_selected_moves_nothing():
    assert aim(scene_state(Selection()), OVERVIEW, ASPECT, stay_if_seen=False) is None


# Shapes


@pytest.mark.parametrize("element", RESULT.elements, ids=lambda e: e.label)
def test_that_a_surface_runs_through_its_points(element):
    mesh = shapes.surfaces((element,)).triangulate()
    points = CLOUD.xyz[RESULT.element_id == element.element_id][:300]
    _, nearest = mesh.find_closest_cell(points, return_closest_point=True)
    off = np.linalg.norm(points - nearest, axis=1)
    assert np.median(off) < 0.004  # noise of 2 mm, and the facets' sagitta


def test_that_ellipses_have_their_axes_and_lie_in_their_plane():
    profiles = RESULT.profiles.of_element(2)
    curves = shapes.ellipses(profiles)
    offset = curves - profiles.centre[:, None, :]
    assert np.abs(np.einsum("mni,mi->mn", offset, profiles.normal)).max() < 1e-9
    reach = np.linalg.norm(offset, axis=2)
    assert reach.max(axis=1) == pytest.approx(profiles.semi_major, rel=1e-6)
    assert reach.min(axis=1) == pytest.approx(profiles.semi_minor, rel=1e-6)


def test_that_many_curves_make_one_mesh():
    profiles = RESULT.profiles.of_element(2, 0)
    assert shapes.ellipse_lines(profiles).n_lines == len(profiles)
    assert shapes.axis_lines(RESULT.elements).n_lines == len(RESULT.elements)


def test_that_the_spacing_of_a_grid_is_found(rng):
    step = 0.007
    x, y = np.meshgrid(np.arange(200) * step, np.arange(200) * step)
    xyz = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]).astype(np.float32)
    assert step <= estimate_spacing(xyz) <= 2.5 * step


# Labels


def test_that_labels_do_not_cover_each_other_nor_leave_the_picture(rng):
    area, size = QRect(0, 0, 800, 600), QSize(120, 24)
    taken: list[QRectF] = []
    for x, y in rng.uniform((0, 0), (800, 600), (25, 2)):
        box = place_box(QPointF(x, y), size, area, taken)
        if box is None:
            continue
        assert QRectF(area).contains(box)
        assert not any(box.intersects(other) for other in taken)
        taken.append(box)
    assert len(taken) > 15


@pytest.mark.parametrize(
    ("metres", "length", "text"),
    [(0.234, 0.2, "200 mm"), (1.0, 1.0, "1 m"), (7.9, 5.0, "5 m"), (0.0021, 0.002, "2 mm")],
)
def test_that_a_scale_bar_has_a_round_length(metres, length, text):
    assert round_length(metres) == pytest.approx(length)
    assert length_text(round_length(metres)) == text
